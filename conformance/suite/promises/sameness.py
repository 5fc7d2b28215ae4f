"""Promises on what an answer depends on: all of the question, and nothing else.

A question may be written in many ways, which all mean the same numbers; one that is nearly the question
before, in its state or in a law of its scene, is another question; and in a flow of hundreds, begun at many
times and on walls, a particle arrives where it does alone. What an implementation keeps from question to
question, by which key, and how much room it has, shows here.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Sequence
from decimal import Decimal
from typing import Any, NamedTuple

from msgspec.structs import replace

from conformance.suite.answers import read_arrival
from conformance.suite.process import Trouble
from conformance.suite.promises.questions import (
    CARRIED,
    INSIDE,
    MOVING,
    NEAR,
    STANDING,
    distance,
    flown,
    is_same,
    is_same_stay,
    offered,
    question,
    repeated,
)
from conformance.suite.session import MAX_SEQ, Session
from scene import Collision, Horizon, Mushroom, Rejected, Scene, State, Stem, Undecided, Wall

# Different particles, and how many of them in one flow: a prime, so that blocks of no size come out even.
N_POOL, N_FLOWN, T_END = 24, 307, 5.0
SHIFTS = 2.0**-24, 2.0**-34, 2.0**-44  # of a state: nearly the same, and told apart in binary64
ROUNDING = 2.0**-48  # of numbers of size 1, after one straight flight
COARSE = 2.0**-28  # likewise, of one that looks for hits down to a tolerance: as coarse as vectors let pass
LATE = 100_000.0  # a time whose last place in binary64 is 2^-36
HEIGHTS = 0.2718281828, 0.3141592653, 0.1618033988, 0.1414213562  # of starts; on no grid of anybody's
CAPTURED = State(0.0, 0.75, 0.25, 0.1, 3.0)  # in a mushroom
Spelling = Callable[[dict[str, Any]], str]


def spelling(session: Session) -> str:
    """A question means the same however its JSON is written."""
    scene = offered(session, MOVING, "step")
    request = question("step", scene, INSIDE[type(scene)], t_end=100.0)
    repeated(session, request)
    draw = random.Random(len(request))
    answers = []
    for write in (json.dumps, *SPELLINGS.values()):
        seq = draw.randint(1, MAX_SEQ)
        answers.append(session.say(write({**request, "seq": seq}).encode(), seq))
    if answers[0].get("outcome") == "undecided":
        raise Trouble("declined", f"undecided: {answers[0]['reason']}")
    if answers[0].get("outcome") != "collision":
        raise Trouble("fail", f"a state inside is answered {answers[0]}"[:200])
    for name, answer in zip(SPELLINGS, answers[1:], strict=True):
        if not is_same(answer, answers[0]):
            raise Trouble("fail", f"{name}: {answer}, as a rule {answers[0]}")
    return f"{len(SPELLINGS)} ways to write it"


def minus_zero(session: Session) -> str:
    """A state with y = -0.0 is where one with y = 0.0 is: on the base, or, by its velocity, off the mouth."""
    n = n_open = 0
    for scene in MOVING:
        try:
            offered(session, (scene,), "step")
        except Trouble:
            continue
        wall: Wall | None = None if isinstance(scene, Mushroom) else "base"
        for vy, t_end in ((0.75, 10.0), (-0.75, 10.0), (0.75, 0.125), (-0.75, 0.125)):
            states = (State(0.0, 0.125, y, 0.25, vy, wall) for y in (0.0, -0.0))
            plus, minus = (session.step(scene, state, t_end) for state in states)
            n += 1
            if isinstance(plus, Undecided) or isinstance(minus, Undecided):
                n_open += 1
            elif isinstance(plus, Rejected) and (wall is None or (vy < 0) == isinstance(scene, Stem)):
                raise Trouble("fail", f"y = 0.0, vy = {vy}: {plus}, though it leaves the base, in {scene}")
            elif distance(scene, minus, plus) > NEAR:
                raise Trouble("fail", f"y = -0.0, vy = {vy}: {minus}, with 0.0 {plus}, in {scene}")
    if not n:
        raise Trouble("unsupported", "no table is offered, or no laws that are constant")
    if n_open:
        raise Trouble("declined", f"{n_open} of {n} undecided")
    return f"{n} states"


def _turned(part: Any) -> Any:
    """Return data with the fields of every object in the opposite order."""
    if isinstance(part, dict):
        return {name: _turned(part[name]) for name in reversed(part)}
    return [_turned(one) for one in part] if isinstance(part, list | tuple) else part


def _spelt(number: Callable[[float], str]) -> Spelling:
    """Write numbers in a way of one's own."""

    def write(part: Any) -> str:
        if isinstance(part, dict):
            return "{" + ",".join(f"{json.dumps(name)}:{write(value)}" for name, value in part.items()) + "}"
        if isinstance(part, list | tuple):
            return "[" + ",".join(map(write, part)) + "]"
        return number(part) if isinstance(part, float) else json.dumps(part)

    return write


