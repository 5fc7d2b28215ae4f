"""The one form of a check, and an implementation as a check sees it: by one profile.

A check draws questions and judges the answers. It is asked of every profile that it lists and that the
implementation offers. The implementation may be a process or Python functions: both answer lines of protocol
1 through `conformance.suite.session.Session`.
"""

import hashlib
import math
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

from conformance.cases.draw import Draw
from conformance.suite.process import NOT_NUMBERS, CheckFailure
from conformance.suite.result import MAX_DECLINED_OF_PART, Result, declines_too_much
from conformance.suite.session import MAX_SEQ, Session, missing, outcomes_of, read_outcome
from conformance.vectors import question, wire_data
from scene import Collision, Outcome, Scene, State, to_data
from scene.protocol.messages import Introduction

QUESTIONS = ("step", "trajectory", "flow")  # the profiles that answer by outcomes
FOREVER = sys.float_info.max  # t_end of a question that only collisions end
MAX_DRAWN = 6  # times that questions are drawn for an implementation of a part of the tables or laws
# An answer of many hits is asked for if it is expected within this part of the time limit, by the pace of the
# answers before: a machine under load may be four times as slow. A short answer is always asked for.
PROMPT, SHORT = 0.25, 2**8
LEAST_TIMED = 2**6  # hits from which an answer tells the pace: start and compilation do not matter then
SEQ = MAX_SEQ // 2  # of a line that is written by hand
Question = tuple[Any, ...]  # a scene that is asked about, or its data, and what else `judges` takes


class SuiteCheck(NamedTuple):
    """What is asked, and how it is judged.

    Attributes:
        name: group and name, as results show it.
        asks: (draw, profile) -> questions; each begins with a scene.
        judges: (implementation, *question) -> whether anything was compared, or what was found. It raises
            AssertionError in one line where the answer is wrong, and `CheckFailure` where there is none.
        profiles: of which it is asked.
    """

    name: str
    asks: Callable[[Draw, str], Iterable[Question]]
    judges: Callable[..., object]
    profiles: tuple[str, ...] = QUESTIONS


class AnswerTally:
    """The different answers that a check asked for, and those left undecided where `undecided` does not pass.

    Equal questions count once, so that a run counts what a file of questions counts. A path has an answer for
    each of its steps, a flow one for each different state. Each command is counted for itself: what is asked
    as steps does not speak for paths.
    """

    def __init__(self) -> None:
        self._counted = defaultdict[str, dict[bytes, tuple[int, int]]](dict)

    def counts(self) -> tuple[int, int]:
        """Return how many answers are undecided, and how many there are.

        They are those of the first command of which too many are undecided, or else those of all commands.
        """
        found = [
            (sum(n_undecided for n_undecided, _ in counted.values()), sum(n for _, n in counted.values()))
            for counted in self._counted.values()
        ]
        for n_undecided, n in found:
            if declines_too_much(n_undecided, n, MAX_DECLINED_OF_PART):
                return n_undecided, n
        return sum(n_undecided for n_undecided, _ in found), sum(n for _, n in found)

    def add(self, request: Mapping[str, Any], outcomes: Sequence[str]) -> None:
        """Count what answers a request: its outcomes, in order."""
        keys, counted = _keys_of(request), self._counted[str(request.get("cmd"))]
        if len(keys) == len(outcomes):
            for key, outcome in zip(keys, outcomes, strict=True):
                counted[key] = (int(outcome == "undecided"), 1)
        else:
            n_undecided = sum(outcome == "undecided" for outcome in outcomes)
            counted[b"".join(keys)] = (n_undecided, len(outcomes))

    def excuse(self, request: Mapping[str, Any]) -> None:
        """Take back what was counted of a request: `undecided` passes there, as nothing else is right."""
        for key in _keys_of(request):
            self._counted[str(request.get("cmd"))].pop(key, None)


def _keys_of(request: Mapping[str, Any]) -> list[bytes]:
    """Return a key for each state of a flow, one for any other request; equal for equal questions."""
    states = request.get("states")
    whole = digest_of({name: part for name, part in request.items() if name not in ("seq", "states")})
    if not isinstance(states, list | tuple):
        return [whole + digest_of(states)]
    return [whole + digest_of(state) for state in states]


def digest_of(question: object) -> bytes:
    """Return a short name of what is asked, equal for equal questions."""
    return hashlib.blake2b(msgspec.json.encode(question, order="sorted"), digest_size=16).digest()


