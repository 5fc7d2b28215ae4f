"""The corpus's hard cases against what is derived by hand: wall, outcome, closed forms, and whole paths.

Keys are number and index of a case (`hard-case-08/1` is "08/1"); scene and state are the corpus's. The closed
forms are chords of a circle, quadratics before a wall under constant acceleration, or roots bracketed by
hand. LIFT is the floor of most: h = 2 - 8 t^2 until t = 1/4, then 1 + 8 (t - 1/2)^2, then 2 - 8 (t - 1)^2.

Static limits are compared bit for bit. That mirror images (cases 43 and 48) are mirrored to the bit is held
by test_fast_bits.py and test_conformance_properties.py for drawn questions.
"""

from __future__ import annotations

import io
import json
import re
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from support.truth import proved_step

import fast
import reference
from conformance import vectors
from conformance.grading.agreement import compare
from scene import Collision, Horizon, InvalidScene, Rejected, State, Undecided, Undefined, from_data
from scene.protocol.wire import MAX_COLLISIONS, serve

MAX_ULPS = 64.0  # backward ulps that the fast stepper may be off
CASES = {vector.id: vector for vector in vectors.load("stress") if vector.group.startswith("hard-case-")}


def case(name):
    """Return a hard case by number and index: `case("04/2")`."""
    return CASES[f"hard-case-{name}"]


def scene_of(name):
    """Return the scene of a hard case."""
    return from_data(case(name).scene)


def in_both(name, *, may_be_undecided=False):
    """Return the reference's outcome of a step, once both steppers agree with the certified one.

    Args:
        name: number and index of the case.
        may_be_undecided: whether the case is degenerate within rounding, so that the fast stepper may say
            `undecided`; the reference may not.
    """
    asked, scene = case(name), scene_of(name)
    proved = reference.next_collision(scene, asked.state, asked.t_end, digits=40)
    assert not isinstance(proved, Undecided), proved
    rounded = proved.rounded() if isinstance(proved, reference.Collision | reference.Horizon) else proved
    assert compare(rounded, asked.expect[0], asked.state, 1.0).kind == "agrees", proved
    answer = fast.next_collision(scene, asked.state, asked.t_end)
    found = compare(answer, asked.expect[0], asked.state, MAX_ULPS)
    assert found.kind == "agrees" or (may_be_undecided and found.kind == "undecided"), (found, answer, proved)
    return proved


def is_enclosed(number, enclosure):
    """Tell whether an exact or 300-digit number lies in an enclosure of at least 40 digits."""
    if isinstance(number, Fraction | float):
        return enclosure.contains(number)
    return bool(enclosure.lo <= number <= enclosure.hi)


mpf = mpmath.mpf
# Degenerate within rounding: the fast stepper may be undecided.
UNDECIDABLE = {"01/6", *(f"04/{i}" for i in range(2, 7)), "05/1", "06/1", "06/2", "07/1", "21/3"}
UNDECIDABLE |= {*(f"23/{i}" for i in range(1, 7)), "25/3", "28/1", "29/1", "29/2", "30/7"}


@pytest.fixture(autouse=True)
def three_hundred_digits():
    with mpmath.workdps(300):
        yield


def root(a, b, c, sign=1):
    """(-b + sign sqrt(b^2 - 4 a c)) / (2 a), exact inputs, 300 digits."""
    a, b, c = (mpf(n) for n in (a, b, c))
    return (-b + sign * mpmath.sqrt(b * b - 4 * a * c)) / (2 * a)


def chord(s):
    """Leaving the arc, a chord takes -2 q.v / v^2, exactly."""
    x, y, vx, vy = (Fraction(n) for n in (s.x, s.y, s.vx, s.vy))
    return {"dt": -2 * (x * vx + y * vy) / (vx * vx + vy * vy)}


def half_a_chord(s):
    return {"dt": mpmath.sqrt(1 - mpf(s.y) ** 2) / mpf(s.vx)}


def rising_floor(s):
    """Before LIFT's floor at constant acceleration: gate on f', never on v, as 1/2 > 0 is overtaken."""
    time = root(-8, s.vy, mpf(2) + mpf(s.y), -1)
    return {"dt": time, "vy": 32 * time - mpf(s.vy)}


