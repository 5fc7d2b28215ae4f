"""`mushrooms ask`, `attack` and `verify`: single questions, proved answers, answers of steppers.

A question is a case of the test suite, a draw of a family of nasty questions, or a step of a
trajectory.
"""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from rich.markup import escape
from rich.table import Column, Table

import fast
import reference
from conformance import vectors, verify as verifier
from conformance.cases.attacks import UnderAttack, run
from conformance.cases.certify import judge
from conformance.cases.draw import wire_form
from conformance.cases.generated import fresh_one
from conformance.cases.table import FAMILIES
from conformance.grading.agreement import middle
from conformance.suite import Result, ask_vector
from conformance.suite.process import CheckFailure
from conformance.suite.run import N_FRESH, Transform, draw_transform
from conformance.suite.session import Session, outcomes_of
from mushrooms.check import format_outcome
from mushrooms.folders import check_file
from mushrooms.output import new_console, print_table
from mushrooms.progress import announce_compilation, progress_bar
from scene import BadInput, Horizon, Mushroom, Scene, State, Undefined, from_data
from scene.files.tables import check_digest, read_number, read_rows
from scene.files.writer import write_file
from scene.named import scene_named
from scene.refusal import shown


@dataclass(frozen=True, slots=True, kw_only=True)
class AskOptions:
    """The options of `mushrooms ask`.

    Attributes:
        case: name of the question.
        command: program and arguments of a stepper to ask.
        seed: of the run that asked the question; None for the question as published.
        as_json: print JSON.
    """

    case: str
    command: Sequence[str] | None
    seed: int | None
    as_json: bool


def ask_case(options: AskOptions) -> int:
    """Print a question with its answer and rule.

    Ask a stepper too, if one is given; return the exit code.
    """
    vector = _find(options.case, options.seed)
    transform = Transform() if options.seed is None else draw_transform(vector, options.seed)
    result = _put(options.command, vector, transform) if options.command else None
    if options.as_json:
        print(msgspec.json.format(msgspec.json.encode(vector), indent=1).decode())
    else:
        _show(vector, transform)
    if result is None:
        return 0
    if result.answer is not None:
        given = "\n           ".join(map(format_outcome, outcomes_of(result.answer)))
        print(f"given      {given}")
    new_console(soft_wrap=True).print(f"[bold]{result.verdict}[/]: {escape(result.why)}")
    return 0 if result.is_right else 1


def _find(case: str, seed: int | None) -> vectors.Vector:
    known = {vector.id: vector for vector in vectors.load("stress")}
    if case in known:
        return known[case]
    fresh = {f"fresh/{number}": number for number in range(1, max(N_FRESH.values()) + 1)}
    if case not in fresh:
        raise BadInput(f"ID = {case!r}, must be a vector's, such as {next(iter(known))}")
    if seed is None:
        raise BadInput(f"ID = {case!r} is of one run's questions: give the run's --seed")
    return fresh_one(seed, fresh[case])


def _show(vector: vectors.Vector, transform: Transform) -> None:
    console = new_console(soft_wrap=True)
    condition = f", condition {vector.condition:.3g}" if vector.condition else ""
    console.print(f"[bold]{vector.id}[/], level {vector.level}{condition}")
    console.print(f"rule       {escape(vector.rule)}")
    console.print(f"source     {escape(vector.source)}")
    if str(transform) != str(type(transform)()):
        console.print(
            f"asked      {transform}; certified answers below are of the question as published"
        )
    console.print(f"question   {escape(json.dumps(vectors.request(transform.apply(vector), 0)))}")
    for i, expectation in enumerate(vector.expect):
        head = "certified" if i == 0 else "or"
        console.print(f"{head}  {expectation.outcome} {expectation.reason}".rstrip())
        for number, outcome in enumerate(middle(expectation, vector.state), 1):
            console.print(f"  {number:>4}  {escape(format_outcome(msgspec.to_builtins(outcome)))}")
        for begin, end in expectation.stays:
            console.print(f"  captured from step {begin + 1} to step {end + 1}")
    verdict = judge(vector)
    console.print(f"verifier   {verdict.status} {escape(verdict.reason)}".rstrip())


