"""What is likely wrong with an ensemble that is not as theory has it: rivals that fit it better.

Each rival is a mistake that people make, told by what it does to log E1/E0 or to the stays. One is named when
the whole distribution is within chance of its own, and no more than a third as far off as theory's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

import theory
from conformance.audit.claim import Check
from conformance.audit.claims.broadened import Sums
from conformance.audit.ensemble import (
    CAPTURED,
    FREE,
    IDENTITY,
    OUTWARD,
    PEAK,
    RELEASE,
    SHARE,
    STARTS,
    TIMES,
    Expected,
    GivenEnsemble,
    cycle_start,
    expected,
    nu_at,
)
from conformance.audit.runs import MAX_LOST, FloatArray
from conformance.audit.tolerances import Cdf, critical_gap
from scene.refusal import BadInput
from scene.transforms import backwards

N_LOOKED_AT = 20_000  # particles
NEARER = 1 / 3  # of theory's distance, that a rival may have
CLOSE = 0.02  # distance that no chance explains, but that a rival's own error may
PARTS = (0.25, 0.5, 0.75)  # of a cycle, at which somebody may have stopped
N_DRAWN = 40_000
EDGE = 0.02  # of a cycle
BOUNCE = (
    "phase volume is not kept, and the never captured have wrong energies too: the bounce is not"
    " v - 2 (v.n - u) n, with the wall's speed u taken once, or with the wrong sign"
)


class Rival(NamedTuple):
    """A mistake: what is said of it, what undoes it in s, and the distribution that is then left."""

    said: str
    cdf: Cdf
    undo: Callable[[FloatArray], FloatArray] = np.asarray


def likely_causes(given: GivenEnsemble, theirs: Expected, found: list[Check]) -> list[str]:
    """Say what is likely wrong, a line each; nothing where every check holds or nothing known fits."""
    if all(check.holds is not False for check in found):
        return []
    told = [*_records(given, theirs), *_stays(given, theirs, found)]
    s = given.s[:: 1 + (len(given.s) - 1) // N_LOOKED_AT]
    distance = gap(s, theirs.cdf)
    if distance <= critical_gap(len(s)) + theirs.bands["cdf"]:
        return told
    fitting = []
    wrong = {check.what for check in found if check.holds is False}
    for rival in _rivals(given, theirs, wrong.isdisjoint((TIMES, CAPTURED, FREE))):
        with np.errstate(all="ignore"):
            undone = rival.undo(s)
        if np.all(np.isfinite(undone)):
            left = gap(undone, rival.cdf)
            reach = max(critical_gap(len(s)) + theirs.bands["cdf"], CLOSE)
            fitting += [(left, rival.said)] if left <= min(reach, NEARER * distance) else []
    if not fitting and wrong.issuperset((IDENTITY, PEAK, FREE)):
        return [*_records(given, theirs), BOUNCE]
    return [*told, *(said for _, said in sorted(fitting)[:2])]


def gap(values: FloatArray, cdf: Cdf) -> float:
    """Return Kolmogorov's distance of a sample from a distribution."""
    x, n = np.sort(values), len(values)
    below = np.asarray(cdf(x))
    steps = np.arange(n + 1) / n
    return float(max(np.max(steps[1:] - below), np.max(below - steps[:-1])))


def _records(given: GivenEnsemble, theirs: Expected) -> Iterator[str]:
    n = len(given.s) + given.n_lost
    if given.is_binary32:
        yield "energies were written or computed in single precision (binary32): 7 digits"
    if given.n_lost > MAX_LOST * n:
        lost = given.n_lost / n
        yield f"{lost:.1%} of the particles are missing: no figure is judged without them"
        if given.captured is not None and abs(lost - (1 - theirs.p_nc)) < 3 * (0.25 / n) ** 0.5 + 0.01:
            share = f"{1 - theirs.p_nc:.1%}"
            yield f"as many are missing as theory has captured, {share}: captured ones were dropped"
    if given.captured is not None and not given.captured.any() and theirs.p_nc < 1:
        yield "nobody is captured: captured particles were dropped, or captures were not looked for"


def _stays(given: GivenEnsemble, theirs: Expected, found: list[Check]) -> Iterator[str]:
    wrong = {check.what for check in found if check.holds is False}
    if not wrong.isdisjoint((STARTS, OUTWARD)):
        yield "starts are not uniform in area: on a wall only, or in one part of the table"
    if given.t_in is None or given.t_out is None or not np.isfinite(given.t_in).any():
        return
    span, begin = given.scene.period, cycle_start(given.scene)
    last = (float(np.nanmax(given.t_out)) - begin) / span
    if last < 1 - 4 * EDGE and float(np.mean(given.t_out > begin + span * (last - EDGE))) > EDGE:
        yield f"many stays end together at {last:.3f} of the cycle: it was followed no further"
        return
    if RELEASE in wrong:
        drop = np.nanmean(nu_at(given.scene, given.t_out) - nu_at(given.scene, given.t_in))
        how = "before" if drop < 0 else "after"
        yield (
            f"captured particles are let out {how} the mouth is as wide as when they were caught (nu by"
            f" {abs(drop):.3f}): the mouth's edge leaks, or base and arc do not keep the angle"
        )
    elif SHARE in wrong:
        share = float(np.mean(np.isfinite(given.t_in)))
        few, more = "few" if share < 1 - theirs.p_nc else "many", "; or starts are not uniform"
        yield (
            f"too {few} are captured, {share:.1%} for {1 - theirs.p_nc:.1%}: the mouth is not as wide as its"
            f" law says, as where its corners leak{more if wrong.isdisjoint((TIMES, CAPTURED)) else ''}"
        )


