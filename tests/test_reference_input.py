"""Input of the reference: what has no certificate, and numbers of other kinds (see test_stepper_input)."""

from __future__ import annotations

import numpy as np
import pytest

import reference
from reference.certificate import certificate, path_certificate
from scene import BadInput, Cap, Rejected, State, Undecided

CIRCLE = Cap(r=1.0)
STATE = State(0.0, 0.1, 0.2, 0.3, 0.4)


@pytest.mark.parametrize("scene", ["moving-cap", None, 1.0, {"table": "cap", "r": 1.0}, Cap], ids=str)
def test_what_is_no_scene_has_no_certificate(scene):
    with pytest.raises(BadInput, match="scene = "):
        certificate(scene, STATE, 9.0, reference.next_collision(CIRCLE, STATE, 9.0))


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
