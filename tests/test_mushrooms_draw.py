"""Pictures: orbits and their exports, the command, ensembles, what heats fastest, typeset formulas."""

import csv
import io
import itertools
import math
import re
from pathlib import Path

import msgspec
import numpy as np
import pyarrow.parquet
import pytest
from matplotlib.text import Text
from mpmath import fp
from PIL import Image
from support.depth import deep_but
from support.refusals import one_line

import fast
import reference
import scene as scenes
import theory
from docs.pictures import BLOCK
from mushrooms import lyapunov, orbits
from mushrooms.figures import energies, orbits as pictures, style, table as tables
from mushrooms.figures.heating import Loop, fastest, moving_cap, phase_diagram, supremum, switched
from mushrooms.reports.page import as_json, typeset
from scene import BangBang, Mushroom, load
from scene.geometry import table_at

STATIC = scenes.load("frozen-mushroom")
MOVING = scenes.load("moving-cap")
N_COLLISIONS, ENERGY, SEED = 300, 1e5, 3


@pytest.fixture(scope="module")
def moving():
    followed = orbits.follow(MOVING, N_COLLISIONS, energy=ENERGY, seed=SEED, n_orbits=6)
    assert len(followed) == 6
    return followed


def whispering(scene: scenes.Scene = STATIC, n: int = N_COLLISIONS) -> orbits.FollowedOrbit:
    """Return an orbit in the cap that never sees the mouth."""
    return orbits.from_state(scene, scenes.State(0.0, 0.9, 0.0, 0.05, 1.0), n)


def test_an_orbit_is_the_particle_of_the_ensemble(moving):
    ensemble = fast.simulate(MOVING, n_particles=6, energy=10.0, seed=SEED)
    followed = orbits.follow(MOVING, 1, energy=10.0, seed=SEED, n_orbits=6)
    assert len(followed) == 6
    for i, orbit in enumerate(followed):
        assert orbit.energies()[0] == pytest.approx(10.0, rel=1e-14)
        whole = fast.trajectory(MOVING, orbit.start, 10**6, math.tau).outcome
        assert isinstance(whole, scenes.Horizon)
        assert whole.x == pytest.approx(ensemble.x[i], abs=1e-6)


@pytest.mark.parametrize("crossings", [60.0, 4.0])
def test_a_particle_of_the_usual_energy_crosses_the_table_so_often_in_a_cycle(crossings):
    """A table at rest has no cycle: there the speed is 1 for sixty crossings."""
    for scene in (MOVING, load("fermi-ulam"), load("fixed-cap-clockwise")):
        speed = (2 * orbits.usual_energy(scene, crossings)) ** 0.5
        assert speed * scene.period == pytest.approx(crossings * table_at(fp, scene, 0.0).size)
    assert (2 * orbits.usual_energy(STATIC, crossings)) ** 0.5 == pytest.approx(crossings / 60)
    assert orbits.usual_energy(MOVING) == orbits.usual_energy(MOVING, 60.0)


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
        r = float(MOVING.laws["r"].value(fp, t))
        assert section.sin_phi[3] == pytest.approx(theory.sin_phi_hat(np, x, y, vx, vy, r), rel=1e-12)
        assert section.nu[3] == pytest.approx(float(MOVING.laws["nu"].value(fp, t)), rel=1e-12)
        assert np.all((section.place >= 0) & (section.place <= 1) & (np.abs(section.sin_phi) <= 1 + 1e-12))


CLOSING = Mushroom(r=1.0, h=1.0, nu=BangBang(((0.0, 0.9), (0.5, 0.1), (1.0, 0.9))))


@pytest.mark.parametrize(
    ("scene", "start", "wall", "captured"),
    [
        # In a mouth at rest |sin phi| decides, and a mirror in the base does not change it.
        (STATIC, (0.9, 0.05, 0.1, -1.0), "base", True),
        (STATIC, (0.9, 0.05, 0.1, 1.0), "arc", True),
        (CLOSING, (0.7, -0.05, 0.0, 1.5), "arc", False),  # through a mouth that has closed behind it
    ],
)
def test_a_particle_is_captured_from_the_flight_that_begins_in_the_cap(scene, start, wall, captured):
    one = orbits.from_state(scene, scenes.State(0.0, *start), 2)
    assert (one.walls[0], one.captured().tolist()) == (wall, [captured, True, True])


