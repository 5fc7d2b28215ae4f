"""The suite: puts every question to one implementation and collects the verdicts.

First the protocol itself (start, the number-transport probe, bad input), then the vectors up to a level,
each as an image of itself, and questions that no file holds (`cases.generated`); then the exact properties
and the statistical profiles, then its speed where it offers `time`, then `stop`. What ends the session is the
verdict of every case not reached; what the implementation does not offer is `unsupported`.
Verdicts follow from the implementation, the level and the seed, not from the machine or its load, but for
time limits and what holds `time` to a clock.

The image of a question is drawn from the run's seed, so that nobody passes by memory: the mirror image in x,
and lengths and times by powers of two. These are symmetries of the billiard, so the certified answer is
carried over without a rounding: the answer of the implementation is transformed back to the question as it is
published, and graded there. Scales are drawn for a scene and not for a question, so that a scene stays one
scene for a whole run.
"""

import itertools
import math
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import msgspec

from conformance import vectors
from conformance.cases.draw import Draw, leaves, readable
from conformance.cases.generated import FRESH, ROUND, fresh_one
from conformance.grading.agreement import Agreement, grade, middle
from conformance.mutants.kill_matrix import diagnose
from conformance.suite.checks import GROUPS, Implementation, checks_of, run_check, timing
from conformance.suite.process import NOT_NUMBERS, CheckFailure
from conformance.suite.result import BAD, Result, Run, Speed, graded_parts
from conformance.suite.session import AnswerLine, Limits, Session, missing, outcomes_of
from conformance.vectors import NUMBERS, Vector
from scene import BadInput, State, from_data, load, to_data, transforms
from scene.protocol.rules import may_be_refused
from scene.refusal import check_seed

NEW_SEEDS = 10**6  # short enough to be typed again
# By level: one round of the table of families or two.
N_FRESH = {"core": ROUND, "extended": 2 * ROUND, "stress": 2 * ROUND}
TIMED_SCENE, TIMED_STATE = "moving-cap", State(0.0, 0.1, 0.2, 300.0, 400.0)
TIMED_MOST = 2.0  # seconds, after which no longer trajectory is asked
TIMED_REPEATS, TIMED_LEAST = 5, 20_000_000  # timings; nanoseconds that each must last to be read from a clock
LARGEST = 12  # exponents of two are drawn between this and its negative
RANGE = 2.0**-350, 2.0**350  # numbers that a scale may lead to: their squares are far from both ends
OTHER_GROUPS = (FRESH, *GROUPS)
OTHER_CASES = (
    *(f"protocol/{name}" for name in ("start", "echo", "rejects", "stop")),
    *(each.name for each in checks_of()),
)
Progress = Callable[[int, int], None]


def check(
    command: Sequence[str] | AnswerLine,
    *,
    level: str = "core",
    seed: int | None = None,
    groups: Sequence[str] = (),
    limits: Limits | None = None,
    known: frozenset[str] = frozenset(),
    progress: Progress | None = None,
) -> Run:
    """Run the suite on a command.

    Args:
        command: program and arguments, or a function that answers lines; it speaks protocol 1.
        level: core, extended or stress.
        seed: of all that is drawn, 0 to 2^64 - 1; None for a new one.
        groups: of cases; all when empty. Of the others only the protocol's own cases are asked.
        limits: time and restarts.
        known: what is known to fail, as `read_known` returns it.
        progress: called with the number of cases done and their total, as far as it is known.

    Raises:
        BadInput: for a command that cannot be started, an unknown level or group, a seed out of its
            bounds, a broken corpus.
    """
    seed = secrets.randbelow(NEW_SEEDS) if seed is None else seed
    asked_for = RunQuestions(level, seed, groups)
    with Session(command, limits) as session:
        return converse(session, asked_for, known, progress)


