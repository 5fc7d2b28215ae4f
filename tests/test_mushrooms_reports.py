"""What the pages of the benchmark, the scoreboard, a conformance run and an ensemble show, in numbers.

Figures are looked at before they become SVG.
"""

import json
import math
import re
import statistics
from pathlib import Path

import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure
from mpmath import fp
from support.artists import bars, line, said, words, xy

import conformance
import fast
import reference
import theory
from conformance import vectors
from conformance.bench import record, scoreboard
from conformance.grading.agreement import middle
from conformance.harness.examples import Example
from conformance.suite import Result, Run
from conformance.suite.result import Speed
from conformance.suite.session import Limits
from fast.batch import careful_steps, fine_steps, lane_steps
from mushrooms import bench, check
from mushrooms.audit import ensemble_command
from mushrooms.audit.claim import Check
from mushrooms.audit.ensemble_checks import GivenEnsemble
from mushrooms.audit.page import pull
from mushrooms.figures import style
from mushrooms.reports import bench_page, check_page
from mushrooms.reports.page import number
from scene import BadInput, Horizon, State, from_data, load
from scene.geometry import table_at

KEPT = record.read(Path(conformance.__file__).parent.parent / "docs" / "bench" / "bench.json")


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Return the list of figures that become SVG from now on."""
    seen: list[Figure] = []

    def note(figure: Figure) -> bytes:
        seen.append(figure)
        return b"<svg/>"

    monkeypatch.setattr(style, "svg", note)
    for module in (ensemble_command,):
        monkeypatch.setattr(module, "svg", note)
    return seen


def test_the_growth_of_errors_is_drawn_for_each_follower(figures):
    grown = KEPT.growth
    bench_page.growth(grown)
    [axes] = figures[0].axes
    count = np.arange(1, grown.collisions + 1)
    for name, errors in grown.followers.items():
        one = line(axes, name)
        x, y = xy(one)
        assert x.tolist() == count.tolist()
        kept = np.array(errors) > 0
        assert y[kept] == pytest.approx(np.array(errors)[kept])
        assert np.isnan(y[~kept]).all()  # no error has no place on a logarithmic axis
        assert (
            one.get_markevery() == grown.collisions // 16
        )  # some marks, one at each collision of a short path
    assert xy(line(axes, "one ulp a step, grown"))[1] == pytest.approx(grown.bound)
    x, y = xy(line(axes, "Lyapunov slope"))
    assert np.diff(np.log10(y)) == pytest.approx(grown.rate)
    assert (x[0], y[0]) == (1, pytest.approx(1e-32))
    assert len(x) == 2 * (grown.collisions // 3)
    assert f"{grown.rate:.2f} decimals a collision" in words(figures[0])
    assert axes.get_yscale() == "log"
    assert axes.get_ylim() == (1e-60, 10)
    [names] = said(figures[0])
    followers = " | ".join(re.sub(r"\d{2,}", "#", name) for name in grown.followers)
    assert names == (
        f" | collisions | error, relative to table and speed | {followers} | one ulp a step, grown"
        " | Lyapunov slope: # decimals a collision"
    )
    brief = {name: errors[:9] for name, errors in grown.followers.items()}
    bench_page.growth(msgspec.structs.replace(grown, collisions=9, followers=brief, bound=grown.bound[:9]))
    assert {one.get_markevery() for one in figures[1].axes[0].lines if one.get_label() in brief} == {1}


def test_the_headline_has_a_mark_for_each_solver_where_its_digits_and_time_are():
    own = msgspec.structs.replace(
        next(p for p in KEPT.points if p.workload == bench_page.HEADLINE and p.solver == "fast, a call"),
        solver="command ./one-with-a-long-name --and --options", family="command", astray=0, further=0,
        wrong=1, right=3, undecided=0,
    )  # fmt: skip
    figure = bench_page.headline(msgspec.structs.replace(KEPT, points=(*KEPT.points, own)))
    [axes] = figure.axes
    marks = {tuple(float(c[0]) for c in xy(one)) for one in axes.lines if len(xy(one)[0]) == 1}
    shown = [
        p
        for p in (*KEPT.points, own)
        if p.workload == bench_page.HEADLINE
        and (p.solver in bench_page.NAMED or p.family in ("proof", "command"))
    ]
    assert len(shown) > 8
    said = words(figure)
    for p in shown:
        ns = statistics.median(p.ns)
        digits = bench_page.digits(statistics.median(p.relative))
        assert any(x == pytest.approx(digits) and y == pytest.approx(ns) for x, y in marks)
        whiskers = [xy(one) for one in axes.lines if len(xy(one)[0]) == 2 and p.right]
        worst = bench_page.digits(max(p.relative))
        assert any(
            x.tolist() == pytest.approx([worst, digits]) and y == pytest.approx(ns) for x, y in whiskers
        )
        quarter, _, three = np.quantile(p.ns, (0.25, 0.5, 0.75))
        assert any(
            y.tolist() == pytest.approx([quarter, three]) and x == pytest.approx(digits) for x, y in whiskers
        )
        if p.solver in bench_page.NAMED:
            assert bench_page.NAMED[p.solver] in said
        if p.further and p.astray:
            assert f"{100 * p.astray / p.further:.1g} % wrong walls" in said
    assert "./one-with-a-long…,\n2e+01 % wrong walls" in said
    assert xy(next(one for one in axes.lines if one.get_linestyle() == ":"))[0] == pytest.approx(
        bench_page.BINARY64
    )
    assert (axes.get_xlim(), axes.get_ylim()) == ((0.65, KEPT.digits), (10, 1e8))
    assert axes.get_xticks().tolist() == [2**k for k in range(8)]
    workload = next(w for w in KEPT.workloads if w.name == bench_page.HEADLINE)
    assert axes.get_title() == f"One core, {workload.name}: {workload.what}"
    assert axes.get_xlabel() == "correct digits of an answer (mark: median; bar: to the worst)"
    assert axes.get_ylabel() == "ns per collision"
    other = msgspec.structs.replace(KEPT, workloads=KEPT.workloads[:1])
    assert KEPT.workloads[0].name in bench_page.headline(other).axes[0].get_title()


def test_digits_are_those_of_the_error_within_bounds():
    assert bench_page.digits(1e-7) == pytest.approx(7)
    assert bench_page.digits(0.9) == 0.5
    assert bench_page.digits(1e-310) == pytest.approx(300)
    assert bench_page.digits(0.0) == pytest.approx(15.95, abs=0.01)
    assert bench_page._digits_of(msgspec.structs.replace(KEPT.points[0], relative=())) == (0.5, 0.5)


def test_a_table_of_one_workload_has_the_numbers_of_its_points():
    name = bench_page.HEADLINE
    rows = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
        for row in bench_page.to_markdown(KEPT, name).splitlines()
    ]
    points = [p for p in KEPT.points if p.workload == name]
    assert len(rows) == 2 + len(points)
    for p, row in zip(points, rows[2:], strict=True):
        worst = max(math.inf if u is None else u for u in p.ulps) if p.ulps else None
        assert row == [
            p.solver, f"{statistics.median(p.ns):,.0f}", "–" if worst is None else f"{worst:.2g}",
            f"{max(p.relative):.0e}" if p.relative else "–", f"{p.wrong} of {KEPT.questions}",
            f"{p.astray:,} of {p.further:,} ({100 * p.astray / p.further:.2g} %)" if p.further else "–",
        ]  # fmt: skip
    odd = msgspec.structs.replace(points[0], solver="a | b")
    assert "| a \\| b |" in bench_page.to_markdown(msgspec.structs.replace(KEPT, points=(odd,)), name)
    with pytest.raises(BadInput, match="workload = 'none', must be all or one of"):
        bench_page.to_markdown(KEPT, "none")


def test_the_table_of_workloads_sets_the_lanes_beside_the_lean_one():
    def a_point(workload, solver, ns):
        return msgspec.structs.replace(KEPT.points[0], workload=workload, solver=solver, ns=(ns,))

    places = [w.name for w in KEPT.workloads]
    points = (
        a_point(bench_page.HEADLINE, "fast, lanes", 100.0), a_point(bench_page.HEADLINE, "lean C", 250.0),
        a_point(places[0], "fast, lanes", 50.0),
    )  # fmt: skip
    text = bench_page.to_markdown(msgspec.structs.replace(KEPT, points=points), "all")
    assert f"| {bench_page.HEADLINE} | 100 | 1 | 2.5 |" in text
    assert f"| {places[0]} | 50 | 0.5 | – |" in text
    assert len(text.splitlines()) == 4
    alone = bench_page.to_markdown(msgspec.structs.replace(KEPT, points=points[2:]), "all")
    assert f"| {places[0]} | 50 | – | – |" in alone


def test_the_page_of_the_benchmark_has_a_row_for_each_point(figures):
    some = KEPT.points[:1] + KEPT.points[-1:]
    page = bench_page.to_html(msgspec.structs.replace(KEPT, points=some), b"<svg/>")
    for p in some:
        first, middle_, third = np.quantile(p.ns, (0.25, 0.5, 0.75))
        form = ",.0f" if middle_ >= 100 else ".1f"
        assert f"{middle_:{form}}" in page
        assert (
            f"{first:{',.0f' if first >= 100 else '.1f'}} to {third:{',.0f' if third >= 100 else '.1f'}}"
            in page
        )
        assert p.solver in page
    assert len(figures) == 1
    assert bench_page.short_name("command " + 17 * "x") == 17 * "x"
    assert bench_page.short_name("command " + 18 * "x") == 17 * "x" + "…"


def a_result(name: str, verdict: str, why: str = "", **more) -> Result:
    return Result(name, name.partition("/")[0], verdict, why, level="core", **more)


def a_run(*results: Result, **more) -> Run:
    graded = {"tables": ["cap"], "laws": [], "profiles": ["step"], "not_graded": ["stem"]}
    usual = {
        "command": ["it"], "level": "core", "seed": 1, "corpus": "9.9", "digest": "", "limits": Limits(),
        "introduction": None, "results": list(results), "speed": None, "n_restarts": 0, "stderr": "",
        "seconds": 41.6, "graded": graded, "diagnosis": [],
    }  # fmt: skip
    return Run(**usual | more)


GOOD = [a_result(f"cap/{k}", "pass", ulps=ulps, relative=1e-16) for k, ulps in enumerate((0.5, 3.0, 900.0))]
BAD = [
    a_result("cap/7", "fail", "x is off by 3"), a_result("stem/1", "fail", "an earlier hit was missed"),
    a_result("stem/2", "fail", "y is off by 9"), a_result("arc/1", "crashed", "gone"),
    a_result("far/1", "timed-out", "slow"), a_result("far/2", "declined", "undecided"),
    a_result("mouth/1", "fail", "captured: true, must be false"), a_result("far/3", "unsupported", "flow"),
]  # fmt: skip


@pytest.mark.parametrize("n_left", [-1, 0, 1, 3])
def test_the_page_of_a_check_lists_the_first_cases_and_counts_the_rest(monkeypatch, n_left):
    """What is not listed is in the JSON report, which the page says."""
    n_listed = len(BAD) - n_left
    monkeypatch.setattr(check_page, "MAX_LISTED", n_listed)
    text = re.sub(r"<[^>]+>", "", check_page.to_html(a_run(*GOOD, *BAD)))
    rest = re.findall(r"and (-?\d+) more, in the JSON report", text)
    assert rest == ([str(n_left)] if n_left > 0 else [])
    assert BAD[0].id in text
    assert (BAD[-1].id in text) == (n_left <= 0)


def cells(row: str) -> list[str]:
    return [re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<t[hd].*?</t[hd]>", row, re.S)]


def test_the_page_of_a_check_counts_verdicts_by_group(figures):
    """A verdict that nothing has gets no column, but for pass; a known failure is listed with its mark."""
    known = [
        a_result("arc/2", "fail", "as it is", is_known=True),
        a_result("arc/3", "pass", "after all", is_known=True),
    ]
    further = [a_result("property/turn", "pass", "turned"), a_result("profile/time", "fail", "slow")]
    beyond = a_result("stem/9", "pass", relative=1.0)
    for results, seen in (
        ([*GOOD, *BAD, *known, *further, beyond],
         ["pass", "fail", "declined", "unsupported", "crashed", "timed-out"]),
        ([a_result("cap/1", "timed-out", "slow")], ["pass", "timed-out"]),
    ):  # fmt: skip
        run = a_run(*results)
        page = check_page.to_html(run)
        table = page.partition("<h2>Verdicts by group</h2>")[2].partition("</table>")[0]
        head, *rows = [found for found in map(cells, table.split("</tr>")) if found]
        assert head == ["Group", "Cases", *seen, "Worst ulps", "A/B/C", "Class"]
        groups = list(dict.fromkeys(one.group for one in results))
        assert [row[0] for row in rows] == [*groups, "all"]
        for row in rows:
            own = [one for one in results if row[0] in (one.group, "all")]
            counts = [sum(one.verdict == verdict for one in own) for verdict in seen]
            assert row[1 : 2 + len(seen)] == [str(n) for n in (len(own), *counts)]
        listed = page.partition("<h2>All that did not pass</h2>")[2].partition("</table>")[0]
        rows = [found for found in map(cells, listed.split("</tr>")) if found][1:]
        assert rows == [
            [one.id, one.verdict + (" (known)" if one.is_known else ""), one.why]
            for one in results
            if one.verdict != "pass" or one.is_known
        ]
        listed = page.partition("<h2>Properties and profiles</h2>")[2].partition("</table>")[0]
        rows = [found for found in map(cells, listed.split("</tr>")) if found][1:]
        assert rows == [[one.id, one.verdict, one.why] for one in results if one in further]
    every = cells(check_page.to_html(a_run(*GOOD, beyond)).partition("<h2>Verdicts")[2].partition("total")[2])
    assert every[:6] == ["all", "4", "4", "inf", "2/1/1", "C"]
    assert (
        cells(check_page.to_html(a_run(*GOOD)).partition("<h2>Verdicts")[2].partition("total")[2])[3] == "900"
    )


def test_the_scoreboard_has_a_row_and_the_reasons_of_each_stepper():
    good, bad = a_run(*GOOD), a_run(*GOOD, *BAD, diagnosis=["Like a mutant: stale."], seconds=600.4)
    graded = [
        scoreboard.Graded("one", good),
        scoreboard.Graded("two", bad),
        scoreboard.Graded("three", None, "no C"),
    ]
    text = scoreboard.page(graded, "9.9")
    assert "level core of corpus 9.9, with seed 1" in text
    a, b, c = good.classes().values()
    assert f"| one | accepted | 3 | 0 | 0 | {a}/{b}/{c} | 42 |" in text
    assert f"| two | not accepted | 3 | 4 | 4 | {a}/{b}/{c} | 600 |" in text
    assert "| three | not run | | | | | |" in text
    assert f"- **one**: {good.scope()}.\n- **two**" in text  # nothing fails
    assert "- **three**: not run here: no C.\n" in text
    groups, kinds, mutant = scoreboard.reasons(bad)
    assert groups == "fails most in stem (2), cap (1), arc (1)"
    assert kinds == (
        "failures by kind: wrong numbers (2), an earlier hit was missed (1), crashed (1), timed-out (1),"
        " wrong capture interval (1)"
    )
    assert mutant == "Like a mutant: stale"
    assert scoreboard.reasons(good) == []


def test_the_scoreboard_is_written_of_all_that_run_here(monkeypatch, tmp_path, capsys):
    asked = []

    def check(command, **options):
        asked.append((command, options["seed"], options["limits"]))
        return a_run(*GOOD)

    examples = {"here": Example(("run", "it")), "not here": Example(why_not="no compiler")}
    monkeypatch.setattr(scoreboard, "find_steppers", lambda _: examples)
    monkeypatch.setattr(scoreboard.suite, "check", check)
    monkeypatch.setattr(scoreboard, "PAGE", tmp_path / "page.md")
    scoreboard.main()
    assert asked == [(("run", "it"), scoreboard.SEED, scoreboard.LIMITS)]
    text = (tmp_path / "page.md").read_text("utf-8")
    assert "| here | accepted | 3 |" in text
    assert "not run here: no compiler." in text
    assert capsys.readouterr().err == "here: accepted\nnot here: no compiler\n"


def test_errors_and_speed_of_a_run_are_drawn(figures):
    run = a_run(*GOOD, *BAD, speed=Speed("moving-cap", 10, 3, 250.0, 300.0))
    check_page._errors(run)
    check_page._speed(run)
    errors, speed = (figure.axes[0] for figure in figures)
    dots = [one for one in errors.lines if one.get_linestyle() == "None"]
    assert [xy(one)[0].tolist() for one in dots] == [[0.5, 3.0, 900.0]]
    assert [text.get_text() for text in errors.get_yticklabels()] == ["cap"]
    ends = {float(xy(one)[0][0]) for one in errors.lines if one.get_linestyle() == "--"}
    assert ends == {check_page.SHARP, check_page.FAIR}
    for label, ulps in (("median", 3.0), ("worst", 900.0)):
        assert [float(c[0]) for c in xy(line(speed, label))] == [250.0, ulps]
    assert speed.get_xlim()[0] < 250.0 < speed.get_xlim()[1]
    levels = {float(xy(one)[1][0]) for one in speed.lines if one.get_linestyle() == "--"}
    assert levels == {check_page.SHARP, check_page.FAIR}
    assert speed.get_xlim() == pytest.approx((250.0 / 30, 250.0 * 30))
    assert errors.get_ylim() == (0.5, -0.5)
    assert said(figures[0]) == [" | backward ulps of the answers that passed | "]
    entries = "worst | median | class A ends | class B ends"
    assert said(figures[1]) == [f" | ns per collision on moving-cap | backward ulps | {entries}"]


def a_vector(kind: str) -> vectors.Vector:
    return next(
        v for v in vectors.load("core")
        if v.kind == kind and v.group.startswith("moving-cap") and v.expect[0].outcome == "collision"
    )  # fmt: skip


def path_of(axes, label: str) -> np.ndarray:
    """Return the points of a path, (n, 2)."""
    return np.column_stack(xy(line(axes, label)))


@pytest.mark.parametrize("verdict", ["pass", "fail"])
def test_a_case_shows_the_given_path_over_the_certified_one_up_to_the_wrong_step(figures, verdict):
    vector = a_vector("trajectory")
    certified = middle(vector.expect[0], vector.state)
    steps = [msgspec.to_builtins(one) for one in certified]
    steps[2] = {**steps[2], "x": steps[2]["x"] + 0.25}
    result = a_result(vector.id, verdict, answer={"steps": steps}, step=2)
    check_page.paths(result, vector)
    whole, close = figures[0].axes
    n = 4 if verdict == "fail" else 1 + len(certified)
    start = [vector.state.x, vector.state.y]
    for axes in (whole, close):
        assert path_of(axes, "certified").tolist() == [start, *([one.x, one.y] for one in certified[: n - 1])]
        assert path_of(axes, "given").tolist() == [start, *([one["x"], one["y"]] for one in steps[: n - 1])]
    at = 2 if verdict == "fail" else len(certified) - 1
    assert close.get_title() == f"close to step {at + 1}"
    for place in ((certified[at].x, certified[at].y), (steps[at]["x"], steps[at]["y"])):
        assert close.get_xlim()[0] < place[0] < close.get_xlim()[1]
        assert close.get_ylim()[0] < place[1] < close.get_ylim()[1]
    assert np.ptp(close.get_xlim()) < np.ptp(whole.get_xlim())
    scene = from_data(vector.scene)
    for t, colour in ((vector.state.t, style.GREY), (certified[at].t, style.BLACK)):
        walls = [
            np.array(xy(one)) for one in whole.lines if one.get_color() == colour and len(xy(one)[0]) > 1
        ]
        wanted = [np.transpose(part) for part in table_at(fp, scene, t).outline()]
        assert all(any(p.shape == w.shape and np.allclose(p, w) for p in walls) for w in wanted)


def test_a_flow_shows_where_it_ends(figures):
    vector = next(v for v in vectors.load("core") if v.kind == "flow" and v.group == "flow")
    end = next(one for one in middle(vector.expect[0], vector.state) if isinstance(one, Horizon))
    given = {**msgspec.to_builtins(end), "y": end.y + 0.1}
    check_page.paths(a_result(vector.id, "fail", answer={"states": [given]}), vector)
    whole, close = figures[0].axes
    assert path_of(whole, "certified")[-1].tolist() == [end.x, end.y]
    assert path_of(whole, "given").tolist() == [[vector.state.x, vector.state.y], [given["x"], given["y"]]]
    assert line(whole, "given").get_linestyle() == "None"
    assert close.get_title() == "close to the end"


def test_a_step_is_drawn_from_its_start_to_both_ends_with_its_direction(figures):
    state, truth = State(0.0, 0.1, 0.2, 3.0, 4.0), Horizon(1.0, 0.5, 0.6, 1.0, -1.0)
    given = {"x": 0.5, "y": 0.62, "vx": 1.0, "vy": 1.0}
    check_page.draw_step(load("moving-cap"), state, truth, given, "step 1")
    whole, close = figures[0].axes[:2]
    for axes in (whole, close):
        assert path_of(axes, "certified").tolist() == [[0.1, 0.2], [0.5, 0.6]]
        assert path_of(axes, "given").tolist() == [[0.1, 0.2], [0.5, 0.62]]
    directions = [
        np.column_stack(xy(one)) for one in whole.lines if not isinstance(one.get_linestyle(), tuple)
    ]
    ahead = [d[1] - d[0] for d in directions if len(d) == 2 and d[0].tolist() in ([0.5, 0.6], [0.5, 0.62])]
    assert sorted(np.sign(one).tolist() for one in ahead) == [[1.0, -1.0], [1.0, 1.0]]
    assert said(figures[0]) == [
        " | x [length] | y [length] | certified | given", "close to the end | x [length] | y [length]",
    ]  # fmt: skip


FALSE_STEPS = [  # of a step to x = 0.5, y = 0.6, vx = 1, vy = -1 at t = 1: what is given, and what is said
    ({"x": 0.5, "y": 0.61}, "y = 0.61, must be 0.6: off by 0.01"),
    ({"x": 0.48, "y": 0.61}, "x = 0.48, must be 0.5: off by -0.02"),
    ({"x": 0.49, "y": 0.6, "vx": 1.02}, "vx = 1.02, must be 1: off by 0.02"),  # of sqrt 2
    ({"x": 0.49, "y": 0.6, "vx": 1.004}, "x = 0.49, must be 0.5: off by -0.01"),
    ({"x": 0.49, "y": 0.6, "vy": -1.1}, "vy = -1.1, must be -1: off by -0.1"),
    ({"t": 1.125, "x": 0.49, "y": 0.6}, "t = 1.125, must be 1: off by 0.12"),
    ({"x": 0.49, "y": 0.6, "wall": None}, "x = 0.49, must be 0.5: off by -0.01"),
    ({"x": 0.49, "y": 0.6, "wall": "arc"}, "wall = arc, must be None"),
]


@pytest.mark.parametrize(("given", "said"), FALSE_STEPS, ids=range(len(FALSE_STEPS)))
def test_the_title_of_a_false_step_names_what_is_off_most(figures, given, said):
    """Times are measured by the time of the step, places by the table's size, velocities by the speed."""
    state, truth = State(0.0, 0.1, 0.2, 3.0, 4.0), Horizon(1.0, 0.5, 0.6, 1.0, -1.0)
    check_page.draw_step(load("moving-cap"), state, truth, given, "step 7")
    assert figures[0].get_suptitle() == f"step 7: {said}"


