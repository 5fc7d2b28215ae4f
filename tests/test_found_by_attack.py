"""Answers that attacks once found wrong, by name; their families are in `conformance.attacks`."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.truth import proved_step

import fast
import reference
import theory
from conformance.grading.agreement import compare
from fast.batch import lane_steps
from scene import (
    BadInput,
    BangBang,
    Cap,
    Collision,
    Fourier,
    Horizon,
    InvalidScene,
    Mushroom,
    Rejected,
    State,
    Stem,
    Undecided,
    Undefined,
    from_data,
    load,
)

CIRCLE = Cap(r=1.0)
STATIC = Mushroom(r=1.0, h=1.0, w=0.5)


class TestProof:
    """The reference's answers."""

    LEAP = ((0.0, 0.01), (1.6097936544959741, 0.01), (1.6097936544959743, 0.9), (5.609793654495975, 0.9))
    TILTED = Stem(w=BangBang(((0.0, 1.0), (1.0, 2.0), (2.0, 1.0))), h=4.0, slope=-(2.0**-300))
    LEFT = State(0.25, -1.125, -1.5, 0.0, 1.0, "left")

    @pytest.mark.parametrize("working", [None, 6, 10, 15, 30, 60, 200])
    def test_a_knot_within_the_enclosure_of_a_time(self, working):
        scene = Mushroom(r=1.0, h=1.0, w=BangBang((*self.LEAP, (16.0, 0.01))))
        path = reference.trajectory(scene, State(2.0**110, 0.3, 0.5, 0.02, 1.0), 2, working=working)
        walls = [step.wall for step in path.steps]
        assert walls == ["arc", "left"] or (walls == ["arc"] and isinstance(path.outcome, Undecided))
        assert len(walls) == 2 or working in (6, 10, 15)

    @pytest.mark.parametrize("digits", [50, 200])
    def test_a_removed_residual_is_removed_at_a_corner(self, digits):
        found = reference.next_collision(self.TILTED, self.LEFT, 3.0, digits=digits)
        assert found.wall == "left"

    @pytest.mark.parametrize("digits", [50, 200])
    def test_a_removed_residual_is_removed_at_the_horizon(self, digits):
        tilting = BangBang(((-0.25, 0.0), (0.75, -(2.0**-300)), (1.75, 0.0)))
        scene = Stem(w=self.TILTED.w, h=4.0, slope=tilting)
        assert reference.next_collision(scene, self.LEFT, 1.75, digits=digits).wall == "left"

    def test_a_hit_exactly_on_a_knot_before_a_violent_leg(self):
        scene = Cap(r=BangBang(((0.0, 1.0), (1.0, 1.0), (1.0 + 2.0**-20, 0.5), (2.0, 0.5), (4.0, 1.0))))
        found = reference.next_collision(scene, State(0.0, 0.0, 0.5, 0.0, 0.5), 9.0)
        assert found.dt.contains(1)

    @pytest.mark.parametrize("digits", [1, 308, 309, 400, 1000])
    def test_digits_are_what_was_asked_for(self, digits):
        found = reference.next_collision(CIRCLE, State(0.0, 0.1, 0.2, 0.3, 0.4), 9.0, digits=digits)
        assert found.dt.extent() * 10**digits <= abs(found.dt.centre())

    def test_the_bound_on_work_leaves_room_for_ten_thousand_digits(self):
        found = reference.next_collision(
            load("moving-cap"), State(0.0, 0.1, 0.2, 0.3, -0.4), 50.0, digits=10_000
        )
        assert isinstance(found, reference.Collision)

    @pytest.mark.parametrize("digits", [-30, 0, 10**6, 2.5, "50", True, None])
    def test_absurd_digits_are_refused(self, digits):
        with pytest.raises(BadInput, match="digits = "):
            reference.next_collision(CIRCLE, State(0.0, 0.1, 0.2, 0.3, 0.4), 9.0, digits=digits)

    def test_a_negative_count_is_refused(self):
        with pytest.raises(BadInput, match="n_collisions = -3"):
            reference.trajectory(CIRCLE, State(0.0, 0.1, 0.2, 0.3, 0.4), -3)

    def test_a_table_whose_square_overflows(self):
        state = State(0.0, 0.6e200, 0.8e200, -1.0, -1.0, "arc")
        assert reference.next_collision(Cap(r=1e200), state, 1e300).wall == "base"


