"""The plain stepper against the reference, and as a process that speaks protocol 1."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from fractions import Fraction
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from support.edges import LATE_EDGES, is_among
from support.tables import BOX, CIRCLE, LIFT, STATIC
from support.truth import proved_step

import reference
from conformance import plain
from conformance.grading.agreement import compare
from conformance.plain.motion import BangBangMotion, FourierMotion
from conformance.strategies import scenes_and_states
from scene import BangBang, Cap, Collision, Fourier, Horizon, Rejected, State, Stem, Undecided, from_data
from scene.states import ON_WALL

N_STEPS = 150  # the corpus asks many more
BOUND = 1024.0  # backward ulps; the worst of 2,500 steps was 218, at a slow particle before a fast wall
UNDECIDED_SHARE = 0.08
# Its floor, left at speed 1/4 at t = 0, is touched again at t = 7/8: f = (s - 7/8)^2 / 2.
BACK = Stem(w=1.0, h=BangBang(knots=((-1.0, 1.0), (1.0, 2.0), (1.5, 1.5), (2.0, 2.0), (3.0, 1.0))))
DROP = Stem(w=1.0, h=BangBang(knots=((-1.0, 1.0), (0.125, 1.0), (1.125, 0.75), (2.0, 0.75), (3.0, 1.0))))


def test_plain_agrees_with_reference(tally):
    @settings(max_examples=N_STEPS)
    @given(scenes_and_states())
    def step(drawn):
        scene, state, t_end = drawn
        answer = plain.next_collision(scene, state, t_end)
        found = compare(answer, proved_step(scene, state, t_end), state, BOUND)
        tally["steps"] += 1
        tally[found.kind] += 1
        assert found.kind in ("agrees", "undecided", "indeterminate"), (found, answer)

    step()
    assert tally["steps"] >= N_STEPS
    assert tally["undecided"] <= UNDECIDED_SHARE * tally["steps"]


def test_a_rise_keeps_its_digits_however_short_the_time():
    """A difference of two values would lose them all: 1e-12 * rate beside a value of order 1."""
    law = Fourier(mean=1.0, omega=2.0, cos=(0.25, 0.125), sin=(0.5,))
    t, s = 0.75, 1e-12
    rate = sum(k * 2 * (b * math.cos(2 * k * t) - a * math.sin(2 * k * t)) for k, a, b in law.harmonics())
    assert FourierMotion(law, t).at(s).rise == pytest.approx(rate * s, rel=1e-11)
    legs = BangBangMotion(LIFT.h, 0.25)  # mid-leg, at rate -4
    assert legs.at(s).rise == pytest.approx(-4 * s, rel=1e-11)


@pytest.mark.parametrize("t", [-1.375, 0.0, 0.125, 0.3125, 0.5, 7.0625])
@pytest.mark.parametrize("s", [0.0, 0.1, 0.25, 0.6, 1.0, 3.7])
def test_legs_close_after_any_period(t, s):
    """2 - 8 t^2, 1 + 8 (t - 1/2)^2, 2 - 8 (t - 1)^2 in turn, period 1."""
    legs = BangBangMotion(LIFT.h, t)

    def height(time):
        u = time % 1.0
        return 1 + 8 * (u - 0.5) ** 2 if 0.25 <= u < 0.75 else 2 - 8 * min(u, 1 - u) ** 2

    assert legs.at(s).now == pytest.approx(height(t + s), abs=1e-13)


@pytest.mark.parametrize(
    ("scene", "state", "kind"),
    [
        (CIRCLE, State(0.0, 0.5, 0.5, 0.5, -0.5), Undecided),  # a corner
        (STATIC, State(0.0, 0.25, 0.25, 1.0, -1.0), Undecided),  # the mouth's edge
        (LIFT, State(0.0, 0.0, -1.0, 0.0, 0.0), Undecided),  # a touch
        (LIFT, State(0.0, 0.0, -2.0, 0.0, 0.0, "floor"), Undecided),  # sliding
        (DROP, State(0.0, 0.25, -1.0, 0.0, 0.25, "floor"), Undecided),  # a touch of the floor that is left
        (DROP, State(0.0, 0.25, -1.0 + 2.0**-30, 0.0, 0.25, "floor"), Undecided),
        (
            BACK,
            State(0.0, 0.25, -1.5, 0.0, 0.0, "floor"),
            Undecided,
        ),  # a touch with no net change of any term
        (BACK, State(0.0, 0.25, -1.5, 0.0, 2.0**-60, "floor"), Undecided),
        (CIRCLE, State(0.0, 0.0, 1.0, 1.0, -1.0, "arc"), Undecided),  # a corner of the arc that is left
        (STATIC, State(0.0, 0.025, 0.0, 0.25, 0.0), Undecided),  # along the mouth to its edge at t_end
        (STATIC, State(0.0, 0.5, 0.0, 0.25, 1.0), Undecided),  # at the mouth's edge
        (STATIC, State(0.0, 1.0, 0.0, 0.25, -1.0), Undecided),  # where the base ends
        (CIRCLE, State(0.0, 0.9, 0.9, 1.0, 0.0), Rejected),
        (CIRCLE, State(0.0, 0.6, 0.8, 1.0, 0.0, "arc"), Rejected),
        (CIRCLE, State(0.0, math.nan, 0.8, 1.0, 0.0), Rejected),
        (CIRCLE, State(0.0, 0.0, 0.5, 1e200, 0.0), Undecided),
        (CIRCLE, State(0.0, 0.1, 0.5, 0.0, 0.0), Horizon),  # at rest
    ],
)
def test_what_it_does_not_answer_it_says(scene, state, kind):
    assert isinstance(plain.next_collision(scene, state, 1.9), kind)


def test_the_mouth_is_open_as_the_side_that_is_left_sees_it():
    """2^-24 outside of the left side by rounding, and going inwards: no base is met from below."""
    found = plain.next_collision(STATIC, State(0.0, -0.5 - 2.0**-24, -0.25, 2.0**-26, 1.0, "left"), 9.0)
    assert found.wall == "arc"


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("ulps", range(-3, 4))
def test_the_wall_being_left_met_again_at_the_horizon(sign, ulps):
    """A diameter: the arc is met again after exactly one unit of time, which is not before t_end = 1."""
    start = State(0.0, -sign, 2.0**-53, 2.0 * sign, 0.0, "arc")
    t_end = 1.0 + ulps * 2.0**-52
    assert isinstance(plain.next_collision(CIRCLE, start, t_end), Undecided)
    assert isinstance(plain.next_collision(CIRCLE, start, 1.001), Collision)
    assert isinstance(plain.next_collision(CIRCLE, start, 0.999), Horizon)
    assert isinstance(plain.next_collision(CIRCLE, start, 2.0**-40), Horizon)
    assert isinstance(plain.next_collision(CIRCLE, start, 0.0), Horizon)


@pytest.mark.parametrize("exponent", [-3, -10, -20])
def test_a_flat_chord_that_ends_at_the_horizon(exponent):
    """There f is a small difference of its terms, and so is f'."""
    inward = 2.0**exponent
    for angle in np.linspace(0.8, 2.3, 24):
        x, y = float(np.cos(angle)), float(np.sin(angle))
        start = State(0.0, x, y, -y - inward * x, x - inward * y, "arc")
        x_is, vx_is, y_is, vy_is = map(Fraction, (x, start.vx, y, start.vy))
        again = float(-2 * (x_is * vx_is + y_is * vy_is) / (vx_is**2 + vy_is**2))
        for ulps in (-3, -1, 0, 1, 3):
            t_end = again * (1.0 + ulps * 2.0**-52)
            assert isinstance(plain.next_collision(CIRCLE, start, t_end), Undecided)
        assert isinstance(plain.next_collision(CIRCLE, start, 1.001 * again), Collision)
        assert isinstance(plain.next_collision(CIRCLE, start, 0.999 * again), Horizon)


