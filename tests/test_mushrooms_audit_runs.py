"""The audit's runs on disk: those that `mushrooms simulate` makes, gone on with, widened and read in part."""

from __future__ import annotations

import json
import os
import shlex
import tomllib
from functools import partial

import numpy as np
import pytest
import xarray
from support import adiabatic_particles
from support.refusals import assert_refused

import fast
import scene as scenes
from conformance.audit.claims import all_claims
from conformance.audit.runs import RUNS, SCENES, Sample, Simulation, draw, run_seed, scene_of
from mushrooms import audit
from mushrooms.output import locked
from mushrooms.store import conduct
from mushrooms.store.run import StoredRun, attributes_of
from scene import BadInput

SMALL = {
    "breathing": Simulation("breathing-circle", 60.0, 100, 270, n_cycles=2, phases=(0.25, 0.5)),
    "mouth": Simulation("only-mouth", 60.0, 100, 270, phases=(0.1, 0.5, 0.9)),
    "cycles": Simulation("moving-cap", 40.0, 100, 270, n_cycles=3),
}
N_QUICK, SEED = 100, 5


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    """Have small blocks, and leave files to the system's buffers, since a busy disk would take minutes."""
    monkeypatch.setattr(os, "fsync", lambda _descriptor: None)
    monkeypatch.setattr(conduct, "MOST_BLOCK", 64)


@pytest.fixture
def followed(monkeypatch):
    """Return the list of block ranges that are followed, (first particle, how many), without probes."""
    block_ranges, go_on = [], fast.go_on

    def noted(scene, **options):
        if options["n_particles"] != conduct.PROBED:
            block_ranges.append((options.get("first", 0), options["n_particles"]))
        return go_on(scene, **options)

    monkeypatch.setattr(fast, "go_on", noted)
    return block_ranges


def kept(folder, run, size="quick", *, resume=True, seed=SEED):
    """Return a run's sample as an audit in the folder has it."""
    audit.check_runs(folder, [run], seed, resume)
    return draw(
        partial(audit.follow_run, folder / "runs" / run.name, resume), run, size=size, seed=seed, threads=1
    )


def at_once(run, size="quick"):
    return draw(fast.simulate, run, size=size, seed=SEED, threads=1)


def assert_same(found, wanted):
    """Hold that two samples are one to the bit; times are none."""
    for name in set(Sample._fields) - {"run", "seconds"}:
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


def made(command_line, run, folder, n, *more):
    """Make a run as the audit's command says, with n particles."""
    words = shlex.split(audit.command(run, "quick", SEED, folder))[1:]
    words[words.index("--particles") + 1] = n
    ended = command_line(*words, "--threads", 1, "--json", *more)
    assert ended.code == 0, ended.err
    return json.loads(ended.out)


@pytest.mark.parametrize("name", SMALL)
def test_a_kept_run_is_the_one_at_once_and_quick_is_the_begin_of_full(tmp_path, followed, name):
    run = SMALL[name]
    quick, full = at_once(run), at_once(run, "full")
    followed.clear()
    assert_same(kept(tmp_path, run, resume=False), quick)
    assert followed == [(0, 64), (64, 36)]
    assert_same(kept(tmp_path, run, "full"), full)
    assert followed[2:] == [(64, 64), (128, 64), (192, 64), (256, 14)]
    assert_same(kept(tmp_path, run), quick)  # of the larger run
    assert len(followed) == 6
    np.testing.assert_array_equal(quick.s, full.s[: quick.n])


@pytest.mark.parametrize("name", ["breathing", "mouth"])
def test_what_simulate_has_made_is_taken_up(command_line, tmp_path, followed, name):
    """One with more particles too; and the audit's report tells the digest that `simulate` prints."""
    run = SMALL[name]
    summary = made(command_line, run, tmp_path, N_QUICK)
    found = kept(tmp_path, run)
    assert found.sha256 == summary["sha256"]
    assert_same(found, at_once(run))
    larger = made(command_line, run, tmp_path, 300)
    followed.clear()
    assert_same(kept(tmp_path, run), found)
    wanted = kept(tmp_path, run, "full")
    assert followed == []
    assert_same(wanted, at_once(run, "full"))
    assert made(command_line, run, tmp_path, 300)["sha256"] == larger["sha256"]  # as it was


