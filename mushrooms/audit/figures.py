"""The figures of the claims: which claim each belongs to, its simulations, how it is drawn.

They show one cycle and many, laws through the cycle and against energy, and the frozen table, with
the theory over the simulation.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import norm

import theory
from mushrooms.audit.claims.exponents import nu_gap, zone_share
from mushrooms.audit.claims.finite_energy import (
    ACW,
    CW,
    DRAWN_SEED,
    ERGODIC,
    LADDER,
    N_DRAWN,
    fitted,
    predicted,
    summed,
    width,
    zone_energy,
)
from mushrooms.audit.runs import Sample, scene_of
from mushrooms.audit.tolerances import Mean, mean, share
from mushrooms.figures.energies import ROOM, draw, draw_adiabatic, gathered, with_residuals
from mushrooms.figures.orbits import draw_map, draw_section
from mushrooms.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    STYLE,
    new_figure,
    phase_colours,
    power,
)
from mushrooms.orbits import follow
from scene import Scene, load
from scene.pieces import FloatArray
from scene.tables import Mushroom

Panels = Any  # axes as `new_figure` returns them
N_SUM_BINS = 300
N_LOOP = 240
N_PHASES = 6


def loops(panels: Panels) -> None:
    """Draw the cycles in the plane (w, h) of sec. 4.1 and in (V_ell/V_cap, V_cap/V) of sec. 3.5."""
    fixed = load("fixed-cap-anticlockwise")
    moving = load("moving-cap")
    w, h = (fixed.laws[name].values(np.linspace(0, 1, N_LOOP + 1)) for name in "wh")
    _loop(panels[0], w, h)
    panels[0].set(xlabel="half-width w", ylabel="depth h", title="fixed cap, anticlockwise")
    titles = ("fixed cap, anticlockwise", "moving cap")
    for panel, scene, title in zip(panels[1:], (fixed, moving), titles, strict=True):
        _loop(panel, *_volume_shares(scene, np.linspace(0, scene.period, N_LOOP + 1)))
        panel.set(xlabel="V_ell / V_cap", ylabel="V_cap / V", title=title)
    panels[2].legend(loc="best", title="t / T")


def _loop(axes: Axes, x: FloatArray, y: FloatArray) -> None:
    axes.fill(x, y, color=SKY, alpha=0.5, linewidth=0)
    axes.plot(x, y, color=BLACK, linewidth=1.2)
    for k, colour in enumerate(phase_colours(N_PHASES)):
        i = k * N_LOOP // N_PHASES
        axes.plot(x[i], y[i], "o", color=colour, markersize=6, label=f"{k}/{N_PHASES}")
        j = i + N_LOOP // (2 * N_PHASES)
        start = (x[j - 2], y[j - 2])
        end = (x[j], y[j])
        if start != end:
            axes.annotate(
                "", end, start, arrowprops={"arrowstyle": "-|>", "color": BLACK, "linewidth": 0}
            )


def _bars(
    axes: Axes, values: FloatArray, edges: FloatArray, n: int | None = None, **style: Any
) -> None:
    """Draw a histogram of values as a density; n are all, where some have no value."""
    heights = np.histogram(values, edges)[0] / ((n or len(values)) * np.diff(edges))
    usual: dict[str, Any] = {"fill": True, "color": SKY, "label": "simulation"}
    axes.stairs(heights, edges, **usual | style)


def _points(
    axes: Axes, x: Sequence[float] | FloatArray, values: Sequence[Mean], **style: Any
) -> None:
    """Draw measured values with their standard errors."""
    found, errors = zip(*values, strict=True)
    usual: dict[str, Any] = {"fmt": "o", "markersize": 4, "label": "simulation, ± 1 standard error"}
    axes.errorbar(x, found, errors, capsize=2, **usual | {"color": BLUE} | style)


def retraced(panels: Panels, sample: Sample) -> None:
    """Draw the retraced arc in the plane of sec. 3.5, and its energies.

    Lines join captures to their releases.
    """
    left, right = panels
    scene = scene_of(sample.run)
    assert isinstance(scene, Mushroom)
    left.plot(
        *_volume_shares(scene, np.linspace(0, scene.period, N_LOOP)), color=BLACK, linewidth=1.2
    )
    curve = theory.capture_curve(scene, 4 * N_PHASES + 1)
    first = curve.t_in < curve.t_out.min()  # on the way back captures and releases change places
    t_in = curve.t_in[first]
    t_out = curve.t_out[first]
    for colour, label, times in ((BLUE, "captures", t_in), (ORANGE, "releases", t_out)):
        left.plot(*_volume_shares(scene, times), "o", color=colour, markersize=5, label=label)
    for pair in zip(t_in, t_out, strict=True):
        left.plot(*_volume_shares(scene, np.array(pair)), color=BLUE, linewidth=0.8, linestyle=":")
    left.set(xlabel="V_ell / V_cap", ylabel="V_cap / V", title=f"{sample.run.scene}, the way there")
    left.legend(loc="best")
    _energies(right, None, sample)
    right.legend(loc="upper right", fontsize=7)


def _volume_shares(scene: Scene, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return V_ell/V_cap and V_cap/V at times."""
    now = theory.volumes_at(np, scene, times)
    return now.v_ell / now.v_cap, now.v_cap / (now.v_cap + now.v_stem)


