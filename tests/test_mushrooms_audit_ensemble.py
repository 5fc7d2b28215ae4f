"""`mushrooms audit --ensemble`: a right ensemble passes, wrong ones are refuted with the likely cause."""

import json

import numpy as np
import pyarrow
import pytest
import zarr
from pyarrow import parquet
from support import practice_engine
from support.depth import deep_among
from support.refusals import assert_refused

import scene as scenes
import theory
from mushrooms.audit import ensemble_command, ensemble_table
from mushrooms.audit.ensemble_checks import GivenEnsemble, HighEnergies, checks, expected, reversal
from mushrooms.audit.ensemble_table import Reading

N = 2_500
# Ensembles that take longest.
LONG = ("wrong sign of the wall's speed", "misprinted protocol", "slope 1/9")
# Of mistakes that few particles show.
FEW = {"wrong sign of the wall's speed": 400, "starts on the wall": 400, "half a period": 400}
SCENE = scenes.load("moving-cap")
PLAIN = Reading(practice_engine.ENERGY, "v2/2", None, None)
# What the report says of each of `practice_engine.ENSEMBLES`; nothing of those that pass.
CAUSES = {
    "right": "",
    "no stays told": "",
    "leaks at the mouth's corners": "as where its corners leak",
    "energies in single precision": "single precision (binary32)",
    "wrong sign of the wall's speed": "with the wall's speed u taken once, or with the wrong sign",
    "captured particles dropped": "captured particles were dropped",
    "E in place of log E": "E1/E0 is given in place of its logarithm",
    "starts on the wall": "starts are not uniform in area",
    "misprinted protocol": "the loop encloses nothing",
    "half a period": "many captures end together at 0.500 of the cycle",
    "energies exchanged": "E0 and E1 are exchanged",
    "logarithms to base 10": "base 10",
    "gains of speeds": "speeds are given",
    "gains less 1": "E1/E0 - 1 is given",
    "slope 1/9": "",  # moves m1 by 7e-6, which 1e11 particles would show
}


def write(path, columns):
    np.savetxt(
        path, np.column_stack([*columns.values()]), "%.17g", ",", header=",".join(columns), comments=""
    )
    return path


@pytest.fixture(scope="module")
def right():
    return practice_engine.ensemble(N, 41)


@pytest.mark.parametrize("name", deep_among(practice_engine.ENSEMBLES, *LONG))
def test_a_mistake_is_refuted_and_its_cause_is_named(name, tmp_path, right):
    switches, write_down = practice_engine.ENSEMBLES[name]
    columns = write_down(
        practice_engine.ensemble(FEW.get(name, N), 41, **switches) if switches else dict(right)
    )
    result = ensemble_command.examine(write(tmp_path / "e.csv", columns), SCENE, None, PLAIN)
    assert result.verdict == ("refuted" if CAUSES[name] else "confirmed"), result.checks
    assert CAUSES[name] in " ".join(result.causes)
    assert bool(result.causes) == bool(CAUSES[name])


def test_missing_particles_are_told_from_wrong_physics(tmp_path, right):
    kept = {name: column[: N - 200] for name, column in right.items()}
    path = write(tmp_path / "e.csv", kept)
    result = ensemble_command.examine(path, SCENE, None, PLAIN._replace(particles=N))
    assert [check.what for check in result.checks if check.holds is False] == ["every particle has an energy"]
    assert "8.0% of the particles are missing" in result.causes[0]


