"""Stored runs: the same bits whatever the blocks, cycles and accidents, and what is refused in one line."""

import contextlib
import errno
import hashlib
import json
import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
import xarray
import zarr
from support.depth import deep_among, deep_but
from support.harm import full_disk, harmed, held
from support.refusals import assert_refused
from zarr.storage import LocalStore

import fast
import mushrooms
from fast.kernel import follow as kernel, rows
from mushrooms import simulate
from mushrooms.folders import LOCK, locked
from mushrooms.main import run
from mushrooms.store import conduct, run as stored
from mushrooms.store.run import DESCRIPTION, DIGESTED, StoredRun
from mushrooms.store.spec import LANES, SCHEMA, RunSpec, paused_of, shape_of
from scene import load, to_data
from scene.files.writer import sealed, unsealed

pytestmark = pytest.mark.usefixtures("unsynced")
N, ENERGY, SEED = 330, 40.0, 7
STEM = to_data(load("fermi-ulam"))


def arguments(folder, *more, n=N, block=64, name="fermi-ulam"):
    words = ["simulate", name, "--energy", ENERGY, "--seed", SEED, "--threads", 1, "--json"]
    return [*words, "--particles", n, "--out", folder, *(["--block", block] if block else []), *more]


@pytest.fixture(scope="module")
def whole():
    """Return the SHA-256 of a run at once."""
    return at_once(N).sha256()


def at_once(n, n_cycles=1, name="fermi-ulam"):
    return fast.simulate(load(name), n_particles=n, energy=ENERGY, n_cycles=n_cycles, seed=SEED)