def test_a_wrong_edge_would_be_seen():
    """Were the mouth half as wide, orbits that leave the cap would count as captured."""
    crossed = [0, 0]
    for orbit in orbits.follow(STATIC, N_COLLISIONS, n_orbits=4, seed=1):
        section = orbit.section()
        is_below = np.isin([*orbit.walls[1:], ""], ["left", "right", "floor"])[section.collision]
        for i, nu in enumerate((STATIC.nu, STATIC.nu / 2)):
            crossed[i] += np.count_nonzero(is_below & (np.abs(section.sin_phi) > nu))
    assert crossed[0] == 0 < crossed[1]


def test_energies_follow_theory_given_the_stays():
    for orbit in orbits.follow(MOVING, 6000, energy=1e7, seed=SEED, n_orbits=2):
        gain = np.log(orbit.energies() / orbit.energies()[0])
        assert (
            np.abs(gain - orbit.adiabatic()).max() < 0.12
        )  # a particle's own wander, about E^(-1/4) in size
    captive = whispering(scenes.load("breathing-circle"))
    first, last = captive.states()[[0, -1], 0]
    ratio = captive.scene.laws["r"].value(fp, first) / captive.scene.laws["r"].value(fp, last)
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


def test_a_chaotic_orbit_stretches_and_an_island_keeps_its_angle_and_does_not():
    free = next(o for o in orbits.follow(STATIC, 64, n_orbits=4, seed=1) if not o.captured().any())
    assert np.ptp(np.abs(free.section().sin_phi)) > 0.3
    found = lyapunov.stretching(free)
    assert found.exponent > 5 * found.error > 0
    assert found.logs.mean() == pytest.approx(found.exponent)
    assert found.exponents[-1] == found.exponent
    section = whispering().section()
    assert section.is_captured().all()
    assert np.ptp(np.abs(section.sin_phi)) < 1e-10
    assert abs(lyapunov.stretching(whispering(n=64)).exponent) < 3 * math.log(64) / 64
    with pytest.raises(scenes.BadInput, match="collisions = 31, must be >= 32"):
        lyapunov.stretching(whispering(n=31))


def test_a_stretch_is_that_of_one_deviation_in_units_of_the_table_and_the_speed(monkeypatch):
    """It begins at right angles to the motion. Against the product of all Jacobians, and blocks by hand."""
    [orbit] = orbits.follow(MOVING, 37, energy=2.0, seed=4)
    random = np.random.default_rng(1).normal(0.0, 1.0, (37, 5, 5))
    monkeypatch.setattr(lyapunov, "jacobians", lambda *_: random)
    found = lyapunov.stretching(orbit)
    states = orbit.states()
    size = max(np.ptp(states[:, 1]), np.ptp(states[:, 2]))
    speeds = [math.hypot(*row[3:]) for row in states.tolist()]
    assert max(speeds) > 1.2 * min(speeds)
    vx, vy = states[0, 3:] / speeds[0]
    deviation = np.array([0.0, -size * vy, size * vx, -speeds[0] * vy, speeds[0] * vx]) / math.sqrt(2)
    sizes = [1.0]
    for matrix, speed in zip(random, speeds[1:], strict=True):
        deviation = matrix @ deviation
        t, x, y, *turn = deviation
        sizes.append(math.hypot(t * speed / size, x / size, y / size, *(v / speed for v in turn)))
    logs = np.diff(np.log(sizes))
    assert found.logs == pytest.approx(logs)
    assert found.exponents == pytest.approx([logs[: k + 1].mean() for k in range(37)])
    blocks = [logs[5 + 2 * k : 7 + 2 * k].mean() for k in range(16)]
    assert found.error == pytest.approx(np.std(blocks, ddof=1) / 4)
    assert found.exponent == pytest.approx(logs.mean())
    assert found.flight == pytest.approx((states[-1, 0] - states[0, 0]) / 37)


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
    orbit.write(tmp_path / "orbit.parquet")
    rows = list(csv.DictReader((tmp_path / "orbit.csv").read_text().splitlines()))
    table = pyarrow.parquet.read_table(tmp_path / "orbit.parquet")
    assert table.column_names == list(rows[0])
    assert [row["wall"] for row in rows[1:]] == orbit.walls
    for name, column in zip(("t", "x", "y", "vx", "vy"), orbit.states().T.tolist(), strict=True):
        assert [float(row[name]) for row in rows] == table[name].to_pylist() == column
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


