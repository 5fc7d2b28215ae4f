"""Vectors and checks as pytest cases, in place of `mushrooms check`: one test for each.

    pytest -p conformance.suite.pytest_plugin --pyargs conformance.suite.pytest_suite \
        --mushrooms-command ./my_stepper

`--mushrooms-level` is core, extended or stress, `--mushrooms-timeout` the seconds for one answer, and
`--mushrooms-seed` repeats a run's symmetry transforms; pytest prints it. Declined and unsupported cases are
skipped with their reason. Not here: fresh questions, speed, known failures (use `-k` and `--deselect`), the
limit on how many cases may be declined.
"""

import pytest

from conformance import suite
from conformance.suite.checks import SuiteCheck, run_check
from conformance.suite.result import Result
from conformance.suite.run import draw_transform
from conformance.suite.session import Session
from conformance.vectors import Vector


def test_vector(mushrooms_session: Session, mushrooms_vector: Vector, pytestconfig: pytest.Config) -> None:
    """Grade one answer to a vector in the image that the run's seed draws."""
    transform = draw_transform(mushrooms_vector, pytestconfig.option.mushrooms_seed)
    _report(suite.ask_vector(mushrooms_session, mushrooms_vector, transform), mushrooms_vector.rule)


def test_check(mushrooms_session: Session, mushrooms_check: SuiteCheck, pytestconfig: pytest.Config) -> None:
    """Ask what one check draws from the run's seed."""
    result = run_check(mushrooms_check, mushrooms_session, pytestconfig.option.mushrooms_seed)
    _report(result, result.paste)


def _report(result: Result, further: str) -> None:
    if result.verdict in ("declined", "unsupported"):
        pytest.skip(f"{result.verdict}: {result.why}")
    if result.verdict != "pass":
        pytest.fail(f"{result.verdict}: {result.why}; {further}", pytrace=False)
