"""The HTML report of a conformance run: one self-contained page, no scripts, figures embedded.

It shows the verdicts by group, the worst cases with the implementation's path drawn over the
certified one, the errors by precision class, and the implementation's point in the plane of speed
and error. The colours of paths have one meaning in all figures, explained once on the page
(`LEGEND`).
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpmath import fp

from conformance import vectors
from conformance.grading.agreement import FAIR, SHARP, middle
from conformance.suite import Result, Run, reports
from conformance.suite.session import outcomes_of
from mushrooms.figures import style as plots, table as draw
from mushrooms.reports.page import embed, render
from scene import BadInput, Collision, Horizon, Outcome, Scene, State, from_data
from scene.geometry import table_at

# Cases drawn: those that failed, or else the least precise that passed.
N_FAILED = 8
N_SHARPEST = 4
MAX_LISTED = 200
EXACT = 1e-2  # ulps at which answers with no error at all are drawn


def to_html(run: Run) -> str:
    """Return the page."""
    report = reports.new_report(run)
    seen = [
        verdict
        for verdict in report.total.counts
        if verdict == "pass" or report.total.counts[verdict]
    ]
    others = [r for r in run.results if r.verdict != "pass" or r.is_known]
    by_id = {vector.id: vector for vector in vectors.load(run.level)}
    cases = [_case(result, by_id[result.id]) for result in _worst(run) if result.id in by_id]
    return render(
        "check.html.jinja",
        report=report,
        seen=seen,
        further=[r for r in run.results if r.group in ("property", "profile")],
        others=others[:MAX_LISTED],
        n_unlisted=max(0, len(others) - MAX_LISTED),
        cases=cases,
        drawn={shown["result"].id for shown in cases},
        legend=LEGEND,
        errors=embed(_errors(run)) if run.ulps() else "",
        speed=embed(_speed(run)) if run.speed and run.ulps() else "",
        sharp=SHARP,
        fair=FAIR,
    )


def _worst(run: Run) -> list[Result]:
    failed = [
        r for r in run.results if r.verdict in ("fail", "indeterminate") and r.answer is not None
    ]
    if failed:
        return failed[:N_FAILED]
    passed = [r for r in run.results if r.verdict == "pass" and r.relative is not None]
    return sorted(passed, key=lambda r: math.inf if r.ulps is None else r.ulps, reverse=True)[
        :N_SHARPEST
    ]


def _case(result: Result, vector: vectors.Vector) -> dict[str, Any]:
    try:
        figure = embed(paths(result, vector))
    except BadInput:  # a vector whose scene must be refused has no table to draw
        figure = ""
    return {"result": result, "vector": vector, "figure": figure, "rows": _rows(result)}


def _rows(result: Result) -> list[tuple[str, str, str]]:
    """Return the fields of a failure: name, certified, given; its reason stands in the caption."""
    certified = result.expected or {}
    given = result.given or {}
    names = [
        name
        for name in dict.fromkeys([*certified, *given])
        if certified.get(name) != given.get(name) and name != "reason"
    ]
    return [(name, _cell(certified.get(name)), _cell(given.get(name))) for name in names]


def _cell(value: Any) -> str:
    return "–" if value is None else f"{value:.17g}" if isinstance(value, float) else str(value)


@rc_context(plots.STYLE)
def _errors(run: Run) -> bytes:
    """Draw the backward ulps of every passing answer, by group, with the bounds of the classes."""
    groups = [group for group in run.groups() if run.ulps(group)]
    figure, axes = plots.new_figure(7.2, 0.9 + 0.24 * len(groups))
    for row, group in enumerate(groups):
        ulps = np.maximum([u for u in run.ulps(group) if math.isfinite(u)], EXACT)
        axes.plot(ulps, np.full(len(ulps), row), "o", color=plots.BLUE, markersize=3.5, alpha=0.5)
    _mark_classes(axes, axes.axvline)
    axes.set(
        xscale="log",
        xlabel="backward ulps of the answers that passed",
        ylim=(len(groups) - 0.5, -0.5),
    )
    axes.set_yticks(range(len(groups)), groups)
    return plots.svg(figure)


@rc_context(plots.STYLE)
def _speed(run: Run) -> bytes:
    """Draw the implementation's point: time per collision against the error of its answers."""
    assert run.speed is not None
    ulps = np.maximum([u for u in run.ulps() if math.isfinite(u)], EXACT)
    middle = float(np.median(ulps))
    worst = float(ulps.max())
    figure, axes = plots.new_figure(4.8, 3.2)
    axes.plot([run.speed.best_ns] * 2, [middle, worst], color=plots.BLUE, linewidth=1.5)
    axes.plot(
        run.speed.best_ns, worst, marker="v", color=plots.BLUE, linestyle="none", label="worst"
    )
    axes.plot(
        run.speed.best_ns, middle, marker="o", color=plots.BLUE, linestyle="none", label="median"
    )
    _mark_classes(axes, axes.axhline)
    axes.set(
        xscale="log",
        yscale="log",
        xlim=(run.speed.best_ns / 30, run.speed.best_ns * 30),
        xlabel=f"ns per collision on {run.speed.scene}",
        ylabel="backward ulps",
    )
    axes.legend(frameon=False)
    return plots.svg(figure)


def _mark_classes(axes: Any, line: Any) -> None:
    for bound, name in ((SHARP, "A"), (FAIR, "B")):
        line(bound, color=plots.ORANGE, linewidth=1, linestyle="--", label=f"class {name} ends")


