"""Questions and answers in files: the suite without a dialogue.

A sheet holds the questions of a run: the vectors up to a level in the images that its seed draws, the fresh
ones, and the checks whose questions are known beforehand (`CHECKS`). Each has a sequence number
that follows from the seed and the question, so that answers tell which questions they belong to. They are
graded by the code that grades a dialogue: `_Replay` is a session that answers from what was read.

JSON lines are what a program of protocol 1 reads: `./my_stepper < questions.jsonl > answers.jsonl`. As CSV
there is a file for each scene: the scene's numbers in lines that begin with #, then a row for each state.
Answers in CSV have a row for each outcome; those of one trajectory or flow follow each other with one seq.
Numbers may be decimal, with Fortran's exponent D too, or hexadecimal as C's %a writes them.

Not in a sheet: how a process behaves, lines that are no questions, checks that go on from an answer, time.
"""

import hashlib
import io
import itertools
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from conformance import plain, vectors
from conformance.suite.checks import checks_of, flows, run_check
from conformance.suite.checks.form import QUESTIONS, SuiteCheck
from conformance.suite.process import CheckFailure, clean
from conformance.suite.result import Run, parts_needed
from conformance.suite.run import RunQuestions, ask_nonsense, converse
from conformance.suite.session import (
    MAX_SEQ,
    UNREADABLE,
    Session,
    check_echo,
    probe_values,
    read_answer,
    read_introduction,
    with_walls,
)
from conformance.vectors import LEVELS, Vector
from scene.files.tables import read_number, read_rows
from scene.files.writer import write_files
from scene.protocol.messages import PROTOCOL, Echoed, Introduction
from scene.protocol.wire import serve
from scene.refusal import BadInput, shown

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
    **dict.fromkeys((f"profile/{name}" for name in flows.PROFILES), ("flow",)),
}
NOT_IN_FILES = ("behaviour as a process", "malformed lines", "checks that go on from an answer")
REJECTS = "protocol/rejects"
WORD = 2**32  # a seed is told as two numbers that binary64 holds
KEY, INDEX = "key", "scenes.txt"  # what the grader keeps; the names of the files, a line each
SEQ = re.compile(rb'"seq"\s*:\s*(-?[0-9]+)')
STATE = ("t", "x", "y", "vx", "vy")
COLUMNS = ("seq", "cmd", "collisions", *STATE, "wall", "t_end")  # of questions
NEEDED = ("seq", "outcome", *STATE)  # of answers
OPTIONAL = ("wall", "dt", "t_in", "t_out", "reason")


