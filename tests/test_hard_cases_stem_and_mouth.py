"""Hard cases 17 to 33: the stem, its mouth, and corners.

Each test's number is the case's. Ties of two walls are degenerate within rounding: there, and
within a few units in the last place of them, the fast stepper may be undecided.
"""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from support.hard_cases import BOX, CIRCLE, LIFT, STATIC, collision, in_both, is_enclosed
from support.truth import proved_step

import fast
import reference
from conformance.grading.agreement import compare
from scene import (
    BangBang,
    Cap,
    Fourier,
    InvalidScene,
    Mushroom,
    State,
    Stem,
    Undecided,
    Undefined,
)

# The mouth: w = 1/2 - t^2 / 2 until t = 1/2, then 1/4 + (t - 1)^2 / 2 until t = 3/2.
CLOSING = Mushroom(r=1.0, h=1.0, w=BangBang(knots=((0.0, 0.5), (1.0, 0.25), (2.0, 0.5))))


def test_17_level_flight_bounces_for_ever():
    s = State(0.0, 0.25, -0.5, 1.0, 0.0)
    walls = ["right", "left"] * 500
    path = fast.trajectory(BOX, s, 1000)
    assert path.walls == walls
    assert np.array_equal(path.steps[:, 0], [0.75] + [2.0] * 999)
    assert set(path.steps[:, 3]) == {-0.5}
    proved = reference.trajectory(BOX, s, 50)
    assert [step.wall for step in proved.steps] == walls[:50]
    assert all(step.dt.contains(2.0) and step.after.y.contains(-0.5) for step in proved.steps[1:])


def test_17_until_the_moving_floor_ends_it():
    """Sides at 1/64 + k/32; the floor at sqrt(1/32) = 0.1767...: after six of them."""
    s = State(0.0, 0.0, -1.75, 64.0, 0.0)
    walls = ["right", "left", "right", "left", "right", "left", "floor"]
    assert fast.trajectory(LIFT, s, 7).walls == walls
    proved = reference.trajectory(LIFT, s, 7)
    assert [step.wall for step in proved.steps] == walls
    with mpmath.workdps(300):
        assert is_enclosed(mpmath.sqrt(mpmath.mpf(1) / 32), proved.steps[-1].after.t)


def test_18_moving_side_hits_a_vertical_flight():
    scene = Stem(w=BangBang(knots=((0.0, 1.0), (0.5, 0.5), (1.0, 1.0))), h=1.0)
    found = collision(scene, State(0.0, 0.875, -0.5, 0.0, 0.5))
    assert found.wall == "right"
    with mpmath.workdps(300):
        s = mpmath.sqrt(mpmath.mpf(1) / 32)  # 1 - 4 s^2 = 7/8
        assert is_enclosed(s, found.dt)
        assert is_enclosed(-16 * s, found.after.vx)


def test_19_nearly_level_flight_keeps_its_vertical_velocity():
    s = State(0.0, 0.0, -0.9, 1.0, 2.0**-22)
    path = fast.trajectory(BOX, s, 1_000_001)
    assert len(path.walls) == 1_000_001
    assert set(path.walls) == {"left", "right"}
    assert np.all(path.steps[:, 5] == 2.0**-22)
    proved = reference.trajectory(BOX, s, 60)
    assert all(step.after.vy.contains(2.0**-22) and step.after.vy.width() == 0 for step in proved.steps)


WIDENING = Stem(w=0.5, h=1.0, slope=-0.5)


def test_20_floor_wider_than_the_mouth():
    found = collision(WIDENING, State(0.0, 0.25, -0.5, 0.5, -0.5))
    assert found.wall == "floor"  # at x = 3/4, beyond the mouth's 1/2
    assert found.dt.contains(1.0)
    assert found.after.x.contains(0.75)


def test_20_side_of_a_widening_stem():
    """At (3/4, -1/2) the outward normal is (1, 1/2): (1, 0) turns into (-3/5, -4/5)."""
    found = collision(WIDENING, State(0.0, 0.0, -0.5, 1.0, 0.0))
    assert found.wall == "right"
    assert found.dt.contains(0.75)
    assert found.after.vx.contains(Fraction(-3, 5))
    assert found.after.vy.contains(Fraction(-4, 5))


