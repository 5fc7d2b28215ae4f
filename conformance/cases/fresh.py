"""Questions in scenes that no file holds, drawn from a run's seed and proved while the suite waits.

A disguise changes how a published question is asked, and not what is asked: whoever is right in the scenes of
the corpus, and wrong in others, passes all of them. So tables, walls, kinds of laws, signs of the time and
places of the start are drawn together, and each wall of each table is met first about as often. A sixth of
them ask for a trajectory, another sixth for a flow: what comes after the first collision is new as well.
Every third question keeps the scene before but for one law, and its state, and has another answer, if such a
law is soon found (few act on a flight to the base): an implementation that knows a scene by less than all of
it gives the answer before. Scenes carry names, which mean nothing: different ones the same.
Some meet their wall for a short time only, some cross a mouth that opens or closes during the flight
(`cases.in_flight`); some have laws of many legs, sides that lean by next to nothing over a great depth,
or meet again the wall that they were a little off, in units of 2^-44 to 2^44 too, some fly past walls that
seem to stand, or wait for hundreds of periods (`cases.seldom`); and every seventh begins up to a
million periods late, or before 0. Some further trajectories and flows begin with such a flight as well:
paths and ensembles often have an engine of their own, which no step shows.
Answers are certified as those of the corpus, and no more delicate than those of level core, but for late
ones, whose time when rounded tells less of the phase, and those in stems so deep that y when rounded tells
less than x: these than level extended. All are filed as of level core. The plain stepper chooses which draws
are asked: those that meet the wall that is looked for, and keep it when nudged.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import msgspec

from conformance import plain
from conformance.cases.certify import certify
from conformance.cases.drawn_scenes import KINDS, SIZES, drawn_scene
from conformance.cases.draws import Draw, clock, state, time, walls_speed, wire_form
from conformance.cases.flow_families import any_marks
from conformance.cases.in_flight import arc_to_mouth, brief_start, swept_scene, swept_start
from conformance.cases.links import Unfit
from conformance.cases.prover import CONDITIONS, NUDGES, SIGNS, nudged
from conformance.cases.question import Question
from conformance.cases.seldom import (
    DEPTHS,
    EXTRA,
    Extra,
    hurried_start,
    in_other_units,
    is_leaning,
    leaning_start,
    leaning_stem,
    off_its_wall,
    returning_start,
    scene_of_many_legs,
    under_a_growing_cap,
    vibrating_scene,
    waiting_start,
)
from conformance.grading.agreement import DIGITS, SHARPEST
from conformance.vectors import Kind, Level, Vector
from scene import (
    BadInput,
    BangBang,
    Collision,
    Fourier,
    Horizon,
    Law,
    Mushroom,
    Scene,
    State,
    Wall,
    from_data,
)
from scene.geometry import rounded
from scene.laws import bounds
from scene.tables import cycle_length, laws

GROUP = "fresh"
RULES: dict[Kind, str] = {
    "step": "a flight in a scene that no file holds",
    "trajectory": "some flights in a scene that no file holds",
    "flow": "a particle carried through a scene that no file holds",
}
WALLS: tuple[tuple[str, Wall], ...] = (
    *(("cap", wall) for wall in ("arc", "base")),
    *(("stem", wall) for wall in ("left", "right", "floor", "base")),
    *(("mushroom", wall) for wall in ("arc", "base", "left", "right", "floor")),
)
USUAL = 132  # questions, after which those of EXTRA come, and so on
LONGEST = 8.0  # periods of one flight
# Periods before a late start, or from it to time 0, as powers of two. Later ones a stepper may refuse: of
# sixteen waves the last is 2^24 of its own periods late by then, and much of a phase is lost.
LATE = 10, 12, 14, 16, 18, 20, 20
# Draws for one question, and how many of them are like the one before. Every fortieth meets a mushroom's
# base: of four hundred, none would in one of some thousands of runs.
ATTEMPTS, LIKE_BEFORE = 4000, 24
# An answer is another one that is farther off than any error that passes, a thousandth of its size up to the
# condition TELLING. Late questions may have higher ones: those are not asked as like the one before.
ANOTHER, TELLING = 2.0**-7, float(DIGITS / SHARPEST)
HITS = 2, 3, 4, 5  # of trajectories and flows
NUDGE = dict(NUDGES)


def fresh(seed: int, n: int) -> Iterator[Vector]:
    """Draw questions and prove their answers, each when it is asked for.

    Args:
        seed: of the run.
        n: how many.

    Yields:
        Steps that end in a collision, trajectories and flows, `fresh/1` to `fresh/n`, filed as of level core,
        though the conditions of late ones go up to those of extended; a greater n only adds some.

    Raises:
        BadInput: for none of very many draws an answer is proved.
    """
    last: Vector | None = None
    for number in range(1, n + 1):
        last = _drawn(seed, number, last)
        yield last


def fresh_one(seed: int, number: int) -> Vector:
    """Draw and prove one question of `fresh`, and at most the one before, which it may be like."""
    return _drawn(seed, number, _drawn(seed, number - 1, None) if _is_like_before(number) else None)


def _is_like_before(number: int) -> bool:
    return number % 3 == 0 and not _extra(number)


def _extra(number: int) -> Extra | None:
    """Return kind, table, wall and aspect of the questions that are made for their own sake."""
    place = (number - 1) % (USUAL + len(EXTRA)) - USUAL
    return EXTRA[place] if place >= 0 else None


def _kind(number: int) -> Kind:
    """Return what a question asks for: of those that are like the one before, and of these, a step."""
    if extra := _extra(number):
        return extra.kind
    return "trajectory" if number % 6 == 1 else "flow" if number % 6 == 4 else "step"


def _drawn(seed: int, number: int, last: Vector | None) -> Vector:
    """Return a question, given the one before, which is looked at where this one is like it."""
    before = last if _is_like_before(number) else None
    proved = (_proved(question, number) for question in _questions(seed, number, before))
    return next(vector for vector in proved if vector)


def _questions(seed: int, number: int, before: Vector | None) -> Iterator[Question]:
    """Yield questions of one number that are not delicate; first some that change one law of that before."""
    table, wanted = _wanted(number)
    for attempt in range(ATTEMPTS):
        draw = Draw(f"{seed}/{GROUP}/{number}/{attempt}")
        like = before if attempt < LIKE_BEFORE else None
        try:
            if like:
                of, start, t_end = _one_law_changed(draw, from_data(like.scene)), like.state, like.t_end
            else:
                of, start, t_end = _made(draw, number) or _usual(draw, number, table)
                if _aspect(number) == "return":
                    of, start, t_end = in_other_units(draw, of, start, t_end)
        except BadInput:
            continue
        met = plain.next_collision(of, start, t_end)
        if not isinstance(met, Collision) or not (_is_another(met, like) if like else met.wall == wanted):
            continue
        ask_path = _asked_beyond if _aspect(number) and _kind(number) != "step" else _asked
        question = ask_path(draw, _kind(number), of, start, t_end)
        if question and like:
            question = question._replace(longest=min(question.longest, TELLING))
        if question and _is_steady(of, question):
            yield question
    raise BadInput(f"{GROUP}/{number}: none of {ATTEMPTS} draws has a certified answer")


def _wanted(number: int) -> tuple[str, Wall]:
    """Return the table of a question, and the wall that is to be met first."""
    if extra := _extra(number):
        return extra.table, extra.wall
    return WALLS[(number - number // 3) % len(WALLS)]


def _aspect(number: int) -> str:
    """Return what a question is made for: a word of `_made` and `_start_of`, empty for those that are not."""
    table, wall = _wanted(number)
    if extra := _extra(number):
        return extra.aspect
    if number % 12 == 5 and wall != "base":  # which never moves
        return "brief"
    if number % 12 == 11 and wall != "base":
        return "return"
    if number % 6 != 2:
        return ""
    if table == "mushroom":
        return "mouth" if wall != "arc" else ""
    return {"arc": "legs", "floor": "legs", "base": ""}.get(wall, "lean")


def _is_late(number: int) -> bool:
    return number % 7 == 5


def _made(draw: Draw, number: int) -> tuple[Scene, State, float] | None:
    """Draw scene, start and horizon of the numbers whose scenes are made for them; None for the others."""
    (table, wall), aspect = _wanted(number), _aspect(number)
    is_side = wall in ("left", "right")
    if aspect == "sweep" or (is_side and aspect == "brief" and (table == "stem" or draw.part() < 0.75)):
        of, t = swept_scene(draw, table)
        return of, *swept_start(draw, of, t, wall)
    if aspect == "lean":
        depth = (
            DEPTHS[number % 5 % len(DEPTHS)] if _kind(number) != "trajectory" else max(DEPTHS)
        )  # each in turn
        stem = leaning_stem(draw, clock(draw, KINDS), depth)
        return stem, *leaning_start(draw, stem, time(draw, stem))
    if aspect == "legs":
        of, t = scene_of_many_legs(draw, table)
        return of, *_start(draw, of, t)
    if aspect == "wait":
        trembling = vibrating_scene(draw, table)
        return trembling, *waiting_start(draw, trembling, time(draw, trembling))
    if aspect == "hurry" or (aspect == "return" and is_side and table == "mushroom"):
        mushroom = under_a_growing_cap(draw)
        if aspect == "hurry":
            return mushroom, *hurried_start(draw, mushroom, time(draw, mushroom))
        return mushroom, *_start_of(draw, number, mushroom)
    return None


def _usual(draw: Draw, number: int, table: str) -> tuple[Scene, State, float]:
    of = drawn_scene(draw, table)
    return of, *_start_of(draw, number, of)


def _is_another(met: Collision, before: Vector) -> bool:
    """Tell whether a collision is clearly not that of the question before."""
    (step,) = before.expect[0].steps
    return met.wall != step.wall or any(
        abs(getattr(met, name) - float(step.centre(name))) > ANOTHER * max(abs(getattr(met, n)) for n in part)
        for part in (("dt",), ("x", "y"), ("vx", "vy"))
        for name in part
    )


def _asked(draw: Draw, kind: Kind, of: Scene, start: State, t_end: float) -> Question | None:
    """Return a question of a kind; None where fewer hits follow than it is to have."""
    scene = {**wire_form(of), **({"name": of.name} if of.name else {})}
    question = Question(
        GROUP, RULES[kind], "sec. 2", scene, start, t_end, longest=CONDITIONS[_delicacy(of, start)]
    )
    if kind == "step":
        return question
    n_hits = draw.pick(HITS)
    hits = plain.trajectory(of, start, n_hits + 1, t_end)
    if not all(isinstance(hit, Collision) for hit in hits):
        return None
    if kind == "trajectory":
        return question._replace(collisions=n_hits)
    before, after = hits[-2:]
    assert isinstance(before, Collision)
    assert isinstance(after, Collision)
    return question._replace(t_end=(before.t + after.t) / 2, collisions=n_hits + 1, flow=any_marks)


def _asked_beyond(draw: Draw, kind: Kind, of: Scene, start: State, t_end: float) -> Question | None:
    """Return a question for one hit, as the flight there may be delicate, or for a flow a little on."""
    question = _asked(draw, "step", of, start, t_end)
    assert question
    question = question._replace(rule=RULES[kind], collisions=1)
    if kind == "trajectory":
        return question
    hit, after = plain.trajectory(of, start, 2, t_end)
    if not (isinstance(hit, Collision) and isinstance(after, Collision | Horizon)):
        return None
    return question._replace(t_end=(hit.t + after.t) / 2, collisions=2, flow=any_marks)


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
    is_late = abs(start.t) > 2.0 ** (LATE[0] - 1) * (cycle_length(of) or inf)
    return "extended" if is_late or is_leaning(of) else "core"


def _start_of(draw: Draw, number: int, of: Scene) -> tuple[State, float]:
    """Draw the start of a question and its horizon, as its number has it."""
    length = cycle_length(of) or 1.0
    t = time(draw, of) - draw.pick((0, 0, 1, 4, 60)) * length
    if _is_late(number):
        t += draw.pick((1.0, -1.0)) * 2.0 ** draw.pick(LATE) * length
    aspect = _aspect(number)
    if aspect == "brief":
        start, after = brief_start(draw, of, t, _wanted(number)[1])
        return start, after + length * draw.between(0.5, LONGEST / 2)
    if aspect == "return":
        return returning_start(draw, of, t, _wanted(number)[1])
    if aspect == "mouth":
        assert isinstance(of, Mushroom)
        return arc_to_mouth(draw, of, t), t + LONGEST * length
    return _start(draw, of, t)


def _start(draw: Draw, of: Scene, t: float) -> tuple[State, float]:
    """Draw a state at a time: of any speed, in any direction and in those that formulas divide by."""
    length, moving = cycle_length(of) or 1.0, walls_speed(of)
    table = rounded(of, t)
    usual = moving or table.size
    speed = draw.between(1.0, 2.0) * draw.pick(
        (usual * draw.power(-2, 8), table.size / length * draw.power(-2, 6))
    )
    found, t_end = state(draw, of, {"t": t, "speed": speed / usual, "patience": 32.0})
    t_end = min(t_end, t + LONGEST * length)
    way = draw.pick(range(12))
    if way == 0 and isinstance(of, Mushroom):
        x, vy = draw.pick((0.0, draw.between(-0.99, 0.99) * table.w)), abs(found.vy)
        return State(t, x, 0.0, found.vx, vy, "base"), t_end
    if found.wall and draw.part() < 0.5:
        return off_its_wall(draw, of, found), t_end
    if way == 1:
        return msgspec.structs.replace(found, vx=0.0), t_end
    if way == 2:
        return msgspec.structs.replace(found, vy=0.0), t_end
    if way == 3:
        return msgspec.structs.replace(found, vx=-speed * found.x, vy=-speed * found.y), t_end
    return found, t_end


def _one_law_changed(draw: Draw, of: Scene) -> Scene:
    """Return the scene with one law exchanged for another of the same range and period."""
    known = laws(of)
    name = draw.pick(sorted(known))
    within = bounds(known[name])
    low, high = within.lowest, within.highest
    if name in SIZES and low <= 0:  # of a deep wave no more is known than that it stays positive
        low = 0.1 * high
    margin = 0.0 if low < high else 0.05 * abs(low)
    moving = [other for other in known.values() if isinstance(other, Fourier | BangBang)]
    changed: Law = draw.between(low - margin, high + margin)
    if moving and draw.part() < 0.5:
        other = draw.pick(moving)
        if isinstance(other, Fourier):
            size = (high - low + 2 * margin) * draw.between(0.1, 0.4)
            changed = msgspec.structs.replace(other, mean=(low + high) / 2, cos=(), sin=(size,))
        else:
            changed = BangBang(knots=_within(other, draw, low - margin, high + margin))
    return msgspec.structs.replace(of, **{name: changed})


def _within(of: BangBang, draw: Draw, low: float, high: float) -> tuple[tuple[float, float], ...]:
    values = [draw.between(low, high) for _ in of.knots[1:]]
    return tuple((t, v) for (t, _), v in zip(of.knots, [*values, values[0]], strict=True))


def _proved(question: Question, number: int) -> Vector | None:
    """Return a question with its certified answer; None where there is none, or it is too delicate."""
    try:
        vector = certify(question._replace(level="core"), number)
    except Unfit:
        return None
    is_met = vector.kind != "step" or vector.expect[0].outcome == "collision"
    return vector if is_met and vector.condition <= question.longest else None
