"""`mushrooms ask`: a case's question, certified answer and rule, the verifier's word, a stepper's answer."""

from __future__ import annotations

import json

import msgspec
from rich.markup import escape

from conformance import vectors
from conformance.cases.certify import judge
from conformance.cases.generated import fresh_one
from conformance.grading.agreement import middle
from conformance.suite import Result, ask_vector
from conformance.suite.answers import outcomes_of
from conformance.suite.process import CheckFailure
from conformance.suite.run import N_FRESH
from conformance.suite.session import Session
from conformance.suite.symmetry import Transform, draw_transform
from conformance.vectors import Vector
from mushrooms.check import format_outcome
from mushrooms.terminal import new_console
from scene.refusal import BadInput


def ask_case(case: str, command: list[str] | None, seed: int | None, as_json: bool) -> int:
    """Print a question with its answer and rule; ask a stepper too, if one is given; return the exit code."""
    vector = _find(case, seed)
    transform = Transform() if seed is None else draw_transform(vector, seed)
    result = _put(command, vector, transform) if command else None
    if as_json:
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


def _find(case: str, seed: int | None) -> Vector:
    if seed is None and case.startswith("fresh/"):
        raise BadInput(f"ID = {case!r} is of one run's questions: give the run's --seed")
    known = vectors.load("stress")
    found = {vector.id: vector for vector in known}
    if seed is not None and case in {f"fresh/{number}" for number in range(1, max(N_FRESH.values()) + 1)}:
        return fresh_one(seed, int(case.removeprefix("fresh/")))
    if case in found:
        return found[case]
    raise BadInput(f"ID = {case!r}, must be a vector's, such as {known[0].id}")


def _show(vector: Vector, transform: Transform) -> None:
    console = new_console(soft_wrap=True)
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
            console.print(f"  {number:>4}  {escape(format_outcome(msgspec.to_builtins(outcome)))}")
        for begin, end in expectation.stays:
            console.print(f"  captured from step {begin + 1} to step {end + 1}")
    verdict = judge(vector)
    console.print(f"verifier   {verdict.status} {escape(verdict.reason)}".rstrip())


def _put(command: list[str], vector: Vector, transform: Transform) -> Result:
    with Session(command) as session:
        try:
            session.start()
            session.probe()
        except CheckFailure as failure:
            raise BadInput(f"the command does not speak protocol 1: {failure}") from None
        return ask_vector(session, vector, transform)
