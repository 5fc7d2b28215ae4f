"""The pytest plugin behind `pytest_suite`: its options, its session, one case per vector."""

from __future__ import annotations

import shlex
from collections.abc import Iterator

import pytest

from conformance import suite, vectors
from conformance.suite.session import Limits, Session


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this module."""
    group = parser.getgroup("mushrooms")
    group.addoption("--mushrooms-command", metavar="COMMAND", help="A stepper that speaks protocol 1.")
    group.addoption("--mushrooms-level", default="core", choices=vectors.LEVELS, help="Hardest level asked.")
    group.addoption("--mushrooms-timeout", default=120.0, type=float, help="Seconds for one answer.")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test for each vector."""
    if "mushrooms_vector" in metafunc.fixturenames:
        chosen = suite.choose(metafunc.config.getoption("--mushrooms-level"))
        metafunc.parametrize("mushrooms_vector", chosen, ids=[vector.id for vector in chosen])


@pytest.fixture(scope="session")
def mushrooms_session(request: pytest.FixtureRequest) -> Iterator[Session]:
    """Open a session with the command, its numbers proved to travel unharmed."""
    command = request.config.getoption("--mushrooms-command")
    if not command:
        pytest.fail("give the stepper as --mushrooms-command", pytrace=False)
    limits = Limits(timeout=request.config.getoption("--mushrooms-timeout"))
    with Session(shlex.split(command), limits) as session:
        session.start()
        session.probe()
        yield session