def _put(command: Sequence[str], vector: vectors.Vector, transform: Transform) -> Result:
    with Session(command) as session:
        try:
            session.start()
            session.probe()
        except CheckFailure as failure:
            raise BadInput(f"the command does not speak protocol 1: {failure}") from None
        return ask_vector(session, vector, transform)


SLOWEST = 10.0  # seconds that one question may take the reference: its work is bounded


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackOptions:
    """The options of `mushrooms attack`.

    Attributes:
        family: name of a family of questions, or all.
        cases: of each family.
        seed: of the questions.
        stepper: reference, fast or both.
        json_file: file for the counts and the wrong cases.
    """

    family: str
    cases: int
    seed: int
    stepper: str
    json_file: Path | None


def attack_steppers(options: AttackOptions) -> int:
    """Ask steppers the questions of one family or of all; print counts, return the exit code."""
    if options.stepper not in STEPPERS:
        raise BadInput(f"--stepper = {options.stepper!r}, must be one of {', '.join(STEPPERS)}")
    family = options.family
    names = list(FAMILIES) if family == "all" else [family]
    if family != "all" and family not in FAMILIES:
        raise BadInput(f"--family = {family!r}, must be all or one of {', '.join(FAMILIES)}")
    check_file(options.json_file, (".json",))
    with announce_compilation(), progress_bar() as bar:
        task = bar.add_task("attack", total=options.cases * len(names))
        tallies = run(
            [FAMILIES[name] for name in names],
            options.cases,
            options.seed,
            STEPPERS[options.stepper],
            progress=lambda _: bar.advance(task),
        )
    _print(tallies)
    if options.json_file is not None:
        write_file(
            options.json_file, json.dumps([_row(tally) for tally in tallies], indent=1) + "\n"
        )
    return int(any(tally.cases["wrong"] or tally.slowest > SLOWEST for tally in tallies))


def count_hits(scene: Scene, state: State, t_end: float) -> dict[str, int] | None:
    """Return how often the lanes meet each wall up to t_end.

    None where a flow is undecided or refused.
    """
    try:
        carried = fast.flow(scene, [state], t_end)
    except BadInput:
        return None
    if not isinstance(carried.outcomes[0], Horizon | Undefined):
        return None
    return dict(zip(Mushroom.walls, map(int, carried.wall_counts[0]), strict=True))


STEPPERS = {
    "reference": UnderAttack(),
    "fast": UnderAttack(fast.next_collision, count_hits, is_proved=False),
    "both": UnderAttack(fast.next_collision, count_hits),
}


def _row(tally: Any) -> dict[str, Any]:
    return {
        "family": tally.family,
        "cases": tally.n_cases,
        **tally.counts,
        "worst_ulps": tally.worst_ulps,
        "slowest_s": tally.slowest,
        **{f"{kind}_cases": cases for kind, cases in tally.cases.items()},
    }


def _print(tallies: list[Any]) -> None:
    heads = ("cases", "agreed", "undecided", "refused", "open", "wrong", "worst ulps", "slowest s")
    table = Table(
        Column("family", no_wrap=True), *heads, title="Attacks: verdicts of all steppers asked"
    )
    for tally in tallies:
        counts = [str(count) for count in tally.counts.values()]
        table.add_row(
            tally.family,
            str(tally.n_cases),
            *counts,
            f"{tally.worst_ulps:.3g}",
            f"{tally.slowest:.2f}",
        )
    print_table(new_console(), table)
    for tally in tallies:
        for kind in ("open", "wrong"):
            for case in tally.cases[kind]:
                print(f"{kind}: {case}")


FIELDS = ("t", "x", "y", "vx", "vy")


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyOptions:
    """The options of `mushrooms verify`.

    Attributes:
        file: of the trajectory.
        scene: of a CSV file; None for a file that has its own.
        picture: file for a picture of the first false step.
        t_end: horizon, where the file gives none [time].
        within: largest backward error that agrees, in units of 2^-53.
        is_all: judge what follows a false step, too.
    """

    file: Path
    scene: str | None
    picture: Path | None
    t_end: float | None
    within: float
    is_all: bool


