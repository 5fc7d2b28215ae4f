"""Given particles: paths from collision to collision, in binary64 or to 31 decimals; until an event; a flow.

A trajectory carries its time as a sum of two floats, and takes the steps of the lanes where they are shown
right (fast.kernel.path). A fine trajectory carries all its numbers so (fast.kernel.fine_step). Events are
sought among the collisions of a trajectory: the arc hit with which a capture interval begins, the hit with
which it ends, or the hit after which an energy is reached. A flow carries particles to a time, as ensembles
are followed.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fast.ensemble import follow_many, least_collisions, only_stop
from fast.kernel import records
from fast.kernel.fates import MOST_TO_A_TIME, Fate
from fast.kernel.fine_step import FineState, fine_path
from fast.kernel.follow import follow_particles
from fast.kernel.path import path_kernel

from fast.kernel.records import (  # isort: skip
    ANCHORS_SHAPE, ANSWER_LOST, Compiled, FloatArray, IntArray, Particle, unfilled_ends,
)  # fmt: skip
from fast.kernel.worker import Loops, follow_path, new_worker
from fast.prepared import prepare

from fast.step import (  # isort: skip
    WALL_NAMES, as_arrays, end_of_path, fitted_start, next_collision, start_at,
)  # fmt: skip
from fast.units import LateTime, Units, scaled

from fast.validation import (  # isort: skip
    MAX_STEPS, check_end, check_energy, check_states, check_threads,
)  # fmt: skip
from scene import InvalidState, Mushroom, Outcome, Rejected, Scene, State, Undecided, Wall, check_scene
from scene.refusal import BadInput, check_count, check_number, shown

NAMES = np.array([WALL_NAMES[code] for code in range(len(WALL_NAMES))], dtype=object)
EVENTS = ("capture", "release")
FIRST = 1000  # collisions looked at first; ten times as many as long as nothing has happened


class Collisions(NamedTuple):
    """Successive collisions, and why they ended.

    Attributes:
        walls: (n,) names of the walls hit.
        steps: (n, 6) dt, t, x, y, vx, vy after each collision.
        outcome: None if all collisions asked for were found, else the outcome that ended the path.
    """

    walls: list[Wall]
    steps: FloatArray
    outcome: Outcome | None


def trajectory(scene: Scene, state: State, n_collisions: int, t_end: float = np.inf) -> Collisions:
    """Follow a particle through `n_collisions` collisions, time carried as a compensated pair.

    Args:
        scene: table and laws of motion.
        state: the start, as for `next_collision`.
        n_collisions: number of collisions to follow, 0 to 10^7.
        t_end: horizon [time], >= state.t; infinity for none.

    Returns:
        The collisions. If t_end is infinite and no wall is met any more (a particle at rest that no wall
        reaches), the outcome is a Horizon at t = infinity with its position.

    Raises:
        BadInput: a bad argument, naming field, value and bound. A state outside the table, or moving into
            the wall that it leaves, is found by the first step: the outcome is then Rejected.
    """
    check_scene(scene)
    t_end = check_end(t_end)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_STEPS)
    prepared = prepare(scene)
    try:
        start, units = start_at(prepared, state, min(t_end, sys.float_info.max))
    except LateTime as error:
        return Collisions([], np.empty((0, 6)), Undecided(str(error)))
    in_lanes = prepared.in_lanes
    exponents = units.of_step()
    rows, (wall,) = as_arrays([start])
    stop = only_stop(units.horizon(t_end))
    kernel, step_at = path_kernel(in_lanes.is_slope_moving, in_lanes.form, n_collisions)
    worker = new_worker(in_lanes, stop, unfilled_ends(rows), loops=Loops(step_at, 0, 0))
    # Steps are brought back in passing: a pass of its own took a quarter of the time.
    halves = np.stack([exponents // 2, exponents - exponents // 2])
    factors = np.ldexp(1.0, np.vstack([halves, -halves]))
    steps, walls = np.empty((n_collisions, 6)), np.empty(n_collisions, np.int64)
    with np.errstate(all="ignore"):  # of what Python follows
        n, code = follow_path(kernel, (worker, wall, factors, steps, walls), n_collisions, stop.called_off)
    steps = steps[:n] if n == n_collisions else steps[:n].copy()  # not all room is held
    outcome: Outcome | None = None
    if n < n_collisions:
        place = place_after(steps, state)
        if code == records.HORIZON and np.isfinite(t_end):
            place, is_kept = scaled(rows[0, 2:], exponents[2:])
            code = code if is_kept.all() else ANSWER_LOST
        outcome = end_of_path(code, scene, state, n, t_end, place)
    return Collisions(NAMES.take(walls[:n]).tolist(), steps, outcome)


def place_after(steps: FloatArray, state: State) -> FloatArray:
    """Return x, y, vx, vy after the last of some steps, or of the start: where it is, what rests stays."""
    return steps[-1, 2:] if len(steps) else np.array([state.x, state.y, state.vx, state.vy])


class FineTrajectory(NamedTuple):
    """Successive collisions as pairs of floats, and why they ended.

    Attributes:
        walls: (n,) names of the walls hit.
        steps: (n, 6, 2) dt, t, x, y, vx, vy after each collision, as sums high + low.
        outcome: None if all collisions asked for were found, else the outcome that ended the path.
    """

    walls: list[Wall]
    steps: FloatArray
    outcome: Outcome | None

    def numbers(self, i: int) -> list[Fraction]:
        """Return dt, t, x, y, vx, vy of a collision, exactly as they are held."""
        return [Fraction(high) + Fraction(low) for high, low in self.steps[i].tolist()]


def fine_trajectory(scene: Scene, state: State, n_collisions: int) -> FineTrajectory:
    """Follow a particle. Each step is right to about 31 decimals for the state that it starts from.

    Along the path the dynamics amplifies errors. If harmonics of a law nearly cancel, the speed of the wall
    is known to fewer decimals: slow particles near such a wall lost up to 6 decimals in tests.

    Args:
        scene: table and laws of motion.
        state: the start, as for `next_collision`.
        n_collisions: number of collisions to follow, 0 to 10^7.

    Returns:
        The collisions. If no wall is met any more (a particle at rest that no wall reaches), the outcome is
        a Horizon at t = infinity with its position. If a wall is met again within some 1e-10 of a period,
        the outcome may be Undecided although `next_collision` decides it.

    Raises:
        BadInput: naming field, value and bound.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1; the scalar step decides which wall is met.
    """
    check_scene(scene)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_STEPS)
    prepared = prepare(scene)
    try:
        start, units = start_at(prepared, state)
    except LateTime as error:
        return FineTrajectory([], np.empty((0, 6, 2)), Undecided(str(error)))
    steps, walls = np.empty((n_collisions, 6, 2)), np.empty(n_collisions, dtype=np.int64)
    end = fill_fine_path(prepared.compiled, start, steps, walls)
    return as_trajectory(scene, state, units, end, steps, walls)


def fill_fine_path(compiled: Compiled, p: Particle, steps: FloatArray, walls: IntArray) -> tuple[int, int]:
    """Fill in steps and walls met, in the kernel's units; returns number of collisions and last code."""
    called_off = np.zeros(1, np.int64)
    fine = FineState(*((number, 0.0) for number in (p.t, p.x, p.y, p.vx, p.vy)))
    given = (compiled, np.zeros(ANCHORS_SHAPE), fine, p.wall, steps, walls, called_off)
    found: tuple[int, int] = follow_path(fine_path, given, len(steps), called_off)
    return found


