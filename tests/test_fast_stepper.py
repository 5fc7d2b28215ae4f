"""The fast step: what it does not guess or got wrong once, that it answers as a path does; sizes near 0.

Waves may cancel to a part of 1e-4 to 1e-13, and terms known to 2^-62 of themselves would not do. Waves that
add up to more than their mean may leave a size that is positive all the same; `Law.bounds` says of it
that it may be negative. A bound below 0 must not be squared, divided by or multiplied by another.
"""

import math
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import msgspec
import numpy as np
import pytest
from support.depth import deep_but
from support.from_python import from_python
from support.tables import CIRCLE, STATIC
from support.truth import proved_step

import fast
import reference
from conformance.cases.attacks import UnderAttack, run, stepped
from conformance.cases.delicate_families import sunk
from conformance.cases.draw import Draw
from conformance.cases.scenes import deep_wave
from conformance.cases.table import FAMILIES
from conformance.grading.agreement import compare
from fast import pieces, step as stepper
from fast.batch import lane_steps
from fast.kernel import arithmetic, records
from fast.kernel.records import BAD_QUESTION
from fast.prepared import prepare
from fast.units import compile_scene
from scene import (
    BadInput,
    BangBang,
    Cap,
    Collision,
    Fourier,
    Horizon,
    Mushroom,
    Outcome,
    Rejected,
    Scene,
    State,
    Stem,
    Undecided,
    Undefined,
    load,
)
from scene.states import check_numbers


@pytest.mark.parametrize(
    ("scene", "state", "expected"),
    [
        (STATIC, State(0, 0.75, 0.0, 1.0, 0.0, "base"), Undefined("sliding")),
        (STATIC, State(0, 0.0, 0.0, 1.0, 0.0), Undefined("mouth-edge")),
        (STATIC, State(0, 0.25, 0.25, 1.0, -1.0), Undecided("the mouth's edge is hit within rounding")),
        (CIRCLE, State(0, 0.5, 0.5, 0.5, -0.5), Undecided("two walls are hit together within rounding")),
    ],
)
def test_what_it_does_not_guess(scene, state, expected):
    assert fast.next_collision(scene, state, 100.0) == expected


def test_rising_from_beside_the_mouths_edge_needs_no_decision():
    """On y = 0 with vy > 0 the flight is in the cap, whether it begins in the mouth or on the base.

    At the edge itself, exactly, it is undefined; binary64 leaves it undecided.
    """
    scene = Mushroom(r=1.4270501136779785, h=0.25, w=0.9501003301060614)
    edge = fast.next_collision(scene, State(0.0, 0.9501003301060614, 0.0, -0.005, 6e-19), 125.0)
    assert isinstance(edge, Undecided)
    for x in (0.9501003301060598, 0.9501003301060613, 0.9501003301060615, 0.9501003301060630):
        outcome = fast.next_collision(scene, State(0.0, x, 0.0, -0.005, 6e-19), 125.0)
        assert isinstance(outcome, Horizon)
        assert fast.next_collision(scene, State(0.0, x, 0.0, -0.005, 6e-19), 999.0).wall == "arc"


def wave(mean, *sin):
    return Fourier(mean=mean, omega=4.65574312210083, sin=sin)


