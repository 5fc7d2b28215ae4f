"""An adapter kit: an engine that was not written for protocol 1 speaks it with one call.

Copy this file, or import it. An engine gives one of two things:

    serve_engine(name, next_hit)            (scene, state) -> (t, x, y, vx, vy) just after its next hit
    serve_parts(name, intersect, reflect)   the first crossing of one wall, and the bounce off it

The kit reads and checks the questions, keeps the horizon, names the wall (least |f| / |grad f| at the place
of the hit), chains trajectories and flows, times them, and refuses what is no state of the scene. Where it
sees that rounding leaves two answers open it says `undecided`. So may an engine, by raising `Open`: of how
near it came to another wall, or to the horizon, a next hit tells nothing. What it returns that is no hit
(nan, a time that has passed) is answered as a failure of its own.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from time import perf_counter_ns

from mpmath import fp
from msgspec.structs import replace

from conformance import plain
from scene import (
    BadInput,
    Cap,
    Collision,
    Horizon,
    Mushroom,
    Outcome,
    Rejected,
    Scene,
    State,
    Undecided,
    Undefined,
    Wall,
)
from scene.geometry import TableAt, placed, table_at
from scene.laws import bounds
from scene.protocol.messages import Answered, AnsweredCollision
from scene.protocol.wire import AnsweringStepper, Captured, OwnFailure, serve
from scene.states import ON_WALL, check_numbers
from scene.tables import laws

ROUNDING = 2.0**-44  # of the table's size: nearer to a wall than this, a place may be on either side of it
TIE = 2.0**-46  # relative: hits nearer to each other than this may come in either order
LARGEST = 1e100  # squares of numbers far beyond overflow
Hit = tuple[float, float, float, float, float]  # t, x, y, vx, vy, after the bounce
NextHit = Callable[[Scene, State], Hit | None]
# (scene, wall, state, after, until) -> the first s, after < s <= until, at which the wall's f falls through
# 0, at the time state.t + s, on the line of the flight, wherever the wall ends; None for none. On state.wall
# f(0) is 0.
Intersect = Callable[[Scene, Wall, State, float, float], float | None]
# (scene, wall, t, x, y, vx, vy) -> the velocity after the bounce.
Reflect = Callable[[Scene, Wall, float, float, float, float, float], tuple[float, float]]


class Open(Exception):  # noqa: N818 (a question left open is no error)
    """Raised by an engine that cannot decide: answered `undecided`, with this text."""


def serve_engine(name: str, next_hit: NextHit) -> None:
    """Answer protocol 1 for an engine that finds the next hit; None for a particle that meets nothing.

    Args:
        name: of the engine.
        next_hit: (scene, state) -> t, x, y, vx, vy just after the next hit, however late. state.wall is the
            wall that the particle leaves; an engine that has no use for it takes the other five.
    """

    def step(scene: Scene, state: State, t_end: float) -> Answered | Outcome:
        return judged(scene, state, t_end) or _answer_of(next_hit, scene, leaving(scene, state), t_end)

    _serve(name, step)


def serve_parts(name: str, intersect: Intersect, reflect: Reflect) -> None:
    """Answer protocol 1 for functions that intersect and reflect; the kit finds out which wall is first.

    Args:
        name: of the engine.
        intersect: see `Intersect`.
        reflect: see `Reflect`.
    """

    def step(scene: Scene, state: State, t_end: float) -> Answered | Outcome:
        try:
            start = leaving(scene, state)
            return judged(scene, state, t_end) or _first_of(intersect, reflect, scene, start, t_end)
        except Open as question:
            return Undecided(str(question))

    _serve(name, step)


def judged(scene: Scene, state: State, t_end: float) -> Outcome | None:
    """Judge a state before any flight: rejected, undefined, undecided, or None for a sound one.

    Raises:
        BadInput: numbers that are none; `serve` answers `rejected`.
    """
    check_numbers(scene, state, t_end)
    if max(abs(number) for number in (state.x, state.y, state.vx, state.vy)) > LARGEST:
        return Undecided(f"numbers beyond {LARGEST:g} may overflow")
    table, wall = table_at(fp, scene, state.t), leaving(scene, state).wall
    place = f"state (x, y) = ({state.x!r}, {state.y!r}) at t = {state.t!r}"
    if wall is None and state.y == state.vy == 0:
        return Undecided("it flies along the mouth")
    if wall not in (None, "base") and state.y == 0:
        return Undecided(f"{place} is in a corner")
    size = float(table.size) + abs(state.t) * _rates(table, state)
    near = near_walls(scene, is_in_cap(scene, state))
    # On y = 0 the mouth ends at the sides, and the base at the arc.
    ends: tuple[Wall, ...] = ("arc", "left", "right") if wall is None and state.y == 0 else ()
    for other in (*ends, *near):
        gap = gap_at(table, other, state.x, state.y)
        if other != wall and abs(gap) <= ROUNDING * size:
            return Undecided(placed(scene, state, other, "within rounding of"))
        if other != wall and gap < 0 and other in near:
            return Rejected(placed(scene, state, other, "beyond"))
    if wall is None:
        return None
    own = {"arc": table.r, "floor": table.h, "base": max(table.r, table.w)}.get(
        wall, max(table.w, abs(state.x))
    )
    is_beyond = isinstance(scene, Mushroom) and (
        state.y < 0 if wall == "arc" else state.y > 0 and wall != "base"
    )
    off = abs(gap_at(table, wall, state.x, state.y)) - ON_WALL * float(own)
    if is_beyond or off > ROUNDING * size:
        return Rejected(f"{place} is not on wall {wall}")
    if off > 0:
        return Undecided(f"{place} may be on wall {wall} within rounding of its phase")
    rate = float(table.gap_rate(wall, state.x, state.y, state.vx, state.vy))
    if wall == "base" and rate == 0:
        return Undefined("sliding")
    terms = math.hypot(state.vx, state.vy) + _rates(table, state)
    turns = abs(state.t) * _curvatures(scene) if rate < 0 else 0.0
    scale = float(table.r) + math.hypot(state.x, state.y) if wall == "arc" else 1.0
    if wall != "base" and abs(rate) <= ROUNDING * (terms + turns) * scale:
        return Undecided(f"it rests on wall {wall}, or nearly")
    return Rejected(f"state.wall = {wall!r}: the particle moves into it") if rate < 0 else None


def leaving(scene: Scene, state: State) -> State:
    """Return a state that names its wall: on y = 0 of a cap or a stem that is the base, said or not."""
    is_on_base = state.wall is None and state.y == 0 and not isinstance(scene, Mushroom)
    return replace(state, wall="base") if is_on_base else state


def gap_at(table: TableAt, wall: Wall, x: float, y: float) -> float:
    """Return a wall's f as a length, positive inside."""
    gap = float(table.gap(wall, x, y))
    return gap / (float(table.r) + math.hypot(x, y)) if wall == "arc" else gap


