"""The figures of the audit's report: what is drawn is what was simulated and what theory says.

Each figure is looked at through its artists. The numbers come from the samples here, not from the figure's
own functions.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from mpmath import fp
from scipy.stats import norm
from support import adiabatic_particles
from support.artists import bars, labels, line, measured, said, xy
from support.figure_words import CLAIMS

import theory
from mushrooms import orbits
from mushrooms.audit import figures
from mushrooms.audit.claims import finite_energy
from mushrooms.audit.claims.misprints import loop_area, signed_area
from mushrooms.audit.runs import RUNS, Sample, draw, scene_of
from mushrooms.figures import style
from mushrooms.figures.energies import ROOM
from scene import load

N = 250  # particles of a run
N_DRAWN = 6_000  # sums of cycles
PICTURES = {picture.claim: picture for picture in figures.ALL}


@pytest.fixture(scope="module", autouse=True)
def _fewer() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module in (finite_energy, figures):
            patch.setattr(module, "N_DRAWN", N_DRAWN)
        patch.setattr(figures, "N_ORBITS", 6)
        patch.setattr(figures, "N_HITS", 60)
        finite_energy.summed.cache_clear()
        yield
        finite_energy.summed.cache_clear()


@pytest.fixture(scope="module")
def sample() -> Callable[[str], Sample]:
    known: dict[str, Sample] = {}

    def of(name: str) -> Sample:
        if name not in known:
            run = RUNS[name]._replace(quick=N)
            known[name] = draw(adiabatic_particles.simulate, run, size="quick", seed=1)
        return known[name]

    return of


@pytest.fixture(scope="module")
def figure(sample: Callable[[str], Sample]) -> Callable[[str], Figure]:
    known: dict[str, Figure] = {}

    def of(claim: str) -> Figure:
        if claim not in known:
            picture = PICTURES[claim]
            with pytest.MonkeyPatch.context() as patch:
                if claim == "X7":  # its right panel is X1's, of a theory that takes seconds
                    patch.setattr(figures, "_energies", lambda axes, *_: axes.plot(0, 0, label="as in X1"))
                found = figures.draw_picture(picture, {name: sample(name) for name in picture.needs})
            assert found is not None
            known[claim] = found
        return known[claim]

    return of


def free_gain(sample: Sample) -> np.ndarray:
    """Return log E1/E0 of the particles without a capture interval in the first cycle."""
    return sample.s[np.isnan(sample.t_in[:, 0]).all(axis=1), 0]


def width_error(values: np.ndarray) -> float:
    """Return the standard error of a standard deviation, from the fourth moment."""
    off = (values - values.mean()) ** 2
    return float(off.std(ddof=1) / len(off) ** 0.5 / (2 * values.std(ddof=1)))


def standard_error(values: np.ndarray) -> float:
    return float(values.std(ddof=1) / len(values) ** 0.5)


def test_every_figure_is_looked_at_here() -> None:
    text = Path(__file__).read_text("utf-8")
    assert [claim for claim in PICTURES if f'"{claim}"' not in text] == []


def test_a_figure_needs_its_runs_and_shows_more_where_they_are(sample: Callable[[str], Sample]) -> None:
    picture = PICTURES["X4"]
    assert figures.draw_picture(picture, {}) is None
    assert figures.draw_picture(figures.FIRST, {}) is None
    shown: list[tuple[Sample, ...]] = []
    listed = picture._replace(draw=lambda _, *samples: shown.append(samples))
    slower, faster = picture.needs[0], picture.more[0]
    some = {faster: sample(slower), "else": sample(slower), slower: sample("ergodic@1e7")}
    figures.draw_picture(listed, some)
    assert [one.run.name for one in shown[0]] == ["ergodic@1e7", slower]


@pytest.mark.parametrize(("panel", "name"), list(enumerate(["", "fixed-cap-anticlockwise", "moving-cap"])))
def test_loops_run_in_their_direction_with_marks_at_their_phases(
    figure: Callable[[str], Figure], panel: int, name: str
) -> None:
    """The fixed cap's runs anticlockwise in the plane of w and h; the arrows point along each loop."""
    axes = figure("M2").axes[panel]
    scene = load(name or "fixed-cap-anticlockwise")
    x, y = xy(axes.lines[0])
    area = signed_area(x.tolist(), y.tolist())
    assert area > 0 if not name else area == pytest.approx(loop_area(name), rel=0.02)
    assert (x[0], y[0]) == pytest.approx((x[-1], y[-1]))
    assert axes.patches[0].get_xy()[: len(x)] == pytest.approx(np.column_stack([x, y]))
    for k, colour in enumerate(style.phase_colours(6)):
        t = scene.period * k / 6
        now = theory.volumes_at(fp, scene, t)
        place = (now.v_ell / now.v_cap, now.v_cap / (now.v_cap + now.v_stem))
        if not name:
            place = tuple(scene.laws[law].value(fp, t) for law in "wh")
        mark = line(axes, f"{k}/6")
        assert [float(one[0]) for one in xy(mark)] == pytest.approx(place, abs=1e-9)
        assert mark.get_color() == colour
    arrows = [one for one in axes.texts if isinstance(one, Annotation)]
    assert len(arrows) >= 4
    for arrow in arrows:
        k = int(np.argmin(np.hypot(x - arrow.xy[0], y - arrow.xy[1])))
        assert (x[k], y[k]) == pytest.approx(arrow.xy)
        ahead = np.array([x[k] - x[k - 1], y[k] - y[k - 1]])
        assert ahead @ (np.array(arrow.xy) - arrow.xyann) > 0
    titles = ["fixed cap, anticlockwise", "fixed cap, anticlockwise", "moving cap"]
    assert axes.get_title() == titles[panel]
    planes = ("half-width w", "depth h"), ("V_ell / V_cap", "V_cap / V")
    assert (axes.get_xlabel(), axes.get_ylabel()) == planes[bool(name)]


