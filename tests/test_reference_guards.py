"""Guards of the reference's proofs: bounds on either side, and questions that must stay undecided."""

from typing import Any

import pytest
from support.starts_by_hand import STARTS

import reference
from scene import Rejected, State, Undefined, from_data

MIRRORED = {"left": "right", "right": "left"}


def found(scene: dict[str, Any], start: dict[str, Any], t_end: float) -> str:
    """Return the wall met, or the outcome, or why it is undefined."""
    outcome = reference.next_collision(from_data(scene), State(**start), t_end, digits=10)
    if isinstance(outcome, Undefined):
        return outcome.reason
    if isinstance(outcome, reference.Collision):
        return outcome.wall
    if isinstance(outcome, Rejected):
        return "rejected"
    return "horizon" if isinstance(outcome, reference.Horizon) else "undecided"


@pytest.mark.parametrize(("scene", "start", "t_end", "truth"), STARTS, ids=range(len(STARTS)))
def test_what_is_true_of_a_start_is_answered(
    scene: dict[str, Any], start: dict[str, Any], t_end: float, truth: str
) -> None:
    wall = start["wall"]
    mirrored = {**start, "x": -start["x"], "vx": -start["vx"], "wall": MIRRORED.get(wall, wall)}
    assert found(scene, start, t_end) == truth
    assert found(scene, mirrored, t_end) == MIRRORED.get(truth, truth)