SLIT = Mushroom(
    r=wave(0.875, 0.11862087249745074), h=wave(2.098803758621216, 1.8488037586195343),
    w=wave(0.2600053250788279, 0.052338038691819494),
)  # fmt: skip
GRAZING = State(1.3409481355317923, 0.0, 0.0, -2.1066059217309278e-16, -1.1467828510215512)
REST = 1.1677015281036474
RESTING = BangBang(
    (
        (0.0, 2.1896091243577565), (0.18958107597645885, REST), (0.261809659609697, REST),
        (0.2870035976351556, 0.3360244714926794), (0.5, 2.1896091243577565),
    )
)  # fmt: skip
HARDLY = BangBang(
    ((0.0, 1.0), (1.0, 1.0 + 2.0**-30), (2.0, 1.0), (2.0 + 2.0**-8, 1.0 + 2.0**-30), (4.0, 1.0))
)
LEAPING = (
    (-0.7119462478359613, 0.49512399995280476), (-0.5866977437708769, 0.43470125731491827),
    (-0.21194624783596128, 0.43722517904960634), (1.2880537521640387, 0.49512399995280476),
)  # fmt: skip
# Steps that were wrong once: scene, state, horizon.
FOUND = {
    # Nearly level with a side that comes close much later; the floor is met first, whatever the horizon.
    "the floor before a graze of a side": (SLIT, GRAZING, 5.0),
    "the same with a late horizon": (SLIT, GRAZING, 1e6),
    # 2 x / v, up to the wall's own bend: 10^-21 of a unit of time.
    "the shortest hop along an arc of legs": (
        Cap(r=BangBang(((1.875, 2.0), (2.011962890625, 0.25), (5.0562744140625, 0.25), (5.0625, 2.0)))),
        State(9.562506079673767, 1.5308084989341915e-17, 0.25, -19218.24325704075, 0.0, "arc"),
        10.5,
    ),
    "the shortest hop along an arc of waves": (
        Cap(r=Fourier(0.7535362243652344, 2.4063210487365723, (-0.2517681121823882, 0.05943409717650916))),
        State(0.0, 3.436372446831787e-17, 0.5612022093593554, -325.5383901035782, 0.0, "arc"),
        1.0,
    ),
    # Off the arc by 2^-29 of its radius: what is left of that there is rounded, and more than the hop.
    "the shortest hop from off the arc": (
        Cap(r=0.25),
        State(0.0, 0.0, 0.2499999995343387, 0.45, -1.788139347702611e-08, "arc"),
        1.0,
    ),
    "a floor met again across a knot keeps its speed": (
        Mushroom(r=1.9226618138907277, h=RESTING, nu=0.3133864674412362),
        State(
            59.7010171193737, 0.008512276997033654, -REST,
            -0.0874566283705382, 5.536225002296594e-15, "floor",
        ),
        100.0,
    ),
    # f(0) is taken out of f, so the wall that is left is met where the place says that it never comes.
    "off the floor by more than it moves": (
        Stem(w=1.0, h=HARDLY),
        State(1.0, 0.0, -1.0 + 2.0**-22, 0.0, 2.0**-34, "floor"),
        100.0,
    ),
    "off a side by more than it moves": (
        Stem(w=HARDLY, h=1.0),
        State(1.0, 1.0 - 2.0**-22, -0.5, -(2.0**-34), 0.0, "right"),
        100.0,
    ),
    "off the arc by more than it moves": (
        Cap(r=HARDLY),
        State(1.0, 0.0, 1.0 - 2.0**-22, 0.0, -(2.0**-34), "arc"),
        100.0,
    ),
    # 4.2 to 8.8 backward ulps when x vx + y vy was taken to be as wrong as its terms.
    "off an arc at rest, in a mushroom": (
        Mushroom(r=0.75, h=0.5, w=0.1875),
        State(0.0, -0.328266938939661, 0.6743447065645082, -0.7329946145091972, -0.35681736360616867, "arc"),
        5.0,
    ),
    "off an arc at rest": (
        Cap(r=0.75),
        State(
            -1.0728890015279906, -0.5979211190136294, 0.45275783645519563,
            9.219797969326965, 12.175849603416522, "arc",
        ),
        5.0,
    ),
    "off an arc of waves": (
        Cap(r=Fourier(1.0, 1.0, (0.1,))),
        State(0.0, -0.7076949518471228, 0.8421210043688356, 316.2147131789378, 265.7379895907578, "arc"),
        5.0,
    ),
    "off an arc of legs": (
        Cap(r=BangBang(((0.0, 1.0), (1.0, 1.2), (2.0, 1.0)))),
        State(0.0, -0.32022388584106987, 0.9473418892569404, -230.18778701388953, -77.80889726144164, "arc"),
        5.0,
    ),
    # Both factors' bounds are negative, their product is above the mouth's least width.
    "a product of two lower bounds below 0": (
        Mushroom(
            r=Fourier(1.0, cos=(0.9, 0.0, -0.35), period=1.0),
            h=1.0,
            nu=Fourier(0.5, cos=(0.45, 0.0, -0.17), period=1.0),
        ),
        State(0.297, -0.024, -0.56, -0.035, -0.87),
        2.297,
    ),
    "through a mouth of 1e-13, from inside it": (
        Mushroom(
            r=1.5,
            w=Fourier(0.5000000000001, cos=(-0.38242109364224425,), sin=(-0.3221088436188455,), period=1.0),
            h=1.0,
        ),
        State(0.11140847644675131, 1.0265573708885821e-13, 6.975390845030978e-11, 0.0, -1.0),
        0.12140847644675131,
    ),
    # Rounding moves the hit by 6e-17 over a knot beyond which the mouth accelerates 40 times as much.
    "just before a knot": (
        Mushroom(r=1.9961775733737999, h=0.3929973578450618, w=BangBang(LEAPING), slope=0.02106190796508007),
        State(
            -1.007335620199992, -0.23916496289503963, 0.12367447731517013,
            -0.8384924649634439, -1.7491212604217496,
        ),
        10.0,
    ),
    "at rest in the way of an arc": (
        Cap(r=BangBang(((0.0, 1.0), (1.0, 0.5), (2.0, 1.0)))),
        State(0.0, 0.0, 0.75, 0.0, 0.0),
        9.0,
    ),
    "a speed that is the least of all floats": (Cap(r=1.0), State(0.0, 0.0, 0.5, 3.0, 5e-324), 9.0),
}  # fmt: skip


