"""Promises on flows whose arrivals are known exactly: of particles nearly alike, and of long ways.

Particles that differ from each other in one field alone, be it the time or the wall, arrive each in its own
place or not at all; they fly straight, so that the place is known. And where walls at rest are met head on
the path comes back again and again, so that after 1500 hits the place is known as well.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from msgspec.structs import replace

from conformance.suite.answers import read_arrival
from conformance.suite.process import Trouble
from conformance.suite.promises.questions import CARRIED, NEAR, STANDING, distance, flown, offered
from conformance.suite.session import Session
from scene import Cap, Horizon, Mushroom, Scene, State, Stem, Undecided

T_END = 1.5
ASIDE = 2.0**-22  # how far beyond its wall a state is: a quarter of what is allowed who names it
N_HITS = 1500  # of a long flow; one a unit of time
# Starts of orbits of period 2, and where they lead within the last quarter of a unit, which holds no hit.
RETURNING = {
    Mushroom: State(0.0, 0.0, -0.5, 1.0, 0.0),
    Cap: State(0.0, 0.0, 0.5, 0.0, 1.0),
    Stem: State(0.0, 0.25, -0.5, 0.0, 1.25),
}


class Twin(NamedTuple):
    """A state of a flow that meets nothing, or must be refused."""

    state: State
    is_good: bool = True


def twin_particles(session: Session) -> str:
    """Particles that differ in one field alone are told apart in a flow, whichever comes first."""
    n = n_open = 0
    for scene in _offered(session):
        there = list(twins(scene))
        for particles in (there, there[::-1]):
            found = flown(session, scene, [one.state for one in particles], T_END)
            for i, (one, answer) in enumerate(zip(particles, found, strict=True)):
                outcome = read_arrival(answer)
                n += 1
                if isinstance(outcome, Undecided):
                    n_open += 1
                elif one.is_good and distance(scene, outcome, _flown_on(one.state, T_END)) > NEAR:
                    raise Trouble(
                        "fail", f"states[{i}], {one.state}, flies straight on, is answered {answer}"
                    )
                elif not one.is_good and answer["outcome"] != "rejected":
                    raise Trouble("fail", f"states[{i}], {one.state}, must be rejected, is answered {answer}")
    return _told(n, n_open, "states")


def twins(scene: Scene) -> list[Twin]:
    """Return particles that differ from one before in a single field."""
    way = -1.0 if isinstance(scene, Stem) else 1.0
    first = State(0.0, 0.125, 0.25 * way, 0.0625, 0.03125)
    changes: list[dict[str, Any]] = [
        {"t": 0.5},
        {"x": 0.25},
        {"y": 0.375 * way},
        {"vx": 0.125},
        {"vy": -0.0625},
    ]
    found = [Twin(first), *(Twin(replace(first, **change)) for change in changes), Twin(first)]
    beyond = State(0.0, -1.0 - ASIDE, -0.5, 0.125, 0.0, "left")
    if isinstance(scene, Mushroom):
        beyond = replace(beyond, x=-0.5 - ASIDE)
        # Who names the base, and moves down, moves into it; who does not is in the open mouth.
        falling = State(0.0, 0.125, 0.0, 0.0625, -0.125)
        found += [Twin(replace(falling, wall="base"), is_good=False), Twin(falling)]
    elif isinstance(scene, Cap):
        beyond = State(0.0, 0.6 * (1.0 + ASIDE), 0.8 * (1.0 + ASIDE), -0.125, -0.125, "arc")
    return [*found, Twin(beyond), Twin(replace(beyond, wall=None), is_good=False), Twin(beyond)]


def long_flow(session: Session) -> str:
    """A flow still meets its walls after a thousand hits."""
    n = n_open = 0
    t_end = N_HITS + 0.25
    for scene in _offered(session):
        start = RETURNING[type(scene)]
        (answer,) = flown(session, scene, [start], t_end)
        outcome, due = read_arrival(answer), replace(_flown_on(start, 0.25), t=t_end)
        n += 1
        if isinstance(outcome, Undecided):
            n_open += 1
        elif distance(scene, outcome, due) > CARRIED:
            raise Trouble("fail", f"after {N_HITS} hits head on {outcome}, must be {due}, in {scene}")
    return _told(n, n_open, f"flows of {N_HITS} hits")


def _offered(session: Session) -> list[Scene]:
    """Return the tables at rest that flows are offered in."""
    found = []
    for scene in STANDING:
        try:
            found.append(offered(session, (scene,), "flow"))
        except Trouble as trouble:
            lacking = trouble
    if not found:
        raise lacking
    return found


def _flown_on(state: State, t: float) -> Horizon:
    """Return where a straight flight is at time t."""
    dt = t - state.t
    return Horizon(t, state.x + state.vx * dt, state.y + state.vy * dt, state.vx, state.vy)


def _told(n: int, n_open: int, what: str) -> str:
    if n_open:
        raise Trouble("declined", f"{n_open} of {n} {what} are undecided")
    return f"{n} {what}"