def test_a_seeded_sample_of_theory_passes_in_other_units_and_forms(tmp_path, right):
    cycles = {**right, "t_in": right["t_in"] / (2 * np.pi), "t_out": right["t_out"] / (2 * np.pi)}
    doubled = {**cycles, "E0": 2 * cycles["E0"], "E1": 2 * cycles["E1"]}
    options = Reading(None, "v2", None, None)
    given, notes = ensemble_table.read(write(tmp_path / "e.csv", doubled), SCENE, options)
    here, _ = ensemble_table.read(write(tmp_path / "f.csv", right), SCENE, PLAIN)
    assert given.energy == practice_engine.ENERGY
    assert "times are taken as parts of a cycle, inferred" in notes
    assert np.nanmax(np.abs(given.t_in - here.t_in)) < 1e-12
    parquet.write_table(pyarrow.table(right), tmp_path / "e.parquet")
    group = zarr.open_group(tmp_path / "e.zarr", mode="w")
    for name, column in right.items():
        group.create_array(name, data=column)
    cells = [["" if np.isnan(x) else float(x).hex() for x in column] for column in right.values()]
    (tmp_path / "hex.csv").write_text("\n".join(map(",".join, [list(right), *zip(*cells, strict=True)])))
    for form in ("e.parquet", "e.zarr", "hex.csv"):
        same, _ = ensemble_table.read(tmp_path / form, SCENE, PLAIN)
        assert np.array_equal(same.s, here.s)
        assert np.array_equal(same.t_out, here.t_out, equal_nan=True)


def test_a_parquet_column_that_stands_twice_is_refused_by_name(tmp_path, command_line):
    energies = pyarrow.array([1e4, 2e4])
    table = pyarrow.Table.from_arrays([energies] * 3, names=["E0", "E1", "E1"])
    parquet.write_table(table, tmp_path / "e.parquet")
    audit = ["audit", "--scene", "moving-cap", "--out", tmp_path / "report", "--ensemble"]
    ended = command_line(*audit, tmp_path / "e.parquet")
    assert_refused(ended, "e.parquet': column 'E1' stands twice")
    assert not (tmp_path / "report").exists()


def test_further_cycles_are_held_to_sums(tmp_path):
    """Sums of cycles drawn from theory pass; an engine that begins each cycle anew at E0 is refuted."""
    s = theory.at_energy(SCENE, 1e6).draw(3, 20_000, 5)
    for later, verdict in ((s, "confirmed"), (np.diff(s, axis=1, prepend=0.0), "refuted")):
        energies = {f"E{k + 1}": 1e6 * np.exp(later[:, k]) for k in (2, 0, 1)}
        path = write(tmp_path / "e.csv", {"E0": np.full(len(s), 1e6), **energies})
        result = ensemble_command.examine(path, SCENE, None, PLAIN._replace(energy=None))
        assert result.verdict == verdict, result.checks
        assert {"log E2/E0", "mean of log E3/E0"} <= {check.what for check in result.checks}


def test_both_directions_are_held_to_the_reversal_identity():
    there = scenes.load("moving-cap-reversed")
    here, back = (
        GivenEnsemble(scene, 1e6, theory.at_energy(scene, 1e6).draw(1, 5_000, seed)[:, 0])
        for scene, seed in ((SCENE, 1), (there, 2))
    )
    theirs = expected(SCENE, 1e6)
    assert reversal(here, back, theirs).holds
    assert reversal(here, here, theirs).holds is False


def test_a_scene_without_rates_leaves_open_what_it_cannot_tell():
    scene = scenes.Mushroom(
        r=1.0, h=scenes.Fourier(1.0, 1.0, (), (0.3,)), nu=scenes.Fourier(0.7, 1.0, (0.3,))
    )
    theirs = expected(scene, 1e6)
    assert isinstance(theirs, HighEnergies)
    assert 0 < theirs.theory_error.mean_s < 0.1
    s = np.random.default_rng(0).normal(theirs.mean_s, 0.1, 500)
    assert {check.holds for check in checks(GivenEnsemble(scene, 1e6, s), theirs)} <= {True, False, None}


def test_the_command_writes_a_page(tmp_path, right, command_line):
    path = write(tmp_path / "e.csv", right)
    out = tmp_path / "report"
    audit = ["audit", "--scene", "moving-cap", "--out", out, "--ensemble"]
    code, printed, err = command_line(*audit, path)
    assert (code, err) == (0, "")
    assert "holds  m1" in printed
    assert json.loads((out / "report.json").read_text())["verdict"] == "confirmed"
    page = (out / "report.html").read_text()
    assert page.count("<img") == 2
    assert "confirmed" in page
    path.write_text("E0,E1\n1,2\n1,3\n")  # two particles, too slow for any theory
    assert command_line(*audit, path).code in (0, 1)
