"""Many machines and other programs: workers that die, xarray, tables, a run killed, a package missing."""

from __future__ import annotations

import csv
import gc
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest
import xarray
from pyarrow import parquet
from support.depth import deep_but
from support.refusals import assert_refused

import fast
from fast.kernel.follow import LANE_ROWS
from mushrooms.main import run
from mushrooms.store import engines
from mushrooms.store.run import DESCRIPTION, GROUP, MARKERS, StoredRun
from scene import load

DOCS = Path(__file__).parent.parent / "docs"
N, ENERGY, SEED = 300, 60.0, 5
RUN = ["simulate", "moving-cap", "--particles", N, "--energy", ENERGY, "--seed", SEED, "--json"]


@pytest.fixture(scope="module")
def ensemble():
    return fast.simulate(load("moving-cap"), n_particles=N, energy=ENERGY, seed=SEED)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Return the folder of a run that keeps energies at phases too."""
    folder = tmp_path_factory.mktemp("stored") / "run"
    with pytest.raises(SystemExit, match="0"):
        run([*map(str, RUN), "--out", str(folder), "--block", "64", "--phases", "0.25,0.5"])
    return folder


def cluster(n_workers, processes):
    return distributed.LocalCluster(
        n_workers=n_workers,
        threads_per_worker=1,
        processes=processes,
        dashboard_address=None,
        worker_dashboard_address=None,
        scheduler_port=0,
    )


@pytest.mark.parametrize("n_workers", deep_but([1, 2, 4], 2))
def test_workers_of_a_cluster_follow_and_lengthen_to_the_same_bits(
    command_line, tmp_path, ensemble, n_workers
):
    with cluster(n_workers, processes=False) as there:
        command = (*RUN, "--out", tmp_path, "--block", 32, "--dask", there.scheduler_address)
        ended = command_line(*command)
        longer = command_line(*command, "--cycles", 2, "--resume")
    assert ended.code == longer.code == 0, ended.err
    assert json.loads(ended.out)["sha256"] == ensemble.sha256()
    wanted = fast.simulate(load("moving-cap"), n_particles=N, energy=ENERGY, n_cycles=2, seed=SEED)
    assert json.loads(longer.out)["sha256"] == wanted.sha256()


@pytest.mark.parametrize("name", ["particles", "command", "phases"])
def test_a_description_that_somebody_changed_is_refused(command_line, tmp_path, stored, name):
    """Its sealed copy is gone; the group's attributes have a seal of their own."""
    path = tmp_path / "run" / GROUP / "zarr.json"
    shutil.copytree(stored, tmp_path / "run")
    (tmp_path / "run" / MARKERS / DESCRIPTION).unlink()
    assert command_line("export", tmp_path / "run", "--to", tmp_path / "run.csv").code == 0
    told = json.loads(path.read_text("utf-8"))
    told["attributes"][name] = -5
    path.write_text(json.dumps(told), "utf-8")
    for command in (
        (*RUN, "--out", tmp_path / "run", "--resume"),
        ("export", tmp_path / "run", "--to", tmp_path / "run.csv"),
    ):
        assert_refused(command_line(*command), "description is damaged")


@pytest.mark.deep
def test_workers_may_die(command_line, tmp_path, ensemble, monkeypatch):
    """One is killed, in the middle of a block most likely; another takes its place."""
    keep, killed = StoredRun.keep, []

    with cluster(2, processes=True) as there:
        pids = [worker.process.pid for worker in there.workers.values()]

        def then_killed(self, block_range, block):
            keep(self, block_range, block)
            if not killed:
                os.kill(pids[0], 9)
                killed.append(pids[0])

        monkeypatch.setattr(StoredRun, "keep", then_killed)
        ended = command_line(*RUN, "--out", tmp_path, "--block", 8, "--dask", there.scheduler_address)
    assert ended.code == 0, ended.err
    assert killed
    assert json.loads(ended.out)["sha256"] == ensemble.sha256()