def digest_of(ended):
    return ended.data()["sha256"]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return the folder of a finished run, to be copied."""
    folder = tmp_path_factory.mktemp("written")
    with contextlib.chdir(folder), pytest.raises(SystemExit, match="0"):
        run([str(word) for word in arguments("run")])
    return folder / "run"


@pytest.fixture
def finished(written, tmp_path, monkeypatch):
    """Return the folder of a finished run, as the run was told it."""
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(written, Path("run"))


@pytest.fixture
def break_off(monkeypatch):
    """Return what lets a run fail, with an error, after it has kept so many further blocks."""
    keep, left = StoredRun.keep, []

    def interrupted(self, block_range, block):
        if left and left.pop():
            raise left.pop()
        keep(self, block_range, block)

    def after(n_kept, error=KeyboardInterrupt):
        left[:] = [error, True, *[False] * n_kept]

    monkeypatch.setattr(StoredRun, "keep", interrupted)
    return after


PROBED = (0, conduct.PROBED)
TWO_OF = f"interrupted; 64 of {N} particles are kept; go on with: mushrooms simulate fermi-ulam"
# Particles and cycles that are asked for; how many blocks are kept before it is broken off, or None; what is
# followed (first particle, how many, from which cycle to which), or what is said then.
GOES_ON = {
    "widened from its last full block": [
        (N, 1, 2, TWO_OF),
        (N, 1, None, [(*PROBED, 0, 1), *((k, 32, 0, 1) for k in range(64, 320, 32)), (320, 10, 0, 1)]),
        (400, 1, None, [(*PROBED, 0, 1), *((k, 32, 0, 1) for k in (320, 352)), (384, 16, 0, 1)]),
    ],
    "long enough, then lengthened and widened": [
        (150, 2, None, [(0, 32, 0, 2), *((k, 32, 0, 2) for k in (32, 64, 96)), (128, 22, 0, 2)]),
        (150, 2, None, [(*PROBED, 0, 2)]),
        (
            *(170, 3, None),
            [
                *((*PROBED, *cycles) for cycles in ((0, 2), (2, 3), (0, 3))),
                *((k, 32, 2, 3) for k in range(0, 128, 32)),
                *((128, 32, 0, 3), (160, 10, 0, 3)),
            ],
        ),
    ],
    # Also to more cycles than it was broken off at: blocks of three lengths stand side by side.
    "lengthened, broken off again and again": [
        (150, 1, None, [(k, min(32, 150 - k), 0, 1) for k in range(0, 150, 32)]),
        (150, 2, 3, "interrupted; 96 of 150 particles are kept"),
        (150, 4, 0, "interrupted; what was there is kept; go on with: mushrooms simulate fermi-ulam"),
        (150, 4, 1, "interrupted; 32 of 150 particles are kept"),
        (
            *(150, 4, None),
            [
                *((32, 4, *cycles) for cycles in ((0, 2), (2, 4), (0, 4))),  # probes: they can be lengthened
                *((32, 32, 2, 4), (64, 32, 2, 4), (96, 32, 1, 4), (128, 22, 1, 4)),
            ],
        ),
    ],
}


@pytest.mark.parametrize("name", deep_among(GOES_ON, "long enough, then lengthened and widened"))
def test_a_run_goes_on_with_what_it_lacks(command_line, tmp_path, followed, break_off, name):
    for n, cycles, n_kept, wanted in GOES_ON[name]:
        followed.clear()
        break_off(10**4 if n_kept is None else n_kept)
        ended = command_line(*arguments(tmp_path, "--cycles", cycles, "--resume", n=n, block=32))
        if n_kept is None:
            assert followed == wanted
            assert digest_of(ended) == at_once(n, cycles).sha256()
        else:
            assert (ended.code, ended.out, wanted in ended.err) == (130, "", True)
            group = zarr.open_group(tmp_path / "ensemble.zarr", mode="r")  # what is missing is nan, or -1
            assert np.isfinite(group["cycle_energies"][:, -1]).sum() == 32 * n_kept
            assert (group["outcome"][:] == -1).sum() == (n - 32 * n_kept if cycles == 1 else 0)
            assert f"--cycles {cycles} --seed {SEED} --out {tmp_path} --resume" in ended.err
    saved = json.loads((tmp_path / "summary.json").read_text())
    assert saved.items() >= {**ended.data(), "cycles": cycles, "particles": n}.items()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["blocks", "ensemble.zarr", "summary.json"]


def truncated(content):
    return content[: len(content) // 2]


def flipped(content):
    return bytes([content[0] ^ 1]) + content[1:]


def emptied(_content):
    return b""


DAMAGES = [
    (truncated, "ensemble.zarr/t/c/2"),
    (flipped, "blocks/2.marker"),
    (truncated, "ensemble.zarr/zarr.json"),
    (truncated, f"blocks/{DESCRIPTION}"),
    (flipped, "ensemble.zarr/wall_counts/c/2/0"),
    (emptied, "ensemble.zarr/outcome/c/2"),
    (truncated, "blocks/2.marker"),
    (truncated, "ensemble.zarr/t/zarr.json"),
]


def test_a_table_of_too_many_columns_is_refused_before_it_is_begun(command_line, tmp_path, monkeypatch):
    """A row of it would hold every cycle of a particle; arrays hold as many as there are."""
    monkeypatch.chdir(tmp_path)
    slow = ["simulate", "fermi-ulam", "--particles", 2, "--energy", 0.01, "--cycles", 11000, "--out", "long"]
    assert command_line(*slow).code == 0
    for to in ("long.csv", "long.parquet"):
        ended = command_line("export", "long", "--to", to)
        assert_refused(ended, "columns, must be at most 10000", ".npz", "xarray")
        assert not Path(to).exists()
    assert command_line("export", "long", "--to", "long.npz").code == 0


@pytest.mark.parametrize("case", deep_but(DAMAGES, *DAMAGES[:4]))
def test_a_damaged_file_is_mended_and_its_block_followed_again(command_line, finished, followed, whole, case):
    """Of one array's description nothing is followed again; that of the run is there twice."""
    damage, name = case
    path, is_block = finished / name, "2" in name
    content = path.read_bytes()
    path.write_bytes(damage(content))
    if is_block:
        assert_refused(command_line("export", finished, "--to", finished / "run.npz"), "mushrooms simulate")
        assert not (finished / "run.npz").exists()
    followed.clear()
    again = command_line(*arguments(finished, "--resume"))
    assert digest_of(again) == whole
    assert ("1 blocks (2)" in again.err) == is_block
    assert followed == [(0, conduct.PROBED, 0, 1), *[(128, 64, 0, 1)] * is_block]
    assert is_block or len(path.read_bytes()) == len(content)