def test_at_time_0_and_at_rest_an_error_is_its_own_measure(figures):
    state, truth = State(-1.0, 0.1, 0.2, 0.0, 0.0), Horizon(0.0, 0.1, 0.2, 0.0, 0.0)
    for given, title in (
        ({"t": 0.1, "x": 0.11, "y": 0.2}, "t = 0.1, must be 0: off by 0.1"),
        ({"x": 0.11, "y": 0.2, "vy": 0.2}, "vy = 0.2, must be 0: off by 0.2"),
    ):
        check_page.draw_step(load("moving-cap"), state, truth, given, "step 1")
        assert figures[-1].get_suptitle() == f"step 1: {title}"


def test_a_page_lists_failures_first_and_else_the_least_precise(monkeypatch):
    failed = [a_result(f"cap/{k}", "fail", answer={}) for k in range(10)]
    assert check_page._worst(a_run(*GOOD, *failed)) == failed[:8]
    silent = a_result("cap/11", "crashed")
    assert [r.ulps for r in check_page._worst(a_run(*GOOD, silent))] == [900.0, 3.0, 0.5]
    beyond = a_result("cap/12", "pass", relative=1.0)
    assert check_page._worst(a_run(*GOOD, beyond))[0] is beyond
    rows = check_page._rows(
        a_result(
            "a/1",
            "fail",
            expected={"wall": "arc", "x": 1.0, "y": 2.0},
            given={"x": 1.5, "y": 2.0, "reason": "no"},
        )
    )
    assert rows == [("wall", "arc", "–"), ("x", "1", "1.5")]


