"""Answers that attacks once found wrong and that no other test repeats, by name.

Their families are in `conformance.attacks`.
"""

from __future__ import annotations

import math

import pytest
from support.tables import CIRCLE, STATIC

import fast
import reference
from fast.batch import lane_steps
from scene import Cap, Fourier, Mushroom, Rejected, State


@pytest.mark.parametrize("digits", [1, 308, 309, 400, 1000])
def test_digits_are_what_was_asked_for(digits):
    found = reference.next_collision(CIRCLE, State(0.0, 0.1, 0.2, 0.3, 0.4), 9.0, digits=digits)
    assert found.dt.extent() * 10**digits <= abs(found.dt.centre())


def test_a_table_whose_square_overflows():
    state = State(0.0, 0.6e200, 0.8e200, -1.0, -1.0, "arc")
    assert reference.next_collision(Cap(r=1e200), state, 1e300).wall == "base"


def test_on_its_wall_as_the_wall_is_now():
    """At t = pi the radius is 1e-3: 1e-4 from the centre is not on the arc, however large r will be."""
    breathing = Cap(r=Fourier(1.0, 1.0, (0.999,)))
    outcome = reference.next_collision(breathing, State(math.pi, 0.0, 1e-4, 0.0, -1.0, "arc"), 9.0)
    assert isinstance(outcome, Rejected)
    assert "away from that wall" in outcome.reason


def test_an_arc_that_dips_below_zero_and_comes_back_on_the_way_to_the_base():
    scene = Mushroom(r=Fourier(1.0, 1.0, (0.9,)), h=1.0, w=0.0005)
    state = State(
        3.116786370335045,
        0.09723691417765834,
        0.024502880446325,
        0.05208237622567096,
        -0.29708987593890235,
    )
    t_end = 3.377786370335045
    truth = reference.trajectory(scene, state, 9, t_end)
    walls = [step.wall for step in truth.steps]
    assert walls == fast.trajectory(scene, state, 9, t_end).walls == ["arc", "arc", "base"]
    assert fast.flow(scene, [state], t_end).wall_counts.tolist() == [[2, 1, 0, 0, 0]]


@pytest.mark.parametrize("state", [State(0.0, 0.1, -0.3, 1.0, 2.0), State(0.0, 0.1, 0.3, 1.0, -2.0)])
def test_lanes_with_a_start_that_names_no_wall(state):
    (found,) = lane_steps(STATIC, [state])
    truth = fast.next_collision(STATIC, state, 9.0)
    assert found is None or found.wall == truth.wall
