"""What the summary of a run says: counts, mean log E / E0, expected collisions, theory."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

import theory
from fast.ensemble import FOLLOWED, UNDECIDED, Ensemble
from mushrooms.orbits import stretches
from mushrooms.store.spec import RunSpec
from scene import BadInput, Mushroom, Scene
from scene.geometry import table_at
from scene.mouth import mouth_minima, one_cycle, start_time


class RunTally(NamedTuple):
    """Counts of some particles of a run.

    Attributes:
        particles, followed, undecided: how many started, reached the end, could not be decided.
        collisions, careful: in all.
        met: collisions of those that were followed to the end.
        captured: captured cycles of the particles that take part.
    """

    particles: int = 0
    followed: int = 0
    undecided: int = 0
    collisions: int = 0
    careful: int = 0
    met: int = 0
    captured: int = 0


def tally_of(found: Ensemble) -> RunTally:
    """Return the tally of an ensemble."""
    was_followed = found.outcome == FOLLOWED
    return RunTally(
        particles=len(found.outcome),
        followed=int(was_followed.sum()),
        undecided=int((found.outcome == UNDECIDED).sum()),
        collisions=int(found.n_collisions.sum()),
        careful=int(found.n_careful.sum()),
        met=int(found.n_collisions[was_followed].sum()),
        captured=int(np.isfinite(found.t_in[found.takes_part()]).any(axis=2).sum()),
    )


class Gain(NamedTuple):
    """The mean of n numbers and its standard error.

    None where they are too few, or one is infinite.
    """

    n: int = 0
    mean: float | None = None
    standard_error: float | None = None


def gain_of(gains: Callable[[], Iterable[npt.NDArray[np.float64]]]) -> Gain:
    """Return the mean of ln(E/E0) after the last cycle.

    `math.fsum` rounds once, whatever the order: blocks of any size come to the same bits.

    Args:
        gains: returns arrays (n, K) of ln(E/E0) after each cycle, block by block; called twice.
    """
    lengths = []

    def values(centre: float) -> Iterator[float]:
        for part in gains():
            lengths.append(len(part))
            yield from (part[:, -1] - centre).tolist()

    total = math.fsum(values(0.0))
    n = sum(lengths)
    if not n or not math.isfinite(total):
        return Gain(n)
    mean = total / n
    squares = math.fsum(x * x for x in values(mean))
    return Gain(n, mean, math.sqrt(squares / (n - 1) / n) if n > 1 else None)


MOST_CYCLES = (
    300  # after which particles that grow faster stay fast enough for any run never to end
)
CAREFUL_COST = 50  # collisions in lanes that take as long as one careful step, measured at 40 to 80


def expected_collisions(scene: Scene, energy: float, n_cycles: int) -> float:
    """Return how many collisions to expect of a particle; nan at the edge of binary64."""
    try:
        return _collisions_of_a_cycle(scene, energy) * _as_first_cycles(scene, n_cycles)
    except (BadInput, ArithmeticError):
        return math.nan


def _collisions_of_a_cycle(scene: Scene, energy: float) -> float:
    """Return how many collisions to expect of a particle that is fast beside the walls.

    Particles uniform in place and direction meet the walls, of length P around an area A, at the
    rate v P / (pi A), however they move; in a cycle v^2 goes as 1 / A.
    """
    begin = start_time(scene)
    span = one_cycle(scene)
    n_times = 64
    area, _ = _size(scene, begin)
    sizes = [_size(scene, begin + span * ((k + 0.5) / n_times)) for k in range(n_times)]
    rates = [math.sqrt(2.0 * energy * area / a) * walls / (math.pi * a) for a, walls in sizes]
    return math.fsum(rates) * span / n_times


def _as_first_cycles(scene: Scene, n_cycles: int) -> float:
    """Return how many first cycles make as many collisions.

    Theory says how v grows in a mushroom.
    """
    if n_cycles <= 1 or not isinstance(scene, Mushroom):
        return n_cycles
    growth = float(theory.mean_of(scene, lambda s: s.context.exp(s / 2), 5))
    return max(float(n_cycles), math.fsum(growth**k for k in range(min(n_cycles, MOST_CYCLES))))


def _size(scene: Scene, t: float) -> tuple[float, float]:
    """Return a table's area [length^2] and the length of its walls [length] at a time."""
    now = table_at(fp, scene, t)
    return float(now.cap_area() + now.stem_area()), math.fsum(
        part.length for part in stretches(now)
    )


