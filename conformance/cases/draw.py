"""One source of everything that is drawn at random: a stream of bits, and the questions made of it.

A stream is seeded by a key, and then the same on every machine and in every version of Python: only
integer bits are drawn, and floats come from + - * / and sqrt alone, so no libm takes part. Or
Hypothesis draws the bits (`conformance.strategies`), and shrinks them: of several options the first
is the simplest. A family is a function from a stream to a question: what is asked, and how it is
filed once its answer is proved.
"""

import math
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import msgspec

from conformance.vectors import Expectation, Kind, Level, Vector
from scene import BadInput, Scene, State, Wall, from_data, to_data

T = TypeVar("T")
LONGEST = 1e8  # condition number up to which a trajectory is followed
NEVER = 2.0**1000  # the horizon of paths that are asked for without one [time]
ATTEMPTS = 4000  # draws for one question


class Unfit(Exception):  # noqa: N818 (a finding about the draw)
    """What is drawn is no question of its kind, or has no certified answer.

    Another must be drawn.
    """


class Draw:
    """A stream of numbers that depends on its key alone."""

    def __init__(self, key: str) -> None:
        self._random = random.Random(key)

    def bits(self, n: int) -> int:
        """Draw an integer of n bits: all that is ever drawn."""
        return self._random.getrandbits(n)

    def part(self) -> float:
        """Draw from (0, 1), even."""
        return (2 * self.bits(40) + 1) / 2**41

    def near_an_end(self) -> float:
        """Draw from (0, 1): even, or within 2^-k of an end, k up to 40."""
        if self.pick((True, True, False)):
            return self.part()
        near = self.power(-40, -1)
        return self.pick((near, 1 - near))

    def between(self, low: float, high: float) -> float:
        """Draw from (low, high), even."""
        return low + (high - low) * self.part()

    def short(self, low: float, high: float) -> float:
        """Draw a number of at most four decimals from [low, high], if it holds one."""
        least = math.ceil(low * 10_000)
        most = math.floor(high * 10_000)
        if most < least:
            return self.between(low, high)
        return (least + self.bits(30) % (most - least + 1)) / 10_000

    def pick(self, options: Sequence[T]) -> T:
        """Draw one of several."""
        return options[self.bits(30) % len(options)]

    def power(self, low: int, high: int) -> float:
        """Draw a power of two, low <= exponent <= high."""
        return 2.0 ** self.pick(range(low, high + 1))

    def direction(self) -> tuple[float, float]:
        """Draw a unit vector: a rational point of the circle, in any octant."""
        p = self.part()
        c = (1 - p * p) / (1 + p * p)
        s = 2 * p / (1 + p * p)
        if self.pick((False, True)):
            c, s = s, c
        return c * self.pick((1.0, -1.0)), s * self.pick((1.0, -1.0))

    def shuffle(self, items: list[T]) -> None:
        """Put a list into any order."""
        for n in range(len(items), 1, -1):
            i = self.pick(range(n))
            items[i], items[n - 1] = items[n - 1], items[i]


def wire_form(of: Scene) -> dict[str, Any]:
    """Return a scene as JSON has it, without its name and notes."""
    data = {key: law for key, law in to_data(of).items() if key not in ("name", "notes")}
    decoded: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(data))  # lists for tuples
    return decoded


def leaves(data: Any, label: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers of a scene in the wire's form, each with the name of its place."""
    if isinstance(data, dict):
        for name, part in data.items():
            yield from leaves(part, name)
    elif isinstance(data, list | tuple):
        for i, part in enumerate(data):
            yield from leaves(
                part, label if isinstance(part, list | tuple) else f"{label}{min(i, 2)}"
            )
    elif isinstance(data, int | float):
        yield label, float(data)


def readable(data: dict[str, Any]) -> Scene | None:
    """Return the scene in the wire's form; None where it is a bad one, which is to be refused."""
    try:
        return from_data(data)
    except BadInput:
        return None


class Question(NamedTuple):
    """What is asked, and how its vector is filed.

    Attributes:
        scene: table and laws; in the wire's form where they may be none.
        state: the start.
        t_end: horizon [time].
        collisions: None for a step; for a trajectory how many are tried, for a flow how many at
            most.
        is_flow: whether it asks for a flow, whose path has all collisions up to t_end.
        longest: condition number up to which a trajectory or a flow is followed.
        level: None to measure it.
        working: decimals that the reference may work with on a trajectory; None lets it choose.
        rule: what it tests, where that is more than the aim of its family.
        group: first part of its vector's id.
        source: place in the paper, or hard case.
    """

    scene: Scene | dict[str, Any]
    state: State
    t_end: float
    collisions: int | None = None
    is_flow: bool = False
    longest: float = LONGEST
    level: Level | None = None
    working: int | None = None
    rule: str = ""
    group: str = ""
    source: str = ""

    @property
    def kind(self) -> Kind:
        """Return what is asked for."""
        return "step" if self.collisions is None else "flow" if self.is_flow else "trajectory"

    def wire_scene(self) -> dict[str, Any]:
        """Return the scene in the wire's form."""
        return self.scene if isinstance(self.scene, dict) else wire_form(self.scene)


class Family(NamedTuple):
    """A row of the table of questions.

    Attributes:
        name: it names questions for ever, with a seed and a number.
        aim: what it tests, or the mistake that it hunts.
        ask: from a stream of numbers to a question; it may raise Unfit or BadInput for another
            draw.
        source: place in the paper, or hard case.
        weight: how many are in each round of a run's questions.
        meets: the wall that such a question meets first; None for any.
        is_delicate: built so that an honest stepper may often leave it undecided.
    """

    name: str
    aim: str
    ask: Callable[[Draw], Question]
    source: str = "sec. 2"
    weight: int = 0
    meets: Wall | None = None
    is_delicate: bool = False

    def question(self, key: object) -> Question:
        """Return the first question that a key's draws have.

        Raises:
            BadInput: they have none.
        """
        for attempt in range(ATTEMPTS):
            question = self.attempt(Draw(f"{self.name}/{key}/{attempt}"))
            if question:
                return question
        raise BadInput(f"{self.name}/{key}: none of {ATTEMPTS} draws is a question")

    def attempt(self, draw: Draw) -> Question | None:
        """Return a draw's question, if it has one."""
        try:
            asked = self.ask(draw)
        except (BadInput, Unfit):
            return None
        rule = asked.rule or self.aim
        source = asked.source or self.source
        return asked._replace(group=self.name, rule=rule, source=source)


class Proved(NamedTuple):
    """What is certified: the right answers, their condition, and the number of collisions."""

    expect: tuple[Expectation, ...]
    condition: float = 0.0
    collisions: int = 1


def file_vector(question: Question, number: int, proved: Proved, level: Level) -> Vector:
    """Return a question with its answers as a vector, of this number in its group."""
    return Vector(
        id=f"{question.group}/{number}",
        group=question.group,
        level=level,
        kind=question.kind,
        rule=question.rule,
        source=question.source,
        scene=question.wire_scene(),
        state=question.state,
        t_end=question.t_end,
        expect=proved.expect,
        collisions=proved.collisions,
        condition=proved.condition,
    )
