"""Margins: gap to the runner-up, distance to the nearest corner, speed of approach."""

from __future__ import annotations

from fractions import Fraction

import pytest
from support.tables import BOX, CIRCLE, STATIC

import reference
from scene import State, load


def margins(scene, state):
    outcome = reference.next_collision(scene, state, 100.0, digits=30, is_measured=True)
    assert isinstance(outcome, reference.Collision)
    assert outcome.margins is not None
    return outcome.margins


def test_box():
    """From the middle with v = (1, 1/4): right at s = 1, base at s = 2, 1/4 below it."""
    found = margins(BOX, State(0, 0.0, -0.5, 1.0, 0.25))
    assert found.gap is not None
    assert found.corner is not None
    assert found.gap.contains(Fraction(1))
    assert found.corner.contains(Fraction(1, 4))
    assert found.slope.contains(Fraction(1))


def test_alone_in_sight():
    """Along y the sides are never met, and the base lies behind."""
    found = margins(BOX, State(0, 0.25, -0.5, 0.0, -1.0))
    assert found.gap is None
    assert found.corner is not None
    assert found.corner.contains(Fraction(3, 4))


@pytest.mark.parametrize("near", [1e-3, 1e-9])
def test_near_the_corner_of_arc_and_base(near):
    """Falling steeply beside the corner: the base is met, then at once the arc."""
    found = margins(CIRCLE, State(0, 0.5, 0.5, 0.5, -0.5 - near))
    assert float(found.corner) == pytest.approx(near, rel=0.02)
    assert 0 < float(found.gap) < 5 * near


def test_arc_of_the_moving_cap_before_the_base():
    found = margins(load("moving-cap"), State(0.1, 0.9, 0.2, 3.0, -0.5))
    assert found.gap is not None
    assert 0 < float(found.corner) < 0.2


def test_sides_of_a_mushroom_ignore_the_arc():
    found = margins(STATIC, State(0, 0.0, -0.5, 1.0, 0.0))
    assert float(found.corner) == 0.5
