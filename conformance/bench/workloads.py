"""The named workloads: single steps with proved answers, drawn anew from a seed.

A question is a state as a trajectory meets it: drawn in the table, flown to its first collision, rounded.
The states of a workload lie within FLIGHTS flights of each other, so that an engine which follows them on
does comparable work at every energy. Every answer is a collision; other draws are drawn again.

Proofs are slow, and a few dozen questions show no rare mistake. So each workload draws many further steps by
the same rule, whose walls a stepper that the caller trusts has named.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from conformance.cases.draw import Draw
from conformance.cases.scenes import place, state, walls_speed
from conformance.grading.agreement import middle
from conformance.vectors import Expectation
from scene import BangBang, Cap, Collision, Fourier, Mushroom, Outcome, Scene, State, Undecided, Wall, load
from scene.geometry import rounded
from scene.states import Stepper

DIGITS = 230  # of the proved answers: beyond any solver's
FLIGHTS = 1000.0  # flights
PHASE = 0.3  # of the cycle, where the flights begin
MAX_DRAWS = 100
# (scene, state, t_end, digits) -> certified answer of a step; None where the proof is undecided.
Prover = Callable[[Scene, State, float, int], Expectation | None]
Drawn = tuple[State, float]  # with its horizon


class ProvedStep(NamedTuple):
    """The question of one step, and its certified answer, a collision."""

    state: State
    t_end: float
    truth: Expectation


class FurtherStep(NamedTuple):
    """The question of one more step, and the wall that the trusted stepper meets."""

    state: State
    wall: Wall


class Rule(NamedTuple):
    """How a workload's questions are drawn.

    Attributes:
        name: words joined by hyphens.
        what: in a line.
        scene: of the catalogue, or of SCENES.
        draw: from a stream of numbers, the scene and a time to a state.
        speed: about that of the particle, for the time that the flights take.
        is_flown: whether the question begins at the first collision of what was drawn.
        length: the time is that of one particle's path of so many collisions; 0: of all the questions.
    """

    name: str
    what: str
    scene: str
    draw: Callable[[Draw, Scene, float], Drawn]
    speed: float
    is_flown: bool = True
    length: int = 0


class Workload(NamedTuple):
    """Questions of one kind.

    Attributes:
        rule: by which they are drawn.
        scene: of all questions.
        questions: one step each.
        further: steps of the same kind, on which only walls are compared.
    """

    rule: Rule
    scene: Scene
    questions: list[ProvedStep]
    further: Sequence[FurtherStep] = ()

    def end(self, flights: float = FLIGHTS) -> float:
        """Return the time that lies so many flights after the last question."""
        last = max((q.state for q in self.questions), key=lambda state: state.t)
        flight = float(rounded(self.scene, last.t).size) / math.hypot(last.vx, last.vy)
        return last.t + flights * flight


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
    now, speed = rounded(scene, t), 2.0**10
    x, y = place(stream, now, "cap")
    flight = now.size / speed * stream.between(0.25, 1.0)
    there = rounded(scene, t + flight)
    corner_x, corner_y = stream.pick(there.corners("cap"))
    off, (c, s) = there.size * stream.power(-40, -8), stream.direction()
    start = State(t, x, y, (corner_x + off * c - x) / flight, (corner_y + off * s - y) / flight)
    return start, t + 4.0 * flight


SIXTEEN = tuple(round(0.4 / k**2, 4) for k in range(1, 17))
SCENES: dict[str, Scene] = {
    "moving cap, two harmonics": Mushroom(
        r=Fourier(1.0, 1.0, sin=(0.4, 0.1)),
        h=Fourier(1.0, 1.0, cos=(0.0, 0.1), sin=(-0.4,)),
        nu=Fourier(0.6, 1.0, cos=(0.3,), sin=(0.0, 0.08)),
        slope=0.1111,
    ),
    "moving cap, sixteen harmonics": Mushroom(
        r=Fourier(1.0, 1.0, sin=SIXTEEN),
        h=Fourier(1.0, 1.0, sin=tuple(-size for size in SIXTEEN)),
        nu=0.5,
        slope=0.1111,
    ),
    "moving cap, moving slope": Mushroom(
        r=Fourier(1.0, 1.0, sin=(0.5,)),
        h=Fourier(1.0, 1.0, sin=(-0.5,)),
        nu=Fourier(0.6, 1.0, cos=(0.4,)),
        slope=Fourier(0.06, 1.0, cos=(0.04,)),
    ),
    "moving cap, bang-bang": Mushroom(
        r=BangBang(((0.0, 1.0), (1.5, 1.5), (4.5, 0.5), (6.0, 1.0))),
        h=BangBang(((0.0, 1.0), (1.5, 0.5), (4.5, 1.5), (6.0, 1.0))),
        nu=BangBang(((0.0, 1.0), (3.0, 0.3), (6.0, 1.0))),
        slope=0.1111,
    ),
}


RULES: tuple[Rule, ...] = (
    Rule("breathing-disk", "the cap alone, energy 1e6", "breathing-circle", *_flight(1e6)),
    Rule("fixed-cap", "sec. 4.1, bang-bang, energy 1e9", "fixed-cap-anticlockwise", *_flight(1e9)),
    Rule("moving-cap-1e4", "sec. 4.2, energy 1e4", "moving-cap", *_flight(1e4)),
    Rule("moving-cap-1e7", "sec. 4.2, energy 1e7", "moving-cap", *_flight(1e7)),
    Rule("moving-cap-1e12", "sec. 4.2, energy 1e12", "moving-cap", *_flight(1e12)),
    Rule("slow", "a quarter to twice the walls' speed", "moving-cap", _slow, 1.0),
    Rule("grazing", "the arc left at 2^-26 to 2^-4 of a radian", "moving-cap", _grazing, 2.0**10, False),
    Rule("near-corner", "2^-40 to 2^-8 from a corner", "moving-cap", _near_corner, 2.0**10, False),
    Rule("two-harmonics", "r, h and nu, energy 1e7", "moving cap, two harmonics", *_flight(1e7)),
    Rule("sixteen-harmonics", "r and h, energy 1e7", "moving cap, sixteen harmonics", *_flight(1e7)),
    Rule("moving-slope", "energy 1e7", "moving cap, moving slope", *_flight(1e7)),
    Rule("bang-bang", "r, h and nu, energy 1e7", "moving cap, bang-bang", *_flight(1e7)),
    Rule("one-path", "one particle, 1e5 collisions", "moving-cap", *_flight(1e7), length=100_000),
)
NAMES = tuple(rule.name for rule in RULES)
SINGLE_STEPS = tuple(rule.name for rule in RULES if not rule.length)


def draw_workload(
    rule: Rule, seed: int, n_questions: int, prove: Prover, n_further: int = 0, trust: Stepper | None = None
) -> Workload:
    """Draw a workload and have it answered.

    Args:
        rule: one of RULES.
        seed: of all draws.
        n_questions: how many, >= 1.
        prove: answers one step by proof.
        n_further: how many further steps.
        trust: names their walls.
    """
    scene = SCENES[rule.scene] if rule.scene in SCENES else load(rule.scene)
    further = list[FurtherStep]()
    questions = [_question(rule, scene, f"bench {seed} {rule.name} {i}", prove) for i in range(n_questions)]
    if trust is not None:
        key = f"bench {seed} {rule.name} further"
        drawn = [_draw_step(rule, scene, f"{key} {i}", trust) for i in range(n_further)]
        further = [FurtherStep(state, wall) for state, _, wall in drawn]
    return Workload(rule, scene, questions, further)


def _draw_step(rule: Rule, scene: Scene, key: str, step: Stepper) -> tuple[State, float, Wall]:
    """Draw a start, its horizon and the wall it meets; the rule may say that it is flown to its first hit.

    No step of the cap begins or ends at its base: the lanes unfold the disk, from arc to arc.
    """
    span, size = scene.period or 1.0, rounded(scene, 0.0).size
    for attempt in range(MAX_DRAWS):
        stream = Draw(f"{key} {attempt}")
        t = span * PHASE + stream.part() * min(span, FLIGHTS * size / rule.speed)
        start, t_end = rule.draw(stream, scene, t)
        met = step(scene, start, t_end)
        if rule.is_flown and isinstance(met, Collision):
            start, t_end = met.state(), t_end + met.t - start.t
            met = step(scene, start, t_end)
        if not isinstance(met, Collision):
            continue
        if not isinstance(scene, Cap) or "base" not in (start.wall, met.wall):
            return start, t_end, met.wall
    raise RuntimeError(f"{key}: no collision in {MAX_DRAWS} draws")


def _question(rule: Rule, scene: Scene, key: str, prove: Prover) -> ProvedStep:
    def step(scene: Scene, start: State, t_end: float) -> Outcome:
        found = prove(scene, start, t_end, 20)
        return middle(found, start)[0] if found else Undecided("the proof is undecided")

    start, t_end, _ = _draw_step(rule, scene, key, step)
    truth = prove(scene, start, t_end, DIGITS)
    assert truth is not None
    return ProvedStep(start, t_end, truth)