def test_the_gain_of_a_capture_has_its_largest_and_that_of_the_free(figure: Callable[[str], Figure]) -> None:
    [axes] = figure("N5").axes
    t, s = xy(axes.lines[0])
    best = line(axes, "largest")
    [place], [gain] = xy(best)
    assert gain == pytest.approx(s.max(), abs=1e-5)
    assert place == pytest.approx(t[np.argmax(s)], abs=0.05)
    assert str(best.get_label()) == f"largest: {gain:.6f} at t = {place:.5f}"
    level = float(theory.predict(load("moving-cap")).log_e_nc)
    assert xy(line(axes, f"never captured: {level:.6f}"))[1] == pytest.approx([level, level])
    assert s[0] == pytest.approx(0, abs=0.01)  # captured all the time, while the cap comes back
    assert s[-1] == pytest.approx(level, abs=0.01)  # captured for no time


def test_widths_are_those_of_the_samples_and_the_printed_power_grows(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample]
) -> None:
    [axes] = figure("M7").axes
    for label, names, expected in (
        ("moving cap", [f"moving-cap@1e{k}" for k in (6, 7, 8)], -0.25),
        ("c = 0", [f"ergodic@1e{k}" for k in (5, 6, 7)], -0.25),
    ):
        found = measured(axes, label)
        widths = [free_gain(sample(name)).std(ddof=1) for name in names]
        assert found.x == pytest.approx([RUNS[name].energy for name in names])
        assert found.y == pytest.approx(widths)
        assert found.errors == pytest.approx(
            [width_error(free_gain(sample(name))) for name in names], rel=1e-6
        )
        [fit] = [
            one for one in axes.lines if len(xy(one)[0]) == 3 and one.get_linestyle() == "-"
            and xy(one)[0][0] == found.x[0]
        ]  # fmt: skip
        slope = np.polyfit(*np.log(xy(fit)), 1)[0]
        assert slope == pytest.approx(expected, abs=0.06)
        inverse = np.log(found.x), np.log(found.y), found.y / found.errors
        (slope, _), spread = np.polyfit(*inverse[:2], 1, w=inverse[2], cov="unscaled")
        assert f"{label}: exponent {slope:.4f} ± {spread[0, 0] ** 0.5:.4f}" in labels(axes)
    x, y = xy(line(axes, "as printed"))
    assert np.diff(np.log(y)) / np.diff(np.log(x)) == pytest.approx([0.25])
    assert y[0] == pytest.approx(measured(axes, "moving cap").y[0])
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_means_approach_the_theory_with_the_energy(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample]
) -> None:
    panels = figure("M9").axes
    samples = [sample(f"moving-cap@1e{k}") for k in range(3, 9)]
    limit = theory.predict(load("moving-cap"))
    drawn = (
        (lambda one: one.s[:, 0], float(limit.m1)),
        (lambda one: np.isnan(one.t_in[:, 0]).all(axis=1).astype(float), float(limit.p_nc)),
        (lambda one: np.exp(-one.s[:, 0] / 2), float(theory.unbiased_mean(load("moving-cap")))),
    )
    for axes, (of, truth) in zip(panels, drawn, strict=True):
        found = measured(axes)
        assert found.x == pytest.approx([one.run.energy for one in samples])
        assert found.y == pytest.approx([of(one).mean() for one in samples])
        assert found.errors == pytest.approx([standard_error(of(one)) for one in samples], rel=0.05)
        assert xy(line(axes, "theory, infinite E0"))[1] == pytest.approx([truth, truth])
        assert axes.get_xscale() == "log"
    [fit] = [one for one in panels[0].lines if str(one.get_label()).endswith("E0^(-1/2)")]
    x, y = xy(fit)
    slope, height = np.polyfit(x**-0.5, y, 1)
    assert str(fit.get_label()) == f"{height:.4f} + {slope:.2f} E0^(-1/2)"
    found = measured(panels[0])
    assert (slope, height) == pytest.approx(np.polyfit(found.x**-0.5, found.y, 1, w=1 / found.errors))