def recollision(s):
    return {"dt": Fraction(s.vy) / 8}


def returning_floor(s):
    """The floor outruns the particle, turns at t = 1, and is met where 1 + 8 u^2 equals its depth."""
    depth = -mpf(s.y) - mpf(s.vy) * (mpf(1.5) - s.t)  # at t = 3/2
    u = root(8, mpf(s.vy), 1 - depth, -1)
    assert -0.25 < u < 0
    return {"dt": mpf(1.5) - s.t + u}


def receding_floor(s):
    """V' = 2 u - v with u = -16 s and v near -4 at s near 1/8: what is left is near 0."""
    time = root(8, s.vy, 0.375, -1)
    return {"dt": time, "vy": -32 * time - mpf(s.vy)}


def first_of_many_roots(_):
    """F = 1/2 - s / 128 + cos(16 s) / 8 turns negative first in the dip whose least value does."""

    def f(time):
        return mpf(0.5) - time / 128 + mpmath.cos(16 * time) / 8

    def dip(k):  # where f' = -1/128 - 2 sin(16 s) = 0 and f'' > 0
        return ((2 * k + 1) * mpmath.pi + mpmath.asin(mpf(1) / 256)) / 16

    first = next(k for k in range(10_000) if f(dip(k)) < 0)
    assert first > 50
    lower, upper = dip(first) - mpmath.pi / 16, dip(first)
    for _ in range(1000):
        middle = (lower + upper) / 2
        lower, upper = (middle, upper) if f(middle) > 0 else (lower, middle)
    return {"dt": lower}


def closing_side(_):
    """1 - 4 s^2 = 7/8."""
    s = mpmath.sqrt(mpf(1) / 32)
    return {"dt": s, "vx": -16 * s}


def braking_floor(s):
    """Past the knot, 1 + 8 (s - 1/2)^2 equals the particle's depth."""
    left = mpmath.sqrt((-mpf(s.y) - 1) / 8)
    return {"dt": mpf(0.5) - left, "vy": 32 * left}


def swept(_):
    return {"dt": mpmath.sqrt(mpf(1) / 32)}


def of(**numbers):
    """The same numbers for every state."""
    return lambda _: numbers


HITS = {
    "01/1": ("arc", chord),
    **{f"01/{i}": ("arc", half_a_chord) for i in range(2, 7)},
    **dict.fromkeys(("08/1", "08/2", "08/3", "16/1", "16/2", "16/3", "16/4"), ("floor", rising_floor)),
    **{f"09/{i}": ("floor", recollision) for i in range(1, 7)},
    "10/1": ("floor", of(dt=Fraction(1, 1024))),  # in the floor's frame all flights last rise / 8
    **dict.fromkeys(("11/1", "11/2"), ("floor", returning_floor)),
    **{f"12/{i}": ("floor", receding_floor) for i in (1, 2, 3)},
    "13/1": ("floor", swept),
    "15/1": ("floor", first_of_many_roots),
    **dict.fromkeys(("18/1", "18/2"), ("right", closing_side)),
    "20/1": ("floor", of(dt=1.0, x=0.75)),  # beyond the mouth's 1/2
    "20/2": ("right", of(dt=0.75, vx=Fraction(-3, 5), vy=Fraction(-4, 5))),  # its normal is (1, 1/2)
    **dict.fromkeys(("21/1", "21/2", "21/4"), ("floor", of(dt=0.5))),
    **{f"23/{i}": (("right", "base")[i % 2], of()) for i in range(3, 11)},
    "24/1": ("base", of(dt=0.5)),  # open at departure, closed at the crossing
    "24/2": ("base", of(dt=0.5)),
    "24/3": ("right", of()),  # through, and swept just below
    "24/4": ("floor", of()),  # closed at departure, open at the crossing
    "24/5": ("base", of(dt=0.5)),
    "25/2": ("base", of(dt=0.5)),
    **dict.fromkeys(("26/1", "26/2"), ("right", lambda _: {"dt": mpmath.sqrt(mpf(3) / 16)})),
    **{f"30/{i}": ("right", lambda s: {"dt": (1 - Fraction(s.x)) / Fraction(s.vx)}) for i in (1, 3, 5, 7)},
    "31/1": ("floor", of(dt=1.5)),
    "31/2": ("base", of(dt=0.5)),
    "31/3": ("right", lambda s: {"dt": Fraction(1e-12) / Fraction(s.vx)}),
    "32/1": ("base", of(dt=2.0**-20)),
    "32/2": ("floor", of()),
    "34/1": ("floor", of(dt=0.25, vy=8.0)),  # 2 - 8 s^2 = 3/2, where the acceleration changes sign
    # No recollision at s = 2^-10 / 8, as the law before the knot has it.
    "35/1": ("base", lambda s: {"dt": Fraction(3, 2) / Fraction(s.vy)}),
    "35/2": ("base", of()),  # the knot comes before the recollision
    "35/3": ("floor", of()),  # the floor recedes ever more slowly
    **dict.fromkeys(("36/1", "36/2"), ("floor", braking_floor)),
    "39/1": ("floor", swept),  # its period is 1: whole periods later all is the same
    **{f"40/{i}": ("arc", half_a_chord) for i in (1, 2, 3)},
    **{f"41/{i}": ("right", lambda s: {"vy": s.vy}) for i in (1, 2, 3)},
    "41/4": ("arc", of()),
    **{f"42/{i}": (wall, lambda s: {"dt": abs(s.y)}) for i, wall in ((1, "base"), (2, "base"), (3, "base"))},
}
HORIZONS = {
    **{f"04/{i}": {} for i in range(1, 7)},
    "05/1": {},
    "25/1": {},
    "14/1": {"t": 50.0, "y": -0.5},
    "27/3": {},
}
UNDEFINED = {
    "06/1": "sliding",
    "06/2": "sliding",
    "21/3": "corner",
    "23/1": "mouth-edge",
    "23/2": "mouth-edge",
}
UNDEFINED |= {"25/3": "mouth-edge", "27/1": "sliding", "27/2": "mouth-edge", "28/1": "corner"}
UNDEFINED |= {"29/1": "corner", "29/2": "corner"}