def _rivals(given: GivenEnsemble, theirs: Expected, right_groups: bool) -> Iterator[Rival]:
    undo: dict[str, Callable[[FloatArray], FloatArray]] = {
        "s has the wrong sign: E0 and E1 are exchanged": np.negative,
        "E1/E0 is given in place of its logarithm": np.log,
        "E1/E0 - 1 is given in place of log E1/E0": np.log1p,
        "speeds are given in place of energies: s is half of what it should be": lambda s: 2 * s,
        "a logarithm to base 10 is given": lambda s: s * np.log(10),
    }
    yield from (Rival(said, theirs.cdf, undoing) for said, undoing in undo.items())
    yield Rival("only the never captured are there: captured particles were dropped", theirs.free_cdf)
    if theirs.p_nc < 1:
        yield Rival("only the captured are there", theirs.captured_cdf)
    if theirs.p_nc < 1 and (given.captured is None or (given.captured.any() and right_groups)):
        p = _share_of_the_free(given, theirs)
        yield Rival(
            f"never captured {p:.1%}, where theory has {theirs.p_nc:.1%}, both with the right energies:"
            " starts are not uniform in area and direction, or a share of one group is lost",
            lambda s: p * theirs.free_cdf(s) + (1 - p) * theirs.captured_cdf(s),
        )
    yield Rival(
        "energies return: the loop encloses nothing, as with a law of the wrong frequency",
        lambda s: np.asarray(ndtr((np.asarray(s) - theirs.sigma**2 / 4) / max(theirs.sigma, 1e-9))),
    )
    try:
        turned = expected(backwards(given.scene), given.energy)
        yield Rival("the cycle was run backwards, or with a and b exchanged", turned.cdf)
        if theirs.has_rates:
            yield from _other_spans(given)
    except (BadInput, theory.NotConverged):
        return


def _share_of_the_free(given: GivenEnsemble, theirs: Expected) -> float:
    """Return the share of the never captured: as told, or that which fits best."""
    if given.captured is not None:
        return float(np.mean(~given.captured))
    s = given.s[:: 1 + (len(given.s) - 1) // N_LOOKED_AT]
    free, captured = theirs.free_cdf(np.sort(s)), theirs.captured_cdf(np.sort(s))
    steps, apart = (np.arange(len(s)) + 0.5) / len(s) - captured, free - captured
    return float(np.clip(steps @ apart / (apart @ apart), 0.0, 1.0))


def _other_spans(given: GivenEnsemble) -> Iterator[Rival]:
    """Yield parts of a cycle, and two cycles."""
    found, span = theory.at_energy(given.scene, given.energy), given.scene.period
    for part in PARTS:
        yield Rival(f"energies are those after {part:g} of a cycle", _at_a_part(given, found, part * span))
    yield Rival("energies are those after two cycles", Sums(found.draw(2, N_DRAWN, 0)[:, -1]).cdf)


def _at_a_part(given: GivenEnsemble, found: theory.FiniteEnergy, time: float) -> Cdf:
    """Return the distribution of log E/E0 at a time of the cycle: in the zone, or in the cap since t_in."""
    begin = cycle_start(given.scene)
    curve = theory.capture_curve(given.scene, 400)
    inside = (curve.t_in < begin + time) & (curve.t_out > begin + time)
    n_in = np.diff(np.append(1 - curve.p_cha, 1 - curve.p_cha[-1]))[inside] if inside.any() else np.zeros(0)
    mean, variance = found.zone([begin + time])
    caught, blur = found.at_capture(curve.t_in[inside]) if inside.any() else (np.zeros(0), np.zeros(0))
    cap = theory.volumes_at(np, given.scene, np.append(curve.t_in[inside], begin + time)).v_cap
    places = np.append(caught + np.log(cap[:-1] / cap[-1]), mean)
    widths = np.sqrt(np.append(blur, variance)) + 1e-9
    weights = np.append(n_in, 1 - n_in.sum())

    def cdf(s: FloatArray) -> FloatArray:
        grid = np.linspace((places - 6 * widths).min(), (places + 6 * widths).max(), 2000)
        below = ndtr((grid[:, None] - places) / widths) @ weights
        return np.asarray(np.interp(s, grid, below))

    return cdf