@pytest.mark.parametrize(
    ("length", "speed"), [(-350, -636), (-400, -700), (-1000, -1000), (-600, -300), (0, -600)]
)
def test_a_hit_is_not_lost_where_squares_vanish(length, speed):
    """The gap of the arc is one of squares: with v^2 = 0 no hit of it is seen."""
    r, v = 2.0**length, 2.0**speed
    for start in (State(0.0, r / 4, r / 2, -0.75 * v, v), State(0.0, 0.75 * r, 0.0, 0.0, v, "base")):
        for t_end in (1.5 * r / v, 4.0 * r / v):
            assert not isinstance(plain.next_collision(Cap(r=r), start, t_end), Horizon)


class RefusesByARoundedPhase(plain.Flight):
    """Takes f at departure for exact, though late in time the phase that it is taken at is rounded."""

    def refusal_of_departure(self, wall):
        off = abs(self.gap(wall, 0.0).start) > ON_WALL * self.size(wall)
        return Rejected("not on its wall") if off else super().refusal_of_departure(wall)


class RefusesByARoundedTurn(plain.Flight):
    """Takes f' at departure for exact, though late in time the phase that it is taken at is rounded."""

    def refusal_of_departure(self, wall):
        is_into = self.f(wall, 0.0)[1] < 0
        return Rejected("it moves into it") if is_into else super().refusal_of_departure(wall)


