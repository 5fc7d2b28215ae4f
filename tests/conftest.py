"""Hypothesis profiles: `quick` (default, reproducible) and `deep`, chosen with HYPOTHESIS_PROFILE.

A failing example of `conformance.strategies` carries a note: the step as the wire's JSON line.
What long comparisons counted is printed after the tests: nothing is skipped silently.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator

import pytest
from hypothesis import settings

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


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the tallies."""
    for report in terminalreporter.stats.get("", []):
        for name, line in report.user_properties if report.when == "teardown" else ():
            if name == "tally":
                terminalreporter.write_line(line)
