"""What the pictures of tables, orbits, energies and loops show, read from their artists.

The expected numbers are computed here, from the orbit, the ensemble or the theory that is drawn.
"""

import io
import itertools
import math

import msgspec
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.text import Annotation
from mpmath import fp
from PIL import Image
from support.artists import bars, labels, line, measured, said, with_errors, xy
from support.figure_words import PICTURES

import scene as scenes
import theory
from mushrooms import lyapunov, orbits
from mushrooms.figures import energies, heating, orbits as pictures, style, table as tables
from mushrooms.store.spec import RunSpec
from mushrooms.store.summary import predicted
from scene import State, load
from scene.geometry import table_at
from scene.mouth import start_time

MOVING, STEM, CAP = map(load, ("moving-cap", "fermi-ulam", "breathing-circle"))
WALLS = {
    "moving-cap": ["arc", "base", "left", "right", "floor"],
    "fermi-ulam": ["base", "left", "right", "floor"],
    "breathing-circle": ["arc", "base"],
}


@pytest.fixture(scope="module")
def moving() -> list[orbits.FollowedOrbit]:
    """Return orbits of some cycles: free ones, and such as are captured on the way."""
    return orbits.follow(MOVING, 200, energy=1e3, seed=3, n_orbits=4)


def drawn_walls(axes, scene, t) -> list:
    """Return the lines that are the walls at a time."""
    wanted = [np.transpose(part) for part in table_at(fp, scene, t).outline()]
    return [
        one
        for one in axes.lines
        if any(part.shape == np.shape(xy(one)) and np.allclose(part, xy(one)) for part in wanted)
    ]


@pytest.mark.parametrize("name", WALLS)
def test_a_path_is_drawn_flight_by_flight_among_its_walls(name):
    scene = load(name)
    [orbit] = orbits.follow(scene, 12, seed=2)
    axes = pictures.trajectory(orbit).axes[0]
    states = orbit.states()
    places = states[:, 1:3]
    [path] = [one for one in axes.collections if isinstance(one, LineCollection)]
    assert np.array(path.get_segments()) == pytest.approx(np.stack([places[:-1], places[1:]], axis=1))
    assert path.get_array().tolist() == sorted(path.get_array().tolist())  # later flights are lighter
    assert xy(line(axes, "start")) == (pytest.approx(places[0, :1]), pytest.approx(places[0, 1:]))
    begin, end = (drawn_walls(axes, scene, t) for t in states[[0, -1], 0])
    for shown, label in ((begin, "walls at the start"), (end, "walls at the end")):
        assert label in {one.get_label() for one in shown}
        assert len(shown) >= len(tables.walls(scene, 0.0))
    [arrow] = [one for one in axes.texts if isinstance(one, Annotation)]
    ahead = np.array(arrow.xy) - places[-1]
    assert ahead @ states[-1, 3:] == pytest.approx(math.hypot(*ahead) * math.hypot(*states[-1, 3:]))
    assert 0 < math.hypot(*ahead) < np.ptp(places, axis=0).max()
    assert f"{scene.name}: 12 collisions from E0 = " in axes.get_title()


@pytest.mark.parametrize("name", WALLS)
def test_a_wall_is_named_where_it_is(name):
    scene = {"moving-cap": MOVING, "fermi-ulam": STEM}.get(name, CAP)
    [orbit] = orbits.follow(scene, 5, seed=2)
    axes = pictures.trajectory(orbit).axes[0]
    now = table_at(fp, scene, orbit.start.t)
    names = {text.get_text(): text.get_position() for text in axes.texts if text.get_text()}
    assert sorted(names) == sorted([*WALLS[name], *(["mouth"] if name == "moving-cap" else [])])
    for wall, (x, y) in names.items():
        if wall == "mouth":
            assert abs(x) < now.w
            assert y == pytest.approx(0.0, abs=0.1 * now.size)
        else:
            assert abs(now.gap(wall, x, y)) < 0.1 * now.size
            assert {"left": x < 0, "right": x > 0, "base": abs(x) >= now.w or scene is STEM}.get(wall, True)
    if "mouth" in names:
        [mouth] = [one for one in axes.lines if one.get_color() == style.GREEN]
        assert xy(mouth) == (pytest.approx([-now.w, now.w]), pytest.approx([0, 0]))