@pytest.mark.parametrize("name", HITS)
def test_a_hit(name):
    wall, by_hand = HITS[name]
    found = in_both(name, may_be_undecided=name in UNDECIDABLE)
    assert isinstance(found, reference.Collision), found
    assert found.wall == wall
    for field, number in by_hand(case(name).state).items():
        assert is_enclosed(number, found.dt if field == "dt" else getattr(found.after, field)), field


@pytest.mark.parametrize("name", HORIZONS)
def test_nothing_is_hit(name):
    """Among them a floor that stops just below a resting particle, and one that turns under it: no kick."""
    found = in_both(name, may_be_undecided=name in UNDECIDABLE)
    assert isinstance(found, reference.Horizon)
    assert all(getattr(found.at, field).contains(number) for field, number in HORIZONS[name].items())


@pytest.mark.parametrize("name", UNDEFINED)
def test_mathematics_gives_no_answer(name):
    assert in_both(name, may_be_undecided=name in UNDECIDABLE) == Undefined(UNDEFINED[name])


def test_a_triple_root_is_undefined():
    """H = 2 + (2 sin t - sin 2t) / 4 is 2 + t^3 / 4 + ..."""
    assert isinstance(in_both("07/1", may_be_undecided=True), Undefined)


REFUSED = {
    **{f"33/{i}": f"{name} > 0" for i, name in enumerate("rhwrhw", 1)},
    **{f"37/{i}": "knots[" for i in (1, 2)},
    "21/5": "w > h slope",
    **{f"22/{i}": "w > h slope" for i in (2, 4, 6)},  # spikes far narrower than any grid of samples
    "32/4": "nu <= 1",
    "46/1": "r",
    "46/2": "colour",
    "46/3": "omega",
}
OUTSIDE = {"45/1": "arc", "45/2": "base", "45/3": "left", "45/4": "floor", "45/5": "moves into it"}
OUTSIDE |= {"45/6": "moves into it", "45/7": "", "45/8": "", "45/9": "t_end"}


@pytest.mark.parametrize("name", REFUSED)
def test_a_scene_that_means_nothing_is_refused(name):
    with pytest.raises(InvalidScene, match=re.escape(REFUSED[name])):
        from_data(case(name).scene)