@pytest.mark.parametrize(("claim", "panel", "name"), [
    ("X1", 0, "fixed-cap-anticlockwise@1e9"), ("X1", 1, "fixed-cap-clockwise@1e9"),
    ("X2", 0, "moving-cap@1e6"), ("X2", 1, "moving-cap@1e7"), ("X5", 0, "ergodic@1e7"),
])  # fmt: skip
def test_histograms_of_energies_stand_under_their_theory(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample], claim: str, panel: int, name: str
) -> None:
    drawn, one = figure(claim), sample(name)
    found = theory.at_energy(scene_of(one.run), one.run.energy)
    axes = [axes for axes in drawn.axes if "simulation" in labels(axes)][panel]
    assert axes.get_title() == f"{one.run.scene}, E0 = {style.power(one.run.energy)}, {one.n:,} particles"
    drawn_bars = bars(axes)
    counts = np.histogram(one.s[:, 0], drawn_bars.edges)[0]
    assert drawn_bars.heights == pytest.approx(counts / (one.n * np.diff(drawn_bars.edges)))
    assert counts.sum() >= 0.98 * one.n
    assert axes.get_xlim() == pytest.approx(drawn_bars.edges[[0, -1]])
    half = np.diff(drawn_bars.edges)[0] / 2
    curves = [(f"theory at this energy, peak {found.peak[1] ** 0.5:.4f} wide", found.cdf)]
    limit = theory.energies(scene_of(one.run))
    if limit.p_nc < 1:
        curves.append(("theory, captured, sharp", limit.captured_below))
    highest = [(drawn_bars.heights + np.sqrt(counts) / (2 * half * one.n)).max()]
    for label, below in curves:
        x, y = xy(line(axes, label))
        assert x[[0, -1]] == pytest.approx(drawn_bars.edges[[0, -1]])
        assert y == pytest.approx((below(x + half) - below(x - half)) / (2 * half))
        highest.append(y.max())
    assert axes.get_ylim() == (0, pytest.approx(ROOM * max(highest)))
    if limit.p_nc > 0:
        peak = xy(line(axes, "theory, never captured"))[0]
        assert peak == pytest.approx([float(theory.predict(scene_of(one.run)).log_e_nc)] * 2)
    below = [rest for rest in drawn.axes if rest.get_ylabel().startswith("(sim.")]
    if below:
        rest = below[panel]
        expected = one.n * np.diff(found.cdf(drawn_bars.edges))
        pulls = np.where(expected >= 5, (counts - expected) / np.sqrt(np.maximum(expected, 1e-9)), np.nan)
        assert xy(rest.lines[-1])[1] == pytest.approx(pulls, nan_ok=True)
        reach = max(4.0, 1.1 * np.nanmax(np.abs(pulls)))
        assert rest.get_ylim() == pytest.approx((-reach, reach))
        assert rest.get_legend() is not None


