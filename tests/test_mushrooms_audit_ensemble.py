"""`mushrooms audit --ensemble`: a right ensemble passes, wrong ones are refuted with the likely cause."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support import practice_engine
from support.refusals import assert_refused

import scene as scenes
import theory
from conformance.audit.ensemble import GivenEnsemble, HighEnergies, checks, expected, reversal
from mushrooms import audit_ensemble
from mushrooms.audit_ensemble import Options

N = 2_500
SCENE = scenes.load("moving-cap")
PLAIN = Options(practice_engine.ENERGY, "v2/2", None, None)
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


def test_every_mistake_has_its_cause():
    assert set(CAUSES) == set(practice_engine.ENSEMBLES)


@pytest.mark.parametrize("name", CAUSES)
def test_a_mistake_is_refuted_and_its_cause_is_named(name, tmp_path, right):
    switches, write_down = practice_engine.ENSEMBLES[name]
    n = 400 if "has_wrong_sign" in switches else N
    columns = write_down(practice_engine.ensemble(n, 41, **switches) if switches else dict(right))
    result = audit_ensemble.examine(write(tmp_path / "e.csv", columns), SCENE, None, PLAIN)
    assert result.verdict == ("refuted" if CAUSES[name] else "confirmed"), result.checks
    assert CAUSES[name] in " ".join(result.causes)
    assert bool(result.causes) == bool(CAUSES[name])


def test_other_mistakes_of_the_pen_are_named(tmp_path, right):
    gain = np.log(right["E1"] / right["E0"])
    said = {"E0 and E1 are exchanged": -gain, "base 10": gain / np.log(10), "speeds are given": gain / 2}
    said |= {"E1/E0 - 1 is given": np.expm1(gain)}
    for words, s in said.items():
        result = audit_ensemble.examine(write(tmp_path / "s.csv", {"s": s}), SCENE, None, PLAIN)
        assert result.verdict == "refuted"
        assert words in " ".join(result.causes)


def test_missing_particles_are_told_from_wrong_physics(tmp_path, right):
    kept = {name: column[: N - 200] for name, column in right.items()}
    path = write(tmp_path / "e.csv", kept)
    result = audit_ensemble.examine(path, SCENE, None, PLAIN._replace(particles=N))
    assert [check.what for check in result.checks if check.holds is False] == ["every particle has an energy"]
    assert "8.0% of the particles are missing" in result.causes[0]


def test_a_seeded_sample_of_theory_passes_in_other_units_and_forms(tmp_path, right):
    cycles = {**right, "t_in": right["t_in"] / (2 * np.pi), "t_out": right["t_out"] / (2 * np.pi)}
    doubled = {**cycles, "E0": 2 * cycles["E0"], "E1": 2 * cycles["E1"]}
    options = Options(None, "v2", None, None)
    given, notes = audit_ensemble.read(write(tmp_path / "e.csv", doubled), SCENE, options)
    here, _ = audit_ensemble.read(write(tmp_path / "f.csv", right), SCENE, PLAIN)
    assert given.energy == practice_engine.ENERGY
    assert "times are taken as parts of a cycle, inferred" in notes
    assert np.nanmax(np.abs(given.t_in - here.t_in)) < 1e-12
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table(right), tmp_path / "e.parquet")
    zarr = pytest.importorskip("zarr")
    group = zarr.open_group(tmp_path / "e.zarr", mode="w")
    for name, column in right.items():
        group.create_array(name, data=column)
    for form in ("e.parquet", "e.zarr"):
        same, _ = audit_ensemble.read(tmp_path / form, SCENE, PLAIN)
        assert np.array_equal(same.s, here.s)
        assert np.array_equal(same.t_out, here.t_out, equal_nan=True)
    text = (tmp_path / "f.csv").read_text().splitlines()
    rows = [
        ",".join(float(cell).hex() if cell != "nan" else "" for cell in row.split(",")) for row in text[1:]
    ]
    (tmp_path / "hex.csv").write_text("\n".join([text[0], *rows]))
    same, _ = audit_ensemble.read(tmp_path / "hex.csv", SCENE, PLAIN)
    assert np.array_equal(same.s, here.s)


def test_further_cycles_are_held_to_sums(tmp_path):
    """Sums of cycles drawn from theory pass; an engine that begins each cycle anew at E0 is refuted."""
    s = theory.at_energy(SCENE, 1e6).draw(3, 20_000, 5)
    for later, verdict in ((s, "confirmed"), (np.diff(s, axis=1, prepend=0.0), "refuted")):
        energies = {f"E{k + 1}": 1e6 * np.exp(later[:, k]) for k in (2, 0, 1)}
        path = write(tmp_path / "e.csv", {"E0": np.full(len(s), 1e6), **energies})
        result = audit_ensemble.examine(path, SCENE, None, PLAIN._replace(energy=None))
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
    code, printed, err = command_line("audit", "--ensemble", path, "--scene", "moving-cap", "--out", out)
    assert (code, err) == (0, "")
    assert "holds  m1" in printed
    assert json.loads((out / "report.json").read_text())["verdict"] == "confirmed"
    page = (out / "report.html").read_text()
    assert page.count("<img") == 2
    assert "confirmed" in page


def table(header="E0,E1", *rows):
    return "\n".join([header, *(rows or ["1e4,2e4", "1e4,3e4"])])


BAD = {
    "missing file": (None, [], "No such file"),
    "other ending": ("e.txt", [], "must be a .csv or .parquet file"),
    "empty": ("", [], "column 'E1' is missing"),
    "header only": ("E0,E1\n", [], "0 energies, must be 2 or more"),
    "one row": (table("E0,E1", "1e4,2e4"), [], "1 energies, must be 2 or more"),
    "no E1": (table("E0,x"), [], "column 'E1' is missing, as is 's'; it has E0, x"),
    "E1 twice": (table("E1,E1"), [], "column 'E1' stands twice"),
    "no E0": (table("N,E1"), [], "column 'E0' is missing, and so is --energy"),
    "text": (table("E0,E1", "1e4,2e4", "1e4,north"), [], "e.csv':3: E1 = 'north', must be a finite number"),
    "infinite": (table("E0,E1", "1e4,2e4", "1e4,1e999"), [], "0 energies")
    and ("E0,E1\n1e4,0x1p\n", [], "E1 = '0x1p'"),
    "short row": (table("E0,E1,t_in", "1e4,2e4,1", "1e4,x"), [], "2 cells, must be 3"),
    "negative E0": (table("E0,E1", "-1,2", "-1,3"), [], "E0 = -1.0, must be finite and > 0"),
    "nan E0": (table("E0,E1", "nan,2", "nan,3"), [], "E0 = nan, must be finite and > 0"),
    "two energies": (
        table("E0,E1", "1e4,2e4", "1e5,2e5"),
        [],
        "E0 takes several values, 10000 and 100000 among them",
    ),
    "many energies": (
        table("E0,E1", *(f"{k},1" for k in range(1, 40))),
        [],
        "E0 takes several values, 1 and 2 among them",
    ),
    "no such energy": (table(), ["--energy", "7"], "0 energies, must be 2 or more"),
    "energy 0": (table(), ["--energy", "0"], "'--energy': 0.0, must be finite and > 0"),
    "odd flag": (table("E0,E1,captured", "1e4,2e4,2", "1e4,2e4,0"), [], "captured = 2.0, must be 0 or 1"),
    "late times": (
        table("E0,E1,t_in", "1e4,2e4,99", "1e4,3e4,98"),
        [],
        "t_in = 98 to 99, must be in the cycle",
    ),
    "unknown unit": (table(), ["--energy-unit", "eV"], "--energy-unit = 'eV', must be one of v2/2, v2"),
    "unknown time": (table(), ["--time-unit", "s"], "--time-unit = 's', must be one of scene, cycles"),
    "few particles": (table(), ["--particles", "1"], "--particles = 1, must be at least the 2 rows"),
    "unknown scene": (table(), ["--scene", "nowhere"], "nowhere"),
    "static scene": (table(), ["--scene", "frozen-mushroom"], "must be a mushroom that moves"),
    "no mushroom": (table(), ["--scene", "breathing-circle"], "must be a mushroom that moves"),
    "too slow": (table("E0,E1", "1,2", "1,3"), [], None),
    "--full": (table(), ["--full"], "--full"),
    "--only": (table(), ["--only", "X2"], "--only"),
    "no parquet": ("e.parquet", [], "Parquet"),
    "no zarr": ("e.zarr", [], "is no Zarr group"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(name, tmp_path, command_line):
    content, options, message = BAD[name]
    is_name = content in ("e.txt", "e.parquet", "e.zarr")
    path = tmp_path / (content if is_name else "e.csv")
    if content is not None:
        path.write_text("x" if is_name else content)
    scene = [] if "--scene" in options else ["--scene", "moving-cap"]
    out = tmp_path / "report"
    result = command_line("audit", "--ensemble", path, *scene, *options, "--out", out)
    if message is None:
        assert result.code in (0, 1)
    else:
        assert_refused(result, message)
        assert not (out / "report.json").exists()


def test_options_of_an_ensemble_need_one(command_line, tmp_path):
    assert_refused(command_line("audit", "--scene", "moving-cap", "--out", tmp_path / "r"), "no --ensemble")
    assert_refused(command_line("audit", "--ensemble", "e.csv", "--out", tmp_path / "r"), "needs --scene")