def as_trajectory(
    scene: Scene, state: State, units: Units, end: tuple[int, int], steps: FloatArray, walls: IntArray
) -> FineTrajectory:
    """Return what the kernel found: some collisions of those asked for, and its last code."""
    n, code = end
    found, is_kept = scaled(steps[:n], units.of_step()[:, None])
    n_exact = int(np.append(is_kept.all(axis=(1, 2)), False).argmin())
    if n_exact < n:
        n, code = n_exact, Fate.ANSWER_LOST.code
    outcome: Outcome | None = None
    if n < len(steps):
        outcome = end_of_path(code, scene, state, n, np.inf, place_after(found[:n, :, 0], state))
    return FineTrajectory(NAMES.take(walls[:n]).tolist(), found[:n], outcome)


class Reached(NamedTuple):
    """Where a particle is when the event happens.

    Attributes:
        state: after the collision at which it happens, with its time `state.t`; None if it does not happen.
        n_collisions: made until then.
        outcome: why the particle was followed no further: Horizon at t_end, or Undefined, Undecided or
            Rejected. None if the event happened, or if the limit of collisions was reached first.
    """

    state: State | None
    n_collisions: int
    outcome: Outcome | None


def follow(
    scene: Scene,
    states: State | Sequence[State],
    until: str | float,
    t_end: float = np.inf,
    n_collisions: int = 10**6,
) -> Reached | list[Reached]:
    """Follow one particle, or several, until an event.

    Args:
        scene: table and laws of motion.
        states: the start, or a sequence of starts, each as for `fast.trajectory`.
        until: "capture": the first arc hit with |sin phi| > nu; "release": the first hit that ends a capture
            interval, an arc hit with |sin phi| <= nu or a hit of a stem wall; or an energy v^2 / 2
            [length^2 / time^2], > 0, that is reached from below or from above.
        t_end: horizon [time]; infinity for none.
        n_collisions: of each particle at most, 1 to 10^7.

    Returns:
        One `Reached` for one state, else a list.

    Raises:
        BadInput: naming field, value and bound; "capture" and "release" need a mushroom.

    Source: sec. 3.2 (capture).
    """
    check_scene(scene)
    if isinstance(until, str) and until in EVENTS and not isinstance(scene, Mushroom):
        raise BadInput(f"until = {until!r}: table is {type(scene).__name__.lower()}, must be mushroom")
    if isinstance(until, str) and until not in EVENTS:
        raise BadInput(f"until = {shown(until)}, must be {', '.join(EVENTS)} or an energy")
    event = until if isinstance(until, str) else check_energy(check_number("until", until))
    most, end = check_count("n_collisions", n_collisions, 1, MAX_STEPS), check_end(t_end)
    if isinstance(states, State):
        return _reached(scene, states, event, end, most)
    return [_reached(scene, state, event, end, most) for state in check_states(scene, states)]


