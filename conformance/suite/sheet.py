"""The suite without a dialogue: every question that hangs on no answer, and the grading of what came back.

A sheet holds the questions of a run: the vectors up to a level in the images that its seed draws, the fresh
ones, and the checks whose questions are known beforehand (`CHECKS`). Each has a sequence number
that follows from the seed and the question, so that answers tell which questions they belong to. They are
graded by the code that grades a dialogue: `_Replay` is a session that answers from what was read.

Not in a sheet: how a process behaves, lines that are no questions, checks that go on from an answer, time.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

from conformance import plain, vectors
from conformance.suite.answers import check_echo, read_answer, read_introduction, with_walls
from conformance.suite.checks import checks_of, ensembles, run_check
from conformance.suite.checks.form import QUESTIONS, SuiteCheck
from conformance.suite.process import CheckFailure
from conformance.suite.result import LAWS, TABLES, Run
from conformance.suite.run import RunQuestions, ask_nonsense, converse
from conformance.suite.session import MAX_SEQ, Session, needs, probe_values
from conformance.vectors import LEVELS, Vector
from scene.protocol.messages import PROFILES, PROTOCOL, Introduction
from scene.protocol.wire import serve
from scene.refusal import BadInput

# Checks whose questions hang on no answer, and by which profiles.
CHECKS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(
        (f"property/{name}" for name in ("mirror", "scaling-of-lengths", "scaling-of-times", "static-limit")),
        QUESTIONS,
    ),
    "property/period-shift": QUESTIONS,
    "property/energy": QUESTIONS,
    "property/angular-momentum": ("step", "trajectory"),
    **dict.fromkeys(
        (f"promise/{name}" for name in ("hits", "edges", "changed-questions", "long-paths", "late-starts")),
        ("trajectory",),
    ),
    "promise/waiting": ("step", "trajectory"),
    "promise/long-flow": ("flow",),
    "promise/many-particles": ("flow",),
    "promise/endings": QUESTIONS,
    **dict.fromkeys((f"profile/{name}" for name in ensembles.PROFILES), ("flow",)),
}
NOT_IN_FILES = ("behaviour as a process", "malformed lines", "checks that go on from an answer")
REJECTS = "protocol/rejects"
WORD = 2**32  # a seed is told as two numbers that binary64 holds


class SheetQuestion(NamedTuple):
    """A question of a sheet: the case it is of, its sequence number, and the request without it."""

    case: str
    seq: int
    request: dict[str, Any]

    @property
    def line(self) -> bytes:
        """Return the line of protocol 1 that asks it."""
        return msgspec.json.encode({**self.request, "seq": self.seq})


class Answers(NamedTuple):
    """What came back.

    Attributes:
        source: of the answers, as messages name it.
        lines: by sequence number, each as protocol 1 has it, or a list of outcomes where no JSON was sent.
        introduction: the answer to `start`, if there is one.
        echoes: those to `echo`.
        places: where each line stands, by sequence number.
    """

    source: str
    lines: dict[int, bytes]
    introduction: bytes | None = None
    echoes: tuple[bytes, ...] = ()
    places: Mapping[int, str] = {}


class Sheet(RunQuestions):
    """The questions of a level and a seed that hang on no answer.

    Args:
        level: core, extended or stress.
        seed: of all that is drawn.
        proved: the fresh questions, where they are known from before; else they are drawn and proved.

    Attributes:
        questions: by what they ask, in the order of a run.
    """

    def __init__(self, level: str, seed: int, proved: Sequence[Vector] | None = None) -> None:
        super().__init__(level, seed, proved=proved)
        self.fresh, self.checks = list(self.fresh), checks_in_files(level)
        self.questions: dict[bytes, SheetQuestion] = {}
        self._numbers = set[int]()
        for vector, image in self.vectors():
            self.add(vector.id, vectors.request(image.apply(vector), 0))
        recorder = _Recorder(self)
        ask_nonsense(recorder)
        for check in self.checks:
            recorder.case = check.name
            run_check(check, recorder, seed)

    def add(self, case: str, request: Mapping[str, Any]) -> None:
        """Add a question, unless it is asked already."""
        key = key_of(request)
        if key in self.questions:
            return
        digest = hashlib.sha256(f"{self.seed} {self.level} {case} ".encode() + key).digest()
        seq = int.from_bytes(digest[:4], "big") % MAX_SEQ + 1
        while seq in self._numbers:
            seq = seq % MAX_SEQ + 1
        self._numbers.add(seq)
        self.questions[key] = SheetQuestion(case, seq, {k: v for k, v in request.items() if k != "seq"})

    def lines(self) -> list[bytes]:
        """Return the questions as a program of protocol 1 reads them, `start` and `stop` included."""
        hello = {"cmd": "start", "protocol": PROTOCOL}
        numbers = [{"cmd": "echo", "values": values} for values in (self.signature(), probe_values())]
        begin, end = map(msgspec.json.encode, [hello, *numbers]), msgspec.json.encode({"cmd": "stop"})
        return [*begin, *(question.line for question in self.questions.values()), end]

    def signature(self) -> list[float]:
        """Return seed and level as numbers, which a program that echoes them hands back."""
        return [float(self.seed // WORD), float(self.seed % WORD), float(LEVELS.index(self.level))]


def signed(echoes: Sequence[bytes]) -> tuple[str, int] | None:
    """Return the level and the seed that answers tell; None where none does."""
    for line in echoes:
        values = msgspec.json.decode(line).get("values")
        if isinstance(values, list) and len(values) == 3:
            high, low, place = (int(number) for number in values)
            if 0 <= place < len(LEVELS):
                return LEVELS[place], high * WORD + low
    return None


def checks_in_files(level: str) -> list[SuiteCheck]:
    """Return the checks of a level whose questions are known beforehand, by the profiles where they are."""
    found = {check.name: check for check in checks_of(level)}
    return [found[name]._replace(profiles=profiles) for name, profiles in CHECKS.items() if name in found]


def key_of(request: Mapping[str, Any]) -> bytes:
    """Return what a request asks, as bytes that are equal for equal questions."""
    return msgspec.json.encode({k: v for k, v in sorted(request.items()) if k != "seq"})


def grade_answers(sheet: Sheet, answers: Answers) -> Run:
    """Grade answers as those of a dialogue; what has none is declined.

    Raises:
        BadInput: they are answers to other questions, naming the first question that has none of them.
    """
    numbers = {question.seq for question in sheet.questions.values()}
    for seq in answers.lines:
        if seq not in numbers:
            first = next(q for q in sheet.questions.values() if q.seq not in answers.lines)
            raise BadInput(
                f"{answers.places.get(seq, answers.source)}: seq = {seq} is of no question of level"
                f" {sheet.level} and seed {sheet.seed}, where {first.case} has seq {first.seq}:"
                " they are answers to other questions"
            )
    return converse(_Replay(sheet, answers), sheet)


class _Recorder(Session):
    """A session that writes its questions into a sheet; the plain stepper answers, so that checks go on.

    Ensembles are answered by where they start: their questions follow from no answer, and take long.
    """

    def __init__(self, sheet: Sheet) -> None:
        super().__init__(_plain)
        self.introduction = offering(PROFILES[:3], TABLES, LAWS)
        self.case, self._sheet = REJECTS, sheet

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        self._sheet.add(self.case, request)
        if self.case.startswith("profile/"):
            at = {"outcome": "horizon", "t": request["t_end"]}
            return {"states": [{**state, **at} for state in request["states"]]}
        return read_answer(_plain(msgspec.json.encode({**request, "seq": 0})), request["cmd"], 0)


class _Replay(Session):
    """A session whose answers were given before."""

    cannot_show = NOT_IN_FILES

    def __init__(self, sheet: Sheet, answers: Answers) -> None:
        super().__init__([answers.source])
        self._sheet, self._answers = sheet, answers
        questions = [q for q in sheet.questions.values() if q.seq in answers.lines and q.case != REJECTS]
        seen = {need for q in questions for need in needs(q.request["cmd"], _scene(q.request))}
        every = ("profile", PROFILES), ("table", TABLES), ("law", LAWS)
        self.introduction = offering(*(tuple(n for n in names if (what, n) in seen) for what, names in every))

    def start(self) -> Introduction:
        if self._answers.introduction is None:
            raise CheckFailure("unsupported", "not in the answers: what it offers is what it answered")
        self.introduction = read_introduction(self._answers.introduction)
        return self.introduction

    def probe(self) -> None:
        if not self._answers.echoes:
            raise CheckFailure("unsupported", "not in the answers")
        check_echo(probe_values(), self._answers.echoes[-1])

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        question = self._sheet.questions.get(key_of(request))
        if question is None:
            raise CheckFailure("unsupported", "not in files: the question hangs on an answer")
        line = self._answers.lines.get(question.seq)
        if line is None:
            raise CheckFailure("declined", f"no answer with seq {question.seq}")
        self.sent = question.line
        line = _enveloped(line, request["cmd"], question.seq) if line.startswith(b"[") else line
        return with_walls(read_answer(line, request["cmd"], question.seq), request.get("scene"))


def offering(profiles: Sequence[str], tables: Sequence[str], laws: Sequence[str]) -> Introduction:
    """Return the introduction of answers without one."""
    return Introduction(PROTOCOL, "answers in files", "", "unknown", *map(tuple, (profiles, tables, laws)))


def _enveloped(line: bytes, cmd: str, seq: int) -> bytes:
    """Return outcomes as an answer of protocol 1; a lone refusal is of the whole question."""
    parts = msgspec.json.decode(line)
    is_whole = len(parts) == 1 and (
        cmd == "step" or (parts[0]["outcome"] == "rejected" and cmd == "trajectory")
    )
    whole = parts[0] if is_whole else {"states" if cmd == "flow" else "steps": parts}
    return msgspec.json.encode({"seq": seq, **whole})


def _scene(request: Mapping[str, Any]) -> Mapping[str, Any] | None:
    scene = request.get("scene")
    return scene if isinstance(scene, Mapping) and "table" in scene else None


def _plain(line: bytes) -> bytes:
    """Answer a line as the plain stepper does."""
    out = io.BytesIO()
    steppers = plain.next_collision, plain.trajectory
    serve("plain", *steppers, io.BytesIO(line), out, flow=plain.flow)
    return out.getvalue()