@pytest.mark.parametrize("name", ["22/1", "22/3", "22/5", "32/3"])
def test_a_scene_within_its_bounds_is_not(name):
    assert from_data(case(name).scene)


@pytest.mark.parametrize("name", OUTSIDE)
@pytest.mark.parametrize("stepper", [reference, fast])
def test_a_start_outside_or_approaching_is_rejected(name, stepper):
    outcome = stepper.next_collision(scene_of(name), case(name).state, case(name).t_end)
    assert isinstance(outcome, Rejected)
    assert OUTSIDE[name] in outcome.reason


@pytest.mark.parametrize("name", ["03/1", "03/3"])
def test_a_gallery_with_a_moving_arc(name):
    """The full moving f: a root of r(s)^2 = |q + v s|^2, far from the static chord's."""
    found, s = in_both(name), case(name).state
    assert found.wall == "arc"
    rate = {"03/1": 0.25, "03/3": -0.25}[name]

    def f(time):
        r, q_v = 1 + mpf(rate) * mpmath.sin(time), mpf(s.x) * s.vx + mpf(s.y) * s.vy
        v2 = mpf(s.vx) ** 2 + mpf(s.vy) ** 2
        return r * r - 1 - 2 * q_v * time - v2 * time * time

    assert f(found.dt.lo) > 0 > f(found.dt.hi)
    assert all(f(found.dt.lo * i / 200) > 0 for i in range(1, 200))
    assert abs(float(found.dt) - 2 * (2.0**-6 - rate)) > 1e-3


def test_a_touch_in_flight_is_no_event_or_undecided():
    lift, s = scene_of("05/1"), State(0.0, 0.0, -1.0, 0.0, 0.0)
    for stepper in (reference, fast):
        outcome = stepper.next_collision(lift, s, 0.75)
        assert isinstance(outcome, Undecided) or type(outcome).__name__ == "Horizon"


def test_the_step_after_a_narrow_mouth():
    scene = scene_of("31/3")
    after = in_both("31/3").rounded().state()
    truth = proved_step(scene, after, 9.0)
    assert compare(fast.next_collision(scene, after, 9.0), truth, after, MAX_ULPS).kind == "agrees"


def test_a_late_start_keeps_full_precision_in_dt():
    """At t = 2 pi 30 the flight time is as sharp as if time began there."""
    asked, found = case("38/1"), in_both("38/1")
    answer = fast.next_collision(scene_of("38/1"), asked.state, asked.t_end)
    assert isinstance(answer, Collision)
    assert answer.dt == pytest.approx(float(found.dt), rel=8 * 2.0**-53)


@pytest.mark.parametrize("name", ["39/2", "39/3", "39/4"])
def test_astronomical_times_are_proved_and_declined_in_binary64(name):
    asked, scene = case(name), scene_of(name)
    proved = reference.next_collision(scene, asked.state, asked.t_end)
    assert isinstance(proved, reference.Collision)
    if name != "39/4":
        assert is_enclosed(mpmath.sqrt(mpf(1) / 32), proved.dt)
    answer = fast.next_collision(scene, asked.state, asked.t_end)
    assert isinstance(answer, Undecided)
    assert "state.t = 1" in answer.reason


@pytest.mark.parametrize("name", ["42/1", "42/2", "42/3"])
def test_subnormal_numbers_are_exact(name):
    asked = case(name)
    answer = fast.next_collision(scene_of(name), asked.state, asked.t_end)
    assert isinstance(answer, Collision)
    assert answer.dt == abs(asked.state.y)


def test_no_case_of_the_corpus_is_forgotten():
    """Every hard case of one step has its answer by hand here, but for mirror images and broken scenes."""
    here = {*HITS, *HORIZONS, *UNDEFINED, *REFUSED, *OUTSIDE, "03/1", "03/3", "07/1", "38/1"}
    here |= {"39/2", "39/3", "39/4", "22/1", "22/3", "22/5", "32/3"}
    steps = {name.removeprefix("hard-case-") for name, vector in CASES.items() if vector.kind == "step"}
    assert {name for name in steps - here if name[:2] not in ("43", "46")} == set()


def proved_path(name, n):
    return reference.trajectory(scene_of(name), case(name).state, n)


def fast_path(name, n, **options):
    return fast.trajectory(scene_of(name), case(name).state, n, **options)