@pytest.mark.parametrize("name", deep_but(["fermi-ulam", "breathing-circle"], "breathing-circle"))
def test_where_nothing_can_be_captured_no_figure_speaks_of_it(name):
    found = orbits.follow(scenes.load(name), 64, n_orbits=2, seed=1)
    figures = [pictures.section(found), pictures.collision_map(found), pictures.exponents(found)]
    figures += [pictures.energy_in_time(found[0]), pictures.trajectory(found[0])]
    said = " ".join(text.get_text() for figure in figures for text in figure.findobj(Text))
    assert not re.search("captured|free|stays", said)


def test_the_section_of_a_stem_is_phase_and_velocity():
    """After a hit of the floor at h'(t) the velocity is the old one less twice the floor's."""
    stem = scenes.load("fermi-ulam")
    [orbit] = orbits.follow(stem, 500, energy=1.8, seed=1)
    at_floor = np.flatnonzero(np.array(orbit.walls) == "floor")
    states, (phase, velocity) = orbit.states(), orbit.phase_section().T
    assert velocity.tolist() == states[at_floor + 1, 4].tolist()
    rate = np.array([float(stem.laws["h"].value(fp, t * stem.period, 1)) for t in phase])
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
        assert isinstance(orbit.outcome, scenes.Horizon)
        assert orbit.outcome.t == pytest.approx(3 * MOVING.period)
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


NAME, NINE = "moving-cap", np.zeros(9)
HINT = "scene.load('moving-cap')"


@pytest.mark.parametrize(
    ("call", "given", "words"),
    [
        *(
            (call, (NAME,), "must be what mushrooms")
            for call in (pictures.section, pictures.collision_map, pictures.trajectory)
        ),
        *((call, (NAME,), HINT) for call in (tables.phases, orbits.usual_energy, orbits.boundary)),
        (tables.new_strip, (NAME, 3.0, 3.0), HINT),
        *(
            (picture, given, words)
            for picture in (energies.histogram, energies.growth)
            for given, words in (
                ((NAME, 1e4, NINE), HINT),
                ((MOVING, 1e4, np.zeros(1)), "gains: 1 particles"),
                ((MOVING, 1e4, [0.0, np.nan, np.inf]), "gains: 1 particles"),
                *(((MOVING, 1e4, gains), f"gains = {gains!r}") for gains in ("moving-cap", 1.0, None)),
                ((MOVING, -1.0, NINE), "energy = -1.0"),
            )
        ),
    ],
)
def test_a_figure_refuses_what_it_cannot_draw(call, given, words):
    assert words in one_line(call, *given)


@pytest.mark.parametrize("suffix", deep_but(["png", "gif"], "gif"))
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
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {*out.split(), "orbit.csv-metadata.json"}
    assert len((tmp_path / "orbit.csv").read_text().splitlines()) == 102


KINDS = {"pdf": b"%PDF", "gif": b"GIF89a", "svg": b"<?xml", "png": b"\x89PNG"}


OF_A_PATH = ("--trajectory", "--collisions", 20, "--seed", 4)
CASES = [(suffix, "untilted", *kind) for suffix in KINDS for kind in ((), OF_A_PATH)]
CASES += [("svg", name) for name in scenes.catalogue() if name != "moving-cap-as-printed"]
NOT_DEEP = ("svg", "untilted", *OF_A_PATH)


