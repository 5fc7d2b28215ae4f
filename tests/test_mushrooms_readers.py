"""Whatever reads a stored run, or a table written from one, refuses it in one line if a file was damaged.

Each kind of file is damaged in each way, and every reader is asked. A reader may also give the numbers of the
whole run: a damaged description is there twice.
"""

import contextlib
import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import zarr
from support.depth import deep_but
from support.options import draw_options
from support.refusals import assert_refused

import fast
import mushrooms
from mushrooms import draw
from mushrooms.audit import ensemble_table
from mushrooms.main import run
from mushrooms.store import export as exports
from mushrooms.store.run import open_run
from scene import BadInput, load, to_data

pytestmark = pytest.mark.usefixtures("unsynced")
ENERGY, SEED, N, BLOCK = 1e4, 3, 60, 20
MAKE = ["simulate", "moving-cap", "--energy", ENERGY, "--seed", SEED, "--particles", N, "--block", BLOCK]


def call(words):
    with pytest.raises(SystemExit) as stop:
        run(list(map(str, words)))
    assert stop.value.code == 0


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return a folder with a finished run and the tables that were exported from it."""
    folder = tmp_path_factory.mktemp("written")
    lines = [
        [*MAKE, "--out", "run"],
        *(["export", "run", "--to", f"run.{kind}"] for kind in ("csv", "parquet")),
    ]
    with contextlib.chdir(folder):
        for words in lines:
            call(words)
    return folder


@pytest.fixture
def here(written, tmp_path, monkeypatch):
    """Stand in a copy of that folder."""
    monkeypatch.chdir(shutil.copytree(written, tmp_path / "here"))


def flipped(content, random):
    at = int(random.integers(len(content)))
    return content[:at] + bytes([content[at] ^ 1 << int(random.integers(8))]) + content[at + 1 :]


def torn(content, random):
    return content[: int(random.integers(len(content)))]


def emptied(_content, _random):
    return b""


def lengthened(content, random):
    return content + random.bytes(7)


def damage(path, how, random):
    """Damage a file; `how` is one of the functions above, "removed", or the file that takes its place."""
    if how == "removed":
        path.unlink()
    elif isinstance(how, str):
        shutil.copy(how, path)
    else:
        path.write_bytes(how(path.read_bytes(), random))


GROUP = "run/ensemble.zarr"
# Files whose damage no reader may pass over, and files of the same kind that may be there by mistake.
NUMBERS = {
    f"{GROUP}/cycle_energies/c/1/0": f"{GROUP}/cycle_energies/c/2/0",
    f"{GROUP}/takes_part/c/1": f"{GROUP}/outcome/c/1",
    f"{GROUP}/t_in/c/1/0/0": f"{GROUP}/t_out/c/1/0/0",
    f"{GROUP}/lanes/c/0/0": f"{GROUP}/lanes/c/1/0",
    "run/blocks/1.marker": "run/blocks/2.marker",
}
# Descriptions: each is there twice, or says nothing of the numbers.
DESCRIPTIONS = {
    "run/blocks/run.marker": "run/blocks/1.marker",
    f"{GROUP}/zarr.json": f"{GROUP}/t/zarr.json",
    f"{GROUP}/cycle_energies/zarr.json": f"{GROUP}/t/zarr.json",
    "run/summary.json": f"{GROUP}/zarr.json",
}
WAYS = (flipped, torn, emptied, "removed", "another")
CASES = [(name, how) for name in (*NUMBERS, *DESCRIPTIONS) for how in WAYS]
QUICK = [case for i, case in enumerate(CASES) if i % 3 == 0 or case[1] == "another"]


def of_dataset(_folder):
    found = exports.open_dataset("run")
    assert found.attrs["energy"] == ENERGY
    return found.cycle_energies.values[:, 0]


def of_csv(folder):
    exports.export_run(exports.ExportOptions(run=Path("run"), to=folder / "again.csv"))
    return np.genfromtxt(folder / "again.csv", delimiter=",", names=True)["cycle_energies_1"]


def of_npz(folder):
    exports.export_run(exports.ExportOptions(run=Path("run"), to=folder / "again.npz"))
    return np.load(folder / "again.npz")["energy"]


def of_audit(path, energy=None):
    def read(_folder):
        options = ensemble_table.Reading(energy, "v2/2", None, None)
        given, _notes = ensemble_table.read(Path(path), load("moving-cap"), options)
        return ENERGY * np.exp(given.s)

    return read


def of_picture(folder):
    drawn = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draw, "draw_energies", lambda _path, _spec, gains, _n: drawn.extend(gains))
        draw.draw_scene(draw_options(scene="run", out=folder / "a.svg"))
    return ENERGY * np.exp(np.concatenate(drawn)[:, 0])


READERS = {
    "open_dataset": of_dataset,
    "export, CSV": of_csv,
    "export, npz": of_npz,
    "draw": of_picture,
    "audit of the folder": of_audit("run"),
    "audit of the group": of_audit(GROUP),
}


@pytest.fixture(scope="module")
def truth():
    """Return the energies that the run has after its cycle."""
    return fast.simulate(load("moving-cap"), n_particles=N, energy=ENERGY, seed=SEED).energy


def is_refused(name, reader, folder, truth):
    """Tell whether a reader refuses a damaged run, in one line; else it must give the numbers of the run."""
    try:
        found = reader(folder)
    except BadInput as error:
        return len(str(error).splitlines()) == 1
    assert np.allclose(found, truth, rtol=1e-12), name
    return False


def named(case):
    path, how = case
    return f"{path}-{how if isinstance(how, str) else how.__name__}"


@pytest.mark.parametrize("case", deep_but(CASES, *QUICK), ids=named)
def test_no_reader_takes_a_damaged_run_for_a_whole_one(here, tmp_path, truth, case):
    path, how = case
    random = np.random.default_rng(CASES.index(case))
    other = {**NUMBERS, **DESCRIPTIONS}[path]
    damage(Path(path), other if how == "another" else how, random)
    refused = [is_refused(name, reader, tmp_path, truth) for name, reader in READERS.items()]
    assert path in DESCRIPTIONS or all(refused)
    if any(refused):  # the run goes on to the same bits
        call([*MAKE, "--out", "run", "--resume"])
    assert np.array_equal(open_run(Path("run")).ensemble(N).energy, truth)


def test_a_group_without_its_checksums_is_refused(here, command_line, tmp_path):
    """Whether it stands where it was made, or was copied elsewhere."""
    shutil.copytree(GROUP, "copy.zarr")
    shutil.rmtree("run/blocks")
    for path in ("run", GROUP, "copy.zarr"):
        audit = ["audit", "--ensemble", path, "--scene", "moving-cap", "--out", tmp_path / "report"]
        assert_refused(command_line(*audit), "checksums", "missing")
    assert not (tmp_path / "report").exists()


@pytest.mark.parametrize("name", ["run.csv", "run.parquet", "run.csv-metadata.json"])
@pytest.mark.parametrize("how", [flipped, torn, emptied, lengthened])
def test_no_reader_takes_a_damaged_table_for_a_whole_one(here, tmp_path, truth, name, how):
    """Of its metadata a table is independent: damage to them may be harmless."""
    random, path = np.random.default_rng(5), name.removesuffix("-metadata.json")
    for _ in range(10):
        before = Path(name).read_bytes()
        damage(Path(name), how, random)
        assert is_refused(name, of_audit(path, ENERGY), tmp_path, truth) or name != "run.csv"
        Path(name).write_bytes(before)


def test_a_zarr_group_of_another_program_that_is_damaged_is_refused(here, command_line, tmp_path):
    group = zarr.open_group("e.zarr", mode="w")
    for name in ("E0", "E1"):
        group.create_array(name, data=np.linspace(1e6, 2e6, 50), chunks=(10,))
    audit = ["audit", "--ensemble", "e.zarr", "--scene", "moving-cap", "--out", tmp_path / "report"]
    Path("e.zarr/E1/c/2").write_bytes(b"torn")
    assert_refused(command_line(*audit), "array 'E1' cannot be read")
    Path("e.zarr/zarr.json").write_bytes(b"{")
    assert_refused(command_line(*audit), "is no Zarr group")


def about(path):
    """Return what goes with an exported table."""
    if path.suffix == ".csv":
        return json.loads(path.with_name(f"{path.name}-metadata.json").read_text())["notes"][0]
    if path.suffix == ".npz":
        return json.loads(str(np.load(path)["about"]))
    found = pyarrow.parquet.read_schema(path).metadata
    texts = {key.decode(): value.decode() for key, value in found.items()}
    return texts | {name: json.loads(texts[name]) for name in ("scene", "energy", "seed")}


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_what_was_run_goes_with_every_table(here, command_line, tmp_path, kind):
    path = tmp_path / f"a.{kind}"
    lines = [["export", "run", "--to", path]]
    if kind != "npz":
        draw_one = ["draw", "moving-cap", "--trajectory", "--collisions", 20, "--out", tmp_path / "a.svg"]
        lines.append([*draw_one, "--energy", ENERGY, "--seed", SEED, "--export", path])
    for line in lines:
        assert command_line(*line).code == 0
        found = about(path)
        assert found["scene"] == json.loads(json.dumps(to_data(load("moving-cap"))))
        assert found["energy"] == pytest.approx(ENERGY, rel=1e-15)
        assert (found["seed"], found["version"]) == (SEED, mushrooms.__version__)