class Implementation:
    """An open session, asked by one profile; called as a stepper, it answers by the first outcome.

    Attributes:
        session: with the implementation.
        profile: step, trajectory or flow (or time).
        answers: what it answered so far.
        pace: seconds for a hit of a trajectory or a flow, or for a state of a flow, in the last long answer.
        errors: of its numbers so far, by what they are of (`checks.paths`).
    """

    def __init__(
        self,
        session: Session,
        profile: str,
        answers: AnswerTally | None = None,
        pace: dict[str, float] | None = None,
    ) -> None:
        self.session, self.profile = session, profile
        self.errors: dict[str, list[float]] = {}
        self.answers = AnswerTally() if answers is None else answers
        self.pace: dict[str, float] = {} if pace is None else pace

    def __call__(self, scene: Scene, state: State, t_end: float) -> Outcome:
        """Return one outcome: of a step, of a trajectory of one collision, or of a flow of one state."""
        if not all(math.isfinite(number) for number in (*msgspec.structs.astuple(state)[:5], t_end)):
            raise CheckFailure("fail", f"its answers lead to the state {state} and t_end = {t_end}")
        (part,) = self.parts(question(self.profile, scene, state, t_end), 1)
        return read_outcome(part, state.t)

    def by(self, *profiles: str, scene: Scene) -> "Implementation":
        """Return the same implementation, asked by the first of some profiles that it offers.

        Raises:
            CheckFailure: unsupported, when it offers none.
        """
        for profile in profiles:
            if not missing(self.session.introduction, profile, to_data(scene)):
                return Implementation(self.session, profile, self.answers, self.pace)
        raise CheckFailure("unsupported", f"profile {' or '.join(profiles)}")

    def parts(self, request: Mapping[str, Any], n_due: int | None = None) -> list[dict[str, Any]]:
        """Ask, and return and count the outcomes that are answered; a whole refusal is the only one.

        Args:
            request: all but its seq.
            n_due: how many outcomes answer it; None where that depends.

        Raises:
            CheckFailure: also error, and wrong-format for another number of outcomes.
        """
        try:
            answer = self.session.ask(request)
        except CheckFailure as failure:
            if failure.verdict == "declined":  # behind a file of answers: this one is missing
                self.answers.add(request, ["undecided"] * len(_keys_of(request)))
            raise
        if "error" in answer:
            raise CheckFailure("error", answer["error"])
        found = outcomes_of(answer)
        self.answers.add(request, [part["outcome"] for part in found])
        if n_due not in (None, len(found)):
            raise CheckFailure("wrong-format", f"{n_due} outcomes are due, answered are {found}"[:200])
        return found

    def require_time(self, what: str, n: int) -> None:
        """Leave out a question whose answer is not expected in time.

        Args:
            what: is counted, a name of `pace`.
            n: how many of them the answer has.

        Raises:
            CheckFailure: declined.
        """
        if n <= SHORT:
            return
        expected = n * self.pace.get(what, 0.0)
        limit = PROMPT * self.session.limits.timeout
        if expected > limit:
            why = f"{n:,} {what} would take some {expected:.2g} s, more than {limit:g} s: not asked"
            raise CheckFailure("declined", why)

    def keep_pace(self, what: str, n: int) -> None:
        """Note how long the last answer took for each of n."""
        if n >= LEAST_TIMED:
            self.pace[what] = self.session.seconds / n

    def said(self, line: str) -> dict[str, Any]:
        """Send a line as it is written, but for the seq in place of "SEQ", and return what it is answered."""
        return self.session.say(line.replace('"SEQ"', str(SEQ)).encode(), SEQ, self.profile)

    def path(self, scene: Scene, state: State, n: int, t_end: float = FOREVER) -> list[Outcome]:
        """Follow up to n collisions, and what comes instead of a further one: at once, or step by step.

        Raises:
            CheckFailure: fail for steps that are too many, too few, or go on after the end; declined for a
                trajectory that would take too long.
        """
        found: list[Outcome] = []
        if self.profile == "step":
            while len(found) < n and all(isinstance(hit, Collision) for hit in found):
                found.append(self(scene, found[-1].state() if found else state, t_end))  # type: ignore[union-attr]
            return found
        t = state.t
        self.require_time("hits of a trajectory", n)
        parts = self.parts(question("trajectory", scene, state, t_end, n))
        self.keep_pace("hits of a trajectory", len(parts))
        for part in parts:
            found.append(read_outcome(part, t))
            t = getattr(found[-1], "t", t)
        hits = [isinstance(outcome, Collision) for outcome in found]
        if len(found) > n or not all(hits[:-1]) or (len(found) < n and hits[-1:] != [False]):
            raise CheckFailure(
                "fail", f"{len(found)} steps, {sum(hits)} of them collisions, are answered to {n} collisions"
            )
        return found

    def flown(self, scene: Scene, states: Sequence[State], t_end: float) -> list[dict[str, Any]]:
        """Carry states to t_end, and return what is answered for each."""
        return self.parts(question("flow", scene, states, t_end), len(states))


