"""The suite: puts every question to one implementation and collects the verdicts.

First the protocol itself (start, the number-transport probe, bad input), then the vectors up to a level,
then the exact properties and the statistical profiles, then its speed where it offers `time`, then `stop`.
Physics and precision stay apart: a verdict for each case, a precision class for each group. What ends the
session is the verdict of every case not reached; what the implementation does not offer is `unsupported`.
"""

from __future__ import annotations

import itertools
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import msgspec

from conformance import properties, vectors
from conformance.grading.grade import grade, precision_class
from conformance.suite import promises, property_checks, timing
from conformance.suite.process import Trouble
from conformance.suite.session import Limits, Session, missing
from conformance.vectors import Vector
from scene import BadInput, State, load, to_data
from scene.protocol.messages import Introduction

# An implementation that declines more than one question in twenty has not been graded.
MAX_DECLINED = 0.05
BAD = ("fail", "crashed", "timed-out", "wrong-format", "error")
VERDICTS = ("pass", "fail", "indeterminate", "declined", "unsupported", *BAD[1:])
TIMED_SCENE, TIMED_STATE = "moving-cap", State(0.0, 0.1, 0.2, 300.0, 400.0)
TIMED_REPEATS, TIMED_LEAST = 5, 20_000_000  # timings; nanoseconds that each must last to be read from a clock
PROTOCOL_CASES = ("start", "echo", "rejects", "stop")
OTHER_CASES = (
    *(f"protocol/{name}" for name in PROTOCOL_CASES),
    *(f"property/{name}" for name in properties.PROPERTIES),
    *(f"profile/{name}" for name in ("work-identity", "one-cycle")),
    *(f"promise/{name}" for name in promises.PROMISES),
)
Progress = Callable[[int, int], None]


class Result(msgspec.Struct, frozen=True, omit_defaults=True):
    """One case and what came of it.

    Attributes:
        id: of the vector, or protocol/..., property/..., profile/...
        group: what it is counted with.
        verdict: see `VERDICTS`.
        why: one line.
        seconds: until the answer.
        level: of a vector.
        ulps: worst backward ulps, absent when not measured (or beyond binary64).
        relative: worst backward error, likewise.
        answer: what the implementation said, where it is of use.
        is_known: listed in the known-failures file.
    """

    id: str
    group: str
    verdict: str
    why: str = ""
    seconds: float = 0.0
    level: str = ""
    ulps: float | None = None
    relative: float | None = None
    answer: dict[str, Any] | None = None
    is_known: bool = False

    @property
    def is_right(self) -> bool:
        """Tell whether this result lets the run succeed: a known failure must fail, all else must not."""
        return self.verdict != "pass" if self.is_known else self.verdict not in BAD


class Speed(msgspec.Struct, frozen=True):
    """Nanoseconds per collision, by the implementation's own clock, best and median of the repeats."""

    scene: str
    collisions: int
    repeats: int
    best_ns: float
    median_ns: float


class Run(msgspec.Struct, frozen=True):
    """A whole run: what was asked of whom, and every result."""

    command: list[str]
    level: str
    corpus: str
    digest: str
    limits: Limits
    introduction: Introduction | None
    results: list[Result]
    speed: Speed | None
    n_restarts: int
    stderr: str
    seconds: float

    def counts(self, group: str | None = None) -> Counter[str]:
        """Count the verdicts, of one group or of all."""
        return Counter(r.verdict for r in self.results if group in (None, r.group))

    def groups(self) -> list[str]:
        """Return the groups in the order they were run."""
        return list(dict.fromkeys(result.group for result in self.results))

    def ulps(self, group: str | None = None) -> list[float]:
        """Return the backward ulps of the answers that passed, inf where binary64 does not hold them."""
        passed = [r for r in self.results if r.verdict == "pass" and group in (None, r.group)]
        return [math.inf if r.ulps is None else r.ulps for r in passed if r.relative is not None]

    def precision(self, group: str | None = None) -> str:
        """Return the class that the passing answers reach, or a dash when none was measured."""
        ulps = self.ulps(group)
        return precision_class(ulps) if ulps else "–"

    def objections(self) -> list[str]:
        """Say, one line each, why the run does not succeed."""
        found = [_objection(result) for result in self.results if not result.is_right]
        counts = self.counts()
        asked = sum(counts.values()) - counts["unsupported"]
        if counts["declined"] > MAX_DECLINED * asked:
            found.append(f"declined {counts['declined']} of {asked} cases, more than {MAX_DECLINED:.0%}")
        vectors_passed = any(r.verdict == "pass" and r.level for r in self.results)
        return found if vectors_passed or found else ["no vector passed: nothing was graded"]

    def exit_code(self) -> int:
        """Return 0 when all is right, 1 when not, 2 when the corpus could not tell (indeterminate)."""
        if self.objections():
            return 1
        return 2 if self.counts()["indeterminate"] else 0


