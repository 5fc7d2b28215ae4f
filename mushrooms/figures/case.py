"""A case of the suite: the given path over the certified one, in the whole table and near the hit.

Colours have one meaning in all of these figures, explained once on the page (`LEGEND`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
# The certified path and the given one: colour, width and name.
STROKES = ((plots.ORANGE, 4.0, "certified"), (plots.BLUE, 1.5, "given"))
Steps = list[dict[str, Any]]  # the state after each


def paths(result: Result, vector: Vector) -> bytes:
    """Draw a case as SVG: the table at the start and at the hit, both paths, and the hit close up.

    Raises:
        BadInput: the vector's scene is one that must be refused, and has no table.
    """
    is_flow = vector.kind == "flow"  # it says where it ends, not how it came there
    scene = from_data(vector.scene)
    certified = [o for o in middle(vector.expect[0], vector.state) if isinstance(o, Collision | Horizon)]
    given = [step for step in outcomes_of(result.answer or {}) if "x" in step and "y" in step]
    at = max(0, len(certified) - 1)
    if result.verdict != "pass" and not is_flow:
        at = min(result.step, at)  # what follows a wrong step follows from it
    t = certified[at].t if certified else vector.state.t
    steps = [_fields(outcome) for outcome in certified[: at + 1]], given[: at + 1]
    figure = _draw(scene, vector.state, t, steps, at, "none" if is_flow else "-")
    figure.axes[1].set_title("close to the end" if is_flow else f"close to step {at + 1}")
    return plots.svg(figure)


def step(scene: Scene, state: State, truth: Collision | Horizon, given: Mapping[str, Any]) -> bytes:
    """Draw one step as SVG: where it leads, and where it was said to; the whole table, and close up."""
    figure = _draw(scene, state, truth.t, ([_fields(truth)], [dict(given)]), 0, "-")
    figure.axes[0].legend(loc="best")
    return plots.svg(figure)


@rc_context(plots.STYLE)
def _draw(scene: Scene, state: State, t: float, both: tuple[Steps, Steps], at: int, line: str) -> Figure:
    """Draw two paths from a state, in the table of its time and of t; at the right close to step `at`."""
    figure, panels = plots.new_figure(7.4, 3.7, 1, 2)
    size = float(np.ptp(np.hstack(draw.walls(scene, t)), axis=1).max())
    for axes in panels:
        draw.draw_walls(axes, scene, state.t, color=plots.GREY, linewidth=1)
        draw.draw_walls(axes, scene, t, color=plots.BLACK, linewidth=1, linestyle=":")
        for steps, (colour, width, name) in zip(both, STROKES, strict=True):
            x, y = ([getattr(state, place), *(step[place] for step in steps)] for place in "xy")
            style = {"marker": ".", "markersize": 3 * width, "linestyle": line, "alpha": 0.75, "label": name}
            axes.plot(x, y, color=colour, linewidth=width, **style)
            for step in steps[at:]:
                _draw_direction(axes, step, 0.1 * size, color=colour, linewidth=width)
        axes.plot(state.x, state.y, marker="o", color=plots.BLACK, markersize=4, linestyle="none")
        axes.set(aspect="equal", xlabel="x [length]", ylabel="y [length]")
    ends = [steps[at] for steps in both if at < len(steps)] or [_fields(state)]
    _close_up(panels[1], ends, CLOSE * size)
    return figure


def _fields(state: Outcome | State) -> dict[str, Any]:
    return {name: getattr(state, name) for name in ("x", "y", "vx", "vy")}


def _draw_direction(axes: Axes, step: Mapping[str, Any], length: float, **style: Any) -> None:
    """Draw where the particle goes on, dashed."""
    vx, vy = step.get("vx", 0.0), step.get("vy", 0.0)
    speed = math.hypot(vx, vy)
    if 0 < speed < math.inf:
        x, y = step["x"] + length * vx / speed, step["y"] + length * vy / speed
        axes.plot([step["x"], x], [step["y"], y], alpha=0.6, linestyle=(0, (1, 0.6)), **style)


def _close_up(axes: Axes, ends: Sequence[Mapping[str, Any]], least: float) -> None:
    xs, ys = ([end[place] for end in ends] for place in "xy")
    half = max(least, 0.75 * (max(xs) - min(xs)), 0.75 * (max(ys) - min(ys)))
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