def _reached(scene: Scene, start: State, event: str | float, t_end: float, most: int) -> Reached:
    n = min(FIRST, most)
    while True:
        path = trajectory(scene, start, n, t_end)
        k = _first(scene, start, path, event)
        if k is not None:
            _, t, x, y, vx, vy = path.steps[k].tolist()
            return Reached(State(t, x, y, vx, vy, path.walls[k]), k + 1, None)
        if n == most or len(path.walls) < n:
            return Reached(None, len(path.walls), path.outcome)
        n = min(10 * n, most)


def _first(scene: Scene, start: State, path: Collisions, event: str | float) -> int | None:
    """Return the number of the collision at which an event happens first, from 0; None without any."""
    if isinstance(event, str):
        first = [start.t, start.x, start.y, start.vx, start.vy]
        is_in = captured(scene, np.vstack([first, path.steps[:, 1:]]), path.walls)
        happens = is_in[1:] if event == "capture" else is_in[:-1] & ~is_in[1:]
    else:
        energies = (path.steps[:, 4] ** 2 + path.steps[:, 5] ** 2) / 2
        is_below = start.vx**2 + start.vy**2 < 2 * event
        happens = energies >= event if is_below else energies <= event
    found = np.flatnonzero(happens)
    return int(found[0]) if len(found) else None