@pytest.mark.parametrize("case", deep_but(CASES, NOT_DEEP))
def test_every_scene_has_a_picture_of_any_kind_and_the_same_bytes_again(
    command_line, tmp_path, monkeypatch, case
):
    suffix, name, *options = case
    monkeypatch.chdir(tmp_path)
    path, out = tmp_path / f"{name}.{suffix}", [] if suffix == "svg" else ["--out", f"{name}.{suffix}"]
    ended = command_line("draw", name, *options, *out)
    assert (ended.code, ended.out, list(tmp_path.iterdir())) == (0, f"{path.name}\n", [path])
    first = path.read_bytes()
    assert first.startswith(KINDS[suffix])
    if suffix != "gif":  # whose frames take longer
        command_line("draw", name, *options, *out)
        assert path.read_bytes() == first


def test_residuals_tell_another_theory():
    """Energies drawn from the theory lie within it; those of the reversed cycle do not."""
    drawn = theory.at_energy(load("moving-cap"), 1e7).draw(1, 20_000, 3)[:, 0]
    pulls = {}
    for name in ("moving-cap", "moving-cap-reversed"):
        figure = energies.histogram(load(name), 1e7, drawn)
        line = figure.axes[1].lines[-1].get_ydata()
        pulls[name] = float(np.sqrt(np.nanmean(np.square(line))))
    assert pulls["moving-cap"] < 1.3
    assert pulls["moving-cap-reversed"] > 5


def labels(axes) -> list[str]:
    return axes.get_legend_handles_labels()[1]


def test_a_scene_without_theory_is_drawn_alone():
    assert energies.known(load("breathing-circle"), 1e4) is None
    figure = energies.histogram(load("breathing-circle"), 1e4, np.linspace(-1e-3, 1e-3, 50), 60)
    [axes] = figure.axes
    assert labels(axes) == ["simulation"]
    assert (axes.patches[0].get_data().values > 0).sum() > 20  # bars as wide as the energies ask for
    assert axes.get_title().endswith("60 particles\n(10 of them never free, or lost: left out)")


OWN = Mushroom(
    r=1.0,
    slope=0.08,
    w=BangBang(((0.0, 0.9), (1.0, 0.9), (2.0, 0.4), (3.0, 0.4), (4.0, 0.9))),
    h=BangBang(((0.0, 0.6), (1.0, 1.5), (2.0, 1.5), (3.0, 0.6), (4.0, 0.6))),
)


def test_the_captured_of_an_own_scene_are_drawn():
    """Their density is that of theory: its area is the captured share."""
    drawn = theory.energies(OWN)
    run = fast.simulate(OWN, n_particles=300, energy=1e6, seed=1)
    [axes] = energies.histogram(OWN, 1e6, np.log(run.energy / 1e6)[run.takes_part()], 300).axes
    captured, free = axes.lines[-2:]
    assert labels(axes) == ["simulation", "theory, captured, at high energies", "theory, never captured"]
    assert np.trapezoid(captured.get_ydata(), captured.get_xdata()) == pytest.approx(1 - drawn.p_nc, rel=0.02)
    assert free.get_xdata()[0] == pytest.approx(drawn.s_nc)


@pytest.mark.parametrize("n_blocks", [1, 3])
def test_growth_shows_means_and_theory_of_each_cycle(n_blocks):
    run = fast.simulate(load("moving-cap"), n_particles=200, energy=1e4, n_cycles=3, seed=2)
    gains = np.log(run.cycle_energies / run.energy0)
    figure = energies.growth(load("moving-cap"), 1e4, iter(np.array_split(gains, n_blocks)))
    left, right = figure.axes
    [mean] = [one for one in left.containers if one.get_label() == "mean"]
    assert mean.lines[0].get_ydata() == pytest.approx([0.0, *gains.mean(axis=0)])
    told = dict(zip(labels(left), left.get_legend_handles_labels()[0], strict=True))
    [line] = [one for name, one in told.items() if name.startswith("theory, m1")]
    assert np.abs(line.get_ydata()[1:] - gains.mean(axis=0)).max() < 4 * gains.std() / 200**0.5
    assert line.get_ydata()[1] == pytest.approx(theory.at_energy(load("moving-cap"), 1e4).mean_s)
    assert any("theory at this energy" in name for name in labels(right))


