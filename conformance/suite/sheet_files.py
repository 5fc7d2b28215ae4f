"""A sheet of questions and its answers as files: JSON lines as protocol 1 has them, or CSV.

JSON lines are what a program of protocol 1 reads: `./my_stepper < questions.jsonl > answers.jsonl`. As CSV
there is a file for each scene: the scene's numbers in lines that begin with #, then a row for each state.
Answers in CSV have a row for each outcome; those of one trajectory or flow follow each other with one seq.
Numbers may be decimal, with Fortran's exponent D too, or hexadecimal as C's %a writes them.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from conformance import vectors
from conformance.files import write_files
from conformance.suite.answers import UNREADABLE
from conformance.suite.process import clean
from conformance.suite.sheet import REJECTS, Answers, Sheet, SheetQuestion
from conformance.vectors import Vector
from scene.refusal import BadInput, shown

KEY, INDEX = "key", "scenes.txt"  # what the grader keeps; the names of the files, a line each
SEQ = re.compile(rb'"seq"\s*:\s*(-?[0-9]+)')
STATE = ("t", "x", "y", "vx", "vy")
COLUMNS = ("seq", "cmd", "collisions", *STATE, "wall", "t_end")  # of questions
NEEDED = ("seq", "outcome", *STATE)  # of answers
OPTIONAL = ("wall", "dt", "t_in", "t_out", "reason")
MAX_SIZE = 2**30  # bytes of a file of answers


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
    by_scene: dict[str, list[SheetQuestion]] = {}
    for question in sheet.questions.values():
        if question.case == REJECTS:  # a state without vy
            continue
        try:
            by_scene.setdefault("".join(_scene_lines(question.request["scene"])), []).append(question)
        except (TypeError, AttributeError, ValueError):
            continue
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
    except OSError as error:
        raise BadInput(f"--questions: the key {str(path)!r} cannot be read: {error.strerror}") from None
    except UNREADABLE as error:
        raise BadInput(f"--questions: {str(path)!r} is no key: {error}") from None
    if key.corpus != vectors.manifest().digest:
        raise BadInput(f"--questions: {str(path)!r} is of another corpus: write the questions anew")
    return Sheet(key.level, key.seed, key.fresh)


def read_answers(path: Path) -> Answers:
    """Read a file of answers: JSON lines, or CSV by its ending, or a folder of CSV files.

    Raises:
        BadInput: in one line, with the place.
    """
    try:
        if path.is_dir():
            files = sorted(path.glob("*.csv"))
            return _of_tables(files, path)
        if path.stat().st_size > MAX_SIZE:
            raise BadInput(f"answers {str(path)!r}: larger than {MAX_SIZE} bytes")
        return _of_tables([path], path) if path.suffix == ".csv" else _of_lines(path)
    except OSError as error:
        raise BadInput(f"answers {str(path)!r} cannot be read: {error.strerror}") from None


def _key(sheet: Sheet) -> bytes:
    return msgspec.json.encode(Key(sheet.level, sheet.seed, vectors.manifest().digest, tuple(sheet.fresh)))


def _scene_lines(scene: Mapping[str, Any]) -> Iterator[str]:
    """Yield a scene as lines of words: # law kind field place number."""
    yield f"# table {scene['table']}\n"
    for name, law in scene.items():
        if name in ("table", "name", "notes"):
            continue
        if not isinstance(law, Mapping):
            yield f"# {name} constant value 1 {float(law)!r}\n"
            continue
        for field, value in law.items():
            if field == "kind":
                continue
            columns = {"time": 0, "value": 1} if field == "knots" else {field: None}
            for label, column in columns.items():
                numbers = value if isinstance(value, list | tuple) else [value]
                for place, one in enumerate(numbers, 1):
                    number = one if column is None else one[column]
                    yield f"# {name} {law['kind']} {label} {place} {float(number)!r}\n"


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
        if not line.strip():
            continue
        place = f"answers {str(path)!r}:{number}"
        seq = SEQ.search(line)
        if seq is None:
            try:
                data = json.loads(line)
            except (*UNREADABLE, ValueError):
                raise BadInput(
                    f"{place}: no JSON, and no seq: {clean(line[:60].decode('utf-8', 'replace'))}"
                ) from None
            if not isinstance(data, dict) or not data.keys() & {"protocol", "values"}:
                raise BadInput(f"{place}: has no seq, must have that of its question")
            introduction = line if "protocol" in data else introduction
            echoes += [line] if "values" in data else []
            continue
        _once(places, int(seq[1]), place)
        found[int(seq[1])] = line
    return _some(Answers(str(path), found, introduction, tuple(echoes), places))