@pytest.mark.parametrize(
    ("raised", "words"),
    [
        (distributed.comm.CommClosedError("closed"), "the scheduler has gone (CommClosedError)"),
        (RuntimeError("Error during deserialization of the task graph"), "must have this project"),
        (distributed.KilledWorker("follow", None, 0), "workers die of block"),
    ],
)
def test_a_lost_cluster_is_one_line_that_says_how_to_go_on(
    command_line, tmp_path, ensemble, monkeypatch, raised, words
):
    """Dask's own pages came out, with exit code 1."""
    keep, result = StoredRun.keep, distributed.Future.result
    with cluster(1, processes=False) as there:

        def then_lost(self, block_range, block):
            keep(self, block_range, block)
            monkeypatch.setattr(distributed.Future, "result", lost)

        def lost(_future):
            raise raised

        monkeypatch.setattr(StoredRun, "keep", then_lost)
        ended = command_line(*RUN, "--out", tmp_path, "--block", 32, "--dask", there.scheduler_address)
    assert_refused(ended, words, "particles are kept; go on with: mushrooms simulate")
    monkeypatch.setattr(StoredRun, "keep", keep)
    monkeypatch.setattr(distributed.Future, "result", result)
    ended = command_line(*RUN, "--out", tmp_path, "--resume")
    assert json.loads(ended.out)["sha256"] == ensemble.sha256()


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:9", "nonsense://x", "nonsense", "tcp://nonsense", "tcp://127.0.0.1:x"]
)
def test_no_scheduler_is_one_line(capsys, tmp_path, monkeypatch, address):
    """Nor is a client that failed the default of the process: what else uses Dask would wait for it."""
    monkeypatch.setattr(engines, "CONNECT_TIMEOUT", 0.3)
    made = distributed.Client.__init__

    def made_at(client, address, **options):
        assert ":" in address.removeprefix("tcp://"), "a client that was never made whole cannot be closed"
        made(client, address, **options)

    monkeypatch.setattr(distributed.Client, "__init__", made_at)
    with pytest.raises(SystemExit) as ended:
        run([*map(str, RUN), "--out", str(tmp_path), "--dask", address])
    with pytest.raises(ValueError, match="No clients"):
        distributed.default_client()
    assert_refused((ended.value.code, *capsys.readouterr()), f"--dask = {address}", "no scheduler")


def test_xarray_reads_names_and_what_was_run(stored):
    """The bits: test_mushrooms_store.py."""
    run = xarray.open_zarr(stored / "ensemble.zarr")
    sizes = {"particle": N, "cycle": 1, "narrowing": 1, "wall": 5, "row": LANE_ROWS, "phase": 2}
    assert dict(run.sizes) == sizes
    assert run.phase_captured.dims == ("particle", "cycle", "phase")
    assert run.attrs["phases"] == [0.25, 0.5]
    assert (run.attrs["seed"], run.attrs["scene"]["name"]) == (SEED, "moving-cap")
    assert "--seed 5" in run.attrs["command"]
    assert set(run.attrs["versions"]) >= {"oscillating-mushrooms", "numpy", "numba", "python"}


def test_exports_have_every_bit(command_line, stored, tmp_path):
    phases = (0.25, 0.5)
    ensemble = fast.simulate(load("moving-cap"), n_particles=N, energy=ENERGY, seed=SEED, phases=phases)
    for kind in ("csv", "parquet", "npz"):
        ended = command_line("export", stored, "--to", tmp_path / f"run.{kind}")
        assert (ended.code, ended.err) == (0, "")
    with np.load(tmp_path / "run.npz") as arrays:
        for name in ensemble._fields[:-2]:
            assert arrays[name].tobytes() == np.asarray(getattr(ensemble, name)).tobytes()
    table = parquet.read_table(tmp_path / "run.parquet")
    with (tmp_path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == table.num_rows == N
    assert list(rows[0]) == table.column_names
    for name, wanted in (("cycle_energies_1", ensemble.energy), ("t_in_1_1", ensemble.t_in[:, 0, 0])):
        assert table[name].to_numpy().tobytes() == wanted.tobytes()
        assert np.array([float(row[name]) for row in rows]).tobytes() == wanted.tobytes()
    assert [int(row["phase_captured_1_2"]) for row in rows] == ensemble.phase_captured[:, 0, 1].tolist()
    assert [int(row["wall_counts_floor"]) for row in rows] == ensemble.wall_counts[:, 4].tolist()
    assert table["particle"].to_pylist() == list(range(N))


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_an_export_of_a_damaged_block_is_refused_in_a_line(command_line, stored, tmp_path, kind):
    """What pyarrow had begun to write closed itself when nobody held it any more, with a page on stderr."""
    folder, unraised = shutil.copytree(stored, tmp_path / "run"), []
    (folder / GROUP / "cycle_energies" / "c" / "2" / "0").write_bytes(b"")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "unraisablehook", unraised.append)
        ended = command_line("export", folder, "--to", tmp_path / f"run.{kind}")
        gc.collect()
    assert_refused(ended, "missing or damaged")
    assert unraised == []
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize(
    ("package", "extra", "command"),
    [("distributed", "scale", [*RUN, "--dask", "tcp://here:1"]), ("pyarrow", "parquet", ["export"])],
)
def test_a_missing_package_is_one_line(command_line, stored, tmp_path, monkeypatch, package, extra, command):
    monkeypatch.setitem(sys.modules, package, None)
    more = [stored, "--to", tmp_path / "a.parquet"] if command == ["export"] else ["--out", tmp_path / "b"]
    assert_refused(command_line(*command, *more), package, f"pip install 'oscillating-mushrooms[{extra}]'")
    assert list(tmp_path.iterdir()) == []