def test_times_of_capture_of_an_ensemble_stand_under_theory(figures):
    found = theory.at_energy(load("moving-cap"), 1e6)
    t_in = np.linspace(1.0, 3.0, 200)
    given = GivenEnsemble(load("moving-cap"), 1e6, np.zeros(201), t_in=np.append(t_in, np.nan))
    assert ensemble_command.capture_times(given)
    [axes] = figures[0].axes
    shown, law = bars(axes, "ensemble"), bars(axes, "theory")
    assert shown.heights == pytest.approx(np.histogram(t_in, shown.edges, density=True)[0])
    assert (shown.edges[0], shown.edges[-1]) == (1.0, 3.0)
    assert said(figures[0]) == [" | time of capture | density | ensemble | theory"]
    assert axes.get_ylim()[0] == 0
    assert law.area == pytest.approx(float(np.ptp(found.capture_cdf(np.array([1.0, 3.0])))))
    for nothing in (None, np.full(9, np.nan), np.full(9, 2.0)):
        assert ensemble_command.capture_times(given._replace(t_in=nothing)) is None


def test_our_solvers_answer_as_one_step_does():
    """Each way of taking steps, asked from the same states, comes to the same walls and times."""
    scene = load("moving-cap")
    states = [
        State(0.2, 0.1, 0.3, 30.0, 5.0),
        State(0.2, -0.2, -0.3, -20.0, -9.0),
        State(0.1, 0.0, 0.5, 2.0, 31.0),
    ]
    one_by_one = [fast.next_collision(scene, state, 100.0) for state in states]
    after = [one.state() for one in one_by_one]
    second = [fast.next_collision(scene, state, 100.0) for state in after]
    assert careful_steps(scene, states, 2)[0] == one_by_one
    fine, seconds = fine_steps(scene, states, 2)
    assert seconds > 0
    for path, one in zip(fine, one_by_one, strict=True):
        assert path.walls == [one.wall]
        assert path.numbers(0) == pytest.approx([one.dt, one.t, one.x, one.y, one.vx, one.vy])
    in_lanes = lane_steps(scene, after)
    assert sum(one is not None for one in in_lanes) >= 1
    for one, other in zip(in_lanes, second, strict=True):
        if one is not None:
            assert (one.wall, one.dt, one.x) == (other.wall, pytest.approx(other.dt), pytest.approx(other.x))
    assert lane_steps(scene, states) == [None] * 3  # they leave no wall
    still = State(0.0, 0.1, 0.2, 0.0, 0.0)
    [end], _ = careful_steps(load("breathing-circle"), [still])
    assert end == Horizon(math.inf, 0.1, 0.2, 0.0, 0.0)  # what never moves meets no wall


