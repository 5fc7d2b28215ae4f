"""Pictures of orbits: path, sections, boundary map, energies, stretching, and an animation.

Each function returns a matplotlib figure, which a notebook shows; `save` of
`mushrooms.figures.style` writes one. Captured is blue, free is orange, in all of them.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, BinaryIO

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.transforms import ScaledTranslation
from mpmath import fp

import theory
from mushrooms import lyapunov
from mushrooms.figures import style as plots, table as tables
from mushrooms.orbits import BoolArray, FollowedOrbit, boundary, boundary_map, span_of_nu
from scene import Mushroom, Scene, Stem
from scene.geometry import table_at
from scene.mouth import start_time
from scene.pieces import FloatArray
from scene.refusal import BadInput, shown

N_FRAMES = 96
TRAIL = 6  # collisions that the animation's particle draws behind it
CAPTURED = plots.BLUE
FREE = plots.ORANGE
HALO = [withStroke(linewidth=2.5, foreground="white")]


def _check_orbits(orbits: Sequence[FollowedOrbit] | FollowedOrbit) -> list[FollowedOrbit]:
    found = [orbits] if isinstance(orbits, FollowedOrbit) else list(orbits)
    if not all(isinstance(orbit, FollowedOrbit) for orbit in found):
        raise BadInput(f"orbits = {shown(orbits)}, must be what mushrooms.orbits.follow returns")
    if not found or not all(len(orbit.walls) for orbit in found):
        raise BadInput("orbits: nothing to draw, the particle meets no wall")
    return found


@rc_context(plots.STYLE)
def trajectory(orbit: FollowedOrbit) -> Figure:
    """Draw an orbit's path in its table, with walls at its start and end.

    Names, the mouth and the start are marked.
    """
    [orbit] = _check_orbits(orbit)
    figure, axes = plots.new_figure(6.4, 6.0)
    states = orbit.states()
    begin = float(states[0, 0])
    end = float(states[-1, 0])
    if orbit.scene.period:
        tables.draw_walls(
            axes,
            orbit.scene,
            end,
            color=plots.GREY,
            linewidth=1.2,
            linestyle="--",
            label="walls at the end",
        )
    tables.draw_walls(
        axes, orbit.scene, begin, color=plots.BLACK, linewidth=2, label="walls at the start"
    )
    points = states[:, 1:3]
    lines = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)),
        cmap="viridis",
        norm=Normalize(0, len(points) / 0.88),  # the palest end is left out
        array=np.arange(len(points) - 1),
        linewidths=1.0,
    )
    axes.add_collection(lines)
    _names(axes, orbit.scene, begin)
    axes.plot(
        *points[0], "o", color=FREE, markeredgecolor="white", markersize=9, label="start", zorder=4
    )
    direction = states[-1, 3:] / (np.hypot(*states[-1, 3:]) or 1.0)
    ahead = points[-1] + 0.08 * np.ptp(points, axis=0).max() * direction
    axes.annotate("", ahead, points[-1], arrowprops={"arrowstyle": "-|>", "color": plots.BLACK})
    bar = figure.colorbar(lines, ax=axes, shrink=0.6, label="collision")
    bar.ax.set_ylim(0, len(points) - 1)
    axes.set(aspect="equal", xlabel="x [length]", ylabel="y [length]", title=_title([orbit]))
    axes.margins(0.08)
    # Half an inch below the axes: a wide table leaves much room between them and the end of the
    # figure.
    below = axes.transAxes + ScaledTranslation(0, -0.5, figure.dpi_scale_trans)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0), bbox_transform=below, ncols=3)
    return figure


def _title(orbits: Sequence[FollowedOrbit]) -> str:
    first = orbits[0]
    n = len(orbits)
    what = f"{len(first.walls):,} collisions" if n == 1 else f"{n} particles"
    name = plots.plain(first.scene.name or "a table")
    return f"{name}: {what} from E0 = {plots.power(first.energies()[0])}"


def _names(axes: Axes, scene: Scene, t: float) -> None:
    """Name the walls where they are at time t, and draw the mouth."""
    table = table_at(fp, scene, t)
    r = float(table.r)
    w = float(table.w)
    h = float(table.h)
    style: dict[str, Any] = {
        "fontsize": 9,
        "path_effects": HALO,
        "ha": "center",
        "va": "center",
        "zorder": 5,
    }
    base = "base", 0.5 * (r + w) if isinstance(scene, Mushroom) else 0.0, 0.0
    places = [base] if isinstance(scene, Stem) else [("arc", 0.0, r), base]
    if h:
        half = float(table.half_width(-0.5 * h))
        places += [("left", -half, -0.5 * h), ("right", half, -0.5 * h), ("floor", 0.0, -h)]
    for name, x, y in places:
        axes.text(x, y, name, **style)
    if isinstance(scene, Mushroom):
        axes.plot([-w, w], [0, 0], color=plots.GREEN, linestyle=":", linewidth=1.8)
        axes.text(0.0, 0.0, "mouth", color="#00624A", **style)


@rc_context(plots.STYLE)
def section(orbits: Sequence[FollowedOrbit] | FollowedOrbit, phase: float | None = None) -> Figure:
    """Draw a Poincare section.

    For a cap or a mushroom it shows place on the arc against sin phi, at each hit. In a mushroom
    the edge is |sin phi| = nu. If nu moves, hits beyond its largest value are captured at all
    times, and hits below its least value never. Between them it depends on the time; the colour of
    each hit shows it. For a stem it is the section of Fermi and Ulam: the phase of the wall against
    the velocity after the hit.

    Args:
        orbits: one or more, of one scene.
        phase: t/T of the walls, 0 to 1. Then only the first hit of the arc after this phase of each
            cycle is drawn; for a stem, depth and velocity at this phase.

    Raises:
        BadInput: the walls stand still, and a phase is asked for or the table is a stem.
    """
    figure, axes = plots.new_figure(6.4, 5.2)
    found = _check_orbits(orbits)
    draw = _draw_stem if isinstance(found[0].scene, Stem) else draw_section
    draw(axes, found, phase)
    axes.set(title=_title(found) + ("" if phase is None else f", at t/T = {phase:g}"))
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def draw_section(axes: Axes, found: Sequence[FollowedOrbit], phase: float | None = None) -> None:
    """Draw the Poincare section of one orbit or more of a cap or a mushroom; see `section`."""
    sections = [orbit.section() for orbit in found]
    if phase is not None:
        instants = [orbit.instants(phase) for orbit in found]
        sections = [one.first_from(times) for one, times in zip(sections, instants, strict=True)]
    span = span_of_nu(found[0].scene)
    if span and phase is not None:
        now = table_at(
            fp, found[0].scene, start_time(found[0].scene) + phase * found[0].scene.period
        )
        span = (float(now.w / now.r),) * 2
    if span:
        _draw_zones(axes, *span)
    place, sine = (np.concatenate([one[k] for one in sections]) for k in (2, 3))
    _points(
        axes, found, place, sine, np.concatenate([one.is_captured() for one in sections]), "hits"
    )
    axes.set(
        xlim=(0, 1),
        ylim=(-1, 1),
        xlabel="angle of the place on the arc / π, from the right end",
        ylabel="sin φ; φ: from the arc's normal, clockwise > 0",
    )


def _draw_zones(axes: Axes, low: float, high: float) -> None:
    """Draw the regions captured at all times and at no time, and the edges."""
    for sign in (1, -1):
        axes.axhspan(sign * high, sign, color=CAPTURED, alpha=0.10, linewidth=0)
        for level in {low, high}:
            axes.axhline(sign * level, color=plots.BLACK, linewidth=1)
    axes.axhspan(-low, low, color=FREE, alpha=0.10, linewidth=0)
    edge = f"nu = {low:.3g}" if high - low < 1e-12 else f"nu = {low:.3g} to {high:.3g}"
    axes.plot([], [], color=plots.BLACK, linewidth=1, label=f"edge |sin φ| = nu, {edge}")


def _draw_stem(axes: Axes, found: Sequence[FollowedOrbit], phase: float | None) -> None:
    """Draw the section of a stem; an orbit has one colour."""
    for orbit, colour in zip(found, plots.phase_colours(len(found)), strict=True):
        points = orbit.phase_section(phase)
        axes.plot(*points.T, ".", color=colour, markersize=1.2, rasterized=True)
    if phase is not None:
        axes.set(xlabel="y [length]", ylabel="vy [length/time]")
        return
    has_floor = isinstance(found[0].scene, Stem) and not found[0].scene.laws["h"].is_constant
    wall, name = ("floor", "vy") if has_floor else ("side", "|vx|")
    axes.set(
        xlim=(0, 1),
        ylim=(0, None),
        xlabel=f"phase t/T of the hit of a moving {wall}",
        ylabel=f"{name} after the hit [length/time]",
    )


def _points(
    axes: Axes,
    found: Sequence[FollowedOrbit],
    x: FloatArray,
    y: FloatArray,
    captured: BoolArray,
    what: str,
) -> None:
    """Draw points and count them in the legend.

    In a mushroom captured ones apart. Many points are finer.
    """
    size = min(4.0, max(0.6, 90.0 / math.sqrt(len(x) or 1)))
    kinds = [(captured, CAPTURED, "captured, "), (~captured, FREE, "free, ")]
    if not isinstance(found[0].scene, Mushroom):
        kinds = [(np.ones(len(x), bool), CAPTURED, "")]
    for which, colour, name in kinds:
        if which.any():
            axes.plot(x[which], y[which], ".", color=colour, markersize=size, rasterized=True)
            axes.plot(
                [], [], "o", color=colour, markersize=5, label=f"{name}{which.sum():,} {what}"
            )


@rc_context(plots.STYLE)
def collision_map(orbits: Sequence[FollowedOrbit] | FollowedOrbit) -> Figure:
    """Draw the boundary map: place along the boundary against the sine after each collision."""
    figure, axes = plots.new_figure(7.6, 5.0)
    draw_map(axes, _check_orbits(orbits))
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def draw_map(axes: Axes, found: Sequence[FollowedOrbit]) -> None:
    """Draw the boundary map of one orbit or more of a scene; see `collision_map`."""
    place, sine = np.vstack([boundary_map(orbit) for orbit in found]).T
    captured = np.concatenate([orbit.captured()[1:] for orbit in found])
    _points(axes, found, place, sine, captured, "collisions")
    for slot in boundary(found[0].scene):
        axes.axvline(slot.end, color=plots.BLACK, linewidth=0.8)
        if slot.end - slot.begin > 0:
            axes.text(
                (slot.begin + slot.end) / 2, 1.03, slot.wall, ha="center", va="bottom", fontsize=9
            )
    axes.set(
        xlim=(0, 1),
        ylim=(-1, 1),
        xlabel="place along the boundary, anticlockwise",
        ylabel="sine of the angle to the wall's normal, anticlockwise > 0",
    )
    axes.set_title(_title(found), pad=18)  # above the names of the walls


@rc_context(plots.STYLE)
def energy_in_time(orbit: FollowedOrbit) -> Figure:
    """Draw ln(E/E0) of a particle against time, with the theory; capture intervals are shaded.

    For many particles use `mushrooms.figures.energies.growth`.
    """
    [orbit] = _check_orbits(orbit)
    figure, axes = plots.new_figure(7.2, 4.4)
    span = orbit.scene.period
    states = orbit.states()
    time = (states[:, 0] - states[0, 0]) / span if span else states[:, 0]
    energies = orbit.energies()
    axes.plot(
        time,
        np.log(energies / energies[0]),
        color=plots.BLUE,
        linewidth=0.8,
        label="this particle",
        zorder=3,  # above the theory, a broad line
    )
    known = "theory with these captures" if isinstance(orbit.scene, Mushroom) else "theory"
    try:
        axes.plot(time, orbit.adiabatic(), color=plots.BLACK, linewidth=2.6, alpha=0.6, label=known)
        if isinstance(orbit.scene, Mushroom):
            free = theory.chaotic_zone(orbit.scene, states[:, 0]).log_energy
            axes.plot(
                time,
                free - free[0],
                color=FREE,
                linestyle="--",
                linewidth=1.3,
                label="theory, never captured",
            )
    except (theory.NotCovered, theory.NotConverged):
        pass  # no theory of this table: the simulation alone
    captured = orbit.captured()
    if isinstance(orbit.scene, Mushroom) and captured.any():
        axes.fill_between(
            time,
            0,
            1,
            where=captured,
            step="post",
            transform=axes.get_xaxis_transform(),
            color=CAPTURED,
            alpha=0.15,
            linewidth=0,
            label="captured",
        )
    axes.set(xlabel="t / T" if span else "t [time]", ylabel="ln(E/E0)", title=_title([orbit]))
    figure.legend(loc="outside lower center", ncols=2)
    return figure


@rc_context(plots.STYLE)
def exponents(
    orbits: Sequence[FollowedOrbit] | FollowedOrbit, progress: Callable[[int], None] | None = None
) -> Figure:
    """Draw finite-time Lyapunov exponents against collisions, the last with its error.

    Raises:
        BadInput: as `mushrooms.lyapunov.stretching`.
    """
    found = _check_orbits(orbits)
    figure, axes = plots.new_figure(7.2, 4.4)
    n_before = 0
    for k, (orbit, colour) in enumerate(zip(found, plots.phase_colours(len(found)), strict=True)):
        report = None if progress is None else (lambda n, before=n_before: progress(before + n))
        one = lyapunov.stretching(orbit, report)
        n_before += len(orbit.walls)
        count = np.arange(1, len(one.logs) + 1)
        label = f"{one.exponent:.3f} ± {one.error:.3f} a collision"
        if isinstance(orbit.scene, Mushroom):
            label += f", {orbit.captured()[1:].mean():.0%} of it captured"
        axes.plot(count, one.exponents, color=colour, linewidth=1.2, label=label)
        axes.errorbar(count[-1] * (1 + 0.01 * k), one.exponent, one.error, color=colour, capsize=3)
    axes.axhline(0, color=plots.BLACK, linewidth=0.8)
    axes.set(
        xscale="log", xlabel="collisions", ylabel="exponent [1/collision]", title=_title(found)
    )
    figure.legend(loc="outside lower center", ncols=1 + (len(found) > 3))
    return figure


@rc_context(plots.STYLE)
def write_animation(
    orbit: FollowedOrbit,
    file: BinaryIO,
    n_frames: int = N_FRAMES,
    progress: tables.Progress | None = None,
) -> None:
    """Write a GIF of the walls in motion and the particle with its last flights behind it.

    Args:
        orbit: shown from its start to its last collision, at frames evenly spaced in time.
        file: open for binary writing.
        n_frames: number of frames.
        progress: called with the number of frames that are drawn, and with that of all.
    """
    [orbit] = _check_orbits(orbit)
    states = orbit.states()
    times = np.linspace(states[0, 0], states[-1, 0], n_frames)
    places = orbit.at(times)
    last = np.searchsorted(states[:, 0], times, side="right") - 1
    unit = orbit.scene.period or 1.0
    name = "t/T" if orbit.scene.period else "t"
    axes = tables.new_slide(orbit.scene)
    axes.plot(*places[0], "o", color=FREE, markersize=6, markerfacecolor="none", label="start")
    (trail,) = axes.plot([], [], color=plots.SKY, linewidth=1)
    (dot,) = axes.plot([], [], "o", color=plots.BLACK, markersize=6)
    axes.figure.legend(loc="outside lower center")

    def show(k: int) -> None:
        trail.set_data(
            *np.vstack([states[max(0, last[k] - TRAIL) : last[k] + 1, 1:3], places[k]]).T
        )
        dot.set_data(*places[k : k + 1].T)
        axes.set_title(
            f"{plots.plain(orbit.scene.name)}   {name} = {(times[k] - times[0]) / unit:.2f}"
        )

    tables.write_frames(orbit.scene, axes, times.tolist(), show, file, progress)
