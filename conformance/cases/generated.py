"""A run's own questions: drawn from its seed by weight, proved while the suite waits.

A stepper that is right in the scenes of the corpus, and wrong in others, passes all of it, whatever
symmetry it is asked in. So a run asks questions that no file holds. The rows of the table that have
a weight are dealt in rounds: each round holds every row as often as its weight says, in an order
drawn from the seed. A third of the questions ask for a trajectory or a flow, as often the one as
the other: paths and ensembles often have an engine of their own, which no step shows. Scenes carry
names, which mean nothing.

Answers are certified as those of the corpus, and no more delicate than those of level core, but for
late ones, whose time when rounded tells less of the phase, and those in stems so deep that y when
rounded tells less than x: these than level extended. All are filed as of level core. The plain
stepper chooses which draws are asked: those that meet the wall that is looked for, and keep it when
nudged.
"""

from math import inf
from typing import Any

from conformance import plain
from conformance.cases.certify import CONDITIONS, NUDGES, SIGNS, certify, nudged
from conformance.cases.draw import ATTEMPTS, Draw, Family, Question, Unfit, wire_form
from conformance.cases.run_families import is_leaning
from conformance.cases.scenes import LATE
from conformance.cases.table import FAMILIES
from conformance.vectors import Kind, Level, Vector
from scene import BadInput, Collision, Horizon, Scene, State, from_data

FRESH = "fresh"
KINDS: tuple[Kind, ...] = ("step", "step", "step", "step", "trajectory", "flow")
HITS = 1, 2, 3, 4, 5  # of trajectories and flows
ROUND = sum(family.weight for family in FAMILIES.values())  # questions


def fresh_one(seed: int, number: int) -> Vector:
    """Draw question `fresh/NUMBER` of a run's seed, and prove its answer.

    Raises:
        BadInput: for none of very many draws an answer is proved.
    """
    return certified_draw(family_of(seed, number), f"{seed}/{FRESH}", number)


def family_of(seed: int, number: int) -> Family:
    """Return the row of the table that a question is of."""
    n_rounds, place = divmod(number - 1, ROUND)
    rows = [family for family in FAMILIES.values() for _ in range(family.weight)]
    Draw(f"{seed}/{FRESH}/round/{n_rounds}").shuffle(rows)
    return rows[place]


def certified_draw(family: Family, key: str, number: int) -> Vector:
    """Draw a question of a row that is not delicate, and prove its answer.

    Args:
        family: the row.
        key: of the streams, with number and attempt.
        number: of the vector.

    Raises:
        BadInput: for none of very many draws an answer is proved.
    """
    kind = Draw(f"{key}/{number}").pick(KINDS)
    for attempt in range(ATTEMPTS):
        draw = Draw(f"{key}/{number}/{attempt}")
        asked = family.attempt(draw)
        question = _asked(draw, kind, asked) if asked else None
        if question is None or not _is_wanted(question, family):
            continue
        try:
            vector = certify(question, number)
        except Unfit:
            continue
        is_met = vector.kind != "step" or vector.expect[0].outcome == "collision"
        if is_met and vector.condition <= question.longest:
            return vector
    raise BadInput(f"{key}/{number}: none of {ATTEMPTS} draws has a certified answer")


def _is_wanted(question: Question, family: Family) -> bool:
    """Tell whether the plain stepper meets the wall that is looked for, from starts nearby too."""
    of = from_data(question.scene)
    met = plain.next_collision(of, question.state, question.t_end)
    return (
        isinstance(met, Collision) and family.meets in (None, met.wall) and _is_steady(of, question)
    )


def _asked(draw: Draw, kind: Kind, asked: Question) -> Question | None:
    """Return a question of a kind, filed; None where fewer hits follow than it is to have."""
    of = asked.scene
    start = asked.state
    t_end = asked.t_end
    assert not isinstance(of, dict)
    data: dict[str, Any] = wire_form(of) | ({"name": of.name} if of.name else {})
    longest = min(asked.longest, CONDITIONS[_delicacy(of, start)])
    question = asked._replace(
        scene=data, level="core", longest=longest, group=FRESH, collisions=None, is_flow=False
    )
    if kind == "step":
        return question
    n_hits = draw.pick(HITS)
    hits = plain.trajectory(of, start, n_hits + 1, t_end)
    if not all(isinstance(hit, Collision) for hit in hits[:n_hits]):
        return None
    before = hits[n_hits - 1]
    after = hits[-1]
    if kind == "trajectory":
        return question._replace(collisions=n_hits)
    if (
        len(hits) <= n_hits
        or not isinstance(before, Collision)
        or not isinstance(after, Collision | Horizon)
    ):
        return None
    return question._replace(t_end=(before.t + after.t) / 2, collisions=n_hits + 1, is_flow=True)


def _is_steady(of: Scene, question: Question) -> bool:
    """Tell whether the plain stepper meets the same walls from starts nearby.

    Of a flow it is captured between the same hits, too.
    """

    def met(start: State) -> list[str | int]:
        path = plain.trajectory(of, start, question.collisions or 1, question.t_end)
        walls = [hit.wall if isinstance(hit, Collision) else type(hit).__name__ for hit in path]
        ((_, stay),) = (
            plain.flow(of, [start], question.t_end) if question.is_flow else [(None, None)]
        )
        times = [hit.t for hit in path if isinstance(hit, Collision)]
        return [*walls, *(sum(hit <= t for hit in times) for t in stay or ())]

    start, t_end = question.state, question.t_end
    expected = met(start)
    nudge = NUDGES[_delicacy(of, start)]
    return all(met(nudged(start, t_end, signs, nudge)) == expected for signs in SIGNS)


def _delicacy(of: Scene, start: State) -> Level:
    """Return the level that says how delicate a question may be.

    Late, a part of the time is a phase; of a very deep stem a part of y is much of its width,
    though not an error of x that is a part of x.
    """
    is_late = abs(start.t) > 2.0 ** (LATE[0] - 1) * (of.period or inf)
    return "extended" if is_late or is_leaning(of) else "core"