def test_followers_of_the_benchmark_go_the_same_way():
    scene, state = load("moving-cap"), State(0.2, 0.1, 0.3, 30.0, 5.0)
    proved, chain = bench.prove_path(scene, state, 3)
    assert len(proved) == len(chain) == 3
    assert max(point.width for point in proved) < 1e-18
    for name, follow in bench.our_followers().items():
        found = follow(scene, state, 3)
        assert [point.wall for point in found] == [point.wall for point in proved], name
        for mine, right in zip(found, proved, strict=True):
            assert [mine.x, mine.y, mine.vx, mine.vy] == pytest.approx(
                [float(right.x), float(right.y), float(right.vx), float(right.vy)], rel=1e-9
            )


def test_numbers_of_a_page_have_a_dash_where_there_is_none():
    assert number(None, ".2e") == "–"
    assert number(1234.5, ",.1f") == "1,234.5"
    checks = json.loads("[[1.5, 0.25, 1], [1.5, 0, 1], [null, 0.25, 1], [1.5, 0.25, 2]]")
    made = [check_of(value, error, expected) for value, error, expected in checks]
    assert [pull(one) for one in made] == [2.0, None, None, -2.0]
    assert pull(check_of(1.5, 0.25, "> 1")) is None
    assert pull(check_of(math.nan, 0.25, 1)) is None
    assert pull(check_of(1.5, math.inf, 1)) is None