def test_a_run_whose_descriptions_are_both_damaged_is_refused(command_line, finished):
    for path in (finished / "ensemble.zarr" / "zarr.json", finished / "blocks" / DESCRIPTION):
        path.write_bytes(truncated(path.read_bytes()))
    for command in (arguments(finished, "--resume"), ["draw", finished, "--out", finished / "a.svg"]):
        assert_refused(command_line(*command), "description is damaged")


def test_the_digest_does_not_take_a_chunk_that_changes_at_the_last_moment(
    command_line, tmp_path, monkeypatch
):
    complete = conduct.complete

    def then_damaged(run, *arguments, **options):
        complete(run, *arguments, **options)
        path = run.folder / "ensemble.zarr" / "x" / "c" / "1"
        path.write_bytes(flipped(path.read_bytes()))

    monkeypatch.setattr(conduct, "complete", then_damaged)
    assert_refused(command_line(*arguments(tmp_path)), "block 1 of", "damaged")


@pytest.mark.parametrize("n_writes", deep_but([0, 5, 22, 40], 0, 22))
def test_a_full_disk_leaves_a_run_that_goes_on(command_line, tmp_path, monkeypatch, whole, n_writes):
    """Whichever file the disk has no room for: of the description, a chunk, a marker."""
    full_disk(monkeypatch, n_writes)
    ended = command_line(*arguments(tmp_path))
    assert_refused(ended, "No space left on device", "go on with: mushrooms simulate")
    full_disk(monkeypatch, 10**9)
    assert not list(tmp_path.rglob(".*"))
    assert digest_of(command_line(*arguments(tmp_path, "--resume"))) == whole


def test_a_target_that_is_read_only_is_refused(command_line, finished, monkeypatch):
    before = sorted(finished.rglob("*"))

    def read_only(*_arguments, **_options):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(Path, "write_bytes", read_only)
    assert_refused(command_line(*arguments(finished, "--resume")), str(finished), "Read-only file system")
    assert sorted(finished.rglob("*")) == before


def test_one_writer_holds_a_folder(command_line, tmp_path, whole):
    with locked(tmp_path):  # of an open file, not of the process: another one is refused too
        assert_refused(command_line(*arguments(tmp_path)), f"process {os.getpid()} on", "one run at a time")
    assert digest_of(command_line(*arguments(tmp_path))) == whole
    (tmp_path / LOCK).write_text("process 1 on a machine that lost power")  # nobody holds it
    assert digest_of(command_line(*arguments(tmp_path, "--resume"))) == whole


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        ({}, [], ["holds this run", "--resume"]),
        ({}, ["--resume", "--seed", 8], ["seed = 7 there, 8 asked for"]),
        ({}, ["--resume", "--energy", 41], ["energy = 40.0 there, 41.0 asked for"]),
        ({}, ["--resume", "--particles", 5], ["particles = 330 there, 5 asked for"]),
        ({}, ["--resume", "--block", 65], ["block = 64 there, 65 asked for"]),
        ({"schema": 0}, ["--resume"], [f"schema = 0 there, {SCHEMA} asked for"]),
        ({"version": "0.0.9"}, ["--resume"], ["version = '0.0.9' there", repr(mushrooms.__version__)]),
        ({"scene": {"table": "stem"}}, ["--resume"], ["scene: ", "= None there"]),
        ({"scene": STEM | {"w": {"mean": 1.0}}}, ["--resume"], ["scene: w = {'mean': 1.0} there, 1.0 asked"]),
        ({"scene": STEM | {"h": {**STEM["h"], "mean": 9.0}}}, ["--resume"], ["scene: h: mean = 9.0 there"]),
    ],
)
def test_another_run_in_the_folder_is_refused(command_line, finished, change, options, words):
    path = finished / "blocks" / DESCRIPTION
    path.write_bytes(sealed(json.dumps(json.loads(unsealed(path)) | change).encode()))
    before = held(finished)
    assert_refused(command_line(*arguments(finished, *options)), *words)
    assert held(finished) == before


