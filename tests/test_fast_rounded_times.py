"""Where an answer hangs on rounding of a time, the careful step has the right one or none."""

from __future__ import annotations

import json

import pytest
from support.depth import deep_but
from support.faulty_kernels import output_of
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


# What is taken out of the kernels, and the family that misses it.
MUTANTS = {
    "a wall that has come back": (
        "after a spike",
        "scalar_step.py",
        "if side > 0 and s < limit:",
        "if s < 0.0:",
    ),
    "the mouth's own motion": (
        "beside a moving mouth",
        "walls.py",
        "rounding * (abs(vx) + drift)",
        "rounding * abs(vx)",
    ),
    "what is wrong with f' on the way": (
        "along a leaning side",
        "scalar_step.py",
        "(error + slope_error * h) / -slope",
        "error / -slope",
    ),
}
PROGRAM = """
import json
from test_fast_rounded_times import answers
print(json.dumps(answers({family!r})))
"""


@pytest.mark.parametrize("name", deep_but(MUTANTS, "the mouth's own motion"))
def test_a_stepper_without_it_is_wrong(name, tmp_path, tally):
    family, *change = MUTANTS[name]
    found = json.loads(output_of(tmp_path, PROGRAM.format(family=family), *change))
    tally["decided"], tally["wrong"] = wrong(family, found)
    assert tally["wrong"] > 0