def gain_of_capture(axes: Axes) -> None:
    """Draw log E1/E0 against the time of capture, theory (the paper's figure beside its loop)."""
    curve = theory.capture_curve(load("moving-cap"), 600)
    best = theory.largest_gain(load("moving-cap"))
    assert best is not None
    axes.plot(curve.t_in, curve.s, color=ORANGE, linewidth=1.8)
    axes.plot(*best, "o", color=BLACK, label=f"largest: {best[1]:.6f} at t = {best[0]:.5f}")
    free = float(theory.predict(load("moving-cap"), 15).log_e_nc)
    axes.axhline(free, color=BLACK, linestyle=":", linewidth=1, label=f"never captured: {free:.6f}")
    axes.set(xlabel="time of capture, t_in", ylabel="ln(E1/E0), theory")
    axes.legend()


def energies(panels: Panels, *samples: Sample) -> None:
    """Draw histograms of log E1/E0 with theory over them.

    Below is what is left, in standard errors.
    """
    for (panel, rest), sample in zip(panels, samples, strict=True):
        _energies(panel, rest, sample)
        # Below: within the panel it would cover the caustic or a peak, wherever a scene has them.
        entries = panel.get_legend_handles_labels()
        rest.legend(*entries, loc="upper center", bbox_to_anchor=(0.5, -0.5))


def _energies(axes: Axes, rest: Axes | None, sample: Sample) -> None:
    found = predicted(sample)
    bars = gathered(sample.gain, float(found.peak[1] ** 0.5))
    draw(axes, rest, bars, found)
    axes.set_title(f"{sample.run.scene}, E0 = {power(sample.run.energy)}, {sample.n:,} particles")
    highest = draw_adiabatic(axes, theory.energies(scene_of(sample.run)), bars.edges, "sharp")
    axes.set_ylim(0, max(axes.get_ylim()[1], ROOM * highest))


def capture_times(panels: Panels, *samples: Sample) -> None:
    """Draw histograms of capture times with the theory's density over them."""
    for panel, sample in zip(panels, samples, strict=True):
        scene = scene_of(sample.run)
        curve = theory.capture_curve(scene, 3)
        edges = np.linspace(curve.t_in[0], curve.t_in[-1], 51)
        mass = np.asarray(theory.capture_time_mass(scene, edges)) / np.diff(edges)
        _bars(panel, sample.first_capture[0], edges, sample.n)
        panel.stairs(
            mass, edges, color=ORANGE, linewidth=1.5, label="theory, eq. (ps)", baseline=None
        )
        panel.set(xlabel="time of capture", ylabel="density", title=sample.run.name, ylim=(0, None))
    panels[0].legend(loc="upper left", fontsize=7)