def _rates(table: TableAt, state: State) -> float:
    """Return the speed at which the walls may move under a time that is rounded, by its last digit's size."""
    speed = abs(table.r_rate) + abs(table.w_rate) + abs(table.h_rate) + abs(table.slope_rate * state.y)
    return float(speed)


def _curvatures(scene: Scene) -> float:
    """Return by how much walls may turn in a unit of time: their rates under a time that is rounded."""
    known = {name: bounds(law) for name, law in laws(scene).items()}
    reach = {
        "nu": known["r"].highest if "r" in known else 0.0,
        "slope": known["h"].highest if "h" in known else 0.0,
    }
    return sum(law.curvature * reach.get(name, 1.0) for name, law in known.items())


def is_in_cap(scene: Scene, state: State) -> bool:
    """Tell whether a flight begins in the cap."""
    if not isinstance(scene, Mushroom):
        return isinstance(scene, Cap)
    is_above = state.y > 0 or (state.y == 0 and state.vy > 0)
    return state.wall in ("arc", "base") or (state.wall is None and is_above)


def near_walls(scene: Scene, is_in_cap: bool) -> tuple[Wall, ...]:
    """List the walls of one part of the table; a mushroom's base is met at y = 0, beside the mouth."""
    near: tuple[Wall, ...] = ("arc",) if is_in_cap else ("left", "right", "floor")
    return near if isinstance(scene, Mushroom) else ("base", *near)


def _answer_of(next_hit: NextHit, scene: Scene, state: State, t_end: float) -> Answered:
    try:
        hit = next_hit(scene, state)
    except Open as question:
        return Undecided(str(question))
    except (ArithmeticError, ValueError) as error:  # of its arithmetic: it has no answer
        raise OwnFailure(f"the engine raised {type(error).__name__}: {error}") from None
    if hit is not None and not (all(map(math.isfinite, hit)) and hit[0] >= state.t):
        raise OwnFailure(f"the engine returned {hit}")
    if hit is None or hit[0] >= t_end:
        return _horizon(state, t_end)
    t, x, y, vx, vy = hit
    wall = table_at(fp, scene, t).nearest_wall(x, y)
    return AnsweredCollision(wall=wall, t=t, x=x, y=0.0 if wall == "base" else y, vx=vx, vy=vy)


def _horizon(state: State, t_end: float) -> Horizon:
    s = t_end - state.t
    return Horizon(t_end, state.x + s * state.vx, state.y + s * state.vy, state.vx, state.vy)