def test_a_path_of_no_collision_is_refused():
    still = orbits.from_state(CAP, State(0.0, 0.0, 0.5, 0.0, 0.0), 3)
    for call, given in itertools.product(
        (pictures.section, pictures.collision_map, pictures.exponents), (still, [still], [])
    ):
        with pytest.raises(scenes.BadInput, match="nothing to draw"):
            call(given)


def points_drawn(axes) -> dict[str, np.ndarray]:
    """Return the small dots of a figure by colour, (n, 2) each."""
    dots = [one for one in axes.lines if one.get_marker() == "." and len(xy(one)[0])]
    return {str(one.get_color()): np.column_stack(xy(one)) for one in dots}


def as_rows(points) -> list:
    return sorted(map(tuple, np.asarray(points).tolist()))


@pytest.mark.parametrize("phase", [None, 0.25])
def test_a_section_shows_every_hit_of_the_arc_captured_ones_apart(moving, phase):
    figure = pictures.section(moving, phase)
    [axes] = figure.axes
    captured, free = [], []
    for orbit in moving:
        hits = orbit.section()
        if phase is not None:
            hits = hits.first_from(orbit.instants(phase))
        is_captured = np.abs(hits.sin_phi) > hits.nu
        rows = np.column_stack([hits.place, hits.sin_phi])
        captured += rows[is_captured].tolist()
        free += rows[~is_captured].tolist()
    found = points_drawn(axes)
    said = labels(axes)
    for colour, name, rows in ((pictures.CAPTURED, "captured", captured), (pictures.FREE, "free", free)):
        assert as_rows(found.get(colour, [])) == as_rows(rows)
        assert (f"{name}, {len(rows):,} hits" in said) is bool(rows)
    assert captured or phase
    assert free
    lowest, highest = 0.2, 1.0
    if phase is not None:  # nu = .6 + .4 cos t
        lowest = highest = 0.6 + 0.4 * math.cos(start_time(MOVING) + phase * MOVING.period)
        assert f"edge |sin φ| = nu, nu = {lowest:.3g}" in said
    flat = [xy(one)[1] for one in axes.lines if len(xy(one)[1]) == 2]
    edges = {sign * level for sign in (1, -1) for level in (lowest, highest)}
    assert sorted({round(y[0], 9) for y in flat if y[0] == y[1]}) == pytest.approx(sorted(edges))
    spans = sorted(sorted((one.get_y(), one.get_y() + one.get_height())) for one in axes.patches)
    wanted = [(-1, -highest), (-lowest, lowest), (highest, 1)]
    assert np.array(spans) == pytest.approx(np.array(wanted))
    assert (axes.get_xlim(), axes.get_ylim()) == ((0, 1), (-1, 1))
    assert len(figure.legends) == 1


def test_the_section_of_a_stem_has_a_colour_for_each_orbit():
    found = orbits.follow(STEM, 60, energy=1.8, seed=1, n_orbits=3)
    for phase in (None, 0.5):
        [axes] = pictures.section(found, phase).axes
        shown = points_drawn(axes)
        assert list(shown) == style.phase_colours(3)
        for orbit, points in zip(found, shown.values(), strict=True):
            assert points.tolist() == orbit.phase_section(phase).tolist()
        names = (axes.get_xlabel(), axes.get_ylabel())
        if phase is None:
            assert names == ("phase t/T of the hit of a moving floor", "vy after the hit [length/time]")
            assert axes.get_xlim() == (0, 1)
        else:
            assert names == ("y [length]", "vy [length/time]")
    wide = scenes.Stem(w=STEM.h, h=1.0)
    [axes] = pictures.section(orbits.follow(wide, 60, energy=1.8, seed=1)).axes
    assert axes.get_xlabel().endswith("a moving side")
    assert axes.get_ylabel().startswith("|vx|")


