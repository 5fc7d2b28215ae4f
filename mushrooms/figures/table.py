"""Pictures of a table: walls through the cycle, a few chords of one trajectory, an animation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, BinaryIO

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpmath import fp
from PIL import Image

import fast
from mushrooms.figures import style as plots
from scene import BadInput, Scene, State, check_scene
from scene.geometry import table_at

Progress = Callable[[int, int], None]
SUFFIXES = (".svg", ".png", ".pdf", ".gif")
N_PHASES = 6
N_CHORDS = 14
N_FRAMES = 36
FRAMES_PER_SECOND = 12
# Of an animation [pixels]: it fills a slide.
WIDEST = 1920
HIGHEST = 1080
DOTS_PER_INCH = 200


def walls(scene: Scene, t: float) -> list[np.ndarray]:
    """Return the walls at time t as polylines of shape (2, n) [length]; the mouth is left open."""
    check_scene(scene)
    return [np.transpose(line) for line in table_at(fp, scene, t).outline()]


def draw_walls(axes: Axes, scene: Scene, t: float, **style: Any) -> list[Line2D]:
    """Draw the walls at time t; a label is that of the first line."""
    lines = [axes.plot(*line, **style)[0] for line in walls(scene, t)]
    for line in lines[1:]:
        line.set_label("_")
    return lines


def phases(scene: Scene, n: int = N_PHASES) -> list[float]:
    """Return n times [time] evenly over one cycle; a static table has the single time 0."""
    check_scene(scene)
    span = scene.period
    return [span * k / n for k in range(n)] if span else [0.0]


def chords(scene: Scene, t: float, n: int = N_CHORDS) -> np.ndarray:
    """Follow one particle for n collisions from time t; returns points of shape (2, m) [length].

    It is so fast that the walls hardly move meanwhile. The line stops early if a step has no
    answer.
    """
    points = np.hstack(walls(scene, t))
    top = points[1].max()
    bottom = points[1].min()
    speed = 1e6 * points[0].max()
    direction = 0.61  # radians: off every symmetry
    vx, vy = float(speed * np.cos(direction)), float(speed * np.sin(direction))
    state = State(t, 0.0, float(0.37 * (top or bottom)), vx, vy)
    path = [np.array([state.x, state.y])]
    with suppress(BadInput):  # of laws too fast for binary64 there is no line
        path += list(fast.trajectory(scene, state, n, t + 1.0).steps[:, 2:4])
    return np.transpose(path)


@rc_context(plots.STYLE)
def new_strip(scene: Scene, width: float, max_height: float) -> Figure:
    """Return a figure [inches] with the table at each phase of the cycle and a trajectory in it.

    Low tables stand in two rows if the height permits.
    """
    times = phases(scene)
    left, right, bottom, top = _frame(scene)
    ratio = (top - bottom) / (right - left)

    def height(n_rows: int) -> float:
        return n_rows * (0.85 * width * n_rows / len(times) * ratio + 0.6)

    n_rows = 2 if len(times) > 1 and height(2) <= max_height else 1
    figure, grid = plots.new_figure(
        width, min(height(n_rows), max_height), n_rows, len(times) // n_rows
    )
    for k, (axes, t, colour) in enumerate(
        zip(np.ravel(grid), times, plots.phase_colours(len(times)), strict=True)
    ):
        axes.plot(*chords(scene, t), color=plots.GREY, linewidth=0.6)
        draw_walls(axes, scene, t, color=colour, linewidth=2, solid_capstyle="butt")
        _set_frame(axes, scene)
        axes.set_title(f"t/T = {k}/{len(times)}" if len(times) > 1 else "static")
        axes.label_outer()
    return figure


def write_picture(
    scene: Scene, suffix: str, file: BinaryIO, progress: Progress | None = None
) -> None:
    """Write a picture of the scene.

    Args:
        scene: any valid table.
        suffix: ".svg", ".png" or ".pdf": the table at each phase, with chords; ".gif": the walls in
            motion.
        file: open for binary writing.
        progress: see `write_frames`.
    """
    times = phases(scene, N_FRAMES)
    name = plots.plain(scene.name)
    if suffix != ".gif":
        figure = new_strip(scene, 7.2, 6.0)
        figure.suptitle(name)
        plots.save(figure, file, suffix)
        return
    axes = new_slide(scene)

    def show(k: int) -> None:
        axes.set_title(
            f"{name}   " + (f"t/T = {times[k] / scene.period:.2f}" if scene.period else "static")
        )

    write_frames(scene, axes, times, show, file, progress)


@rc_context(plots.STYLE)
def new_slide(scene: Scene) -> Axes:
    """Return the axes of a figure that holds the table throughout its cycle and fills a slide."""
    left, right, bottom, top = _frame(scene)
    width = min(WIDEST, max(HIGHEST, HIGHEST * (right - left) / (top - bottom)))
    figure = plots.new_figure(width / DOTS_PER_INCH, HIGHEST / DOTS_PER_INCH)[0]
    axes = figure.axes[0]
    figure.set_dpi(DOTS_PER_INCH)
    _set_frame(axes, scene)
    return axes


@rc_context(plots.STYLE)
@plots.any_letters()
def write_frames(
    scene: Scene,
    axes: Axes,
    times: Sequence[float],
    show: Callable[[int], None],
    file: BinaryIO,
    progress: Progress | None = None,
) -> None:
    """Write a GIF of the walls at these times [time].

    Args:
        scene: the table.
        axes: of `new_slide`.
        times: one for each frame.
        show: receives the number of a frame, and draws what moves besides the walls.
        file: open for binary writing.
        progress: called with the number of frames that are drawn, and with that of all.
    """
    tell = progress or (lambda _n_done, _n: None)
    lines = draw_walls(axes, scene, times[0], color=plots.BLUE, linewidth=2)
    canvas: Any = axes.figure.canvas
    frames = []
    for k, t in enumerate(times):
        tell(k, len(times))
        show(k)
        for line, points in zip(lines, walls(scene, t), strict=True):
            line.set_data(*points)
        canvas.draw()
        canvas.figure.set_layout_engine("none")  # the axes stay where the first frame has them
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        frames.append(picture.quantize(method=Image.Quantize.FASTOCTREE))
    duration = round(1000 / FRAMES_PER_SECOND)
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:], duration=duration, loop=0)


def _frame(scene: Scene) -> tuple[float, float, float, float]:
    # Left, right, bottom, top of one frame that holds the walls of the whole cycle.
    points = np.hstack([line for t in phases(scene, N_FRAMES) for line in walls(scene, t)])
    left, bottom = points.min(axis=1)
    right, top = points.max(axis=1)
    margin = 0.05 * max(right - left, top - bottom)
    return left - margin, right + margin, bottom - margin, top + margin


def _set_frame(axes: Axes, scene: Scene) -> None:
    left, right, bottom, top = _frame(scene)
    axes.set(
        xlim=(left, right),
        ylim=(bottom, top),
        aspect="equal",
        xlabel="x [length]",
        ylabel="y [length]",
    )