def _once(places: dict[int, str], seq: int, place: str) -> None:
    if seq in places:
        raise BadInput(f"{place}: seq = {seq} is answered twice, first at {places[seq].rpartition(':')[2]}")
    places[seq] = place


def _some(answers: Answers) -> Answers:
    if not answers.lines:
        raise BadInput(f"answers {answers.source!r}: holds no answer")
    return answers


def _of_tables(files: Sequence[Path], source: Path) -> Answers:
    rows: dict[int, list[dict[str, Any]]] = {}
    places: dict[int, str] = {}
    for path in files:
        last, label = None, f"answers {str(path)!r}"
        for place, cells in read_rows(path, label, NEEDED, (*NEEDED, *OPTIONAL)):
            seq = _whole(place, cells["seq"])
            if seq != last:
                _once(places, seq, place)
            rows.setdefault(seq, []).append(_outcome(place, cells))
            last = seq
    lines = {seq: msgspec.json.encode(parts) for seq, parts in rows.items()}
    return _some(Answers(str(source), lines, None, (), places))


def read_rows(
    path: Path, label: str, needed: Sequence[str], known: Sequence[str] | None = None
) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the rows of a CSV file by the names of its columns, each with its place; # begins a comment.

    Args:
        path: of the file.
        label: what messages begin with.
        needed: columns that must be there.
        known: columns that there may be; None for any.

    Raises:
        BadInput: naming the column, or the place.
    """
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        rows = (row for row in reader if any(map(str.strip, row)) and not row[0].startswith("#"))
        try:
            names = [name.strip() for name in next(rows, [])]
            lacking = [name for name in needed if name not in names]
            twice = [name for i, name in enumerate(names) if name in names[:i]]
            unknown = [name for name in names if known and name not in known]
            for fault, found in (("is missing", lacking), ("stands twice", twice), ("is unknown", unknown)):
                if found:
                    which = f"; columns are {', '.join(known)}" if known else ""
                    raise BadInput(f"{label}: column {shown(found[0])} {fault}{which}")
            for row in rows:
                place = f"{label}:{reader.line_num}"
                if len(row) != len(names):
                    raise BadInput(f"{place}: {len(row)} cells, must be {len(names)} as in the first row")
                yield place, dict(zip(names, map(str.strip, row), strict=True))
        except (csv.Error, UnicodeDecodeError) as error:
            why = error if isinstance(error, csv.Error) else "it is no UTF-8"
            raise BadInput(f"{label}:{reader.line_num}: {why}") from None


def _outcome(place: str, cells: Mapping[str, str]) -> dict[str, Any]:
    """Return a row as an outcome of protocol 1; what it does not hold is left out."""
    found: dict[str, Any] = {"outcome": cells["outcome"], "reason": cells.get("reason", "")}
    found |= {"wall": cells["wall"]} if cells.get("wall") else {}
    for name in (*STATE, "dt"):
        if cells.get(name):
            found[name] = read_number(place, name, cells[name])
    if cells["outcome"] == "horizon" and ("t_in" in cells or "t_out" in cells):
        ends = [read_number(place, n, cells[n]) for n in ("t_in", "t_out") if cells.get(n)]
        found["captured"] = ends or None
    return found


def read_number(place: str, name: str, text: str) -> float:
    """Return a number written in decimal, with Fortran's D, or hexadecimal with p.

    Raises:
        BadInput: it is none, or not finite.
    """
    try:
        word = text.lower()
        number = float.fromhex(word) if "0x" in word else float(word.replace("d", "e"))
    except (ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise BadInput(f"{place}: {name} = {shown(text)}, must be a finite number, decimal or as 0x1.8p+3")
    return number


def _whole(place: str, text: str) -> int:
    number = read_number(place, "seq", text)
    if number != int(number):
        raise BadInput(f"{place}: seq = {shown(text)}, must be a whole number")
    return int(number)