def test_a_table_without_a_mouth_has_hits_of_one_kind():
    [orbit] = orbits.follow(CAP, 40, seed=1)
    for figure, points, what in (
        (pictures.section(orbit), np.column_stack(orbit.section()[2:4]), "hits"),
        (pictures.collision_map(orbit), orbits.boundary_map(orbit), "collisions"),
    ):
        assert as_rows(np.vstack(list(points_drawn(figure.axes[0]).values()))) == as_rows(points)
        assert labels(figure.axes[0]) == [f"{len(points)} {what}"]
    [orbit] = orbits.follow(CAP, seed=1, energy=500.0, n_cycles=2)
    [axes] = pictures.section(orbit, 0.25).axes
    assert labels(axes) == ["2 hits"]  # the first one after the phase of each cycle


def test_the_boundary_map_has_every_collision_and_the_walls_in_their_slots(moving):
    [axes] = pictures.collision_map(moving).axes
    marks = np.vstack([orbits.boundary_map(orbit) for orbit in moving])
    captured = np.concatenate([orbit.captured()[1:] for orbit in moving])
    found = points_drawn(axes)
    assert as_rows(found[pictures.CAPTURED]) == as_rows(marks[captured])
    assert as_rows(found[pictures.FREE]) == as_rows(marks[~captured])
    slots = orbits.boundary(MOVING)
    ends = [float(xy(one)[0][0]) for one in axes.lines if len(xy(one)[0]) == 2 and np.ptp(xy(one)[0]) == 0]
    assert ends == pytest.approx([slot.end for slot in slots])
    for text, slot in zip(axes.texts, [slot for slot in slots if slot.end > slot.begin], strict=True):
        assert text.get_text() == slot.wall
        assert slot.begin < text.get_position()[0] < slot.end
    assert (axes.get_xlim(), axes.get_ylim()) == ((0, 1), (-1, 1))


@pytest.fixture(scope="module")
def later(moving) -> orbits.FollowedOrbit:
    """Return an orbit that begins a third of a cycle after theory's."""
    orbit = next(one for one in moving if 5 < np.count_nonzero(one.captured()) < 195)
    states = orbit.states()
    k = int(np.argmax(states[:, 0] > MOVING.period / 3))
    begin = msgspec.structs.replace(State(*states[k].tolist()), wall=orbit.walls[k - 1])
    return orbits.from_state(MOVING, begin, 150)


@pytest.mark.parametrize("begins_later", [False, True])
def test_the_energy_in_time_stands_beside_theory_and_captures_are_shaded(moving, later, begins_later):
    orbit = next(one for one in moving if 5 < np.count_nonzero(one.captured()) < 195)
    orbit = later if begins_later else orbit
    assert (orbit.start.t > 1.0) is begins_later
    [axes] = pictures.energy_in_time(orbit).axes
    states = orbit.states()
    time = (states[:, 0] - states[0, 0]) / MOVING.period
    v2 = states[:, 3] ** 2 + states[:, 4] ** 2
    free = theory.chaotic_zone(MOVING, states[:, 0]).log_energy
    for label, expected in (
        ("this particle", np.log(v2 / v2[0])),
        ("theory with these captures", orbit.adiabatic()),
        ("theory, never captured", free - free[0]),
    ):
        x, y = xy(line(axes, label))
        assert x == pytest.approx(time)
        assert y == pytest.approx(expected, abs=1e-12)
    [shade] = [one for one in axes.collections if isinstance(one, PolyCollection)]
    assert shade.get_label() == "captured"
    spans = [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in shade.get_paths()]
    captured = orbit.captured()
    middles = (time[1:] + time[:-1]) / 2
    is_shaded = np.array([any(low < t < high for low, high in spans) for t in middles])
    assert not (is_shaded & ~captured[:-1]).any()
    assert is_shaded[1:-1][captured[:-3] & captured[1:-2] & captured[2:-1]].all()
    assert is_shaded.any()
    assert axes.get_xlabel() == "t / T"


def test_the_energy_of_a_table_that_stands_still_is_drawn_against_time():
    [still] = orbits.follow(load("frozen-mushroom"), 9, seed=1)
    [axes] = pictures.energy_in_time(still).axes
    assert axes.get_xlabel() == "t [time]"
    assert xy(line(axes, "this particle"))[0] == pytest.approx(still.states()[:, 0])


