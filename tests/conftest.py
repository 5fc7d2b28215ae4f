"""Hypothesis profiles: `quick` (default, reproducible) and `deep`, chosen with HYPOTHESIS_PROFILE.

A failing example of `conformance.strategies` carries a note: the step as the wire's JSON line.
What long comparisons counted is printed after the tests: nothing is skipped silently.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest
from hypothesis import settings

from mushrooms.main import run

settings.register_profile("quick", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("deep", max_examples=10_000, deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


@pytest.fixture
def tally(request: pytest.FixtureRequest) -> Iterator[Counter[str]]:
    """Count what a test looked at; the counts are printed in the terminal summary."""
    counts: Counter[str] = Counter()
    yield counts
    line = f"{request.node.name}: " + ", ".join(f"{name} {n}" for name, n in counts.items())
    request.node.user_properties.append(("tally", line))  # with the report it travels from any worker


class Ended(NamedTuple):
    """How a command ended: exit code, standard output, standard error."""

    code: object
    out: str
    err: str


@pytest.fixture
def command_line(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """Run `mushrooms` with arguments, in this process."""

    def call(*arguments: object) -> Ended:
        with pytest.raises(SystemExit) as stop:
            run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Ended(stop.value.code, captured.out, captured.err)

    return call


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the tallies."""
    for report in terminalreporter.stats.get("", []):
        for name, line in report.user_properties if report.when == "teardown" else ():
            if name == "tally":
                terminalreporter.write_line(line)
