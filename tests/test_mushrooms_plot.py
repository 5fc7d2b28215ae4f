"""Plots of ensembles, what heats fastest, typeset formulas."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from support.refusals import one_line

import fast
import theory
from mushrooms.figures import energies, style
from mushrooms.figures.heating import Loop, fastest, moving_cap, phase_diagram, supremum, switched
from mushrooms.reports.page import as_json, typeset
from scene import BangBang, Mushroom, load


def test_residuals_tell_another_theory():
    """Energies drawn from the theory lie within it; those of the reversed cycle do not."""
    drawn = theory.at_energy(load("moving-cap"), 1e7).draw(1, 20_000, 3)[:, 0]
    pulls = {}
    for name in ("moving-cap", "moving-cap-reversed"):
        figure = energies.histogram(load(name), 1e7, drawn)
        line = figure.axes[1].lines[-1].get_ydata()
        pulls[name] = float(np.sqrt(np.nanmean(np.square(line))))
    assert pulls["moving-cap"] < 1.3
    assert pulls["moving-cap-reversed"] > 5


def labels(axes) -> list[str]:
    return axes.get_legend_handles_labels()[1]


def test_a_scene_without_theory_is_drawn_alone():
    assert energies.known(load("breathing-circle"), 1e4) is None
    figure = energies.histogram(load("breathing-circle"), 1e4, np.linspace(-1e-3, 1e-3, 50), 60)
    [axes] = figure.axes
    assert labels(axes) == ["simulation"]
    assert (axes.patches[0].get_data().values > 0).sum() > 20  # bars as wide as the energies ask for
    assert axes.get_title().endswith("60 particles\n(10 of them never free, or lost: left out)")


OWN = Mushroom(
    r=1.0,
    slope=0.08,
    w=BangBang(((0.0, 0.9), (1.0, 0.9), (2.0, 0.4), (3.0, 0.4), (4.0, 0.9))),
    h=BangBang(((0.0, 0.6), (1.0, 1.5), (2.0, 1.5), (3.0, 0.6), (4.0, 0.6))),
)


def test_the_captured_of_an_own_scene_are_drawn():
    """Their density is that of theory: its area is the captured share."""
    drawn = theory.energies(OWN)
    run = fast.simulate(OWN, n_particles=300, energy=1e6, seed=1)
    [axes] = energies.histogram(OWN, 1e6, np.log(run.energy / 1e6)[run.takes_part()], 300).axes
    captured, free = axes.lines[-2:]
    assert labels(axes) == ["simulation", "theory, captured, at high energies", "theory, never captured"]
    assert np.trapezoid(captured.get_ydata(), captured.get_xdata()) == pytest.approx(1 - drawn.p_nc, rel=0.02)
    assert free.get_xdata()[0] == pytest.approx(drawn.s_nc)


@pytest.mark.parametrize("n_blocks", [1, 3])
def test_growth_shows_means_and_theory_of_each_cycle(n_blocks):
    run = fast.simulate(load("moving-cap"), n_particles=200, energy=1e4, n_cycles=3, seed=2)
    gains = np.log(run.cycle_energies / run.energy0)
    figure = energies.growth(load("moving-cap"), 1e4, iter(np.array_split(gains, n_blocks)))
    left, right = figure.axes
    [mean] = [one for one in left.containers if one.get_label() == "mean"]
    assert mean.lines[0].get_ydata() == pytest.approx([0.0, *gains.mean(axis=0)])
    told = dict(zip(labels(left), left.get_legend_handles_labels()[0], strict=True))
    [line] = [one for name, one in told.items() if name.startswith("theory, m1")]
    assert np.abs(line.get_ydata()[1:] - gains.mean(axis=0)).max() < 4 * gains.std() / 200**0.5
    assert line.get_ydata()[1] == pytest.approx(theory.at_energy(load("moving-cap"), 1e4).mean_s)
    assert any("theory at this energy" in name for name in labels(right))


@pytest.mark.parametrize("picture", [energies.histogram, energies.growth])
def test_a_figure_takes_a_scene_and_not_its_name(picture):
    assert "scene.load('moving-cap')" in one_line(picture, "moving-cap", 1e4, np.zeros(9))
    for gains, words in (
        (np.zeros(1), "gains: 1 particles"),
        ([0.0, np.nan, np.inf], "gains: 1 particles"),
        ("moving-cap", "gains = 'moving-cap'"),
        (1.0, "gains = 1.0"),
        (None, "gains = None"),
    ):
        assert one_line(picture, load("moving-cap"), 1e4, gains).startswith(words)
    assert one_line(picture, load("moving-cap"), -1.0, np.zeros(9)).startswith("energy = -1.0")


@pytest.mark.parametrize(
    ("number", "text"), [(50.0, "50"), (2500.0, "2500"), (1e5, "$10^{5}$"), (2.5e-7, r"$2.5\cdot10^{-7}$")]
)
def test_energies_are_written_as_powers(number, text):
    assert style.power(number) == text


PAGE = Path(__file__).parent.parent / "docs" / "heating.md"


def as_scene(loop: Loop) -> Mushroom:
    """Return an upright mushroom that runs a loop in four legs."""
    w = BangBang(tuple(zip(QUARTERS, (loop.w1, loop.w0, loop.w0, loop.w1, loop.w1), strict=True)))
    depths = (loop.closing, loop.closing, loop.opening, loop.opening, loop.closing)
    return Mushroom(r=1.0, h=BangBang(tuple(zip(QUARTERS, depths, strict=True))), w=w)


QUARTERS = (0.0, 0.25, 0.5, 0.75, 1.0)
DIRECTIONS = [(Loop(6.0, 2.0, 0.3), Loop(2.0, 6.0, 0.3)), (Loop(6.0, 0.1, 0.02), Loop(0.1, 6.0, 0.02))]


@pytest.mark.parametrize("loop", [*itertools.chain(*DIRECTIONS), Loop(1.0, 3.0, 0.5, 0.9)])
def test_a_loop_in_floats_is_the_theory_of_its_scene(loop):
    assert loop.m1 == pytest.approx(float(theory.predict(as_scene(loop), 8).m1), rel=2e-5)


def test_a_switched_loop_in_floats_is_the_theory_of_its_scene():
    eighths = [k / 8 for k in range(9)]
    w = (1.0, 0.1, 0.1, 0.02, 0.02, 0.1, 0.1, 1.0, 1.0)
    h = (6.0, 6.0, 0.1, 0.1, 6.0, 6.0, 0.1, 0.1, 6.0)
    depth, mouth = (BangBang(tuple(zip(eighths, values, strict=True))) for values in (h, w))
    found = float(theory.predict(Mushroom(r=1.0, h=depth, w=mouth), 8).m1)
    assert switched(0.1, 6.0, 0.02, 0.1) == pytest.approx(found, rel=2e-5)


def largest_gain(shallowest: float, deepest: float, narrowest: float, n: int = 6000) -> float:
    """Return the largest m1 of all loops: dV = max(b - a - a log(b / a) - a V) |d delta|, narrow to wide."""
    edges = np.geomspace(narrowest, 1.0, n + 1)
    deltas = theory.delta(np, edges)
    middles = np.sqrt(edges[1:] * edges[:-1])
    zones = 1 - theory.delta(np, middles) + 4 / np.pi * middles * np.linspace(shallowest, deepest, 5)[:, None]
    a, b = 1 / zones[:, None], 1 / zones[None, :]
    gain = b - a - a * np.log(b / a)
    found = 0.0
    for k in range(n):
        found += float(np.max(gain[..., k] - a[..., k] * found)) * (deltas[k] - deltas[k + 1])
    return found


@pytest.mark.parametrize("bounds", [(2.0, 6.0, 0.3), (0.1, 6.0, 0.02), (0.0, 20.0, 0.3), (0.1, 20.0, 0.02)])
def test_no_loop_within_bounds_gains_more_than_the_supremum(bounds):
    shallowest, deepest, narrowest = bounds
    found, switch = supremum(*bounds)
    assert found == pytest.approx(largest_gain(*bounds), rel=2e-4)
    assert narrowest < switch <= 1
    ends = Loop(deepest, shallowest, narrowest).m1, Loop(shallowest, deepest, narrowest).m1
    assert found >= max(ends) * (1 - 1e-9)
    assert (ends[1] > ends[0]) == (narrowest == 0.3)  # clockwise wins only if the mouth stays wide


def test_clockwise_has_no_bound_in_depth_anticlockwise_none_only_if_the_mouth_closes_too():
    limit = -math.log(1 - float(theory.delta(np, 0.1)))
    assert Loop(1e7, 0.0, 0.1).m1 == pytest.approx(limit, rel=1e-4)
    first, second = Loop(0.0, 1e7, 0.1), Loop(0.0, 1e9, 0.1)
    assert second.m1 - first.m1 == pytest.approx((1 - first.free_share) * math.log(100), rel=1e-5)
    shut = [supremum(2.0, 6.0, w)[0] for w in (1e-4, 1e-9, 1e-15, 1e-30)]
    assert shut == sorted(shut)
    assert shut[3] == pytest.approx(shut[2], rel=1e-2)


@pytest.mark.parametrize("clockwise", [False, True])
def test_the_fastest_loop_is_not_beaten_by_its_neighbours(clockwise):
    best, rate = fastest(0.02, 0.1, clockwise=clockwise)
    assert rate == pytest.approx(best.m1 / best.path)
    assert (best.closing < best.opening) == clockwise
    for h1, w0 in itertools.product((0.9, 1.0, 1.1), (1.0, 1.2)):
        depths = [h if h == 0.1 else h * h1 for h in best[:2]]
        near = Loop(*depths, 0.02 * w0)
        assert near.m1 / near.path <= rate * (1 + 1e-6)


def test_the_moving_cap_is_trivial_in_phase_and_gains_with_the_square_of_the_amplitude():
    found = phase_diagram(np.array([0.0, math.pi / 2, math.pi]), np.array([0.1, 0.2]))
    assert np.abs(found[:, 0]).max() < 1e-12
    assert found[1, 2] / found[0, 2] == pytest.approx(4, rel=0.05)
    assert (found[:, 2] > found[:, 1]).all()
    assert theory.predict(moving_cap(4.0, 0.6, 0.6), 6).m1 > 0


def test_the_page_says_what_the_code_finds():
    lines = [line for line in PAGE.read_text("utf-8").splitlines() if re.match(r"\| [\d.]+ \|", line)]
    numbers = [list(map(float, re.findall(r"[\d.]+", line))) for line in lines]
    loops, rates = ([row for row in numbers if len(row) == n] for n in (7, 6))
    assert (len(loops), len(rates)) == (4, 3)
    for h0, h1, w0, anticlockwise, clockwise, largest, switch in loops:
        assert Loop(h1, h0, w0).m1 == pytest.approx(anticlockwise, abs=6e-5)
        assert Loop(h0, h1, w0).m1 == pytest.approx(clockwise, abs=6e-5)
        assert supremum(h0, h1, w0) == (pytest.approx(largest, abs=6e-5), pytest.approx(switch, abs=6e-4))
    for h0, w0, *columns in rates:
        for clockwise, h1, rate in ((False, *columns[:2]), (True, *columns[2:])):
            best, found = fastest(w0, h0, clockwise=clockwise)
            assert (max(best[:2]), best.w0) == (pytest.approx(h1, abs=6e-3), pytest.approx(w0, rel=1e-3))
            assert found == pytest.approx(rate, abs=6e-6)


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("p_nc", "<i>p</i><sub>nc</sub>"),
        ("E0^(-1/4)", "<i>E</i><sub>0</sub><sup>−1/4</sup>"),
        ("dV_ell / V_cha", "<i>dV</i><sub>ell</sub> / <i>V</i><sub>cha</sub>"),
        ("log E1/E0", "log <i>E</i><sub>1</sub>/<i>E</i><sub>0</sub>"),
        ("sigma_w <= 10^-25", "<i>σ</i><sub>w</sub> ≤ 10<sup>−25</sup>"),
        ("x^2 + y^2", "x<sup>2</sup> + y<sup>2</sup>"),
        ("nu(t)", "<i>ν</i>(t)"),
        ("<script>a_b</script>", "&lt;script&gt;<i>a</i><sub>b</sub>&lt;/script&gt;"),
        *((prose, prose) for prose in ("M1 and X2, see L7", "theory/equations.md", "sec. 4.1", "numbers")),
        *((prose, prose) for prose in ("minus 3 sd at n = 30", "moving-cap@1e7")),
    ],
)
def test_formulas_are_typeset_prose_is_left_alone_and_markup_escaped(text, html):
    assert typeset(text) == html


def test_scenes_are_written_as_a_reader_sees_them():
    assert as_json({"notes": "the captions' nu, größer"}) == '{"notes": "the captions\' nu, größer"}'