def test_the_retraced_arc_joins_captures_to_releases(figure: Callable[[str], Figure]) -> None:
    left = figure("X7").axes[0]
    begin, end = (np.array(xy(line(left, label))) for label in ("captures", "releases"))
    assert begin.shape == end.shape
    assert begin.shape[1] >= 5
    assert begin[0] == pytest.approx(end[0], abs=1e-6)  # at the same V_ell / V_cap
    assert (np.abs(begin[1] - end[1]).max()) > 0.01  # and another V_cap / V
    joined = [np.array(xy(one)) for one in left.lines if one.get_linestyle() == ":"]
    assert len(joined) == begin.shape[1]
    for pair, a, b in zip(joined, begin.T, end.T, strict=True):
        assert pair.T.tolist() == [pytest.approx(a), pytest.approx(b)]
    scene = load("retraced-arc")
    now = theory.volumes_at(np, scene, np.linspace(0, scene.period, 97))
    curve = np.array(xy(left.lines[0]))
    for place in np.array([now.v_ell / now.v_cap, now.v_cap / (now.v_cap + now.v_stem)]).T:
        assert np.min(np.hypot(*(curve - place[:, None]))) < 0.02
    assert left.get_title() == "retraced-arc, the way there"


@pytest.mark.parametrize(
    ("panel", "name"),
    list(enumerate(["moving-cap@1e7", "fixed-cap-anticlockwise@1e9", "fixed-cap-clockwise@1e9"])),
)
def test_times_of_capture_have_the_captured_share_as_their_area(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample], panel: int, name: str
) -> None:
    axes, one = figure("X3").axes[panel], sample(name)
    first = np.fmin.reduce(one.t_in[:, 0], axis=1)
    found, law = bars(axes), bars(axes, "theory, eq. (ps)")
    counts = np.histogram(first, found.edges)[0]
    assert found.heights == pytest.approx(counts / one.n / np.diff(found.edges))
    assert found.area == pytest.approx(np.isfinite(first).mean(), abs=0.02)
    assert law.area == pytest.approx(1 - float(theory.predict(scene_of(one.run)).p_nc), abs=1e-3)
    centre = (law.edges[1:] + law.edges[:-1]) / 2
    mean = law.heights @ (centre * np.diff(law.edges)) / law.area
    assert mean == pytest.approx(
        np.nanmean(first), abs=5 * np.nanstd(first) / np.isfinite(first).sum() ** 0.5
    )
    assert axes.get_title() == name
    assert axes.get_ylim()[0] == 0
    curve = theory.capture_curve(scene_of(one.run), 9)
    for edges in (found.edges, law.edges):
        assert edges == pytest.approx(np.linspace(curve.t_in.min(), curve.t_in.max(), 51))


