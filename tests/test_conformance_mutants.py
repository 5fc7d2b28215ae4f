"""Every mutant is killed by the vectors that the published kill matrix names for it; plain by none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conformance.mutants import MUTANTS, kill_matrix
from conformance.mutants.kill_matrix import PLAIN, kills, table, verdict
from conformance.vectors import load, manifest

DOCS = Path(__file__).parent.parent / "docs"
PUBLISHED = json.loads((kill_matrix.DATA / "kill-matrix.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def vectors():
    return {vector.id: vector for vector in load("stress")}


def test_there_are_many_mutants_and_none_survives():
    assert len(MUTANTS) >= 40
    assert set(PUBLISHED["mutants"]) == set(MUTANTS)
    assert PUBLISHED["survivors"] == []
    assert PUBLISHED["plain_fails"] == []
    assert all(entry["kills"] for entry in PUBLISHED["mutants"].values())


def test_the_readable_form_is_of_the_published_matrix():
    text = (DOCS / "kill-matrix.md").read_text("utf-8")
    assert text == table(PUBLISHED)
    rows = [line.replace("\\|", "") for line in text.splitlines() if line.startswith("| ")]
    assert len(rows) == len(MUTANTS) + 2
    assert {row.count("|") for row in rows} == {5}


def test_the_matrix_is_of_this_corpus():
    assert PUBLISHED["corpus"] == manifest().corpus
    assert PUBLISHED["digest"] == manifest().digest


@pytest.mark.parametrize("name", MUTANTS)
def test_mutant_is_killed_by_its_witnesses(vectors, name):
    entry = PUBLISHED["mutants"][name]
    assert entry["fault"] == MUTANTS[name].fault
    assert entry["witnesses"]
    for witness in entry["witnesses"]:
        assert verdict(MUTANTS[name], vectors[witness]) == "fail", witness
        assert verdict(PLAIN, vectors[witness]) == "pass", witness


def test_plain_fails_no_vector(vectors):
    """A sample here; the published run looked at all."""
    sample = list(vectors.values())[::8]
    verdicts = {vector.id: verdict(PLAIN, vector) for vector in sample}
    assert set(verdicts.values()) <= {"pass", "declined"}
    assert sum(found == "declined" for found in verdicts.values()) <= 0.02 * len(sample)


def test_a_sample_of_the_matrix_is_reproduced(vectors):
    sample = list(vectors.values())[::40]
    for name in ("wall-velocity-once", "mouth-tested-at-departure", "harmonics-ignored"):
        published = [v.id for v in sample if name in PUBLISHED["killed_by"][v.id]]
        assert kills(sample, MUTANTS[name]) == published


def test_a_crash_is_no_kill(vectors):
    class Breaks(PLAIN.flight):
        def outcome(self):
            raise ZeroDivisionError

    sample = [v for v in list(vectors.values())[:50] if v.kind == "step"]
    mutant = PLAIN._replace(name="breaks", flight=Breaks)
    assert {verdict(mutant, vector) for vector in sample} == {"crashed"}
    assert kills(sample, mutant) == []


def test_the_command_writes_both_files_and_judges(monkeypatch, tmp_path, vectors):
    sample = [vectors[w] for w in PUBLISHED["mutants"]["base-closed"]["witnesses"]]
    monkeypatch.setattr(kill_matrix, "load", lambda level: sample)
    monkeypatch.setattr(kill_matrix, "MUTANTS", {"base-closed": MUTANTS["base-closed"]})
    lines: list[str] = []
    assert kill_matrix.run(tmp_path / "docs", tmp_path / "docs", lines.append) == 0
    written = json.loads((tmp_path / "docs" / "kill-matrix.json").read_text())
    assert written["mutants"]["base-closed"]["kills"] == len(sample)
    assert "| base-closed |" in (tmp_path / "docs" / "kill-matrix.md").read_text()
    assert sorted(path.name for path in (tmp_path / "docs").iterdir()) == [
        "kill-matrix.json",
        "kill-matrix.md",
    ]


def test_a_survivor_makes_the_command_fail(monkeypatch, tmp_path, vectors):
    """A mutant that is none leaves no kill, and the matrix names it."""
    name = "wall-velocity-once"
    monkeypatch.setattr(kill_matrix, "load", lambda level: list(vectors.values())[:3])
    monkeypatch.setattr(kill_matrix, "MUTANTS", {name: MUTANTS[name]._replace(flight=PLAIN.flight)})
    assert kill_matrix.run(tmp_path, tmp_path, lambda line: None) == 1
    assert json.loads((tmp_path / "kill-matrix.json").read_text())["survivors"] == [name]
    text = (tmp_path / "kill-matrix.md").read_text()
    assert "1 mutants" in text
    assert ": 0 killed" in text