def _bare(request: dict[str, Any]) -> str:
    """Leave out what may be left out, but for the wall."""
    laws = {
        name: {key: part for key, part in law.items() if part not in ((), [])}
        if isinstance(law, dict)
        else law
        for name, law in request["scene"].items()
        if not (name == "slope" and law == 0.0)
    }
    return json.dumps({**request, "scene": {name: law for name, law in laws.items() if law != ""}})


def _named(request: dict[str, Any]) -> str:
    return json.dumps({**request, "scene": {**request["scene"], "name": "a name", "notes": '{"r":2.0}'}})


SPELLINGS: dict[str, Spelling] = {
    "fields in another order": lambda request: json.dumps(_turned(request)),
    "no spaces": lambda request: json.dumps(request, separators=(",", ":")),
    "more spaces": lambda request: " \t" + json.dumps(request, separators=(" ,\t", "  :  ")) + "  ",
    "whole numbers without a point": _spelt(lambda x: str(int(x)) if x == int(x) else repr(x)),
    "numbers with exponents": _spelt(lambda x: f"{x:.16e}"),
    "numbers to the last digit": _spelt(lambda x: f"{Decimal(x):f}"),
    "what is optional left out": _bare,
    "a scene with name and notes": _named,
}


class _Exact(NamedTuple):
    """A question whose answer is known: a straight flight that ends in time, or at rest walls head on."""

    scene: Scene
    state: State
    t_end: float
    due: State


def near_questions(session: Session) -> str:
    """A question nearly the same as the one before is answered as itself, and that one again as before."""
    n = 0
    for standing in STANDING:
        try:
            scene = offered(session, (standing,), "step")
        except Trouble:
            continue
        # Who is coarse is held to its own measure: vectors let it pass, and say its class.
        own = max(_error(session, _flight_to_the_end(scene, height)) for height in HEIGHTS)
        most = ROUNDING if own <= ROUNDING else COARSE
        n += len(HEIGHTS)
        for flights in (_flights_that_end, _flights_to_the_end, _late_flights):
            n += _told_apart(session, flights(scene), COARSE if flights is _late_flights else most)
    if not n:
        raise Trouble("unsupported", "no table is offered, or no laws that are constant")
    return f"{n} questions"


def _flights_that_end(scene: Scene) -> list[_Exact]:
    """Return flights between the walls, from places nearly the same."""
    way = -1.0 if isinstance(scene, Stem) else 1.0
    return [
        _Exact(scene, State(0.0, x, way / 4, 0.0, way), 0.125, State(0.125, x, 0.375 * way, 0.0, way))
        for x in (0.0, *SHIFTS, 0.3, *(0.3 + shift for shift in SHIFTS))
    ]


def _late_flights(scene: Scene) -> list[_Exact]:
    """Return fast flights from one place at late times that are the same to 15 digits.

    Late, the last digits of the time are worth more than an error of the place can be.
    """
    way, v, t_end = (-1.0 if isinstance(scene, Stem) else 1.0), 64.0, LATE + 2.0**-8
    starts = (LATE + n * math.ulp(LATE) for n in (0, 24, 28))
    return [
        _Exact(scene, State(t, 0.25, way / 4, 0.0, way * v), t_end, State(t_end, 0.25, y, 0.0, way * v))
        for t in starts
        for y in (way * (0.25 + v * (t_end - t)),)
    ]