def sums(panels: Panels, *samples: Sample) -> None:
    """Draw log E_n/E0 over n of the last run: density, and its tails on a logarithmic axis."""
    for row, n in zip(panels, (10, 30), strict=True):
        for panel, scale in zip(row, ("linear", "log"), strict=True):
            _sum(panel, samples[-1], n, scale)
        row[0].legend(loc="upper left")


def _sum(axes: Axes, sample: Sample, n: int, scale: str) -> None:
    drawn = summed(sample.run.name, n)
    centre = drawn.mean / n
    sd = drawn.sd / n
    density, places = np.histogram(drawn.values / n, N_SUM_BINS, density=True)
    x = (places[1:] + places[:-1]) / 2
    _bars(
        axes,
        sample.s[:, n - 1] / n,
        np.linspace(centre - 5 * sd, centre + 5 * sd, 51),
        baseline=1e-9,
    )
    axes.plot(x, density, color=BLACK, linewidth=1.3, label="sums of n cycles, by theory")
    axes.plot(
        x, norm.pdf(x, centre, sd), color=ORANGE, linestyle="--", linewidth=1.2, label="Gaussian"
    )
    top = float(norm.pdf(0) / sd)
    limits = (0, 1.4 * top) if scale == "linear" else (top * 1e-5, 2 * top)
    axes.set(
        yscale=scale,
        xlim=(centre - 5 * sd, centre + 5 * sd),
        ylim=limits,
        xlabel=f"(1/{n}) ln(E_{n}/E0)",
        ylabel="density",
        title=f"n = {n}, E0 = {power(sample.run.energy)}, {sample.n:,} particles",
    )