def check_of(value, error, expected):
    return Check("a number", True, str(expected), value, error)


def shown_on_a_terminal(capsys, monkeypatch, run: Run) -> str:
    monkeypatch.setenv("COLUMNS", "200")
    check.show(run)
    return capsys.readouterr().out


def test_a_run_is_shown_with_its_counts_and_why_it_fails(capsys, monkeypatch):
    taught = [
        a_result(f"cap/{k}", "fail", f"x is off by {k}", expected={"outcome": "collision", "x": 1.5},
                 given={"outcome": "collision", "x": k + 0.5}, asked="mirrored", paste=f"def test_{k}(): ...")
        for k in range(7)
    ]  # fmt: skip
    sent = [a_result(f"protocol/{k}", "crashed", "gone", sent=k * "x") for k in (0, 500, 501)]
    stderr = "\n".join(["", *(f"line {k}" for k in range(9)), " "])
    speed = Speed("moving-cap", 10, 3, 250.0, 300.0)
    more = {"diagnosis": ["like a mutant: stale"], "stderr": stderr, "n_restarts": 2, "speed": speed}
    run = a_run(*GOOD, *taught, *sent, **more)
    text = shown_on_a_terminal(capsys, monkeypatch, run)
    for k in range(7):
        is_taught = k < 5
        assert (f"cap/{k}, asked mirrored; mushrooms ask cap/{k} --seed 1 prints it" in text) is is_taught
        assert (f"  given     collision x={k + 0.5}" in text) is is_taught
        assert (f"def test_{k}(): ..." in text) is is_taught
    assert "  certified collision x=1.5" in text
    assert "protocol/0, sent last" not in text  # nothing was sent
    assert f"protocol/500, sent last: {500 * 'x'}\n" in text
    assert f"protocol/501, sent last: {500 * 'x'}... (--json FILE has it whole)\n" in text
    assert "Its standard error ends:\n  line 3\n" in text
    assert "line 2\n" not in text
    assert "like a mutant: stale" in text
    assert "Speed on moving-cap: 250 ns per collision, best of 3 x 10." in text
    assert "3 of 13 cases pass, 2 restarts, 41.6 s." in text
    assert f"not accepted: {run.scope()}" in text
    assert "900" in text  # the worst ulps


