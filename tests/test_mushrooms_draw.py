"""Orbits and their pictures: starts, sections, capture intervals, exponents, exports, the command."""

from __future__ import annotations

import csv
import itertools
import math

import msgspec
import numpy as np
import pyarrow.parquet
import pytest
from matplotlib.text import Text
from mpmath import fp
from PIL import Image
from support.depth import deep_but

import fast
import reference
import scene as scenes
import theory
from mushrooms import lyapunov, orbits
from mushrooms.figures import orbits as pictures
from mushrooms.figures import table as tables
from scene.laws import value

STATIC = scenes.load("frozen-mushroom")
MOVING = scenes.load("moving-cap")
N_COLLISIONS, ENERGY, SEED = 300, 1e5, 3


@pytest.fixture(scope="module")
def moving():
    return orbits.follow(MOVING, N_COLLISIONS, energy=ENERGY, seed=SEED, n_orbits=6)


def whispering(scene: scenes.Scene = STATIC, n: int = N_COLLISIONS) -> orbits.FollowedOrbit:
    """Return an orbit in the cap that never sees the mouth."""
    return orbits.from_state(scene, scenes.State(0.0, 0.9, 0.0, 0.05, 1.0), n)


def test_an_orbit_is_the_particle_of_the_ensemble(moving):
    ensemble = fast.simulate(MOVING, n_particles=6, energy=10.0, seed=SEED)
    for i, orbit in enumerate(orbits.follow(MOVING, 1, energy=10.0, seed=SEED, n_orbits=6)):
        assert orbit.energies()[0] == pytest.approx(10.0, rel=1e-14)
        whole = fast.trajectory(MOVING, orbit.start, 10**6, math.tau).outcome
        assert isinstance(whole, scenes.Horizon)
        assert whole.x == pytest.approx(ensemble.x[i], abs=1e-6)


def test_places_between_collisions_are_on_the_path(moving):
    orbit = moving[0]
    states = orbit.states()
    assert np.array_equal(orbit.at(states[:, 0]), states[:, 1:3])
    t = 0.5 * (states[4, 0] + states[5, 0])
    x = states[4, 1] + (t - states[4, 0]) * states[4, 3]
    assert orbit.at(np.array([t]))[0, 0] == pytest.approx(x, rel=1e-12)


def test_the_section_is_eq_sinphi_before_the_bounce(moving):
    for orbit in moving:
        section, states = orbit.section(), orbit.states()
        k = int(section.collision[3])
        _, _, _, vx, vy = states[k]
        t, x, y, _, _ = states[k + 1]
        r = float(value(fp, MOVING.r, t))
        assert section.sin_phi[3] == pytest.approx(theory.sin_phi_hat(np, x, y, vx, vy, r), rel=1e-12)
        assert section.nu[3] == pytest.approx(float(value(fp, MOVING.nu, t)), rel=1e-12)
        assert np.all((section.place >= 0) & (section.place <= 1) & (np.abs(section.sin_phi) <= 1 + 1e-12))


def test_who_goes_to_the_arc_by_way_of_the_base_is_captured_from_the_start():
    """In a mouth at rest |sin phi| decides, and a mirror in the base does not change it."""
    walls = set()
    for vy in (-1.0, 1.0):
        one = orbits.from_state(STATIC, scenes.State(0.0, 0.9, 0.05, 0.1, vy), N_COLLISIONS)
        walls.add(one.walls[0])
        assert one.captured().all()
    assert walls == {"base", "arc"}


def test_who_meets_the_arc_through_a_mouth_that_closed_behind_was_not_captured_before():
    closing = scenes.BangBang(knots=((0.0, 0.9), (0.5, 0.1), (1.0, 0.9)))
    table = scenes.Mushroom(r=1.0, h=1.0, nu=closing)
    one = orbits.from_state(table, scenes.State(0.0, 0.7, -0.05, 0.0, 1.5), 1)
    assert one.walls == ["arc"]
    assert one.captured().tolist() == [False, True]


def test_an_island_keeps_its_angle_and_a_chaotic_orbit_does_not():
    section = whispering().section()
    assert section.is_captured().all()
    assert np.ptp(np.abs(section.sin_phi)) < 1e-10
    free = next(o for o in orbits.follow(STATIC, N_COLLISIONS, n_orbits=4, seed=1) if not o.captured().any())
    assert np.ptp(np.abs(free.section().sin_phi)) > 0.3