def losses(axes: Axes, sample: Sample) -> None:
    """Draw the share with less energy than at first against the number of cycles."""
    scene = scene_of(sample.run)
    n_cycles = sample.run.n_cycles
    found = predicted(sample).draw(n_cycles, N_DRAWN // n_cycles, DRAWN_SEED)
    axes.plot(
        np.arange(1, n_cycles + 1),
        (found < 0).mean(axis=0),
        color=BLACK,
        linewidth=1.3,
        label="theory at this energy, drawn",
    )
    places = np.unique(np.geomspace(1, n_cycles, 12).astype(int))
    far = np.array([theory.loss_probability(scene, int(k)) for k in places])
    axes.plot(places, far, "s", color=ORANGE, markersize=4, label="theory at infinite energy")
    rate = float(theory.rarity(scene).rate)
    late = places[len(places) // 2 :]
    slope = far[-1] * np.exp(rate * (n_cycles - late))
    axes.plot(late, slope, ":", color=ORANGE, label=f"exp(-{rate:.4f} n)")
    _points(axes, places, [share(sample.s[:, k - 1] < 0) for k in places])
    axes.set(
        yscale="log",
        xlabel="cycles n",
        ylabel="P(E_n < E0)",
        title=f"{sample.run.name}, {sample.n:,} particles",
    )
    axes.legend(fontsize=8)


def stems(panels: Panels, tilted: Sample, upright: Sample) -> None:
    """Draw the uncaptured particles' energies of both stems, each from its own theory's."""
    edges = np.linspace(-0.4, 0.8, 121)
    sigma = width(tilted).value
    outline: dict[str, Any] = {"color": BLUE, "fill": False, "linewidth": 1.5}
    for panel, scale in zip(panels, ("linear", "log"), strict=True):
        for sample, label, style in (
            (tilted, "tilted stem", {}),
            (upright, "upright stem", outline),
        ):
            kept = sample.gain[~sample.captured] - float(
                theory.predict(scene_of(sample.run)).log_e_nc
            )
            _bars(panel, kept, edges, baseline=1e-3, label=label, **style)
        gaussian = norm.pdf(edges, sigma**2 / 4, sigma)
        panel.plot(
            edges, gaussian, color=GREEN, linewidth=1.2, label="Gaussian, tilted stem's width"
        )
        panel.set(
            xlabel="ln(E1/E0) of the never captured, from theory's", ylabel="density", yscale=scale
        )
    panels[1].set(ylim=(1e-3, 10))
    panels[0].legend()


N_ORBITS = 40
N_HITS = 250
SEED = 7


def zone(panels: Panels, *samples: Sample) -> None:
    """Draw mean log E of the uncaptured and the share in the chaotic zone through the cycle."""
    for (left, right), sample in zip(panels, samples, strict=True):
        times, means = zone_energy(sample)
        span = times[0] / sample.run.phases[0]
        fine = np.linspace(0, span, 400)
        curve = theory.chaotic_zone(scene_of(sample.run), fine)
        left.plot(
            fine / span,
            curve.log_energy - curve.log_energy[0],
            color=ORANGE,
            label="theory, eq. (dE)",
        )
        _points(left, sample.run.phases, means)
        left.set(xlabel="t / T", ylabel="mean ln(E/E0), not captured so far", title=sample.run.name)
        right.plot(fine / span, curve.p_cha, color=ORANGE, label="theory, eq. (ps)")
        shares = zone_share(sample, np.array(times))
        errors = [Mean(float(p), math.sqrt(max(p * (1 - p), 1e-6) / sample.n)) for p in shares]
        _points(right, sample.run.phases, errors)
        right.set(
            xlabel="t / T",
            ylabel="share in the chaotic zone",
            title=sample.run.name,
            ylim=(0, 1.05),
        )
        left.legend(loc="lower center")
        right.legend(loc="lower left")


def widths(axes: Axes, *samples: Sample) -> None:
    """Draw the width of the uncaptured peak against E0, with fitted powers.

    Moving caps come first, then c = 0.
    """
    moving = list(samples[: len(PEAKS)])
    ergodic = list(samples[len(PEAKS) :])
    for these, colour, marker, label in (
        (moving, BLUE, "o", "moving cap"),
        (ergodic, GREEN, "s", "c = 0"),
    ):
        energies = [sample.run.energy for sample in these]
        values = [width(sample) for sample in these]
        fit = fitted(these, values)
        text = f"{label}: exponent {fit.exponent:.4f} ± {fit.exponent_error:.4f}"
        _points(axes, energies, values, fmt=marker, color=colour, markersize=5, label=text)
        axes.plot(
            energies,
            fit.coefficient * np.array(energies) ** fit.exponent,
            color=colour,
            linewidth=1,
        )
    x = np.array([moving[0].run.energy, moving[-1].run.energy])
    printed = width(moving[0]).value * (x / x[0]) ** 0.25
    axes.plot(x, printed, color=ORANGE, linestyle="--", label="as printed, E0^(1/4)")
    axes.set(
        xscale="log", yscale="log", xlabel="E0", ylabel="width of the uncaptured peak of ln(E1/E0)"
    )
    axes.legend(fontsize=8)


def convergence(panels: Panels, *samples: Sample) -> None:
    """Draw the mean of s, p_nc and the unbiased mean against E0."""
    energies = [sample.run.energy for sample in samples]
    scene = load("moving-cap")
    prediction = theory.predict(scene, 15)
    unbiased = theory.unbiased_mean(scene)
    rows: tuple[tuple[str, list[Mean], float], ...] = (
        ("mean of ln(E1/E0)", [mean(s.gain) for s in samples], float(prediction.m1)),
        (
            "share never captured",
            [share(s.never_captured) for s in samples],
            float(prediction.p_nc),
        ),
        ("mean of exp(-s/2)", [mean(np.exp(-s.gain / 2)) for s in samples], float(unbiased)),
    )
    for panel, (label, measured, truth) in zip(panels, rows, strict=True):
        _points(panel, energies, measured)
        panel.axhline(truth, color=ORANGE, label="theory, infinite E0")
        panel.set(xscale="log", xlabel="E0", title=label)
    fit = theory.extrapolate(energies, [v.value for v in rows[0][1]], [v.error for v in rows[0][1]])
    x = np.geomspace(energies[0], energies[-1], 200)
    panels[0].plot(
        x,
        fit.limit + fit.slope * x**-0.5,
        color=BLACK,
        linewidth=1,
        label=f"{fit.limit:.4f} + {fit.slope:.2f} E0^(-1/2)",
    )
    panels[0].legend(fontsize=8)


def release(panels: Panels, *samples: Sample) -> None:
    """Draw nu(t_out) - nu(t_in) against 1/v."""
    for sample in samples:
        shown = np.abs(nu_gap(sample)[:400])
        place = np.full(len(shown), 1 / sample.speed)
        panels[0].plot(place, shown, ".", color=GREY, markersize=1.5, rasterized=True)
    x = np.array([1 / sample.speed for sample in samples])
    rms = np.array([math.sqrt(np.mean(nu_gap(sample) ** 2)) for sample in samples])
    panels[0].plot(x, rms, "o", color=BLUE, label="root mean square")
    panels[0].plot(x, rms[0] * x / x[0], color=ORANGE, label="slope 1")
    panels[0].set(
        xscale="log",
        yscale="log",
        ylim=(rms.min() / 100, rms.max() * 100),
        xlabel="1/v",
        ylabel="|nu(t_out) - nu(t_in)|",
    )
    panels[0].legend()
    sample = samples[-1]
    gap = nu_gap(sample) * sample.speed
    panels[1].hist(gap, np.linspace(-1, 1.5, 101), density=True, color=BLUE, alpha=0.5)
    panels[1].set(xlabel="v (nu(t_out) - nu(t_in))", ylabel="density", title=sample.run.name)


def frozen(panels: Panels) -> None:
    """Draw the frozen mushroom: hits of the arc, and the boundary map."""
    found = follow(load("frozen-mushroom"), N_HITS, seed=SEED, n_orbits=N_ORBITS)
    draw_section(panels[0], found)
    draw_map(panels[1], found)
    for panel in panels:
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15))


