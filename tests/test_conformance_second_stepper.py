"""The second stepper against closed forms, symmetries and the plain stepper; faults in it do not pass."""

from __future__ import annotations

from math import inf, pi

import pytest
from flint import arb, fmpq
from support import faulty_provers as faults
from support.answers_by_hand import ANSWERS
from support.tables import BREATHING, LEAP, STATIC

from conformance import plain
from conformance.attacks.search import as_certified
from conformance.generator.draws import Draw, clock, scene, state
from conformance.grading.agreement import compare
from conformance.second_stepper import next_collision, trajectory
from conformance.second_stepper.step import simplest
from conformance.vectors import NUMBERS
from scene import Collision, State, Undecided
from scene.transforms import mirrored, mirrored_wall

N_DRAWS = 150


def holds(ball, number):
    return ball.overlaps(arb(number)) and ball.rad() < 1e-20


def answers_by_hand():
    for name, (table, start, t_end, expected, numbers) in ANSWERS.items():
        answer = next_collision(table, start, t_end)
        assert expected in (answer.wall, answer.kind, answer.reason), name
        balls = dict(zip(NUMBERS, answer.numbers, strict=False))
        for field, number in numbers.items():
            assert holds(balls[field], fmpq(number.numerator, number.denominator)), name


def rest_in_a_breathing_circle():
    # Swept at r = 7/8 on the way in: sin t = -1/2.
    hit = next_collision(BREATHING, State(0.0, 0.0, 0.875, 0.0, 0.0), 9.0)
    assert hit.wall == "arc"
    assert holds(hit.numbers[0], arb.pi() * 7 / 6)
    assert holds(hit.numbers[4], -arb(3).sqrt() / 4)


def knot_within_the_time():
    path = trajectory(LEAP, State(2.0**110, 0.3, 0.5, 0.02, 1.0), 2)
    assert [step.wall for step in path] == ["arc", "left"]


def mirror_images():
    draw = Draw("mirror")
    for _ in range(20):
        table = scene(draw, "mushroom", clock(draw))
        start, t_end = state(draw, table, {})
        one, other = next_collision(table, start, t_end), next_collision(table, mirrored(start), t_end)
        assert mirrored_wall(one.wall) == other.wall
        assert all(a.overlaps(b) for a, b in zip(one.numbers[2::2], other.numbers[2::2], strict=True))
        assert all(a.overlaps(-b) for a, b in zip(one.numbers[1::2], other.numbers[1::2], strict=True))


def agreement_with_plain():
    n_collisions = 0
    for index in range(N_DRAWS):
        draw = Draw(f"plain/{index}")
        table = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw))
        start, t_end = state(draw, table, {})
        answer, rival = next_collision(table, start, t_end), plain.next_collision(table, start, t_end)
        if isinstance(rival, Undecided) or answer.kind == "undecided":
            continue
        found = compare(rival, as_certified([answer], start), start, 1e6)
        assert found.kind == "agrees", (index, found)
        n_collisions += isinstance(rival, Collision)
    assert n_collisions > N_DRAWS // 2


BATTERY = [
    answers_by_hand,
    rest_in_a_breathing_circle,
    knot_within_the_time,
    mirror_images,
    agreement_with_plain,
]


@pytest.mark.parametrize("check", BATTERY)
def test_battery(check):
    check()


FAULTS = [
    faults.residual_forgotten,
    faults.corner_unseen,
    faults.tie_guessed,
    faults.hit_at_end_counts,
    faults.ends_alone,
    faults.still_wall,
    faults.last_wall,
    faults.lazy_taylor,
]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_does_not_pass(fault):
    with faults.patched(fault):
        assert any(fails(check) for check in BATTERY)


def fails(check):
    try:
        check()
    except Exception:  # a fault may show itself in any way
        return True
    return False


@pytest.mark.parametrize(
    ("low", "high", "best"),
    [
        (fmpq(1, 3), fmpq(1, 2), fmpq(1, 2)),
        (fmpq(-7, 5), fmpq(-6, 5), fmpq(-4, 3)),
        (fmpq(2), fmpq(9), fmpq(2)),
    ],
)
def test_simplest(low, high, best):
    assert simplest(low, high) == best


def test_rejections():
    assert next_collision(STATIC, State(0.0, 2.0, 0.5, 1.0, 0.0), 9.0).kind == "rejected"
    assert next_collision(STATIC, State(0.0, 0.0, 0.5, inf, 0.0), 9.0).kind == "rejected"
    assert next_collision(STATIC, State(0.0, 0.0, 0.5, 1.0, 0.0, "floor"), 9.0).kind == "rejected"
    assert next_collision(STATIC, State(0.0, -0.5, -0.5, -1.0, 0.0, "left"), 9.0).kind == "rejected"
    assert next_collision(BREATHING, State(3 * pi / 2, 0.0, 1e-4, 0.0, -1.0, "arc"), 9.0).kind == "rejected"


def test_a_path_ends_where_it_must():
    assert [step.kind for step in trajectory(STATIC, State(0.0, 0.0, 0.5, 0.0, -1.0), 9, 1.0)] == ["horizon"]
    assert trajectory(STATIC, State(0.0, 0.75, 0.5, 0.0, 0.0), 3)[0].kind == "undecided"
    path = trajectory(STATIC, State(0.0, 0.75, 0.5, 0.0, -0.5), 2)
    assert [step.wall for step in path] == ["base", "arc"]
    assert trajectory(STATIC, State(0.0, 0.0, 0.5, inf, 0.0), 2)[0].kind == "rejected"
