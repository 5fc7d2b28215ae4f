"""`simulate`: time, theory beside results, folders that are held; clusters, exports and other programs."""

import errno
import gc
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import weakref
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest
from pyarrow import parquet
from support.depth import deep_but
from support.refusals import assert_refused

import fast
import theory
from fast.kernel.follow import LANE_ROWS
from mushrooms import progress
from mushrooms.audit import ensemble_table
from mushrooms.audit.ensemble_table import Reading
from mushrooms.folders import LOCK, locked
from mushrooms.main import run
from mushrooms.store import conduct
from mushrooms.store.run import DESCRIPTION, GROUP, MARKERS, StoredRun
from mushrooms.store.spec import RunSpec, shape_of
from mushrooms.store.summary import (
    Gain,
    begins_widest,
    expected_collisions,
    explain_limit,
    gain_of,
    measured,
)
from scene import Fourier, Mushroom, load
from scene.named import SCENES

IN_MEMORY = ["simulate", "moving-cap", "--particles", 60, "--energy", 1e4, "--threads", 1, "--json"]


@pytest.mark.parametrize(
    ("name", "energy", "n_cycles"),
    [("moving-cap", 1e5, 1), ("moving-cap", 1e4, 5), ("fermi-ulam", 1e4, 3), ("ergodic", 1e5, 2)],
)
def test_expected_collisions_are_within_a_fifth(name, energy, n_cycles):
    scene = load(name)
    found = fast.simulate(scene, n_particles=200, energy=energy, n_cycles=n_cycles, seed=1)
    assert 0.8 < expected_collisions(scene, energy, n_cycles) / found.n_collisions.mean() < 1.25


