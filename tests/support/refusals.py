"""What a refusal of bad input looks like: one short line; and what is no number."""

import math

import numpy as np
import pytest

from scene import BadInput, Cap, Fourier, State

HUGE = 10**400
# Neither numbers, nor None: that an argument may be left out is for a test to say.
NO_NUMBERS = [
    *(True, np.True_, "1", b"1", [], [1.0], (1.0,), {}, {"kind": "fourier"}, np.array([1.0, 2.0])),
    *(1j, object(), Fourier, Cap(r=1.0), State(0.0, 0.1, 0.3, 1.0, 0.7), HUGE),
]
NOT_FINITE = [math.nan, math.inf, -math.inf, np.float64("nan"), np.float32("inf")]


def one_line(call, *arguments, **fields):
    """Return the message with which a call refuses."""
    with pytest.raises(BadInput) as refusal:
        call(*arguments, **fields)
    message = str(refusal.value)
    assert len(message.splitlines()) == 1
    assert len(message) < 300
    return message


def assert_refused(result, *words):
    """Hold that a command ended with code 2 and one line on standard error, with these words in it."""
    code, out, err = result
    assert (code, out) == (2, "")
    assert err.startswith("mushrooms: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    for word in words:
        assert word in err