def test_exponents_are_those_of_the_stretches_with_their_errors(monkeypatch):
    def stretched(orbit, progress):
        """Stand for proofs, which take long."""
        for k in range(len(orbit.walls)) if progress else ():
            progress(k + 1)
        return np.random.default_rng(int(1e6 * abs(orbit.start.x))).normal(0, 1, (len(orbit.walls), 5, 5))

    monkeypatch.setattr(lyapunov, "jacobians", stretched)
    found = orbits.follow(load("frozen-mushroom"), 32, n_orbits=2, seed=1)
    done: list[int] = []
    [axes] = pictures.exponents(found, done.append).axes
    assert done == list(range(1, 65))  # of both orbits, one after the other
    for k, (orbit, bar) in enumerate(zip(found, axes.containers, strict=True)):
        one = lyapunov.stretching(orbit)
        share = orbit.captured()[1:].mean()
        curve = line(axes, f"{one.exponent:.3f} ± {one.error:.3f} a collision, {share:.0%} of it captured")
        assert xy(curve) == (pytest.approx(np.arange(1, 33)), pytest.approx(one.exponents))
        last = with_errors(bar)
        assert (last.y.tolist(), last.errors) == ([one.exponent], pytest.approx(one.error))
        assert last.x == pytest.approx(32 * (1 + 0.01 * k))  # beside one another
    assert axes.get_xscale() == "log"
    assert any(xy(one)[1].tolist() == [0, 0] for one in axes.lines)  # an island falls to 0
    assert axes.get_title().startswith("frozen-mushroom: 2 particles from E0 = ")


def test_an_animation_shows_the_particle_where_it_is(moving, later, monkeypatch):
    shown = []

    def look(scene, axes, times, show, _file, _progress):
        for k in range(len(times)):
            show(k)
            trail, dot = axes.lines[-2:]
            shown.append((times[k], np.column_stack(xy(trail)), np.ravel(xy(dot)), axes.get_title()))

    monkeypatch.setattr(tables, "write_frames", look)
    for orbit in (moving[0], later, orbits.follow(load("frozen-mushroom"), 9, seed=1)[0]):
        shown.clear()
        pictures.write_animation(orbit, io.BytesIO(), 7)
        states, period = orbit.states(), orbit.scene.period
        assert [t for t, *_ in shown] == pytest.approx(np.linspace(states[0, 0], states[-1, 0], 7))
        for t, trail, dot, title in shown:
            place = [np.interp(t, states[:, 0], states[:, k]) for k in (1, 2)]
            assert dot == pytest.approx(place)
            assert trail[-1] == pytest.approx(place)
            done = np.count_nonzero(states[:, 0] <= t)
            before = states[max(0, done - 1 - pictures.TRAIL) : done, 1:3]
            assert trail[:-1] == pytest.approx(before)
            passed = t - states[0, 0]
            assert title.endswith(f" t/T = {passed / period:.2f}" if period else f" t = {passed:.2f}")


@pytest.mark.parametrize("name", ["moving-cap", "frozen-mushroom"])
def test_a_strip_shows_the_table_at_each_phase_with_chords_between_its_walls(name):
    scene = load(name)
    figure = tables.new_strip(scene, 7.2, 6.0)
    n = 6 if scene.period else 1
    assert len(figure.axes) == n
    limits = {(*axes.get_xlim(), *axes.get_ylim()) for axes in figure.axes}
    [(left, right, bottom, top)] = limits  # one frame, which holds all walls
    for k, (axes, colour) in enumerate(zip(figure.axes, style.phase_colours(n), strict=True)):
        t = scene.period * k / n
        now = table_at(fp, scene, t)
        walls = drawn_walls(axes, scene, t)
        assert len(walls) == 2
        assert {one.get_color() for one in walls} == {colour}
        for x, y in map(xy, walls):
            assert left < x.min() <= x.max() < right
            assert bottom < y.min() <= y.max() < top
        [chords] = [one for one in axes.lines if one not in walls]
        x, y = xy(chords)
        assert len(x) == tables.N_CHORDS + 1
        met = [now.nearest_wall(*place) for place in zip(x[1:], y[1:], strict=True)]
        for wall, *place in zip(met, x[1:], y[1:], strict=True):
            assert abs(now.gap(wall, *place)) < 1e-4 * now.size  # walls hardly move meanwhile
        assert axes.get_title() == (f"t/T = {k}/6" if scene.period else "static")
        assert axes.get_aspect() == 1