def test_blocks_of_another_run_do_not_count(command_line, tmp_path, followed, whole):
    """Files that somebody moved here: each is as it was written, but of another seed."""
    digest_of(command_line(*arguments(tmp_path / "other", "--seed", 8)))
    (tmp_path / "other" / "ensemble.zarr" / "zarr.json").unlink()
    (tmp_path / "other" / "blocks" / DESCRIPTION).unlink()
    assert digest_of(command_line(*arguments(tmp_path / "other"))) == whole


def test_limits_end_in_a_run_that_goes_on(command_line, tmp_path, monkeypatch, whole):
    code, out, err = command_line(*arguments(tmp_path, "--max-collisions", 3))
    assert (code, out) == (3, "")
    assert "collisions, --max-collisions = 3: 0 of 330 particles are kept; go on with: mushrooms" in err
    assert "no block was finished" in err
    now = iter(range(10**6))
    monkeypatch.setattr(conduct, "CLOCK", lambda: float(next(now)))
    code, out, err = command_line(*arguments(tmp_path, "--resume", "--max-seconds", 5))
    assert (code, out) == (3, "")
    assert 0 < int(err.split("passed: ")[1].split(" of")[0]) < N
    assert "no block" not in err
    done = command_line(*arguments(tmp_path, "--resume", "--max-collisions", 10**6))
    assert digest_of(done) == whole


def test_blocks_take_seconds_and_fit_into_memory():
    sizes = {}
    for energy, n_cycles in ((10.0, 1), (1e4, 1), (1e7, 1), (1e12, 1), (10.0, 10**6)):
        spec = RunSpec(load("moving-cap"), energy, n_cycles, SEED)
        size = sizes[energy, n_cycles] = conduct.block_size(spec, 4)
        assert size * shape_of(spec, 1, 1).bytes_of_a_particle <= conduct.BLOCK_BYTES
    assert list(sizes.values()) == [2**17, 2**17, 2**12, 2**9, 2]


def test_the_time_of_day_decides_nothing(command_line, tmp_path, monkeypatch, whole):
    """It jumps back and forth."""
    jumps = np.random.default_rng(1).uniform(0, 4e9, 10**5).tolist()
    monkeypatch.setattr(time, "time", jumps.pop)
    assert digest_of(command_line(*arguments(tmp_path, "--max-seconds", 1e6))) == whole
    assert digest_of(command_line(*arguments(tmp_path, "--resume"))) == whole


def test_whatever_happens_in_whatever_order_the_bits_are_the_same(command_line, tmp_path, break_off):
    """Runs that are broken off, harmed, widened and lengthened at random."""
    random, errors = np.random.default_rng(11), (KeyboardInterrupt, OSError(errno.EIO, "input/output error"))
    for number in range(int(os.environ.get("MUSHROOMS_HARMS", "2"))):
        folder, n, cycles, block = tmp_path / str(number), 20, 1, int(random.integers(5, 40))
        for _ in range(6):
            n, cycles = n + int(random.integers(0, 40)), cycles + int(random.integers(0, 2))
            run = arguments(folder, "--resume", "--cycles", cycles, n=n, block=block)
            break_off(int(random.integers(0, 8)), errors[random.integers(2)])
            assert command_line(*run).code in (0, 2, 130)
            if folder.exists():
                harmed(folder, random)
        break_off(10**4)
        assert digest_of(command_line(*run)) == at_once(n, cycles).sha256()