def walls_of(path):
    return path.walls if hasattr(path, "walls") else [step.wall for step in path.steps]


def test_02_whispering_gallery():
    """All chords are alike: no ghost hit at s = 0 in 10^4 bounces, nor in 100 proved ones."""
    s = case("02/2").state
    x, y, vx, vy = (Fraction(n) for n in (s.x, s.y, s.vx, s.vy))
    chord = -2 * (x * vx + y * vy) / (vx * vx + vy * vy)
    proved = proved_path("02/2", 100)
    assert walls_of(proved) == ["arc"] * 100
    assert all(step.dt.contains(chord) for step in proved.steps)
    path = fast_path("02/2", 10_000)
    assert path.outcome is None
    chords, passages, taken = 0, 0, 0.0
    for wall, dt in zip(path.walls, path.steps[:, 0], strict=True):
        taken += dt  # the base, in the unfolded disk, cuts a chord in two
        if wall == "base":
            passages += 1
            continue
        # A few roundings of v at each bounce turn it by 2^-53 beside its angle 1e-3. The place is
        # rounded there, too: by up to 1.5 x 2^-53 in f, which the next chord keeps, for the root at 0
        # is divided out. After the base nothing is, and what has gathered moves the root, by
        # f / 2e-3 beside a chord of 2e-3.
        bound = 2.0**-53 * (4e3 * (chords + 1) + (8e6 + 4e5 * chords) * passages)
        assert taken == pytest.approx(float(chord), rel=bound)
        chords, taken = chords + 1, 0.0
    assert 10_000 - chords == pytest.approx(10_000 * 2e-3 / mpmath.pi, abs=1)


def test_10_train_of_bounces():
    """In the floor's frame a particle under constant gravity: all flights last rise / 8."""
    proved, path = proved_path("10/2", 100), fast_path("10/2", 200)
    assert walls_of(proved) == ["floor"] * 100
    assert all(step.dt.contains(Fraction(1, 1024)) for step in proved.steps)
    assert path.walls == ["floor"] * 200
    assert path.steps[:, 0] == pytest.approx(2.0**-10, rel=1e-10)


def test_10_a_limit_on_collisions_ends_in_a_clear_error():
    path = fast.trajectory(scene_of("10/2"), State(0.0, 0.0, -2.0, 0.0, 2.0**-20, "floor"), 1000, t_end=0.2)
    assert len(path.walls) == 1000
    assert path.outcome is None  # as many as asked for, the horizon not reached
    state = {"t": 0.0, "x": 0.0, "y": -0.5, "vx": 1.0, "vy": 0.0}
    request = {"cmd": "trajectory", "seq": 1, "scene": {"table": "stem", "w": 1.0, "h": 1.0}, "state": state}
    line, out = json.dumps({**request, "collisions": MAX_COLLISIONS + 1, "t_end": 1.0}), io.BytesIO()
    serve("s", pytest.fail, pytest.fail, io.BytesIO(line.encode()), out)
    answer = json.loads(out.getvalue())
    assert answer["outcome"] == "rejected"
    assert "collisions = 1000001" in answer["reason"]


def test_17_level_flight_bounces_for_ever():
    walls = ["right", "left"] * 500
    path, proved = fast_path("17/1", 1000), proved_path("17/1", 50)
    assert path.walls == walls
    assert np.array_equal(path.steps[:, 0], [0.75] + [2.0] * 999)
    assert set(path.steps[:, 3]) == {-0.5}
    assert walls_of(proved) == walls[:50]
    assert all(step.dt.contains(2.0) and step.after.y.contains(-0.5) for step in proved.steps[1:])


def test_17_until_the_moving_floor_ends_it():
    """Sides at 1/64 + k/32; the floor at sqrt(1/32) = 0.1767...: after six of them."""
    proved = proved_path("17/2", 7)
    assert walls_of(proved) == fast_path("17/2", 7).walls == ["right", "left"] * 3 + ["floor"]
    with mpmath.workdps(300):
        assert is_enclosed(mpmath.sqrt(mpmath.mpf(1) / 32), proved.steps[-1].after.t)


