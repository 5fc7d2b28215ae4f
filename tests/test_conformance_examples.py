"""The compiled examples: an absent compiler is told from a source at fault; no source has a warning."""

import shutil

import pytest
from support.runnable import runnable

from conformance.bench import baselines
from conformance.harness import examples

STRICT = ("-O1", "-Wall", "-Wextra", "-Werror")
BY_LANGUAGE = {
    "C": lambda folder, flags: examples.find_examples(folder, flags)["C"],
    "C++": lambda folder, flags: examples.find_kit_examples(folder, flags)["C++, next hit"],
}


@pytest.mark.parametrize(
    ("language", "source", "fault"),
    [
        ("C", "c/stepper.c", "int json_null;"),
        ("C++", "cpp/engine.cpp", "int at_fault() { return ; }"),
    ],
)
def test_a_source_at_fault_is_not_taken_for_an_absent_compiler(
    language, source, fault, tmp_path, monkeypatch
):
    """Its tests would be skipped. The error in the C source quotes jansson's header."""
    runnable(BY_LANGUAGE[language](tmp_path, ["-O0"]))
    folder = shutil.copytree(examples.FOLDER, tmp_path / "harness")
    path = folder / source
    path.write_text(f"{path.read_text('utf-8')}\n{fault}\n", "utf-8")
    monkeypatch.setattr(examples, "FOLDER", folder)
    found = BY_LANGUAGE[language](tmp_path, ["-O0"])
    assert (found.command, found.is_absent) == ((), False)
    assert found.why_not.startswith("it does not compile: ")


@pytest.mark.parametrize(
    ("language", "hidden", "reason"),
    [
        ("C", "a compiler", "no C compiler is installed"),
        ("C++", "a compiler", "no C++ compiler is installed"),
        ("C", "jansson", "jansson is not installed (Debian: libjansson-dev)"),
    ],
)
def test_what_is_absent_is_named(language, hidden, reason, tmp_path, monkeypatch):
    """A header that only fails stands for a jansson that is not there."""
    if hidden == "jansson":
        runnable(BY_LANGUAGE[language](tmp_path, ["-O0"]))
        (tmp_path / "jansson.h").write_text("#error absent\n", "utf-8")
        monkeypatch.setenv("CPATH", str(tmp_path))
    else:
        monkeypatch.setattr(examples.shutil, "which", lambda _: None)
    found = BY_LANGUAGE[language](tmp_path, ["-O0"])
    assert (found.command, found.is_absent, found.why_not) == ((), True, reason)


@pytest.mark.deep
@pytest.mark.parametrize("language", BY_LANGUAGE)
def test_no_source_has_a_warning(language, tmp_path):
    """Of the compilers of CI. Another may warn of more, which is why `pytest` does not ask."""
    runnable(BY_LANGUAGE[language](tmp_path, STRICT))


@pytest.mark.deep
def test_the_baselines_have_no_warning(tmp_path):
    if not examples.find_compiler("C"):
        pytest.skip("no C compiler is installed")
    baselines.build(tmp_path, STRICT)
