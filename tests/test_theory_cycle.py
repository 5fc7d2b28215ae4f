"""Secs. 3.2 and 3.5: where nu falls and rises, capture and release times, refusals."""

from __future__ import annotations

import importlib
import re
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpmath import MPContext
from support.depth import deep_but

from scene import BangBang, Fourier, Mushroom, load
from scene.laws import value
from scene.transforms import scaled
from theory import Cycle
from theory.critical import solve_rising, spans
from theory.cycle import MovingMushroom


def test_moving_cap_releases_at_two_pi_minus_t() -> None:
    cycle = Cycle.of(load("moving-cap"), 30)
    ctx = cycle.ctx
    assert cycle.start == 0
    assert (cycle.nu_max, float(cycle.nu_min)) == (1, pytest.approx(0.2))
    for t in ("0.01", "1.3", "3.1"):
        assert abs(cycle.release_time(ctx.mpf(t)) - (2 * ctx.pi - ctx.mpf(t))) < ctx.mpf(10) ** -40
        later = ctx.mpf(t) + 6 * ctx.pi
        assert abs(cycle.release_time(later) - (8 * ctx.pi - ctx.mpf(t))) < ctx.mpf(10) ** -40
        nu = ctx.mpf(0.6) + ctx.mpf(0.4) * ctx.cos(ctx.mpf(t))
        assert abs(cycle.t_in(nu) - ctx.mpf(t)) < ctx.mpf(10) ** -40
        assert abs(cycle.t_out(nu) - cycle.release_time(ctx.mpf(t))) < ctx.mpf(10) ** -40


def test_degenerate_turns_are_found_with_their_orders() -> None:
    # nu' ~ -sin t (1 + cos t): quartic minimum. nu' ~ -sin t (1 + cos 2t): cubic inflections.
    for cos, orders in (([0.25, 0.0625], [4, 2]), ([0.28125, 0.0, 0.09375], [3, 2, 3, 2])):
        law = Fourier(mean=0.5, omega=1.0, cos=tuple(cos))
        ctx = MPContext()
        found = spans(ctx, Mushroom(r=1.0, h=1.0, nu=law))
        assert sorted(s.start_order for s in found) == sorted(orders)


@pytest.mark.parametrize("shift", [0.0, 1.0, -2.5, 3.0])
def test_a_shift_in_time_shifts_the_start(shift: float) -> None:
    # cos(t - shift), so the fall starts at the shift, taken into [0, 2 pi).
    ctx = MPContext()
    ctx.dps = 30
    law = Fourier(mean=0.5, omega=1.0, cos=(float(ctx.cos(shift)) / 4,), sin=(float(ctx.sin(shift)) / 4,))
    cycle = Cycle.of(Mushroom(r=1.0, h=1.0, nu=law), 15)
    assert float(cycle.start) == pytest.approx(shift % float(2 * ctx.pi), abs=1e-12)
    assert 0 <= cycle.start < cycle.period


@pytest.mark.parametrize("wave", deep_but([(3, -4), (-3, 4), (-3, -4)], (3, -4)))
def test_a_mouth_that_opens_fully_at_no_round_time(wave: tuple[int, int]) -> None:
    cos, sin = wave
    # w = r (m + c cos t + s sin t), r = 1 + sin t / 2, exact in binary64: w / r touches 1, and rounding
    # carries it above at some digits.
    c, s, m = cos / 32, sin / 32, 1 - 5 / 32
    w = Fourier(mean=m + s / 4, omega=1.0, cos=(c, -s / 4), sin=(s + m / 2, c / 4))
    scene = Mushroom(r=Fourier(mean=1.0, omega=1.0, sin=(0.5,)), h=1.0, w=w)
    for digits in range(5, 25):
        cycle = Cycle.of(scene, digits)
        assert cycle.nu_max == 1
        whole = cycle.t_out(cycle.nu_max) - cycle.t_in(cycle.nu_max)
        assert abs(whole - cycle.period) < cycle.ctx.mpf(10) ** -(digits + 35)


@pytest.mark.parametrize("length", [0, -600])
def test_width_over_radius_is_the_same_cycle_as_nu(length: int) -> None:
    """In small units too, where the square of the radius is no float."""
    # (1/2 + cos t / 4) (1 + sin t / 2), exact in binary64.
    r = Fourier(mean=1.0, omega=1.0, sin=(0.5,))
    w = Fourier(mean=0.5, omega=1.0, cos=(0.25,), sin=(0.25, 0.0625))
    by_w = Cycle.of(scaled(Mushroom(r=r, h=1.0, w=w), length, 0), 20)
    by_nu = Cycle.of(Mushroom(r=r, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.25,))), 20)
    ctx = by_w.ctx
    for nu in ("0.3", "0.5", "0.7"):
        assert abs(by_w.t_in(ctx.mpf(nu)) - by_nu.t_in(ctx.mpf(nu))) < ctx.mpf(10) ** -45
        assert abs(by_w.t_out(ctx.mpf(nu)) - by_nu.t_out(ctx.mpf(nu))) < ctx.mpf(10) ** -45


def test_bang_bang_width_and_radius_turn_between_knots() -> None:
    # w and r both move in the leg [0, 1]; dense sampling finds the same extremes.
    w = BangBang(knots=((0.0, 0.5), (1.0, 0.75), (3.0, 0.5)))
    r = BangBang(knots=((0.0, 1.0), (2.0, 1.5), (3.0, 1.0)))
    cycle = Cycle.of(Mushroom(r=r, h=1.0, w=w), 15)
    motion = [s.motion for p in cycle.pieces for s in (p.capture, p.release)]
    assert motion
    sampled = [value(cycle.ctx, w, k / 512) / value(cycle.ctx, r, k / 512) for k in range(1536)]
    assert max(sampled) <= cycle.nu_max < max(sampled) + 1e-4
    assert min(sampled) - 1e-4 < cycle.nu_min <= min(sampled)


