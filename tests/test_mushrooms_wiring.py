"""What a command hands on: options reach what they are for.

What takes long is replaced by something that notes what it was asked for.
"""

import io
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import zarr
from pyarrow import parquet
from support.options import draw_options
from support.refusals import assert_refused, one_line

import fast
import mushrooms
import scene as scenes
import theory
from conformance.cases.draw import wire_form
from mushrooms import bench, draw, orbits, output, progress, questions, scenes as listing, simulate
from mushrooms.figures import energies, orbits as pictures, style, table
from mushrooms.reports import bench_page, check_page
from mushrooms.store import conduct, export as exports, run as stored, spec, summary
from mushrooms.store.run import BlockRange
from mushrooms.store.spec import LANES, RunSpec, shape_of
from mushrooms.store.summary import careful_note, gain_of, tally_of
from scene import BadInput, load
from scene.refusal import refuse_unheeded

STEM = load("fermi-ulam")


def test_the_version_of_a_tree_that_was_never_installed(monkeypatch):
    from importlib import metadata

    def absent(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", absent)
    assert mushrooms.__version__ == "0+source"
    with pytest.raises(AttributeError, match="'nothing'"):
        _ = mushrooms.nothing


# ------------------------------------------------------------------------------------ what a stored run is of


@pytest.mark.parametrize(
    ("done", "wanted"),
    [
        (FileNotFoundError("git"), None),
        (PermissionError("git"), None),
        (subprocess.TimeoutExpired("git", 20), None),
        (SimpleNamespace(stdout=""), None),
        (SimpleNamespace(stdout="abc+\n"), "abc+"),
    ],
)
def test_without_git_or_a_tree_there_is_no_revision(monkeypatch, done, wanted):
    def ran(*_: object, **__: object) -> object:
        if isinstance(done, Exception):
            raise done
        return done

    monkeypatch.setattr(spec.subprocess, "run", ran)
    assert spec.made_by()["revision"] == wanted


def test_a_worker_of_another_version_is_refused(monkeypatch):
    asked = []
    monkeypatch.setattr(conduct, "follow", lambda *given: asked.append(given))
    one = RunSpec(STEM, 40.0, 1, 7), BlockRange(0, 0, 3), 2
    line = one_line(conduct.follow_elsewhere, "0.0.1", *one)
    assert line == f"a worker has version {mushrooms.__version__}, must be 0.0.1"
    conduct.follow_elsewhere(mushrooms.__version__, *one)
    assert asked == [one]


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a small run of two blocks and two cycles, with captures."""
    folder = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        one = RunSpec(load("moving-cap"), 40.0, 2, 7, (0.25, 0.75))
        run = conduct.open_or_create(folder, one, 6, 4, 4, "moving-cap", False)
        done: list[int] = []
        conduct.complete(run, lambda *given: conduct.in_process(*given, 1), done.append)
        assert done[-1] == 6
        assert done == sorted(done)
    return folder


@pytest.fixture
def reopened(kept: Path, tmp_path: Path) -> stored.StoredRun:
    import shutil

    shutil.copytree(kept, tmp_path / "run")
    return stored.open_run(tmp_path / "run")


def test_a_stored_run_is_the_one_at_once(reopened):
    at_once = fast.simulate(
        load("moving-cap"), n_particles=6, energy=40.0, n_cycles=2, seed=7, phases=(0.25, 0.75), threads=1
    )
    assert reopened.sha256() == at_once.sha256()
    whole = reopened.ensemble(6)
    for name in fast.Ensemble._fields[:-2]:
        np.testing.assert_array_equal(getattr(whole, name), getattr(at_once, name), err_msg=name)
    np.testing.assert_array_equal(reopened.ensemble(5).energy, at_once.energy[:5])
    gains = np.log(at_once.cycle_energies / 40.0)[at_once.takes_part()]
    assert np.concatenate(list(reopened.gains())) == pytest.approx(gains)
    assert reopened.part(1, "energy").tolist() == at_once.energy[4:].tolist()
    assert reopened.part(1, "n_collisions").tolist() == at_once.n_collisions[4:].tolist()
    assert reopened.ensemble(3).seconds == pytest.approx(reopened.seconds / 2)
    assert reopened.seconds > 0
    assert reopened.tally.particles == 6
    again = stored.StoredRun(reopened.folder, reopened.spec, reopened.shape, "it")
    assert again.check() == []
    assert again.tally == tally_of(at_once)
    assert list(again.lacking()) == []


def test_an_export_has_every_result_and_nothing_internal(reopened, tmp_path, capsys):
    files = [tmp_path / f"a.{kind}" for kind in ("csv", "parquet", "npz")]
    for file in files:
        exports.export_run(exports.ExportOptions(run=reopened.folder, to=file))
    assert capsys.readouterr().out.split() == list(map(str, files))
    wanted = [
        "particle", *(f"cycle_energies_{k}" for k in (1, 2)), "t", "x", "y", "vx", "vy",
        "outcome", "takes_part", *(f"{name}_{k}_1" for name in ("t_in", "t_out") for k in (1, 2)),
        *(f"wall_counts_{wall}" for wall in ("arc", "base", "left", "right", "floor")), "n_careful",
        *(f"{name}_{k}_{j}" for name in ("phase_energies", "phase_captured") for k in (1, 2) for j in (1, 2)),
    ]  # fmt: skip
    assert files[0].read_text().splitlines()[0].split(",") == wanted
    columns = parquet.read_table(files[1])
    assert columns.column_names == wanted
    assert columns["particle"].to_pylist() == list(range(6))
    whole = reopened.ensemble(6)
    assert columns["t_in_2_1"].to_numpy() == pytest.approx(whole.t_in[:, 1, 0], nan_ok=True)
    assert columns["phase_energies_2_1"].to_numpy() == pytest.approx(whole.phase_energies[:, 1, 0])
    with np.load(files[2]) as held:
        assert set(held.files) == {"about"} | set(fast.Ensemble._fields) - {"seconds", "threads"}
    assert LANES not in " ".join(wanted)


def test_a_run_of_another_schema_is_refused(reopened, monkeypatch):
    monkeypatch.setattr(stored, "SCHEMA", spec.SCHEMA + 1)
    line = one_line(stored.open_run, reopened.folder)
    assert line.endswith(f"schema = {spec.SCHEMA} there, {spec.SCHEMA + 1} is read here")


def test_a_block_that_is_missing_or_damaged_is_named(reopened, tmp_path):
    (reopened.folder / "blocks" / "1.marker").unlink()
    line = one_line(stored.open_run, reopened.folder)
    assert "has 4 of 6 particles: go on with mushrooms simulate moving-cap" in line
    other = stored.StoredRun(reopened.folder, reopened.spec, reopened.shape, "it")
    assert other.check() == []
    assert [(one.number, one.first, one.n) for one in other.lacking()] == [(1, 4, 2)]
    group = zarr.open_group(reopened.folder / "ensemble.zarr", mode="r+")
    group["x"][1] = 9.0
    again = stored.StoredRun(reopened.folder, reopened.spec, reopened.shape, "it")
    assert again.check() == [0]
    assert again.tally.particles == 0
    assert again.first_there() is None
    assert "block 0 of" in one_line(again.block, 0)


def test_a_longer_run_goes_on_from_what_is_there(reopened):
    longer = reopened.spec._replace(n_cycles=3)
    run = stored.StoredRun(reopened.folder, longer, shape_of(longer, 6, 4, 2), "it")
    assert run.check() == []
    assert run.first_there() == 0
    [first, second] = run.missing()
    assert first.before is not None
    assert first.before.ensemble.cycle_energies.shape == (4, 2)
    assert second.before is not None
    wider = stored.StoredRun(reopened.folder, reopened.spec, shape_of(reopened.spec, 9, 4, 2), "it")
    wider.check()
    assert [(one.number, one.n, one.before) for one in wider.missing()] == [(1, 4, None), (2, 1, None)]
    assert wider.first_there() == 0


def test_limits_stop_a_run_between_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _: None)
    one = RunSpec(STEM, 40.0, 1, 7)

    def run_in(name: str) -> stored.StoredRun:
        (tmp_path / name).mkdir()
        return conduct.open_or_create(tmp_path / name, one, 6, 2, 2, "fermi-ulam", False)

    def engine(*given):
        return conduct.in_process(*given, 1)

    made = fast.simulate(STEM, n_particles=6, energy=40.0, seed=7, threads=1).n_collisions
    most = [int(made[k : k + 2].max()) for k in (0, 2, 4)]
    limited = run_in("a")
    with pytest.raises(
        conduct.LimitReached, match=f"makes {max(most)} collisions, --max-collisions = {max(most) - 1}"
    ):
        conduct.complete(limited, engine, lambda _: None, max_collisions=max(most) - 1)
    assert limited.tally.particles == 2 * most.index(max(most))
    enough = run_in("b")
    conduct.complete(enough, engine, lambda _: None, max_collisions=max(most))
    assert enough.tally.particles == 6
    clock = iter(range(0, 1000, 10))
    monkeypatch.setattr(conduct, "CLOCK", lambda: next(clock))
    slow = run_in("c")
    with pytest.raises(conduct.LimitReached, match="--max-seconds = 15 have passed"):
        conduct.complete(slow, engine, lambda _: None, max_seconds=15.0)
    assert slow.tally.particles < 6
    part = run_in("d")
    done: list[int] = []
    conduct.complete(part, engine, done.append, n_particles=3)
    assert part.tally.particles == 4  # whole blocks
    assert min(done) >= 0
    assert done[-1] == 3  # of those that are asked for
    assert [one.number for one in part.lacking()] == [2]


def test_blocks_take_seconds_of_what_is_to_be_expected(monkeypatch):
    """A power of two between the least and the most, so that a block makes some 2e8 collisions."""
    one = RunSpec(STEM, 40.0, 1, 7)
    for each, wanted in (
        (1e4, 16384), (1e9, 256), (1.0, 2**17), (0.0, 2**17), (math.nan, 256), (math.inf, 256),
    ):  # fmt: skip
        monkeypatch.setattr(conduct, "expected_collisions", lambda *_, each=each: each)
        monkeypatch.setattr(conduct, "BLOCK_BYTES", 2**40)
        assert conduct.block_size(one, 1) == wanted
    assert conduct.block_size(one, 32) == 4096  # 128 for each thread
    monkeypatch.setattr(conduct, "BLOCK_BYTES", 3000 * shape_of(one, 1, 1).bytes_of_a_particle)
    monkeypatch.setattr(conduct, "expected_collisions", lambda *_: 1.0)
    assert conduct.block_size(one, 1) == 2048
    monkeypatch.setattr(conduct, "BLOCK_BYTES", 1)  # less than one particle needs
    assert conduct.block_size(one, 1) == 1
    monkeypatch.setattr(conduct, "BLOCK_BYTES", 2**40)
    assert [conduct.block_of_new(one, n, 1) for n in (1, 4096, 4097, 10**9)] == [4096, 4096, 8192, 2**17]
    with pytest.raises(BadInput, match=r"--block = 2: 2000001 particles need blocks of at least 3"):
        conduct.open_or_create(Path("nowhere"), one, 2_000_001, 2, 2, "x", False)


def test_gains_of_blocks_have_the_mean_of_all():
    random = np.random.default_rng(1)
    gains = random.normal(0.2, 1.0, (50, 3))
    found = gain_of(lambda: iter(np.array_split(gains, 4)))
    assert found.n == 50
    assert found.mean == pytest.approx(gains[:, -1].mean())
    assert found.standard_error == pytest.approx(gains[:, -1].std(ddof=1) / 50**0.5)
    assert gain_of(lambda: [gains[:1]]).standard_error is None
    assert gain_of(lambda: [gains[:0]]) == (0, None, None)


def test_a_share_of_all_or_none_has_an_error_as_if_one_more_could_tell():
    for share, wanted in ((0.5, 0.25), (1.0, 0.1 * 0.9), (0.0, 0.1 * 0.9), (0.05, 0.1 * 0.9)):
        assert summary._measured_error(load("moving-cap"), share, 9) == pytest.approx((wanted / 9) ** 0.5)
    assert summary._measured_error(load("ergodic"), 1.0, 9) == 0.0  # no particle can be captured


@pytest.mark.parametrize(
    ("ns", "collisions", "careful", "is_told"),
    [
        (100.0, 10**7, 10**5, True), (100.0, 10**7, 10**4, False), (100.0, 9_000_000, 10**6, False),
        (100.0, 10**7, 22_000, False), (100.0, 10**7, 23_000, True),
    ],
)  # fmt: skip
def test_careful_steps_are_told_of_where_they_cost_a_tenth_of_a_second_or_more(
    ns, collisions, careful, is_told
):
    """A careful step costs as much as fifty others."""
    summary = {"ns_per_collision": ns, "collisions": collisions, "careful": careful}
    note = careful_note(summary)
    assert (note is not None) is is_told
    if note:
        part = 50 * careful / (50 * careful + collisions - careful)
        assert f"{careful / collisions:.2g} of the collisions, some {part:.0%} of the time" in note


# --------------------------------------------------------------------------------------------- what is drawn


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[object, ...]]:
    """Return the list of what is followed and drawn; nothing is."""
    log: list[tuple[object, ...]] = []

    def follow(scene, n_collisions, *, progress, **options):
        progress(0)
        log.append(("follow", scene.name, n_collisions, options))
        return ["an orbit", "another"][: options["n_orbits"]]

    monkeypatch.setattr(orbits, "follow", follow)
    for name in ("trajectory", "energy_in_time", "section", "collision_map"):
        monkeypatch.setattr(pictures, name, lambda *given, name=name: log.append((name, *given)) or name)

    def write_animation(orbit, _, *, progress):
        progress(1, 2)
        log.append(("animation", orbit))

    def write_picture(scene, suffix, _, progress):
        progress(1, 2)
        log.append(("walls", scene.name, suffix))

    monkeypatch.setattr(pictures, "write_animation", write_animation)
    monkeypatch.setattr(table, "write_picture", write_picture)
    monkeypatch.setattr(style, "save", lambda figure, _, suffix: log.append(("save", figure, suffix)))
    return log


MANY = 10**6
USUAL = {
    "--trajectory": (60, 60.0, 1, None),
    "--section": (400, 1000.0, 40, None),
    "--map": (400, 1000.0, 40, None),
    "--growth --particles 1": (MANY, 1000.0, 1, 10),
    "--section --phase 0.5": (MANY, 60.0, 40, 60),
}


@pytest.mark.parametrize("words", USUAL)
def test_a_picture_follows_what_suits_it_unless_it_is_told(command_line, tmp_path, drawn, words):
    n_collisions, crossings, n_orbits, n_cycles = USUAL[words]
    out = ["--out", tmp_path / "a.svg"]
    assert command_line("draw", "moving-cap", *words.split(), *out).code == 0
    energy = orbits.usual_energy(load("moving-cap"), crossings)
    usual = {"energy": energy, "seed": 0, "n_orbits": n_orbits, "n_cycles": n_cycles}
    assert drawn[0] == ("follow", "moving-cap", n_collisions, usual)
    told = ["--energy", 9, "--seed", 3, "--cycles", 7]
    assert command_line("draw", "moving-cap", *words.split(), *told, *out).code == 0
    mine = {"energy": 9.0, "seed": 3, "n_orbits": n_orbits, "n_cycles": 7}
    assert next(one for one in drawn[1:] if one[0] == "follow") == ("follow", "moving-cap", MANY, mine)
    if "growth" not in words:
        drawn.clear()
        assert command_line("draw", "moving-cap", *words.split(), "--collisions", 9, *out).code == 0
        assert drawn[0] == ("follow", "moving-cap", 9, usual | {"n_cycles": None})


@pytest.mark.parametrize(
    ("words", "n_collisions", "n_cycles"), [("--section", 4000, None), ("--section --phase 0.5", MANY, 400)]
)
def test_the_section_of_a_stem_is_of_slow_particles(
    command_line, tmp_path, drawn, words, n_collisions, n_cycles
):
    assert command_line("draw", "fermi-ulam", *words.split(), "--out", tmp_path / "a.svg").code == 0
    _, name, n, options = drawn[0]
    assert (name, n, options["n_cycles"], options["n_orbits"]) == ("fermi-ulam", n_collisions, n_cycles, 40)
    assert options["energy"] == orbits.usual_energy(STEM, 4.0)


def test_each_kind_of_picture_is_drawn_by_its_function(command_line, tmp_path, drawn):
    kinds = {
        "--trajectory": [("trajectory", "an orbit"), ("save", "trajectory", ".svg")],
        "--section": [("section", ["an orbit", "another"], None), ("save", "section", ".svg")],
        "--map": [("collision_map", ["an orbit", "another"]), ("save", "collision_map", ".svg")],
        "--growth --particles 1": [("energy_in_time", "an orbit"), ("save", "energy_in_time", ".svg")],
    }
    for words, wanted in kinds.items():
        drawn.clear()
        assert command_line("draw", "moving-cap", *words.split(), "--out", tmp_path / "a.svg").code == 0
        assert drawn[1:] == wanted
    drawn.clear()
    assert command_line("draw", "moving-cap", "--trajectory", "--out", tmp_path / "a.gif").code == 0
    assert drawn[1:] == [("animation", "an orbit")]
    drawn.clear()
    assert command_line("draw", "moving-cap", "--out", tmp_path / "a.gif").code == 0
    assert drawn == [("walls", "moving-cap", ".gif")]


def test_growth_is_of_those_that_take_part(monkeypatch):
    asked = []
    monkeypatch.setattr(energies, "growth", lambda *given: asked.append(given))
    options = draw_options(energy=50.0, cycles=2, particles=30, seed=4)
    island = scenes.Mushroom(r=1.0, h=1.0, nu=scenes.Fourier(0.6, 1.0, (0.2,)), name="island")
    draw._growth(island, options)
    [(scene, energy, gains, n)] = asked
    found = fast.simulate(island, n_particles=30, energy=50.0, n_cycles=2, seed=4)
    assert (scene, energy, n) == (island, 50.0, 30)
    assert np.array_equal(gains, np.log(found.cycle_energies[found.takes_part()] / 50.0))
    assert 0 < len(gains) < 30  # some are in the island all the time


def test_exponents_tell_how_far_they_are(monkeypatch):
    seen = []
    orbit = SimpleNamespace(walls=["arc"] * 5)
    monkeypatch.setattr(draw.DrawOptions, "follow", lambda *_: [orbit, orbit])
    monkeypatch.setattr(
        pictures, "exponents", lambda found, report: seen.append(len(found)) or report(7) or "it"
    )
    assert draw._figure("lyapunov", STEM, draw_options()) == "it"
    assert seen == [2]


def test_an_output_that_is_a_folder_is_refused(command_line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.svg").mkdir()
    assert_refused(
        command_line("draw", "moving-cap", "--out", "a.svg"), "output 'a.svg' is a folder, must be a file"
    )


# ------------------------------------------------------------------------------------- tables, numbers, words


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.5, "0.5 seconds"), (9.96, "10 seconds"), (12.4, "12 seconds"), (89.0, "89 seconds"),
        (90.0, "1.5 minutes"), (5399.0, "90 minutes"), (5400.0, "1.5 hours"), (129599.0, "36 hours"),
        (129600.0, "1.5 days"), (86400 * 1e7, "1e+07 days"),
    ],
)  # fmt: skip
def test_a_duration_has_the_unit_that_suits_it(seconds, text):
    assert progress.format_duration(seconds) == text


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("is_terminal", [True, False])
def test_progress_goes_to_standard_error_as_a_bar_or_as_lines(capsys, monkeypatch, is_terminal):
    """Also while the clock stands still: then the time that is left is unknown."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(progress, "CLOCK", lambda: 7.0)
    monkeypatch.setattr(progress, "FIRST", 0.0)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    told = Terminal() if is_terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", told)
    with progress.progress_bar() as bar:
        watch = progress.Watch(bar, "run", "particles")
        watch.update(1000, 2000)
        watch.update(1500, 2000)
    lines = told.getvalue()
    assert capsys.readouterr().out == ""
    assert ("run: 1,000 of 2,000 particles, time left unknown" in lines) is not is_terminal
    assert ("run: 1,500 of 2,000 particles, " in lines) is not is_terminal
    assert ("1500/2000" in lines) is is_terminal


def test_pairs_are_lines_with_their_meanings(capsys):
    pairs = {"a": 0.123456, "a_se": 0.0123, "a_theory": 0.1299999, "long": None, "n": 12}
    output.print_pairs(pairs, False, {"a": "what it is"})
    assert capsys.readouterr().out.splitlines() == [
        "a         0.123  what it is", "a_se      0.012", "a_theory  0.130", "long      –", "n         12",
    ]  # fmt: skip
    output.print_pairs(pairs, True)
    assert json.loads(capsys.readouterr().out) == pairs


def test_what_nothing_heeds_is_named_with_its_value():
    for options, words in (
        ({"--a": None, "--b": "x"}, "--b = 'x' would"), ({"--b": True, "--c": 1}, "--b would"),
        ({"--c": 0}, "--c = 0 would"),
    ):  # fmt: skip
        with pytest.raises(BadInput, match=f"{words} change nothing here: why"):
            refuse_unheeded(options, "why")
    refuse_unheeded({"--a": None}, "why")


def test_summaries_are_of_what_was_followed():
    found = fast.simulate(STEM, n_particles=20, energy=40.0, n_cycles=3, seed=1, threads=1)
    lost = found._replace(outcome=np.where(np.arange(20) < 2, 1, 0).astype(np.int8))
    tally = tally_of(lost)
    assert (tally.particles, tally.followed, tally.undecided) == (20, 18, 2)
    assert tally.collisions == found.n_collisions.sum()
    assert tally.met == found.n_collisions[2:].sum()
    data = simulate._summary(RunSpec(STEM, 40.0, 3, 1), tally, 2.0, lambda: [np.zeros((20, 3))], "digest")
    assert data["lost"] == 2
    assert data["collision_time"] == pytest.approx(18 * 3 * STEM.period / tally.met)
    assert data["ns_per_collision"] == pytest.approx(2e9 / tally.collisions)
    nothing = simulate._summary(
        RunSpec(STEM, 40.0, 3, 1), tally._replace(met=0, collisions=0), 2.0, list, "d"
    )
    assert (nothing["collision_time"], nothing["ns_per_collision"]) == (None, 2e9)


PULLS = [  # found, predicted, standard error, possible error of theory; the difference in both
    (2.0, 1.0, 0.3, 0.4, 2.0), (1.0, 2.0, 0.3, 0.4, -2.0), (1.0, 1.0, 0.3, 0.4, 0.0),
    (2.0, 1.0, 0.5, 0.0, 2.0), (2.0, 1.0, 0.0, 0.5, 2.0), (2.0, 1.0, 0.0, 0.0, None),
    (None, 1.0, 0.3, 0.4, None), (2.0, 1.0, None, 0.4, None), (2.0, 1.0, 0.3, None, None),
    (1.0, 0.0, 1.5, 0.0, 0.667),
]  # fmt: skip


@pytest.mark.parametrize(("found", "wanted", "error", "left_out", "pull"), PULLS, ids=range(len(PULLS)))
def test_a_difference_is_told_in_the_errors_that_there_are(found, wanted, error, left_out, pull):
    """None where there is none, or where one is not known; rounded to three decimals."""
    assert summary._pull(found, wanted, error, left_out) == pull


@pytest.mark.parametrize("n_cycles", [1, 3])
def test_a_prediction_of_a_run_goes_from_its_energy_towards_the_limit(n_cycles):
    """A cycle adds what finite energy does as E^(-1/2), which falls by the mean of exp(-s / 2) each time."""
    scene, energy = load("moving-cap"), 1e4
    limit, here = theory.predict(scene, 10), theory.at_energy(scene, energy)
    found = summary.predicted(RunSpec(scene, energy, n_cycles, 0))
    falls = here.mean_of_exp(-0.5)
    part = 1.0 if n_cycles == 1 else (1 + falls + falls**2) / 3
    assert 0.8 < falls < 0.99
    for name, at_infinity, at_energy in (
        ("m1", limit.m1, here.mean_s), ("p_nc", limit.p_nc, here.p_nc),
        ("variance", limit.sd**2, here.variance_s),
    ):  # fmt: skip
        expected = part * at_energy + (1 - part) * float(at_infinity)
        assert abs(at_energy - float(at_infinity)) > 1e-4
        assert getattr(found, name) == pytest.approx(expected, rel=1e-8)
    assert found.m1_error == pytest.approx(part * here.theory_error.mean_s)
    assert found.p_nc_error == pytest.approx(part * here.theory_error.p_nc)


def test_predictions_at_an_energy_are_rounded_to_what_they_are_worth():
    found, data = theory.at_energy(load("moving-cap"), 1e5), listing._at_energy(load("moving-cap"), 1e5)
    left = found.theory_error
    assert data["m1_at"] == pytest.approx(found.mean_s, rel=1e-6)
    assert data["sd_at"] == pytest.approx(found.variance_s**0.5, rel=1e-6)
    assert data["peak_width_at"] == pytest.approx(found.peak[1] ** 0.5, rel=1e-6)
    assert data["peak_width_error"] == pytest.approx(found.peak[1] ** 0.5 * left.variance / 2, rel=0.05)
    assert data["m1_error"] == float(f"{left.mean_s:.2g}")
    assert (data["v"], data["is_in_reach"]) == (447.2136, True)
    free = listing._at_energy(load("ergodic"), 1e5)
    assert free["captured_at"] is None
    assert data["captured_at"] == pytest.approx(found.captured_mean, rel=1e-6)


def test_a_benchmark_hands_on_what_it_is_asked(command_line, tmp_path, monkeypatch):
    asked, kept = (
        [],
        bench.record.read(Path(mushrooms.__file__).parent.parent / "docs" / "bench" / "bench.json"),
    )
    monkeypatch.setattr(bench, "_measure", lambda *given: asked.append(given) or kept)
    monkeypatch.setattr(bench_page, "to_html", lambda *_: "page")
    monkeypatch.setattr(style, "svg", lambda _: b"<svg/>")
    monkeypatch.setattr(bench_page, "headline", lambda _: None)
    code, out, _ = command_line("bench", "--quick", "--seed", 4, "--out", tmp_path / "b", "--", "it", "--x")
    assert (code, asked) == (0, [("quick", 4, ["it", "--x"])])
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == [
        "bench.html",
        "bench.json",
        "bench.svg",
    ]
    assert bench.record.read(tmp_path / "b" / "bench.json") == kept
    assert out.count("| stepper |") == len(kept.workloads)
    for name, why in kept.not_run.items():
        assert f"not run: {name}: {why}" in out
    command_line("bench", "--out", tmp_path / "c")
    assert asked[1] == ("full", 0, [])


def test_solvers_that_cannot_run_are_told_of_and_a_command_is_one_of_them(monkeypatch):
    from contextlib import ExitStack

    from conformance.harness.examples import Example

    def no_compiler(*_: object) -> None:
        raise bench.CheckFailure("error", "no C")

    def by_command(name, family, command, *_):
        if command[0] == "broken":
            raise bench.CheckFailure("crashed", "it is gone")
        return bench.Solver(name, family, lambda *_: None)

    monkeypatch.setattr(bench.baselines, "build", no_compiler)
    monkeypatch.setattr(bench, "by_command", by_command)
    examples = {"A": Example(("a",), built="cc a"), "B": Example(why_not="no B"), "C": Example(("broken",))}
    monkeypatch.setattr(bench, "find_examples", lambda *_: examples)
    with ExitStack() as stack:
        found, built, not_run = bench._solvers(stack, ["mine", "-x"])
        assert [one.name for one in found[-2:]] == ["example in A", "command mine -x"]
        assert built == {"example in A": "cc a"}
        assert not_run["lean C, time steps"] == "no C"
        assert not_run["example in B"] == "no B"
        assert "it is gone" in not_run["example in C"]
        with pytest.raises(BadInput, match="command 'broken' crashed: it is gone"):
            bench._solvers(stack, ["broken"])


FIELDS = ("t", "x", "y", "vx", "vy", "wall")


@pytest.mark.parametrize("n_false", [1, 2])
def test_a_picture_is_of_the_first_false_step_from_where_it_begins(
    command_line, tmp_path, monkeypatch, n_false
):
    """Each later one is false, too: it begins where the false one ends."""
    asked = []
    monkeypatch.setattr(check_page, "draw_step", lambda *given: asked.append(given) or b"svg")
    scene, start = load("moving-cap"), scenes.State(0.0, 0.1, 0.2, 3.0, 4.0)
    path = [start]
    for _ in range(3):
        path.append(fast.next_collision(scene, path[-1], 100.0).state())
    states = [{name: getattr(one, name) for name in FIELDS} for one in path]
    states[n_false]["x"] += 0.01
    file, picture = tmp_path / "a.json", tmp_path / "a.svg"
    head = {"scene": wire_form(scene), "state": states[0], "steps": states[1:]}
    file.write_text(json.dumps(head))
    ended = command_line("verify", file, "--picture", picture)
    assert (ended.code, picture.read_text()) == (1, "svg")
    assert f"Picture of step {n_false}: {picture}" in ended.out
    [(drawn, begin, truth, given, place)] = asked
    assert scenes.to_data(drawn)["r"] == scenes.to_data(scene)["r"]
    assert [getattr(begin, name) for name in FIELDS] == [states[n_false - 1][name] for name in FIELDS]
    assert (truth.wall, truth.x) == (path[n_false].wall, pytest.approx(path[n_false].x))
    assert (given, place) == (states[n_false], f"step {n_false}")


def test_hits_are_counted_where_a_flow_is_decided(monkeypatch):
    """Of one that ends undecided, or is refused, there is nothing to count."""
    scene, start = load("moving-cap"), scenes.State(0.0, 0.1, 0.2, 30.0, 40.0)
    found = questions.count_hits(scene, start, 0.5)
    walls = fast.trajectory(scene, start, 1000, 0.5).walls
    assert found == {wall: walls.count(wall) for wall in scene.walls}
    assert questions.count_hits(scene, start, -1.0) is None
    carried = fast.flow(scene, [start], 0.5)
    open_end = carried._replace(outcomes=(scenes.Undecided("shy"),))
    monkeypatch.setattr(fast, "flow", lambda *_: open_end)
    assert questions.count_hits(scene, start, 0.5) is None