def _first_of(intersect: Intersect, reflect: Reflect, scene: Scene, state: State, t_end: float) -> Answered:
    horizon, inside = t_end - state.t, is_in_cap(scene, state)
    end = min(horizon, _escape(scene, state))
    is_towards = state.y > 0 > state.vy or state.y < 0 < state.vy
    has_mouth = isinstance(scene, Mushroom) and is_towards and state.wall != "base"
    crossing = -state.y / state.vy if has_mouth else math.inf
    hits = _hits(intersect, scene, state, inside, 0.0, (1 + TIE) * min(crossing, end))
    s, wall = _earliest([*hits, (crossing, None), (end, None)])
    if s == crossing:
        dx, w = crossing * state.vx, float(table_at(fp, scene, state.t + crossing).w)
        room = w - abs(state.x + dx)
        if abs(room) <= TIE * (w + abs(state.x) + abs(dx)):
            raise Open("the mouth's edge is met within rounding")
        if room > 0:
            hits = _hits(intersect, scene, state, not inside, crossing, (1 + TIE) * end)
            if hits and hits[0][0] - crossing <= TIE * crossing:
                raise Open("a wall is met at the mouth within rounding")
            s, wall = _earliest([*hits, (end, None)])
        elif inside:
            wall = "base"
    if wall is None and s < horizon:
        raise Open("no wall is met in the time that it takes to leave the table")
    if wall is None:
        return _horizon(state, t_end)
    x, y, t = state.x + s * state.vx, state.y + s * state.vy, state.t + s
    vx, vy = reflect(scene, wall, t, x, y, state.vx, state.vy)
    y = 0.0 if wall == "base" else y
    return AnsweredCollision(wall=wall, dt=s, t=t, x=x, y=y, vx=vx, vy=vy)


def _earliest(met: list[tuple[float, Wall | None]]) -> tuple[float, Wall | None]:
    """Return the earliest of what is met, walls by name; Open where another is met within rounding of it."""
    first, second, *_ = sorted([*met, (math.inf, None)], key=lambda found: found[0])
    if second[0] - first[0] <= TIE * first[0]:
        raise Open(f"{first[1] or 'no wall'} and {second[1] or 'no wall'} come within rounding of each other")
    return first


def _escape(scene: Scene, state: State) -> float:
    """Return a time in which a particle leaves the table at its largest, whichever way it flies."""
    largest = {name: bounds(law).highest for name, law in laws(scene).items()}
    extent = sum(largest.get(name, 0.0) for name in ("r", "w", "h"))
    speed = math.hypot(state.vx, state.vy)
    return 8 * extent / speed if speed > sys.float_info.min else math.inf


def _hits(
    intersect: Intersect, scene: Scene, state: State, inside: bool, after: float, until: float
) -> list[tuple[float, Wall]]:
    """List the walls of one part of the table that are met, by the time of the first crossing of each."""
    found = []
    for wall in near_walls(scene, inside):
        s = intersect(scene, wall, state, after, until)
        if s is not None:
            found.append((s, wall))
    return sorted(found)


def _serve(name: str, step: AnsweringStepper) -> None:
    def follow(scene: Scene, state: State, n_collisions: int, t_end: float) -> list[Answered | Outcome]:
        steps: list[Answered | Outcome] = []
        while len(steps) < n_collisions:
            steps.append(hit := step(scene, state, t_end))
            if not isinstance(hit, AnsweredCollision):
                break
            state = State(hit.t, hit.x, hit.y, hit.vx, hit.vy, hit.wall)
        return steps

    def collide(scene: Scene, state: State, t_end: float) -> Outcome:
        try:
            hit = step(scene, state, t_end)
        except BadInput as refusal:  # of one particle; the others go on
            return Rejected(str(refusal))
        if not isinstance(hit, AnsweredCollision):
            return hit
        assert hit.wall is not None
        return Collision(hit.wall, hit.t - state.t, hit.t, hit.x, hit.y, hit.vx, hit.vy)

    def carry(scene: Scene, states: Sequence[State], t_end: float) -> list[tuple[Outcome, Captured]]:
        return plain.flow(scene, states, t_end, collide)

    def timed(
        scene: Scene, state: State, n_collisions: int, repeat: int
    ) -> tuple[list[int], Answered | Outcome]:
        ns = []
        for _ in range(repeat):
            begin = perf_counter_ns()
            steps = follow(scene, state, n_collisions, sys.float_info.max)
            ns.append(perf_counter_ns() - begin)
        return ns, steps[-1]

    serve(name, step, follow, sys.stdin.buffer, sys.stdout.buffer, flow=carry, timer=timed)
