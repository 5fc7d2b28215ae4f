"""Run families of attacks against steppers, every answer compared with the second stepper's.

Steppers are callables that the caller gives. A proved stepper answers with claims, whose enclosures must meet
the second stepper's; `undecided` is honest. A fast one answers a step in the wire's form, judged as grades
are (`conformance.grading.agreement`), and a flow with the walls it counted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

from flint import arb, fmpq

from conformance import second_stepper
from conformance.attacks.case import Attack, Family, line
from conformance.grading.agreement import Truth, compare
from conformance.second_proof.exclusion import Refuted
from conformance.second_proof.step import check
from conformance.second_proof.trajectory import check_path
from conformance.second_stepper import Answer
from scene import Collision, Horizon, Outcome, Rejected, Scene, State, Undecided, Undefined

KINDS = ("agreed", "undecided", "refused", "open", "wrong")
BOUND = 4.0  # backward ulps: the sharpest class of grades


class Claim(NamedTuple):
    """One step as a proved stepper answers it; the same fields as `second_stepper.Answer`.

    `numbers` are pairs (low, high) that enclose dt, x, y, vx, vy; a `certificate` is proved again. That of a
    path is given with its first step.
    """

    kind: str
    wall: str | None = None
    reason: str = ""
    numbers: Sequence[tuple[Fraction, Fraction]] = ()
    certificate: dict[str, Any] | None = None


Prover = Callable[[Attack], Sequence[Claim]]
Stepper = Callable[[Scene, State, float], Outcome]
Flow = Callable[[Scene, State, float], "dict[str, int] | None"]  # None: undecided


class Verdict(NamedTuple):
    """How one answer compares: agreed, undecided, refused, open (the second stepper's), or wrong."""

    kind: str
    why: str = ""
    ulps: float = 0.0


class Steppers(NamedTuple):
    """What is under attack; None leaves one out."""

    prover: Prover | None = None
    stepper: Stepper | None = None
    flow: Flow | None = None


@dataclass
class Tally:
    """What a family's attacks came to."""

    family: str
    n_cases: int = 0
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))
    worst_ulps: float = 0.0
    slowest: float = 0.0  # seconds a step of the proved stepper, its proof repeated
    wrong: list[str] = field(default_factory=list)

    def add(self, verdict: Verdict, where: str) -> None:
        """Count a verdict."""
        self.counts[verdict.kind] += 1
        self.worst_ulps = max(self.worst_ulps, verdict.ulps)
        if verdict.kind == "wrong":
            self.wrong.append(f"{verdict.why}: {where}")


def truths(attack: Attack) -> list[Answer]:
    """Return the second stepper's answers."""
    if attack.n_collisions is not None:
        return second_stepper.trajectory(attack.scene, attack.state, attack.n_collisions, attack.t_end)
    assert attack.t_end is not None
    return [second_stepper.next_collision(attack.scene, attack.state, attack.t_end)]


