"""Questions in scenes that no file holds: right steppers pass, who is right in the corpus alone does not."""

from __future__ import annotations

import json
from functools import cache
from math import hypot, inf
from typing import ClassVar

import msgspec
import pytest
from support.depth import deep_among, deep_but

import fast
from conformance import plain, vectors
from conformance.cases.draws import wire_form
from conformance.cases.flow_families import any_marks
from conformance.cases.fresh import (
    ANOTHER,
    TELLING,
    USUAL,
    WALLS,
    _is_steady,
    drawn_scene,
    fresh,
    fresh_one,
)
from conformance.cases.question import Question
from conformance.cases.seldom import EXTRA
from conformance.grading.agreement import physics_bound
from conformance.grading.grade import grade
from conformance.mutants import Mutant
from conformance.mutants.of_laws import single
from conformance.plain.flow import MAX_COLLISIONS, PlainPath
from conformance.plain.motion import BangBangMotion
from conformance.plain.step import Flight, Open
from conformance.suite.disguise import Disguise, drawn_disguise
from conformance.suite.run import N_FRESH
from conformance.verify import Verdict, verify_line
from fast.__main__ import carry, follow
from scene import BadInput, BangBang, Fourier, Mushroom, Rejected, State, from_data
from scene.tables import cycle_length, laws

SEEDS = (1, 2)
N = N_FRESH["core"]
SOME = N // 3  # of the first seed's: what every run of the tests asks


@cache
def questions(seed, n=N):
    return list(fresh(seed, n))


def answer_to(vector):
    """Return the right answer of a step."""
    return vectors.answer(vector, plain.next_collision, plain.trajectory)


@pytest.mark.parametrize("asked", deep_but([(1, SOME), (1, N), (2, N)], (1, SOME)))
def test_right_steppers_pass(asked):
    for vector in questions(*asked):
        for step, path, flow in (
            (fast.next_collision, follow, carry),
            (plain.next_collision, plain.trajectory, plain.flow),
        ):
            found = grade(vector, vectors.answer(vector, step, path, flow))
            assert found.verdict == "pass", (vector, found)


@pytest.mark.deep
@pytest.mark.parametrize("seed", SEEDS)
def test_all_is_asked_that_the_corpus_asks_seldom(seed, tally):
    asked = questions(seed)
    known = {msgspec.json.encode(vector.scene) for vector in vectors.load("stress")}
    for i, vector in enumerate(asked):
        scene, step = from_data(vector.scene), vector.expect[0].steps[0]
        kinds = {type(law) for law in laws(scene).values()}
        assert msgspec.json.encode(vector.scene) not in known
        assert drawn_disguise(vector, seed) == Disguise()
        if vector.kind == "step":
            tally[f"{vector.scene['table']}, {step.wall}"] += 1
        tally["before 0"] += vector.state.t < 0
        tally["of mixed laws"] += kinds >= {Fourier, BangBang}
        tally[vector.kind] += 1
        tally["hits beyond the first"] += (vector.collisions - 1) if vector.kind == "trajectory" else 0
        if i > 0 and vector.state == asked[i - 1].state:
            tally["like the one before"] += 1
            assert grade(vector, answer_to(asked[i - 1])).verdict == "fail"
            assert vector.condition * physics_bound(vector.condition) < ANOTHER
        tally["named"] += "name" in vector.scene
        tally["late"] += abs(vector.state.t) > 500 * (cycle_length(scene) or inf)
        tally["more than 20 legs"] += any(len(getattr(law, "knots", ())) > 20 for law in laws(scene).values())
    assert all(tally[f"{table}, {wall}"] >= 6 for table, wall in WALLS)
    assert min(tally["before 0"], tally["named"]) > N / 5
    assert tally["like the one before"] > N / 8
    for kind in ("trajectory", "flow"):
        assert tally[kind] == USUAL / 6 + sum(extra.kind == kind for extra in EXTRA)
    assert tally["hits beyond the first"] > N / 6
    assert tally["of mixed laws"] > N / 12
    assert tally["more than 20 legs"] >= 3
    assert tally["late"] >= N / 12


@pytest.mark.deep
def test_what_is_drawn_follows_from_the_seed():
    assert list(fresh(1, 12)) == questions(1, SOME)[:12]
    assert list(fresh(3, 12)) != questions(1, SOME)[:12]


def test_what_the_verifier_does_not_prove_is_not_asked(monkeypatch):
    asked = []

    def shy(record):
        asked.append(record)
        return Verdict("not proved", "") if len(asked) == 1 else verify_line(record)

    monkeypatch.setattr("conformance.cases.certify.verify_line", shy)
    assert fresh_one(1, 1).state != questions(1, SOME)[0].state
    assert len(asked) > 1


