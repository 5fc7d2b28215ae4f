"""A step does not depend on how far it may look; where rounding of a time decides, it is right or undecided.

In each of the questions drawn at the end the wall moves much, or f changes much, within rounding of the time
at which it is asked for: a crossing, a horizon, the order of two hits. Numbers are drawn such that the answer
is open at that size; the reference, for which times are exact, has it.
"""

from fractions import Fraction

import numpy as np
import pytest
from mpmath import MPContext

import fast
import reference
from fast import __main__ as served
from scene import (
    BangBang,
    Cap,
    Collision,
    Fourier,
    GivenLaw,
    Horizon,
    Mushroom,
    Scene,
    State,
    Stem,
    Undecided,
)  # fmt: skip
from scene.laws import law_of

# Sides that lean, now more and now less. What bounds them for all time bounds them above the floor alone.
WAVING = Mushroom(r=1.0, h=1.0, nu=Fourier(0.6, 1.0, (-0.3,)), slope=Fourier(0.1, 1.0, (0.05,)))
TILTING = Mushroom(
    r=1.0,
    h=BangBang(knots=((0.0, 1.0), (3.0, 1.5), (6.0, 1.0))),
    w=BangBang(knots=((0.0, 0.7), (2.0, 0.4), (6.0, 0.7))),
    slope=BangBang(knots=((0.0, 0.0), (2.0, 0.2), (4.0, -0.2), (6.0, 0.0))),
)
# A slow flight to the floor. Below it, had there been none, it would have met the left side later.
MISSED = State(
    19.567471529586616,
    0.3255672736818292,
    -0.35216875914665585,
    -0.08157687079110951,
    -0.15007099796621198,
    "right",
)


def slow_starts(random, n):
    """Draw states in the stem, slow beside the walls, most on their way down."""
    for _ in range(n):
        t, x, y, vx, vy = random.uniform((0.0, -0.15, -0.9, -0.3, -0.3), (60.0, 0.15, -0.1, 0.3, 0.1))
        yield State(float(t), float(x), float(y), float(vx), float(vy))


@pytest.mark.parametrize("scene", [WAVING, TILTING])
def test_a_step_does_not_depend_on_how_far_it_may_look(scene):
    n_met = 0
    for state in slow_starts(np.random.default_rng(7), 400):
        far = fast.next_collision(scene, state, state.t + 300.0)
        if isinstance(far, Collision):
            n_met += 1
            for factor in (1.0 + 2.0**-20, 1.3, 4.0):
                assert fast.next_collision(scene, state, state.t + factor * far.dt) == far
            assert far.y >= -1.5 * (1.0 + 2.0**-50)
    assert n_met > 300


def test_the_floor_is_not_missed():
    assert fast.next_collision(WAVING, MISSED, 50.0) == fast.next_collision(WAVING, MISSED, 25.0)


SWEPT = Stem(w=0.5, h=Fourier(1.0, 1.0, (0.2,)))
RIPPLED = Mushroom(r=1.0, h=1.0, w=Fourier(0.5, 1.0, (0.0,) * 15 + (0.05,)))
# 2^27 quarter turns of the highest harmonic end at t = 2.1e8 and 1.3e7.
LATE = [
    (SWEPT, 1e12),
    (SWEPT, -1e12),
    (SWEPT, 2.2e8),
    (RIPPLED, 1.4e7),
    (Cap(r=Fourier(1.0, 1.0, (0.1,))), 1e300),
]


@pytest.mark.parametrize(("scene", "t"), LATE)
def test_a_late_time_is_undecided_in_every_profile(scene, t):
    start = State(t, 0.0, 0.5 if isinstance(scene, Cap) else -0.5, 0.1, 1.0)
    step = fast.next_collision(scene, start, t + abs(t))
    fine = fast.fine_trajectory(scene, start, 9).outcome
    [(flow, stay)] = served.carry(scene, [start], t + abs(t))
    [path] = served.follow(scene, start, 9)
    for found in (step, fine, flow, path):
        assert isinstance(found, Undecided)
    assert f"state.t = {t!r}" in step.reason
    assert stay is None


def test_a_path_that_grows_late_ends_undecided():
    """It began in time, so that it is no bad input."""
    start = State(2.1e8, 0.0, -0.5, 0.1, 0.5)
    path = fast.trajectory(SWEPT, start, 10**7)
    assert 1e5 < len(path.walls) < 10**7
    assert isinstance(path.outcome, Undecided)
    assert f"{len(path.walls)} collisions after state.t" in path.outcome.reason