@pytest.mark.parametrize("name", ["moving-cap", "frozen-mushroom"])
def test_a_gif_has_the_walls_of_each_frame(name, monkeypatch):
    scene, frames = load(name), []
    monkeypatch.setattr(tables, "WIDEST", 480)  # small pictures are quick
    monkeypatch.setattr(tables, "HIGHEST", 270)
    axes = tables.new_slide(scene)
    draw = axes.figure.canvas.draw

    def noted():
        frames.append([np.array(xy(one)) for one in axes.lines])
        draw()

    monkeypatch.setattr(axes.figure.canvas, "draw", noted)
    times, file = tables.phases(scene, 2), io.BytesIO()
    tables.write_frames(scene, axes, times, lambda k: axes.set_title(f"{k}"), file)
    assert len(frames) == len(times) == (2 if scene.period else 1)
    for t, shown in zip(times, frames, strict=True):
        for part, wanted in zip(shown, tables.walls(scene, t), strict=True):
            assert part == pytest.approx(wanted)
    picture = Image.open(file)
    assert getattr(picture, "n_frames", 1) == len(times)
    assert picture.size[1] == tables.HIGHEST
    assert tables.HIGHEST <= picture.size[0] <= tables.WIDEST


def test_a_table_that_stands_still_is_drawn_once_whatever_room_there_is():
    for height in (2.0, 60.0):
        figure = tables.new_strip(load("frozen-mushroom"), 7.2, height)
        assert len(figure.axes) == 1
        assert figure.get_figheight() <= height
    low, high = (tables.new_strip(MOVING, 7.2, height) for height in (2.0, 60.0))
    rows = [len({round(axes.get_subplotspec().rowspan.start, 3) for axes in one.axes}) for one in (low, high)]
    assert rows == [1, 2]  # in two rows if the height permits
    assert low.get_figheight() <= 2.0


def test_phases_are_even_in_one_cycle():
    assert tables.phases(MOVING, 4) == pytest.approx([0, math.pi / 2, math.pi, 1.5 * math.pi])
    assert tables.phases(load("frozen-mushroom"), 4) == [0.0]


@pytest.mark.parametrize("n_blocks", [1, 3])
def test_what_is_gathered_is_of_all_blocks(n_blocks):
    random = np.random.default_rng(5)
    gains = random.normal(0.1, 0.3, (4000, 3))
    gains[7, 1], gains[9, 0] = np.nan, -np.inf
    kept = np.delete(gains, [7, 9], axis=0)
    found = energies.gathered(iter(np.array_split(gains, n_blocks)) if n_blocks > 1 else gains, 0.25)
    assert found.n == 3998
    assert found.mean == pytest.approx(kept.mean(axis=0))
    assert found.sd == pytest.approx(kept.std(axis=0))
    assert found.counts.tolist() == np.histogram(kept[:, 0], found.edges)[0].tolist()
    assert found.few.tolist() == kept[:12].tolist()
    assert len(found.edges) == 81
    low, high = np.quantile(kept[:, 0], (0.0005, 0.9995))
    assert found.edges[[0, -1]] == pytest.approx([low - 0.25, high + 0.25])
    narrow = energies.gathered(kept[:50, 0])
    assert len(narrow.edges) == 41  # few particles, few bars
    assert narrow.edges[0] < kept[:50, 0].min() < kept[:50, 0].max() < narrow.edges[-1]
    alike = energies.gathered(np.full(50, 0.1))
    assert (np.diff(alike.edges) > 0).all()
    assert alike.counts.sum() == 50


def test_blocks_are_gathered_until_the_bars_can_be_placed(monkeypatch):
    """The first blocks say where the bars go, as many as are needed and no more."""
    monkeypatch.setattr(energies, "ENOUGH", 30)
    blocks = [np.full(20, 0.0), np.linspace(0, 1, 20), np.full(20, 9.0)]
    found = energies.gathered(iter(blocks))
    assert found.n == 60
    assert 1 < found.edges[-1] < 2
    assert found.counts.sum() == 40


