"""What is asked and by which family, what is proved of it, and how both are filed."""

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

from conformance.cases.draw import Draw, Unfit
from conformance.cases.scenes import wire_form
from conformance.vectors import Expectation, Kind, Level, OutcomeName, Vector
from scene import BadInput, Scene, State, Wall

# What a hit means for capture intervals: arc of a mushroom, captured or free; wall of the stem; nothing.
Mark = Literal["captured", "free", "out", ""]
LONGEST = 1e8  # condition number up to which a trajectory is followed
NEVER = 2.0**1000  # the horizon of paths that are asked for without one [time]
ATTEMPTS = 4000  # draws for one question


class Question(NamedTuple):
    """What is asked, and how its vector is filed.

    Attributes:
        scene: table and laws; in the wire's form where they may be none.
        state: the start.
        t_end: horizon [time].
        collisions: None for a step; for a trajectory how many are tried, for a flow how many at most.
        flow: None when it is none; else which of its collisions' marks (`paths.marks`) are looked for.
        longest: condition number up to which a trajectory or a flow is followed.
        also: outcomes that are right beside the proved one.
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
    flow: Callable[[Sequence[Mark]], bool] | None = None
    longest: float = LONGEST
    also: tuple[OutcomeName, ...] = ()
    level: Level | None = None
    working: int | None = None
    rule: str = ""
    group: str = ""
    source: str = ""

    @property
    def kind(self) -> Kind:
        """Return what is asked for."""
        return "step" if self.collisions is None else "flow" if self.flow else "trajectory"

    def wire_scene(self) -> dict[str, Any]:
        """Return the scene in the wire's form."""
        return self.scene if isinstance(self.scene, dict) else wire_form(self.scene)


class Family(NamedTuple):
    """A row of the table of questions.

    Attributes:
        name: it names questions for ever, with a seed and a number.
        aim: what it tests, or the mistake that it hunts.
        ask: from a stream of numbers to a question; it may raise Unfit or BadInput for another draw.
        source: place in the paper, or hard case.
        n_vectors: how many are in the corpus.
        weight: how many are in each round of a run's questions.
        meets: the wall that such a question meets first; None for any.
        wanted: the outcome of its vectors; None for any answer of a valid question.
        first_attempts: for each vector which draw is tried first, 0 by default. What a family looks for may
            be rare: the plain stepper has been asked before, so that few draws are certified in vain.
        is_delicate: built so that an honest stepper may often leave it undecided.
    """

    name: str
    aim: str
    ask: Callable[[Draw], Question]
    source: str = "sec. 2"
    n_vectors: int = 0
    weight: int = 0
    meets: Wall | None = None
    wanted: str | None = None
    first_attempts: tuple[int, ...] = ()
    is_delicate: bool = False

    def question(self, key: object) -> Question:
        """Return the first question that a key's draws have.

        Raises:
            BadInput: they have none.
        """
        for attempt in range(ATTEMPTS):
            if question := self.attempt(Draw(f"{self.name}/{key}/{attempt}")):
                return question
        raise BadInput(f"{self.name}/{key}: none of {ATTEMPTS} draws is a question")

    def attempt(self, draw: Draw) -> Question | None:
        """Return a draw's question, if it has one."""
        try:
            asked = self.ask(draw)
        except (BadInput, Unfit):
            return None
        rule, source = asked.rule or self.aim, asked.source or self.source
        return asked._replace(group=self.name, rule=rule, source=source)


class Proved(NamedTuple):
    """What is certified: the right answers, how delicate they are, and how many collisions they have."""

    expect: tuple[Expectation, ...]
    condition: float = 0.0
    collisions: int = 1


def filed(question: Question, number: int, proved: Proved, level: Level) -> Vector:
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