def _flights_to_the_end(scene: Scene) -> list[_Exact]:
    """Return flights from one place straight into arc or floor, in tables nearly the same."""
    name = "h" if isinstance(scene, Stem) else "r"
    tables = (replace(scene, **{name: getattr(scene, name) * (1.0 + shift)}) for shift in (0.0, *SHIFTS))
    return [_flight_to_the_end(table, HEIGHTS[0]) for table in tables]


def _flight_to_the_end(scene: Scene, height: float) -> _Exact:
    """Return a flight straight into arc or floor."""
    size, way = (scene.h, -1.0) if isinstance(scene, Stem) else (scene.r, 1.0)
    assert isinstance(size, float)
    due = State(size - height, 0.0, size * way, 0.0, -way)
    return _Exact(scene, State(0.0, 0.0, way * height, 0.0, way), 10.0, due)


def _told_apart(session: Session, questions: Sequence[_Exact], most: float) -> int:
    """Ask the first question before and after each of the others, and hold every answer to the exact one."""
    first, *others = questions
    for asked in (first, *(one for other in others for one in (other, first))):
        _error(session, asked, most)
    return 2 * len(others) + 1


def _error(session: Session, asked: _Exact, most: float = COARSE) -> float:
    """Ask a question, and return by how much the worst number of the answer is off.

    Raises:
        Trouble: declined where it is undecided; fail for another outcome, or one off by more than `most`.
    """
    outcome = session.step(asked.scene, asked.state, asked.t_end)
    if isinstance(outcome, Undecided):
        raise Trouble("declined", f"undecided: {outcome.reason}")
    if not isinstance(outcome, Collision | Horizon):
        raise Trouble("fail", f"{outcome} where a flight is straight and short: {asked}")
    worst = 0.0
    for name in ("t", "x", "y", "vx", "vy"):
        found, wanted = getattr(outcome, name), getattr(asked.due, name)
        worst = max(worst, abs(found - wanted))
        if not abs(found - wanted) <= most:
            raise Trouble("fail", f"{name} = {found!r}, must be {wanted!r}, of {asked}")
    return worst


def many_particles(session: Session) -> str:
    """Each of hundreds of particles, begun at its own time and on walls, is answered as it is alone."""
    scene = offered(session, MOVING, "flow", "step")
    pool = _pool(session, scene)
    alone = [flown(session, scene, [state], T_END)[0] for state in pool]
    order = [random.Random(N_FLOWN + i).randrange(len(pool)) for i in range(N_FLOWN)]
    together = flown(session, scene, [pool[which] for which in order], T_END)
    n_compared = n_captured = 0
    for i, (which, found) in enumerate(zip(order, together, strict=True)):
        one, other = (read_arrival(part) for part in (found, alone[which]))
        if not isinstance(one, Horizon) and not isinstance(other, Horizon):
            continue
        n_compared += 1
        if distance(scene, one, other) > CARRIED:
            raise Trouble("fail", f"states[{i}] of {N_FLOWN}: {one} among others, {other} alone")
        stay, own = found.get("captured"), alone[which].get("captured")
        n_captured += own is not None
        if not is_same_stay(stay, own, T_END):
            raise Trouble("fail", f"states[{i}] of {N_FLOWN}: captured = {stay}, alone {own}")
    if 2 * n_compared < N_FLOWN:
        raise Trouble("declined", f"{n_compared} of {N_FLOWN} could be compared")
    return f"{N_FLOWN} states, {n_captured} captured"


def _pool(session: Session, scene: Scene) -> list[State]:
    """Return starts within the table, and the states after their first hits: other times, and walls."""
    inside, found = INSIDE[type(scene)], []
    for i in range(N_POOL // 2):
        state = replace(inside, vx=inside.vx * (1.0 + i / 8), vy=inside.vy * (1.5 - i / 16))
        hit = session.step(scene, state, T_END)
        found += [state, hit.state() if isinstance(hit, Collision) and hit.t < T_END / 2 else state]
    if isinstance(scene, Mushroom):
        found += [replace(CAPTURED, vy=CAPTURED.vy * (1.0 + i / 8)) for i in range(N_POOL // 4)]
    return found
