"""The named workloads: single steps with proved answers, drawn anew from a seed.

A question is a state as a trajectory meets it: drawn in the table, flown to its first collision, rounded.
The states of a workload lie within WINDOW flights of each other, so that an engine which follows them on
does comparable work at every energy. Every answer is a collision; other draws are drawn again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from mpmath import fp

from conformance.generator.draws import Draw, TableAt, state, walls_speed
from conformance.grading.agreement import middle
from conformance.vectors import Expectation
from scene import Cap, Collision, Scene, State, load
from scene.tables import period

DIGITS = 230  # of the proved answers: beyond any contender's
WINDOW = 1000.0  # flights
PHASE = 0.3  # of the cycle, where the window begins
MAX_DRAWS = 100
# (scene, state, t_end, digits) -> certified answer of a step; None where the proof is undecided.
Prover = Callable[[Scene, State, float, int], Expectation | None]
Drawn = tuple[State, float]  # with its horizon


class ProvedStep(NamedTuple):
    """The question of one step, and its certified answer, a collision."""

    state: State
    t_end: float
    truth: Expectation


class Workload(NamedTuple):
    """Questions of one kind.

    Attributes:
        name: words joined by hyphens.
        what: in a line.
        scene: of all questions.
        questions: one step each.
    """

    name: str
    what: str
    scene: Scene
    questions: list[ProvedStep]


class Rule(NamedTuple):
    """How a workload's questions are drawn.

    Attributes:
        name, what: as in Workload.
        scene: of the catalogue.
        draw: from a stream of numbers, the scene and a time to a state.
        speed: about that of the particle, for the length of the window.
        is_flown: whether the question begins at the first collision of what was drawn.
    """

    name: str
    what: str
    scene: str
    draw: Callable[[Draw, Scene, float], Drawn]
    speed: float
    is_flown: bool = True


def _flight(energy: float) -> tuple[Callable[[Draw, Scene, float], Drawn], float]:
    speed = math.sqrt(2.0 * energy)

    def draw(stream: Draw, scene: Scene, t: float) -> Drawn:
        site = stream.pick(["cap"] if "floor" not in scene.walls else ["cap", "stem"])
        at = {"t": t, "site": site, "speed": speed / walls_speed(scene)}
        return state(stream, scene, at)

    return draw, speed


def _slow(stream: Draw, scene: Scene, t: float) -> Drawn:
    at = {"t": t, "site": stream.pick(["cap", "stem"]), "speed": stream.power(-2, 1)}
    return state(stream, scene, at)


def _grazing(stream: Draw, scene: Scene, t: float) -> Drawn:
    at = {"t": t, "site": "arc", "speed": 2.0**10, "lift": stream.power(-26, -4), "patience": 400.0}
    return state(stream, scene, at)


def _near_corner(stream: Draw, scene: Scene, t: float) -> Drawn:
    now, speed = TableAt(scene, t), 2.0**10
    x, y = now.place(stream, "cap")
    flight = now.size / speed * stream.between(0.25, 1.0)
    there = TableAt(scene, t + flight)
    corner_x, corner_y = stream.pick(there.corners("cap"))
    off, (c, s) = there.size * stream.power(-40, -8), stream.direction()
    start = State(t, x, y, (corner_x + off * c - x) / flight, (corner_y + off * s - y) / flight)
    return start, t + 4.0 * flight


RULES: tuple[Rule, ...] = (
    Rule("breathing-disk", "the cap alone, energy 1e6", "breathing-circle", *_flight(1e6)),
    Rule("fixed-cap", "sec. 4.1, energy 1e9", "fixed-cap-anticlockwise", *_flight(1e9)),
    Rule("moving-cap-1e4", "sec. 4.2, energy 1e4", "moving-cap", *_flight(1e4)),
    Rule("moving-cap-1e7", "sec. 4.2, energy 1e7", "moving-cap", *_flight(1e7)),
    Rule("moving-cap-1e12", "sec. 4.2, energy 1e12", "moving-cap", *_flight(1e12)),
    Rule("slow", "a quarter to twice the walls' speed", "moving-cap", _slow, 1.0),
    Rule("grazing", "the arc left at 2^-26 to 2^-4 of a radian", "moving-cap", _grazing, 2.0**10, False),
    Rule("near-corner", "2^-40 to 2^-8 from a corner", "moving-cap", _near_corner, 2.0**10, False),
)
NAMES = tuple(rule.name for rule in RULES)


def draw_workload(rule: Rule, seed: int, n_questions: int, prove: Prover) -> Workload:
    """Draw a workload and have it answered.

    Args:
        rule: one of RULES.
        seed: of all draws.
        n_questions: how many, >= 1.
        prove: answers one step by proof.
    """
    scene = load(rule.scene)
    questions = [_question(rule, scene, f"bench {seed} {rule.name} {i}", prove) for i in range(n_questions)]
    return Workload(rule.name, rule.what, scene, questions)


def _question(rule: Rule, scene: Scene, key: str, prove: Prover) -> ProvedStep:
    shared = period(scene)
    span = 1.0 if shared is None else float(shared.value(fp))
    for attempt in range(MAX_DRAWS):
        stream = Draw(f"{key} {attempt}")
        size = TableAt(scene, 0.0).size
        t = span * PHASE + stream.part() * min(span, WINDOW * size / rule.speed)
        start, t_end = rule.draw(stream, scene, t)
        if rule.is_flown:
            first = prove(scene, start, t_end, 20)
            met = middle(first, start)[0] if first else None
            if not isinstance(met, Collision):
                continue
            t_end += met.t - start.t
            start = met.state()
        truth = prove(scene, start, t_end, DIGITS)
        if truth is None or truth.outcome != "collision":
            continue
        if isinstance(scene, Cap) and "base" in (start.wall, truth.steps[0].wall):
            continue  # lanes unfold the disk: from arc to arc
        return ProvedStep(start, t_end, truth)
    raise RuntimeError(f"{key}: no collision in {MAX_DRAWS} draws")