def careful_note(summary: Mapping[str, Any]) -> str | None:
    """Return a line on careful steps, if a run took a second and they a tenth of it or more.

    Args:
        summary: as `mushrooms simulate` prints it.
    """
    seconds = summary["ns_per_collision"] * summary["collisions"] / 1e9
    share = summary["careful"] / max(summary["collisions"], 1)
    part = CAREFUL_COST * share / (1.0 + (CAREFUL_COST - 1.0) * share)
    if seconds < 1.0 or part <= 0.1:
        return None
    return (
        f"careful steps: {share:.2g} of the collisions, some {part:.0%} of the time. They are as"
        " right as the others. Walls that move far between two collisions need them: at higher"
        " energy they are fewer"
    )


DIGITS = 10  # of the adiabatic theory: a run knows six at most
SAME = 2.0**-40  # of nu: far above rounding, and no particle starts in so thin a part of the island
NO_THEORY = (BadInput, theory.NotCovered, theory.NotConverged)  # raised where theory covers nothing


class Theory(NamedTuple):
    """What theory says of a run.

    Attributes:
        m1, p_nc: predicted.
        variance: of ln(E/E0) after the run's cycles, for each of them.
        m1_error, p_nc_error: how far that may be off; None if that is unknown.
    """

    m1: float
    p_nc: float
    variance: float
    m1_error: float | None = None
    p_nc_error: float | None = None


def measured(spec: RunSpec, n_captured: int, gain: Gain) -> dict[str, Any]:
    """Return m1 and p_nc as measured, with errors, as predicted, and the differences in errors.

    Args:
        spec: the run.
        n_captured: cycles with a capture, of all particles that take part.
        gain: ln(E/E0) of these particles after the last cycle.

    The prediction is that at the run's energy where rates of the scene's frozen tables are known.
    Elsewhere it is the limit of high energies, and without z: what that leaves out is not known.
    None is what is unknown: of a cycle that does not begin where the mouth is widest too (see
    `begins_widest`).
    """
    n, k = gain.n, spec.n_cycles
    mean, error = (None if x is None else x / k for x in (gain.mean, gain.standard_error))
    free = 1.0 - n_captured / (n * k) if n and isinstance(spec.scene, Mushroom) else None
    free_error = None if free is None else _measured_error(spec.scene, free, n * k)
    found = predicted(spec)
    m1_z = p_nc_z = None
    if found is not None and n:
        m1_z = _pull(mean, found.m1, error, found.m1_error)
        p_nc_z = _pull(free, found.p_nc, _binomial_error(found.p_nc, n * k), found.p_nc_error)
    return {
        "m1": mean,
        "m1_se": error,
        "m1_theory": found.m1 if found else None,
        "m1_z": m1_z,
        "p_nc": free,
        "p_nc_se": free_error,
        "p_nc_theory": found.p_nc if found else None,
        "p_nc_z": p_nc_z,
    }


def explain_limit(spec: RunSpec, summary: Mapping[str, Any]) -> str | None:
    """Return a line that says why theory beside a run is the limit of high energies, or is none.

    Args:
        spec: the run.
        summary: as `measured` returns it, or more.
    """
    if isinstance(spec.scene, Mushroom) and not begins_widest(spec.scene):
        return _explain_narrow_start(spec.scene)
    # Of one particle m1 has no error, and so no z, at an energy of which theory knows all the same.
    is_of_this_energy = any(summary[z] is not None for z in ("m1_z", "p_nc_z"))
    is_still = not spec.scene.period  # energies are what they were, at any energy
    if summary["m1_theory"] is None or summary["m1"] is None or is_of_this_energy or is_still:
        return None
    return (
        "m1_theory, p_nc_theory: the limit of high energies; what is left at this one is not known"
    )


