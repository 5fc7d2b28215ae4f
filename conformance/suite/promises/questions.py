"""Questions that promises and timings are held to, on whatever tables and laws an implementation offers."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
from mpmath import fp

from conformance.suite.answers import read_outcome
from conformance.suite.process import Trouble
from conformance.suite.session import Session, missing
from scene import Collision, Fourier, Horizon, Mushroom, Outcome, Scene, State, Undecided, to_data
from scene.geometry import table_at
from scene.tables import Cap, Stem

NEAR = 1e-6  # of sizes: far above rounding that a few steps carry along, far below an error of principle
CARRIED = 1e-4  # of sizes: what a dozen bounces may make of rounding, far below an error of principle
N_REPEATS = 8  # answers to one question, which are all the same
FOREVER = sys.float_info.max  # t_end of a question that only collisions end
STANDING: tuple[Scene, ...] = (Mushroom(r=1.0, w=0.5, h=1.0), Cap(r=1.0), Stem(w=1.0, h=1.25))
BREATHING = Cap(r=Fourier(mean=1.0, cos=(0.1,), omega=1.0))
MOVING: tuple[Scene, ...] = (
    Mushroom(
        r=Fourier(mean=1.0, cos=(0.1,), omega=1.0),
        nu=Fourier(mean=0.55, sin=(0.25,), omega=1.0),
        h=Fourier(mean=1.0, sin=(0.0, 0.1), omega=1.0),
        slope=Fourier(mean=0.1, cos=(0.05,), omega=1.0),
    ),
    BREATHING,
    Stem(w=Fourier(mean=1.0, cos=(0.1,), omega=1.0), h=Fourier(mean=1.25, sin=(0.1,), omega=1.0), slope=0.1),
    *STANDING,
)
INSIDE = {
    Mushroom: State(0.0, 0.1, 0.3, 0.4, -0.9),
    Cap: State(0.0, 0.1, 0.3, 0.4, 0.9),
    Stem: State(0.0, 0.1, -0.3, 0.4, -0.9),
}


def offered(session: Session, scenes: Sequence[Scene], *profiles: str) -> Scene:
    """Return the first scene that an implementation can be asked about in some profiles.

    Raises:
        Trouble: unsupported, naming what is lacking.
    """
    assert session.introduction is not None
    lacking = [
        [part for profile in profiles if (part := missing(session.introduction, profile, to_data(scene)))]
        for scene in scenes
    ]
    if [] in lacking:
        return scenes[lacking.index([])]
    raise Trouble("unsupported", lacking[0][0])


def question(cmd: str, scene: Scene, start: State | Sequence[State], **more: float) -> dict[str, Any]:
    """Return a request, all but its seq; several starts are the states of a flow."""
    place = {"state" if isinstance(start, State) else "states": msgspec.to_builtins(start)}
    return {"cmd": cmd, "scene": to_data(scene), **place, **more}


def repeated(session: Session, request: Mapping[str, Any]) -> dict[str, Any]:
    """Ask one question N_REPEATS times, and return its answer: what differs elsewhere is not for chance then.

    Raises:
        Trouble: also fail, where the answers differ in any bit.
    """
    answer = session.ask(request)
    for _ in range(N_REPEATS - 1):
        if not is_same(other := session.ask(request), answer):
            raise Trouble("fail", f"not deterministic: one question is answered {answer}, then {other}")
    return answer


def follow(session: Session, scene: Scene, state: State, n: int, t_end: float = FOREVER) -> list[Outcome]:
    """Ask for n successive collisions, in one trajectory or, where that is not offered, step by step.

    Raises:
        Trouble: also wrong-format, for a number of steps that cannot be, and declined where it ends
            undecided.
    """
    found = follow_on(session, scene, state, n, t_end)
    if isinstance(last := found[-1], Undecided):
        raise Trouble("declined", f"step {len(found)} of {n}: undecided: {last.reason}")
    return found


def follow_on(session: Session, scene: Scene, state: State, n: int, t_end: float = FOREVER) -> list[Outcome]:
    """Ask for n successive collisions as `follow`; a path may end undecided.

    Raises:
        Trouble: as `follow`, but for declined.
    """
    assert session.introduction is not None
    if missing(session.introduction, "trajectory", to_data(scene)):
        return _follow_by_steps(session, scene, state, n, t_end)
    answer = session.ask(question("trajectory", scene, state, collisions=n, t_end=t_end))
    if "error" in answer:
        raise Trouble("error", answer["error"])
    if "steps" not in answer:
        raise Trouble("fail", f"a trajectory of {n} collisions is answered {answer}"[:200])
    found: list[Outcome] = []
    t = state.t
    for step in answer["steps"]:
        found.append(read_outcome(step, t))
        t = getattr(found[-1], "t", t)
    return _ending_well(found, n)


def _follow_by_steps(session: Session, scene: Scene, state: State, n: int, t_end: float) -> list[Outcome]:
    found: list[Outcome] = []
    while len(found) < n:
        found.append(outcome := session.step(scene, state, t_end))
        if not isinstance(outcome, Collision):
            break
        state = outcome.state()
    return _ending_well(found, n)


def _ending_well(found: list[Outcome], n: int) -> list[Outcome]:
    """Return what is answered, at least that nothing is, where it may be the answer."""
    *before, last = found = found or [Undecided("nothing is answered")]
    if len(found) > n or not all(isinstance(outcome, Collision) for outcome in before):
        raise Trouble("wrong-format", f"{len(found)} steps are answered to a trajectory of {n} collisions")
    if isinstance(last, Collision) and len(found) < n:
        raise Trouble(
            "fail", f"{len(found)} of {n} collisions are answered, and not what came instead of more"
        )
    return found


def flown(session: Session, scene: Scene, states: Sequence[State], t_end: float) -> Sequence[dict[str, Any]]:
    """Carry states to t_end, and return what is answered for each.

    Raises:
        Trouble: also error, when that is the answer, and wrong-format for another number of states.
    """
    answer = session.ask(question("flow", scene, list(states), t_end=t_end))
    if "error" in answer:
        raise Trouble("error", answer["error"])
    found: Sequence[dict[str, Any]] | None = answer.get("states")
    if found is None or len(found) != len(states):
        raise Trouble("wrong-format", f"a flow of {len(states)} states is answered {answer}"[:200])
    return found


def last_collision(session: Session, scene: Scene, state: State, n: int) -> Collision:
    """Follow n collisions, and return the last.

    Raises:
        Trouble: as `follow`; fail when there is another end to it.
    """
    last = follow(session, scene, state, n)[-1]
    if not isinstance(last, Collision):
        raise Trouble("fail", f"a collision must come, and {last} is answered")
    return last


def distance(scene: Scene, a: Outcome, b: Outcome) -> float:
    """Return how far two outcomes are apart: the worst of time, place and velocity, each by its size.

    Infinite for different outcomes or walls. Sizes are those of b, and for the place that of the table.
    """
    if type(a) is not type(b) or getattr(a, "wall", None) != getattr(b, "wall", None):
        return math.inf
    if not (isinstance(a, Collision | Horizon) and isinstance(b, Collision | Horizon)):
        return 0.0
    size = float(table_at(fp, scene, b.t).size)
    parts = (
        (abs(a.t - b.t), abs(b.t)),
        (math.hypot(a.x - b.x, a.y - b.y), size),
        (math.hypot(a.vx - b.vx, a.vy - b.vy), math.hypot(b.vx, b.vy)),
    )
    found = max(gap / extent if extent else (math.inf if gap else 0.0) for gap, extent in parts)
    return math.inf if math.isnan(found) else found


def off_wall(scene: Scene, at: Collision) -> float:
    """Return how far a place is from the wall that it names, as a part of the table's size."""
    table = table_at(fp, scene, at.t)
    gap = abs(table.gap(at.wall, at.x, at.y)) / (table.r if at.wall == "arc" else 1.0)
    found = float(gap / table.size)
    return math.inf if math.isnan(found) else found


def is_same(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Tell whether two answers to one question are the same, numbers and outcome; reasons may differ."""
    return {**a, "reason": ""} == {**b, "reason": ""}


def is_same_stay(a: Sequence[float] | None, b: Sequence[float] | None, span: float) -> bool:
    """Tell whether two captured stays of one particle are the same, but for what bounces make of rounding.

    Args:
        a: begin and end [time], or None for no stay.
        b: likewise.
        span: of the flow [time].
    """
    if a is None or b is None:
        return a is b
    return all(abs(one - other) <= CARRIED * span for one, other in zip(a, b, strict=True))