def faulty_sums(_array):
    return "as it was"


def faulty_follow(spec, block_range, threads, on_progress=None):
    return follow(spec, block_range._replace(first=0), threads, on_progress)


def faulty_digest(run):
    """Go block by block, all fields of each."""
    found = hashlib.sha256()
    for number in range(run.shape.n_blocks):
        for source in DIGESTED:
            found.update(run.part(number, source).tobytes())
    return found.hexdigest()


follow = conduct.follow


@pytest.mark.parametrize(
    ("owner", "name", "faulty"),
    [
        (stored, "_sum", faulty_sums),
        (conduct, "follow", faulty_follow),
        (StoredRun, "sha256", faulty_digest),
    ],
)
def test_faulty_stores_are_found_out(command_line, tmp_path, monkeypatch, whole, owner, name, faulty):
    monkeypatch.setattr(owner, name, faulty)
    command_line(*arguments(tmp_path))
    path = tmp_path / "ensemble.zarr" / "t" / "c" / "2"
    path.write_bytes(flipped(path.read_bytes()))
    ended = command_line(*arguments(tmp_path, "--resume"))
    assert ended.code != 0 or json.loads(ended.out)["sha256"] != whole


N_LONG, BLOCK = 150, 32


def lengthened(folder, cycles, n=N_LONG, block=BLOCK, name="fermi-ulam"):
    return arguments(folder, "--cycles", cycles, "--resume", n=n, block=block, name=name)


def summary_of(ended):
    return {name: value for name, value in ended.data().items() if name != "ns_per_collision"}


@pytest.fixture(autouse=True)
def _whole_sums(monkeypatch):
    """Leave the theory, which takes seconds, out of the summary."""
    monkeypatch.setattr(simulate, "measured", lambda _spec, n, gain: {"captured": n, **gain._asdict()})
    monkeypatch.setattr(simulate, "explain_limit", lambda _spec, _summary: None)


@pytest.mark.parametrize("name", deep_but(["fermi-ulam", "moving-cap", "breathing-circle"], "moving-cap"))
def test_a_run_is_lengthened_and_widened_to_the_bits_of_one_at_once(command_line, tmp_path, name):
    """In several goes, with blocks of any size: arrays, digest, and whole sums."""
    for n, cycles in ((30, 1), (50, 3), (60, 4)):
        found = summary_of(command_line(*lengthened(tmp_path / "a", cycles, n=n, block=13, name=name)))
    wanted = at_once(n, cycles, name)
    assert found["sha256"] == wanted.sha256()
    other = lengthened(tmp_path / "b", cycles, n=n, block=25, name=name)
    assert summary_of(command_line(*other)) == found
    run, once = (xarray.open_zarr(tmp_path / folder / "ensemble.zarr") for folder in "ab")
    assert run.drop_attrs().equals(once.drop_attrs())  # what it takes to go on among them
    assert run.attrs["cycles"] == cycles
    assert f"--cycles {cycles}" in run.attrs["command"]
    for field in wanted._fields:
        if field in run:
            assert run[field].values.tobytes() == getattr(wanted, field).tobytes()
    assert run.takes_part.values.tolist() == wanted.takes_part().tolist()