@pytest.mark.parametrize("name", FOUND)
def test_what_was_wrong_once_is_right(name):
    scene, state, t_end = FOUND[name]
    truth = proved_step(scene, state, t_end)
    assert truth.outcome in ("collision", "horizon")
    found = compare(fast.next_collision(scene, state, t_end), truth, state, 4.0)
    assert found.verdict == "pass", found


def test_an_arc_that_dips_below_zero_and_comes_back_on_the_way_to_the_base():
    scene = Mushroom(r=Fourier(1.0, 1.0, (0.9,)), h=1.0, w=0.0005)
    place = 0.09723691417765834, 0.024502880446325
    state = State(3.116786370335045, *place, 0.05208237622567096, -0.29708987593890235)
    t_end = 3.377786370335045
    truth = reference.trajectory(scene, state, 9, t_end)
    walls = [step.wall for step in truth.steps]
    assert walls == fast.trajectory(scene, state, 9, t_end).walls == ["arc", "arc", "base"]
    assert fast.flow(scene, [state], t_end).wall_counts.tolist() == [[2, 1, 0, 0, 0]]


def test_python_may_call_a_kernel():
    """It runs as it is written, before and after compiled callers used it."""
    for _ in range(2):
        assert arithmetic.two_sum(1.0, 2.0**-60) == (1.0, 2.0**-60)
        assert from_python(arithmetic.two_sum)(1.0, 2.0**-60) == (1.0, 2.0**-60)
        compiled = from_python(arithmetic.sine_cosine)(1.0, 0.0, 1.0, 0.5, 0.0)
        assert arithmetic.sine_cosine(1.0, 0.0, 1.0, 0.5, 0.0) == compiled


NAMES = ("moving-cap", "fixed-cap-clockwise", "fermi-ulam", "frozen-mushroom", "ergodic")
SCENES = (
    *map(load, NAMES),
    Cap(r=1.0),
    Cap(r=2.0**-500),
    Cap(r=2.0**1000),
    Cap(r=Fourier(1.0, 2.0**1000, (0.5,))),
    Cap(r=Fourier(2.0**900, 2.0**300, (2.0**898, 2.0**-170))),  # loses bits in any unit
    Mushroom(r=1.0, h=1.0, w=0.5),
)
ODD = (math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e308, 1e-308, 2.0**400, 2.0**-500, 1e15, 1 / 3)
FIELDS = ("t", "x", "y", "vx", "vy")
Question = tuple[Scene, State, float]


def by_a_path(scene: Scene, state: State, t_end: float) -> Outcome | None:
    """Answer as `next_collision`, with checks in Python and the careful step of trajectories."""
    try:
        prepare(scene)
        check_numbers(scene, state, t_end)
        path = fast.trajectory(scene, state, 1, t_end)
    except BadInput as error:
        return Rejected(str(error))
    return Collision(path.walls[0], *path.steps[0].tolist()) if path.walls else path.outcome