def test_21_nearly_a_triangle():
    """A floor of half-width 2^-40: met in its middle; its ends are corners; the apex itself is refused."""
    scene = Stem(w=0.5, h=1.0, slope=0.5 - 2.0**-40)
    found = collision(scene, State(0.0, 2.0**-42, -0.5, 0.0, -1.0))
    assert found.wall == "floor"
    assert found.dt.contains(0.5)
    corner = in_both(scene, State(0.0, 2.0**-40, -0.5, 0.0, -1.0), may_be_undecided=True)
    assert corner == Undefined("corner")
    with pytest.raises(InvalidScene, match="w > h slope"):
        Stem(w=0.5, h=1.0, slope=0.5)


@pytest.mark.parametrize("slope", [0.25, 0.5 - 2.0**-40])
def test_21_sides_that_would_meet_below_the_floor(slope):
    found = collision(Stem(w=0.5, h=1.0, slope=slope), State(0.0, 0.0, -0.5, 0.0, -1.0))
    assert found.wall == "floor"
    assert found.dt.contains(0.5)


@pytest.mark.parametrize("wide", [1e-3, 1e-9, 1e-15])
def test_22_closed_stem_is_refused_by_proof(wide):
    """A spike of the slope, far narrower than any grid of samples over the period."""

    def spiked(top):
        return BangBang(knots=((0.0, 0.1), (0.3 - wide, 0.1), (0.3, top), (0.3 + wide, 0.1), (1.0, 0.1)))

    assert Stem(w=0.5, h=1.0, slope=spiked(0.4999))
    with pytest.raises(InvalidScene, match="w > h slope"):
        Stem(w=0.5, h=1.0, slope=spiked(0.5001))


@pytest.mark.parametrize(("x", "y", "vy"), [(0.25, 0.25, -1.0), (0.25, -0.25, 1.0)])
def test_23_mouth_edge(x, y, vy):
    found = in_both(STATIC, State(0.0, x, y, 1.0, vy), may_be_undecided=True)
    assert found == Undefined("mouth-edge")


@pytest.mark.parametrize("gap", [2.0**-54, 2.0**-45, 2.0**-30])
@pytest.mark.parametrize(("side", "wall"), [(1, "base"), (-1, "right")])
def test_23_beside_the_mouth_edge(gap, side, wall):
    """One ulp to either side; the fast stepper may be undecided within 2^-48."""
    state = State(0.0, 0.25 + side * gap, 0.25, 1.0, -1.0)
    assert collision(STATIC, state, may_be_undecided=gap < 2.0**-48).wall == wall


@pytest.mark.parametrize(
    ("t", "x", "wall", "vx"),
    [
        (0.0, 0.4375, "base", 0.0),  # open at departure, closed at the crossing
        (0.0, 0.375 + 2.0**-30, "base", 0.0),
        (0.0, 0.375 - 2.0**-30, "right", 0.0),  # through, and swept just below
        (1.0, 0.3125, "floor", 0.0),  # closed at departure, open at the crossing
        (1.0, 0.375 + 2.0**-30, "base", 0.0),
    ],
)
def test_24_width_at_the_crossing_decides(t, x, wall, vx):
    found = collision(CLOSING, State(t, x, 0.5, vx, -1.0))
    assert found.wall == wall
    if wall == "base":
        assert found.dt.contains(0.5)


def test_25_double_root_at_the_crossing():
    """W - x = (t - 1)^2 / 2 at the crossing t = 1: the edge, or undecided, in both steppers."""
    s = State(0.5, 0.25, 0.5, 0.0, -1.0)
    for stepper in (reference, fast):
        outcome = stepper.next_collision(CLOSING, s, 1.5)
        assert outcome == Undefined("mouth-edge") or isinstance(outcome, Undecided)