def test_a_wrong_edge_would_be_seen():
    """Were the mouth half as wide, orbits that leave the cap would count as captured."""
    wide = orbits.follow(STATIC, N_COLLISIONS, n_orbits=4, seed=1)
    narrow = msgspec.structs.replace(STATIC, nu=STATIC.nu / 2)
    n_below = [
        np.count_nonzero(np.isin(o.walls, ["left", "right", "floor"]) & o.captured()[1:]) for o in wide
    ]
    assert sum(n_below) == 0
    crossed = 0
    for orbit in wide:
        section = orbit.section()
        beyond = section.collision[np.abs(section.sin_phi) > narrow.nu]
        after = [orbit.walls[k + 1] for k in beyond if k + 1 < len(orbit.walls)]
        crossed += sum(wall in ("left", "right", "floor") for wall in after)
    assert crossed > 0


def test_energies_follow_theory_given_the_stays():
    for orbit in orbits.follow(MOVING, 6000, energy=1e7, seed=SEED, n_orbits=2):
        gain = np.log(orbit.energies() / orbit.energies()[0])
        assert (
            np.abs(gain - orbit.adiabatic()).max() < 0.12
        )  # a particle's own wander, about E^(-1/4) in size
    captive = whispering(scenes.load("breathing-circle"))
    first, last = captive.states()[[0, -1], 0]
    ratio = value(fp, captive.scene.r, first) / value(fp, captive.scene.r, last)
    assert captive.adiabatic()[-1] == pytest.approx(2 * math.log(ratio), rel=1e-9)
    with pytest.raises(theory.NotCovered):
        orbits.follow(scenes.load("fermi-ulam"), 10)[0].adiabatic()


@pytest.mark.parametrize("name", ["moving-cap", "fermi-ulam", "breathing-circle"])
def test_the_boundary_map_keeps_to_its_slots(name):
    scene = scenes.load(name)
    [orbit] = orbits.follow(scene, N_COLLISIONS, seed=2)
    slots = orbits.boundary(scene)
    assert (slots[0].begin, slots[-1].end) == (0.0, 1.0)
    for wall, (place, sine) in zip(orbit.walls, orbits.boundary_map(orbit), strict=True):
        assert any(slot.wall == wall and slot.begin <= place <= slot.end for slot in slots)
        assert abs(sine) <= 1 + 1e-12
    if name != "fermi-ulam":  # at the arc the section has the other sense
        at_arc = orbit.section()
        assert (
            np.sign(orbits.boundary_map(orbit)[at_arc.collision, 1]).tolist()
            == np.sign(-at_arc.sin_phi).tolist()
        )


def test_chained_jacobians_are_those_of_the_proved_trajectory():
    [orbit] = orbits.follow(MOVING, 6, seed=SEED)
    product = np.eye(5)
    for matrix in lyapunov.jacobians(orbit):
        product = matrix @ product
    proved = reference.trajectory(MOVING, orbit.start, 6, is_differentiated=True).jacobian
    assert proved is not None
    truth = np.array([[float(entry) for entry in row] for row in proved])
    scale = np.abs(truth).max()
    assert (
        np.abs(product - truth).max() < 1e-9 * scale
    )  # the orbit is the proved one but for rounding, stretched
    without_time = np.eye(5)
    for matrix in lyapunov.jacobians(orbit):
        without_time = (matrix - np.diag([1.0, 0, 0, 0, 0])) @ without_time  # dt in place of t + dt
    assert np.abs(without_time - truth).max() > 1e-3 * scale


def test_a_chaotic_orbit_stretches_and_an_island_does_not():
    free = next(o for o in orbits.follow(STATIC, 64, n_orbits=4, seed=1) if not o.captured().any())
    found = lyapunov.stretching(free)
    assert found.exponent > 5 * found.error > 0
    assert found.logs.mean() == pytest.approx(found.exponent)
    assert found.exponents[-1] == found.exponent
    still = lyapunov.stretching(whispering(n=64))
    assert abs(still.exponent) < 3 * math.log(64) / 64
    with pytest.raises(scenes.BadInput, match="collisions = 31, must be >= 32"):
        lyapunov.stretching(whispering(n=31))


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        (scenes.Undecided("more than 50000 evaluations"), "the reference is undecided, more than 50000"),
        (scenes.Undefined("corner"), "is not what the reference proves"),
    ],
)
def test_an_exponent_says_whose_doubt_it_is(monkeypatch, moving, outcome, words):
    monkeypatch.setattr(reference, "next_collision", lambda *_, **__: outcome)
    with pytest.raises(scenes.BadInput, match=f"^collision 1 of the orbit: .*{words}"):
        lyapunov.jacobians(moving[0])