def test_19_nearly_level_flight_keeps_its_vertical_velocity():
    path = fast_path("19/1", 1_000_001)
    assert len(path.walls) == 1_000_001
    assert set(path.walls) == {"left", "right"}
    assert np.all(path.steps[:, 5] == 2.0**-22)
    after = [step.after for step in proved_path("19/1", 60).steps]
    assert all(a.vy.contains(2.0**-22) and a.vy.width() == 0 for a in after)


@pytest.mark.parametrize("name", ["30/4", "30/6", "30/8"])
def test_30_two_hits_beside_a_corner(name):
    """Right first, then the floor 2 gap later; the fast stepper may be undecided at 2^-50."""
    gap = case(name).state.x - 0.5
    proved, path = proved_path(name, 2), fast_path(name, 2)
    assert walls_of(proved) == ["right", "floor"]
    assert proved.steps[1].dt.contains(2 * gap)
    if gap < 2.0**-48 and isinstance(path.outcome, Undecided):
        return
    assert path.walls == ["right", "floor"]
    assert path.steps[1, 0] == pytest.approx(2 * gap, abs=4 * 2.0**-53)


def bits(answer):
    numbers = answer.dt, answer.t, answer.x, answer.y, answer.vx, answer.vy
    return [(n + 0.0).hex() for n in numbers]  # + 0.0: no sign of zero


@pytest.mark.parametrize("state", [State(0.0, 0.0, 0.5, 0.0, -1.0), State(0.0, 0.0, 0.0, 0.0, 1.0)])
def test_43_signs_of_zero_do_not_matter(state):
    scene, outcomes = scene_of("43/19"), set()
    for x in (0.0, -0.0):
        for vx in (0.0, -0.0):
            for t in (0.0, -0.0):
                start = State(t, x, state.y, vx, state.vy)
                answer = fast.next_collision(scene, start, 9.0)
                assert isinstance(answer, Collision)
                for found in (answer, reference.next_collision(scene, start, 9.0).rounded()):
                    outcomes.add((found.wall, *bits(found)))
    assert len(outcomes) == 1


@pytest.mark.parametrize("index", [1, 3, 5])
def test_44_laws_that_move_by_nothing_stand_still(index):
    names = f"44/{index}", f"44/{index + 1}"
    one, two = (fast_path(name, 300) for name in names)
    assert one.walls == two.walls
    assert one.steps.tobytes() == two.steps.tobytes()
    first, second = (proved_path(name, 1).steps[0].rounded() for name in names)
    assert first == second


def test_44_speed_in_a_static_box():
    path = fast_path("44/1", 10_000)
    assert set(np.abs(path.steps[:, 4])) == {0.7}
    assert set(np.abs(path.steps[:, 5])) == {0.3}


def test_44_speed_in_a_static_circle():
    """(vx, vy) are rounded at each bounce off the arc, so v is kept within rounding there."""
    path = fast_path("44/3", 10_000)
    v2 = path.steps[:, 4] ** 2 + path.steps[:, 5] ** 2
    drift = np.abs(v2 / (0.7**2 + 0.3**2) - 1.0)
    assert np.all(drift <= 8 * 2.0**-53 * np.arange(2, 10_002))


@pytest.mark.parametrize(("forwards", "backwards"), [("47/1", "47/2"), ("47/3", "47/4")])
@pytest.mark.parametrize("stepper", [reference, fast])
def test_47_reversed_film(stepper, forwards, backwards):
    """Velocity and laws reversed, the path is retraced; a hundredfold per bounce is its sensitivity."""
    scene, film, start = scene_of(forwards), scene_of(backwards), case(forwards).state
    t_end = case(forwards).t_end
    there = stepper.trajectory(scene, start, 99, t_end)
    end = there.outcome if stepper is fast else there.outcome.rounded()
    assert isinstance(end, Horizon)
    back = stepper.trajectory(film, State(-t_end, end.x, end.y, -end.vx, -end.vy), 99, -start.t)
    home = back.outcome if stepper is fast else back.outcome.rounded()
    assert isinstance(home, Horizon)
    assert len(walls_of(there)) >= 3
    assert walls_of(there) == walls_of(back)[::-1]
    got = (home.x, home.y, -home.vx, -home.vy)
    assert got == pytest.approx((start.x, start.y, start.vx, start.vy), rel=1e-10, abs=1e-10)