Samples = Mapping[str, Sample]
MAIN_RUN = "moving-cap@1e7"
MANY_CYCLES = "moving-cap@1e7x30"
MANY_SLOWER = "moving-cap@1e5x30"
PEAKS = LADDER[3:6]  # the moving caps whose widths are fitted


class Picture(NamedTuple):
    """A figure of the report.

    Attributes:
        claim: the claims's id below which it stands.
        caption: what it shows.
        draw: draws into its panels the samples of its runs.
        panels: returns a new figure and its panels.
        needs: runs it cannot do without.
        more: runs that it shows where they are there, after the others.
    """

    claim: str
    caption: str
    draw: Callable[..., None]
    panels: Callable[[], tuple[Figure, Panels]]
    needs: tuple[str, ...] = ()
    more: tuple[str, ...] = ()


ALL = (
    Picture(
        "M2",
        "The cycles, with the direction of time; colours mark the phase. Left: the plane of eq. "
        "(cycle). Middle and right: the plane of sec. 3.5, in which energy grows when the loop"
        " bounds an area (M12). The moving cap's runs clockwise, as its caption in the paper says.",
        loops,
        partial(new_figure, 9.6, 3.4, 1, 3),
    ),
    Picture(
        "N5",
        "Theory: what a particle captured at t_in has gained after the cycle.",
        gain_of_capture,
        partial(new_figure, 5.2, 3.2),
    ),
    Picture(
        "M7",
        "Width of the uncaptured peak against energy, with fitted powers, and the power as"
        " printed. Error bars are smaller than the marks.",
        widths,
        partial(new_figure, 5.4, 3.8),
        (*PEAKS, *ERGODIC[1:]),
    ),
    Picture(
        "M9",
        "How the moving cap's means approach the theory as E0 grows. The mean of exp(-s/2), right, "
        "has no bias of order E0^(-1/2).",
        convergence,
        partial(new_figure, 9.6, 3.2, 1, 3),
        LADDER[:6],
        LADDER[6:],
    ),
    Picture(
        "X1",
        "Energies after one cycle, fixed cap. In theory (orange) the never captured share one"
        " energy, dashed. The other curve is the theory at this energy, with diffusion and lags"
        " from frozen tables and nothing fitted.",
        energies,
        partial(with_residuals, 2),
        (ACW, CW),
    ),
    Picture(
        "X2",
        "Energies after one cycle, moving cap; as above. The orange density is infinite at its"
        " right end, the caustic of N5; drawn is its mean over one bar.",
        energies,
        partial(with_residuals, 2),
        ("moving-cap@1e6", MAIN_RUN),
    ),
    Picture(
        "X3",
        "When particles are captured. The area is the captured share.",
        capture_times,
        partial(new_figure, 9.6, 3.2, 1, 3),
        (MAIN_RUN, ACW, CW),
    ),
    Picture(
        "X4",
        "Many cycles: the centre and, on a logarithmic axis, the tails, with sums drawn from the"
        " theory at this energy.",
        sums,
        partial(new_figure, 9.6, 6.4, 2, 2),
        (MANY_SLOWER,),
        (MANY_CYCLES,),
    ),
    Picture(
        "X5", "c = 0: one narrow peak.", energies, partial(with_residuals, 1), ("ergodic@1e7",)
    ),
    Picture(
        "X6",
        "Tilted and upright stem: energies of the never captured, each counted from its own"
        " theory's log E_nc. Parabolic orbits between the upright sides spread them far.",
        stems,
        partial(new_figure, 9.6, 3.4, 1, 2),
        ("moving-cap@1e6", "untilted@1e6"),
    ),
    Picture(
        "X7",
        "A loop without an interior that accelerates. Left: one parameter moves along the arc and"
        " back; captures (blue) and their releases (orange), at the same V_ell/V_cap, lie at"
        " different V_cap/V. Right: energies after one cycle, as in X1.",
        retraced,
        partial(new_figure, 9.6, 3.6, 1, 2),
        ("retraced-arc@1e6",),
    ),
    Picture(
        "D1",
        "How rare it is to end with less energy: the probability falls as exp(-n I).",
        losses,
        partial(new_figure, 5.6, 3.6),
        (MANY_SLOWER,),
    ),
    Picture(
        "L3",
        "The frozen mushroom: orbits in the island (blue) and in the chaotic zone (orange).",
        frozen,
        partial(new_figure, 9.6, 4.2, 1, 2),
    ),
    Picture(
        "L4",
        "Release: how far nu at release is from nu at capture, against 1/v (grey: single"
        " particles), and its distribution in units of 1/v.",
        release,
        partial(new_figure, 9.6, 3.4, 1, 2),
        LADDER[1:6],
    ),
    Picture(
        "L5",
        "Through the cycle: mean log E of the particles not captured so far, and the share of "
        "particles in the chaotic zone (L6).",
        zone,
        partial(new_figure, 9.6, 6.0, 2, 2),
        (MAIN_RUN, ACW),
    ),
)


FIRST = Picture("", "", energies, partial(with_residuals, 1), (MAIN_RUN,))  # on the first screen


def draw_picture(picture: Picture, samples: Samples) -> Figure | None:
    """Draw one figure; None if simulations that it needs are not there."""
    if not all(name in samples for name in picture.needs):
        return None
    runs = [samples[name] for name in (*picture.needs, *picture.more) if name in samples]
    with rc_context(STYLE):
        figure, panels = picture.panels()
        picture.draw(panels, *runs)
    return figure