def test_a_good_run_is_shown_without_objections(capsys, monkeypatch):
    known = a_result(
        "cap/9", "fail", "as it is", is_known=True, expected={"outcome": "x"}, paste="no", sent="no"
    )
    profile = a_result("profile/time", "pass", "it takes long")
    text = shown_on_a_terminal(capsys, monkeypatch, a_run(*GOOD, known, profile, stderr="noise"))
    assert "accepted: core 9.9; cap; step" in text
    assert "profile/time: it takes long." in text
    for word in ("noise", "certified", "as a test", "sent last", "and 1 more"):
        assert word not in text
    for result, is_told in (
        (a_result("cap/9", "fail", "off"), False),  # what it wrote says nothing of a wrong number
        (a_result("cap/9", "crashed", "gone"), True),
        (a_result("protocol/stop", "fail", "it goes on"), True),
    ):
        text = shown_on_a_terminal(capsys, monkeypatch, a_run(*GOOD, result, stderr="noise"))
        assert ("Its standard error ends:\n  noise" in text) is is_told
    many = [a_result(f"cap/{k}", "fail", "wrong") for k in range(23)]
    text = shown_on_a_terminal(capsys, monkeypatch, a_run(*GOOD, *many))
    assert "... and 3 more: --json FILE has them all." in text
    assert text.count(": fail: wrong") == 20


def test_the_width_of_a_proved_path_is_that_of_its_places_and_velocities():
    """Places are measured by their distance from the middle, velocities by the speed: the worse counts."""
    path = reference.trajectory(load("moving-cap"), State(0.2, 0.1, 0.3, 30.0, 5.0), 12, working=30)
    for point, step in zip(bench._places(path), path.steps, strict=True):
        _, x, y, vx, vy = step.after
        size = math.hypot(float(x.centre()), float(y.centre()))
        speed = math.hypot(float(vx.centre()), float(vy.centre()))
        units = size, size, speed, speed
        worst = max(float(c.width()) / unit for c, unit in zip(step.after[1:], units, strict=True))
        assert float(point.width) == pytest.approx(worst, rel=1e-12)
        assert (point.wall, point.x, point.vy) == (step.wall, x.centre(), vy.centre())
