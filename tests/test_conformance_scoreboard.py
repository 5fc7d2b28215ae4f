"""The scoreboard: baselines speak the protocol, and the page says who passes and why not."""

from __future__ import annotations

import shutil
import sys

import pytest

from conformance import suite
from conformance.bench import baselines, scoreboard
from conformance.bench.scoreboard import Graded, page, reasons
from conformance.suite import property_checks
from conformance.suite.session import Limits
from scene import BadInput

needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler is installed")


@pytest.fixture(scope="module")
def lean():
    command = [sys.executable, "-m", "conformance.bench.baselines", "lean-c"]
    with pytest.MonkeyPatch.context() as patch:  # ensembles and promises are not what is looked at
        patch.setattr(property_checks, "SIZES", {"core": property_checks.Size(20, 50.0, 0.5)})
        patch.setattr("conformance.suite.promises.ask_promises", lambda _: iter(()))
        return suite.check(command, seed=1, groups=["moving-cap", "fast-wall"], limits=Limits(total=300.0))


@pytest.mark.deep
@needs_compiler
def test_a_lean_stepper_without_checks_passes_the_easy_and_fails_the_hard(lean):
    easy, hard = (lean.counts(group) for group in ("moving-cap", "fast-wall"))
    assert easy["pass"] > 0.9 * sum(easy.values())
    assert hard["fail"] >= 5
    assert lean.verdict() == "not accepted"
    assert "fast-wall" in reasons(lean)[0]


@pytest.mark.deep
@needs_compiler
def test_the_page_has_a_row_for_each_and_a_reason_for_failure(lean):
    text = page([Graded("lean-c", lean), Graded("example in C", None, "no compiler")], lean.corpus)
    assert "| lean-c | not accepted |" in text
    assert "| example in C | not run |" in text
    assert f"- **lean-c**: {lean.scope()}." in text
    assert "  - fails most in " in text
    assert "not run here: no compiler." in text


def test_a_baseline_that_is_none_is_refused():
    with pytest.raises(BadInput, match="must be one of lean-c"):
        baselines.main(["lean"])


def test_every_baseline_is_listed(tmp_path, monkeypatch):
    """Whatever can be built here; the examples have tests of their own."""
    for finder in ("find_examples", "find_kit_examples"):
        monkeypatch.setattr(scoreboard, finder, lambda _: {})
    names = [name for name, _, _ in scoreboard.commands(tmp_path)]
    assert {"fast", "plain", "steps-1000", "solve-ivp-1e-09", "lean-numba"} < set(names)
