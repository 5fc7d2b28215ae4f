"""What frozen tables say of finite energy, read from `frozen_rates.json` and followed through a cycle.

For each of PHASES of a cycle the file holds, in the scene's own units, how fast kicks of the walls diffuse,
and, at each of SPEEDS, how far particles near capture lag behind the rest and how much diffusion loses where
the mouth moves; all with standard errors. `python -m mushrooms.audit.frozen` measures them on tables at
rest. They are even (diffusion, depletion, squares) or odd (lags) in the walls' velocities, so they serve the
reversed cycle too. theory/equations.md derives what is done with them.

`Fields` follows a cycle in time, for particles of one initial energy: what the chaotic zone gathers, and who
lags behind. Rates are joined with the adiabatic theory's energies and hazards. Particles that were captured
have other speeds, so lags and sums are functions of their gain over the uncaptured too.
"""

from __future__ import annotations

import json
import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mpmath import fp
from numpy.typing import NDArray

import scene as scenes
from scene.geometry import table_at
from scene.mouth import start_time
from scene.tables import Scene
from scene.transforms import backwards
from theory.branches import Floats, solve_cycle, zone_of
from theory.prepared import NotCovered, PreparedMushroom, prepare
from theory.volumes import delta_slope, volumes_of

FILE = Path(__file__).with_name("frozen_rates.json")
N_PHASES = 64
PHASES = (np.arange(N_PHASES) + 0.5) / N_PHASES  # of the period; walls at rest at a knot have no rates there
SPEEDS = np.array([100.0, 200.0, 500.0, 2500.0, 12500.0, 62500.0])
MEMORIES = (4.0, 12.0, 36.0, 108.0, 324.0)  # lengths over which kicks are remembered
TINY = 1e-300
SAME = 1e-9  # relative difference of parameters below which two cycles are one
N_TIMES = 1024  # steps of a cycle, the midpoint rule's
GAINS = np.linspace(-4.0, 4.0, 17)  # in log E, at which lags are integrated
NUDGE = 1e-3  # in log E, for a derivative
ROUNDING = 1e-9

Flags = NDArray[np.bool_]


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

    diffusion: (T, M) the variance per path length of kicks of each of MEMORIES.
    lag, square, depletion: (T, S) at SPEEDS.
    """

    diffusion: Floats
    lag: Floats
    square: Floats
    depletion: Floats


def pace(scene: Scene, times: Floats | float) -> Floats:
    """Return the root of the sum of squares of all parameters' rates at times of any shape, as named.

    A mouth told as w has another pace than the same mouth told as nu. Rates are over the pace of the scene
    that was measured, so they are to be multiplied by no other.
    """
    squares = np.array([law.values(np.asarray(times), 1) ** 2 for law in scene.laws.values()])
    return np.asarray(np.sqrt(squares.sum(axis=0)), dtype=np.float64)


def kick_rates(scene: Scene, times: Floats | float) -> Floats:
    """Return the chaotic zone's mean d log E / dt at times. In Eq:dE the terms in d delta cancel."""
    return kick_rates_of(prepare(scene), np.asarray(times, dtype=np.float64))


def kick_rates_of(mushroom: PreparedMushroom, times: Floats) -> Floats:
    """Return the `kick_rates` of a mushroom that is prepared."""
    now = table_at(fp, mushroom.given, times)
    volumes = volumes_of(np, mushroom, times)
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
    _, rates, turned = find_rates(prepare(scene))
    return rates, turned


class MeasuredRates(NamedTuple):
    """A mushroom that was measured, its rates, and whether it is the reverse of what is sought."""

    mushroom: PreparedMushroom
    rates: Rates
    is_reverse: bool


