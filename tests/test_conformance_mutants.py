"""Every mutant is killed by the vectors that the published kill matrix names for it; plain by none."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from support.depth import deep_but

from conformance.mutants import COMMON, MUTANTS, PLAIN, kill_matrix
from conformance.mutants.kill_matrix import diagnose, kills, page, verdict
from conformance.mutants.mutant import make_mutant
from conformance.vectors import manifest

DOCS = Path(__file__).parent.parent / "docs"
PUBLISHED = json.loads((kill_matrix.DATA / "kill-matrix.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def vectors(corpus):
    return {vector.id: vector for vector in corpus}


def test_the_matrix_is_of_these_mutants_and_this_corpus():
    assert (PUBLISHED["corpus"], PUBLISHED["digest"]) == (manifest().corpus, manifest().digest)
    listed = {name: (entry["fault"], entry["size"]) for name, entry in PUBLISHED["mutants"].items()}
    assert listed == {name: (mutant.fault, mutant.size) for name, mutant in (MUTANTS | COMMON).items()}
    for name, entry in PUBLISHED["mutants"].items():
        assert bool(entry["subsumed_by"]) == (name in COMMON), name
        assert entry["kills"] > 0, name
        assert 1 <= len(entry["vectors"]) <= kill_matrix.MOST_VECTORS, name


def test_without_a_threshold_a_mutant_is_killed_at_level_core(vectors):
    levels = {name: {vectors[v].level for v in e["vectors"]} for name, e in PUBLISHED["mutants"].items()}
    late = {name for name, found in levels.items() if "core" not in found}
    assert all(MUTANTS[name].size is not None for name in late), late


def test_the_table_has_a_row_for_each_mutant():
    text = page(PUBLISHED)
    rows = [line.replace("\\|", "") for line in text.splitlines() if line.startswith("| ")]
    assert len(rows) == len(MUTANTS | COMMON) + 2
    assert {row.count("|") for row in rows} == {6}


@pytest.mark.parametrize("name", list(MUTANTS | COMMON))
def test_mutant_is_killed_by_its_vectors(vectors, name):
    for killing in PUBLISHED["mutants"][name]["vectors"]:
        assert verdict((MUTANTS | COMMON)[name], vectors[killing]) == "fail", killing
        assert verdict(PLAIN, vectors[killing]) in ("pass", "declined"), killing


def test_plain_fails_no_vector(vectors):
    """A sample here; the published run looked at all. It declines what is degenerate, and nothing else."""
    verdicts = {(vector.level, verdict(PLAIN, vector)) for vector in list(vectors.values())[::24]}
    assert {found for _, found in verdicts} <= {"pass", "declined"}
    assert {level for level, found in verdicts if found == "declined"} <= {"stress"}


def test_the_page_for_contributors_shows_a_mutant_as_it_is():
    shown = (DOCS.parent / "CONTRIBUTING.md").read_text("utf-8").split("\n```python\n")[1].split("```")[0]
    assert shown in (kill_matrix.DATA / "walls.py").read_text("utf-8")


# From which size on a mistake is none for the vectors that kill it.
HARMLESS = {
    "three-harmonics-at-most": 16,
    "gives-up-after-ten-periods": 1e9,
    "energy-frozen-after-fifty-hits": 1e4,
    "mouth-wider-by-a-millionth": 0,
    "capture-edge-moved": 0,
}


@pytest.mark.parametrize("name", HARMLESS)
def test_a_size_is_where_the_mistake_begins(vectors, name):
    for killing in PUBLISHED["mutants"][name]["vectors"]:
        assert verdict(MUTANTS[name].of_size(HARMLESS[name]), vectors[killing]) != "fail"
        assert verdict(MUTANTS[name].of_size(MUTANTS[name].size), vectors[killing]) == "fail"


def crash(*_):
    """Divide by zero in place of an outcome."""
    raise ZeroDivisionError


def test_a_crash_is_no_kill(vectors):
    sample, mutant = list(vectors.values())[:50], make_mutant(PLAIN.flight, "outcome", crash)
    assert {verdict(mutant, vector) for vector in sample if vector.kind == "step"} == {"crashed"}
    assert kills(sample, mutant) == []


def test_the_command_writes_both_files_and_judges(monkeypatch, tmp_path, vectors):
    """One mutant is subsumed by another that hides for longer, and one is none and survives."""
    name, lines = "three-harmonics-at-most", []
    fewer = MUTANTS[name].of_size(1)
    group = [vector for vector in vectors.values() if vector.group in ("many-harmonics", "deep-waves")]
    monkeypatch.setattr(kill_matrix, "load", lambda level: group)
    monkeypatch.setattr(kill_matrix, "COMMON", {})
    for others, expected in (
        ({}, ["not killed: none", "subsumed: none", "plain fails: none"]),
        ({"fewer": fewer}, ["not killed: none", f"subsumed: fewer by {name}", "plain fails: none"]),
        ({"alive": PLAIN}, ["not killed: alive", "subsumed: none", "plain fails: none"]),
    ):
        monkeypatch.setattr(kill_matrix, "MUTANTS", {name: MUTANTS[name], **others})
        code = kill_matrix.run(tmp_path, lines.append)
        assert (code, lines[-3:]) == (int(bool(others)), expected)
    assert name in json.loads((tmp_path / "kill-matrix.json").read_text())["mutants"]


def judged(mutant, vectors):
    """Return what fails and what passes in a run of a mutant: every 12th vector and those of the matrix."""
    told = {v for entry in PUBLISHED["mutants"].values() for v in entry["vectors"]}
    asked = [v for i, v in enumerate(vectors.values()) if v.level == "core" and (i % 12 == 0 or v.id in told)]
    failed = set(kills(asked, mutant))
    return [v for v in asked if v.id in failed], [v for v in asked if v.id not in failed]


NAMED = [
    "floor-velocity-sign",
    "mouth-tested-at-departure",
    "captured-by-velocity-after",
    "slope-at-departure",
    "wall-velocity-once",
    "newton-from-departure",
]


@pytest.mark.parametrize("name", deep_but(NAMED, "slope-at-departure"))
def test_a_diagnosis_names_the_mistake(vectors, name):
    said = diagnose(*judged((MUTANTS | COMMON)[name], vectors))
    assert any(line.startswith(f"like {name} on ") for line in said), said


@pytest.mark.parametrize("module", ["conformance.mutants.kill_matrix", "conformance.bench.scoreboard"])
@pytest.mark.parametrize("option", ["--help", "--tabel"])
def test_an_unknown_option_starts_no_long_run(module, option):
    """Both write a file of the project after a quarter of an hour."""
    done = subprocess.run(
        [sys.executable, "-m", module, option], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"{option!r} is no option: ")
    assert done.stderr.count("\n") == 1
