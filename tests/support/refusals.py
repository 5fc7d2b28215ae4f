"""What a refusal of bad input looks like: one short line."""

import pytest

from scene import BadInput


def one_line(call, *arguments, **fields):
    """Return the message with which a call refuses."""
    with pytest.raises(BadInput) as refusal:
        call(*arguments, **fields)
    message = str(refusal.value)
    assert len(message.splitlines()) == 1
    assert len(message) < 300
    return message