@lru_cache(maxsize=256)
def find_rates(mushroom: PreparedMushroom) -> MeasuredRates:
    """Find the rates of a cycle or of its reverse.

    Raises:
        NotCovered: as `frozen_rates`.
    """
    for is_reverse in (False, True):
        sought = prepare(backwards(mushroom.given)) if is_reverse else mushroom
        for measured, rates in _table().values():
            if _is_one_cycle(measured, sought):
                return MeasuredRates(measured, rates, is_reverse)
    known = ", ".join(_table())
    raise NotCovered(
        f"no frozen rates of scene {mushroom.given.name!r} are known, without which nothing is said"
        f" of a finite energy, only of {known} and their reverses"
    )


def rates_at(known: MeasuredRates, times: Floats) -> RatesAt:
    """Interpolate a cycle's rates at times (T,), whichever."""
    measured, rates, turned = known
    speed = pace(measured.given, -times if turned else times)
    phases = (times / measured.period) % 1.0
    columns = [rates.diffusion, rates.lag, rates.square, rates.depletion]
    found = _between(np.column_stack(columns), 1 - phases if turned else phases, _spans(measured))
    diffusion, found = np.split(found, [len(MEMORIES)], axis=1)
    lag, square, depletion = np.split(found, 3, axis=1)
    return RatesAt(
        diffusion * speed[:, None] ** 2,
        (-1.0 if turned else 1.0) * lag * speed[:, None],
        square * speed[:, None] ** 2,
        depletion * speed[:, None] ** 2,
    )


def table_error(known: MeasuredRates) -> tuple[float, float]:
    """Return relative standard errors of what a whole cycle gathers by diffusion and by lags.

    Phases are weighted by the walls' speed.
    """
    measured, rates, _ = known
    speed = pace(measured.given, PHASES * measured.period)
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


def _spans(measured: PreparedMushroom) -> Floats:
    """Return the phases, in (0, 1), of knots; those of the scenes measured are bang-bang laws', at rest."""
    length = measured.period
    laws = measured.laws.values()
    knots = {float(t) / length % 1.0 for law in laws for t in law.breakpoints()[::2]}
    return np.array(sorted(knots - {0.0}))


def _is_one_cycle(measured: PreparedMushroom, sought: PreparedMushroom) -> bool:
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
    times = np.array([*(length * PHASES), *measured.breakpoints, *sought.breakpoints])
    mine = table_at(fp, measured.given, times)
    its = table_at(fp, sought.given, times)
    for name in ("r", "w", "h", "slope"):
        place, rate = getattr(mine, name), getattr(mine, f"{name}_rate")
        its_place, its_rate = getattr(its, name), getattr(its, f"{name}_rate")
        size = np.abs(place).max()
        quickest = max(np.abs(rate).max(), size / length)  # of what rests, rounding may leave a rate
        if np.abs(place - its_place).max() > SAME * size or np.abs(rate - its_rate).max() > SAME * quickest:
            return False
    return True


@lru_cache(maxsize=1)
def _table() -> dict[str, tuple[PreparedMushroom, Rates]]:
    data = json.loads(FILE.read_text("utf-8"))
    found = {}
    for name, entry in data["scenes"].items():
        scene = prepare(scenes.from_data(entry["scene"]))
        found[name] = scene, Rates(*(np.array(entry[field]) for field in Rates._fields))
    return found


class CycleCoefficients(NamedTuple):
    """A cycle at T times, midpoints of equal steps from its start.

    start, step: of time.
    log_energy: (T,) of the uncaptured, over its value at the start (Eq:dE).
    hazard: (T,) of capture per time, where nu rises that of the reversed cycle (Eq:dps/ps).
    is_capture: (T,) whether nu falls.
    shear: (T,) rate at which walls turn velocities: that of log tan of their angle [1 / time].
    crossing: (T,) mean path down the table and up again, directions uniform [length].
    rates: from frozen tables.
    """

    start: float
    step: float
    log_energy: Floats
    hazard: Floats
    is_capture: Flags
    shear: Floats
    crossing: Floats
    rates: RatesAt


