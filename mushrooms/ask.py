"""`mushrooms ask`: a case's question, certified answer and rule, the verifier's word, a stepper's answer."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from rich.markup import escape

from mushrooms.check import in_one_line
from mushrooms.terminal import new_console
from scene.refusal import BadInput, check_seed

if TYPE_CHECKING:
    from conformance.suite import Result
    from conformance.suite.symmetry import Transform
    from conformance.vectors import Vector


def ask(
    case: Annotated[str, typer.Argument(metavar="ID", help="Name of the case, as check prints it.")],
    command: Annotated[
        list[str] | None,
        typer.Argument(metavar="[-- COMMAND...]", help="Ask this stepper, and grade its answer."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Ask the question exactly as the run with this seed asked it.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the vector as JSON.")] = False,
) -> int:
    """Print a question of the test suite, its proved answer and its rule.

    -- COMMAND also asks a stepper this question, and grades the answer.

    Exit code 0; 1 if the stepper does not pass; 2 on bad input.
    """
    from conformance.suite.symmetry import Transform, draw_transform

    vector = _find(case, seed)
    transform = Transform() if seed is None else draw_transform(vector, seed)
    result = _put(command, vector, transform) if command else None
    if as_json:
        print(msgspec.json.format(msgspec.json.encode(vector), indent=1).decode())
    else:
        _show(vector, transform)
    return 0 if result is None else _judge(result)


def _find(case: str, seed: int | None) -> Vector:
    from conformance import vectors
    from conformance.cases.generated import fresh_one
    from conformance.suite.run import N_FRESH

    if seed is not None:
        check_seed(seed, "--seed")
    elif case.startswith("fresh/"):
        raise BadInput(f"ID = {case!r} is of one run's questions: give the run's --seed")
    if seed is not None and case in {f"fresh/{number}" for number in range(1, max(N_FRESH.values()) + 1)}:
        return fresh_one(seed, int(case.removeprefix("fresh/")))
    known = vectors.load("stress")
    for vector in known:
        if vector.id == case:
            return vector
    raise BadInput(f"ID = {case!r}, must be a vector's, such as {known[0].id}")


def _show(vector: Vector, transform: Transform) -> None:
    from conformance import vectors
    from conformance.cases.certify import judge
    from conformance.grading.agreement import middle

    console = new_console()
    condition = f", condition {vector.condition:.3g}" if vector.condition else ""
    console.print(f"[bold]{vector.id}[/], level {vector.level}{condition}")
    console.print(f"rule       {escape(vector.rule)}")
    console.print(f"source     {escape(vector.source)}")
    if str(transform) != str(type(transform)()):
        console.print(f"asked      {transform}; certified answers below are of the question as published")
    console.print(f"question   {escape(json.dumps(vectors.request(transform.apply(vector), 0)))}")
    for i, expectation in enumerate(vector.expect):
        console.print(
            f"{'certified' if i == 0 else 'or'}  {expectation.outcome} {expectation.reason}".rstrip()
        )
        for number, outcome in enumerate(middle(expectation, vector.state), 1):
            console.print(f"  {number:>4}  {escape(in_one_line(msgspec.to_builtins(outcome)))}")
        for begin, end in expectation.stays:
            console.print(f"  captured from step {begin + 1} to step {end + 1}")
    verdict = judge(vector)
    console.print(f"verifier   {verdict.status} {escape(verdict.reason)}".rstrip())


def _put(command: list[str], vector: Vector, transform: Transform) -> Result:
    from conformance.suite import ask_vector
    from conformance.suite.process import CheckFailure
    from conformance.suite.session import Session

    with Session(command) as session:
        try:
            session.start()
            session.probe()
        except CheckFailure as failure:
            raise BadInput(f"the command does not speak protocol 1: {failure}") from None
        return ask_vector(session, vector, transform)


def _judge(result: Result) -> int:
    from conformance.suite.answers import outcomes_of

    console = new_console()
    if result.answer is not None:
        given = "\n           ".join(map(in_one_line, outcomes_of(result.answer)))
        console.print(f"given      {escape(given)}")
    console.print(f"[bold]{result.verdict}[/]: {escape(result.why)}")
    return 0 if result.is_right else 1