def sin_phi(scene: Scene, states: FloatArray, hits: npt.NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Return sin phi and nu at hits of the arc.

    Args:
        scene: a cap or a mushroom.
        states: (n + 1, 5) t, x, y, vx, vy at the start and after each collision.
        hits: (m,) which of the collisions are of the arc, from 0.

    Returns:
        (m,) sin of the angle to the normal before the bounce, clockwise > 0 (Eq:sinphi); (m,) nu.
    """
    before, (t, x, y, vx, vy) = states[hits], states[hits + 1].T
    r = scene.laws["r"].values(t)
    w = scene.width.values(t)
    # The speed of the flight that ends here; the bounce keeps the angular momentum about the centre.
    sine: FloatArray = (y * vx - x * vy) / (np.hypot(before[:, 3], before[:, 4]) * r)
    return sine, w / r


def captured(scene: Scene, states: FloatArray, walls: Sequence[str]) -> npt.NDArray[np.bool_]:
    """Return (n + 1,): whether a particle in a mushroom is captured on the flight from each state.

    A stay begins with an arc hit at which |sin phi| > nu. It ends with an arc hit at which that is no longer
    so, or below the mouth. `states` and `walls` are those of a path; see `sin_phi`.
    """
    hits = np.array([k for k, wall in enumerate(walls) if wall == "arc"], np.int64)
    sines, nu = sin_phi(scene, states, hits)
    at_arc = dict(zip(hits.tolist(), (np.abs(sines) > nu).tolist(), strict=True))
    found = np.zeros(len(walls) + 1, bool)
    # A particle that is captured at the first hit of the arc was so before, by way of the base too, which
    # keeps |sin phi|; one that comes through a mouth that narrows meanwhile was not.
    first = next((k for k, wall in enumerate(walls) if wall != "base"), -1)
    found[0] = bool(states[0, 2] >= 0) and at_arc.get(first, False)
    for k, wall in enumerate(walls):
        found[k + 1] = at_arc[k] if wall == "arc" else found[k] and wall == "base"
    return found


FEW = 100  # collisions: these take less time than to start a thread, and an interrupt can wait for them


class Flow(NamedTuple):
    """N particles at t_end.

    Attributes:
        outcomes: (N,) Horizon with the state at t_end; Undefined or Undecided for a particle lost before.
            A particle in a moving table is also Undecided after 10^7 collisions.
        t_in, t_out: (N,) the first capture interval in the cap [time], cut at t_end; nan for none.
        wall_counts: (N, 5) collisions with arc, base, left, right, floor.
        n_careful: (N,) number of collisions computed by the scalar step, not by the SIMD lanes.
    """

    outcomes: list[Outcome]
    t_in: FloatArray
    t_out: FloatArray
    wall_counts: IntArray
    n_careful: IntArray


def flow(scene: Scene, states: Sequence[State], t_end: float, threads: int | None = None) -> Flow:
    """Carry particles to t_end.

    Args:
        scene: table and laws of motion.
        states: the starts, each as for `next_collision`, with t <= t_end.
        t_end: when to stop [time], finite.
        threads: number of threads; default: one per core. The results do not depend on it.

    Raises:
        InvalidState: a start is not a State or not in this table; the particle is named.
        BadInput: another argument is bad; naming field, value and bound.

    Source: captured means |sin phi| > nu at the arc, sec. 3.2.
    """
    check_scene(scene)
    threads = check_threads(threads)
    states = check_states(scene, states)
    t_end = check_number("t_end", t_end)
    refusals = [refuse(scene, state, t_end) for state in states]
    for i, refusal in enumerate(refusals):
        if isinstance(refusal, Rejected):
            raise InvalidState(f"particle {i}: {refusal.reason}")
    return carry(scene, states, refusals, t_end, threads)[0]


def carry(
    scene: Scene, states: Sequence[State], refusals: Sequence[Outcome | None], t_end: float, threads: int
) -> tuple[Flow, float]:
    """Carry particles to t_end, those whose units agree together; those refused stay where they are.

    Returns:
        What became of them, and the seconds that the threads took, if any were started.

    Raises:
        BadInput: the scene does not fit into binary64: see fast.units.
    """
    prepared = prepare(scene)
    starts = {i: fitted_start(prepared, states[i]) for i, refusal in enumerate(refusals) if refusal is None}
    every, outcomes, seconds = unfilled_ends(np.empty((len(states), 6))), list(refusals), 0.0
    for units in sorted({units for _, units in starts.values()}):
        those = [i for i, start in starts.items() if start[1] == units]
        rows, walls = as_arrays([starts[i][0] for i in those])
        done = unfilled_ends(rows)
        stop = only_stop(units.horizon(t_end))
        fastest, longest = np.hypot(rows[:, 4], rows[:, 5]).max(), stop.times[0] - rows[:, 0].min()
        if len(rows) * least_collisions(prepared.compiled, fastest, longest) < FEW and all(
            len(trajectory(scene, states[i], FEW, t_end).walls) < FEW for i in those
        ):  # as a path each is short: the bound alone is no argument, for a particle may skip along the arc
            follow_particles(new_worker(prepared.in_lanes, stop, done), walls)
        else:
            seconds += follow_many(prepared.in_lanes, done, walls, stop, threads)
        # t, its low part, x, y, vx, vy; begin and end of the capture interval
        numbers = np.column_stack([done.states, done.t_in[:, 0, 0], done.t_out[:, 0, 0]])
        numbers, is_kept = scaled(numbers, np.append(units.of_step(), [units.time, units.time]))
        is_lost = ~is_kept.all(axis=1)
        done.codes[is_lost], numbers[is_lost, 6:] = ANSWER_LOST, np.nan
        done.t_in[:, 0, 0], done.t_out[:, 0, 0] = numbers[:, 6], numbers[:, 7]
        for whole, own in zip(every, done, strict=True):
            whole[those] = own
        ends = zip(those, done.codes.tolist(), done.counts.sum(axis=1), numbers[:, 2:6], strict=True)
        for i, code, n, place in ends:
            outcomes[i] = end_of_path(code, scene, states[i], n, t_end, place)
    found = [outcome for outcome in outcomes if outcome is not None]
    return Flow(found, every.t_in[:, 0, 0], every.t_out[:, 0, 0], every.counts, every.careful), seconds


def refuse(scene: Scene, state: State, t_end: float) -> Rejected | Undecided | None:
    """Return why a particle cannot start so, or is not followed so far; else None."""
    outcome = next_collision(scene, state, t_end)
    if isinstance(outcome, Rejected | Undecided):
        return outcome
    prepared = prepare(scene)
    p, units = fitted_start(prepared, state)
    ahead = least_collisions(prepared.compiled, math.hypot(p.vx, p.vy), units.horizon(t_end) - p.t)
    if ahead > MOST_TO_A_TIME:
        return Undecided(f"t_end = {t_end!r} is over {ahead:.0e} collisions away, must be at most 1e7")
    return None