@lru_cache(maxsize=16)
def cycle_coefficients(mushroom: PreparedMushroom) -> CycleCoefficients:
    """Follow a cycle whose frozen rates are known.

    Raises:
        NotCovered: they are not.
    """
    known = find_rates(mushroom)
    start = _clock_start(mushroom)
    step = mushroom.period / N_TIMES
    times: Floats = np.asarray(start + step * (np.arange(N_TIMES) + 0.5), dtype=np.float64)
    now = table_at(fp, mushroom.given, times)
    volumes = volumes_of(np, mushroom, times)
    rates = rates_at(known, times)
    nu_rate = (now.w_rate * now.r - now.w * now.r_rate) / now.r**2
    flux = delta_slope(np, volumes.nu) * volumes.v_cap / volumes.v_cha
    begun = zone_of(mushroom, np.array([start])).log_energy[0]
    log_energy = zone_of(mushroom, times).log_energy - begun
    # v_x w and v_y (h + r) are adiabatic; the mean of |v_y| is 2 v / pi.
    height, rising = now.h + now.r, now.h_rate + now.r_rate
    shear, crossing = (
        np.broadcast_to(x, times.shape) for x in (now.w_rate / now.w - rising / height, np.pi * height)
    )
    hazard = np.abs(flux * nu_rate)
    return CycleCoefficients(start, step, log_energy, hazard, nu_rate < 0, shear, crossing, rates)


def _clock_start(mushroom: PreparedMushroom) -> float:
    """Return when an ensemble's cycle begins: at a bang-bang law's first knot, else at 0; or cycles later.

    Raises:
        NotCovered: some particles are in the island then that leave it later.
    """
    length = mushroom.period
    root, opening, _ = solve_cycle(mushroom)
    start = start_time(mushroom.given)
    start += length * float(np.floor((opening - start) / length + ROUNDING))
    last = max((float(branch.ends[2].max()) for branch in root.all_branches()), default=start)
    if last > start + length * (1 + ROUNDING):
        raise NotCovered("the cycle must begin with its mouth at the widest: captures before it are unknown")
    return start