LEGEND = (
    (plots.ORANGE, "certified path"),
    (plots.BLUE, "given path"),
    (plots.GREY, "walls at the start"),
    (plots.BLACK, "walls at the certified hit"),
)
N_CHORDS = 180  # of an arc, as `Table.outline` has it
LEAST_SEEN = 1e-12  # of the table's size: two places that are closer are drawn as one
# Half the width of the close-up, of the table's size; more where the two hits lie further apart.
CLOSE = 0.06
# The certified path and the given one: colour, width and name.
STROKES = ((plots.ORANGE, 4.0, "certified"), (plots.BLUE, 1.5, "given"))
Steps = list[dict[str, Any]]  # the state after each


def paths(result: Result, vector: vectors.Vector) -> bytes:
    """Draw a case as SVG: the table at the start and at the hit, both paths, and the hit close up.

    Raises:
        BadInput: the vector's scene is one that must be refused, and has no table.
    """
    is_flow = vector.kind == "flow"  # it says where it ends, not how it came there
    scene = from_data(vector.scene)
    certified = [
        o for o in middle(vector.expect[0], vector.state) if isinstance(o, Collision | Horizon)
    ]
    given = [step for step in outcomes_of(result.answer or {}) if "x" in step and "y" in step]
    at = max(0, len(certified) - 1)
    if result.verdict != "pass" and not is_flow:
        at = min(result.step, at)  # what follows a wrong step follows from it
    t = certified[at].t if certified else vector.state.t
    steps = [_fields(outcome) for outcome in certified[: at + 1]], given[: at + 1]
    figure = _draw(scene, vector.state, t, steps, at, "none" if is_flow else "-")
    figure.axes[1].set_title("close to the end" if is_flow else f"close to step {at + 1}")
    return plots.svg(figure)


@rc_context(plots.STYLE)
def draw_step(
    scene: Scene, state: State, truth: Collision | Horizon, given: Mapping[str, Any], place: str
) -> bytes:
    """Draw one step as SVG, where it leads and where it was said to: whole table and close up.

    The close-up is as large as the distance of both places, so that this is seen. The title names
    the field that is off most. Velocities are compared with the speed, places with the table's
    size.

    Args:
        scene: of the step.
        state: where it begins.
        truth: its certified end.
        given: its end as it was given; fields may be missing.
        place: of the step, such as step 1.
    """
    size = float(np.ptp(np.hstack(draw.walls(scene, truth.t)), axis=1).max())
    certified = {**_fields(truth), "t": truth.t}
    far = math.hypot(given["x"] - truth.x, given["y"] - truth.y)
    figure = _draw(scene, state, truth.t, ([_fields(truth)], [dict(given)]), 0, "-")
    figure.axes[0].legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
    if far > LEAST_SEEN * size:
        _close_up(figure.axes[1], [_fields(truth), given], 2.0 * far)
        _bend_arcs(figure.axes[1], scene, (state.t, truth.t), truth, 8.0 * far)
    figure.axes[1].set_title("close to the end")
    figure.axes[1].locator_params(nbins=4)
    speed = math.hypot(truth.vx, truth.vy)
    scales = {"t": abs(truth.t), "x": size, "y": size, "vx": speed, "vy": speed}
    figure.suptitle(
        f"{place}: {_worst_field(certified, given, scales, getattr(truth, 'wall', None))}"
    )
    return plots.svg(figure)


def _bend_arcs(
    axes: Axes, scene: Scene, times: Sequence[float], at: Collision | Horizon, reach: float
) -> None:
    """Draw the arcs near a place by points as close as a close-up needs.

    Longer chords would miss the hit.
    """
    if at.y <= reach:
        return  # the base is near too, and drawn by the same line
    arcs = [line for line in axes.lines if np.size(line.get_xdata()) > N_CHORDS]
    for line, t in zip(arcs, times, strict=False):
        r = float(table_at(fp, scene, t).r)
        middle = math.atan2(at.y, at.x)
        angles = np.linspace(middle - reach / r, middle + reach / r, N_CHORDS)
        line.set_data(r * np.cos(angles), r * np.sin(angles))


def _worst_field(
    certified: Mapping[str, float],
    given: Mapping[str, Any],
    scales: Mapping[str, float],
    wall: str | None,
) -> str:
    """Say which field of a step is off most, by its scale; a wrong wall before any number."""
    if given.get("wall") not in (None, wall):
        return f"wall = {given['wall']}, must be {wall}"

    def error(name: str) -> float:
        return abs(float(given[name]) - certified[name]) / (scales[name] or 1.0)

    worst = max((name for name in scales if name in given), key=error)
    gap = given[worst] - certified[worst]
    return f"{worst} = {given[worst]:.10g}, must be {certified[worst]:.10g}: off by {gap:.2g}"


@rc_context(plots.STYLE)
def _draw(
    scene: Scene, state: State, t: float, both: tuple[Steps, Steps], at: int, line: str
) -> Figure:
    """Draw two paths from a state, in the table of its time and of t.

    At the right close to step `at`.
    """
    figure, panels = plots.new_figure(7.4, 3.7, 1, 2)
    size = float(np.ptp(np.hstack(draw.walls(scene, t)), axis=1).max())
    for axes in panels:
        draw.draw_walls(axes, scene, state.t, color=plots.GREY, linewidth=1)
        draw.draw_walls(axes, scene, t, color=plots.BLACK, linewidth=1, linestyle=":")
        for steps, (colour, width, name) in zip(both, STROKES, strict=True):
            x, y = ([getattr(state, place), *(step[place] for step in steps)] for place in "xy")
            axes.plot(
                x,
                y,
                color=colour,
                linewidth=width,
                marker=".",
                markersize=3 * width,
                linestyle=line,
                alpha=0.75,
                label=name,
            )
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