def octaves(draw: Draw, low: float, high: float) -> Iterator[float]:
    """Draw one number from each octave of [low, high], log-uniform, the highest first."""
    while high > low:
        yield high * 2.0 ** -(draw.part() * min(1.0, math.log2(high / low)))
        high /= 2


def rising(draw: Draw, low: float, high: float) -> list[float]:
    """Draw one number from each octave, the lowest first: each answer tells how long the next will take."""
    return list(octaves(draw, low, high))[::-1]


def run_check(check: SuiteCheck, session: Session, seed: int) -> Result:
    """Ask all that a check draws from a seed, of every profile that is offered, up to the first fault."""
    begin, lacking = time.monotonic(), ""
    notes: list[str] = []
    n = n_compared = n_declined = 0
    answers = AnswerTally()

    def result(verdict: str, why: str, paste: str = "") -> Result:
        return Result(
            check.name,
            check.name.partition("/")[0],
            verdict,
            why,
            time.monotonic() - begin,
            paste=paste,
            n_answers=answers.counts()[1],
            n_undecided=answers.counts()[0],
        )

    for profile in check.profiles:
        side = Implementation(session, profile, answers)
        fitting, lacking = _draw_asked(check, session.introduction, profile, seed)
        for asked in fitting:
            try:
                n += 1
                found = check.judges(side, *asked)
                n_compared += bool(found)
                notes += [found] if isinstance(found, str) else []
            except (AssertionError, *NOT_NUMBERS) as error:
                what = "" if isinstance(error, AssertionError) else "its answers cannot be calculated with: "
                return result("fail", f"{profile}: {what}{error}", as_pytest(check, profile, asked))
            except CheckFailure as failure:
                if failure.verdict == "unsupported":
                    lacking = failure.why
                elif failure.verdict == "declined":
                    n_declined += 1
                    notes.append(failure.why)
                else:
                    why = f"{profile}: {failure.why}"
                    return result(failure.verdict, why, as_pytest(check, profile, asked))
    why = "; ".join(notes[:4]) or f"{n_compared} of {n} compared"
    n_undecided, n_answers = answers.counts()
    if n_undecided:
        why += f"; {n_undecided} of {n_answers} answers are undecided"
    if declines_too_much(n_undecided, n_answers, MAX_DECLINED_OF_PART):
        return result("declined", why)
    if n_compared:
        return result("pass", why)
    if n_declined or n_undecided:
        return result("declined", why)
    return result("unsupported", lacking or "nothing to compare")


def _draw_asked(
    check: SuiteCheck, offered: Introduction | None, profile: str, seed: int
) -> tuple[list[Question], str]:
    """Return the questions that may be asked, drawn anew while too few are, and what the others need."""
    fitting: list[Question] = []
    lacking = missing(offered, profile, None)
    for i in range(0 if lacking else MAX_DRAWN):
        asked = list(check.asks(Draw(f"{seed}/{check.name}/{profile}/{i}"), profile))
        needs = [missing(offered, profile, wire_data(one[0])) for one in asked]
        fitting += [one for one, need in zip(asked, needs, strict=True) if not need]
        lacking = next(filter(None, needs), lacking)
        if 2 * len(fitting) >= len(asked):
            break
    return fitting, lacking


def as_pytest(check: SuiteCheck, profile: str, asked: Question) -> str:
    """Return a failed question as a pytest case to paste; `implementation` is the stepper, or its command."""
    name = check.name.replace("/", "_").replace("-", "_")
    return f"""\
from hypothesis import example, given
from conformance.suite import checks
from scene import *

@example({asked!r})
@given(checks.questions({check.name!r}, {profile!r}))
def test_{name}(asked):
    checks.judge(implementation, {check.name!r}, {profile!r}, *asked)
"""
