"""What frozen tables say of finite energy: `frozen_rates.json`, read and interpolated.

For each of PHASES of a cycle the file holds, in the scene's own units, how fast kicks of the walls diffuse,
and, at each of SPEEDS, how far particles near capture lag behind the rest and how much diffusion loses where
the mouth moves; all with standard errors. `python -m conformance.audit.frozen` measures them on tables at
rest. They are even (diffusion, depletion, squares) or odd (lags) in the walls' velocities, so they serve the
reversed cycle too. theory/equations.md derives what is done with them.
"""

from __future__ import annotations

import json
import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mpmath import fp

import scene as scenes
from scene.geometry import table_at
from scene.laws import breakpoints, values
from scene.tables import Mushroom, Scene, laws
from scene.transforms import backwards
from theory.branches import Floats
from theory.volumes import NotCovered, as_mushroom, volumes_at

FILE = Path(__file__).with_name("frozen_rates.json")
N_PHASES = 64
PHASES = (np.arange(N_PHASES) + 0.5) / N_PHASES  # of the period; walls at rest at a knot have no rates there
SPEEDS = np.array([100.0, 200.0, 500.0, 2500.0, 12500.0, 62500.0])
MEMORIES = (4.0, 12.0, 36.0, 108.0, 324.0)  # lengths over which kicks are remembered
TINY = 1e-300
SAME = 1e-9  # relative difference of parameters below which two cycles are one


class Rates(NamedTuple):
    """The rates of a cycle at PHASES.

    They are divided by powers of `pace`, the speed of the walls. This makes them smooth in the phase.

    diffusion: (N, M) variance of the sum of kicks per path length, for each of MEMORIES, over pace^2.
    lag: (N, S) mean lag times v, for particles captured or released at SPEEDS v, over pace; 0 if nu rests.
    square: (N, S) mean square of the same sum of kicks, minus that of diffusion, times v^2, over pace^2.
    depletion: (N, S) change of diffusion by the motion of the mouth, over pace^2; usually negative.
    diffusion_error, lag_error, square_error, depletion_error: their standard errors.
    """

    diffusion: Floats
    lag: Floats
    square: Floats
    depletion: Floats
    diffusion_error: Floats
    lag_error: Floats
    square_error: Floats
    depletion_error: Floats


class RatesAt(NamedTuple):
    """Rates at T times of a cycle.

    pace: (T,) the walls' speed, as `pace` of the measured scene has it.
    diffusion: (T, M) the variance per path length of kicks of each of MEMORIES.
    lag, square, depletion: (T, S) at SPEEDS.
    """

    pace: Floats
    diffusion: Floats
    lag: Floats
    square: Floats
    depletion: Floats


def pace(scene: Scene, times: Floats) -> Floats:
    """Return the root of the sum of squares of all parameters' rates at times (T,), as a scene names them.

    A mouth told as w has another pace than the same mouth told as nu. Rates are over the pace of the scene
    that was measured, so they are to be multiplied by no other: `RatesAt` has it.
    """
    squares = np.array([values(law, times, 1) ** 2 for law in laws(scene).values()])
    return np.asarray(np.sqrt(squares.sum(axis=0)), dtype=np.float64)


def kick_rates(scene: Scene, times: Floats) -> Floats:
    """Return the chaotic zone's mean d log E / dt at times (T,). In Eq:dE the terms in d delta cancel."""
    now, volumes = table_at(fp, scene, times), volumes_at(np, scene, times)
    cap = 2 * np.pi**2 * now.r * now.r_rate
    widening = now.w_rate * now.h + now.w * now.h_rate - now.h * now.h_rate * now.slope
    stem = 2 * np.pi * (2 * widening - now.h**2 * now.slope_rate)
    free = 1 - volumes.v_ell / volumes.v_cap
    found: Floats = -(cap * free + stem) / volumes.v_cha
    return np.broadcast_to(found, times.shape)


def frozen_rates(scene: Scene) -> tuple[Rates, bool]:
    """Return the measured rates of a cycle, and whether they were measured on its reverse.

    Raises:
        NotCovered: there are no rates for the scene or its reverse.
    """
    found = _found(scene)
    return found.rates, found.turned


class _Found(NamedTuple):
    """A measured scene, its rates, and whether it is the reverse of what was sought."""

    measured: Mushroom
    rates: Rates
    turned: bool


def _found(scene: Scene) -> _Found:
    mushroom = as_mushroom(scene)
    for turned in (False, True):
        sought = backwards(mushroom) if turned else mushroom
        for measured, rates in _table().values():
            if _is_one_cycle(measured, sought):
                return _Found(measured, rates, turned)
    known = ", ".join(_table())
    raise NotCovered(
        f"no frozen rates of scene {mushroom.name!r} are known, without which nothing is said of a finite"
        f" energy, only of {known} and their reverses"
    )