def test_growth_shows_the_mean_with_its_error_the_spread_and_theory():
    random = np.random.default_rng(2)
    n, n_cycles = 150, 4
    gains = np.cumsum(random.normal(0.12, 0.3, (n, n_cycles)), axis=1)
    above, below = energies.growth(MOVING, 1e5, gains, n + 10).axes
    mean, sd = (np.pad(of(gains, axis=0), (1, 0)) for of in (np.mean, np.std))
    found = measured(above, "mean")
    assert found.x.tolist() == [0, 1, 2, 3, 4]
    assert found.y == pytest.approx(mean)
    assert found.errors == pytest.approx(sd / n**0.5)
    [band] = [one for one in above.collections if one.get_label() == "± 1 sd of one"]
    corners = band.get_paths()[0].vertices
    for k in range(n_cycles + 1):
        edges = corners[corners[:, 0] == k, 1]
        assert (edges.min(), edges.max()) == pytest.approx((mean[k] - sd[k], mean[k] + sd[k]))
    few = [xy(one)[1] for one in above.lines if one.get_color() == style.GREY and len(xy(one)[0])]
    assert np.array(few) == pytest.approx(np.pad(gains[:12], ((0, 0), (1, 0))))
    x, theirs = xy(line(above, "theory, m1"))
    assert x.tolist() == [0, 1, 2, 3, 4]
    for k in (1, 4):
        one = predicted(RunSpec(MOVING, 1e5, k, 0))
        assert one is not None
        assert theirs[k] == pytest.approx(k * one.m1)
    dotted = np.array([xy(one)[1] for one in above.lines if one.get_linestyle() == ":"])
    assert dotted.mean(axis=0) == pytest.approx(theirs)
    spread = np.ptp(dotted, axis=0) / 2
    assert spread[0] == 0
    assert spread[1:] == pytest.approx(float(theory.predict(MOVING, 6).sd) * np.arange(1, 5) ** 0.5, rel=0.25)
    assert above.get_title().endswith(f"{n + 10} particles\n(10 of them never free, or lost: left out)")
    shown = bars(below)
    assert shown.heights == pytest.approx(
        np.histogram(gains[:, 0], shown.edges)[0] / n / np.diff(shown.edges)
    )
    assert above.get_legend() is not None
    assert below.get_legend() is not None


def test_growth_without_theory_is_the_simulation_alone():
    gains = np.random.default_rng(2).normal(0, 1e-3, (50, 3))
    above, below = energies.growth(CAP, 1e4, gains).axes
    assert not any("theory" in name for axes in (above, below) for name in labels(axes))


def test_a_cycle_that_begins_at_a_narrow_mouth_has_no_theory():
    """Some particles start in the island: theory's limit is not theirs."""
    late = scenes.Mushroom(r=1.0, h=1.0, nu=scenes.Fourier(0.6, 1.0, (), (0.4,)), slope=0.0)
    s = np.random.default_rng(1).normal(0.0, 0.1, 50)
    [axes] = energies.histogram(late, 1e6, s).axes
    assert labels(axes) == ["simulation"]


@pytest.mark.parametrize(("n", "shift", "hole"), [
    (3000, -0.02, 0.0), (3000, 0.02, 0.0), (3000, 0.0, 0.5), (3000, 0.0, 0.0), (20, 0.0, 0.0),
])  # fmt: skip
def test_residuals_are_all_within_their_panel(n, shift, hole):
    """Large ones, too, to either side; small ones, and none where bars hold few, do not widen it."""
    found = theory.at_energy(load("ergodic"), 1e6)
    width = 0.01 if shift else found.peak[1] ** 0.5
    z = np.random.default_rng(1).normal(0.0, 1.0, n)
    s = found.peak[0] + shift + width * z[np.abs(z) >= hole]
    rest = energies.histogram(load("ergodic"), 1e6, s).axes[1]
    left = xy(rest.lines[-1])[1]
    assert np.isnan(left).all() == (n == 20)
    reach = 1.1 * np.nanmax(np.abs(left), initial=0.0)
    assert (reach > 4.0) == bool(shift or hole)
    assert not hole or reach > 1.2 * np.nanmax(left)  # most is missing, nowhere is as much too many
    assert rest.get_ylim() == pytest.approx((-max(4.0, reach), max(4.0, reach)))


