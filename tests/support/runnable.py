"""The command of an example harness, for a test that runs it."""

import pytest

from conformance.harness.examples import Example


def runnable(example: Example) -> list[str]:
    """Return the command. An absent compiler skips the test; a source that does not compile fails it."""
    if example.is_absent:
        pytest.skip(example.why_not)
    assert example.command, example.why_not
    return list(example.command)