def rates_at(scene: Scene, times: Floats) -> RatesAt:
    """Interpolate a cycle's rates.

    Args:
        scene: one of those measured, or the reverse of one.
        times: (T,) any times.

    Raises:
        NotCovered: as `frozen_rates`.
    """
    known = _found(scene)
    rates, spans = known.rates, _spans(known.measured)
    speed = pace(known.measured, -times if known.turned else times)
    phases = (times / known.measured.period) % 1.0
    columns = [rates.diffusion, rates.lag, rates.square, rates.depletion]
    found = _between(np.column_stack(columns), 1 - phases if known.turned else phases, spans)
    diffusion, found = np.split(found, [len(MEMORIES)], axis=1)
    lag, square, depletion = np.split(found, 3, axis=1)
    return RatesAt(
        speed,
        diffusion * speed[:, None] ** 2,
        (-1.0 if known.turned else 1.0) * lag * speed[:, None],
        square * speed[:, None] ** 2,
        depletion * speed[:, None] ** 2,
    )


def table_error(scene: Scene) -> tuple[float, float]:
    """Return relative standard errors of what a whole cycle gathers by diffusion and by lags.

    Phases are weighted by the walls' speed.

    Raises:
        NotCovered: as `frozen_rates`.
    """
    measured, rates, _ = _found(scene)
    speed = pace(measured, PHASES * measured.period)
    spread, lag = rates.diffusion.sum(axis=1) * speed**2, rates.lag.mean(axis=1) * speed
    errors = [rates.diffusion_error.sum(axis=1) * speed**2, rates.lag_error.mean(axis=1) * speed]
    sums = np.abs(spread).sum(), max(float(np.abs(lag).sum()), TINY)
    diffusion, lags = (np.sqrt((e**2).sum()) / s for e, s in zip(errors, sums, strict=True))
    return float(diffusion), float(lags)


def _between(columns: Floats, phase: Floats, spans: Floats) -> Floats:
    """Interpolate linearly within each span on which the laws are analytic; if it is one, round the cycle."""
    found = np.empty((len(phase), columns.shape[1]))
    mine, wanted = (np.searchsorted(spans, x, side="right") for x in (PHASES, phase))
    for k in np.unique(wanted):
        inside, here = mine == k, wanted == k
        period = 1.0 if len(spans) == 0 else None
        for j in range(columns.shape[1]):
            found[here, j] = np.interp(phase[here], PHASES[inside], columns[inside, j], period=period)
    return found


def _spans(scene: Mushroom) -> Floats:
    """Return the phases, in (0, 1), at which a law stops being analytic and its walls rest."""
    length = scene.period
    knots = {float(t) / length % 1.0 for law in laws(scene).values() for t in breakpoints(law)[::2]}
    return np.array(sorted(knots - {0.0}))


def _is_one_cycle(measured: Mushroom, sought: Mushroom) -> bool:
    """Tell whether two scenes move alike, however their laws are written.

    Values and rates at PHASES tell apart all Fourier laws of up to 63 harmonics, more than a product of two
    has. Between two neighbours among the breakpoints of both, bang-bang laws are parabolas, which values and
    rates at both ends tell apart.

    A law written at twice its period (Fourier's with even harmonics only, a bang-bang law's knots told two
    times) has another cycle length, and other units other numbers: these are not known for the same.
    """
    length = sought.period
    if length == 0 or not math.isclose(measured.period, length, rel_tol=SAME):
        return False  # of tables at rest no rates are kept
    both = [*laws(measured).values(), *laws(sought).values()]
    times = np.array([*(length * PHASES), *(float(t) for law in both for t in breakpoints(law))])
    mine, its = table_at(fp, measured, times), table_at(fp, sought, times)
    for name in ("r", "w", "h", "slope"):
        place, rate = getattr(mine, name), getattr(mine, f"{name}_rate")
        its_place, its_rate = getattr(its, name), getattr(its, f"{name}_rate")
        size = np.abs(place).max()
        quickest = max(np.abs(rate).max(), size / length)  # of what rests, rounding may leave a rate
        if np.abs(place - its_place).max() > SAME * size or np.abs(rate - its_rate).max() > SAME * quickest:
            return False
    return True


@lru_cache(maxsize=1)
def _table() -> dict[str, tuple[Mushroom, Rates]]:
    data = json.loads(FILE.read_text("utf-8"))
    found = {}
    for name, entry in data["scenes"].items():
        scene = as_mushroom(scenes.from_data(entry["scene"]))
        found[name] = scene, Rates(*(np.array(entry[field]) for field in Rates._fields))
    return found