def test_many_points_are_drawn_finer(moving):
    sizes = []
    for found in (moving[:1], moving):
        [axes] = pictures.collision_map(found).axes
        sizes.append(
            {one.get_markersize() for one in axes.lines if one.get_marker() == "." and len(xy(one)[0])}
        )
    assert max(sizes[1]) < min(sizes[0]) <= 4.5


@pytest.mark.parametrize("width", [0.005, 0.3])
def test_bars_have_the_errors_of_their_counts(width):
    """The panel is as high as the bars or as theory, whichever is higher."""
    s = np.random.default_rng(1).normal(0.0, width, 3000)
    figure = energies.histogram(load("ergodic"), 1e6, s)
    axes, rest = figure.axes
    shown = bars(axes)
    counts = np.histogram(s, shown.edges)[0]
    unit = len(s) * np.diff(shown.edges)
    [errors] = [with_errors(one) for one in axes.containers]
    assert errors.x == pytest.approx((shown.edges[1:] + shown.edges[:-1]) / 2)
    assert errors.y == pytest.approx(counts / unit)
    assert errors.errors == pytest.approx(np.sqrt(counts) / unit)
    curve = xy(line(axes, "theory at this energy"))[1]
    highest = max(curve.max(), (errors.y + errors.errors).max())
    assert (highest == curve.max()) == (width > 0.01)
    assert axes.get_ylim() == (0, pytest.approx(energies.ROOM * highest))
    assert axes.get_xlim() == pytest.approx((shown.edges[0], shown.edges[-1]))
    found = theory.at_energy(load("ergodic"), 1e6)
    expected = np.diff(found.cdf(shown.edges)) * len(s)
    left = xy(rest.lines[-1])[1]
    assert np.isnan(left).tolist() == (expected < 5).tolist()
    enough = expected >= 5
    assert left[enough] == pytest.approx((counts - expected)[enough] / np.sqrt(expected[enough]))
    peak = line(axes, "theory, never captured")
    assert xy(peak)[0] == pytest.approx([found.peak[0]] * 2)


def test_loops_are_drawn_over_the_narrowest_mouth():
    [axes] = heating.draw_loops((1.0, 6.0), 5).axes
    for depth in (1.0, 6.0):
        for label, of in (
            ("anticlockwise", lambda d, w: heating.Loop(d, 0.0, w).m1),
            ("clockwise", lambda d, w: heating.Loop(0.0, d, w).m1),
            ("supremum", lambda d, w: heating.supremum(0.0, d, w)[0]),
        ):
            mouths, m1 = xy(line(axes, f"{label}, depth at most {depth:g} r"))
            assert mouths == pytest.approx(np.geomspace(1e-3, 0.9, 5))
            assert m1 == pytest.approx([of(depth, w) for w in mouths.tolist()])
    assert axes.get_xscale() == "log"


def test_the_phase_diagram_is_the_theory_of_each_moving_cap(monkeypatch):
    asked = []

    def found(phases, sizes):
        asked.append((phases, sizes))
        return np.add.outer(sizes, 10 * phases)

    monkeypatch.setattr(heating, "phase_diagram", found)
    figure = heating.draw_phase_diagram(4, 3)
    axes, bar = figure.axes
    [(phases, sizes)] = asked
    assert phases == pytest.approx(np.pi * np.array([0, 0.5, 1, 1.5, 2]))
    assert sizes == pytest.approx([0.2, 0.4, 0.6])
    [filled] = axes.collections
    assert (filled.zmin, filled.zmax) == pytest.approx((0.2, 0.6 + 20 * np.pi))
    assert (axes.get_xlim(), axes.get_ylim()) == (pytest.approx((0, 2)), pytest.approx((0.2, 0.6)))
    assert "m_1" in bar.get_ylabel() + bar.get_xlabel()


def test_what_a_moving_cap_of_the_diagram_is():
    """Amplitudes of radius and depth, the stem ahead by the phase; as sec. 4.2 at a phase of pi."""
    cap = heating.moving_cap(0.7, 0.3, 0.2)
    t = np.array([0.0, 1.0, 2.0])
    assert cap.r(t) == pytest.approx(1 + 0.3 * np.sin(t))
    assert cap.h(t) == pytest.approx(1 + 0.2 * np.sin(t + 0.7))
    assert cap.nu(t) == pytest.approx(0.6 + 0.4 * np.cos(t))
    assert heating.phase_diagram(np.array([1.0, 4.0]), np.array([0.3])) == pytest.approx(
        np.array([[float(theory.predict(heating.moving_cap(p, 0.3, 0.3), 6).m1) for p in (1.0, 4.0)]])
    )