def test_a_stored_run_is_drawn_as_when_it_was_made(command_line, stored, tmp_path):
    ended = command_line("draw", stored, "--out", tmp_path / "a.svg")
    assert (ended.code, ended.out) == (0, f"{tmp_path / 'a.svg'}\n")
    assert command_line(*RUN, "--plot", tmp_path / "b.svg").code == 0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert_refused(command_line("draw", stored, "--out", tmp_path / "a.gif"), ".svg, .png")


@pytest.mark.parametrize(
    "options",
    [
        ["--trajectory"],
        ["--map"],
        ["--export", "a.csv"],
        ["--energy", 5],
        ["--seed", 0],
        ["--particles", 3],
    ],
)
def test_of_a_stored_run_only_its_histogram_is_drawn(command_line, stored, tmp_path, options):
    refused = command_line("draw", stored, "--out", tmp_path / "a.svg", *options)
    assert_refused(refused, options[0], "would change nothing here", "is a run")
    assert list(tmp_path.iterdir()) == []


def test_an_unfinished_run_is_neither_exported_nor_drawn(command_line, stored, tmp_path):
    path = stored / "blocks" / "1.marker"
    content = path.read_bytes()
    path.unlink()
    try:
        words = [f"has {N - 64} of {N} particles", "--resume"]
        assert_refused(command_line("export", stored, "--to", tmp_path / "a.csv"), *words)
        assert_refused(command_line("draw", stored, "--out", tmp_path / "a.svg"), *words)
    finally:
        path.write_bytes(content)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.deep
def test_a_run_killed_at_random_moments_goes_on_to_the_same_bits(tmp_path):
    """Processes are killed (SIGKILL) while they follow, and lengthen, a run; then one is left to finish."""
    scene, random = "fermi-ulam", np.random.default_rng(1)
    options = ["--particles", "1500", "--energy", "1e3", "--block", "20", "--threads", "1", "--resume"]
    wanted = fast.simulate(load(scene), n_particles=1500, energy=1e3, n_cycles=2).sha256()
    command = [sys.executable, "-m", "mushrooms", "simulate", scene, *options, "--json"]
    for number in range(int(os.environ.get("MUSHROOMS_KILLS", "2"))):
        place = ["--out", str(tmp_path / str(number // 5)), "--cycles", str(1 + (number % 5 > 2))]
        child = subprocess.Popen([*command, *place], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(random.uniform(1.0, 4.0))  # its start takes a second
        child.kill()
        child.wait()
    for folder in tmp_path.iterdir():
        place = ["--out", str(folder), "--cycles", "2"]
        done = subprocess.run([*command, *place], capture_output=True, text=True, check=True)
        assert json.loads(done.stdout)["sha256"] == wanted


def test_the_page_s_python_plots_a_histogram(stored, monkeypatch, ensemble):
    """A few lines, run where the page says, on a run that is there; p_nc is that of the ensemble."""
    text = (DOCS / "ensembles.md").read_text("utf-8")
    (snippet,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert sum(map(bool, snippet.splitlines())) < 9
    monkeypatch.chdir(stored.parent)
    names = dict[str, Any]()
    exec(snippet, names)
    assert names["p_nc"].values == pytest.approx(ensemble.p_nc())
    assert (stored.parent / "histogram.png").stat().st_size > 5000