def test_an_orbit_is_written_and_read_again(tmp_path, moving):
    orbit = moving[0]
    orbit.write(tmp_path / "orbit.csv")
    with (tmp_path / "orbit.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == N_COLLISIONS + 1
    first = scenes.State(*(float(rows[0][name]) for name in ("t", "x", "y", "vx", "vy")))
    assert first == orbit.start
    assert [row["wall"] for row in rows[1:]] == orbit.walls
    assert [float(row["x"]) for row in rows[1:]] == orbit.steps[:, 2].tolist()
    orbit.write(tmp_path / "orbit.parquet")
    table = pyarrow.parquet.read_table(tmp_path / "orbit.parquet")
    assert table["vy"].to_pylist() == orbit.states()[:, 4].tolist()
    assert table.column_names == list(rows[0])
    assert scenes.from_data(msgspec.json.decode(table.schema.metadata[b"scene"])) == MOVING
    with pytest.raises(scenes.BadInput, match=r"\.csv, \.parquet"):
        orbit.write(tmp_path / "orbit.txt")


def test_figures_are_returned(moving):
    assert [text.get_text() for text in pictures.trajectory(moving[0]).axes[0].texts if text.get_text()] == [
        "arc", "base", "left", "right", "floor", "mouth",
    ]  # fmt: skip
    labels = [text.get_text() for text in pictures.section(moving).legends[0].get_texts()]
    assert labels[0] == "edge |sin φ| = nu, nu = 0.2 to 1"
    assert pictures.collision_map(moving).axes
    lines = pictures.energy_in_time(moving[0]).axes[0].lines
    drawn = [line.get_label() for line in sorted(lines, key=lambda line: -line.get_zorder())]
    assert drawn == ["this particle", "theory with these captures", "theory, never captured"]  # from above


def words_of(figure) -> str:
    """Return everything that a figure says, in one line."""
    return " ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.parametrize("name", ["fermi-ulam", "breathing-circle"])
def test_where_nothing_can_be_captured_no_figure_speaks_of_it(name):
    found = orbits.follow(scenes.load(name), 64, n_orbits=2, seed=1)
    figures = [pictures.section(found), pictures.collision_map(found), pictures.exponents(found)]
    figures += [pictures.energy_in_time(found[0]), pictures.trajectory(found[0])]
    for figure in figures:
        assert "captured" not in words_of(figure)
        assert "free" not in words_of(figure)
        assert "stays" not in words_of(figure)


def test_the_section_of_a_stem_is_phase_and_velocity():
    """After a hit of the floor at h'(t) the velocity is the old one less twice the floor's."""
    stem = scenes.load("fermi-ulam")
    [orbit] = orbits.follow(stem, 500, energy=1.8, seed=1)
    at_floor = np.flatnonzero(np.array(orbit.walls) == "floor")
    states, (phase, velocity) = orbit.states(), orbit.phase_section().T
    assert velocity.tolist() == states[at_floor + 1, 4].tolist()
    rate = np.array([float(value(fp, stem.h, t * stem.period, 1)) for t in phase])
    assert velocity == pytest.approx(-states[at_floor, 4] - 2 * rate, abs=1e-9)
    depth, speed = orbit.phase_section(0.5).T
    assert depth == pytest.approx(orbit.at(orbit.instants(0.5))[:, 1])
    assert set(speed) <= set(states[:, 4])
    wide = scenes.Stem(w=stem.h, h=1.0)
    [other] = orbits.follow(wide, 500, energy=1.8, seed=1)
    assert len(other.phase_section()) == sum(wall in ("left", "right") for wall in other.walls)
    for one in (STATIC, scenes.Stem(w=1.0, h=1.0)):
        with pytest.raises(scenes.BadInput, match="of a stem that moves"):
            orbits.follow(one, 9)[0].phase_section()


def test_a_section_at_a_phase_has_a_point_a_cycle():
    found = orbits.follow(MOVING, energy=ENERGY, seed=SEED, n_cycles=3, n_orbits=2)
    for orbit in found:
        instants = orbit.instants(0.25)
        assert instants == pytest.approx(MOVING.period * np.array([0.25, 1.25, 2.25]))
        section = orbit.section().first_from(instants)
        assert np.all((section.t >= instants) & (section.t < instants + 0.05))
        assert section.nu == pytest.approx(MOVING.nu(instants), abs=0.05)
    [axes] = pictures.section(found, 0.25).axes
    assert axes.get_title().endswith("at t/T = 0.25")
    for phase, words in ((1.0, "phase = 1.0, must be"), (math.nan, "phase = nan")):
        with pytest.raises(scenes.BadInput, match=words):
            found[0].instants(phase)


def test_orbits_go_through_whole_cycles():
    [orbit] = orbits.follow(MOVING, energy=ENERGY, seed=SEED, n_cycles=2)
    assert isinstance(orbit.outcome, scenes.Horizon)
    assert orbit.outcome.t == pytest.approx(2 * MOVING.period)
    run = fast.simulate(MOVING, n_particles=1, energy=ENERGY, n_cycles=2, seed=SEED)
    assert len(orbit.walls) == pytest.approx(run.n_collisions[0], rel=0.2)  # chaos: rounded otherwise


OF_ORBITS, OF_TABLES = "must be what mushrooms", "is loaded by"


@pytest.mark.parametrize(
    ("call", "more", "words"),
    [
        (pictures.section, (), OF_ORBITS),
        (pictures.collision_map, (), OF_ORBITS),
        (pictures.trajectory, (), OF_ORBITS),
        (tables.phases, (), OF_TABLES),
        (tables.new_strip, (3.0, 3.0), OF_TABLES),
        (orbits.usual_energy, (), OF_TABLES),
        (orbits.boundary, (), OF_TABLES),
    ],
)
def test_a_figure_takes_no_name(call, more, words):
    with pytest.raises(scenes.BadInput, match=words):
        call("moving-cap", *more)


@pytest.mark.parametrize("suffix", ["png", "gif"])
def test_a_name_of_any_length_and_letter_is_a_title(command_line, tmp_path, recwarn, suffix):
    sizes = []
    for i, name in enumerate(["short", 1000 * "long" + "\\n" * 1000, "\U0001f344 $x$ \u00e4"]):
        path = tmp_path / f"{i}.toml"
        path.write_text(f'table = "cap"\nname = "{name}"\nr = 1.0\n', "utf-8")
        picture = tmp_path / f"{i}.{suffix}"
        assert command_line("draw", path, "--out", picture).code == 0
        sizes.append(Image.open(picture).size)
    assert np.ptp(sizes, axis=0).max() < 300  # pixels; without an end of lines, tens of thousands
    assert not [warning for warning in recwarn if "Glyph" in str(warning.message)]


def test_notebooks_show_scenes_predictions_and_ensembles():
    assert "<svg" in MOVING._repr_html_()
    assert "&lt;b&gt;" in msgspec.structs.replace(STATIC, name="<b>")._repr_html_()
    assert "0.122767964937387" in theory.predict(MOVING)._repr_html_()
    assert "sha256" in fast.simulate(MOVING, n_particles=3, energy=100.0)._repr_html_()


def test_the_command_draws_several_pictures_and_exports(command_line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = command_line(
        "draw", "moving-cap", "--section", "--map", "--particles", "3", "--collisions", "1e2",
        "--out", "orbits.png", "--export", "orbit.csv",
    )  # fmt: skip
    assert code == 0
    assert out.split() == ["orbit.csv", "orbits-section.png", "orbits-map.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(out.split())
    assert len((tmp_path / "orbit.csv").read_text().splitlines()) == 102


KINDS = {"pdf": b"%PDF", "gif": b"GIF89a", "svg": b"<?xml", "png": b"\x89PNG"}


OF_A_PATH = ("--trajectory", "--collisions", 20, "--seed", 4)
CASES = list(itertools.product(KINDS, [(), OF_A_PATH]))


@pytest.mark.parametrize("case", deep_but(CASES, ("svg", OF_A_PATH), ("png", ()), ("gif", ())))
def test_a_picture_has_the_kind_of_its_ending_and_the_same_bytes_again(command_line, tmp_path, case):
    suffix, kind = case
    path = tmp_path / f"path.{suffix}"
    assert command_line("draw", "untilted", *kind, "--out", path).code == 0
    first = path.read_bytes()
    assert first.startswith(KINDS[suffix])
    if suffix != "gif":  # whose frames take longer
        command_line("draw", "untilted", *kind, "--out", path)
        assert path.read_bytes() == first
