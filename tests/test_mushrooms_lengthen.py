"""Stored runs that get more cycles: the bits of all cycles at once, however often and whatever went wrong."""

from __future__ import annotations

import errno
import json
import os

import numpy as np
import pytest
import xarray
import zarr
from support.depth import deep_but
from support.harm import held
from support.refusals import assert_refused
from zarr.storage import LocalStore

import fast
from fast.kernel import follow, pools
from mushrooms import simulate
from mushrooms.store import conduct, engines
from mushrooms.store import run as stored
from mushrooms.store.run import StoredRun
from mushrooms.store.spec import LANES, RunSpec, paused_of, shape_of
from scene import load

pytestmark = pytest.mark.usefixtures("unsynced")
N, BLOCK, ENERGY, SEED = 150, 32, 40.0, 7


def arguments(folder, cycles, *more, n=N, block=BLOCK, name="fermi-ulam"):
    words = ["simulate", name, "--particles", n, "--energy", ENERGY, "--seed", SEED, "--cycles", cycles]
    sizes = ["--block", block] if block else []
    return [*words, "--threads", 1, "--json", "--out", folder, "--resume", *sizes, *more]


def at_once(n_cycles, n=N, name="fermi-ulam"):
    return fast.simulate(load(name), n_particles=n, energy=ENERGY, n_cycles=n_cycles, seed=SEED)


def summary_of(ended):
    assert ended.code == 0, ended.err
    return {name: value for name, value in json.loads(ended.out).items() if name != "ns_per_collision"}


@pytest.fixture(autouse=True)
def _whole_sums(monkeypatch):
    """Leave the theory, which takes seconds, out of the summary."""
    monkeypatch.setattr(simulate, "measured", lambda _spec, n, gain: {"captured": n, **gain._asdict()})
    monkeypatch.setattr(simulate, "explain_limit", lambda _spec, _summary: None)


@pytest.mark.parametrize("name", deep_but(["fermi-ulam", "moving-cap", "breathing-circle"], "moving-cap"))
def test_a_run_is_lengthened_and_widened_to_the_bits_of_one_at_once(command_line, tmp_path, name):
    """In several goes, with blocks of any size: arrays, digest, and whole sums."""
    random, n, cycles, last = np.random.default_rng(len(name)), 30, 1, (0, 0)
    for _ in range(3):
        last = (n, cycles)
        found = summary_of(command_line(*arguments(tmp_path / "a", cycles, n=n, block=13, name=name)))
        n, cycles = n + int(random.integers(0, 3)) * 10, cycles + int(random.integers(1, 4))
    n, cycles = last
    wanted = at_once(cycles, n, name)
    assert found["sha256"] == wanted.sha256()
    other = arguments(tmp_path / "b", cycles, n=n, block=25, name=name)
    assert summary_of(command_line(*other)) == found
    run, once = (xarray.open_zarr(tmp_path / folder / "ensemble.zarr") for folder in "ab")
    assert run.drop_attrs().equals(once.drop_attrs())  # what it takes to go on among them
    assert run.attrs["cycles"] == cycles
    assert f"--cycles {cycles}" in run.attrs["command"]
    for field in wanted._fields:
        if field in run:
            assert run[field].values.tobytes() == getattr(wanted, field).tobytes()
    assert run.takes_part.values.tolist() == wanted.takes_part().tolist()


def test_a_run_that_is_long_enough_is_not_followed_again(command_line, tmp_path, followed):
    summary_of(command_line(*arguments(tmp_path, 2)))
    followed.clear()
    assert summary_of(command_line(*arguments(tmp_path, 2)))["sha256"] == at_once(2).sha256()
    assert followed == [(0, 4, 0, 2)]
    followed.clear()
    summary_of(command_line(*arguments(tmp_path, 3, n=170)))
    probes, rest = followed[:3], followed[3:]
    assert probes == [(0, 4, 0, 2), (0, 4, 2, 3), (0, 4, 0, 3)]
    whole = [(first, 32, 2, 3) for first in range(0, 128, 32)]
    assert rest == [*whole, (128, 32, 0, 3), (160, 10, 0, 3)]
    saved = json.loads((tmp_path / "summary.json").read_text())
    assert (saved["cycles"], saved["particles"]) == (3, 170)