def test_where_errors_that_pass_may_be_large_no_answer_is_taken_for_another(monkeypatch):
    before, like = fresh_one(1, 5), fresh_one(1, 6)
    assert like.state == before.state
    monkeypatch.setattr("conformance.cases.fresh.TELLING", like.condition / 2)
    assert fresh_one(1, 6).condition <= like.condition / 2 or fresh_one(1, 6).state != before.state
    assert float(physics_bound(TELLING)) * TELLING < ANOTHER < float(physics_bound(1e12)) * 1e12


@pytest.mark.parametrize(("x", "is_asked"), [(0.6, True), (0.5 + 2.0**-36, False), (0.5 - 2.0**-36, False)])
def test_a_flow_whose_capture_hangs_by_a_thread_is_not_asked(x, is_asked):
    """The walls that are met are the same on both sides of it."""
    start = State(0.0, x, 0.25, 0.0, 4.0)
    still = Mushroom(r=1.0, w=0.5, h=1.0)
    asked = Question("fresh", "", "", wire_form(still), start, 0.25, collisions=2, flow=any_marks)
    assert _is_steady(still, asked) == is_asked


def test_hundreds_of_draws_that_are_none_end_no_run(monkeypatch):
    """One in forty meets the base of a mushroom: in some runs of thousands four hundred in a row do not."""
    n_left = 1000

    def drawn(draw, table):
        nonlocal n_left
        n_left -= 1
        if n_left >= 0:
            raise BadInput("none")
        return drawn_scene(draw, table)

    monkeypatch.setattr("conformance.cases.fresh.drawn_scene", drawn)
    assert len(list(fresh(1, 1))) == 1


class RoomForThirtyLegs(BangBangMotion):
    """Joins all later legs to one."""

    def __init__(self, law, t):
        most = law.knots if len(law.knots) <= 31 else (*law.knots[:30], law.knots[-1])
        super().__init__(BangBang(knots=most), t)


class ManyLegs(Flight):
    """A flight between walls with room for thirty legs."""

    kinds: ClassVar = {**Flight.kinds, BangBang: RoomForThirtyLegs}


class OnlyOnItsWall(Flight):
    """Refuses a start that is farther from its wall than rounding of the place."""

    def refusal(self):
        is_off = self.wall and abs(self.gap(self.wall, 0.0).start) > 1e-9 * (self.x**2 + self.y**2)
        return Rejected("off its wall") if is_off else super().refusal()


class Keeping(Flight):
    """Keeps the table by its name, or by all but one of its laws."""

    kept: ClassVar[dict[str, object]] = {}

    def __init__(self, scene, state, t_end):
        super().__init__(self.kept.setdefault(self.key(scene), scene), state, t_end)


class KeptByName(Keeping):
    """Takes two scenes of one name for the same."""

    def key(self, scene):
        return scene.name or repr(scene)


class KeptWithoutDepth(Keeping):
    """Forgets the depth of the stem and its slope in the key of a table."""

    def key(self, scene):
        forgotten = {name: value for name, value in (("h", 1.0), ("slope", 0.0)) if name in laws(scene)}
        return repr(msgspec.structs.replace(scene, name="", **forgotten))


def wrong_where(condition):
    """Return a flight that gives a speed off by a thousandth, where a condition on flight and wall holds."""

    class WrongThere(Flight):
        def bounce(self, wall, s):
            vx, vy = super().bounce(wall, s)
            return (1.001 * vx, 1.001 * vy) if condition(self, wall) else (vx, vy)

    return WrongThere


def family(scene):
    """Return what a law is in a scene, and its numbers in proportion: the same in all its disguises."""
    return json.dumps([sorted(laws(scene)), *(_proportions(law) for law in laws(scene).values())])


def _proportions(law):
    if isinstance(law, BangBang):
        return sorted({f"{v / (law.knots[0][1] or 1.0):.6g}" for _, v in law.knots})
    return (
        [f"{a / (law.mean or 1.0):.6g}" for a in (*law.cos, *law.sin)]
        if isinstance(law, Fourier)
        else "constant"
    )


KNOWN = {family(from_data(v.scene)) for v in vectors.load("stress") if v.expect[0].outcome != "rejected"}


class OmegaOfTheFirst(Flight):
    """Takes omega of the first wave of a scene for all: one that stands still may have any."""

    def law(self, law):
        if isinstance(law, Fourier):
            first = next(other for other in laws(self.scene).values() if isinstance(other, Fourier))
            law = msgspec.structs.replace(law, omega=first.omega, period=first.period)
        return super().law(law)


class NoBaseInTheMouth(Flight):
    """Refuses a state that names the base in the open mouth, where the mouth may have been narrower."""

    def refusal(self):
        is_open = isinstance(self.scene, Mushroom) and abs(self.x) < self.width(0.0).value
        return Rejected("no base") if is_open and self.wall == "base" else super().refusal()