def questions(seed: int, n: int) -> Iterator[Question]:
    """Draw states and horizons: steps of a path, off the wall by a little, odd numbers in some fields."""
    random = np.random.default_rng(seed)
    for _ in range(n):
        scene = SCENES[random.integers(len(SCENES))]
        size = scene.r if isinstance(getattr(scene, "r", None), float) else 1.0
        speed = size * 10.0 ** float(random.uniform(-3, 5))
        x, y, vx, vy = (float(v) for v in random.uniform(-1.0, 1.0, 4))
        state = State(float(random.uniform(-9, 9)), 0.3 * x * size, 0.9 * y * size, vx * speed, vy * speed)
        t_end = state.t + float(random.choice([0.0, 1e-3, 1.0, 100.0]))
        found = fast.next_collision(scene, state, t_end)
        if isinstance(found, Collision):
            state = found.state()
            off = 1.0 + float(random.choice([0.0, 1e-7, 1e-5]))
            yield scene, msgspec.structs.replace(state, x=state.x * off, y=state.y * off), t_end
        for _ in range(random.integers(3)):
            field, value = FIELDS[random.integers(5)], float(ODD[random.integers(len(ODD))])
            state = msgspec.structs.replace(state, **{field: value})
        yield scene, state, t_end if random.random() < 0.7 else float(ODD[random.integers(len(ODD))])


def differing(seed: int, n: int) -> list[Question]:
    """Return the questions that are answered otherwise than by a path; nan counts as itself."""
    return [q for q in questions(seed, n) if repr(fast.next_collision(*q)) != repr(by_a_path(*q))]


def test_one_call_answers_as_a_path_does(tally):
    assert differing(1, 1500) == []
    for question in questions(1, 1500):
        tally[type(fast.next_collision(*question)).__name__] += 1
    assert tally["Collision"] > 300
    assert tally["Rejected"] > 500
    assert tally["Horizon"] > 50


@pytest.mark.parametrize("exponent", [-900, -950])
def test_a_path_loses_no_bit_that_one_question_keeps(exponent, tally):
    """Products bring the first table's steps back, and ldexp the second's: their units are beyond 2^-1000."""
    random = np.random.default_rng(4)
    for _ in range(60):
        angle, shrink = float(random.uniform(0.1, 3.0)), int(random.integers(20, 1065 + exponent))
        along, across = np.ldexp([math.cos(angle), math.sin(angle)], [exponent, exponent - shrink])
        state = State(0.0, 0.0, math.ldexp(0.5, exponent - shrink), float(along), float(across))
        question = Cap(r=2.0**exponent), state, 1e300
        alone = fast.next_collision(*question)
        assert by_a_path(*question) == alone
        assert isinstance(alone, Collision) or "beyond binary64" in alone.reason
        tally[type(alone).__name__] += 1
    assert tally["Collision"] > 5
    assert tally["Undecided"] > 5


def test_a_kernel_that_overlooks_the_wall_is_found(monkeypatch):
    """It takes for free what is not on the wall that it names."""
    single, step_at = stepper.single.asking()

    def lenient(*question):
        found = single(*question)
        free = (*question[:-2], int(records.NO_WALL), question[-1])
        return single(*free) if found[0] == BAD_QUESTION else found

    monkeypatch.setattr(stepper.single, "asking", lambda: (lenient, step_at))
    assert differing(1, 300)


def test_a_horizon_of_zero_is_no_late_one(monkeypatch):
    """Where the unit of time is below 2^-1024 no power of two takes 0 anywhere."""
    quick = Cap(r=Fourier(1.0, 2.0**1000, (0.5,))), State(0.0, 0.0, 0.25, 2.0**1000, 0.0)
    small = Cap(r=2.0**-500), State(0.0, 0.0, 2.0**-501, 2.0**520, 0.0)
    for scene, state in (quick, small):
        expected = Horizon(0.0, state.x, state.y, state.vx, state.vy)
        assert fast.next_collision(scene, state, 0.0) == expected
        assert fast.trajectory(scene, state, 1, 0.0).outcome == expected
    latest = np.finfo(np.float64).max
    monkeypatch.setattr(stepper.Units, "horizon", lambda units, t_end: t_end or latest)
    assert by_a_path(*small, 0.0) != fast.next_collision(*small, 0.0)


class Marked(State, frozen=True):
    """A state with a field more."""

    mark: int = 1


AT = {"t": 0.0, "x": 0.25, "y": 0.5, "vx": 1.0, "vy": 0.5}


