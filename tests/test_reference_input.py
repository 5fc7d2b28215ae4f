"""Bad input of the reference's public entries: one line naming field, value and bound, no traceback."""

from __future__ import annotations

import math

import numpy as np
import pytest

import reference
from reference.certificate import certificate, path_certificate
from scene import BadInput, Cap, Rejected, State, Undecided

CIRCLE = Cap(r=1.0)
STATE = State(0.0, 0.1, 0.2, 0.3, 0.4)
NO_SCENES = ("moving-cap", None, 1.0, {"table": "cap", "r": 1.0}, Cap)
NO_NUMBERS = (None, "1", math.nan, math.inf, -math.inf, True, [1.0], 1j, 10**400)
NO_COUNTS = (-3, 2.5, None, "2", True, math.nan, 10**9)
NO_DIGITS = (-30, 0, 2.5, None, "50", True, math.inf, 10**6)


def refused(call, field):
    """Refused by an exception or by an outcome, in one line that names the field."""
    try:
        outcome = call()
    except BadInput as error:
        reason = str(error)
    else:
        assert isinstance(outcome, Rejected), outcome
        reason = outcome.reason
    assert field in reason
    assert "\n" not in reason


@pytest.mark.parametrize("scene", NO_SCENES, ids=str)
def test_what_is_no_scene(scene):
    for call in (
        lambda: reference.next_collision(scene, STATE, 9.0),
        lambda: reference.trajectory(scene, STATE, 2),
        lambda: certificate(scene, STATE, 9.0, reference.next_collision(CIRCLE, STATE, 9.0)),
    ):
        with pytest.raises(BadInput, match="scene = "):
            call()


@pytest.mark.parametrize("field", ["t", "x", "y", "vx", "vy"])
@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
def test_what_is_no_number_of_a_state(field, value):
    state = State(**{"t": 0.0, "x": 0.1, "y": 0.2, "vx": 0.3, "vy": 0.4, field: value})
    refused(lambda: reference.next_collision(CIRCLE, state, 9.0), f"state.{field} = ")
    refused(lambda: reference.trajectory(CIRCLE, state, 2), f"state.{field} = ")


@pytest.mark.parametrize("state", [None, "state", (0.0, 0.1, 0.2, 0.3, 0.4), {"t": 0.0}], ids=str)
def test_what_is_no_state(state):
    refused(lambda: reference.next_collision(CIRCLE, state, 9.0), "state = ")
    refused(lambda: reference.trajectory(CIRCLE, state, 2), "state = ")
    refused(lambda: reference.trajectory(CIRCLE, state, 2, 9.0), "state = ")


@pytest.mark.parametrize("wall", ["lid", "left", ["arc"], 1, math.nan], ids=str)
def test_what_is_no_wall(wall):
    refused(
        lambda: reference.next_collision(CIRCLE, State(0.0, 0.1, 0.2, 0.3, 0.4, wall), 9.0), "state.wall = "
    )


@pytest.mark.parametrize("t_end", [*NO_NUMBERS, -1.0], ids=lambda value: type(value).__name__)
def test_what_is_no_horizon(t_end):
    refused(lambda: reference.next_collision(CIRCLE, STATE, t_end), "t_end = ")
    if t_end is not None:
        refused(lambda: reference.trajectory(CIRCLE, STATE, 2, t_end), "t_end = ")


@pytest.mark.parametrize("value", NO_DIGITS, ids=str)
def test_what_is_no_number_of_digits(value):
    refused(lambda: reference.next_collision(CIRCLE, STATE, 9.0, digits=value), "digits = ")
    refused(lambda: reference.trajectory(CIRCLE, STATE, 2, digits=value), "digits = ")
    if value is not None:
        refused(lambda: reference.trajectory(CIRCLE, STATE, 2, working=value), "working = ")


@pytest.mark.parametrize("value", NO_COUNTS, ids=str)
def test_what_is_no_number_of_collisions(value):
    refused(lambda: reference.trajectory(CIRCLE, STATE, value), "n_collisions = ")


@pytest.mark.parametrize("outcome", [None, "arc", Undecided("open"), Rejected("no")], ids=str)
def test_what_has_no_certificate(outcome):
    with pytest.raises(BadInput, match="outcome = "):
        certificate(CIRCLE, STATE, 9.0, outcome)
    with pytest.raises(BadInput, match="path = "):
        path_certificate(CIRCLE, STATE, 9.0, outcome)


def test_numbers_of_other_kinds_are_the_floats_they_stand_for():
    plain = reference.next_collision(CIRCLE, State(0.0, 0.5, 0.0, 1.0, 2.0, "base"), 9.0)
    for kind in (int, np.float64, np.float32):
        others = [kind(number) for number in (0, 1, 2, 9)]
        state = State(others[0], 0.5, others[0], others[1], others[2], "base")
        assert reference.next_collision(CIRCLE, state, others[3]).dt == plain.dt
