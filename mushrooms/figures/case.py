"""A case of the suite: the given path over the certified one, in the whole table and near the hit.

Colours have one meaning in all of these figures, told once on the page (`LEGEND`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context

from conformance.grading.agreement import middle
from conformance.suite.answers import outcomes_of
from conformance.suite.result import Result
from conformance.vectors import Vector
from mushrooms.figures import style as plots
from mushrooms.figures import table as draw
from scene import Collision, Horizon, Outcome, Scene, State, from_data

LEGEND = (
    (plots.ORANGE, "certified path"),
    (plots.BLUE, "given path"),
    (plots.GREY, "walls at the start"),
    (plots.BLACK, "walls at the certified hit"),
)
CLOSE = 0.06  # half the width of the close-up, of the table's size; more where the two hits lie further apart
Point = tuple[float, float]
STROKES = ((plots.ORANGE, 4.0, "certified"), (plots.BLUE, 1.5, "given"))


@rc_context(plots.STYLE)
def paths(result: Result, vector: Vector) -> bytes:
    """Draw a case as SVG: the table at the start and at the hit, both paths, and the hit close up.

    Raises:
        BadInput: the vector's scene is one that must be refused, and has no table.
    """
    scene = from_data(vector.scene)
    certified = [o for o in middle(vector.expect[0], vector.state) if isinstance(o, Collision | Horizon)]
    given = _given(result)
    at = _in_question(result, vector, certified)
    t = certified[at].t if certified else vector.state.t
    start = (vector.state.x, vector.state.y)
    certified, given = certified[: at + 1], given[: at + 1]  # what follows a wrong step follows from it
    routes = [start, *((o.x, o.y) for o in certified)], [start, *((step["x"], step["y"]) for step in given)]
    line = "none" if vector.kind == "flow" else "-"  # a flow says where it ends, not how it came there
    figure, both = plots.new_figure(7.4, 3.7, 1, 2)
    for axes in both:
        _draw_walls(axes, scene, vector.state.t, t)
        for route, colour, width in zip(routes, (plots.ORANGE, plots.BLUE), (4, 1.5), strict=True):
            style = {"color": colour, "linewidth": width, "markersize": 3 * width}
            axes.plot(*np.transpose(route), linestyle=line, alpha=0.75, marker=".", **style)
        axes.plot(*start, marker="o", color=plots.BLACK, markersize=4, linestyle="none")
        axes.set(aspect="equal", xlabel="x [length]", ylabel="y [length]")
    size = float(np.ptp(np.hstack(draw.walls(scene, t)), axis=1).max())
    ends = [route[at + 1] for route in routes if at + 1 < len(route)]
    _directions(both, certified[at:], given[at:], 0.1 * size)
    _close_up(both[1], ends or [start], CLOSE * size)
    both[1].set_title("close to the end" if vector.kind == "flow" else f"close to step {at + 1}")
    return plots.svg(figure)


@rc_context(plots.STYLE)
def step(scene: Scene, state: State, truth: Collision | Horizon, given: Mapping[str, Any]) -> bytes:
    """Draw one step as SVG: where it leads, and where it was said to; the whole table, and close up."""
    figure, both = plots.new_figure(7.4, 3.7, 1, 2)
    ends = [(truth.x, truth.y), (given["x"], given["y"])]
    for axes in both:
        _draw_walls(axes, scene, state.t, truth.t)
        for (x, y), (colour, width, label) in zip(ends, STROKES, strict=True):
            style = {"color": colour, "linewidth": width, "markersize": 3 * width, "label": label}
            axes.plot([state.x, x], [state.y, y], marker=".", alpha=0.75, **style)
        axes.plot(state.x, state.y, marker="o", color=plots.BLACK, markersize=4, linestyle="none")
        axes.set(aspect="equal", xlabel="x [length]", ylabel="y [length]")
    size = float(np.ptp(np.hstack(draw.walls(scene, truth.t)), axis=1).max())
    _directions(both, [truth], [dict(given)], 0.1 * size)
    _close_up(both[1], ends, CLOSE * size)
    both[0].legend(loc="best")
    return plots.svg(figure)


def _given(result: Result) -> list[dict[str, Any]]:
    return [step for step in outcomes_of(result.answer or {}) if "x" in step and "y" in step]


def _in_question(result: Result, vector: Vector, certified: Sequence[Outcome]) -> int:
    """Return the place of the certified step to look at: of a failure the one that differs, else the last."""
    last = max(0, len(certified) - 1)
    is_wrong = result.verdict != "pass" and vector.kind != "flow"
    return min(result.step, last) if is_wrong else last


def _draw_walls(axes: Any, scene: Scene, begin: float, end: float) -> None:
    for line in draw.walls(scene, begin):
        axes.plot(*line, color=plots.GREY, linewidth=1)
    for line in draw.walls(scene, end):
        axes.plot(*line, color=plots.BLACK, linewidth=1, linestyle=":")


def _directions(both: Any, certified: Sequence[Any], given: Sequence[Any], length: float) -> None:
    """Draw where the particle goes on, dashed."""
    truth = [{name: getattr(o, name) for name in ("x", "y", "vx", "vy")} for o in certified]
    for steps, colour, width in ((truth, plots.ORANGE, 4), (given, plots.BLUE, 1.5)):
        for step in steps:
            speed = math.hypot(step.get("vx", 0.0), step.get("vy", 0.0))
            if not 0 < speed < math.inf:
                continue
            x, y = (step[place] + length * step[v] / speed for place, v in (("x", "vx"), ("y", "vy")))
            for axes in both:
                line = [step["x"], x], [step["y"], y]
                axes.plot(*line, color=colour, linewidth=width, alpha=0.6, linestyle=(0, (1, 0.6)))


def _close_up(axes: Any, ends: Sequence[Point], least: float) -> None:
    xs, ys = zip(*ends, strict=True)
    half = max(least, 0.75 * (max(xs) - min(xs)), 0.75 * (max(ys) - min(ys)))
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