@pytest.mark.parametrize("energy", [1e4, 1e6])
def test_all_lines_of_a_panel_are_of_one_energy(energy):
    """At 1e4 the retraced arc spreads twice as far as in the limit, by which its sd was once drawn."""
    scene = load("retraced-arc")
    gains = np.random.default_rng(1).normal(0.1, 0.5, (40, 3))
    above = energies.growth(scene, energy, gains).axes[0]
    told = dict(zip(labels(above), above.get_legend_handles_labels()[0], strict=True))
    [mean] = [line for name, line in told.items() if name.startswith("theory, m1")]
    dotted = [line for line in above.lines if line.get_linestyle() == ":"]
    there = theory.at_energy(scene, energy)
    for edge, sign in zip(dotted, (-1, 1), strict=True):
        spread = sign * (edge.get_ydata() - mean.get_ydata())
        assert spread[1] == pytest.approx(there.variance_s**0.5)
        assert spread[2] < 2**0.5 * spread[1]  # the second cycle is a little faster


@pytest.mark.parametrize(
    ("scene", "energy"), [(OWN, 1e6), (load("retraced-arc"), 1e4), (load("moving-cap"), 1e4)]
)
def test_a_curve_of_theory_stays_in_its_frame_and_is_smooth(scene, energy):
    """The density of the captured has no bound where captures have the greatest gain."""
    run = fast.simulate(scene, n_particles=2000, energy=energy, seed=1)
    axes = energies.histogram(scene, energy, np.log(run.energy / energy)[run.takes_part()]).axes[0]
    [curve] = [line for line in axes.lines if len(line.get_xdata()) > 2]
    x, y = curve.get_data()
    low, high = axes.get_ylim()
    assert low <= y.min()
    assert y.max() < high
    bars = axes.patches[0].get_data()
    middle = (bars.edges[1:] + bars.edges[:-1]) / 2
    width = bars.edges[1] - bars.edges[0]
    known = energies.known(scene, energy)
    if known is not None:  # at steps of a quarter of a bar; 0.06 where single point masses show
        quarters = np.interp(np.arange(x[0], x[-1], width / 4), x, y)
        assert np.abs(np.diff(quarters, 2)).max() < 0.02 * y.max()
    below = theory.energies(scene).captured_below if known is None else known.cdf
    assert np.interp(middle, x, y) == pytest.approx(np.diff(below(bars.edges)) / width, abs=0.05 * y.max())


def test_the_legend_of_a_path_stands_below_its_axes(moving):
    """Once far below: a table keeps its shape, and the figure what it leaves."""
    flat = scenes.Stem(w=4.0, h=scenes.Fourier(mean=1.0, cos=(0.1,), omega=1.0))
    for orbit in (moving[0], orbits.follow(flat, 40, energy=1e3, seed=1)[0]):
        figure = pictures.trajectory(orbit)
        figure.draw_without_rendering()
        axes = figure.axes[0]
        label, legend = axes.xaxis.label.get_window_extent(), axes.get_legend().get_window_extent()
        assert 0 < label.y0 - legend.y1 < 0.3 * figure.dpi


def test_the_particle_of_the_gallery_is_captured():
    """The page explains a black line and a shade."""
    page = (Path(__file__).parent.parent / "docs" / "gallery.md").read_text("utf-8")
    [code] = [code for name, code in BLOCK.findall(page) if name == "gallery-particle.png"]
    given = {"moving_cap": MOVING, "orbits": orbits, "pictures": pictures}
    exec(code, given)
    shown = given["figure"].axes[0].get_legend_handles_labels()[1]
    assert shown == ["this particle", "theory with these captures", "theory, never captured", "captured"]