def test_of_a_larger_run_only_what_the_audit_needs_is_followed(command_line, tmp_path, followed):
    run = SMALL["mouth"]
    wanted = at_once(run)
    larger = made(command_line, run, tmp_path, 300)
    place = tmp_path / "runs" / run.name
    for number in (1, 3):  # broken off there
        (place / "blocks" / f"{number}.marker").unlink()
    followed.clear()
    assert_same(kept(tmp_path, run), wanted)
    assert followed == [(64, 64)]
    assert made(command_line, run, tmp_path, 300)["sha256"] == larger["sha256"]
    assert followed[1:] == [(192, 64)]


def test_another_run_or_one_in_use_is_refused_before_anything_is_followed(command_line, tmp_path, followed):
    run = SMALL["mouth"]
    made(command_line, run, tmp_path, N_QUICK)
    followed.clear()
    place = str(tmp_path / "runs" / run.name)
    seeds = f"seed = {run_seed(SEED, run)} there, {run_seed(6, run)} asked for"
    for change, words in (
        ({"seed": 6}, [place, seeds]),
        ({"run": run._replace(phases=(0.1, 0.5))}, ["phases = [0.1, 0.5, 0.9] there, [0.1, 0.5] asked for"]),
        ({"run": run._replace(phases=())}, ["phases = [0.1, 0.5, 0.9] there, [] asked for"]),
        ({"resume": False}, [place, "--resume takes it up"]),
    ):
        with pytest.raises(BadInput) as refusal:
            kept(tmp_path, **{"run": run, **change})
        assert all(word in str(refusal.value) for word in words), refusal.value
    with locked(tmp_path / "runs" / run.name), pytest.raises(BadInput, match="one run at a time"):
        kept(tmp_path, run)
    assert followed == []


def test_a_run_with_more_cycles_is_refused_before_any_is_followed(tmp_path):
    run = SMALL["cycles"]
    asked = {"energy": run.energy, "seed": run_seed(SEED, run), "phases": run.phases, "threads": 1}
    longer = {"n_particles": 5, "n_cycles": 4, "progress": lambda _: None}
    audit.follow_run(tmp_path / "runs" / run.name, True, scene_of(run), **asked, **longer)
    with pytest.raises(BadInput, match="cycles = 4 there, 3 asked for: a run only grows"):
        audit.check_runs(tmp_path, [run], SEED, True)


def test_a_run_is_held_while_the_audit_follows_it(command_line, tmp_path, monkeypatch):
    run, go_on = SMALL["mouth"], fast.go_on
    words = shlex.split(audit.command(run, "quick", SEED, tmp_path))[1:]
    refused = []

    def meanwhile(scene, **options):
        monkeypatch.setattr(fast, "go_on", go_on)
        refused.append(command_line(*words))
        return go_on(scene, **options)

    monkeypatch.setattr(fast, "go_on", meanwhile)
    assert kept(tmp_path, run).n_particles == N_QUICK
    assert_refused(refused[0], "one run at a time")


ensemble = StoredRun.ensemble