def test_the_mean_time_between_collisions_is_that_of_the_table(command_line):
    """A particle in an area A with walls of length P meets them every pi A / (P v); here nothing moves."""
    run = ["simulate", "frozen-mushroom", "--particles", 400, "--energy", 1e4, "--seed", 1, "--json"]
    found = command_line(*run).data()
    wanted = 1 / expected_collisions(load("frozen-mushroom"), 1e4, 1)
    assert found["collision_time"] == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize(
    ("seconds", "per_thousand", "said"),
    [(5.0, 3, "0.003 of the collisions, some 13% of the time"), (5.0, 2, ""), (0.5, 3, "")],
)
def test_careful_steps_are_told_of_where_they_took_the_time(
    command_line, monkeypatch, seconds, per_thousand, said
):
    run = fast.simulate(load("moving-cap"), n_particles=40, energy=1e4, threads=1)
    n_careful = np.array([run.n_collisions.sum() * per_thousand // 1000])
    run = run._replace(seconds=seconds, n_careful=n_careful)
    monkeypatch.setattr(fast, "simulate", lambda *_args, **_options: run)
    ended = command_line(*IN_MEMORY)
    assert ended.data()["careful"] == run.n_careful.sum()
    assert (said in ended.err) if said else ended.err == ""


def gain(values):
    return gain_of(lambda: [values[:, None]])


@pytest.mark.parametrize("n_cycles", [1, 4])
@pytest.mark.parametrize("energy", [1e5, 1e7])  # at 1e4 theory leaves out as much as the directions differ by
def test_energies_drawn_from_theory_agree_with_it(n_cycles, energy):
    """And those of the reversed cycle do not."""
    n, pulls = 100_000, {}
    for name in ("moving-cap", "moving-cap-reversed"):
        found = theory.at_energy(load(name), energy)
        gains = found.draw(n_cycles, n, 5)[:, -1]
        captured = round((1 - found.p_nc) * n * n_cycles)
        beside = measured(RunSpec(load("moving-cap"), energy, n_cycles, 1), captured, gain(gains))
        assert beside["m1"] == pytest.approx(gains.mean() / n_cycles)
        assert beside["m1_se"] == pytest.approx(gains.std(ddof=1) / np.sqrt(n) / n_cycles)
        pulls[name] = abs(beside["m1_z"])
    assert pulls["moving-cap"] < 3.5
    assert pulls["moving-cap-reversed"] > 3.5


def turned(phase):
    """Return a mushroom whose cycle begins at a phase of its mouth's, the widest at 0."""

    def law(mean, amplitude, lag):
        cos, sin = amplitude * np.cos(phase - lag), -amplitude * np.sin(phase - lag)
        return Fourier(mean=mean, omega=1.0, cos=(float(cos),), sin=(float(sin),))

    return Mushroom(r=1.0, h=law(1.2, 0.5, 1.2), nu=law(0.55, 0.4, 0.0), slope=0.1)


@pytest.mark.parametrize("phase", [0.0, *np.random.default_rng(23).uniform(0.1, 6.1, 6), 2 * np.pi])
def test_theory_stands_beside_cycles_that_begin_where_its_own_do(phase):
    beside = measured(RunSpec(turned(phase), 1e6, 1, 1), 0, Gain())
    assert (
        (beside["p_nc_theory"] is not None) == (beside["m1_theory"] is not None) == (phase in (0, 2 * np.pi))
    )


@pytest.mark.parametrize("name", [name for name in SCENES if isinstance(SCENES[name], Mushroom)])
def test_the_audits_cycles_begin_where_theorys_do(name):
    assert begins_widest(SCENES[name])


def test_a_cycle_that_begins_at_a_narrow_mouth_is_another_one():
    """Whoever starts in what opens later counts as captured; the next cycle does not know of it."""
    found = fast.simulate(turned(3.0), n_particles=1500, energy=1e6, n_cycles=2, seed=1)
    wanted = float(theory.predict(turned(3.0), 6).p_nc)
    error = np.sqrt(wanted * (1 - wanted) / 1500)
    first, second = np.abs(found.p_nc() - wanted) / error
    assert first > 10
    assert second < 4


NEVER_NARROWS = Mushroom(r=1.0, h=Fourier(mean=1.0, omega=1.0, sin=(0.5,)), nu=0.5, slope=0.1)


NOT_KNOWN = dict.fromkeys(("m1", "m1_se", "m1_theory", "m1_z", "p_nc", "p_nc_se", "p_nc_theory", "p_nc_z"))


@pytest.mark.parametrize(
    ("scene", "captured", "gains", "wanted"),
    [
        # The limit of high energies has no z.
        (
            *(load("untilted"), 60, np.linspace(-1, 1, 100)),
            {"m1_theory": 0.19134361, "m1_z": None, "p_nc": 0.4, "p_nc_se": 0.24**0.5 / 10, "p_nc_z": None},
        ),
        (load("breathing-circle"), 0, np.empty(0), NOT_KNOWN),
        # A share of particles that were all alike has an error, unless it is known: of twenty that are free,
        # where one in 300 is captured, none is.
        (turned(0.0), 0, np.linspace(-1, 1, 20), {"p_nc": 1.0, "p_nc_se": 1 / 21}),
        (turned(0.0), 20, np.linspace(-1, 1, 20), {"p_nc": 0.0, "p_nc_se": 1 / 21}),
        (NEVER_NARROWS, 0, np.linspace(-1, 1, 20), {"p_nc": 1.0, "p_nc_se": 0.0}),
    ],
)
def test_what_is_measured_has_errors_and_z_where_they_are_known(scene, captured, gains, wanted):
    found = measured(RunSpec(scene, 1e4, 1, 1), captured, gain(gains))
    for name, value in wanted.items():
        assert found[name] == (value if value is None else pytest.approx(value)), name


@pytest.mark.parametrize("n", [1, 100])  # one particle's m1 has no error, and so no z
@pytest.mark.parametrize(
    ("scene", "told"),
    [
        (load("moving-cap"), ""),  # theory is of that energy
        (load("frozen-mushroom"), ""),  # nothing moves: at any energy
        (load("untilted"), "the limit of high energies; what is left at this one is not known"),
        (turned(0.0), "the limit of high energies; what is left at this one is not known"),
        (turned(1.0), "none, for the cycle begins at t = 0 with its mouth at"),
    ],
)
def test_theory_that_is_the_limit_says_so(scene, told, n):
    spec = RunSpec(scene, 1e6, 1, 1)
    line = explain_limit(spec, measured(spec, 0, gain(np.linspace(-1, 1, n)))) or ""
    assert told in line
    assert bool(told) == bool(line)
    if "shift" in line:
        shift = float(line.split("shift all laws by ")[1].split()[0])
        assert begins_widest(turned(1.0 - shift))


def test_a_mean_has_the_same_bits_in_blocks_of_any_size_and_order():
    random = np.random.default_rng(2)
    gains = random.normal(0.1, 0.4, 5000) * 10.0 ** random.integers(-5, 2, 5000)
    found, plain = set(), set()
    for _ in range(5):
        parts = np.split(random.permutation(gains)[:, None], np.sort(random.integers(0, 5001, 7)))
        found.add(gain_of(lambda parts=parts: parts))
        plain.add(float(np.cumsum(np.concatenate(parts))[-1]))
    assert len(plain) > 1  # a faulty mean, of plain sums, would be found out
    [gain] = found
    assert gain.mean == float(sum(map(Fraction, gains.tolist())) / 5000)
    assert gain.standard_error == pytest.approx(gains.std(ddof=1) / 5000**0.5, rel=1e-12)


@pytest.mark.parametrize(
    ("gains", "wanted"),
    [([], (0, None, None)), ([0.5], (1, 0.5, None)), ([1.0, -np.inf], (2, None, None))],
)
def test_a_mean_that_nobody_knows_is_none(gains, wanted):
    assert gain_of(lambda: [np.array(gains).reshape(-1, 1)]) == wanted


def test_a_block_is_reported_at_once_and_two_are_in_memory(tmp_path, monkeypatch):
    """Not when it has been written: progress would fall back by a block."""
    begun, told, kept = [], [], []
    spec = RunSpec(load("fermi-ulam"), 1e3, 1, 0)

    def engine(_spec, block_ranges, _on_progress):
        for number, block_range in enumerate(block_ranges):
            block = fast.go_on(spec.scene, n_particles=3, energy=1e3)
            begun.append(weakref.ref(block.lanes))
            assert told == list(range(3, 3 * number + 1, 3))
            assert sum(ref() is not None for ref in begun) <= 2
            yield block_range, block
            del block

    def keep(_run, block_range, _block):
        time.sleep(0.01)
        kept.append(block_range.number)

    monkeypatch.setattr(StoredRun, "keep", keep)
    run = StoredRun(tmp_path, spec, shape_of(spec, 18, 3), "")
    conduct.complete(run, engine, told.append)
    assert kept == list(range(6))
    assert told == [3, 6, 9, 12, 15, 18]


def test_progress_tells_the_time_left(capsys, monkeypatch):
    """From the first call on: what was there before took no time."""
    now = iter(range(7000, 10**6, 60))  # a clock begins anywhere
    monkeypatch.setattr(progress, "CLOCK", lambda: float(next(now)))
    with progress.progress_bar() as bar:
        watch = progress.Watch(bar, "run", "particles")
        for n_done in (500, 1000, 1500, 1900):
            watch.update(n_done, 2000)
    told = (
        "run: 1,000 of 2,000 particles, 2 minutes left\n"
        "run: 1,500 of 2,000 particles, 60 seconds left\n"
        "run: 1,900 of 2,000 particles, 13 seconds left\n"
    )
    assert capsys.readouterr().err == told


def test_a_full_disk_is_told_of_the_lock_that_it_does_not_take_and_of_no_other(tmp_path, monkeypatch):
    def full(_descriptor=0, _content=b""):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match="No space left") as refusal, locked(tmp_path):
        full()
    assert refusal.value.filename is None
    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space left") as refusal, locked(tmp_path):
        pass
    assert refusal.value.filename == str(tmp_path / LOCK)
    assert list(tmp_path.iterdir()) == []


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


@pytest.fixture(scope="module", autouse=True)
def _taken_port():
    """Take the port that Dask's servers ask for by default, as another cluster on this machine does."""
    with socket.socket() as taken:
        with suppress(OSError):  # another has it
            taken.bind(("127.0.0.1", 8787))
            taken.listen()
        yield


def cluster(n_workers, processes):
    """Return a cluster on free ports. Without an address its servers would ask for port 8787."""
    return distributed.LocalCluster(
        n_workers=n_workers,
        threads_per_worker=1,
        processes=processes,
        dashboard_address="127.0.0.1:0",
        worker_dashboard_address="127.0.0.1:0",
        scheduler_port=0,
    )


@pytest.fixture(scope="module")
def one_worker():
    with cluster(1, processes=False) as there:
        yield there


@pytest.mark.parametrize("n_workers", deep_but([1, 2, 4], 2))
def test_workers_of_a_cluster_follow_and_lengthen_to_the_same_bits(
    command_line, tmp_path, ensemble, n_workers
):
    with cluster(n_workers, processes=False) as there:
        command = (*RUN, "--out", tmp_path, "--block", 32, "--dask", there.scheduler_address)
        ended = command_line(*command).data()
        longer = command_line(*command, "--cycles", 2, "--resume").data()
    assert ended["sha256"] == ensemble.sha256()
    wanted = fast.simulate(load("moving-cap"), n_particles=N, energy=ENERGY, n_cycles=2, seed=SEED)
    assert longer["sha256"] == wanted.sha256()


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
    assert killed
    assert ended.data()["sha256"] == ensemble.sha256()


@pytest.mark.parametrize(
    ("raised", "words"),
    [
        (distributed.comm.CommClosedError("closed"), "the scheduler has gone (CommClosedError)"),
        (RuntimeError("Error during deserialization of the task graph"), "must have this project"),
        (distributed.KilledWorker("follow", None, 0), "workers die of block"),
    ],
)
def test_a_lost_cluster_is_one_line_that_says_how_to_go_on(
    command_line, tmp_path, ensemble, monkeypatch, one_worker, raised, words
):
    """Dask's own pages came out, with exit code 1."""
    keep = StoredRun.keep

    def lost(_future):
        raise raised

    with monkeypatch.context() as patch:

        def then_lost(self, block_range, block):
            keep(self, block_range, block)
            patch.setattr(distributed.Future, "result", lost)

        patch.setattr(StoredRun, "keep", then_lost)
        there = one_worker.scheduler_address
        ended = command_line(*RUN, "--out", tmp_path, "--block", 32, "--dask", there)
    assert_refused(ended, words, "particles are kept; go on with: mushrooms simulate")
    assert command_line(*RUN, "--out", tmp_path, "--resume").data()["sha256"] == ensemble.sha256()


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:9", "nonsense://x", "nonsense", "tcp://nonsense", "tcp://127.0.0.1:x"]
)
def test_no_scheduler_is_one_line(command_line, tmp_path, monkeypatch, address):
    """Nor is a client that failed the default of the process: what else uses Dask would wait for it."""
    monkeypatch.setattr(conduct, "CONNECT_TIMEOUT", 0.3)
    made = distributed.Client.__init__

    def made_at(client, address, **options):
        assert ":" in address.removeprefix("tcp://"), "a client that was never made whole cannot be closed"
        made(client, address, **options)

    monkeypatch.setattr(distributed.Client, "__init__", made_at)
    ended = command_line(*RUN, "--out", tmp_path, "--dask", address)
    with pytest.raises(ValueError, match="No clients"):
        distributed.default_client()
    assert_refused(ended, f"--dask = {address}", "no scheduler")


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
    rows = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    assert list(rows.dtype.names) == table.column_names
    wanted = {
        "particle": np.arange(N),
        "cycle_energies_1": ensemble.energy,
        "t_in_1_1": ensemble.t_in[:, 0, 0],
        "phase_captured_1_2": ensemble.phase_captured[:, 0, 1],
        "wall_counts_floor": ensemble.wall_counts[:, 4],
    }
    for name, column in wanted.items():
        for found in (rows, table):
            np.testing.assert_array_equal(np.asarray(found[name]), column)
    for path in (tmp_path / "run.csv", tmp_path / "run.parquet", stored):  # and the audit reads them
        given, _ = ensemble_table.read(path, load("moving-cap"), Reading(ENERGY, "v2/2", "scene", None))
        takes_part = np.isfinite(ensemble.energy)
        np.testing.assert_array_equal(given.s, np.log(ensemble.energy[takes_part] / ENERGY))
        np.testing.assert_array_equal(given.t_in, ensemble.t_in[takes_part, 0, 0])


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        (f"{GROUP}/cycle_energies/c/2/0", b"", ["missing or damaged"]),
        (f"{MARKERS}/1.marker", b"", ["block 1 of", "missing or damaged"]),
        (f"{MARKERS}/1.marker", None, [f"has {N - 64} of {N} particles", "--resume"]),
    ],
)
@pytest.mark.parametrize(
    "to", deep_but(["run.csv", "run.parquet", "run.npz", "run.svg"], "run.parquet", "run.svg")
)
def test_a_damaged_or_unfinished_run_is_neither_exported_nor_drawn(
    command_line, stored, tmp_path, name, content, words, to
):
    """What pyarrow had begun to write closed itself when nobody held it any more, with a page on stderr."""
    folder, unraised = shutil.copytree(stored, tmp_path / "run"), []
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_bytes(content)
    command = ["draw", folder, "--out"] if to == "run.svg" else ["export", folder, "--to"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "unraisablehook", unraised.append)
        ended = command_line(*command, tmp_path / to)
        gc.collect()
    assert_refused(ended, *words)
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