def _objection(result: Result) -> str:
    if result.is_known:
        return f"{result.id}: passes, though it is listed as a known failure"
    return f"{result.id}: {result.verdict}: {result.why}"


def check(
    command: Sequence[str],
    *,
    level: str = "core",
    groups: Sequence[str] = (),
    limits: Limits | None = None,
    known: frozenset[str] = frozenset(),
    progress: Progress | None = None,
) -> Run:
    """Run the suite on a command.

    Args:
        command: program and arguments; it speaks protocol 1.
        level: core, extended or stress.
        groups: of vectors; all when empty.
        limits: time and restarts.
        known: ids of the cases that are known to fail.
        progress: called with the number of cases done and their total, as far as it is known.

    Raises:
        BadInput: for a command that cannot be started, an unknown level or group, a broken corpus.
    """
    chosen = choose(level, groups)
    manifest = vectors.manifest()
    limits = limits or Limits()
    begin = time.monotonic()
    with Session(command, limits) as session:
        results, speed = _converse(session, chosen, progress or (lambda _done, _total: None))
        marked = [msgspec.structs.replace(result, is_known=result.id in known) for result in results]
        return Run(
            command=list(command),
            level=level,
            corpus=manifest.corpus,
            digest=manifest.digest,
            limits=limits,
            introduction=session.introduction,
            results=marked,
            speed=speed,
            n_restarts=session.n_restarts,
            stderr=session.stderr.text(),
            seconds=time.monotonic() - begin,
        )


def choose(level: str, groups: Sequence[str] = ()) -> list[Vector]:
    """Return the vectors up to a level, of some groups or all.

    Raises:
        BadInput: naming a level or group that does not exist.
    """
    found = vectors.load(level)
    names = list(dict.fromkeys(vector.group for vector in found))
    for group in groups:
        if group not in names:
            raise BadInput(f"group = {group!r}, must be one of {', '.join(names)}")
    return [vector for vector in found if not groups or vector.group in groups]


def read_known(path: Path) -> frozenset[str]:
    """Read a known-failures file: one id a line, # begins a comment.

    Raises:
        BadInput: naming the line whose id the suite does not have, or that comes twice.
    """
    try:
        lines = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"known failures {str(path)!r} cannot be read: {error}") from None
    ids = {vector.id for vector in vectors.load("stress")} | set(OTHER_CASES)
    found: set[str] = set()
    for number, line in enumerate(lines, 1):
        name = line.partition("#")[0].strip()
        if not name:
            continue
        if name in found or name not in ids:
            problem = "comes twice" if name in found else "is no case of this suite"
            raise BadInput(f"known failures {str(path)!r}:{number}: {name} {problem}")
        found.add(name)
    return frozenset(found)


def _converse(
    session: Session, chosen: Sequence[Vector], progress: Progress
) -> tuple[list[Result], Speed | None]:
    results: list[Result] = []
    for name, act in (("start", session.start), ("echo", session.probe)):
        results.append(_tried(name, act))
        if results[-1].verdict != "pass":
            unreached = Trouble(results[-1].verdict, f"not asked: {name} failed")
            return [*results, *(_result(vector, unreached) for vector in chosen)], None
    results.append(_tried("rejects", partial(_ask_nonsense, session)))
    total = len(results) + len(chosen) + len(OTHER_CASES) - len(PROTOCOL_CASES)
    for result in itertools.chain(
        (ask_vector(session, vector) for vector in chosen), _ask_further(session, chosen)
    ):
        results.append(result)
        progress(len(results), total)
    speed = measure_speed(session)
    return [*results, _tried("stop", session.stop)], speed


