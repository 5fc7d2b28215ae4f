"""Questions in scenes that no file holds, drawn from a run's seed and proved while the suite waits.

A disguise changes how a published question is asked, and not what is asked: whoever is right in the scenes of
the corpus, and wrong in others, passes all of them. So tables, walls, kinds of laws, signs of the time and
places of the start are drawn together, and each wall of each table is met first about as often. A sixth of
them ask for a trajectory, another sixth for a flow: what comes after the first collision is new as well.
Every third question keeps the scene before but for one law, and its state, and has another answer, if such a
law is soon found (few act on a flight to the base): an implementation that knows a scene by less than all of
it gives the answer before. Scenes carry names, which mean nothing: different ones the same.
Some meet their wall for a short time only, some cross a mouth that opens or closes during the flight
(`generator.in_flight`), and every seventh begins up to a million periods late, or before 0.
Answers are proved by the reference alone, and are no more delicate than those of level core, but for late
ones, whose time when rounded tells less of the phase: these than level extended. All are filed as of level
core. The plain stepper chooses which draws are asked: those that meet the wall that is looked for, and keep
it when nudged.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import msgspec

import reference
from conformance import plain
from conformance.generator.draws import (
    Draw,
    SharedPeriod,
    clock,
    law,
    scene,
    state,
    time,
    walls_speed,
    wire_form,
)
from conformance.generator.flow_families import any_marks
from conformance.generator.in_flight import arc_to_mouth, brief_start
from conformance.generator.links import Confirmation, Unfit
from conformance.generator.paths import proved_path
from conformance.generator.prover import CONDITIONS, NUDGES, SIGNS, ask, flight_of, nudged
from conformance.generator.question import Proved, Question, filed
from conformance.grading.agreement import DIGITS, SHARPEST
from conformance.grading.error import condition_number, inputs_of
from conformance.vectors import Expectation, Kind, Level, Vector
from scene import BadInput, BangBang, Collision, Fourier, Law, Mushroom, Scene, State, Wall, from_data
from scene.geometry import rounded
from scene.laws import bounds, is_constant
from scene.states import ON_WALL
from scene.tables import cycle_length, laws
from scene.transforms import scaled_law

GROUP = "fresh"
RULES: dict[Kind, str] = {
    "step": "a flight in a scene that no file holds",
    "trajectory": "some flights in a scene that no file holds",
    "flow": "a particle carried through a scene that no file holds",
}
ALONE = Confirmation()  # the reference's word is taken
WALLS: tuple[tuple[str, Wall], ...] = (
    *(("cap", wall) for wall in ("arc", "base")),
    *(("stem", wall) for wall in ("left", "right", "floor", "base")),
    *(("mushroom", wall) for wall in ("arc", "base", "left", "right", "floor")),
)
KINDS = ("fourier", "bang-bang", "mixed", "mixed", "mixed", "harmonics")  # mixed: each law of its own
LEGS = 7, 7, 7, 12, 12, 23, 40, 120  # of a law with many: the corpus has at most four
SHAPES = {"h": (-5, -3, 3, 5), "nu": (-8, -4), "w": (-8, -4)}  # powers of two that a law is multiplied with
FAINT = 8, 20, 30  # powers of a half that what a law moves by is multiplied with
LONGEST = 8.0  # periods of one flight
# Periods before a late start, or from it to time 0, as powers of two. Later ones a stepper may refuse: of
# sixteen waves the last is 2^24 of its own periods late by then, and much of a phase is lost.
LATE = 10, 12, 14, 16, 18, 20, 20
NAMES = "", "", "scene", "scene", "1"
# Draws for one question, and how many of them are like the one before. Every fortieth meets a mushroom's
# base: of four hundred, none would in one of some thousands of runs.
ATTEMPTS, LIKE_BEFORE = 4000, 50
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
    return number % 3 == 0


def _kind(number: int) -> Kind:
    """Return what a question asks for: of those that are like the one before, and of these, a step."""
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
                of = drawn_scene(draw, table)
                start, t_end = _start_of(draw, number, of)
        except BadInput:
            continue
        met = plain.next_collision(of, start, t_end)
        if not isinstance(met, Collision) or not (_is_another(met, like) if like else met.wall == wanted):
            continue
        question = _asked(draw, _kind(number), of, start, t_end)
        if question and like:
            question = question._replace(longest=min(question.longest, TELLING))
        if question and _is_steady(of, question):
            yield question
    raise BadInput(f"{GROUP}/{number}: none of {ATTEMPTS} draws has a certified answer")


def _wanted(number: int) -> tuple[str, Wall]:
    """Return the table of a question, and the wall that is to be met first."""
    return WALLS[(number - number // 3) % len(WALLS)]


def _is_brief(number: int) -> bool:
    return number % 12 == 5 and _wanted(number)[1] != "base"  # which never moves


def _crosses_changed_mouth(number: int) -> bool:
    table, wall = _wanted(number)
    return number % 6 == 2 and table == "mushroom" and wall != "arc"


def _is_late(number: int) -> bool:
    return number % 7 == 5


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
    """Return the level that says how delicate a question may be: late, a part of the time is a phase."""
    is_late = abs(start.t) > 2.0 ** (LATE[0] - 1) * (cycle_length(of) or inf)
    return "extended" if is_late else "core"


def drawn_scene(draw: Draw, table: str) -> Scene:
    """Draw a scene of a table: laws of all kinds, of any shape, also long ones, that begin anywhere."""
    shared = clock(draw, KINDS)
    of = scene(draw, table, shared)
    of = msgspec.structs.replace(of, **{name: _shaped(draw, name, found) for name, found in laws(of).items()})
    if table != "cap" and draw.part() < 0.5:
        of = msgspec.structs.replace(of, slope=law(draw, -0.4, _steepest(of), shared))
    changed = {name: _begun_elsewhere(draw, found, shared) for name, found in laws(of).items()}
    return msgspec.structs.replace(of, **changed, name=draw.pick(NAMES))


def _shaped(draw: Draw, name: str, of: Law) -> Law:
    """Return a law as it is, or of a shape seldom drawn.

    That is: a stem far deeper or shallower, a mouth far narrower than the cap is wide; a law that hardly
    moves, and one that does not, but is written as one that might, with a period that no other has.
    """
    if draw.part() < 0.25 and name in SHAPES:
        of = scaled_law(of, draw.pick(SHAPES[name]), 0)
    if draw.part() > (0.5 if isinstance(of, float) else 0.25):
        return of
    if isinstance(of, Fourier):
        part = 2.0 ** -draw.pick(FAINT)
        cos, sin = (tuple(part * a for a in amplitudes) for amplitudes in (of.cos, of.sin))
        return msgspec.structs.replace(of, cos=cos, sin=sin)
    if isinstance(of, BangBang):
        first, part = of.knots[0][1], 2.0 ** -draw.pick(FAINT)
        return BangBang(knots=tuple((t, first + part * (v - first)) for t, v in of.knots))
    if draw.part() < 0.5:
        return Fourier(mean=of, omega=draw.short(0.5, 6.0))
    return BangBang(knots=tuple((draw.short(0.1, 1.0) + k, of) for k in range(0, 9, 4)))


def _steepest(of: Scene) -> float:
    """Return a slope that no stem of this scene closes under."""
    found = {name: bounds(known) for name, known in laws(of).items()}
    narrowest = found["w"].lowest if "w" in found else found["nu"].lowest * found["r"].lowest
    return 0.9 * narrowest / found["h"].highest


def _begun_elsewhere(draw: Draw, of: Law, shared: SharedPeriod) -> Law:
    """Return a bang-bang law with its knots moved by a part of the period, now and then one of many legs."""
    if not isinstance(of, BangBang) or is_constant(of):
        return of
    knots = of.knots
    if draw.pick(range(3)) == 0:
        n, low, high = draw.pick(LEGS), min(v for _, v in knots), max(v for _, v in knots)
        values = [draw.between(low, high) for _ in range(n)]
        places = sorted({0, *(draw.pick(range(1, 1024)) for _ in range(n - 1))})
        times = [*(shared.rate * place / 1024 for place in places), shared.rate]
        knots = tuple(zip(times, [*values[: len(places)], values[0]], strict=True))
    by = shared.rate * draw.pick(range(-256, 256)) / 64  # all sums are exact
    return BangBang(knots=tuple((t + by, v) for t, v in knots))


def _start_of(draw: Draw, number: int, of: Scene) -> tuple[State, float]:
    """Draw the start of a question and its horizon, as its number has it."""
    length = cycle_length(of) or 1.0
    t = time(draw, of) - draw.pick((0, 0, 1, 4, 60)) * length
    if _is_late(number):
        t += draw.pick((1.0, -1.0)) * 2.0 ** draw.pick(LATE) * length
    if _is_brief(number):
        start, after = brief_start(draw, of, t, _wanted(number)[1])
        return start, after + length * draw.between(0.5, LONGEST / 2)
    if _crosses_changed_mouth(number):
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
        return _off_its_wall(draw, of, found), t_end
    if way == 1:
        return msgspec.structs.replace(found, vx=0.0), t_end
    if way == 2:
        return msgspec.structs.replace(found, vy=0.0), t_end
    if way == 3:
        return msgspec.structs.replace(found, vx=-speed * found.x, vy=-speed * found.y), t_end
    return found, t_end


def _off_its_wall(draw: Draw, of: Scene, start: State) -> State:
    """Return a start farther from its wall than rounding leads, on either side, and on it by definition."""
    assert start.wall is not None
    if start.wall == "base":
        return start  # at y = 0 it is, or it is not
    table = rounded(of, start.t)
    nx, ny = table.normal(start.wall, start.x, start.y)
    reach = {"arc": table.r, "floor": table.h}.get(start.wall, table.w)
    by = reach * ON_WALL * draw.power(-9, -2) * draw.pick((1.0, -1.0))
    return msgspec.structs.replace(start, x=start.x + by * nx, y=start.y + by * ny)


def _one_law_changed(draw: Draw, of: Scene) -> Scene:
    """Return the scene with one law exchanged for another of the same range and period."""
    known = laws(of)
    name = draw.pick(sorted(known))
    within = bounds(known[name])
    low, high = within.lowest, within.highest
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
    """Return a question with its proved answer; None where there is none, or its condition is too high."""
    of, is_step = from_data(question.scene), question.kind == "step"
    try:
        found = _proved_step(of, question) if is_step else proved_path(of, question, ALONE)
    except Unfit:
        return None
    return filed(question, number, found, "core") if found.condition <= question.longest else None


def _proved_step(of: Scene, question: Question) -> Proved:
    start, t_end = question.state, question.t_end
    outcome = ask(of, start, t_end)
    if not isinstance(outcome, reference.Collision):
        raise Unfit("no collision is met")
    flight = flight_of(outcome, start, t_end)
    condition = condition_number(flight.centre(), flight.jacobian, inputs_of(start))
    return Proved((Expectation("collision", (flight.certified(start),)),), condition)