def _explain_narrow_start(scene: Mushroom) -> str:
    """Say why a cycle that begins with a narrow mouth has no theory, and how to shift it."""
    begin = start_time(scene)
    length = scene.period
    now = table_at(fp, scene, begin)
    widest = theory.Cycle.of(scene, DIGITS)
    wait = (float(widest.start) - begin) % length
    return (
        f"m1_theory, p_nc_theory: none, for the cycle begins at t = {begin:.6g} with its mouth at"
        f" {float(now.w / now.r):.4g} r, not at its widest, {float(widest.nu_max):.4g} r:"
        f" some particles start in the island; shift all laws by {-wait!r} in time, to begin where"
        " it is"
    )


def _measured_error(scene: Scene, share: float, n: int) -> float:
    """Return the standard error of a measured share of n that were free.

    Of n that are all alike the binomial one would be 0, as if no more could tell: there it is that
    of a share of 1 / (n + 1). Where the mouth never narrows no particle can be captured, and the
    share is known.
    """
    if not mouth_minima(scene):
        return 0.0
    least = 1.0 / (n + 1)
    return _binomial_error(min(max(share, least), 1.0 - least), n)


def _binomial_error(share: float, n: int) -> float:
    return math.sqrt(max(0.0, share * (1.0 - share)) / n)


def _pull(
    found: float | None, wanted: float, error: float | None, left_out: float | None
) -> float | None:
    if found is None or error is None or left_out is None or not (error or left_out):
        return None
    return round((found - wanted) / math.hypot(error, left_out), 3)


def begins_widest(scene: Mushroom) -> bool:
    """Tell whether the cycles that are simulated begin where theory's do: where nu is greatest.

    There all particles that take part are free. At a narrower mouth some of the starts, uniform in
    all of the table, lie in the part of the island that opens later: they count as captured, with
    the energy of those that are free, and no energy however high mends that. Later cycles do not
    know of it.
    """
    now = table_at(fp, scene, start_time(scene))
    widest = theory.Cycle.of(scene, DIGITS).nu_max
    return bool(now.w / now.r >= widest * (1 - SAME))


def known(scene: Scene, energy: float) -> theory.FiniteEnergy | None:
    """Return the theory of a scene at an energy; None if it does not cover the scene."""
    try:
        return theory.at_energy(scene, energy) if isinstance(scene, Mushroom) else None
    except NO_THEORY:
        return None


def predicted(spec: RunSpec) -> Theory | None:
    """Return what theory says of a run; None where it covers nothing.

    What finite energy adds to a cycle goes as E^(-1/2) with the energy at which the cycle begins.
    Cycles are independent, so its mean falls by the mean of exp(-s / 2) each. Mean, share and
    variance of a run are all of its energy, or all of the limit.
    """
    if not isinstance(spec.scene, Mushroom) or not begins_widest(spec.scene):
        return None
    try:
        limit = theory.predict(spec.scene, DIGITS)
    except NO_THEORY:
        return None
    m1 = float(limit.m1)
    p_nc = float(limit.p_nc)
    variance = float(limit.sd) ** 2
    there = known(spec.scene, spec.energy)
    if there is None:
        return Theory(m1, p_nc, variance)
    slower = there.mean_of_exp(-0.5)
    left = there.theory_error
    share = math.fsum(slower**k for k in range(spec.n_cycles)) / spec.n_cycles
    return Theory(
        m1 + share * (there.mean_s - m1),
        p_nc + share * (there.p_nc - p_nc),
        variance + share * (there.variance_s - variance),
        share * left.mean_s,
        share * left.p_nc,
    )