@pytest.mark.parametrize(("row", "n"), list(enumerate([10, 30])))
def test_sums_of_cycles_stand_beside_theory_and_a_gaussian(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample], row: int, n: int
) -> None:
    one = sample("moving-cap@1e5x30")
    drawn = theory.at_energy(load("moving-cap"), 1e5).draw(n, N_DRAWN, finite_energy.DRAWN_SEED)[:, -1] / n
    centre, sd = drawn.mean(), drawn.std()
    for axes, scale in zip(figure("X4").axes[2 * row : 2 * row + 2], ("linear", "log"), strict=True):
        found = bars(axes)
        counts = np.histogram(one.s[:, n - 1] / n, found.edges)[0]
        assert found.heights == pytest.approx(counts / one.n / np.diff(found.edges))
        assert counts.sum() > 0.95 * one.n
        x, y = xy(line(axes, "sums of n cycles"))
        assert np.trapezoid(y, x) == pytest.approx(1, abs=0.01)
        assert np.trapezoid(x * y, x) == pytest.approx(centre, abs=0.01 * sd)
        x, y = xy(line(axes, "Gaussian"))
        assert y == pytest.approx(norm.pdf(x, centre, sd))
        assert axes.get_yscale() == scale
        assert found.edges == pytest.approx(centre + sd * np.linspace(-5, 5, 51))
        assert axes.get_xlim() == pytest.approx((centre - 5 * sd, centre + 5 * sd))
        top = 1 / (sd * math.sqrt(2 * math.pi))
        assert axes.get_ylim() == pytest.approx(
            (0, 1.4 * top) if scale == "linear" else (1e-5 * top, 2 * top)
        )
        assert axes.get_title() == f"n = {n}, E0 = $10^{{5}}$, {one.n:,} particles"
        assert f"E_{n}/E0" in axes.get_xlabel()


def test_energies_of_both_stems_are_counted_from_their_own_theory(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample]
) -> None:
    for axes, scale in zip(figure("X6").axes, ("linear", "log"), strict=True):
        for label, name in (("tilted stem", "moving-cap@1e6"), ("upright stem", "untilted@1e6")):
            one, found = sample(name), bars(axes, label)
            gain = free_gain(one) - float(theory.predict(scene_of(one.run)).log_e_nc)
            counts = np.histogram(gain, found.edges)[0]
            assert found.heights == pytest.approx(counts / (len(gain) * np.diff(found.edges)))
        x, y = xy(line(axes, "Gaussian"))
        sigma = free_gain(sample("moving-cap@1e6")).std(ddof=1)
        assert y == pytest.approx(norm.pdf(x, sigma**2 / 4, sigma))
        for edges in (found.edges, x):
            assert edges == pytest.approx(np.linspace(-0.4, 0.8, 121))
        assert axes.get_yscale() == scale
    assert figure("X6").axes[1].get_ylim() == pytest.approx((1e-3, 10))


