"""The pytest plugin behind `pytest_suite`: its options, its session, one case per vector."""

import secrets
import shlex
from collections.abc import Iterator
from typing import Any

import pytest

from conformance import suite, vectors
from conformance.suite.checks import checks_of
from conformance.suite.process import CheckFailure
from conformance.suite.run import NEW_SEEDS
from conformance.suite.session import Limits, Session
from scene.refusal import BadInput, check_seed


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this module."""
    group = parser.getgroup("mushrooms")
    group.addoption("--mushrooms-command", metavar="COMMAND", help="A stepper that speaks protocol 1.")
    group.addoption("--mushrooms-level", default="core", choices=vectors.LEVELS, help="Hardest level asked.")
    group.addoption("--mushrooms-seed", type=int, help="Of all random choices; a new one each run, printed.")
    group.addoption("--mushrooms-timeout", default=120.0, type=float, help="Seconds for one answer.")


def pytest_configure(config: pytest.Config) -> None:
    """Refuse bad options, and draw a seed where none is given, the same for every worker of a run."""
    options = config.option
    if options.mushrooms_seed is None:
        inherited = getattr(config, "workerinput", {}).get("mushrooms_seed")
        options.mushrooms_seed = secrets.randbelow(NEW_SEEDS) if inherited is None else inherited
    try:
        check_seed(options.mushrooms_seed, "--mushrooms-seed")
    except BadInput as error:
        raise pytest.UsageError(str(error)) from None
    if not options.mushrooms_timeout > 0:
        raise pytest.UsageError(f"--mushrooms-timeout = {options.mushrooms_timeout}, must be above 0 seconds")
    try:
        shlex.split(options.mushrooms_command or "")
    except ValueError as error:
        raise pytest.UsageError(f"--mushrooms-command = {options.mushrooms_command!r}: {error}") from None


def pytest_report_header(config: pytest.Config) -> str:
    """Print the seed, which repeats a run."""
    return f"mushrooms: --mushrooms-seed {config.option.mushrooms_seed}"


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Hand the seed to a worker of pytest-xdist."""
    node.workerinput["mushrooms_seed"] = node.config.option.mushrooms_seed


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test for each vector, and for each check."""
    if "mushrooms_vector" in metafunc.fixturenames:
        chosen = suite.choose(metafunc.config.getoption("--mushrooms-level"))
        metafunc.parametrize("mushrooms_vector", chosen, ids=[vector.id for vector in chosen])
    if "mushrooms_check" in metafunc.fixturenames:
        checks = checks_of(metafunc.config.getoption("--mushrooms-level"))
        metafunc.parametrize("mushrooms_check", checks, ids=[check.name for check in checks])


@pytest.fixture(scope="session")
def mushrooms_session(request: pytest.FixtureRequest) -> Iterator[Session]:
    """Open a session with the command, its numbers proved to travel unharmed."""
    command = shlex.split(request.config.getoption("--mushrooms-command") or "")
    if not command:
        pytest.fail("give the stepper as --mushrooms-command", pytrace=False)
    limits = Limits(timeout=request.config.getoption("--mushrooms-timeout"))
    with Session(command, limits) as session:
        try:
            session.start()
            session.probe()
        except (BadInput, CheckFailure) as failure:
            pytest.fail(str(failure), pytrace=False)
        yield session