def test_a_lengthening_that_is_broken_off_goes_on(command_line, tmp_path, followed, monkeypatch):
    """Also to more cycles than it was broken off at; blocks of three lengths stand side by side."""
    keep, left = StoredRun.keep, 0

    def interrupted(self, block_range, block):
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt
        keep(self, block_range, block)

    monkeypatch.setattr(StoredRun, "keep", interrupted)
    left = 10
    summary_of(command_line(*arguments(tmp_path, 1)))
    for cycles, n_kept in ((2, 3), (4, 0), (4, 1)):
        left = n_kept
        code, out, err = command_line(*arguments(tmp_path, cycles))
        assert (code, out) == (130, "")
        told = f"{32 * n_kept} of {N} particles are" if n_kept else "what was there is"
        assert f"interrupted; {told} kept; go on with: mushrooms simulate fermi-ulam" in err
        assert f"--cycles {cycles}" in err
    assert_refused(command_line("export", tmp_path, "--to", tmp_path / "a.csv"), f"has 32 of {N} particles")
    assert_refused(command_line(*arguments(tmp_path, 3)), "cycles = 4 there, 3 asked for: a run only grows")
    left = 10
    followed.clear()
    assert summary_of(command_line(*arguments(tmp_path, 4)))["sha256"] == at_once(4).sha256()
    assert followed[:3] == [(32, 4, 0, 2), (32, 4, 2, 4), (32, 4, 0, 4)]  # they can be lengthened
    assert followed[3:] == [(32, 32, 2, 4), (64, 32, 2, 4), (96, 32, 1, 4), (128, 22, 1, 4)]


@pytest.mark.parametrize("n_written", [0, 1, 5, 100])
def test_a_block_that_is_half_lengthened_is_followed_from_the_start(
    command_line, tmp_path, followed, monkeypatch, n_written
):
    """The process dies after some of the block's chunks, or before its marker."""
    summary_of(command_line(*arguments(tmp_path, 1)))
    put, left = LocalStore.set, n_written

    async def dying(self, key, value):
        nonlocal left
        if "zarr.json" not in key:
            left -= 1
            if left < 0:
                raise OSError(errno.EIO, os.strerror(errno.EIO))
        await put(self, key, value)

    def no_marker(_path, _content):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    keep = StoredRun.keep

    def dies(self, block_range, block):
        monkeypatch.setattr(stored, "write_file", no_marker)
        keep(self, block_range, block)

    monkeypatch.setattr(StoredRun, "keep", dies)
    if n_written < 100:
        monkeypatch.setattr(LocalStore, "set", dying)
    assert command_line(*arguments(tmp_path, 3)).code == 2
    monkeypatch.undo()
    ended = command_line(*arguments(tmp_path, 3))
    assert json.loads(ended.out)["sha256"] == at_once(3).sha256()
    # Its first new chunk holds later cycles alone, and those before do not miss it.
    assert ("1 blocks (0)" in ended.err) == (n_written > 2)


def test_a_chunk_holds_the_cycles_that_a_run_began_with(command_line, tmp_path):
    for cycles in (2, 5):
        summary_of(command_line(*arguments(tmp_path, cycles)))
        energy = zarr.open_group(tmp_path / "ensemble.zarr", mode="r")["cycle_energies"]
        assert (energy.shape, energy.chunks) == ((N, cycles), (BLOCK, 2))
    folder = tmp_path / "ensemble.zarr" / "cycle_energies" / "c" / "1"
    assert sorted(path.name for path in folder.iterdir()) == ["0", "1", "2"]


def test_what_is_kept_takes_the_room_that_the_page_says():
    shape = shape_of(RunSpec(load("moving-cap"), ENERGY, 1, SEED), 1, 1)
    assert shape.bytes_of_a_particle == 114 + 8 * follow.LANE_ROWS == 410


def forgotten(row):
    column = follow.FIRST_ROW + int(row // pools.STRIDE)

    def faulty(arrays, *more):
        lanes = arrays[LANES].copy()
        lanes[:, column] = 0.0
        return paused_of({**arrays, LANES: lanes}, *more)

    return faulty


def of_others(arrays, *more):
    return paused_of({**arrays, LANES: arrays[LANES][::-1]}, *more)


@pytest.mark.parametrize("faulty", [forgotten(pools.VX), forgotten(pools.PHASE_SINE), of_others])
def test_a_run_that_would_go_on_otherwise_does_not(command_line, tmp_path, monkeypatch, faulty):
    """The first particles are followed both ways before a block is touched."""
    summary_of(command_line(*arguments(tmp_path, 1)))
    before = held(tmp_path)
    monkeypatch.setattr(engines, "paused_of", faulty)
    assert_refused(command_line(*arguments(tmp_path, 2)), "of its first particles comes out otherwise here")
    assert held(tmp_path) == before


@pytest.mark.parametrize("n", [1, 5, 20])
def test_the_room_that_is_asked_of_a_disk_is_that_which_a_run_takes(command_line, tmp_path, monkeypatch, n):
    usage = conduct.shutil.disk_usage(tmp_path)
    summary_of(command_line(*arguments(tmp_path / "whole", 1, n=n, block=None)))
    taken = sum(path.stat().st_size for path in (tmp_path / "whole").rglob("c/**/*") if path.is_file())
    assert taken < 2**21  # as much as a few thousand particles take
    monkeypatch.setattr(conduct.shutil, "disk_usage", lambda _path: usage._replace(free=taken - 1))
    monkeypatch.setattr(fast, "go_on", None)
    assert_refused(command_line(*arguments(tmp_path / "a", 1, n=n, block=None)), "GB to be written", "free")
