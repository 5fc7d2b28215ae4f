"""Ensembles that can be continued: some cycles now and more later, with the bits of a single run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fast.ensemble import Ensemble, Plan, planned
from fast.given import given_phases
from fast.kernel import codes
from fast.kernel.kept import LANE_ROWS
from fast.kernel.records import FloatArray
from fast.kernel.worker import is_known_throughout
from fast.pieces import laws_in_lanes
from scene import Scene
from scene.refusal import BadInput, shown
from scene.tables import laws

BY_CYCLE = ("cycle_energies", "t_in", "t_out", "phase_energies", "phase_captured")


class Paused(NamedTuple):
    """An ensemble, and the data needed to continue it.

    A last state is not enough. It lies in the middle of a flight, and a flight restarted there rounds
    differently.

    Attributes:
        ensemble: results up to the end of its last cycle.
        lanes: (N, LANE_ROWS) each particle at its last collision, and its next one, in the stepper's own
            units (`fast.kernel.kept`); nan for one that was not followed to the end.
        asked: table, laws, seed, first and phases of the run, by name; None if a caller has rebuilt the
            object and guarantees them.
    """

    ensemble: Ensemble
    lanes: FloatArray
    asked: dict[str, Any] | None = None


def go_on(
    scene: Scene,
    *,
    n_particles: int,
    energy: float,
    n_cycles: int = 1,
    seed: int = 0,
    first: int = 0,
    threads: int | None = None,
    phases: Sequence[float] = (),
    progress: Callable[[int], None] | None = None,
    before: Paused | None = None,
) -> Paused:
    """Simulate an ensemble that can be continued. The arguments are those of `fast.simulate`.

    `before` is the result of the same call with fewer cycles, or None to begin. `n_cycles` counts all
    cycles, including those of `before`.

    Returns:
        The ensemble that `fast.simulate` returns, to the bit, and the data needed to continue it. A particle
        that was lost before, or had a collision within rounding of the end, is followed from its start.

    Raises:
        BadInput: naming field, value and bound; `before` has another scene, energy, seed, first, phases or
            size; or the cycles reach a time at which the lanes no longer resolve the phases of the laws.
    """
    plan = planned(scene, n_particles, energy, n_cycles, seed, first, threads, phases, progress)
    own: dict[str, Any] = {"seed": plan.seed, "first": plan.first, "phases": given_phases(phases)}
    asked = {"table": type(scene).__name__, **laws(scene), **own}
    if before is None:
        done, seconds = plan.followed(plan.starts(), LANE_ROWS)
        return Paused(plan.ensemble(done, seconds), done.lanes, asked)
    n_before, n_passed = _passed(plan, before)
    _check_same(asked if before.asked is None else before.asked, asked)
    done, seconds = plan.followed(np.full((n_particles, 6), np.nan), LANE_ROWS, before.lanes, n_passed)
    after, anew = plan.ensemble(done, seconds), np.flatnonzero(done.codes == codes.ANEW)
    for name in BY_CYCLE:
        getattr(after, name)[:, :n_before] = getattr(before.ensemble, name)
    if len(anew):
        starts = plan.starts()[anew]
        again, more = plan._replace(progress=None).followed(starts, LANE_ROWS)
        fresh, seconds = plan.ensemble(again, more), seconds + more
        for name in Ensemble._fields[1:-2]:
            getattr(after, name)[anew] = getattr(fresh, name)
        done.lanes[anew] = again.lanes
    seconds += before.ensemble.seconds * before.ensemble.threads / plan.threads
    return Paused(after._replace(seconds=seconds), done.lanes, asked)


def _check_same(there: dict[str, Any], asked: dict[str, Any]) -> None:
    # Two runs of one shape would be joined without a seam: some particles of one, some of the other.
    for name in dict.fromkeys((*asked, *there)):
        if repr(there.get(name)) != repr(asked.get(name)):  # a caller's own may not compare
            raise BadInput(f"before: {name} = {there.get(name)}, must be {asked.get(name)}")


def _passed(plan: Plan, before: Paused) -> tuple[int, int]:
    """Return how many cycles and stops an ensemble has passed, after a look at whether it can go on so."""
    n, n_cycles, looks = plan.size
    if not (
        isinstance(before, Paused)
        and isinstance(before.ensemble, Ensemble)
        and np.ndim(before.lanes) == 2
        and isinstance(before.asked, dict | None)
    ):
        raise BadInput(f"before = {shown(before)}, must be None or what go_on has returned")
    old = before.ensemble
    n_before = old.cycle_energies.shape[1]
    there = (old.energy0, *before.lanes.shape, old.phase_energies.shape[2], old.t_in.shape[2])
    wanted = (plan.energy0, n, LANE_ROWS, looks - 1, plan.stops.narrowings.shape[1])
    for name, found, value in zip(
        ("energy", "n_particles", "rows of lanes", "phases", "narrowings"), there, wanted, strict=True
    ):
        if found != value:
            raise BadInput(f"before: {name} = {found}, must be {value}")
    if not 1 <= n_before <= n_cycles:
        raise BadInput(f"n_cycles = {n_cycles}, must be at least the {n_before} of before")
    n_passed = n_before * (len(plan.stops.times) // n_cycles)
    in_lanes, times = laws_in_lanes(plan.scene), plan.stops.times
    if is_known_throughout(in_lanes, times[n_passed - 1]) != is_known_throughout(in_lanes, times[-1]):
        raise BadInput(
            f"n_cycles = {n_cycles}: beyond the time up to which lanes know the laws' phases. Lanes followed"
            f" the first {n_before} cycles: they cannot be gone on from"
        )
    return n_before, n_passed