HARMONICS = Fourier(mean=0.5, omega=1.7, cos=(0.1, 0.0, 0.05, 0.0, 0.01), sin=(0.0, 0.02, 0.0, 0.03))


@pytest.mark.parametrize(
    "scene", [load("moving-cap"), load("fixed-cap-clockwise"), Mushroom(r=1.0, h=1.0, nu=HARMONICS)]
)
def test_motion_is_the_laws_of_the_scene(scene: Mushroom) -> None:
    ctx = MPContext()
    ctx.dps = 40
    for t in (Fraction(1, 32), Fraction(5, 16), Fraction(15, 8)):
        motion, at = MovingMushroom(ctx, scene, t), ctx.mpf(t.numerator) / t.denominator
        nu, rate = motion.nu(at)
        width = scene.nu if scene.nu is not None else scene.w  # r = 1 where w is given
        assert width is not None
        assert abs(nu - value(ctx, width, at)) < ctx.mpf(10) ** -38
        assert abs(rate - value(ctx, width, at, 1)) < ctx.mpf(10) ** -38
        r, h, slope = (value(ctx, law, at) for law in (scene.r, scene.h, scene.slope))
        binary, share = motion.binary, 2 * (2 * nu * r * h - h * h * slope) / (ctx.pi * r * r)
        with binary.working():
            found = binary.given(motion.stem_share(binary.taken(at), binary.taken(nu)))
        assert abs(found - share) < ctx.mpf(10) ** -37


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise", "retraced-arc"])
@pytest.mark.parametrize("digits", [15, 200])
def test_times_of_capture_and_release_have_the_mouth_asked_for_to_all_digits(name: str, digits: int) -> None:
    """Parabolas are inverted in closed form, waves from a solution in binary64."""
    cycle = Cycle.of(load(name), digits)
    for piece in cycle.pieces:
        for stretch in (piece.capture, piece.release):
            for share in (0.01, 0.5, 0.99):
                nu = piece.nu_lower + (piece.nu_upper - piece.nu_lower) * cycle.ctx.mpf(share)
                t = stretch.time(nu)
                assert min(stretch.lower, stretch.upper) < t < max(stretch.lower, stretch.upper)
                assert abs(stretch.motion.nu(t)[0] - nu) < cycle.ctx.mpf(10) ** (2 - cycle.ctx.dps)


@pytest.mark.parametrize("size", [1.0, 1e-30, 1e-290])
@pytest.mark.parametrize("digits", [15, 60, 300])
def test_waves_are_summed_to_their_last_bits(size: float, digits: int) -> None:
    """However small the waves: rates are right relatively to them, where one of them alone is seen."""
    draw = np.random.default_rng(digits)
    cos, sin = (
        tuple((size * draw.uniform(-1, 1, 16) * 10.0 ** -draw.integers(0, 9, 16)).tolist()) for _ in "ab"
    )
    law = Fourier(mean=0.5, omega=1.7, cos=tuple(0.03 * c for c in cos), sin=tuple(0.03 * s for s in sin))
    ctx, finer = MPContext(), MPContext()
    ctx.dps, finer.dps = digits, digits + 400
    motion = MovingMushroom(ctx, Mushroom(r=1.0, h=1.0, nu=law), Fraction(0))
    for t in draw.uniform(0, 3, 5).tolist():
        nu, rate = (finer.mpf(x) for x in motion.nu(ctx.mpf(t)))
        assert abs(nu - value(finer, law, finer.mpf(t))) < finer.mpf(10) ** -(digits - 1)
        assert abs(rate - value(finer, law, finer.mpf(t), 1)) < size * finer.mpf(10) ** -(digits - 2)


def test_a_root_costs_a_handful_of_evaluations() -> None:
    # At convergence the iterate is itself an end of the bracket: no reason to fall back on bisection.
    ctx = MPContext()
    ctx.dps = 50
    for k in range(-59, 60):
        asked: list[Any] = []

        def rising(x: Any, k: int = k, asked: list[Any] = asked) -> tuple[Any, Any]:
            asked.append(x)
            return -ctx.cos(x) - ctx.mpf(k) / 60, ctx.sin(x)

        root = solve_rising(ctx, rising, ctx.zero, +ctx.pi)
        assert abs(root - ctx.acos(ctx.mpf(-k) / 60)) < ctx.mpf(10) ** -47
        assert len(asked) <= 12


def test_a_root_is_found_where_newton_alone_runs_away() -> None:
    ctx = MPContext()
    ctx.dps = 30
    root = solve_rising(ctx, lambda x: (ctx.atan(50 * x - 3), 50 / (1 + (50 * x - 3) ** 2)), -10, ctx.mpf(90))
    assert abs(root - ctx.mpf(3) / 50) < ctx.mpf(10) ** -29


def test_the_table_of_equations_names_what_exists() -> None:
    tests = Path(__file__).parent
    table = (tests.parent / "theory" / "equations.md").read_text("utf-8")
    written = "".join(file.read_text("utf-8") for file in tests.glob("test_*.py"))
    functions, cases = re.findall(r"`(\w+)\.(\w+)`", table), re.findall(r"`(test_\w+)`", table)
    assert len(functions) > 15
    for module, function in functions:
        room = "" if find_spec(f"theory.{module}") else "finite_energy."
        assert hasattr(importlib.import_module(f"theory.{room}{module}"), function), f"{module}.{function}"
    for case in cases:
        assert f"def {case}(" in written, case