@pytest.mark.parametrize("depth", [2.0**-20, 2.0**-500])
def test_26_just_below_a_closing_mouth(depth):
    found = collision(CLOSING, State(0.0, 0.40625, -depth, 0.0, 0.0))
    assert found.wall == "right"
    with mpmath.workdps(300):
        assert is_enclosed(mpmath.sqrt(mpmath.mpf(3) / 16), found.dt)


def test_27_along_the_base_and_the_mouth():
    assert in_both(STATIC, State(0.0, 0.75, 0.0, 1.0, 0.0, "base")) == Undefined("sliding")
    along = State(0.0, 0.0, 0.0, 1.0, 0.0)
    assert in_both(STATIC, along) == Undefined("mouth-edge")
    assert isinstance(in_both(STATIC, along, 0.25), reference.Horizon)


def test_28_arc_meets_base():
    found = in_both(CIRCLE, State(0.0, 0.5, 0.5, 0.5, -0.5), may_be_undecided=True)
    assert found == Undefined("corner")


@pytest.mark.parametrize("vx", [0.5, -0.5])
def test_29_floor_meets_side(vx):
    state = State(0.0, vx, -0.5, vx, -0.5)
    assert in_both(BOX, state, may_be_undecided=True) == Undefined("corner")


@pytest.mark.parametrize("gap", [2.0**-30, 2.0**-40, 2.0**-50])
def test_30_two_hits_beside_a_corner(gap):
    """Right first, then the floor 2 gap later; the fast stepper may be undecided at 2^-50."""
    s = State(0.0, 0.5 + gap, -0.5, 0.5, -0.5)
    proved = reference.trajectory(BOX, s, 2)
    assert [step.wall for step in proved.steps] == ["right", "floor"]
    assert proved.steps[1].dt.contains(2 * gap)
    path = fast.trajectory(BOX, s, 2)
    if gap < 2.0**-48 and isinstance(path.outcome, Undecided):
        return
    assert path.walls == ["right", "floor"]
    assert path.steps[1, 0] == pytest.approx(2 * gap, abs=4 * 2.0**-53)


def test_31_narrow_mouth():
    scene = Mushroom(r=1.0, h=1.0, w=1e-12)
    assert collision(scene, State(0.0, 0.0, 0.5, 0.0, -1.0)).dt.contains(1.5)
    assert collision(scene, State(0.0, 2e-12, 0.5, 0.0, -1.0)).wall == "base"
    state = State(0.0, 0.0, 0.5, 1.5e-12, -1.0)
    found = collision(scene, state)
    assert found.wall == "right"
    assert found.dt.contains(Fraction(1e-12) / Fraction(1.5e-12))
    after = found.rounded().state()
    following = fast.next_collision(scene, after, 9.0)
    assert compare(following, proved_step(scene, after, 9.0), after, 64).kind == "agrees"


def test_32_base_is_a_sliver():
    found = collision(Mushroom(r=1.0, h=1.0, nu=1 - 2.0**-30), State(0.0, 1 - 2.0**-31, 2.0**-20, 0.0, -1.0))
    assert found.wall == "base"
    assert found.dt.contains(2.0**-20)
    closed = Mushroom(r=1.0, h=1.0, nu=1.0)
    assert collision(closed, State(0.0, 0.5, 0.5, 0.0, -1.0)).wall == "floor"


def test_32_more_than_the_whole_base_is_refused():
    assert Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.75, omega=1.0, cos=(0.25,)))
    with pytest.raises(InvalidScene, match="nu <= 1"):
        Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.75 + 2.0**-53, omega=1.0, cos=(0.25,)))


@pytest.mark.parametrize("least", [0.0, -(2.0**-53)])
@pytest.mark.parametrize("name", ["r", "h", "w"])
def test_33_no_room(name, least):
    law = Fourier(mean=0.25 + least, omega=1.0, sin=(0.25,))
    make = {
        "r": lambda: Cap(r=law),
        "h": lambda: Stem(w=1.0, h=law),
        "w": lambda: Stem(w=law, h=1.0, slope=-0.5),
    }[name]
    with pytest.raises(InvalidScene, match=f"{name} > 0"):
        make()