class Fields:
    """Functions of time and of a particle's gain over the uncaptured, in log E.

    lag, square: mean of what the captured and released lag by, and of its square less diffusion's.
    likelier: by how much, relatively, capture is likelier.
    variance: gathered by diffusion since the cycle's start.
    drift: of log E, beyond the quarter of the variance that belongs to one that falls as E^(-1/2).
    lags, squares, hazards: sums of hazard times `lag`, `square` and, while nu falls, `likelier`.

    Args:
        cycle: from `cycle_coefficients`.
        energy: of the ensemble when the cycle begins.

    Attributes, of the uncaptured, weighted by diffusion:
        forgotten: share of the variance without `shear` that it takes off.
        depleted: share of diffusion that depletion takes off.
        turned: share of the variance that walls take off by turning velocities within a `crossing`.
        is_known: whether their speeds are among those for which rates were measured.
        n_blocks: of path, each twice as long as the memory, in a cycle.
    """

    def __init__(self, cycle: CycleCoefficients, energy: float) -> None:
        self._start, self._step = cycle.start, cycle.step
        speed = np.sqrt(2 * energy) * np.exp((cycle.log_energy + GAINS[:, None]) / 2)
        faster, rates = speed * np.exp(NUDGE / 2), cycle.rates
        lag = _at_speeds(rates.lag, speed) / speed
        # Phase volume is kept: particles that lag by J(E) are captured likelier by J + dJ / d log E.
        likelier = lag + (_at_speeds(rates.lag, faster) / faster - lag) / NUDGE
        square = _at_speeds(rates.square, speed) / speed**2
        left = 1 + _at_speeds(rates.depletion, speed) / rates.diffusion.sum(axis=1)
        diffusion = np.maximum(left, 0.0)[None] * rates.diffusion.T[:, None]
        # What kicks remember is a direction: walls that turn it the other way kick with the other sign.
        kicks, turning = np.sign(cycle.shear) * np.sqrt(diffusion / speed), np.abs(cycle.shear)
        remembered = self._remembered(kicks, speed, turning).sum(axis=0)
        # Of 1 - x only the first order is known: 1 / (1 + x) has it, and stays positive.
        turned = (remembered * (turning * cycle.crossing / speed) ** 2).sum(axis=1) / remembered.sum(axis=1)
        spread = remembered / (1 + turned)[:, None]
        slower = np.exp(-GAINS[:, None] / 2)
        self._values = {
            "lag": lag,
            "square": square,
            "likelier": likelier,
            "variance": self._gathered(spread),
            "drift": self._gathered(np.gradient(spread / slower, GAINS, axis=0) * slower / 2),
            "lags": self._gathered(cycle.hazard * lag),
            "squares": self._gathered(cycle.hazard * square),
            "hazards": self._gathered(cycle.hazard * cycle.is_capture * likelier),
        }
        uncaptured = len(GAINS) // 2
        share = spread[uncaptured] / spread[uncaptured].sum()
        memory = rates.diffusion @ np.array(MEMORIES) / rates.diffusion.sum(axis=1)
        steady = self._remembered(kicks, speed, np.zeros(N_TIMES))[:, uncaptured]
        self.depleted = 1 - float(share @ left[uncaptured])
        self.turned = 1 - float(1 / (1 + turned[uncaptured]))
        self.forgotten = 1 - float(remembered[uncaptured].sum() / steady.sum())
        self.is_known = bool(speed[uncaptured].min() >= SPEEDS[0])
        self.n_blocks = float(speed[uncaptured].sum() * self._step / (2 * (share @ memory)))

    def _remembered(self, kicks: Floats, speed: Floats, turning: Floats) -> Floats:
        """Return the growth of variance per time by kicks of each of MEMORIES: (M, G, T).

        Of kicks of the size a: a times the mean of a over the path so far, weighted by the correlations
        exp(-l / m). Walls that turn velocities, at a rate (T,) in time, end them sooner.
        """
        fading = speed / np.array(MEMORIES)[:, None, None]
        steps = (fading + turning) * self._step
        full = kicks * fading / (fading + turning)  # what is kept in the end where nothing changes
        decay, found = np.exp(-steps), np.empty_like(kicks)
        kept = np.zeros(kicks.shape[:2])
        for k in range(N_TIMES):
            limit, lost = full[:, :, k], decay[:, :, k]
            found[:, :, k] = kicks[:, :, k] * (limit + (kept - limit) * (1 - lost) / steps[:, :, k])
            kept = limit + (kept - limit) * lost
        return found

    def at(self, name: str, gain: Floats, t: Floats | float) -> Floats:
        """Interpolate a field; sums are known at the steps' ends, the others in their middles."""
        from scipy.ndimage import map_coordinates  # here, as it takes longer to load than all of theory

        values = self._values[name]
        first = 0.0 if values.shape[1] > N_TIMES else 0.5
        place = (np.asarray(t) - self._start) / self._step - first
        level = (gain - GAINS[0]) / (GAINS[1] - GAINS[0])
        found: Floats = map_coordinates(values, np.broadcast_arrays(level, place), order=1, mode="nearest")
        return found

    def _gathered(self, rate: Floats) -> Floats:
        return np.pad(np.cumsum(rate, axis=1) * self._step, ((0, 0), (1, 0)))


def _at_speeds(rows: Floats, speed: Floats) -> Floats:
    """Interpolate (T, S) rows, linear in the cube root of SPEEDS, at speeds (G, T); beyond them too."""
    knots, x = np.cbrt(SPEEDS), np.cbrt(speed)
    i = np.clip(np.searchsorted(knots, x) - 1, 0, len(knots) - 2)
    column = np.arange(rows.shape[0])[None, :]
    share = (x - knots[i]) / (knots[i + 1] - knots[i])
    return np.asarray(rows[column, i] * (1 - share) + rows[column, i + 1] * share, dtype=np.float64)
