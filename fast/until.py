"""A particle followed until something happens: its first capture, its first release, or an energy.

The event is sought among the collisions of `fast.trajectory`: the arc hit with which a captured stay begins,
the hit with which it ends, or the hit after which the energy is reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from fast.trajectory import Collisions, trajectory
from fast.validation import MAX_STEPS, given_end, given_energy, given_states
from scene import Mushroom, Outcome, Scene, State, check_scene
from scene.geometry import half_width
from scene.laws import values
from scene.refusal import BadInput, check_count, shown

FloatArray = npt.NDArray[np.float64]
EVENTS = ("capture", "release")
FIRST = 1000  # collisions looked at first; ten times as many as long as nothing has happened


class Reached(NamedTuple):
    """Where a particle is when the event happens.

    Attributes:
        state: after the collision at which it happens, with its time `state.t`; None if it does not happen.
        n_collisions: made until then.
        outcome: None, or why the particle was followed no further: Horizon at t_end, or Undefined, Undecided,
            Rejected; None too where as many collisions were made as were allowed.
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
    """Follow a particle, or some, until an event.

    Args:
        scene: table and laws of motion.
        states: the start, or a sequence of starts, each as for `fast.trajectory`.
        until: "capture": the first arc hit with |sin phi| > nu; "release": the first hit that ends a captured
            stay, an arc hit with |sin phi| <= nu or one below the mouth; or an energy v^2 / 2 [length^2 /
            time^2], > 0, that is reached from either side.
        t_end: horizon [time]; infinity for none.
        n_collisions: of each particle at most, 1 to 10^7.

    Returns:
        One `Reached` for one state, else a list.

    Raises:
        BadInput: naming field, value and bound; "capture" and "release" are of a mushroom.

    Source: sec. 3.2 (capture).
    """
    check_scene(scene)
    if until in EVENTS and not isinstance(scene, Mushroom):
        raise BadInput(f"until = {until!r}: table is {type(scene).__name__.lower()}, must be mushroom")
    if isinstance(until, str) and until not in EVENTS:
        raise BadInput(f"until = {shown(until)}, must be {', '.join(EVENTS)} or an energy")
    event = until if isinstance(until, str) else given_energy(until)
    most, end = check_count("n_collisions", n_collisions, 1, MAX_STEPS), given_end(t_end)
    if isinstance(states, State):
        return _reached(scene, states, event, end, most)
    return [_reached(scene, state, event, end, most) for state in given_states(scene, states)]


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
    r, w = values(scene.r, t), half_width(fp, scene, t)  # type: ignore[union-attr]  # no stem has an arc
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