def test_a_horizon_beyond_all_patience_is_undecided():
    """A good start beside it is carried all the same."""
    start, slow = State(0.0, 0.0, -0.5, 0.1, 1.0), State(0.0, 0.0, -0.5, 1e-9, 1e-9)
    box = Stem(w=0.5, h=1.0)
    run = fast.flow(box, [slow, start], 1e8)
    assert [type(outcome).__name__ for outcome in run.outcomes] == ["Horizon", "Undecided"]
    assert run.wall_counts.sum(axis=1).tolist() == [0, 0]


Question = tuple[Scene, State, float]
CTX = MPContext()
CTX.dps = 60


def after_a_spike(random: np.random.Generator) -> Question:
    """Ask for a horizon just after a wall has come and gone, in a billionth of the time or less."""
    width = 2.0 ** -float(random.integers(30, 45))
    law = BangBang(((0.0, 1.0), (width, 0.5), (2.0 * width, 1.0), (1.0, 1.0)))
    t_end = 2.0 * width * (1.0 + 2.0 ** random.uniform(-10, 4))
    t, y = -float(random.uniform(0.05, 0.9)), float(random.uniform(0.52, 0.98))
    return Cap(r=law), State(t, 0.0, y, 0.0, 0.0), float(t_end)


def beside_a_moving_mouth(random: np.random.Generator) -> Question:
    """Cross y = 0 within 2^-40 of the edge of a mouth that moves, after one to thirty thousand periods."""
    period = float(random.choice([1.0, 0.3, 2.0**-6]))
    if random.random() < 0.5:
        turns = int(random.integers(0, 6))
        w: GivenLaw = Fourier(
            0.5, period=period, cos=(0.0,) * turns + (0.1,), sin=(float(random.uniform(-0.2, 0.2)),)
        )
    else:
        w = BangBang(((0.0, 0.7), (float(period * random.uniform(0.2, 0.8)), 0.3), (period, 0.7)))
    s = period * 10.0 ** random.uniform(0, 4.5)
    t, y, along = (
        float(random.uniform(-1, 5)),
        float(random.uniform(0.01, 0.6)),
        float(random.uniform(-0.2, 0.2)),
    )
    vx, vy = along / s, -y / s
    crossing = CTX.mpf(y) / CTX.mpf(-vy)
    edge = law_of(w).value(CTX, t + crossing) * (
        1 + random.choice([-1, 1]) * CTX.mpf(2) ** random.uniform(-56, -40)
    )
    x = float(random.choice([-1, 1]) * edge - CTX.mpf(vx) * crossing)
    return Mushroom(r=1.5, h=1.0, w=w), State(t, x, y, vx, vy), t + 1.01 * s


def along_a_leaning_side(random: np.random.Generator) -> Question:
    """Fly beside a side at rest, nearly along it, to its end: a corner or the mouth's edge."""
    lean, w, is_up = float(random.uniform(-0.4, 0.4)), 0.7, random.random() < 0.5
    y, vy = -float(random.uniform(0.2, 0.8)), float(random.uniform(0.3, 1.0)) * (1 if is_up else -1)
    x = float(Fraction(w) + Fraction(lean) * Fraction(y) - Fraction(2.0 ** random.uniform(-30, -3)))
    end = Fraction(0 if is_up else -1)
    vx = (Fraction(w) + Fraction(lean) * end - Fraction(x)) * Fraction(vy) / (end - Fraction(y))
    nearby = float(vx * (1 + Fraction(float(random.choice([-1.0, 1.0]) * 2.0 ** random.uniform(-54, -42)))))
    scene: Scene = Mushroom(r=1.0, w=w, h=1.0, slope=lean)
    if not is_up or random.random() < 0.5:
        scene = Stem(w=w, h=1.0, slope=lean)
    return scene, State(0.0, x, y, nearby, vy), 100.0


# How to draw a question, and how many: the reference takes long for some.
FAMILIES = {
    "after a spike": (after_a_spike, 12),
    "beside a moving mouth": (beside_a_moving_mouth, 40),
    "along a leaning side": (along_a_leaning_side, 300),
}


def told(outcome):
    """Return the wall of a collision, "horizon", else None: undecided, or refused for its phases."""
    if isinstance(outcome, Collision | reference.Collision):
        return outcome.wall
    return "horizon" if isinstance(outcome, Horizon | reference.Horizon) else None


def judge(family):
    """Return how many answers of the careful step are decided, and how many of those are wrong."""
    draw, n = FAMILIES[family]
    random, n_decided, n_wrong = np.random.default_rng(1), 0, 0
    for _ in range(n):
        question = draw(random)
        answer = told(fast.next_collision(*question))
        if answer is not None:
            n_decided += 1
            n_wrong += told(reference.next_collision(*question, digits=20)) not in (None, answer)
    return n_decided, n_wrong


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_decided_is_right(family, tally):
    tally["decided"], tally["wrong"] = judge(family)
    assert tally["decided"] > 0
    assert tally["wrong"] == 0