def cut_off(run, n):
    """Read whole blocks."""
    return ensemble(run, min(-(-n // run.shape.block) * run.shape.block, run.tally.particles))


def test_a_run_read_in_whole_blocks_is_found_out(tmp_path, monkeypatch):
    run = SMALL["mouth"]
    monkeypatch.setattr(StoredRun, "ensemble", cut_off)
    sizes = ("quick", "full", "quick")
    found = [kept(tmp_path, run, size).sha256 for size in sizes]
    assert found != [at_once(run, size).sha256 for size in sizes]


def test_the_commands_of_an_audit_make_its_runs(command_line, tmp_path, monkeypatch):
    """Each asks for what the audit asks for, of a scene that `simulate` knows; nothing is made yet."""
    monkeypatch.chdir(tmp_path)
    for more, size in (([], "quick"), (["--full"], "full")):
        ended = command_line("audit", "--commands", "--out", "here", "--seed", 3, *more)
        assert ended.code == 0
        lines = ended.out.splitlines()
        runs = audit.needed(all_claims(), size)
        assert {run.name for run in runs} == {name for name, run in RUNS.items() if run.n_particles(size)}
        assert len({run_seed(3, run) for run in runs}) == len(lines) == len(runs)
        for line, run in zip(lines, runs, strict=True):
            words = shlex.split(line)
            assert words[:3] == ["mushrooms", "simulate", run.scene]
            options = dict(zip(words[3:-1:2], words[4:-1:2], strict=True))
            assert (float(options["--energy"]), int(options["--cycles"])) == (run.energy, run.n_cycles)
            assert int(options["--seed"]) == run_seed(3, run)
            assert int(options["--particles"]) == run.n_particles(size)
            assert options["--out"] == f"here/runs/{run.name}"
            assert tuple(map(float, filter(None, options.get("--phases", "").split(",")))) == run.phases
            assert scene_of(run).name == run.scene
    ended = command_line("audit", "--commands", "--only", "X5", "--json")
    assert len(json.loads(ended.out)) == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", SCENES)
def test_the_audit_s_scenes_are_known_by_name(command_line, tmp_path, name):
    for option, read in (("--toml", tomllib.loads), ("--json", json.loads)):
        ended = command_line("scenes", name, option)
        assert scenes.from_data(read(ended.out)) == SCENES[name]
    path = tmp_path / "a.toml"
    path.write_text(command_line("scenes", name, "--toml").out)
    assert scenes.load(path) == SCENES[name]


def test_what_is_not_there_yet_has_no_phase(tmp_path):
    """A run of three blocks of which only the second is kept."""
    spec = audit.spec_of(SMALL["mouth"], SEED)
    run, _ = conduct.open_or_create(tmp_path, spec, 150, 64, 64, "", False)
    block_range = list(run.missing())[1]
    run.keep(block_range, audit.engines.follow(spec, block_range, 1))
    with xarray.open_zarr(tmp_path / "ensemble.zarr", mask_and_scale=False) as found:
        there = np.zeros(150, bool)
        there[64:128] = True
        np.testing.assert_array_equal((found.phase_captured.values >= 0).all(axis=(1, 2)), there)
        np.testing.assert_array_equal((found.phase_captured.values == -1).all(axis=(1, 2)), ~there)
        np.testing.assert_array_equal(np.isfinite(found.phase_energies.values).all(axis=(1, 2)), there)


def test_without_phases_a_run_says_what_it_always_said(tmp_path):
    run = SMALL["cycles"]
    kept(tmp_path, run)
    place = tmp_path / "runs" / run.name
    assert "phases" not in attributes_of(place)
    assert "phases" not in audit.spec_of(run, SEED).to_data()  # nor in what markers are held to
    assert not list(place.rglob("phase*"))


def test_the_stand_in_s_particles_depend_on_their_numbers_alone():
    options = {"energy": 1e4, "seed": 3, "phases": (0.5,)}
    size = adiabatic_particles.TOGETHER
    whole = adiabatic_particles.simulate(scenes.load("moving-cap"), n_particles=size + 500, **options)
    part = adiabatic_particles.simulate(
        scenes.load("moving-cap"), n_particles=200, first=size - 100, **options
    )
    for name in fast.Ensemble._fields[1:-2]:
        np.testing.assert_array_equal(getattr(whole, name)[size - 100 : size + 100], getattr(part, name))