def when_written(folder):
    """Return the time at which each block of a stored run was last written."""
    return {path.name: path.stat().st_mtime_ns for path in (folder / MARKERS).glob("[0-9]*.marker")}


@pytest.mark.deep
def test_a_run_killed_at_random_moments_goes_on_to_the_same_bits(tmp_path):
    """Processes are killed (SIGKILL) while they follow, and lengthen, a run; then one is left to finish.

    The moment is a number of blocks, so that it lies within the run on any machine.
    """
    scene = "fermi-ulam"
    n_blocks = 75
    n_kills = int(os.environ.get("MUSHROOMS_KILLS", "2"))
    random = np.random.default_rng(1)
    options = ["--particles", "1500", "--energy", "1e3", "--block", "20", "--threads", "1", "--resume"]
    wanted = fast.simulate(load(scene), n_particles=1500, energy=1e3, n_cycles=2).sha256()
    command = [sys.executable, "-m", "mushrooms", "simulate", scene, *options, "--json"]
    folders = [tmp_path / str(number // 2) for number in range(n_kills)]
    for number, folder in enumerate(folders):
        place = ["--out", str(folder), "--cycles", str(1 + number % 2)]
        before = when_written(folder)
        n_more = random.integers(1, n_blocks // 2)
        give_up = time.monotonic() + 300.0  # a child that writes nothing
        child = subprocess.Popen([*command, *place], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while len(when_written(folder).items() - before.items()) < n_more:
            assert child.poll() is None, "it ended before it was killed"
            assert time.monotonic() < give_up, "it writes nothing"
            time.sleep(0.001)
        child.kill()
        assert child.wait() == -signal.SIGKILL
        assert len(when_written(folder).items() - before.items()) < n_blocks
    for folder in dict.fromkeys(folders):
        place = ["--out", str(folder), "--cycles", "2"]
        done = subprocess.run([*command, *place], capture_output=True, text=True, check=True)
        assert json.loads(done.stdout)["sha256"] == wanted


def test_xarray_reads_names_and_what_was_run_and_the_page_s_python_plots_it(stored, monkeypatch, ensemble):
    """A few lines, run where the page says; p_nc is that of the ensemble. Bits: test_mushrooms_store.py."""
    text = (DOCS / "ensembles.md").read_text("utf-8")
    (snippet,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert sum(map(bool, snippet.splitlines())) < 9
    monkeypatch.chdir(stored.parent)
    names = dict[str, Any]()
    exec(snippet, names)
    assert names["p_nc"].values == pytest.approx(ensemble.p_nc())
    assert (stored.parent / "histogram.png").stat().st_size > 5000
    run = names["run"]
    sizes = {"particle": N, "cycle": 1, "narrowing": 1, "wall": 5, "row": LANE_ROWS, "phase": 2}
    assert dict(run.sizes) == sizes
    assert run.phase_captured.dims == ("particle", "cycle", "phase")
    assert (run.attrs["phases"], run.attrs["seed"]) == ([0.25, 0.5], SEED)
    assert run.attrs["scene"]["name"] == "moving-cap"
    assert "--seed 5" in run.attrs["command"]
    assert set(run.attrs["versions"]) >= {"oscillating-mushrooms", "numpy", "numba", "python"}