@pytest.mark.parametrize("n_written", deep_but([0, 1, 5, 100], 1, 100))
def test_a_block_that_is_half_lengthened_is_followed_from_the_start(
    command_line, tmp_path, followed, monkeypatch, n_written
):
    """The process dies after some of the block's chunks, or before its marker."""
    summary_of(command_line(*lengthened(tmp_path, 1)))
    put, write, left = LocalStore.set, stored.write_file, n_written

    async def dying(self, key, value):
        nonlocal left
        left -= "zarr.json" not in key
        if left < 0:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        await put(self, key, value)

    def unmarked(path, content):
        if path.name == "0.marker":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        write(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(LocalStore, "set", dying)
        patch.setattr(stored, "write_file", unmarked)
        assert command_line(*lengthened(tmp_path, 3)).code == 2
    ended = command_line(*lengthened(tmp_path, 3))
    assert digest_of(ended) == at_once(N_LONG, 3).sha256()
    # Its first chunks hold the cycles there were, with the same bits, or later ones alone.
    assert ("1 blocks (0)" in ended.err) == (n_written > 3)


def test_a_run_may_be_lengthened_many_times_over_but_not_endlessly(command_line, tmp_path, monkeypatch):
    """Each chunk of cycles is a file of every array."""
    summary_of(command_line(*lengthened(tmp_path, 2)))
    before = held(tmp_path)
    monkeypatch.setattr(fast, "go_on", None)
    words = "--cycles = 401, must be at most 400 for a run that began with 2"
    assert_refused(command_line(*lengthened(tmp_path, 401)), words)
    assert held(tmp_path) == before


def test_a_chunk_holds_the_cycles_that_a_run_began_with_and_is_written_once(command_line, tmp_path):
    folder, written = tmp_path / "ensemble.zarr" / "cycle_energies" / "c" / "1", set()
    for cycles in (2, 5):
        summary_of(command_line(*lengthened(tmp_path, cycles)))
        energy = zarr.open_group(tmp_path / "ensemble.zarr", mode="r")["cycle_energies"]
        assert (energy.shape, energy.chunks) == ((N_LONG, cycles), (BLOCK, 2))
        written.add((folder / "0").stat().st_mtime_ns)
    assert sorted(path.name for path in folder.iterdir()) == ["0", "1", "2"]
    assert len(written) == 1


go_on = fast.go_on


def with_other_numbers(scene, **options):
    """Follow as a machine does whose numbers differ in their last place."""
    run = go_on(scene, **options)
    return run._replace(ensemble=run.ensemble._replace(x=np.nextafter(run.ensemble.x, 1.0)))


def forgotten(row):
    column = kernel.FIRST_ROW + int(row // rows.STRIDE)

    def faulty(arrays, *more):
        lanes = arrays[LANES].copy()
        lanes[:, column] = 0.0
        return paused_of({**arrays, LANES: lanes}, *more)

    return faulty


def of_others(arrays, *more):
    return paused_of({**arrays, LANES: arrays[LANES][::-1]}, *more)


@pytest.mark.parametrize(
    ("owner", "name", "faulty"),
    [
        (fast, "go_on", with_other_numbers),
        *(
            (stored, "paused_of", faulty)
            for faulty in (forgotten(rows.VX), forgotten(rows.PHASE_SINE), of_others)
        ),
    ],
)
def test_a_run_that_would_go_on_otherwise_does_not(command_line, tmp_path, monkeypatch, owner, name, faulty):
    """The first particles are followed both ways before a block is touched."""
    summary_of(command_line(*lengthened(tmp_path, 1)))
    before = held(tmp_path)
    monkeypatch.setattr(owner, name, faulty)
    refused = command_line(*lengthened(tmp_path, 2))
    assert_refused(refused, "of its first particles comes out otherwise here", "numba")
    assert held(tmp_path) == before


@pytest.mark.parametrize("n", [1, 5, 20])
def test_the_room_that_is_asked_of_a_disk_is_that_which_a_run_takes(command_line, tmp_path, monkeypatch, n):
    usage = conduct.shutil.disk_usage(tmp_path)
    summary_of(command_line(*lengthened(tmp_path / "whole", 1, n=n, block=None)))
    taken = sum(path.stat().st_size for path in (tmp_path / "whole").rglob("c/**/*") if path.is_file())
    assert taken < 2**21  # as much as a few thousand particles take
    monkeypatch.setattr(conduct.shutil, "disk_usage", lambda _path: usage._replace(free=taken - 1))
    monkeypatch.setattr(fast, "go_on", None)
    assert_refused(command_line(*lengthened(tmp_path / "a", 1, n=n, block=None)), "GB to be written", "free")
