"""Run families of attacks: the reference answers, the verifier and others are compared with it.

The other steppers are callables that the caller gives. One answers a step in the wire's form,
another a flow with the walls it counted. `undecided` is honest. Steps are compared by
`conformance.grading.agreement`.
"""

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import msgspec

from conformance.cases.certify import claimed_path, judge, proved_step, with_further
from conformance.cases.draw import Family, Proved, Question, file_vector
from conformance.grading.agreement import SHARP, compare
from conformance.vectors import Expectation
from scene import Outcome, Rejected, Scene, State, from_data
from scene.states import Stepper

KINDS = ("agreed", "undecided", "refused", "open", "wrong")
LISTED = ("undecided", "open", "wrong")
Flow = Callable[[Scene, State, float], "dict[str, int] | None"]  # None: undecided


class Judgement(NamedTuple):
    """How one answer compares.

    Attributes:
        kind: agreed, undecided, refused, open (the verifier does not prove what is claimed), or
            wrong.
        why: one line.
        ulps: worst backward ulps of a component, of a step in binary64.
        claim: what the reference claims, where that is proved.
        seconds: processor time a step, of the reference.
    """

    kind: str
    why: str = ""
    ulps: float = 0.0
    claim: Expectation | None = None
    seconds: float = 0.0


class UnderAttack(NamedTuple):
    """What is under attack beside the reference; None leaves one out."""

    stepper: Stepper | None = None
    flow: Flow | None = None
    is_proved: bool = True  # count the reference's answers too, and not only those that are wrong


@dataclass
class Tally:
    """What a family's attacks came to."""

    family: str
    n_cases: int = 0
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))
    worst_ulps: float = 0.0
    slowest: float = 0.0  # processor seconds a step of the reference
    cases: dict[str, list[str]] = field(default_factory=lambda: {kind: [] for kind in LISTED})

    def add(self, verdict: Judgement, where: str) -> None:
        """Count a verdict."""
        self.counts[verdict.kind] += 1
        self.worst_ulps = max(self.worst_ulps, verdict.ulps)
        self.slowest = max(self.slowest, verdict.seconds)
        if verdict.kind in LISTED:
            self.cases[verdict.kind].append(f"{verdict.why}: {where}")


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
        progress: called after every case.

    Returns:
        One tally a family: every stepper asked adds one verdict a question.
    """
    tallies = []
    for family in families:
        tally = Tally(family.name)
        tallies.append(tally)
        for index in range(n_cases):
            attack = family.question(f"{seed}/{index}")
            where = line(attack, seed, index)
            for verdict in judged(attack, steppers):
                tally.add(verdict, where)
            tally.n_cases += 1
            progress(tally)
    return tallies


def line(attack: Question, seed: int, index: int) -> str:
    """Write a question as one line of JSON.

    It has where the question comes from, and the question in the wire's form.
    """
    path = (
        {}
        if attack.collisions is None
        else {"collisions": attack.collisions, "working": attack.working}
    )
    named = {"family": attack.group, "seed": seed, "index": index, "scene": attack.wire_scene()}
    asked = {"state": msgspec.structs.asdict(attack.state), "t_end": attack.t_end}
    return json.dumps({**named, "cmd": "trajectory" if path else "step", **asked, **path})


def judged(attack: Question, steppers: UnderAttack) -> Iterable[Judgement]:
    """Put one attack to the reference and to each stepper, and judge what they answer."""
    step, flow, is_proved = steppers
    asked = from_data(attack.wire_scene()), attack.state, attack.t_end
    found = _survived(partial(confirmed, attack))
    if is_proved or found.kind == "wrong":
        yield found
    if step is not None:
        is_alone = attack.collisions is None
        alone = attack._replace(collisions=None, is_flow=False)
        claim = (found if is_alone else _survived(partial(confirmed, alone))).claim
        yield _survived(lambda: stepped(step(*asked), claim, attack.state))
    if flow is not None and attack.is_flow:
        yield _survived(lambda: flown(flow(*asked), found.claim))


def _survived(judge_answer: Callable[[], Judgement]) -> Judgement:
    """Return a verdict.

    Whatever a stepper under attack raises is one too, and the search goes on.
    """
    try:
        return judge_answer()
    except Exception as error:
        return Judgement("wrong", f"it raises {type(error).__name__}: {error}")


def confirmed(attack: Question) -> Judgement:
    """Ask the reference, and have the verifier judge its claim.

    Of an undecided path as far as that goes.
    """
    state = attack.state
    t_end = attack.t_end
    n_collisions = attack.collisions
    scene = from_data(attack.wire_scene())
    begun = time.process_time()
    if n_collisions is None:
        claim = proved_step(scene, state, t_end) or Expectation("undecided")
    else:
        claim = claimed_path(scene, state, n_collisions, t_end, attack.working)
    seconds = (time.process_time() - begun) / max(len(claim.steps), 1)
    is_undecided = claim.outcome == "undecided"
    n_steps = len(claim.steps) + (claim.outcome == "undefined")
    if is_undecided and not claim.steps:
        return Judgement("undecided", claim.reason, seconds=seconds)
    written = Expectation("collision", claim.steps) if is_undecided else claim
    proved = Proved(with_further(written, scene, state), collisions=max(n_steps, 1))
    verdict = judge(
        file_vector(attack._replace(group="attack", is_flow=False), 1, proved, "stress")
    )
    if verdict.status == "false":
        return Judgement(
            "wrong", f"the reference claims what is false: {verdict.reason}", seconds=seconds
        )
    if is_undecided:
        return Judgement("undecided", claim.reason, seconds=seconds)
    if verdict.status != "proved":
        return Judgement("open", verdict.reason, seconds=seconds)
    return Judgement(
        "refused" if claim.outcome == "rejected" else "agreed", claim=claim, seconds=seconds
    )


def stepped(outcome: Outcome, claim: Expectation | None, state: State) -> Judgement:
    """Judge one step in binary64.

    Right is the same outcome within some backward ulps, or an honest undecided.
    """
    if isinstance(outcome, Rejected) and claim is not None:
        return Judgement("refused")
    found = compare(outcome, claim, state, SHARP)
    kinds = {"pass": "agreed", "indeterminate": "open", "declined": "undecided"}
    kind = kinds.get(found.verdict, "wrong")
    return Judgement(kind, found.why, found.ulps)


def flown(counts: dict[str, int] | None, claim: Expectation | None) -> Judgement:
    """Compare the walls that a flow counted with those of the path."""
    if counts is None:
        return Judgement("undecided", "of the flow")
    if claim is None or claim.outcome != "horizon":
        return Judgement("open", "no path to the horizon is proved")
    truth = Counter(step.wall for step in claim.steps if step.wall)
    is_right = Counter(counts) == truth
    return Judgement(
        "agreed" if is_right else "wrong", f"a flow met {counts}, must be {dict(truth)}"
    )