def test_losses_fall_with_the_number_of_cycles(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample]
) -> None:
    [axes], one = figure("D1").axes, sample("moving-cap@1e5x30")
    n, p = xy(line(axes, "theory at this energy"))
    assert n.tolist() == list(range(1, 31))
    sums = theory.at_energy(load("moving-cap"), 1e5).draw(30, N_DRAWN // 30, finite_energy.DRAWN_SEED)
    assert p == pytest.approx((sums < 0).mean(axis=0))
    places, far = xy(line(axes, "theory at infinite energy"))
    assert places.tolist() == [1, 2, 3, 4, 6, 8, 11, 16, 22, 30]
    assert far == pytest.approx([float(theory.loss_probability(load("moving-cap"), int(k))) for k in places])
    rate = float(theory.rarity(load("moving-cap")).rate)
    late, slope = xy(line(axes, f"exp(-{rate:.4f} n)"))
    assert np.diff(np.log(slope)) == pytest.approx(-rate * np.diff(late))
    assert late.tolist() == places[5:].tolist()
    assert slope[-1] == pytest.approx(far[-1])
    found = measured(axes)
    assert found.x == pytest.approx(places)
    assert found.y == pytest.approx([(one.s[:, int(k) - 1] < 0).mean() for k in places])
    assert found.errors == pytest.approx(np.sqrt(found.y * (1 - found.y) / one.n), rel=0.3, abs=0.01)
    assert axes.get_yscale() == "log"


def test_the_frozen_mushroom_shows_a_section_and_a_map(figure: Callable[[str], Figure]) -> None:
    section, boundary = figure("L3").axes
    found = orbits.follow(load("frozen-mushroom"), 60, seed=figures.SEED, n_orbits=6)
    hits = np.vstack([np.column_stack(orbit.section()[2:4]) for orbit in found])
    marks = np.vstack([orbits.boundary_map(orbit) for orbit in found])
    for axes, expected in ((section, hits), (boundary, marks)):
        shown = np.vstack([np.column_stack(xy(one)) for one in axes.lines if one.get_marker() == "."])
        assert sorted(map(tuple, shown)) == sorted(map(tuple, expected))
        assert axes.get_legend() is not None


def test_releases_are_in_units_of_the_speed(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample]
) -> None:
    left, right = figure("L4").axes
    samples = [sample(f"moving-cap@1e{k}") for k in range(4, 9)]
    nu, gaps = np.vectorize(partial(load("moving-cap").laws["nu"].value, fp)), []
    for one in samples:
        begin, end = (t[np.isfinite(one.t_in[:, 0, 0]), 0, 0] for t in (one.t_in, one.t_out))
        gaps.append(nu(end) - nu(begin))
    slowness = [(2 * one.run.energy) ** -0.5 for one in samples]
    x, rms = xy(line(left, "root mean square"))
    assert x == pytest.approx(slowness)
    assert rms == pytest.approx([np.sqrt(np.mean(gap**2)) for gap in gaps], rel=1e-6)
    x, slope = xy(line(left, "slope 1"))
    assert slope / x == pytest.approx(rms[0] / x[0])
    clouds = [xy(one) for one in left.lines if one.get_marker() == "."]
    for (place, shown), gap, slow in zip(clouds, gaps, slowness, strict=True):
        assert place == pytest.approx(slow)
        assert sorted(shown) == pytest.approx(sorted(np.abs(gap)[:400]), abs=1e-9)
    assert (left.get_xscale(), left.get_yscale()) == ("log", "log")
    assert left.get_ylim() == pytest.approx((rms.min() / 100, rms.max() * 100))
    density = np.histogram(gaps[-1] / slowness[-1], np.linspace(-1, 1.5, 101), density=True)[0]
    assert [bar.get_height() for bar in right.patches] == pytest.approx(density)
    assert right.get_title() == samples[-1].run.name


@pytest.mark.parametrize(("row", "name"), list(enumerate(["moving-cap@1e7", "fixed-cap-anticlockwise@1e9"])))
def test_the_zone_is_followed_through_the_cycle(
    figure: Callable[[str], Figure], sample: Callable[[str], Sample], row: int, name: str
) -> None:
    one, (left, right) = sample(name), figure("L5").axes[2 * row : 2 * row + 2]
    scene, phases = scene_of(one.run), np.array(one.run.phases)
    begin = np.fmin.reduce(one.t_in[:, 0], axis=1)
    means, shares = [], []
    for k, t in enumerate(scene.period * phases):
        free = ~(begin <= t)
        means.append(one.phase_s[free, 0, k])
        inside = (one.t_in[:, 0] <= t) & (t < one.t_out[:, 0])
        shares.append(1 - inside.any(axis=1).mean())
    found = measured(left)
    assert found.x == pytest.approx(phases)
    assert found.y == pytest.approx([values.mean() for values in means])
    assert found.errors == pytest.approx([standard_error(values) for values in means])
    found = measured(right)
    assert found.y == pytest.approx(shares)
    # Of a share of all or none, which has no spread, an error is drawn as if a millionth were otherwise.
    assert found.errors == pytest.approx(np.sqrt(np.maximum(found.y * (1 - found.y), 1e-6) / one.n))
    curve = theory.chaotic_zone(scene, np.linspace(0, scene.period, 9))
    for axes, law in ((left, curve.log_energy - curve.log_energy[0]), (right, curve.p_cha)):
        x, y = xy(line(axes, "theory, eq. "))
        assert (x[0], x[-1]) == pytest.approx((0, 1))
        assert np.interp(np.linspace(0, 1, 9), x, y) == pytest.approx(law, abs=5e-3)
        assert axes.get_title() == name
    assert right.get_ylim() == pytest.approx((0, 1.05))


@pytest.mark.parametrize("claim", PICTURES)
def test_a_figure_says_what_it_shows(figure: Callable[[str], Figure], claim: str) -> None:
    assert said(figure(claim)) == CLAIMS[claim]
