"""An ensemble of another program, compared with what the paper claims for its scene.

Each figure is a `Check`, as in the audit: theory at that energy with what it leaves out, the
departure that a sample of this size would show, and the power against a rival. A scene without
frozen rates has the adiabatic theory only; then a band is granted that no rates confirm, (walls'
speed / particles' speed)^(2/3), the order of the first correction.

Where a check fails, rivals tell what is likely wrong: each is a mistake that people make, known by
what it does to log E1/E0 or to the capture intervals. One is named when the whole distribution is
within chance of its own, and no more than a third as far off as theory's.

Not handled: starts of several energies, tables other than mushrooms.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from mpmath import fp
from scipy.special import ndtr
from scipy.stats import ks_1samp

import theory
from mushrooms.audit.claim import Check
from mushrooms.audit.claims.assumptions import walls_speed
from mushrooms.audit.claims.finite_energy import DRAWN_SEED, PEAK_DENSITY, Sums, peak_band
from mushrooms.audit.runs import MAX_LOST, BoolArray, FloatArray
from mushrooms.audit.tolerances import (
    N_SIGMA,
    Cdf,
    close,
    critical_gap,
    fits,
    mean,
    seen_late,
    share,
    spread,
    stated,
    steepest,
)
from scene import BadInput, Mushroom
from scene.geometry import table_at
from scene.transforms import backwards
from theory.finite_energy.one_cycle import TheoryError

IDENTITY = "mean of E0/E1, which is 1 in the limit"
SHARE = "p_nc: share never captured"
PEAK = "log E_nc: mean of log E1/E0 of the never captured"
FREE = "log E1/E0 of the never captured"
CAPTURED = "log E1/E0 of the captured"
TIMES = "times of capture"
RELEASE = "nu at release less nu at capture"
STARTS = "share of the starts in the cap"
OUTWARD = "mean of (x^2 + y^2) / r^2 of these"
MOST_DRAWN = 2_000_000  # gains of cycles that are drawn from theory
MOST_SORTED = 1_000_000  # values whose whole distribution is tested; of more, evenly spaced ones
N_TIMES = 4096  # of a cycle, at which laws are looked at
FEW = 20  # particles below which a group says nothing
N_LEVELS = 50  # of s, at which two directions are compared
# Longest flights between two arc hits, which captures and releases are told late by, and lags.
WAITS = 4
N_LOOKED_AT = 20_000  # particles
NEARER = 1 / 3  # of theory's distance, that a rival may have
CLOSE = 0.02  # distance that no chance explains, but that a rival's own error may
EDGE = 0.02  # of a cycle
BOUNCE = (
    "phase volume is not kept, and the never captured have wrong energies too: the bounce is not"
    " v - 2 (v.n - u) n, with the wall's speed u taken once, or with the wrong sign"
)


class GivenEnsemble(NamedTuple):
    """One cycle of n particles, those that have energies.

    Attributes:
        scene: that is claimed to have been simulated.
        energy: of every start, v^2 / 2 in the scene's units.
        s: (n,) log E1 / E0.
        captured: (n,) which were captured; None where nothing tells.
        t_in, t_out: (n,) ends of the capture interval [scene's time]; nan for none; None where not
            given.
        x0, y0: (n,) where each started; None where not given.
        n_lost: rows without an energy, or particles without a row.
        is_binary32: whether every energy is a number of 24 bits.
        later: (n, K - 1) log E_k / E0 after the second of K cycles and each that follows; None for
            one cycle.
    """

    scene: Mushroom
    energy: float
    s: FloatArray
    captured: BoolArray | None = None
    t_in: FloatArray | None = None
    t_out: FloatArray | None = None
    x0: FloatArray | None = None
    y0: FloatArray | None = None
    n_lost: int = 0
    is_binary32: bool = False
    later: FloatArray | None = None


class HighEnergies:
    """The limit of high energies, by the names of `theory.FiniteEnergy`.

    What it leaves out is a guess.
    """

    def __init__(self, scene: Mushroom, energy: float) -> None:
        found = theory.predict(scene, 12)
        self._curve = theory.energies(scene)
        self.mean_s = float(found.m1)
        self.p_nc = float(found.p_nc)
        self.peak = (float(found.log_e_nc), 0.0)
        self.cdf = self._curve.cdf
        left_out = (walls_speed(scene) / math.sqrt(2 * energy)) ** (2 / 3)
        self.theory_error = TheoryError(left_out, left_out, left_out, left_out, 0.0, 0.0)
        self._edges = np.linspace(0.0, scene.period, N_TIMES + 1) + cycle_start(scene)
        mass = theory.capture_time_mass(scene, self._edges) if self.p_nc < 1 else np.zeros(N_TIMES)
        self._captured = np.cumsum(mass)

    def mean_of_exp(self, q: float) -> float:
        """Return the mean of exp(-s)."""
        return 1.0

    def free_cdf(self, s: FloatArray) -> FloatArray:
        """Return the distribution of s of the particles never captured: all at one place."""
        return np.asarray(s >= self.peak[0], dtype=np.float64)

    def captured_cdf(self, s: FloatArray) -> FloatArray:
        """Return the distribution of s of the captured."""
        return np.asarray(self._curve.captured_below(np.asarray(s)) / max(1 - self.p_nc, 1e-12))

    def capture_cdf(self, t: FloatArray) -> FloatArray:
        """Return the distribution of the time of capture."""
        return np.asarray(
            np.interp(t, self._edges[1:], self._captured / max(self._captured[-1], 1e-12))
        )


Theory = theory.FiniteEnergy | HighEnergies


def expected(scene: Mushroom, energy: float) -> Theory:
    """Return what theory has for a scene at an energy: with rates where they are known."""
    try:
        return theory.at_energy(scene, energy)
    except theory.NotCovered:
        return HighEnergies(scene, energy)


def shape_band(theirs: Theory) -> float:
    """Return how far the distribution function of s may be off."""
    if isinstance(theirs, HighEnergies):
        return theirs.theory_error.peak_mean
    return peak_band(theirs)


def cycle_start(scene: Mushroom) -> float:
    """Return the time at which nu begins to fall."""
    return float(theory.Cycle.of(scene, 10).start)


def nu_at(scene: Mushroom, times: FloatArray) -> FloatArray:
    """Return w / r at times."""
    return np.asarray(scene.width.values(times) / scene.laws["r"].values(times))


def checks(given: GivenEnsemble, theirs: Theory) -> list[Check]:
    """Return every figure of the paper that the ensemble can be held to."""
    return [
        *_records(given),
        *_starts(given),
        *_energies(given, theirs),
        *_captures(given, theirs),
        *_capture_intervals(given, theirs),
        *_later(given, theirs),
    ]


def reversal(given: GivenEnsemble, other: GivenEnsemble, theirs: Theory) -> Check:
    """Compare two directions of one cycle by p_rev(-s) = p(s) exp(-s).

    Compared is the share below s, where it differs most.
    """
    here = _some(given.s)
    there = -_some(other.s)
    places = np.quantile(np.concatenate([here, there]), np.linspace(0.01, 0.99, N_LEVELS))
    pairs = [(mean(np.exp(-here) * (here <= x)), mean(there <= x)) for x in places]
    found = [(one.value - two.value, float(np.hypot(one.error, two.error))) for one, two in pairs]
    return close(
        "reversal identity: share of exp(-s) below s, less that above -s of the reversed cycle",
        max(found, key=_in_errors),
        0.0,
        band=2 * shape_band(theirs),
        scale=0.3,
        against=("the same direction twice", 0.3),
    )


def _in_errors(difference: tuple[float, float]) -> float:
    """Return a difference in its standard errors; that of very few particles may have no error."""
    size = abs(difference[0])
    error = difference[1]
    if error == 0:
        return math.inf if size else 0.0
    return size / error


def _records(given: GivenEnsemble) -> Iterator[Check]:
    n = len(given.s) + given.n_lost
    yield stated(
        "every particle has an energy",
        given.n_lost <= MAX_LOST * n,
        f"{given.n_lost:,} of {n:,} have none",
        f"at most {MAX_LOST:.1%}",
    )
    yield stated(
        "energies have more than 24 bits",
        not given.is_binary32,
        "all are binary32 numbers" if given.is_binary32 else "they have",
        "binary64",
    )


def _starts(given: GivenEnsemble) -> Iterator[Check]:
    """Compare the starts with a uniform density in area.

    Compared are how many are in the cap, and how far out they are there.
    """
    if given.x0 is None or given.y0 is None:
        return
    now = table_at(fp, given.scene, cycle_start(given.scene))
    is_in_cap = given.y0 > 0
    cap = float(now.cap_area())
    yield close(STARTS, share(is_in_cap), cap / (cap + float(now.stem_area())), scale=0.3)
    if is_in_cap.sum() >= FEW:
        out = (given.x0[is_in_cap] ** 2 + given.y0[is_in_cap] ** 2) / float(now.r) ** 2
        yield close(OUTWARD, mean(out), 0.5, scale=0.3, against=("all on the arc", 1.0))


def _energies(given: GivenEnsemble, theirs: Theory) -> Iterator[Check]:
    s = given.s
    left = theirs.theory_error
    rival = ("no growth", 0.0) if theirs.mean_s else None
    scale = max(abs(theirs.mean_s), left.mean_s) * 4
    yield close(
        "m1: mean of log E1/E0",
        mean(s),
        theirs.mean_s,
        band=left.mean_s,
        scale=scale,
        against=rival,
    )
    yield close(
        IDENTITY,
        mean(np.exp(-s)),
        theirs.mean_of_exp(-1),
        band=left.mean_s,
        scale=0.5,
    )
    if isinstance(theirs, theory.FiniteEnergy):
        mirrored = ("the wrong sign of every gain", lambda x: 1 - theirs.cdf(-np.asarray(x)))
        yield fits(
            "log E1/E0", _some(s), theirs.cdf, band=peak_band(theirs), scale=0.3, against=mirrored
        )


def _captures(given: GivenEnsemble, theirs: Theory) -> Iterator[Check]:
    if given.captured is None:
        return
    free = given.s[~given.captured]
    caught = given.s[given.captured]
    left = theirs.theory_error
    yield close(
        SHARE,
        share(~given.captured),
        theirs.p_nc,
        band=left.p_nc,
        scale=0.3,
        against=("nobody is captured", 1.0) if theirs.p_nc < 1 else None,
    )
    if len(free) >= FEW:
        yield close(PEAK, mean(free), theirs.peak[0], band=left.peak_mean)
    if isinstance(theirs, HighEnergies):
        return
    band = peak_band(theirs)
    if len(free) >= FEW:
        sigma = theirs.peak[1] ** 0.5
        yield close("width of their peak", spread(free), sigma, band=sigma * left.variance / 2)
        yield fits(FREE, _some(free), theirs.free_cdf, band=band, scale=0.4)
    if len(caught) >= FEW and theirs.p_nc < 1:
        band += left.captured_mean * steepest(
            theirs.captured_cdf, *np.quantile(caught, (0.001, 0.999))
        )
        yield fits(CAPTURED, _some(caught), theirs.captured_cdf, band=band, scale=0.4)


def _capture_intervals(given: GivenEnsemble, theirs: Theory) -> Iterator[Check]:
    if given.t_in is None or theirs.p_nc == 1:
        return
    t_in = given.t_in[np.isfinite(given.t_in)]
    if len(t_in) < FEW:
        return
    wait = 2 * float(given.scene.laws["r"].bounds().highest) / math.sqrt(2 * given.energy)
    band = seen_late(theirs.capture_cdf, t_in, wait) + theirs.theory_error.captured_mean
    yield fits(TIMES, _some(t_in), theirs.capture_cdf, band=band, scale=0.4)
    if given.t_out is None:
        return
    begin = _some(given.t_in)
    end = _some(given.t_out)
    both = np.isfinite(begin) & np.isfinite(end)
    rate = N_TIMES / given.scene.period
    steepest = rate * float(
        np.max(np.abs(np.diff(nu_at(given.scene, np.arange(N_TIMES + 1) / rate))))
    )
    yield close(
        RELEASE,
        mean(nu_at(given.scene, end[both]) - nu_at(given.scene, begin[both])),
        0.0,
        band=WAITS * wait * steepest,
    )


def _later(given: GivenEnsemble, theirs: Theory) -> Iterator[Check]:
    """Compare log E_k/E0 after each further cycle with sums of k cycles.

    They are drawn from theory where it has rates.
    """
    if given.later is None:
        return
    n_cycles = 1 + given.later.shape[1]
    n_drawn = MOST_DRAWN // n_cycles
    drawn = None if isinstance(theirs, HighEnergies) else theirs.draw(n_cycles, n_drawn, DRAWN_SEED)
    for k, total in enumerate(given.later.T, 2):
        what = f"log E{k}/E0"
        band = k * theirs.theory_error.mean_s
        if drawn is None:
            yield close(f"mean of {what}", mean(total), k * theirs.mean_s, band=band)
            continue
        sums = Sums(drawn[:, k - 1])
        own = N_SIGMA * sums.sd / n_drawn**0.5
        rival = ("no growth", 0.0) if theirs.mean_s else None
        yield close(f"mean of {what}", mean(total), sums.mean, band=band + own, against=rival)
        shape = PEAK_DENSITY * band / sums.sd + critical_gap(n_drawn)
        yield fits(what, _some(total), sums.cdf, band=shape, scale=0.3)


def _some(values: FloatArray, most: int = MOST_SORTED) -> FloatArray:
    return values[:: 1 + (len(values) - 1) // most]


class Rival(NamedTuple):
    """A mistake: what is said of it, what undoes it in s, and the distribution then left."""

    said: str
    cdf: Cdf
    undo: Callable[[FloatArray], FloatArray] = np.asarray


def likely_causes(given: GivenEnsemble, theirs: Theory, found: list[Check]) -> list[str]:
    """Say what is likely wrong, a line each.

    Nothing where every check holds or nothing known fits.
    """
    wrong = {check.what for check in found if check.holds is False}
    if not wrong:
        return []
    records = list(_told_by_records(given, theirs))
    end = _common_end(given)
    if end is not None:
        return [
            *records,
            f"many captures end together at {end:.3f} of the cycle: it was followed no further",
        ]
    told = [*records, *_told_by_captures(given, theirs, wrong)]
    s = _some(given.s, N_LOOKED_AT)
    distance = gap(s, theirs.cdf)
    reach = critical_gap(len(s)) + shape_band(theirs)
    if distance <= reach:
        return told
    fitting = []
    for rival in _rivals(given, theirs, wrong.isdisjoint((TIMES, CAPTURED, FREE))):
        with np.errstate(all="ignore"):
            undone = rival.undo(s)
        left = gap(undone, rival.cdf) if np.isfinite(undone).all() else math.inf
        if left <= min(max(reach, CLOSE), NEARER * distance):
            fitting.append((left, rival.said))
    if not fitting and wrong.issuperset((IDENTITY, PEAK, FREE)):
        return [*records, BOUNCE]
    return [*told, *(said for _, said in sorted(fitting)[:2])]


def gap(values: FloatArray, cdf: Cdf) -> float:
    """Return Kolmogorov's distance of a sample from a distribution."""
    return float(ks_1samp(values, cdf, method="asymp").statistic)


def _told_by_records(given: GivenEnsemble, theirs: Theory) -> Iterator[str]:
    n = len(given.s) + given.n_lost
    if given.is_binary32:
        yield "energies were written or computed in single precision (binary32): 7 digits"
    if given.n_lost > MAX_LOST * n:
        lost = given.n_lost / n
        yield f"{lost:.1%} of the particles are missing: no figure is judged without them"
        if (
            given.captured is not None
            and abs(lost - (1 - theirs.p_nc)) < 3 * (0.25 / n) ** 0.5 + 0.01
        ):
            share = f"{1 - theirs.p_nc:.1%}"
            yield f"as many are missing as theory has captured, {share}: captured ones were dropped"
    if given.captured is not None and not given.captured.any() and theirs.p_nc < 1:
        yield "nobody is captured: captured particles were dropped, or captures were not looked for"


def _common_end(given: GivenEnsemble) -> float | None:
    """Return the part of the cycle where many capture intervals end and none goes on."""
    if given.t_out is None or not np.isfinite(given.t_out).any():
        return None
    ends = (given.t_out - cycle_start(given.scene)) / given.scene.period
    last = float(np.nanmax(ends))
    return last if last < 1 - 4 * EDGE and float(np.mean(ends > last - EDGE)) > EDGE else None


def _told_by_captures(given: GivenEnsemble, theirs: Theory, wrong: set[str]) -> Iterator[str]:
    if not wrong.isdisjoint((STARTS, OUTWARD)):
        yield "starts are not uniform in area: on a wall only, or in one part of the table"
    if given.t_in is None or given.t_out is None or not np.isfinite(given.t_in).any():
        return
    if RELEASE in wrong:
        drop = np.nanmean(nu_at(given.scene, given.t_out) - nu_at(given.scene, given.t_in))
        how = "before" if drop < 0 else "after"
        yield (
            f"captured particles are let out {how} the mouth is as wide as when they were caught"
            f" (nu by {abs(drop):.3f}): the mouth's edge leaks, or base and arc do not keep the"
            " angle"
        )
    elif SHARE in wrong:
        share = float(np.mean(np.isfinite(given.t_in)))
        few = "few" if share < 1 - theirs.p_nc else "many"
        more = "; or starts are not uniform"
        yield (
            f"too {few} are captured, {share:.1%} for {1 - theirs.p_nc:.1%}: the mouth is not as"
            " wide as its law says, as where its corners"
            f" leak{more if wrong.isdisjoint((TIMES, CAPTURED)) else ''}"
        )


def _rivals(given: GivenEnsemble, theirs: Theory, right_groups: bool) -> Iterator[Rival]:
    undo: dict[str, Callable[[FloatArray], FloatArray]] = {
        "s has the wrong sign: E0 and E1 are exchanged": np.negative,
        "E1/E0 is given in place of its logarithm": np.log,
        "E1/E0 - 1 is given in place of log E1/E0": np.log1p,
        "speeds are given in place of energies: s is half of what it should be": lambda s: 2 * s,
        "a logarithm to base 10 is given": lambda s: s * np.log(10),
    }
    yield from (Rival(said, theirs.cdf, undoing) for said, undoing in undo.items())
    yield Rival(
        "only the never captured are there: captured particles were dropped", theirs.free_cdf
    )
    if theirs.p_nc < 1:
        yield Rival("only the captured are there", theirs.captured_cdf)
    if theirs.p_nc < 1 and (given.captured is None or (given.captured.any() and right_groups)):
        p = _share_of_the_free(given, theirs)
        yield Rival(
            f"never captured {p:.1%}, where theory has {theirs.p_nc:.1%}, both with the right"
            " energies: starts are not uniform in area and direction, or a share of one group is"
            " lost",
            lambda s: p * theirs.free_cdf(s) + (1 - p) * theirs.captured_cdf(s),
        )
    variance = max(theirs.peak[1], 1e-18)
    yield Rival(
        "energies return: the loop encloses nothing, as with a law of the wrong frequency",
        lambda s: np.asarray(ndtr((np.asarray(s) - variance / 4) / variance**0.5)),
    )
    with suppress(BadInput, theory.NotConverged):
        turned = expected(backwards(given.scene), given.energy)
        yield Rival("the cycle was run backwards, or with a and b exchanged", turned.cdf)


def _share_of_the_free(given: GivenEnsemble, theirs: Theory) -> float:
    """Return the share of the never captured: as told, or that which fits best."""
    if given.captured is not None:
        return float(np.mean(~given.captured))
    s = _some(given.s, N_LOOKED_AT)
    free = theirs.free_cdf(np.sort(s))
    captured = theirs.captured_cdf(np.sort(s))
    steps = (np.arange(len(s)) + 0.5) / len(s) - captured
    apart = free - captured
    return float(np.clip(steps @ apart / (apart @ apart), 0.0, 1.0))