@pytest.mark.parametrize("flight", [plain.Flight, RefusesByARoundedPhase, RefusesByARoundedTurn])
def test_no_state_is_refused_for_a_rounded_phase(flight):
    """The reference, which knows every phase, agrees with what may come."""
    for stepper, is_right in (
        (reference.next_collision, True),
        (partial(plain.next_collision, flight=flight), flight is plain.Flight),
    ):
        answers = []
        for question, allowed in LATE_EDGES:
            state = msgspec.convert(question["state"], State)
            found = stepper(from_data(question["scene"]), state, question["t_end"])
            kind = "collision" if hasattr(found, "dt") else type(found).__name__.lower()
            answer = {"outcome": kind, "wall": getattr(found, "wall", None)}
            answers.append(is_among(answer, allowed))
        assert all(answers) == is_right


def test_trajectory_ends_at_the_horizon():
    steps = plain.trajectory(BOX, State(0.0, 0.0, -0.5, 1.0, 0.0), 10, 5.5)
    assert [getattr(step, "wall", "horizon") for step in steps] == ["right", "left", "right", "horizon"]
    assert steps[-1] == Horizon(5.5, 0.5, -0.5, -1.0, 0.0)


def test_flow_tells_the_captured_stay():
    """In a static cap a chord that misses the mouth misses it for ever; one through it never does."""
    gallery, ray = State(0.0, 0.0, 0.9, 1.0, 0.0), State(0.0, 0.0, 0.5, 0.0, -1.0)
    (_, stay), (_, none) = plain.flow(STATIC, [gallery, ray], 4.0)
    assert stay == (pytest.approx(math.sqrt(1 - 0.81)), 4.0)
    assert none is None


def test_it_speaks_protocol_1():
    state = {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 0.0, "vy": 1.0}
    cap = {"table": "cap", "r": 1.0}
    lines = [
        {"cmd": "start", "protocol": 1},
        {"cmd": "step", "seq": 1, "scene": cap, "state": state, "t_end": 9.0},
        {"cmd": "flow", "seq": 2, "scene": cap, "states": [state], "t_end": 0.25},
        {"cmd": "stop"},
    ]
    done = subprocess.run(
        [sys.executable, "-m", "conformance.plain"],
        input="".join(json.dumps(line) + "\n" for line in lines),
        capture_output=True,
        check=True,
        text=True,
        timeout=60,
        cwd=Path(__file__).parent.parent,
    )
    start, step, flow = map(json.loads, done.stdout.splitlines())
    assert start["name"] == "plain"
    assert "flow" in start["profiles"]
    assert (step["wall"], step["dt"], step["vy"]) == ("arc", 0.5, -1.0)
    assert flow["states"][0]["y"] == 0.75
