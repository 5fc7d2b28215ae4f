"""Every mutant is killed by the vectors that the published kill matrix names for it; plain by none."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from conformance.mutants import MUTANTS, kill_matrix
from conformance.mutants.kill_matrix import PLAIN, is_plain_at, kills, table, verdict
from conformance.vectors import load, manifest

DOCS = Path(__file__).parent.parent / "docs"
PUBLISHED = json.loads((kill_matrix.DATA / "kill-matrix.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def vectors():
    return {vector.id: vector for vector in load("stress")}


def test_there_are_many_mutants_and_none_survives():
    assert len(MUTANTS) >= 100
    assert set(PUBLISHED["mutants"]) == set(MUTANTS)
    assert PUBLISHED["survivors"] == []
    assert PUBLISHED["plain_fails"] == []
    killed = PUBLISHED["killed_by"].values()
    for name, entry in PUBLISHED["mutants"].items():
        assert entry["kills"] == sum(name in killers for killers in killed) >= kill_matrix.LEAST_KILLS, name


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
        assert verdict(PLAIN, vectors[witness]) in ("pass", "declined"), witness


def test_plain_fails_no_vector(vectors):
    """A sample here; the published run looked at all. It declines what is degenerate, and nothing else."""
    verdicts = {(vector.level, verdict(PLAIN, vector)) for vector in list(vectors.values())[::8]}
    assert {found for _, found in verdicts} <= {"pass", "declined"}
    assert {level for level, found in verdicts if found == "declined"} <= {"stress"}


def test_a_sample_of_the_matrix_is_reproduced(vectors):
    sample = list(vectors.values())[::40]
    for name in (
        "wall-velocity-once",
        "mouth-tested-at-departure",
        "harmonics-ignored",
        "periods-towards-zero",
    ):
        published = [v.id for v in sample if name in PUBLISHED["killed_by"][v.id]]
        assert kills(sample, MUTANTS[name]) == published
    flows = [vector for vector in vectors.values() if vector.kind == "flow"][::4]
    for name in ("captured-by-velocity-after", "stay-cut-at-free-hit", "energy-frozen-after-fifty-hits"):
        published = [v.id for v in flows if name in PUBLISHED["killed_by"][v.id]]
        assert kills(flows, MUTANTS[name]) == published


@pytest.mark.deep
def test_the_least_killed_are_killed_again_five_times(vectors):
    """By the vectors that the matrix names: it is not taken at its word where there is least to spare."""
    least = sorted(MUTANTS, key=lambda name: PUBLISHED["mutants"][name]["kills"])[:10]
    for name in least:
        killing = [vectors[v] for v, killers in PUBLISHED["killed_by"].items() if name in killers][:5]
        assert [verdict(MUTANTS[name], vector) for vector in killing] == ["fail"] * 5, name


def test_what_is_not_asked_is_answered_as_plain_does(vectors):
    """The matrix asks a mutant only where its fault is used."""
    rng = random.Random(20)
    for name, mutant in rng.sample(sorted(MUTANTS.items()), 30):
        passed = [vector for vector in vectors.values() if is_plain_at(mutant, vector)]
        for vector in rng.sample(passed, min(len(passed), 10)):
            assert verdict(mutant, vector) == verdict(PLAIN, vector), (name, vector.id)


def test_a_crash_is_no_kill(vectors):
    class Breaks(PLAIN.flight):
        def outcome(self):
            raise ZeroDivisionError

    sample = [v for v in list(vectors.values())[:50] if v.kind == "step"]
    mutant = PLAIN._replace(name="breaks", flight=Breaks)
    assert {verdict(mutant, vector) for vector in sample} == {"crashed"}
    assert kills(sample, mutant) == []


def test_the_command_writes_both_files_and_judges(monkeypatch, tmp_path, vectors):
    sample = [vectors[v] for v, killers in PUBLISHED["killed_by"].items() if "base-closed" in killers][:5]
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
    monkeypatch.setattr(kill_matrix, "load", lambda level: sample[:4])
    assert kill_matrix.run(tmp_path / "docs", tmp_path / "docs", lines.append) == 1
    assert lines[-2] == "killed by fewer than 5: base-closed"


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
