"""Answers that attacks once found wrong, by name; their families are in `conformance.attacks`."""

from __future__ import annotations

import pytest
from support.tables import CIRCLE, STATIC

import fast
import reference
from fast.batch import lane_steps
from scene import Cap, Fourier, Mushroom, State, load


class TestProof:
    """The reference's answers."""

    @pytest.mark.parametrize("digits", [1, 308, 309, 400, 1000])
    def test_digits_are_what_was_asked_for(self, digits):
        found = reference.next_collision(CIRCLE, State(0.0, 0.1, 0.2, 0.3, 0.4), 9.0, digits=digits)
        assert found.dt.extent() * 10**digits <= abs(found.dt.centre())

    def test_the_bound_on_work_leaves_room_for_ten_thousand_digits(self):
        found = reference.next_collision(
            load("moving-cap"), State(0.0, 0.1, 0.2, 0.3, -0.4), 50.0, digits=10_000
        )
        assert isinstance(found, reference.Collision)

    def test_a_table_whose_square_overflows(self):
        state = State(0.0, 0.6e200, 0.8e200, -1.0, -1.0, "arc")
        assert reference.next_collision(Cap(r=1e200), state, 1e300).wall == "base"


class TestFast:
    """The fast stepper's answers."""

    def test_an_arc_that_dips_below_zero_and_comes_back_on_the_way_to_the_base(self):
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
    def test_lanes_with_a_start_that_names_no_wall(self, state):
        (found,) = lane_steps(STATIC, [state])
        truth = fast.next_collision(STATIC, state, 9.0)
        assert found is None or found.wall == truth.wall