def verify_file(options: VerifyOptions) -> int:
    """Judge a trajectory, each step from the state before it, and return the exit code."""
    file = options.file
    picture = options.picture
    check_file(picture, (".svg",))
    label = f"trajectory {str(file)!r}"
    if (file.suffix == ".csv") != (options.scene is not None):
        raise BadInput(f"{label}: a CSV file needs --scene, a JSON file has its own")
    if options.within < 0 or not math.isfinite(options.within):
        raise BadInput(f"--within = {options.within}, must be a finite number >= 0")
    try:
        if options.scene is None:
            answers = verifier.read_answers(str(file), t_end=options.t_end)
        else:
            head, rows = _of_rows(file, label, options.scene)
            steps = ((f"step {number}", row) for number, row in enumerate(rows, 1))
            answers = verifier.build_answers(head, options.t_end, steps)
        report = verifier.Report(options.within)
        false = _judge(answers, report, options.is_all)
    except ValueError as error:
        raise BadInput(f"{label}: {error}") from None
    if not report.n_steps:
        raise BadInput(f"{label}: there is no step to judge")
    for line in report.lines():
        print(line)
    if picture is not None and false is not None:
        write_file(picture, _draw(answers, *false))
        print(f"Picture of {false[0]}: {picture}")
    return int(report.counts["agrees"] < report.n_steps)


def _judge(
    answers: verifier.Answers, report: verifier.Report, is_all: bool
) -> tuple[str, dict[str, Any], dict[str, Any]] | None:
    """Judge steps and print those that do not agree.

    The first false one is returned: place, start, answer.
    """
    seen = [answers.state]

    def remembered() -> Iterator[tuple[str, Any]]:
        for place, answer in answers.steps:
            seen[:] = [seen[-1], answer]
            yield place, answer

    false = None
    with progress_bar() as bar:
        task = bar.add_task("verify", total=None)
        for place, verdict in verifier.judge_path(
            answers._replace(steps=remembered()), report, is_all=is_all
        ):
            bar.advance(task)
            if verdict.status != "agrees":
                print(verifier.printable(f"{place}: {verdict.status}: {verdict.reason}"))
            if verdict.status == "false" and false is None:
                false = place, seen[0], seen[1]
    return false


def _of_rows(file: Path, label: str, scene: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return a CSV file as the verifier takes a trajectory: its scene and start, and its steps.

    Each row but the first names the wall that was hit.
    """
    of = scene_named(scene)
    check_digest(file, label)
    states: list[dict[str, Any]] = []
    for place, row in read_rows(file, label, (*FIELDS, "wall")):
        numbers = {name: read_number(place, name, row[name]) for name in FIELDS}
        if states and row["wall"] not in of.walls:
            given = shown(row["wall"]) if row["wall"] else "empty"
            raise BadInput(
                f"{place}: wall is {given}, must be the wall that was hit: {', '.join(of.walls)}"
            )
        states.append({**numbers, "wall": row["wall"] or None})
    if not states:
        raise BadInput(f"{label}: there is no row")
    return {"scene": wire_form(of), "state": states[0]}, states[1:]


def _draw(answers: verifier.Answers, place: str, begin: dict[str, Any], given: Any) -> bytes:
    """Draw a step as it was given, and as the reference has it."""
    from mushrooms.reports import check_page  # drawing takes a second to import

    scene = from_data(answers.wire_scene)
    try:
        state = msgspec.convert({name: begin.get(name) for name in (*FIELDS, "wall")}, State)
        verifier.read_answer(given)
        found = reference.next_collision(scene, state, float(answers.t_end))
    except (msgspec.ValidationError, verifier.Contradicted) as error:
        raise BadInput(f"--picture: {place} has no state to draw: {error}") from None
    if not isinstance(found, reference.Collision | reference.Horizon):
        raise BadInput(f"--picture: {place} from {shown(str(state))} has no certified end to draw")
    return check_page.draw_step(scene, state, found.rounded(), given, place)