class TestCornersAndEdges:
    """Places on two walls at once, in the reference: undefined, whichever way the particle moves."""

    @pytest.mark.parametrize(
        ("scene", "state"),
        [
            (STATIC, State(0.0, 1.0, 0.0, -0.1, -1.0, "arc")),
            (STATIC, State(0.0, -0.5, 0.0, 1.0, 0.0, "left")),
            (STATIC, State(0.0, -0.5, 0.0, 1.0, 0.3, "left")),
            (CIRCLE, State(0.0, 1.0, 0.0, -1.0, 0.1, "arc")),
        ],
    )
    def test_a_start_on_two_walls(self, scene, state):
        assert isinstance(reference.next_collision(scene, state, 9.0), Undefined)

    def test_on_its_wall_as_the_wall_is_now(self):
        """At t = pi the radius is 1e-3: 1e-4 from the centre is not on the arc, however large r will be."""
        breathing = Cap(r=Fourier(1.0, 1.0, (0.999,)))
        outcome = reference.next_collision(breathing, State(math.pi, 0.0, 1e-4, 0.0, -1.0, "arc"), 9.0)
        assert isinstance(outcome, Rejected)
        assert "away from that wall" in outcome.reason


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

    @pytest.mark.parametrize("length", [-390, -150, 150, 390])
    @pytest.mark.parametrize("speed", [-380, 0, 380])
    def test_any_scale(self, length, speed):
        size, v = 2.0**length, 2.0**speed
        one = fast.next_collision(CIRCLE, State(0.0, 0.3, 0.2, -0.9, 0.2), 100.0)
        scaled = State(0.0, 0.3 * size, 0.2 * size, -0.9 * v, 0.2 * v)
        try:
            other = fast.next_collision(Cap(r=size), scaled, 100.0 * size / v)
        except BadInput:
            return
        if isinstance(other, Rejected):
            return
        assert isinstance(one, Collision)
        time = size / v
        assert other == Collision(
            one.wall, one.dt * time, one.t * time, one.x * size, one.y * size, one.vx * v, one.vy * v
        )

    @pytest.mark.parametrize("state", [State(0.0, 0.1, -0.3, 1.0, 2.0), State(0.0, 0.1, 0.3, 1.0, -2.0)])
    def test_lanes_with_a_start_that_names_no_wall(self, state):
        (found,) = lane_steps(STATIC, [state])
        truth = fast.next_collision(STATIC, state, 9.0)
        assert found is None or found.wall == truth.wall

    def test_a_resting_particle_without_a_horizon(self):
        path = fast.trajectory(CIRCLE, State(0.0, 0.0, 0.5, 0.0, 0.0), 3)
        assert path.walls == []
        assert path.outcome == Horizon(math.inf, 0.0, 0.5, 0.0, 0.0)

    def test_stays_of_a_mouth_that_narrows_twice_equally(self):
        """Theory's share of the never captured, 0.4744; averaging the two instants of least nu gave 0.976."""
        scene = Mushroom(
            r=Fourier(1.0, 1.0, sin=(0.3,)), nu=Fourier(0.6, 1.0, (0.0, 0.25)), h=1.0, slope=0.05
        )
        truth = float(theory.predict(scene).p_nc)
        run = fast.simulate(scene, n_particles=300, energy=1e4, seed=3)
        share = float(run.p_nc()[0])
        assert run.t_in.shape == (300, 1, 2)
        assert abs(share - truth) < 4 * math.sqrt(truth * (1 - truth) / 300) + 0.02


class TestScenes:
    """Scenes that were wrongly accepted or refused."""

    def test_laws_without_a_shared_period_are_refused(self):
        with pytest.raises(InvalidScene):
            Stem(w=Fourier(1.0, 1.0, (0.1,)), h=Fourier(1.0, math.sqrt(2.0), (0.1,)))

    def test_laws_of_both_kinds_share_a_scene(self):
        scene = Mushroom(
            r=Fourier(1.0, period=2.0, cos=(0.125,)),
            nu=0.5,
            h=BangBang(((0.0, 1.0), (1.0, 1.5), (2.0, 1.0))),
        )
        state = State(0.3, 0.1, 0.2, 3.0, -4.0)
        truth = proved_step(scene, state, 9.0)
        assert compare(fast.next_collision(scene, state, 9.0), truth, state, 4.0).kind == "agrees"
        run = fast.simulate(scene, n_particles=20, energy=100.0, seed=1)
        assert np.all(run.outcome == 0)

    def test_a_schema_is_no_unknown_field(self):
        assert from_data({"$schema": "scene.schema.json", "table": "cap", "r": 1.0}) == CIRCLE
