"""A cycle in time, for particles of one initial energy: what the chaotic zone gathers, and who lags behind.

Rates of frozen tables (`rates`) are joined with the adiabatic theory's energies and hazards. Particles that
were captured have other speeds, so lags and sums are functions of their gain over the uncaptured too.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from mpmath import fp
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from scene.geometry import table_at
from scene.laws import BangBang
from scene.tables import Mushroom, laws
from theory.branches import Floats, tree
from theory.curves import chaotic_zone
from theory.cycle import Cycle
from theory.finite_energy.rates import MEMORIES, SPEEDS, RatesAt, rates_at
from theory.volumes import NotCovered, delta_slope, volumes_at

N_TIMES = 1024  # steps of a cycle, the midpoint rule's
GAINS = np.linspace(-4.0, 4.0, 17)  # in log E, at which lags are integrated
NUDGE = 1e-3  # in log E, for a derivative
ROUNDING = 1e-9

Flags = NDArray[np.bool_]


class CycleCoefficients(NamedTuple):
    """A cycle at T times, midpoints of equal steps from its start.

    start, step: of time.
    times: (T,).
    log_energy: (T,) of the uncaptured, over its value at the start (Eq:dE).
    hazard: (T,) of capture per time, where nu rises that of the reversed cycle (Eq:dps/ps).
    is_capture: (T,) whether nu falls.
    shear: (T,) rate at which walls turn velocities: that of log tan of their angle [1 / time].
    crossing: (T,) mean path down the table and up again, directions uniform [length].
    rates: from frozen tables.
    """

    start: float
    step: float
    times: Floats
    log_energy: Floats
    hazard: Floats
    is_capture: Flags
    shear: Floats
    crossing: Floats
    rates: RatesAt


@lru_cache(maxsize=16)
def cycle_coefficients(scene: Mushroom) -> CycleCoefficients:
    """Follow a cycle whose frozen rates are known.

    Raises:
        NotCovered: they are not.
    """
    rates_at(scene, np.zeros(1))
    start, step = _clock_start(scene), scene.period / N_TIMES
    times: Floats = np.asarray(start + step * (np.arange(N_TIMES) + 0.5), dtype=np.float64)
    now, volumes, rates = table_at(fp, scene, times), volumes_at(np, scene, times), rates_at(scene, times)
    nu_rate = (now.w_rate * now.r - now.w * now.r_rate) / now.r**2
    flux = delta_slope(np, volumes.nu) * volumes.v_cap / volumes.v_cha
    log_energy = chaotic_zone(scene, times).log_energy - chaotic_zone(scene, [start]).log_energy[0]
    # v_x w and v_y (h + r) are adiabatic; the mean of |v_y| is 2 v / pi.
    height, rising = now.h + now.r, now.h_rate + now.r_rate
    shear, crossing = (
        np.broadcast_to(x, times.shape) for x in (now.w_rate / now.w - rising / height, np.pi * height)
    )
    hazard = np.abs(flux * nu_rate)
    return CycleCoefficients(start, step, times, log_energy, hazard, nu_rate < 0, shear, crossing, rates)


def _clock_start(scene: Mushroom) -> float:
    """Return when an ensemble's cycle begins: at a bang-bang law's first knot, else at 0; or cycles later.

    Raises:
        NotCovered: some particles are in the island then that leave it later.
    """
    length, opening = scene.period, float(Cycle.of(scene, 15).start)
    start = next((law.knots[0][0] for law in laws(scene).values() if isinstance(law, BangBang)), 0.0)
    start += length * float(np.floor((opening - start) / length + ROUNDING))
    last = max((float(branch.ends[2].max()) for branch in tree(scene).all_branches()), default=start)
    if last > start + length * (1 + ROUNDING):
        raise NotCovered("the cycle must begin with its mouth at the widest: who is captured then is unknown")
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