class Transform(NamedTuple):
    """An exact symmetry of a question.

    Attributes:
        is_mirrored: x -> -x, left and right exchanged.
        length: lengths are multiplied by 2^length.
        time: times are multiplied by 2^time.
    """

    is_mirrored: bool = False
    length: int = 0
    time: int = 0

    def __str__(self) -> str:
        """Say what was asked in place of the question as published."""
        said = ["mirrored"] if self.is_mirrored else []
        said += [f"lengths x 2^{self.length}"] if self.length else []
        said += [f"times x 2^{self.time}"] if self.time else []
        return ", ".join(said) or "as published"

    def apply(self, vector: Vector) -> Vector:
        """Return the image of a question; its certified answers stay those of the question as published."""
        state, scene = vector.state, readable(vector.scene)
        if self.is_mirrored:
            state = transforms.mirrored(state)
        if scene is None or not (self.length or self.time):
            return msgspec.structs.replace(vector, state=state)
        return msgspec.structs.replace(
            vector,
            scene=to_data(transforms.scaled(scene, self.length, self.time)),
            state=transforms.scaled_state(state, self.length, self.time),
            t_end=vector.t_end * 2.0**self.time,
        )

    def restore(self, answer: Any, exponent: int = 0) -> Any:
        """Return an answer to the image of a question as one to the question as published.

        Args:
            answer: or a part of one.
            exponent: of the power of two that a number is multiplied with.
        """
        if isinstance(answer, list | tuple):
            return [self.restore(part, exponent) for part in answer]
        if not isinstance(answer, dict):
            return answer * 2.0**exponent if exponent and isinstance(answer, int | float) else answer
        exponents = {
            **dict.fromkeys(("dt", "t", "captured"), -self.time),
            **dict.fromkeys(("x", "y"), -self.length),
            **dict.fromkeys(("vx", "vy"), self.time - self.length),
        }
        found = {name: self.restore(part, exponents.get(name, 0)) for name, part in answer.items()}
        if self.is_mirrored:
            found |= {name: -found[name] for name in ("x", "vx") if isinstance(found.get(name), float)}
            if isinstance(answer.get("wall"), str):
                found["wall"] = transforms.mirrored_wall(answer["wall"])
        return found


def draw_transform(vector: Vector, seed: int) -> Transform:
    """Draw the transform by which a vector is asked in the run of a seed; a fresh question needs none."""
    if vector.group == FRESH:
        return Transform()
    own, shared = Draw(f"{seed}/{vector.id}"), Draw(f"{seed}/{msgspec.json.encode(vector.scene).decode()}")
    is_mirrored = own.pick((False, True))
    exponents = [k for k in range(-LARGEST, LARGEST + 1) if k]
    length, time = shared.pick(exponents), shared.pick(exponents)
    if readable(vector.scene) is None:
        return Transform(is_mirrored)
    # Lateness counts units of time where nothing moves: no question may become one that may be refused.
    for image in (Transform(is_mirrored, length, time), Transform(is_mirrored, length)):
        if not _stays_in_range(vector, image.length, image.time):
            continue
        if _may_be_refused(image.apply(vector)) == _may_be_refused(vector):
            return image
    return Transform(is_mirrored)


def _may_be_refused(vector: Vector) -> bool:
    """Tell whether a question in a valid scene may be refused, by its own numbers."""
    return may_be_refused(from_data(vector.scene), vector.state)


def _stays_in_range(vector: Vector, length: int, time: int) -> bool:
    """Tell whether a scale leads to no number, asked or certified, that is near an end of binary64."""
    least, most = RANGE
    numbers = [*msgspec.structs.astuple(vector.state)[:5], vector.t_end]
    numbers += [number for _, number in leaves(vector.scene)]
    for step in (step for known in vector.expect for step in known.steps):
        numbers += [float(end) for name in NUMBERS for end in getattr(step, name)]
    factors = [2.0**k for k in (0, length, time, -time, length - time)]
    return all(least < abs(number) * factor < most for number in numbers if number for factor in factors)


class RunQuestions:
    """What a run asks: vectors, each in the image that its seed draws, and checks.

    Args:
        level: core, extended or stress.
        seed: of all that is drawn.
        groups: of cases; all when empty.
        proved: the fresh questions, where they are known from before; else each is proved when it is reached.

    Attributes:
        chosen: the vectors that files hold.
        fresh: those of this seed.
        checks: further questions.
        is_whole: whether no group is left out.
        n: number of cases, the protocol's own left out.
    """

    def __init__(
        self, level: str, seed: int, groups: Sequence[str] = (), proved: Sequence[Vector] | None = None
    ) -> None:
        self.chosen, self.is_whole = choose(level, groups), not groups
        self.level, self.seed = level, check_seed(seed)
        parts = tuple(groups) or OTHER_GROUPS
        n_fresh = N_FRESH[level] if FRESH in parts else 0
        drawn = (fresh_one(seed, number) for number in range(1, n_fresh + 1))
        self.fresh: Iterable[Vector] = drawn if proved is None else proved
        self.checks = [each for each in checks_of(level) if each.name.startswith(parts)]
        self.n = len(self.chosen) + n_fresh + len(self.checks)

    def vectors(self) -> Iterator[tuple[Vector, Transform]]:
        """Return the vectors in the order of a run, each with its image."""
        every = itertools.chain(self.chosen, self.fresh)
        return ((vector, draw_transform(vector, self.seed)) for vector in every)


