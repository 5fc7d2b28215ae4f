"""The vectors as pytest cases, for those who prefer `pytest` to `mushrooms check`: one test per vector.

    pytest -p conformance.suite.pytest_plugin --pyargs conformance.suite.pytest_suite \
        --mushrooms-command ./my_stepper

`--mushrooms-level` is core, extended or stress, `--mushrooms-timeout` the seconds for one answer, and
`--mushrooms-seed` repeats a run's disguises; pytest prints it. Declined and unsupported cases are skipped
with their reason. Not here: drawn questions, properties, profiles, speed, known failures (use `-k` and
`--deselect`), and the limit on how many cases may be declined.
"""

from __future__ import annotations

import pytest

from conformance import suite
from conformance.suite.disguise import Disguise
from conformance.suite.session import Session
from conformance.vectors import Vector


def test_vector(mushrooms_session: Session, mushrooms_vector: Vector, mushrooms_disguise: Disguise) -> None:
    """Grade one answer."""
    result = suite.ask_vector(mushrooms_session, mushrooms_vector, mushrooms_disguise)
    if result.verdict in ("declined", "unsupported"):
        pytest.skip(f"{result.verdict}: {result.why}")
    if result.verdict != "pass":
        pytest.fail(f"{result.verdict}: {result.why}; {mushrooms_vector.rule}", pytrace=False)