def test_a_notebook_is_given_every_figure(moving):
    """It asks an object for its picture; pyplot is never loaded, which would answer for a plain figure."""
    ensemble = [energies.histogram(MOVING, 1e4, NINE), energies.growth(MOVING, 1e4, np.ones((9, 2)))]
    single = [make(moving[0]) for make in (pictures.trajectory, pictures.energy_in_time)]
    several = [make(moving[:1]) for make in (pictures.section, pictures.collision_map)]
    for figure in (
        *ensemble,
        *single,
        *several,
        style.new_figure(1.0, 1.0)[0],
        tables.new_strip(MOVING, 3.0, 3.0),
    ):
        assert Image.open(io.BytesIO(figure._repr_png_())).format == "PNG"


PAGE = Path(__file__).parent.parent / "docs" / "heating.md"


# m1, and depth and mouth at the ends of legs that last as long: of switched loops, and of simple ones.
H = (6.0, 6.0, 0.1, 0.1, 6.0, 6.0, 0.1, 0.1, 6.0)
W = (1.0, 0.1, 0.1, 0.02, 0.02, 0.1, 0.1, 1.0, 1.0)
LOOPS = [(switched(0.1, 6.0, 0.02, 0.1), H, W)]
for a, b, w0, w1 in (
    *((6.0, 2.0, 0.3, 1.0), (2.0, 6.0, 0.3, 1.0), (6.0, 0.1, 0.02, 1.0), (0.1, 6.0, 0.02, 1.0)),
    (1.0, 3.0, 0.5, 0.9),
):
    LOOPS.append((Loop(a, b, w0, w1).m1, (a, a, b, b, a), (w1, w0, w0, w1, w1)))


@pytest.mark.parametrize(("m1", "h", "w"), LOOPS)
def test_a_loop_in_floats_is_the_theory_of_its_scene(m1, h, w):
    depth, mouth = (BangBang(tuple(zip(np.linspace(0, 1, len(h)), ends, strict=True))) for ends in (h, w))
    assert m1 == pytest.approx(float(theory.predict(Mushroom(r=1.0, h=depth, w=mouth), 8).m1), rel=2e-5)


def largest_gain(shallowest: float, deepest: float, narrowest: float, n: int = 6000) -> float:
    """Return the largest m1 of all loops: dV = max(b - a - a log(b / a) - a V) |d delta|, narrow to wide."""
    edges = np.geomspace(narrowest, 1.0, n + 1)
    deltas = theory.delta(np, edges)
    middles = np.sqrt(edges[1:] * edges[:-1])
    zones = 1 - theory.delta(np, middles) + 4 / np.pi * middles * np.linspace(shallowest, deepest, 5)[:, None]
    a, b = 1 / zones[:, None], 1 / zones[None, :]
    gain = b - a - a * np.log(b / a)
    found = 0.0
    for k in range(n):
        found += float(np.max(gain[..., k] - a[..., k] * found)) * (deltas[k] - deltas[k + 1])
    return found


@pytest.mark.parametrize("bounds", [(2.0, 6.0, 0.3), (0.1, 6.0, 0.02), (0.0, 20.0, 0.3), (0.1, 20.0, 0.02)])
def test_no_loop_within_bounds_gains_more_than_the_supremum(bounds):
    shallowest, deepest, narrowest = bounds
    found, switch = supremum(*bounds)
    assert found == pytest.approx(largest_gain(*bounds), rel=2e-4)
    assert narrowest < switch <= 1
    ends = Loop(deepest, shallowest, narrowest).m1, Loop(shallowest, deepest, narrowest).m1
    assert found >= max(ends) * (1 - 1e-9)
    assert (ends[1] > ends[0]) == (narrowest == 0.3)  # clockwise wins only if the mouth stays wide


def test_clockwise_has_no_bound_in_depth_anticlockwise_none_only_if_the_mouth_closes_too():
    limit = -math.log(1 - float(theory.delta(np, 0.1)))
    assert Loop(1e7, 0.0, 0.1).m1 == pytest.approx(limit, rel=1e-4)
    first, second = Loop(0.0, 1e7, 0.1), Loop(0.0, 1e9, 0.1)
    assert second.m1 - first.m1 == pytest.approx((1 - first.free_share) * math.log(100), rel=1e-5)
    shut = [supremum(2.0, 6.0, w)[0] for w in (1e-4, 1e-9, 1e-15, 1e-30)]
    assert shut == sorted(shut)
    assert shut[3] == pytest.approx(shut[2], rel=1e-2)


