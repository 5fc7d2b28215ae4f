"""A run's own questions: drawn from its seed by the weights of the table, proved while the suite waits.

Whoever is right in the scenes of the corpus, and wrong in others, passes all of it, whatever symmetry it is
asked in. So a run asks questions that no file holds. The rows of the table that have a weight are dealt in
rounds: each round holds every row as often as its weight says, in an order drawn from the seed. A third of
the questions ask for a trajectory or a flow, as often the one as the other: paths and ensembles often have
an engine of their own, which no step shows. One row takes scene and state of the question before, with one
law changed so that the answer is another, if such a law is soon found. Scenes carry names, which mean
nothing.

Answers are certified as those of the corpus, and no more delicate than those of level core, but for late
ones, whose time when rounded tells less of the phase, and those in stems so deep that y when rounded tells
less than x: these than level extended. All are filed as of level core. The plain stepper chooses which draws
are asked: those that meet the wall that is looked for, and keep it when nudged.
"""

from collections.abc import Iterator
from functools import cache
from math import inf
from typing import Any

import msgspec

from conformance import plain
from conformance.cases.certify import certify
from conformance.cases.draw import Draw, Unfit
from conformance.cases.flow_families import any_marks
from conformance.cases.prover import CONDITIONS, NUDGES, SIGNS, nudged
from conformance.cases.question import ATTEMPTS, Family, Question
from conformance.cases.run_families import LIKE_BEFORE, is_leaning
from conformance.cases.scenes import LATE, Clock, law, wire_form
from conformance.cases.table import FAMILIES
from conformance.grading.agreement import DIGITS, SHARPEST
from conformance.vectors import Kind, Level, Vector
from scene import BadInput, BangBang, Collision, Fourier, Horizon, Scene, State, from_data
from scene.laws import bounds
from scene.tables import laws

FRESH = "fresh"
KINDS: tuple[Kind, ...] = ("step", "step", "step", "step", "trajectory", "flow")
HITS = 1, 2, 3, 4, 5  # of trajectories and flows
LIKE_ATTEMPTS = 24  # draws that change a law of the question before
# An answer is another one that is farther off than any error that passes, a thousandth of its size up to the
# condition TELLING. Late questions may have higher ones: those are not asked as like the one before.
ANOTHER, TELLING = 2.0**-7, float(DIGITS / SHARPEST)
ROUND = sum(family.weight for family in FAMILIES.values())  # questions
NUDGE = dict(NUDGES)


def fresh(seed: int, n: int) -> Iterator[Vector]:
    """Draw questions and prove their answers, each when it is asked for.

    Args:
        seed: of the run.
        n: how many.

    Yields:
        `fresh/1` to `fresh/n`, filed as of level core, though the conditions of late ones go up to those of
        extended; a greater n only adds some.

    Raises:
        BadInput: for none of very many draws an answer is proved.
    """
    last: Vector | None = None
    for number in range(1, n + 1):
        last = _drawn(seed, number, last)
        yield last


def fresh_one(seed: int, number: int) -> Vector:
    """Draw and prove one question of `fresh`, and those before it that it hangs on."""
    is_like = number > 1 and family_of(seed, number).name == LIKE_BEFORE
    return _drawn(seed, number, fresh_one(seed, number - 1) if is_like else None)


