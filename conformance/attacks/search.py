"""Run families of attacks against steppers, every answer compared with the second stepper's.

Steppers are callables that the caller gives. A proved stepper answers with a claim, whose enclosures must
meet the second stepper's; `undecided` is honest. A fast one answers a step in the wire's form, and a flow
with the walls it counted. All but these counts are compared by `conformance.grading.agreement`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

from conformance import second_stepper
from conformance.arb.numbers import rational_ends
from conformance.attacks.case import Attack, Family, line
from conformance.grading.agreement import Answer, compare
from conformance.grading.error import free_flight, inputs_of, moved
from conformance.second_proof.exclusion import Refuted
from conformance.second_proof.step import check
from conformance.second_proof.trajectory import check_path
from conformance.vectors import NUMBERS, Certified, Ends, Expectation, certified
from scene import Outcome, Rejected, Scene, State, Undecided, Undefined
from scene.states import Stepper

KINDS = ("agreed", "undecided", "refused", "open", "wrong")
BOUND = 4.0  # backward ulps: the sharpest class of grades
DIGITS = 400  # decimals that balls are written with: beyond their own precision


class Claim(NamedTuple):
    """What a proved stepper answers.

    Attributes:
        answers: one a step, collisions and horizons enclosed.
        certificate: of all of it, to be proved again; None where there is none.
    """

    answers: list[Answer]
    certificate: dict[str, Any] | None = None


Flow = Callable[[Scene, State, float], "dict[str, int] | None"]  # None: undecided


class Judgement(NamedTuple):
    """How one answer compares: agreed, undecided, refused, open (the second stepper's), or wrong."""

    kind: str
    why: str = ""
    ulps: float = 0.0


class UnderAttack(NamedTuple):
    """What is under attack; None leaves one out."""

    prover: Callable[[Attack], Claim] | None = None
    stepper: Stepper | None = None
    flow: Flow | None = None


@dataclass
class Tally:
    """What a family's attacks came to."""

    family: str
    n_cases: int = 0
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))
    worst_ulps: float = 0.0
    slowest: float = 0.0  # processor seconds a step of the proved stepper, its proof repeated
    wrong: list[str] = field(default_factory=list)

    def add(self, verdict: Judgement, where: str) -> None:
        """Count a verdict."""
        self.counts[verdict.kind] += 1
        self.worst_ulps = max(self.worst_ulps, verdict.ulps)
        if verdict.kind == "wrong":
            self.wrong.append(f"{verdict.why}: {where}")


def truths(attack: Attack) -> list[second_stepper.Answer]:
    """Return the second stepper's answers."""
    if attack.n_collisions is not None:
        return second_stepper.trajectory(attack.scene, attack.state, attack.n_collisions, attack.t_end)
    assert attack.t_end is not None
    return [second_stepper.next_collision(attack.scene, attack.state, attack.t_end)]


def run(
    families: Iterable[Family],
    n_cases: int,
    seed: int,
    steppers: UnderAttack,
    progress: Callable[[Tally], None] = lambda tally: None,
) -> list[Tally]:
    """Attack steppers with some cases of each family.

    Args:
        families: kinds of attack.
        n_cases: cases of each.
        seed: with the family's name and the index, it names a case for ever.
        steppers: under attack.
        progress: told after every case.

    Returns:
        One tally a family: every stepper asked adds one verdict a question.
    """
    tallies = []
    for family in families:
        tally = Tally(family.name)
        tallies.append(tally)
        for index in range(n_cases):
            attack = family.attack(seed, index)
            where = line(family.name, seed, index, attack)
            for verdict in judged(attack, steppers, tally):
                tally.add(verdict, where)
            tally.n_cases += 1
            progress(tally)
    return tallies


def judged(attack: Attack, steppers: UnderAttack, tally: Tally) -> Iterable[Judgement]:
    """Put one attack to each stepper and judge what it answers."""
    answers = truths(attack)
    if steppers.prover is not None:
        prover, begun = steppers.prover, time.process_time()
        verdict = _survived(lambda: proved(prover(attack), answers, attack.state))
        tally.slowest = max(tally.slowest, (time.process_time() - begun) / max(len(answers), 1))
        yield verdict
    if steppers.stepper is not None:
        t_end = attack.t_end if attack.t_end is not None else late_enough(attack.state, answers[0])
        if t_end is not None:
            outcome = partial(steppers.stepper, attack.scene, attack.state, t_end)
            yield _survived(lambda: stepped(outcome(), answers[0], attack.state))
    if steppers.flow is not None and attack.is_flow and attack.t_end is not None:
        flow, end = steppers.flow, attack.t_end
        yield _survived(lambda: flown(flow(attack.scene, attack.state, end), answers))