class SheetQuestion(NamedTuple):
    """A question of a sheet: the case it is of, its sequence number, and the request, whatever its own is."""

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
        by_number: the same by their sequence numbers.
    """

    def __init__(self, level: str, seed: int, proved: Sequence[Vector] | None = None) -> None:
        super().__init__(level, seed, proved=proved)
        self.fresh, self.checks = list(self.fresh), checks_in_files(level)
        self.questions: dict[bytes, SheetQuestion] = {}
        self.by_number: dict[int, SheetQuestion] = {}
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
        while seq in self.by_number:
            seq = seq % MAX_SEQ + 1
        self.questions[key] = self.by_number[seq] = SheetQuestion(case, seq, dict(request))

    def lines(self) -> list[bytes]:
        """Return the questions as a program of protocol 1 reads them, `start` and `stop` included."""
        # A program that echoes seed and level hands them back.
        signature = [float(self.seed // WORD), float(self.seed % WORD), float(LEVELS.index(self.level))]
        hello = {"cmd": "start", "protocol": PROTOCOL}
        numbers = [{"cmd": "echo", "values": values} for values in (signature, probe_values())]
        begin, end = map(msgspec.json.encode, [hello, *numbers]), msgspec.json.encode({"cmd": "stop"})
        return [*begin, *(question.line for question in self.questions.values()), end]


def signed(echoes: Sequence[bytes]) -> tuple[str, int] | None:
    """Return the level and the seed that answers tell; None where none does."""
    for line in echoes:
        with suppress(*UNREADABLE, ValueError, OverflowError, IndexError):
            high, low, place = map(int, msgspec.json.decode(line, type=Echoed).values)
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
    for seq in answers.lines:
        if seq not in sheet.by_number:
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
        self.case, self._sheet = REJECTS, sheet
        self.start()

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        self._sheet.add(self.case, request)
        if self.case.startswith("profile/"):
            at = {"outcome": "horizon", "t": request["t_end"]}
            return {"states": [{**state, **at} for state in request["states"]]}
        return super().ask(request)


class _Replay(Session):
    """A session whose answers were given before."""

    cannot_show = NOT_IN_FILES

    def __init__(self, sheet: Sheet, answers: Answers) -> None:
        super().__init__([answers.source])
        self._sheet, self._answers = sheet, answers
        questions = [q for seq in answers.lines if (q := sheet.by_number[seq]).case != REJECTS]
        asked = [(q.request["cmd"], q.request["scene"]) for q in questions]
        offered = parts_needed((cmd, scene if "table" in scene else None) for cmd, scene in asked)
        names = {part: tuple(names) for part, names in offered.items()}
        self.introduction = Introduction(PROTOCOL, "answers in files", "", "unknown", **names)

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


def _enveloped(line: bytes, cmd: str, seq: int) -> bytes:
    """Return outcomes as an answer of protocol 1; a lone refusal is of the whole question."""
    parts = msgspec.json.decode(line)
    is_whole = len(parts) == 1 and (
        cmd == "step" or (parts[0]["outcome"] == "rejected" and cmd == "trajectory")
    )
    whole = parts[0] if is_whole else {"states" if cmd == "flow" else "steps": parts}
    return msgspec.json.encode({"seq": seq, **whole})


def _plain(line: bytes) -> bytes:
    """Answer a line as the plain stepper does."""
    out = io.BytesIO()
    steppers = plain.next_collision, plain.trajectory
    serve("plain", *steppers, io.BytesIO(line), out, flow=plain.flow)
    return out.getvalue()


class Key(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the grader of a sheet need not find out again: level, seed, corpus, and the proved questions."""

    level: str
    seed: int
    corpus: str
    fresh: tuple[Vector, ...]


def write_lines(sheet: Sheet, path: Path) -> int:
    """Write questions as JSON lines, and the key beside them; return how many there are."""
    lines = b"\n".join([*sheet.lines(), b""])
    write_files(path.parent, {path.name: lines, key_file(path).name: _key(sheet)})
    return len(sheet.questions)


def write_tables(sheet: Sheet, folder: Path) -> int:
    """Write questions as CSV into an existing folder, a file a scene; return how many there are.

    Questions about what is no scene or no state, which are to be refused, are left out.
    """
    by_scene = defaultdict[str, list[SheetQuestion]](list)
    for question in sheet.questions.values():
        with suppress(TypeError, AttributeError, ValueError):  # no scene
            if question.case != REJECTS:  # a state without vy
                by_scene["".join(_scene_lines(question.request["scene"]))].append(question)
    names = {f"{number:05d}.csv": scene for number, scene in enumerate(by_scene, 1)}
    files: dict[str, Any] = {name: scene + "".join(_rows(by_scene[scene])) for name, scene in names.items()}
    write_files(folder, {**files, INDEX: "".join(f"{name}\n" for name in names), KEY: _key(sheet)})
    return sum(map(len, by_scene.values()))


def key_file(questions: Path) -> Path:
    """Return where the key of a file of questions is."""
    return questions / KEY if questions.is_dir() else questions.with_name(f"{questions.name}.{KEY}")


def read_key(questions: Path) -> Sheet:
    """Return the sheet that a file or folder of questions was written from.

    Raises:
        BadInput: there is no key, it is damaged, or of another corpus.
    """
    path = key_file(questions)
    try:
        key = msgspec.json.decode(path.read_bytes(), type=Key)
    except (OSError, *UNREADABLE) as error:
        raise BadInput(f"--questions: the key {str(path)!r} cannot be read: {error}") from None
    if key.corpus != vectors.manifest().digest:
        raise BadInput(f"--questions: {str(path)!r} is of another corpus: write the questions anew")
    return Sheet(key.level, key.seed, key.fresh)


def read_answers(path: Path) -> Answers:
    """Read a file of answers: JSON lines, or CSV by its ending, or a folder of CSV files.

    Raises:
        BadInput: in one line, with the place.
    """
    files = sorted(path.glob("*.csv")) if path.is_dir() else [path]
    is_table = path.is_dir() or path.suffix == ".csv"
    try:
        found = _of_tables(files, path) if is_table else _of_lines(path)
    except OSError as error:
        raise BadInput(f"answers {str(path)!r} cannot be read: {error.strerror}") from None
    if not found.lines:
        raise BadInput(f"answers {str(path)!r}: holds no answer")
    return found


