"""Energies after one cycle at finite energy: the adiabatic theory with diffusion and shifts, nothing fitted.

The chaotic zone's log E diffuses by the kicks of its walls, and the particles about to be captured, like
those just released, lag behind the zone's mean. Both are known from frozen tables (`rates`). Beside
its gain over the uncaptured a particle has a shift and a variance, of the orders v^-1 to v^(-2/3) and v^-1.
Diffusion alone is exact: E^(1/4) is the distance from 0 of a Brownian motion in four dimensions, which
is what keeping phase volume leaves of it. theory/equations.md derives all this and says what is left out.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from scene.refusal import BadInput, check_count, check_number, check_seed
from scene.tables import Mushroom, Scene
from theory.branches import Branch, Floats, Node, at, solve_cycle, zone_of
from theory.finite_energy.rates import (
    N_TIMES,
    SPEEDS,
    Fields,
    Flags,
    cycle_coefficients,
    find_rates,
    table_error,
)
from theory.precision import finite_array
from theory.prepared import NotCovered, as_mushroom, prepare

N_PLACES = 2000  # at which distribution functions are computed; linear between them
N_CAPTURES = 600  # point masses of a well that lies in no other; of one among several a fifth
MOST_DRAWN = 100_000_000
LATE = 16  # steps of a cycle, by which times may miss it: captures are seen from arc hit to arc hit
REACH = 7.0  # standard deviations beyond which no kernel is computed
LEAST = 1e-12  # variance of a kernel, in log E: a lag's square may leave less than none
LARGEST = 2.0**1000  # of an energy: where its double is no float, fast particles seem slow
MOST = 4.0  # variance of a kernel, in log E: beyond it what the peak has of it, v - v^2 / 8, falls again


def kernel_cdf(x: ArrayLike, variance: ArrayLike) -> Floats:
    """Return the probability of log E / E_adiabatic <= x for a particle that diffused.

    (E / E_adiabatic)^(1/4) is |e + N|, with e a unit vector and N normal with `variance` / 16 along each
    of four axes. Up to terms of the order variance^2 it is normal, with the mean and variance used here.

    Args:
        x: in log E.
        variance: what diffusion at the uncaptured's speed gives, small beside 1.
    """
    from scipy.special import ndtr  # here, as it takes longer to load than all of theory

    step = np.maximum(np.asarray(variance, dtype=np.float64), LEAST) / 16
    excess = np.exp(np.asarray(x) / 4) - 1 - 1.5 * step + 0.375 * step**2
    return np.asarray(ndtr(excess / np.sqrt(step * (1 - 1.5 * step))), dtype=np.float64)


class PointMasses(NamedTuple):
    """A distribution of log E1 / E0 as weighted diffusion kernels, (n,) each.

    weight: probabilities.
    gain: over the uncaptured, as in the adiabatic theory.
    shift: of log E, by lags.
    variance: as `kernel_cdf` takes it.
    t_in: time of the first capture; nan for the uncaptured.
    """

    weight: Floats
    gain: Floats
    shift: Floats
    variance: Floats
    t_in: Floats

    @property
    def is_free(self) -> Flags:
        """Tell which are never captured."""
        return np.isnan(self.t_in)

    def those(self, chosen: Flags) -> PointMasses:
        """Return some of them."""
        return PointMasses(*(column[chosen] for column in self))


class TheoryError(NamedTuple):
    """How far each figure may be off: the size of what the theory leaves out, and of its rates' errors.

    mean_s, captured_mean, peak_mean, p_nc: the square of the lags where each enters; of means also a quarter
        of what the variance leaves out, which is its drift.
    variance: of the peak, relatively: as independent errors half of what is forgotten, half of what depletion
        takes off, and half of what turning takes off and its square; the rates' own is added.
    skewness: of the kicks, were each block of path, twice as long as the memory, to have a skewness of 1.
    """

    mean_s: float
    captured_mean: float
    peak_mean: float
    p_nc: float
    variance: float
    skewness: float


class FiniteEnergy:
    """The energies after one cycle, for one initial energy.

    Attributes:
        scene, energy: the arguments; the same ones are refused as by `at_energy`.
        s_nc: log E_nc / E0 of the adiabatic theory.
        p_nc: probability of never being captured.
        point_masses: the distribution of s = log E1 / E0.
    """

    def __init__(self, scene: Scene, energy: float) -> None:
        self._mushroom = prepare(scene)
        self.scene = self._mushroom.given
        self.energy = check_number("energy", energy)
        if not 0 < energy <= LARGEST:
            raise BadInput(f"energy = {energy}, must be > 0 and at most 2^1000")
        with np.errstate(all="ignore"):  # lags as large as log E itself: refused below
            self._solve()
            if not self._fields.is_known:
                raise NotCovered(
                    f"energy = {energy}: particles so slow, below a speed of {SPEEDS[0]:g},"
                    " are beyond the measured rates"
                )
            is_one = self.point_masses.variance.max() < MOST and self.variance_s > 0 and self.peak[1] > 0
        if not is_one:
            raise NotCovered(
                f"energy = {energy}: walls turn too soon for particles so slow,"
                " and theory has no distribution"
            )
        self._below: dict[str, tuple[Floats, Floats]] = {}

    def _solve(self) -> None:
        cycle = cycle_coefficients(self._mushroom)
        root = solve_cycle(self._mushroom).root
        self.s_nc = root.s_nc
        self._coefficients, self._fields = cycle, Fields(cycle, self.energy)
        self._n_captures = N_CAPTURES // 5 if root.children else N_CAPTURES
        start = PointMasses(np.ones(1), np.zeros(1), np.zeros(1), np.zeros(1), np.full(1, np.nan))
        passed, now = self._through(root, root, start, cycle.start)
        found = self._drift(passed, now, cycle.start + cycle.step * N_TIMES)
        self.point_masses = found._replace(weight=found.weight / found.weight.sum())
        self.p_nc = float(self.point_masses.weight[self.point_masses.is_free].sum())

    @property
    def mean_s(self) -> float:
        """Mean of log E1 / E0."""
        return float(self.point_masses.weight @ self._centres(self.point_masses))

    @property
    def variance_s(self) -> float:
        """Variance of log E1 / E0."""
        a = self.point_masses
        square = (self._centres(a) - self.mean_s) ** 2
        return float(a.weight @ (square + a.variance - a.variance**2 / 8))

    @property
    def captured_mean(self) -> float:
        """Mean of log E1 / E0 of the captured particles; nan if there are none."""
        a = self.point_masses.those(~self.point_masses.is_free)
        return float(a.weight @ self._centres(a) / a.weight.sum()) if len(a.weight) else float("nan")

    @property
    def peak(self) -> tuple[float, float]:
        """Mean and variance of log E1 / E0 of the particles never captured."""
        a = self.point_masses.those(self.point_masses.is_free)
        return float(self._centres(a)[0]), float(a.variance[0] - a.variance[0] ** 2 / 8)

    @property
    def theory_error(self) -> TheoryError:
        """Estimated error of each figure."""
        captured = self.point_masses.those(~self.point_masses.is_free)
        second = (
            float(captured.weight @ captured.shift**2) / p if (p := float(captured.weight.sum())) else 0.0
        )
        diffusion_error, lag_error = table_error(find_rates(self._mushroom))
        # A shift of a size has an error by the rates too, in the same proportion.
        captured_mean = second + lag_error * second**0.5
        fields = self._fields
        turning = fields.turned / 2 + fields.turned**2
        variance = math.hypot(fields.forgotten / 2, fields.depleted / 2, turning) + diffusion_error
        drift = variance * self.peak[1] / 4
        return TheoryError(
            p * captured_mean + drift,
            captured_mean + drift,
            -np.log(max(1 - p, LEAST)) * captured_mean + drift,
            p * (1 - p) * captured_mean,
            variance,
            fields.n_blocks**-0.5,
        )

    def free_cdf(self, s: ArrayLike) -> Floats:
        """Return the probability of log E1 / E0 <= s for a particle never captured."""
        return self._cdf(s, "free")

    def captured_cdf(self, s: ArrayLike) -> Floats:
        """Return the probability of log E1 / E0 <= s for a captured particle; BadInput if there is none."""
        return self._cdf(s, "captured")

    def cdf(self, s: ArrayLike) -> Floats:
        """Return the probability of log E1 / E0 <= s."""
        return self._cdf(s, "all")

    def mean_of_exp(self, q: float) -> float:
        """Return the mean of exp(q s), to second order in the widths; BadInput if beyond binary64."""
        a, q = self.point_masses, check_number("q", q)
        with np.errstate(over="ignore", invalid="ignore"):
            drift = q * (1 + 2 * q) / 4 * a.variance
            found = float(a.weight @ np.exp(q * (self.s_nc + a.gain + a.shift) + drift))
        if not np.isfinite(found):
            raise BadInput(f"q = {q}: the mean of exp(q s) is beyond binary64")
        return found

    def capture_cdf(self, t: ArrayLike) -> Floats:
        """Return the distribution function of the first capture time; BadInput if nothing is captured."""
        a = self._part("captured")
        order = np.argsort(a.t_in)
        below = np.cumsum(a.weight[order]) - a.weight[order] / 2
        found: Floats = np.interp(finite_array("t", t), a.t_in[order], below / a.weight.sum())
        return found

    def zone(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Return mean and variance of log E / E0, at times of the cycle, of particles not captured so far.

        The variance 0 means: it is smaller than its error.

        Raises:
            BadInput: times is not a one-dimensional array of finite numbers, or a time is outside the cycle.
        """
        return (found := self._in_zone(times))[0], np.maximum(found[1], 0.0)

    def _in_zone(self, times: ArrayLike) -> tuple[Floats, Floats]:
        t = self._within(times)
        none = np.zeros(len(t))
        gathered = {name: self._fields.at(name, none, t) for name in ("variance", "squares", "lags", "drift")}
        variance = gathered["variance"] - gathered["squares"]
        begun = zone_of(self._mushroom, np.array([self._coefficients.start])).log_energy[0]
        drift = gathered["variance"] / 4 + gathered["drift"] - gathered["lags"]
        return zone_of(self._mushroom, t).log_energy - begun + drift, variance - variance**2 / 8

    def at_capture(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Return mean and variance of log E / E0 of particles first captured at each time; else as `zone`."""
        (mean, variance), t = self._in_zone(times), self._within(times)
        lag, square = (self._fields.at(name, np.zeros(len(t)), t) for name in ("lag", "square"))
        return mean + lag, np.maximum(variance + square - lag**2, 0.0)

    def draw(self, n_cycles: int, n: int, seed: int) -> Floats:
        """Draw log E / E0 of n particles after each of n_cycles independent cycles; shape (n, n_cycles).

        In a cycle that begins at energy E, shifts and variances are scaled by (E / E0)^(-1/2).
        """
        n_cycles = check_count("n_cycles", n_cycles, 1, MOST_DRAWN)
        n = check_count("n", n, 1, MOST_DRAWN // n_cycles)
        random, a = np.random.default_rng(check_seed(seed)), self.point_masses
        found = np.zeros((n, n_cycles))
        total = np.zeros(n)
        share = np.cumsum(a.weight)
        for k in range(n_cycles):
            i = np.minimum(np.searchsorted(share, random.random(n)), len(share) - 1)
            slower = np.exp(-total / 2)
            step = np.sqrt(np.maximum(a.variance[i] * slower, 0.0) / 16)
            along, across = 1 + step * random.standard_normal(n), step**2 * random.chisquare(3, n)
            total = total + self.s_nc + a.gain[i] + a.shift[i] * slower + 2 * np.log(along**2 + across)
            found[:, k] = total
        return found

    def _centres(self, masses: PointMasses) -> Floats:
        return np.asarray(self.s_nc + masses.gain + masses.shift + masses.variance / 4, dtype=np.float64)

    def _cdf(self, s: ArrayLike, kind: str) -> Floats:
        levels = finite_array("s", s)
        if kind not in self._below:
            self._below[kind] = self._sampled(kind)
        found: Floats = np.interp(levels, *self._below[kind])
        return found

    def _part(self, kind: str) -> PointMasses:
        """Return the "free", the "captured" or "all"."""
        free = self.point_masses.is_free
        found = self.point_masses.those({"free": free, "captured": ~free, "all": free | True}[kind])
        if not len(found.weight):
            raise BadInput("nobody is captured in this cycle: there is no distribution of the captured")
        return found

    def _within(self, times: ArrayLike) -> Floats:
        """Return times in the cycle, beyond which nothing is gathered."""
        t, (start, step) = finite_array("times", times, n_dimensions=1), self._coefficients[:2]
        first, last = start - LATE * step, start + (N_TIMES + LATE) * step
        if np.any(outside := (t < first) | (t > last)):
            raise BadInput(f"times holds {t[outside][0]}, must be in the cycle, [{first:.6g}, {last:.6g}]")
        return t

    def _sampled(self, kind: str) -> tuple[Floats, Floats]:
        """Return places and the distribution function there of the "free", the "captured" or "all"."""
        a = self._part(kind)
        centre, reach = self.s_nc + a.gain + a.shift, REACH * np.sqrt(np.maximum(a.variance, LEAST))
        places = np.linspace((centre - reach).min(), (centre + reach).max(), N_PLACES)
        below = np.zeros(N_PLACES)
        for part in np.array_split(np.arange(len(centre)), 1 + len(centre) // 1000):
            below += kernel_cdf(places[:, None] - centre[part], a.variance[part]) @ a.weight[part]
        return np.asarray(places, dtype=np.float64), below / a.weight.sum()

    def _drift(self, masses: PointMasses, now: Floats | float, until: Floats | float) -> PointMasses:
        """Let particles in the chaotic zone diffuse, and correct for those captured meanwhile."""

        def gathered(name: str) -> Floats:
            return self._fields.at(name, masses.gain, until) - self._fields.at(name, masses.gain, now)

        squares = gathered("squares")
        return masses._replace(
            weight=masses.weight * np.exp(-gathered("hazards")),
            shift=masses.shift + gathered("drift") - gathered("lags") + squares / 4,  # no drift of it
            variance=masses.variance + gathered("variance") - squares,
        )

    def _through(self, root: Node, node: Node, masses: PointMasses, now: float) -> tuple[PointMasses, float]:
        """Take particles that are in the chaotic zone through a well; return them, and when it ends."""
        if not node.branches:
            for child in node.children:
                masses, now = self._through(root, child, masses, now)
            return masses, now
        end, below = float(node.branches[0].ends[2, 0]), float(node.branches[-1].ends[1, 1])
        free = self._drift(masses, now, below)
        free = free._replace(weight=free.weight * node.passed)
        for child in node.children:
            free, below = self._through(root, child, free, below)
        parts = [self._drift(free, below, end)]
        for branch in node.branches:
            stays = _stays(node, branch, self._n_captures, root.s_nc)
            parts += [self._captured(masses, now, stays, end)]
        return PointMasses(*(np.concatenate(columns) for columns in zip(*parts, strict=True))), end

    def _captured(
        self, masses: PointMasses, now: float, stays: tuple[Floats, ...], end: float
    ) -> PointMasses:
        """Let each particle have each stay in the island; return them at the well's end."""
        n = len(stays[0])
        t_in, t_out, gain, probability = (np.tile(column, len(masses.gain)) for column in stays)
        found = self._drift(PointMasses(*(np.repeat(column, n) for column in masses)), now, t_in)
        gain = found.gain + gain
        lag, square, likelier = (self._fields.at(k, found.gain, t_in) for k in ("lag", "square", "likelier"))
        late, late_square = (self._fields.at(name, gain, t_out) for name in ("lag", "square"))
        spread = square - lag**2 + late_square - late**2
        released = PointMasses(
            found.weight * probability * np.exp(likelier),
            gain,
            found.shift + lag + late - spread / 4,
            found.variance + spread,
            np.where(found.is_free, t_in, found.t_in),
        )
        return self._drift(released, t_out, end)


def at_energy(scene: Scene, energy: float) -> FiniteEnergy:
    """Return the distribution of log E1 / E0 for an initial energy.

    Args:
        scene: a mushroom with measured rates (`theory.finite_energy.rates`), or the reverse of one.
        energy: E = v^2 / 2 of every particle when the cycle begins [length^2 / time^2].

    Raises:
        BadInput: energy is not finite, not > 0, or above 2^1000.
        NotCovered: no rates are known for this scene or for this speed, or the computed variance is not
            positive.
    """
    return _solved(as_mushroom(scene), check_number("energy", energy))


@lru_cache(maxsize=64)
def _solved(scene: Mushroom, energy: float) -> FiniteEnergy:
    return FiniteEnergy(scene, energy)


def _stays(node: Node, branch: Branch, n: int, s_nc: float) -> tuple[Floats, ...]:
    """Divide a panel's captures among point masses: of the well's n as many as it has of the captures.

    Returns:
        When each stay begins and ends, the gain over the uncaptured, in log E, and the probability, given the
        chaotic zone at the well's top.
    """
    ends = branch.chaotic(np.array([0.0, 1.0])) / node.p_top
    n = max(8, int(n * (ends[0] - ends[1]) / max(1 - node.passed, LEAST)))
    edges = np.linspace(0.0, 1.0, n + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    _, t_in, t_out, *_ = branch.evaluate(middle)
    return t_in, t_out, at(branch.s, middle) - s_nc, -np.diff(branch.chaotic(edges)) / node.p_top
