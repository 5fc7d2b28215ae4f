"""The promise that a trajectory says how it ends.

Its steps are as many collisions as are asked for, and no more, none where none are; or fewer, and then last
what came instead of a further one: a horizon, or what mathematics leaves undefined.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from msgspec.structs import replace

from conformance.suite.process import Trouble
from conformance.suite.promises.questions import INSIDE, offered, question
from conformance.suite.session import Session
from scene import Cap, Mushroom, Scene, State, Stem

T_END = 100.0
SCENES: tuple[Scene, ...] = (Mushroom(r=1.0, w=0.5, h=1.0), Cap(r=1.0), Stem(w=1.0, h=1.5))
# Starts that meet two walls at once at t = 0.5, whose numbers are exact.
CORNERS = {
    Mushroom: State(0.0, 0.25, -0.5, 0.5, -1.0),
    Cap: State(0.0, 0.5, 0.25, 1.0, -0.5),
    Stem: State(0.0, 0.0, -0.75, 2.0, -1.5),
}
# Likewise after hits: of the base at t = 0.25, before the corner at t = 1.
LATER_CORNER = State(0.0, 0.0, -0.5, 1.0, 2.0)


class AskedPath(NamedTuple):
    """A question for a trajectory, and the outcomes that its steps may have where that is known."""

    state: State
    n: int
    t_end: float
    due: tuple[str, ...] | None = None


def trajectory_ends(session: Session) -> str:
    """The steps of a trajectory are those asked for, and last what came instead of more.

    Raises:
        Trouble: fail for steps too many or too few; declined where a step is undecided; unsupported.
    """
    n = n_open = 0
    for scene in SCENES:
        try:
            offered(session, (scene,), "trajectory")
        except Trouble as trouble:
            lacking = trouble
            continue
        for path in _paths(scene):
            found = _outcomes(session, scene, path)
            n += 1
            if found[-1:] == ["undecided"] and len(found) <= path.n:
                n_open += path.due is not None  # at a corner it may be
                continue
            *before, last = found or ["nothing"]
            is_ended = len(found) == path.n or last not in ("collision", "nothing")
            wanted = f"{path.n} steps, or fewer and last what came instead"
            if path.due is not None:
                is_ended, wanted = found == list(path.due), f"{list(path.due)}"
            if not is_ended or len(found) > path.n or any(outcome != "collision" for outcome in before):
                what = f"a trajectory of {path.n} collisions from {path.state} to {path.t_end}"
                raise Trouble("fail", f"{what} is answered {found}, must be {wanted}, in {scene}")
    if not n:
        raise lacking
    if n_open:
        raise Trouble("declined", f"{n_open} of {n} trajectories are undecided")
    return f"{n} trajectories"


def _paths(scene: Scene) -> Iterator[AskedPath]:
    inside, corner = INSIDE[type(scene)], CORNERS[type(scene)]
    for n in (0, 1, 4):
        yield AskedPath(inside, n, T_END, ("collision",) * n)
        yield AskedPath(inside, n, 2.0**-6, ("horizon",)[:n])
        yield AskedPath(corner, n, T_END)
    sliding = State(0.0, 0.75, 0.0, 0.1, 0.0, "base")
    yield AskedPath(sliding, 3, T_END)
    if isinstance(scene, Stem):
        yield AskedPath(LATER_CORNER, 5, T_END)
        yield AskedPath(replace(LATER_CORNER, vx=0.25), 5, 0.5, ("collision", "horizon"))


def _outcomes(session: Session, scene: Scene, path: AskedPath) -> list[str]:
    """Ask for a path, and return the outcomes of its steps."""
    request = question("trajectory", scene, path.state, collisions=path.n, t_end=path.t_end)
    answer = session.ask(request)
    if "error" in answer:
        raise Trouble("error", answer["error"])
    if "steps" not in answer:
        raise Trouble("fail", f"a trajectory of {path.n} collisions is answered {answer}"[:200])
    return [str(step["outcome"]) for step in answer["steps"]]