def _key(sheet: Sheet) -> bytes:
    return msgspec.json.encode(Key(sheet.level, sheet.seed, vectors.manifest().digest, tuple(sheet.fresh)))


def _scene_lines(scene: Mapping[str, Any]) -> Iterator[str]:
    """Yield a scene as lines of words: # law kind field place number."""
    yield f"# table {scene['table']}\n"
    for name, law in scene.items():
        if name not in ("table", "name", "notes"):
            kind = law["kind"] if isinstance(law, Mapping) else "constant"
            for field, numbers in _fields(law).items():
                for place, number in enumerate(numbers, 1):
                    yield f"# {name} {kind} {field} {place} {float(number)!r}\n"


def _fields(law: Any) -> dict[str, Sequence[float]]:
    """Return the numbers of a law by their names; a bang-bang law has times and values."""
    if not isinstance(law, Mapping):
        return {"value": [law]}
    if "knots" in law:
        times, values = zip(*law["knots"], strict=True)
        return {"time": times, "value": values}
    fields = {name: part for name, part in law.items() if name != "kind"}
    return {name: part if isinstance(part, list | tuple) else [part] for name, part in fields.items()}


def _rows(questions: Sequence[SheetQuestion]) -> Iterator[str]:
    yield ",".join(COLUMNS) + "\n"
    for question in questions:
        request = question.request
        for state in request.get("states") or [request["state"]]:
            numbers = [repr(float(state[name])) for name in STATE]
            cells = [question.seq, request["cmd"], request.get("collisions", 1), *numbers]
            yield ",".join(map(str, [*cells, state.get("wall") or "", repr(float(request["t_end"]))])) + "\n"


def _of_lines(path: Path) -> Answers:
    found: dict[int, bytes] = {}
    places: dict[int, str] = {}
    introduction, echoes = None, []
    for number, line in enumerate(path.read_bytes().split(b"\n"), 1):
        place = f"answers {str(path)!r}:{number}"
        if seq := SEQ.search(line):
            _once(places, int(seq[1]), place)
            found[int(seq[1])] = line
        elif b'"protocol"' in line:
            introduction = line
        elif b'"values"' in line:
            echoes.append(line)
        elif line.strip():
            said = clean(line[:60].decode("utf-8", "replace"))
            raise BadInput(f"{place}: has no seq, must have that of its question: {said}")
    return Answers(str(path), found, introduction, tuple(echoes), places)


def _once(places: dict[int, str], seq: int, place: str) -> None:
    if seq in places:
        raise BadInput(f"{place}: seq = {seq} is answered twice, first at {places[seq].rpartition(':')[2]}")
    places[seq] = place


def _of_tables(files: Sequence[Path], source: Path) -> Answers:
    lines: dict[int, bytes] = {}
    places: dict[int, str] = {}
    for path in files:
        rows = read_rows(path, f"answers {str(path)!r}", NEEDED, (*NEEDED, *OPTIONAL))
        for seq, group in itertools.groupby(rows, _seq):
            found = list(group)
            _once(places, seq, found[0][0])
            lines[seq] = msgspec.json.encode([_outcome(*row) for row in found])
    return Answers(str(source), lines, None, (), places)


def _seq(row: tuple[str, dict[str, str]]) -> int:
    place, cells = row
    number = read_number(place, "seq", cells["seq"])
    if not number.is_integer():
        raise BadInput(f"{place}: seq = {shown(cells['seq'])}, must be a whole number")
    return int(number)


def _outcome(place: str, cells: Mapping[str, str]) -> dict[str, Any]:
    """Return a row as an outcome of protocol 1; what it does not hold is left out."""
    words = {name: cells[name] for name in ("wall", "reason") if cells.get(name)}
    names = (*STATE, "dt", "t_in", "t_out")
    numbers = {name: read_number(place, name, cells[name]) for name in names if cells.get(name)}
    ends = [numbers.pop(name) for name in ("t_in", "t_out") if name in numbers]
    is_told = cells["outcome"] == "horizon" and ("t_in" in cells or "t_out" in cells)
    captured = {"captured": ends or None} if is_told else {}
    return {"outcome": cells["outcome"], "reason": "", **words, **numbers, **captured}