def _survived(judge: Callable[[], Judgement]) -> Judgement:
    """Return a verdict; whatever a stepper under attack raises is one too, and the search goes on."""
    try:
        return judge()
    except Exception as error:
        return Judgement("wrong", f"it raises {type(error).__name__}: {error}")


def proved(claim: Claim, truth: Sequence[second_stepper.Answer], state: State) -> Judgement:
    """Compare a proved stepper's path with the second stepper's, up to where either is undecided."""
    is_open = truth[-1].kind == "undecided"
    given = claim.answers[: len(truth) - 1] if is_open else claim.answers
    expected = as_certified(truth[: len(given)] if is_open else truth, state)
    # Two enclosures of one number meet: they are less than 0 backward ulps apart.
    found = compare(given, expected, state, bound=0.0)
    if found.kind == "undecided" or any(isinstance(a, Undecided) for a in claim.answers[: len(truth)]):
        return Judgement("undecided")
    if found.kind not in ("agrees", "indeterminate"):
        return Judgement("wrong", f"proved, but {found.why}")
    end = given[-1] if given else None
    if isinstance(end, Undefined) and end.reason != expected.reason:
        return Judgement("wrong", f"proved to be undefined: {end.reason}, not {expected.reason}")
    if claim.certificate is not None:
        try:
            (check_path if "steps" in claim.certificate else check)(claim.certificate)
        except Refuted as error:
            return Judgement("wrong", f"the certificate does not hold: {error}")
    if is_open:
        return Judgement("open", truth[-1].reason)
    return Judgement("refused" if isinstance(end, Rejected) else "agreed")


def late_enough(state: State, answer: second_stepper.Answer) -> float | None:
    """Return a horizon well after the first collision, for a path asked for without one."""
    if answer.kind != "collision":
        return None
    return state.t + 2 * float(answer.numbers[0].mid()) + abs(state.t) * 2.0**-50


def stepped(outcome: Outcome, truth: second_stepper.Answer, state: State) -> Judgement:
    """Judge one step in binary64: the same outcome within some backward ulps, or an honest undecided."""
    if isinstance(outcome, Undecided):
        return Judgement("undecided")
    if truth.kind == "undecided":
        return Judgement("open", truth.reason)
    if isinstance(outcome, Rejected):
        return Judgement("refused")
    found = compare(outcome, as_certified([truth], state), state, BOUND)
    if found.kind == "agrees":
        return Judgement("agreed", ulps=found.ulps)
    return Judgement("open" if found.kind == "indeterminate" else "wrong", found.why, found.ulps)


def as_certified(truth: Sequence[second_stepper.Answer], state: State) -> Expectation:
    """Return the second stepper's path, or step, as a certified answer.

    The allowances are those of the first step, and 0 for later ones: the second stepper does not know them.
    """
    steps = [
        _certified(answer, state if number == 0 else None)
        for number, answer in enumerate(truth)
        if answer.kind in ("collision", "horizon")
    ]
    return Expectation(
        truth[-1].kind if truth else "collision", tuple(steps), truth[-1].reason if truth else ""
    )


def _certified(answer: second_stepper.Answer, state: State | None) -> Certified:
    numbers = dict(zip(NUMBERS, map(ball_ends, answer.numbers), strict=True))
    allowance = [0.0] * len(NUMBERS)
    if state is not None:
        rows = [[float(entry.abs_upper()) for entry in row] for row in answer.jacobian]
        rows = rows or free_flight(state, float(answer.numbers[0].mid()))
        allowance = [moved(row, inputs_of(state)) for row in rows]
    return certified(numbers, allowance, answer.wall, digits=DIGITS)


def ball_ends(ball: Any) -> Ends:
    """Return the ends of a ball, exactly."""
    low, high = rational_ends(ball)
    return Fraction(int(low.p), int(low.q)), Fraction(int(high.p), int(high.q))


def flown(counts: dict[str, int] | None, answers: Sequence[second_stepper.Answer]) -> Judgement:
    """Compare the walls that a flow counted with those of the path."""
    if counts is None:
        return Judgement("undecided")
    if answers[-1].kind != "horizon":
        return Judgement("open", answers[-1].reason)
    truth: dict[str, int] = {}
    for answer in answers[:-1]:
        truth[str(answer.wall)] = truth.get(str(answer.wall), 0) + 1
    counted = {wall: n for wall, n in counts.items() if n}
    return (
        Judgement("agreed") if counted == truth else Judgement("wrong", f"a flow met {counted}, not {truth}")
    )