def run(
    families: Iterable[Family],
    n_cases: int,
    seed: int,
    steppers: Steppers,
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


def judged(attack: Attack, steppers: Steppers, tally: Tally) -> Iterable[Verdict]:
    """Put one attack to each stepper and judge what it answers."""
    answers = truths(attack)
    if steppers.prover is not None:
        prover, begun = steppers.prover, time.perf_counter()
        verdict = _survived(lambda: proved(prover(attack), answers))
        tally.slowest = max(tally.slowest, (time.perf_counter() - begun) / max(len(answers), 1))
        yield verdict
    if steppers.stepper is not None:
        t_end = attack.t_end if attack.t_end is not None else late_enough(attack.state, answers[0])
        if t_end is not None:
            yield _survived(partial(_step_verdict, steppers.stepper, attack, t_end, answers[0]))
    if steppers.flow is not None and attack.is_flow and attack.t_end is not None:
        flow, end = steppers.flow, attack.t_end
        yield _survived(lambda: flown(flow(attack.scene, attack.state, end), answers))


def _step_verdict(stepper: Stepper, attack: Attack, t_end: float, answer: Answer) -> Verdict:
    return stepped(stepper(attack.scene, attack.state, t_end), answer, attack.state, t_end)


def _survived(judge: Callable[[], Verdict]) -> Verdict:
    """Return a verdict; whatever a stepper under attack raises is one too, and the search goes on."""
    try:
        return judge()
    except Exception as error:
        return Verdict("wrong", f"it raises {type(error).__name__}: {error}")


def proved(claims: Sequence[Claim], answers: Sequence[Answer]) -> Verdict:
    """Compare a proved stepper's path with the second stepper's, up to where either is undecided."""
    for number, (claim, answer) in enumerate(zip(claims, answers, strict=False), 1):
        if claim.kind == "undecided":
            return Verdict("undecided")
        if answer.kind == "undecided":
            return Verdict("open", answer.reason)
        if (claim.kind, claim.wall) != (answer.kind, answer.wall):
            met = (
                f"{claim.kind} {claim.wall or claim.reason}, not {answer.kind} {answer.wall or answer.reason}"
            )
            return Verdict("wrong", f"step {number} is proved to be {met}")
        if claim.kind == "undefined" and claim.reason != answer.reason:
            return Verdict("wrong", f"step {number} is undefined: {claim.reason}, not {answer.reason}")
        for name, ends, ball in zip(
            ("dt", "x", "y", "vx", "vy"), claim.numbers, answer.numbers, strict=False
        ):
            if not meets(ends, ball):
                return Verdict("wrong", f"the enclosure of {name} after step {number} misses the truth")
        if claim.certificate is not None:
            try:
                (check_path if "steps" in claim.certificate else check)(claim.certificate)
            except Refuted as error:
                return Verdict("wrong", f"the certificate of step {number} on does not hold: {error}")
        if claim.kind == "rejected":
            return Verdict("refused")
    if len(claims) > len(answers):
        return Verdict("wrong", f"{len(claims)} steps are proved of a path that ends after {len(answers)}")
    return Verdict("agreed")


def meets(ends: tuple[Fraction, Fraction], ball: Any) -> bool:
    """Tell whether a ball holds a number of [low, high]; a ball exceeds its number by rounding only."""
    low, high = (arb(fmpq(end.numerator, end.denominator)) for end in ends)
    return bool(ball.overlaps(low.union(high)))


def late_enough(state: State, answer: Answer) -> float | None:
    """Return a horizon well after the first collision, for a path asked for without one."""
    if answer.kind != "collision":
        return None
    return state.t + 2 * float(answer.numbers[0].mid()) + abs(state.t) * 2.0**-50


def stepped(outcome: Outcome, answer: Answer, state: State, t_end: float) -> Verdict:
    """Judge one step in binary64: the same outcome within some backward ulps, or an honest undecided."""
    if isinstance(outcome, Undecided):
        return Verdict("undecided")
    if answer.kind == "undecided":
        return Verdict("open", answer.reason)
    if isinstance(outcome, Rejected):
        return Verdict("refused")
    if isinstance(outcome, Undefined) and answer.kind == "undefined":
        return Verdict("agreed")
    truth = as_truth(answer, t_end)
    found = compare(outcome, truth, state, BOUND)
    if found.kind == "agrees":
        return Verdict("agreed", ulps=found.ulps)
    met = f"{type(outcome).__name__.lower()} {getattr(outcome, 'wall', '')}"
    why = {
        "numbers": f"numbers are off by {found.ulps:.3g} backward ulps",
        "wall": f"{met}, not {answer.wall}",
    }.get(found.kind, f"{met}, not {answer.kind} {answer.wall or answer.reason}")
    return Verdict("wrong", why, found.ulps)


def as_truth(answer: Answer, t_end: float) -> Truth:
    """Return an answer as comparisons take it."""
    if answer.kind not in ("collision", "horizon"):
        plain = Rejected(answer.reason) if answer.kind == "rejected" else Undefined("corner")
        return Truth(plain)
    numbers = [_fraction(ball) for ball in answer.numbers]
    dt, x, y, vx, vy = map(float, numbers)
    if answer.kind == "horizon":
        return Truth(Horizon(t_end, x, y, vx, vy), numbers)
    assert answer.wall is not None
    rows = [[float(entry.abs_upper()) for entry in row] for row in answer.jacobian]
    return Truth(Collision(answer.wall, dt, 0.0, x, y, vx, vy), numbers, rows)


def _fraction(ball: Any) -> Fraction:
    middle = ball.mid().fmpq()
    return Fraction(int(middle.p), int(middle.q))


def flown(counts: dict[str, int] | None, answers: Sequence[Answer]) -> Verdict:
    """Compare the walls that a flow counted with those of the path."""
    if counts is None:
        return Verdict("undecided")
    if answers[-1].kind != "horizon":
        return Verdict("open", answers[-1].reason)
    truth: dict[str, int] = {}
    for answer in answers[:-1]:
        truth[str(answer.wall)] = truth.get(str(answer.wall), 0) + 1
    counted = {wall: n for wall, n in counts.items() if n}
    return Verdict("agreed") if counted == truth else Verdict("wrong", f"a flow met {counted}, not {truth}")