class LooksByThePeriod(Flight):
    """Looks at f 64 times in a period for a change of sign, and in a flight."""

    def first_root(self, wall, start, end):
        look = min((cycle_length(self.scene) or 1.0) / 64, (end - start) / 64)
        a = start
        while a < end:
            b = min(a + look, end)
            if self.f(wall, b)[0] <= 0:
                return self.root_between(wall, a, b)
            if b == a:
                raise Open("a look of no length")
            a = b
        return None

    def require_clear(self, walls, s):
        """Goes on, outside a wall that it has missed."""


class CapturedCannotLeave(Flight):
    """Keeps a particle in the cap that leaves the arc on a chord which the mouth does not reach yet."""

    def is_mouth_open(self, s):
        reach = self.width(0.0).value * hypot(self.vx, self.vy)
        is_captured = self.state.wall == "arc" and abs(self.x * self.vy - self.y * self.vx) > reach
        return not is_captured and super().is_mouth_open(s)


class LatePhaseInFloat32(Flight):
    """Keeps the time of departure in binary32 from a hundred thousand on."""

    def law(self, law):
        t = self.state.t
        return self.kinds[type(law)](law, single(t) if abs(t) > 1e5 else t)


def is_shallow(flight, wall):
    """Tell whether a stem is ten times as wide as it is deep, where one of its walls is met."""
    widths = [flight.bounds[name].lowest for name in ("w", "r") if name in flight.bounds]
    return wall in ("left", "right", "floor") and 10 * flight.bounds["h"].highest < min(widths)


def hardly_moves(flight, wall):
    """Tell whether the arc is met that moves by less than a hundredth of its radius."""
    r = flight.bounds.get("r")
    return wall == "arc" and 0 < r.highest - r.lowest < r.lowest / 100


FAULTY = {
    "omega of the first": OmegaOfTheFirst,
    "no base in the mouth": NoBaseInTheMouth,
    "where the stem is shallow": wrong_where(is_shallow),
    "where the arc hardly moves": wrong_where(hardly_moves),
    "straight at the centre": wrong_where(
        lambda flight, wall: wall == "arc" and flight.x * flight.vy == flight.y * flight.vx
    ),
    "right in known scenes": wrong_where(lambda flight, _: family(flight.scene) not in KNOWN),
    "before time 0, in waves": wrong_where(
        lambda flight, _: flight.state.t < 0 and Fourier in map(type, laws(flight.scene).values())
    ),
    "room for thirty legs": ManyLegs,
    "only on its wall": OnlyOnItsWall,
    "kept by name": KeptByName,
    "kept without depth": KeptWithoutDepth,
    "looks by the period": LooksByThePeriod,
    "captured cannot leave": CapturedCannotLeave,
    "late phase in float32": LatePhaseInFloat32,
}


SELDOM_SEEN = (
    "omega of the first",
    "where the stem is shallow",
    "room for thirty legs",
    "captured cannot leave",
)


class LaterHitsInKnownScenes(PlainPath):
    """Gains a thousandth of its speed at the second hit, where no file holds the scene."""

    kind = "trajectory"

    def told(self, hit):
        is_wrong = self.n_hits == 2 and self.is_followed and family(self.scene) not in KNOWN
        return msgspec.structs.replace(hit, vx=1.001 * hit.vx, vy=1.001 * hit.vy) if is_wrong else hit

    @property
    def is_followed(self):
        return (self.most != MAX_COLLISIONS) == (self.kind == "flow")


class FlowsInKnownScenes(LaterHitsInKnownScenes):
    """Does so in a flow."""

    kind = "flow"


FAULTY_PATHS = {
    "later hits in known scenes": LaterHitsInKnownScenes,
    "flows in known scenes": FlowsInKnownScenes,
}


def n_failures(flight, asked, path=PlainPath):
    """Return how many answers of a faulty stepper fail."""
    Keeping.kept.clear()
    faulty = Mutant("faulty", "", flight, path)
    answers = ((v, vectors.answer(v, faulty.step, faulty.trajectory, faulty.flow)) for v in asked)
    return sum(grade(vector, answer).verdict == "fail" for vector, answer in answers)


@pytest.mark.parametrize("name", deep_among(FAULTY, *SELDOM_SEEN))
def test_who_is_right_in_the_corpus_alone_is_found_out(name):
    asked = [questions(seed) for seed in SEEDS] if name in SELDOM_SEEN else [questions(1, SOME)]
    assert any(n_failures(FAULTY[name], some) for some in asked)


@pytest.mark.parametrize("name", FAULTY_PATHS)
def test_who_goes_on_right_in_the_corpus_alone_is_found_out(name):
    """All of its single steps are right."""
    steps, paths = (
        [v for v in questions(1, SOME) if (v.kind == "step") == is_step] for is_step in (True, False)
    )
    assert not n_failures(Flight, steps, FAULTY_PATHS[name])
    kinds = {v.kind for v in paths if n_failures(Flight, [v], FAULTY_PATHS[name])}
    assert kinds == {FAULTY_PATHS[name].kind}
