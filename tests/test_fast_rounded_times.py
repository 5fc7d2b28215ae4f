"""Where an answer hangs on rounding of a time, the careful step has the right one or none."""

from __future__ import annotations

import pytest
from support.rounded_times import FAMILIES, questions

import fast
import reference
from scene import Collision, Horizon

# Of each family: the reference takes long for some.
N_QUESTIONS = {
    "after a spike": 12,
    "after a long wait": 5,
    "beside a moving mouth": 40,
    "along a leaning side": 300,
}


def told(outcome):
    """Return the wall of a collision, "horizon", else None: undecided, or refused for its phases."""
    if isinstance(outcome, Collision | reference.Collision):
        return outcome.wall
    return "horizon" if isinstance(outcome, Horizon | reference.Horizon) else None


def answers(family):
    """Return what the careful step tells of questions of a family."""
    return [told(fast.next_collision(*question)) for question in questions(family, 1, N_QUESTIONS[family])]


def wrong(family, found):
    """Return how many answers are decided, and how many of them the reference contradicts."""
    n_decided = n_wrong = 0
    for question, answer in zip(questions(family, 1, len(found)), found, strict=True):
        if answer is not None:
            n_decided += 1
            n_wrong += told(reference.next_collision(*question, digits=20)) not in (None, answer)
    return n_decided, n_wrong


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_decided_is_right(family, tally):
    tally["decided"], tally["wrong"] = wrong(family, answers(family))
    assert tally["decided"] > 0
    assert tally["wrong"] == 0