def family_of(seed: int, number: int) -> Family:
    """Return the row of the table that a question is of."""
    return _dealt(seed, (number - 1) // ROUND)[(number - 1) % ROUND]


@cache
def _dealt(seed: int, number: int) -> list[Family]:
    rows = [family for family in FAMILIES.values() for _ in range(family.weight)]
    Draw(f"{seed}/{FRESH}/round/{number}").shuffle(rows)
    return rows


def _drawn(seed: int, number: int, before: Vector | None) -> Vector:
    """Return a question, given the one before, which is looked at where this one is like it."""
    return next(vector for vector in questions(family_of(seed, number), f"{seed}/{FRESH}", number, before))


def questions(family: Family, key: str, number: int, before: Vector | None = None) -> Iterator[Vector]:
    """Yield questions of a row that are not delicate, with their proved answers.

    Args:
        family: the row.
        key: of the streams, with number and attempt.
        number: of the vector.
        before: a question whose scene is kept but for one law, where the row is for that.

    Raises:
        BadInput: for none of very many draws an answer is proved.
    """
    kind = Draw(f"{key}/{number}").pick(KINDS)
    for attempt in range(ATTEMPTS):
        draw = Draw(f"{key}/{number}/{attempt}")
        like = before if family.name == LIKE_BEFORE and attempt < LIKE_ATTEMPTS else None
        asked = _one_law_changed(draw, like) if like else family.attempt(draw)
        question = _asked(draw, "step" if like else kind, asked) if asked else None
        if question is None or not _is_wanted(question, family, like):
            continue
        try:
            vector = certify(question, number)
        except Unfit:
            continue
        is_met = vector.kind != "step" or vector.expect[0].outcome == "collision"
        if is_met and vector.condition <= question.longest:
            yield vector
    raise BadInput(f"{key}/{number}: none of {ATTEMPTS} draws has a certified answer")


def _is_wanted(question: Question, family: Family, like: Vector | None) -> bool:
    """Tell whether the plain stepper meets the wall that is looked for, or has another answer than before."""
    of = from_data(question.scene)
    met = plain.next_collision(of, question.state, question.t_end)
    if not isinstance(met, Collision):
        return False
    is_met = _is_another(met, like) if like else family.meets in (None, met.wall)
    return is_met and _is_steady(of, question)


def _is_another(met: Collision, before: Vector) -> bool:
    """Tell whether a collision is clearly not that of the scene before."""
    was = plain.next_collision(from_data(before.scene), before.state, before.t_end)
    return (
        not isinstance(was, Collision)
        or met.wall != was.wall
        or any(
            abs(getattr(met, name) - getattr(was, name)) > ANOTHER * max(abs(getattr(met, n)) for n in part)
            for part in (("dt",), ("x", "y"), ("vx", "vy"))
            for name in part
        )
    )


def _asked(draw: Draw, kind: Kind, asked: Question) -> Question | None:
    """Return a question of a kind, filed; None where fewer hits follow than it is to have."""
    of, start, t_end = asked.scene, asked.state, asked.t_end
    assert not isinstance(of, dict)
    data: dict[str, Any] = wire_form(of) | ({"name": of.name} if of.name else {})
    longest = min(asked.longest, CONDITIONS[_delicacy(of, start)])
    question = asked._replace(
        scene=data, level="core", longest=longest, group=FRESH, collisions=None, flow=None
    )
    if kind == "step":
        return question
    n_hits = draw.pick(HITS)
    hits = plain.trajectory(of, start, n_hits + 1, t_end)
    if not all(isinstance(hit, Collision) for hit in hits[:n_hits]):
        return None
    before, after = hits[n_hits - 1], hits[-1]
    if kind == "trajectory":
        return question._replace(collisions=n_hits)
    if len(hits) <= n_hits or not isinstance(before, Collision) or not isinstance(after, Collision | Horizon):
        return None
    return question._replace(t_end=(before.t + after.t) / 2, collisions=n_hits + 1, flow=any_marks)


def _is_steady(of: Scene, question: Question) -> bool:
    """Tell whether the plain stepper meets the same walls from starts nearby: it answers none of this.

    Of a flow it is captured between the same hits, too.
    """

    def met(start: State) -> list[str | int]:
        path = plain.trajectory(of, start, question.collisions or 1, question.t_end)
        walls = [hit.wall if isinstance(hit, Collision) else type(hit).__name__ for hit in path]
        ((_, stay),) = plain.flow(of, [start], question.t_end) if question.flow else [(None, None)]
        times = [hit.t for hit in path if isinstance(hit, Collision)]
        return [*walls, *(sum(hit <= t for hit in times) for t in stay or ())]

    start, t_end = question.state, question.t_end
    expected = met(start)
    nudge = NUDGE[_delicacy(of, start)]
    return all(met(nudged(start, t_end, signs, nudge)) == expected for signs in SIGNS)


def _delicacy(of: Scene, start: State) -> Level:
    """Return the level that says how delicate a question may be.

    Late, a part of the time is a phase; of a very deep stem a part of y is much of its width, though not an
    error of x that is a part of x.
    """
    is_late = abs(start.t) > 2.0 ** (LATE[0] - 1) * (of.period or inf)
    return "extended" if is_late or is_leaning(of) else "core"


def _one_law_changed(draw: Draw, before: Vector) -> Question | None:
    """Return the question before with one law exchanged for another of the same range and period."""
    of = from_data(before.scene)
    known = laws(of)
    name = draw.pick(sorted(known))
    within = bounds(known[name])
    low, high = within.lowest, within.highest
    if name != "slope" and low <= 0:  # of a deep wave no more is known than that it stays positive
        low = 0.1 * high
    margin = 0.0 if low < high else 0.05 * abs(low)
    moving = [other for other in known.values() if isinstance(other, Fourier | BangBang)]
    changed = law(
        draw, low - margin, high + margin, _clock_of(draw.pick(moving)) if moving else Clock("constant")
    )
    try:
        return Question(
            msgspec.structs.replace(of, **{name: changed}), before.state, before.t_end, longest=TELLING
        )
    except BadInput:
        return None


def _clock_of(known: Fourier | BangBang) -> Clock:
    """Return kind and rate of a law."""
    if isinstance(known, BangBang):
        return Clock("bang-bang", known.knots[-1][0] - known.knots[0][0])
    return Clock("fourier", known.omega) if known.omega else Clock("mixed", known.period or 1.0)