def choose(level: str, groups: Sequence[str] = ()) -> list[Vector]:
    """Return the vectors up to a level, of some groups or all.

    Raises:
        BadInput: naming a level or group that does not exist.
    """
    found = vectors.load(level)
    names = list(dict.fromkeys(vector.group for vector in found))
    for group in groups:
        if group not in (*names, *OTHER_GROUPS):
            raise BadInput(f"group = {group!r}, must be one of {', '.join((*names, *OTHER_GROUPS))}")
    return [vector for vector in found if not groups or vector.group in groups]


def read_known(path: Path) -> frozenset[str]:
    """Read a known-failures file: one name a line, # begins a comment.

    A name is a case's id; ID@SEED for the run of one seed, which a fresh question needs; fresh/* for all of
    these, which may pass; declined/GROUP or declined/all where too many vectors are declined.

    Raises:
        BadInput: naming the line whose name the suite does not have, or that comes twice.
    """
    try:
        lines = path.read_text("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"known failures {str(path)!r} cannot be read: {error}") from None
    corpus = vectors.load("stress")
    names = {vector.id for vector in corpus} | set(OTHER_CASES) | {f"{FRESH}/*"}
    names |= {f"declined/{group}" for group in ("all", FRESH, *(v.group for v in corpus))}
    drawn = {f"{FRESH}/{number}" for number in range(1, max(N_FRESH.values()) + 1)}
    found: set[str] = set()
    for number, line in enumerate(lines, 1):
        name = line.partition("#")[0].strip()
        if not name:
            continue
        case, _, seed = name.partition("@")
        is_listed = case in names | drawn and seed.isdecimal() if "@" in name else name in names
        if name in found or not is_listed:
            problem = "comes twice" if name in found else "is no case of this suite"
            if name in drawn:
                problem = f"is of one run's questions: {name}@SEED lists it, {FRESH}/* all"
            raise BadInput(f"known failures {str(path)!r}:{number}: {name} {problem}")
        found.add(name)
    return frozenset(found)


def _is_known(result: Result, known: frozenset[str], seed: int) -> bool:
    """Tell whether a case must fail, or, where all that is drawn is listed, is one that did."""
    is_listed = not known.isdisjoint((result.id, f"{result.id}@{seed}"))
    return is_listed or (result.verdict in BAD and f"{result.group}/*" in known)


def converse(
    session: Session,
    questions: RunQuestions,
    known: frozenset[str] = frozenset(),
    progress: Progress | None = None,
) -> Run:
    """Ask all questions in a session, and collect what came of them; arguments as for `check`."""
    begin, speed = time.monotonic(), None
    results: list[Result] = []
    for name, act in (("start", session.start), ("echo", session.probe)):
        results.append(_closed(session, _tried(name, act)))
        if results[-1].verdict in BAD:
            unreached = CheckFailure(results[-1].verdict, f"not asked: {name} failed")
            results += [_result(vector, unreached) for vector in questions.chosen]
            break
    else:
        results.append(_closed(session, _tried("rejects", partial(ask_nonsense, session))))
        total = len(results) + questions.n
        for result in itertools.chain(
            (ask_vector(session, vector, image) for vector, image in questions.vectors()),
            (run_check(each, session, questions.seed) for each in questions.checks),
        ):
            results.append(_closed(session, result))
            if progress:
                progress(len(results), total)
        speed = measure_speed(session) if questions.is_whole else None
        if not session.cannot_show:
            results.append(_closed(session, _tried("stop", session.stop)))
    results = [msgspec.structs.replace(r, is_known=_is_known(r, known, questions.seed)) for r in results]
    verdicts = {result.id: result.verdict for result in results}
    passed = [vector for vector in questions.chosen if verdicts[vector.id] == "pass"]
    failed = [vector for vector in questions.chosen if verdicts[vector.id] == "fail"]
    graded = graded_parts(passed, is_timed=speed is not None)
    manifest = vectors.manifest()
    return Run(
        command=session.command,
        level=questions.level,
        seed=questions.seed,
        corpus=manifest.corpus,
        digest=manifest.digest,
        limits=session.limits,
        introduction=session.introduction,
        results=results,
        speed=speed,
        n_restarts=session.n_restarts,
        stderr=session.stderr.text(),
        seconds=time.monotonic() - begin,
        graded={**graded, "not_graded": [*graded["not_graded"], *session.cannot_show]},
        diagnosis=diagnose(failed, passed),
        known=known,
    )


def _closed(session: Session, result: Result) -> Result:
    """Return a case with the last line that was sent for it, unless it passed."""
    sent, session.sent = session.sent.decode("utf-8", "replace"), b""
    return result if result.verdict == "pass" else msgspec.structs.replace(result, sent=sent)


def _tried(name: str, act: Callable[[], object]) -> Result:
    """Return a case of the protocol: what it raises is its verdict."""
    begin, verdict, why = time.monotonic(), "pass", ""
    try:
        act()
    except CheckFailure as failure:
        verdict, why = failure.verdict, failure.why
    return Result(f"protocol/{name}", "protocol", verdict, why, time.monotonic() - begin)


def ask_vector(session: Session, vector: Vector, transform: Transform = Transform()) -> Result:  # noqa: B008
    """Put an image of one vector to an open session, and grade the answer to the question as published."""
    begin, is_refused = time.monotonic(), vector.expect[0].outcome == "rejected"
    if lacking := missing(session.introduction, vector.kind, None if is_refused else vector.scene):
        return _result(vector, CheckFailure("unsupported", lacking))
    try:
        answer = transform.restore(session.ask(vectors.request(transform.apply(vector), 0)))
    except CheckFailure as failure:
        return _result(vector, failure, time.monotonic() - begin)
    graded = grade(vector, answer)
    given, expected = _compared(vector, answer, graded)
    return Result(
        vector.id,
        vector.group,
        graded.verdict,
        graded.why,
        time.monotonic() - begin,
        vector.level,
        str(transform),
        ulps=graded.ulps if math.isfinite(graded.ulps) else None,
        relative=graded.relative if math.isfinite(graded.relative) else None,
        answer=answer,
        step=graded.step,
        given=given,
        expected=expected,
    )


def _compared(
    vector: Vector, answer: dict[str, Any], graded: Agreement
) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Return the outcome that did not pass and the certified one in its place; None where there is none."""
    if graded.verdict in ("pass", "wrong-format", "error"):
        return None, None
    certified = msgspec.to_builtins(middle(vector.expect[0], vector.state))
    outcomes = outcomes_of(answer)
    if vector.kind == "flow":
        certified = certified[-1:]
    at = graded.step
    return outcomes[at] if at < len(outcomes) else None, certified[at] if at < len(certified) else None


def measure_speed(session: Session) -> Speed | None:
    """Time a trajectory on the moving cap, longer until the clock can read it.

    None where it is not offered, or where it ends in another place than `trajectory` (`checks.timing`).
    """
    scene, state = load(TIMED_SCENE), TIMED_STATE
    if missing(session.introduction, "time", to_data(scene)):
        return None
    n_collisions, ns, seconds = 10, [0], 0.0
    try:
        timing.same_steps(Implementation(session, "time"), scene, state, (2,))
        # An answer that takes long, and is said to have taken no time, will not grow more credible.
        while min(ns) < TIMED_LEAST and n_collisions < 100_000 and seconds < TIMED_MOST:
            n_collisions *= 10 if min(ns) * 10 < TIMED_LEAST else 2
            ns, seconds, _ = timing.timed(session, scene, state, n_collisions, TIMED_REPEATS)
    except (CheckFailure, *NOT_NUMBERS):
        return None
    if not min(ns):
        return None
    return Speed(TIMED_SCENE, n_collisions, len(ns), min(ns) / n_collisions, median(ns) / n_collisions)


def ask_nonsense(session: Session) -> None:
    """A state without `vy` must be rejected, not guessed, and the process must live on."""
    state = {name: value for name, value in msgspec.to_builtins(TIMED_STATE).items() if name != "vy"}
    answer = session.ask({"cmd": "step", "scene": {"table": "cap", "r": 1.0}, "state": state, "t_end": 1.0})
    if answer.get("outcome") != "rejected":
        raise CheckFailure("fail", f"a state without vy was answered {answer}"[:200])


def _result(vector: Vector, failure: CheckFailure, seconds: float = 0.0) -> Result:
    return Result(vector.id, vector.group, failure.verdict, failure.why, seconds, vector.level)