def test_a_figure_is_the_same_bytes_again_and_a_small_svg():
    figure, axes = style.new_figure(3.0, 2.0)
    axes.plot([0.123456789, 2.0], [1.0, 3.0])
    axes.set_title("words")
    first = style.svg(figure)
    assert style.svg(figure) == first
    assert b"words" in first  # letters are text
    assert b"<!--" not in first
    numbers = [part for part in first.split(b'"') if part.startswith(b"M ")]
    assert numbers
    assert all(len(word.partition(b".")[2]) <= 2 for part in numbers for word in part.split())
    file = io.BytesIO()
    style.save(figure, file, ".png")
    assert file.getvalue().startswith(b"\x89PNG")


POWERS = {
    0.01: "0.01",
    0.0099: r"$9.9\cdot10^{-3}$",
    9999.0: "9999",
    1e4: "$10^{4}$",
    2e12: r"$2\cdot10^{12}$",
}


@pytest.mark.parametrize("number", POWERS)
def test_a_number_is_written_as_a_power_only_where_it_is_large_or_small(number):
    assert style.power(number) == POWERS[number]


def test_colours_of_phases_go_from_dark_to_light():
    colours = style.phase_colours(5)
    light = [sum(int(one[k : k + 2], 16) for k in (1, 3, 5)) for one in colours]
    assert len(set(colours)) == 5
    assert light[0] < light[-1]


NAMELESS = msgspec.structs.replace(MOVING, name="", slope=0.05)  # no rates were measured for it
GAINS = np.random.default_rng(1).normal(0.1, 0.1, (400, 3))
DRAWN = {
    "path": lambda found: pictures.trajectory(found[0]),
    "path at rest": lambda _: pictures.trajectory(
        orbits.follow(msgspec.structs.replace(load("frozen-mushroom"), name=""), 9, seed=1)[0]
    ),
    "section": pictures.section,
    "section at a phase": lambda found: pictures.section(found, 0.25),
    "section of a stem": lambda _: pictures.section(orbits.follow(STEM, 60, energy=1.8, seed=1)),
    "section of a stem at a phase": lambda _: pictures.section(
        orbits.follow(STEM, 60, energy=1.8, seed=1), 0.5
    ),
    "map": pictures.collision_map,
    "map of a cap": lambda _: pictures.collision_map(orbits.follow(CAP, 20, seed=1)),
    "energy": lambda found: pictures.energy_in_time(found[0]),
    "energy in a cap": lambda _: pictures.energy_in_time(orbits.follow(CAP, 20, seed=1)[0]),
    "histogram": lambda _: energies.histogram(MOVING, 1e6, GAINS[:, 0], 500),
    "histogram at high energies": lambda _: energies.histogram(NAMELESS, 1e6, GAINS[:, 0]),
    "growth": lambda _: energies.growth(MOVING, 1e6, GAINS),
    "loops": lambda _: heating.draw_loops((1.0,), 3),
    "phases": lambda _: heating.draw_phase_diagram(2, 2),
}


@pytest.mark.parametrize("name", DRAWN)
def test_a_figure_says_what_it_shows(moving, name):
    assert said(DRAWN[name](moving)) == PICTURES[name]


@pytest.mark.parametrize("width", [0.02, 1.0])
def test_a_panel_of_the_limit_is_as_high_as_its_bars_or_theory(width):
    """Whichever is higher."""
    s = np.random.default_rng(1).normal(0.1, width, 400)
    [axes] = energies.histogram(NAMELESS, 1e6, s).axes
    curve = xy(line(axes, "theory, captured, at high energies"))[1].max()
    [errors] = [with_errors(one) for one in axes.containers]
    top = (errors.y + errors.errors).max()
    assert (curve > top) == (width > 0.5)
    assert axes.get_ylim() == (0, pytest.approx(energies.ROOM * max(curve, top)))