def _tried(name: str, act: Callable[[], object]) -> Result:
    """Return a case of the protocol: what it raises is its verdict."""
    begin, verdict, why = time.monotonic(), "pass", ""
    try:
        act()
    except Trouble as trouble:
        verdict, why = trouble.verdict, trouble.why
    return Result(f"protocol/{name}", "protocol", verdict, why, time.monotonic() - begin)


def put(session: Session, vector: Vector) -> dict[str, Any]:
    """Put one vector to an open session and return its answer.

    Raises:
        Trouble: as `Session.ask`; unsupported, when the implementation does not list what it needs.
    """
    assert session.introduction is not None
    is_refused = vector.expect[0].outcome == "rejected"
    if lacking := missing(session.introduction, vector.kind, None if is_refused else vector.scene):
        raise Trouble("unsupported", lacking)
    return session.ask(vectors.request(vector, 0))


def ask_vector(session: Session, vector: Vector) -> Result:
    """Put one vector to an open session and grade the answer."""
    begin = time.monotonic()
    try:
        answer = put(session, vector)
    except Trouble as trouble:
        return _result(vector, trouble, time.monotonic() - begin)
    graded = grade(vector, answer)
    return Result(
        vector.id,
        vector.group,
        graded.verdict,
        graded.why,
        time.monotonic() - begin,
        vector.level,
        ulps=graded.ulps if math.isfinite(graded.ulps) else None,
        relative=graded.relative if math.isfinite(graded.relative) else None,
        answer=answer,
    )


def measure_speed(session: Session) -> Speed | None:
    """Time a trajectory on the moving cap, longer until the clock can read it.

    None where it is not offered, or where it does not end as `trajectory` says (`conformance.suite.timing`).
    """
    assert session.introduction is not None
    scene, state = load(TIMED_SCENE), TIMED_STATE
    if missing(session.introduction, "time", to_data(scene)):
        return None
    n_collisions, ns = 10, [0]
    try:
        while min(ns) < TIMED_LEAST and n_collisions < 100_000:
            n_collisions *= 10 if min(ns) * 10 < TIMED_LEAST else 2
            ns, _, last = timing.timed(session, scene, state, n_collisions, TIMED_REPEATS)
        timing.check_last(session, scene, state, n_collisions, last)
    except Trouble:
        return None
    return Speed(TIMED_SCENE, n_collisions, len(ns), min(ns) / n_collisions, median(ns) / n_collisions)


def _ask_nonsense(session: Session) -> None:
    """A state without `vy` must be rejected, not guessed, and the process must live on."""
    state = {name: value for name, value in msgspec.to_builtins(TIMED_STATE).items() if name != "vy"}
    answer = session.ask({"cmd": "step", "scene": {"table": "cap", "r": 1.0}, "state": state, "t_end": 1.0})
    if answer.get("outcome") != "rejected":
        raise Trouble("fail", f"a state without vy was answered {answer}"[:200])


def _ask_further(session: Session, chosen: Sequence[Vector]) -> Iterator[Result]:
    for name, verdict, why, seconds in property_checks.ask_properties(session, chosen):
        yield Result(f"property/{name}", "property", verdict, why, seconds)
    for name, verdict, why, seconds in property_checks.ask_profiles(session):
        yield Result(f"profile/{name}", "profile", verdict, why, seconds)
    for name, verdict, why, seconds in promises.ask_promises(session):
        yield Result(f"promise/{name}", "promise", verdict, why, seconds)


def _result(vector: Vector, trouble: Trouble, seconds: float = 0.0) -> Result:
    return Result(vector.id, vector.group, trouble.verdict, trouble.why, seconds, vector.level)
