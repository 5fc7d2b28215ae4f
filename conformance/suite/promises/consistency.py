"""Promises that answers to one thing agree: of `step`, `trajectory` and `flow`, alone and with others."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import msgspec
from mpmath import fp

from conformance.suite.answers import read_arrival
from conformance.suite.process import Trouble
from conformance.suite.promises.questions import (
    BREATHING,
    CARRIED,
    INSIDE,
    MOVING,
    NEAR,
    STANDING,
    distance,
    flown,
    follow,
    is_same_stay,
    offered,
)
from conformance.suite.session import Session, missing
from scene import Cap, Collision, Horizon, Mushroom, Outcome, Scene, State, Stem, Undecided, to_data
from scene.geometry import half_width

N_LONG, N_PIECE = 1200, 430  # collisions of a whole trajectory, and of its first piece
N_MOVING, N_SINGLE = 600, 16  # collisions of a trajectory between moving walls, and how many are asked alone
FAR_TIMES = -1000.0, 10_000.0  # from which such trajectories begin
N_FLOWN = 16  # particles that `flow` and `trajectory` both carry
# Starts on orbits whose errors grow slowly: of a mushroom, one that stays in the cap.
REGULAR = {
    Mushroom: State(0.0, 0.75, 0.25, 0.1, 4.0),
    Cap: State(0.0, 0.1, 0.2, 3.0, 4.0),
    Stem: State(0.0, 0.1, -0.2, 0.3, -0.43),
}


def flow_alone(session: Session) -> str:
    """Each state of a flow is answered in its place, and as when asked alone, whatever the others are."""
    scene = offered(session, STANDING, "flow")
    states, allowed = mixed_states(scene)
    together = flown(session, scene, states, 1.5)
    for i, (state, found) in enumerate(zip(states, together, strict=True)):
        (alone,) = flown(session, scene, [state], 1.5)
        if found["outcome"] not in allowed[i]:
            raise Trouble("fail", f"states[{i}]: {found}, must be {' or '.join(allowed[i])}")
        gap = distance(scene, read_arrival(found), read_arrival(alone))
        if gap > NEAR or not is_same_stay(found.get("captured"), alone.get("captured"), 1.5):
            raise Trouble("fail", f"states[{i}]: {found} among others, {alone} alone")
    if flown(session, scene, [], 1.5):
        raise Trouble("fail", "a flow of no states is answered with some")
    n_open = sum(
        found["outcome"] == "undecided" for found, ways in zip(together, allowed, strict=True) if ways == GOOD
    )
    if n_open:
        raise Trouble("declined", f"{n_open} of {len(states)} states undecided")
    return f"{len(states)} states"


GOOD = ("horizon", "undecided")
OPEN = ("undefined", "undecided")


def mixed_states(scene: Scene) -> tuple[list[State], list[tuple[str, ...]]]:
    """Return states of all kinds (good, outside, sliding, bound for a corner), and what each may come to."""
    good = INSIDE[type(scene)]
    again = msgspec.structs.replace(good, x=-0.2, vx=0.35)
    outside = msgspec.structs.replace(good, y=5.0)
    into = State(0.0, 0.75, 0.0, 0.3, 0.7 if isinstance(scene, Stem) else -0.7, "base")
    sliding = State(0.0, 0.75, 0.0, 0.1, 0.0, "base")
    # Both walls are met at t = 0.5; in the cap the corner of arc and base.
    corner = State(0.0, 0.5, 0.25, 1.0, -0.5)
    if isinstance(scene, Stem):
        corner = State(0.0, 0.0, -0.625, 2.0, -1.25)
    elif isinstance(scene, Mushroom):
        corner = State(0.0, 0.25, -0.5, 0.5, -1.0)
    bad = ("rejected",)
    return [good, outside, again, into, corner, good, sliding, again], [
        GOOD,
        bad,
        GOOD,
        bad,
        OPEN,
        GOOD,
        OPEN,
        GOOD,
    ]


def long_trajectory(session: Session) -> str:
    """Collisions asked at once are as many as asked for, and those that are found piece by piece.

    In a cap that breathes, where that is offered: an error that begins late, of an energy that is no longer
    changed too, begins in the pieces at another collision than in the whole.
    """
    scene = offered(session, (BREATHING, *STANDING), "trajectory")
    start = REGULAR[type(scene)]
    whole = follow(session, scene, start, N_LONG)
    first = follow(session, scene, start, N_PIECE)
    middle = first[-1]
    if not isinstance(middle, Collision):
        raise Trouble("fail", f"a collision must come, and {middle} is answered")
    pieces = [*first, *follow(session, scene, middle.state(), N_LONG - N_PIECE)]
    for i, (one, other) in enumerate(zip(whole, pieces, strict=True)):
        if not isinstance(one, Collision) or distance(scene, one, other) > NEAR:
            raise Trouble("fail", f"collision {i + 1} of {N_LONG}: {one} at once, {other} in two pieces")
    return f"{N_LONG} collisions"


def trajectory_steps(session: Session) -> str:
    """A trajectory between moving walls consists of what `step` answers, also late, and at far times."""
    scene = offered(session, MOVING, "trajectory", "step")
    paths = [(INSIDE[type(scene)], N_MOVING)]
    paths += [(msgspec.structs.replace(paths[0][0], t=t), N_MOVING // 8) for t in FAR_TIMES]
    n_compared = [_single_steps(session, scene, *path) for path in paths]
    if not all(n_compared):
        raise Trouble("declined", "every single step is undecided")
    return f"{sum(n_compared)} of {N_MOVING + len(FAR_TIMES) * (N_MOVING // 8)} collisions"


def _single_steps(session: Session, scene: Scene, start: State, n: int) -> int:
    """Compare some collisions of a trajectory, the last among them, with steps; return how many."""
    path = follow(session, scene, start, n)
    late = sorted(random.Random(n).sample(range(1, len(path)), min(N_SINGLE, len(path) - 1)))
    n_compared = 0
    for i in {*late, len(path) - 1}:
        before = path[i - 1]
        assert isinstance(before, Collision)
        alone = session.step(scene, before.state(), math.nextafter(math.inf, 0.0))
        if isinstance(alone, Undecided):
            continue
        n_compared += 1
        if distance(scene, path[i], alone) > NEAR:
            raise Trouble("fail", f"collision {i + 1}: {path[i]} in a trajectory, {alone} as a step")
    return n_compared


def flow_arrivals(session: Session) -> str:
    """A flow arrives where the trajectory does, and its captured stays are those of the trajectory's hits."""
    scene, t_end = offered(session, MOVING, "flow", "trajectory"), 5.0
    starts = [_start(scene, i) for i in range(N_FLOWN)]
    later = [after for start in starts if (after := _after_a_hit(session, scene, start, t_end))]
    found = _compared(session, scene, [*starts, *later], t_end)
    assert session.introduction is not None
    circle = MOVING[1]
    if not missing(session.introduction, "flow", to_data(circle)):
        # Fast particles hit a hundred times, and here rounding hardly grows.
        fast = [_start(circle, i, speed=60.0) for i in range(N_FLOWN // 4)]
        found = [a + b for a, b in zip(found, _compared(session, circle, fast, t_end / 2), strict=True)]
    n, n_compared, n_stays = found
    if 2 * n_compared < n:
        raise Trouble("declined", f"{n_compared} of {n} could be compared")
    return f"{n_compared} of {n} states, {n_stays} captured"


def _after_a_hit(session: Session, scene: Scene, start: State, t_end: float) -> State | None:
    """Return the state after the first hit: on a wall, at a time of its own; None where none is decided."""
    try:
        (hit,) = follow(session, scene, start, 1, t_end)
    except Trouble as trouble:
        if trouble.verdict == "declined":
            return None
        raise
    return hit.state() if isinstance(hit, Collision) else None


def _compared(session: Session, scene: Scene, states: Sequence[State], t_end: float) -> list[int]:
    """Compare arrivals with trajectories: the number of states, of those compared, and of captured stays."""
    n_stays = n_compared = 0
    for state, found in zip(states, flown(session, scene, states, t_end), strict=True):
        arrival = read_arrival(found)
        try:
            *hits, last = follow(session, scene, state, 1000, t_end)
        except Trouble as trouble:
            if trouble.verdict == "declined":
                continue
            raise
        if isinstance(arrival, Undecided):
            continue
        n_compared += 1
        if distance(scene, arrival, last) > CARRIED:
            raise Trouble("fail", f"{state}: {arrival} by flow, {last} by trajectory")
        if isinstance(scene, Mushroom) and isinstance(last, Horizon):
            stay = first_stay(scene, state, hits, t_end)
            if stay == UNCLEAR:
                continue
            n_stays += stay is not None
            if not is_same_stay(found.get("captured"), stay, t_end):
                raise Trouble("fail", f"{state}: captured = {found.get('captured')}, must be {stay}")
    return [len(states), n_compared, n_stays]


UNCLEAR = (math.nan, math.nan)


def first_stay(
    scene: Mushroom, start: State, hits: Sequence[Outcome], t_end: float
) -> tuple[float, float] | None:
    """Return the first captured stay of a path, by docs/protocol.md; UNCLEAR where rounding decides.

    Args:
        scene: a mushroom.
        start: of the path.
        hits: its collisions up to t_end.
        t_end: [time].
    """
    begin = end = None
    vx, vy = start.vx, start.vy
    for hit in hits:
        assert isinstance(hit, Collision)
        if hit.wall == "arc":
            reach = float(half_width(fp, scene, hit.t)) * math.hypot(vx, vy)
            spin = abs(hit.x * vy - hit.y * vx)
            if abs(spin - reach) <= NEAR * reach:
                return UNCLEAR
            if spin > reach:
                begin, end = (hit.t if begin is None else begin), None
            elif begin is not None and end is None:
                end = hit.t
        elif hit.wall != "base" and begin is not None:
            return begin, hit.t if end is None else end
        vx, vy = hit.vx, hit.vy
    return None if begin is None else (begin, t_end if end is None else end)


def _start(scene: Scene, i: int, speed: float = 0.0) -> State:
    """Draw the i-th start: every other one on a chord that misses the centre by far."""
    draw = random.Random(N_FLOWN + i)
    size, turn = draw.uniform(0.6, 0.8), draw.uniform(0.5, 1.2)
    speed = speed or draw.uniform(1.5, 4.0)
    course = turn + math.pi / 2 + (draw.uniform(-0.3, 0.3) if i % 2 else draw.uniform(-math.pi, math.pi))
    up = -1.0 if isinstance(scene, Stem) else 1.0
    x, y = size * math.cos(turn), size * math.sin(turn)
    return State(0.0, x, up * y, speed * math.cos(course), up * speed * math.sin(course))