def test_the_moving_cap_is_trivial_in_phase_and_gains_with_the_square_of_the_amplitude():
    found = phase_diagram(np.array([0.0, math.pi / 2, math.pi]), np.array([0.1, 0.2]))
    assert np.abs(found[:, 0]).max() < 1e-12
    assert found[1, 2] / found[0, 2] == pytest.approx(4, rel=0.05)
    assert (found[:, 2] > found[:, 1]).all()
    assert theory.predict(moving_cap(4.0, 0.6, 0.6), 6).m1 > 0


def test_the_page_says_what_the_code_finds():
    lines = [line for line in PAGE.read_text("utf-8").splitlines() if re.match(r"\| [\d.]+ \|", line)]
    numbers = [list(map(float, re.findall(r"[\d.]+", line))) for line in lines]
    loops, rates = ([row for row in numbers if len(row) == n] for n in (7, 6))
    assert (len(loops), len(rates)) == (4, 3)
    for h0, h1, w0, anticlockwise, clockwise, largest, switch in loops:
        assert Loop(h1, h0, w0).m1 == pytest.approx(anticlockwise, abs=6e-5)
        assert Loop(h0, h1, w0).m1 == pytest.approx(clockwise, abs=6e-5)
        assert supremum(h0, h1, w0) == (pytest.approx(largest, abs=6e-5), pytest.approx(switch, abs=6e-4))
    for h0, w0, *columns in rates:
        for clockwise, h1, rate in ((False, *columns[:2]), (True, *columns[2:])):
            best, found = fastest(w0, h0, clockwise=clockwise)
            assert (max(best[:2]), best.w0) == (pytest.approx(h1, abs=6e-3), pytest.approx(w0, rel=1e-3))
            assert found == pytest.approx(rate, abs=6e-6)
            assert found == pytest.approx(best.m1 / best.path)
            assert (best.closing < best.opening) == clockwise
            # Neither a shorter nor a longer stroke of h, nor a wider mouth, gains more.
            for stroke, w in itertools.product((0.9, 1.0, 1.1), (1.0, 1.2)):
                depths = [h if h == h0 else h * stroke for h in best[:2]]
                near = Loop(*depths, best.w0 * w)
                assert near.m1 / near.path <= found * (1 + 1e-6)


@pytest.mark.parametrize(
    ("write", "given", "text"),
    [
        *((style.power, *row) for row in ((50.0, "50"), (2500.0, "2500"), (1e5, "$10^{5}$"))),
        (style.power, 2.5e-7, r"$2.5\cdot10^{-7}$"),
        (as_json, {"notes": "the captions' nu, größer"}, '{"notes": "the captions\' nu, größer"}'),
        (typeset, "p_nc", "<i>p</i><sub>nc</sub>"),
        (typeset, "E0^(-1/4)", "<i>E</i><sub>0</sub><sup>−1/4</sup>"),
        (typeset, "dV_ell / V_cha", "<i>dV</i><sub>ell</sub> / <i>V</i><sub>cha</sub>"),
        (typeset, "log E1/E0", "log <i>E</i><sub>1</sub>/<i>E</i><sub>0</sub>"),
        (typeset, "sigma_w <= 10^-25", "<i>σ</i><sub>w</sub> ≤ 10<sup>−25</sup>"),
        (typeset, "x^2 + y^2", "x<sup>2</sup> + y<sup>2</sup>"),
        (typeset, "nu(t)", "<i>ν</i>(t)"),
        (typeset, "<script>a_b</script>", "&lt;script&gt;<i>a</i><sub>b</sub>&lt;/script&gt;"),
        *((typeset, prose, prose) for prose in ("M1 and X2, see L7", "theory/equations.md", "sec. 4.1")),
        *((typeset, prose, prose) for prose in ("numbers", "minus 3 sd at n = 30", "moving-cap@1e7")),
    ],
)
def test_numbers_data_and_formulas_are_written_as_a_reader_sees_them(write, given, text):
    """Prose is left alone, and markup escaped."""
    assert write(given) == text