@pytest.mark.parametrize(
    ("state", "is_taken"),
    [
        (Marked(**AT), True),
        (State(**AT | {"x": np.float64(0.25)}), True),
        (State(**AT | {"vx": 1}), True),
        (State(**AT | {"vx": True}), False),
        (State(**AT | {"vy": "0.5"}), False),
        (State(**AT | {"wall": "floor"}), False),
        (State(**AT | {"wall": ["arc"]}), False),
        (State(**AT | {"wall": np.array(["arc"])}), False),
        (None, False),
    ],
)
def test_states_of_other_types_are_taken_or_refused(state, is_taken):
    scene = Cap(r=load("moving-cap").r)
    found = fast.next_collision(scene, state, 9.0)
    assert found == fast.next_collision(scene, State(**AT), 9.0) if is_taken else isinstance(found, Rejected)


def test_threads_may_ask_side_by_side():
    asked = list(questions(2, 300))
    expected = [repr(fast.next_collision(*question)) for question in asked]
    with ThreadPoolExecutor(4) as threads:
        for found in threads.map(lambda _: [repr(fast.next_collision(*q)) for q in asked], range(8)):
            assert found == expected


N_ATTACKS = int(os.environ.get("MUSHROOMS_ATTACKS", "30"))


def attack(name, n_cases, seed):
    """Ask the fast stepper questions of a family."""
    (found,) = run([FAMILIES[name]], n_cases, seed, UnderAttack(fast.next_collision, is_proved=False))
    return found


@pytest.mark.parametrize(("name", "seed"), [("nearly-shut", 1), ("all-but-gone", 1), ("deep-waves", 2)])
def test_no_answer_is_wrong(name, seed, tally):
    found = attack(name, N_ATTACKS, seed)
    tally.update(found.counts)
    assert found.cases["wrong"] == []
    assert found.counts["agreed"] > N_ATTACKS // 3


@pytest.mark.usefixtures("uncached")
def test_between_deep_waves_some_answers_hang_on_the_bounds(monkeypatch):
    """With the bounds of a law that may be negative they are wrong."""
    monkeypatch.setattr(Fourier, "size_bounds", Fourier.bounds)
    assert attack("deep-waves", N_ATTACKS, 2).cases["wrong"] != []


def test_the_least_of_a_size_is_positive_and_below_all_values():
    times = np.arange(10_000) / 10_000
    for index in range(200):
        draw = Draw(f"deep/{index}")
        high = draw.power(-10, 10)
        law = deep_wave(draw, high * draw.power(-10, -4), high, 2.0 * math.pi)
        assert law.bounds().lowest < 0.0 < law.size_bounds().lowest
        assert law.size_bounds().lowest <= law.values(times).min() * (1.0 + 1e-12)


def test_what_samples_do_not_show_to_be_positive_is_told_to_be_0():
    touching = Fourier(mean=1.0, omega=1.0, cos=(1.0 - 2.0**-53,))
    assert touching.bounds().lowest < touching.size_bounds().lowest == 0.0
    scene = Cap(r=touching)
    assert pieces.pieces_of(scene, compile_scene(scene), pieces.SERIES) is None  # lanes know nothing of it
    start = State(0.0, 0.5, 0.5, 30.0, 40.0)
    path, flow = fast.trajectory(scene, start, 100, 0.5), fast.flow(scene, [start], 0.5)
    end, arrived = path.outcome, flow.outcomes[0]
    assert (arrived.vx, arrived.vy) == pytest.approx((end.vx, end.vy), rel=1e-12)
    assert flow.n_careful.sum() >= flow.wall_counts.sum() > 10


@pytest.mark.parametrize("n", deep_but([1, 2, 4], 4))
@pytest.mark.parametrize("left", deep_but([1e-4, 1e-6, 1e-8], 1e-8))
def test_lanes_meet_what_is_left(n, left, tally):
    """As the careful step does: within the four backward ulps of every answer."""
    random, scene = np.random.default_rng(n), Stem(w=1.0, h=sunk(n, left))
    starts = []
    for _ in range(100):
        t, v = 10.0 ** random.uniform(-6.0, -1.5), 10.0 ** random.uniform(-1.0, 3.0)
        starts.append(State(float(t), 0.1, 0.0, float(0.1 * v * random.normal()), float(-v), "base"))
    for start, answer in zip(starts, lane_steps(scene, starts), strict=True):
        if answer is None:
            continue
        judged = stepped(answer, proved_step(scene, start, start.t + 100.0), start)
        tally[judged.kind] += 1
        assert judged.kind == "agreed", judged
    assert tally["agreed"] > 30
