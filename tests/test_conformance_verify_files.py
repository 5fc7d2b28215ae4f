"""The verifier as a program: what it reads, what it refuses, what it prints, and how it ends."""

import ast
import io
import json
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.forged_claims import CORPUS, lines, plain

from conformance import verify

CAP: dict[str, Any] = {"table": "cap", "r": 1.0}
DOWN = {"t": 0, "x": 0, "y": 0.5, "vx": 0, "vy": -1.0}
NULL = ["0", "0"]
STEP = {"wall": "base", "dt": ["0.5", "0.5"], "x": NULL, "y": NULL, "vx": NULL, "vy": ["1", "1"]}
LINE: dict[str, Any] = {
    "id": "a/1", "kind": "step", "scene": CAP, "state": DOWN, "t_end": 9.0,
    "expect": [{"outcome": "collision", "steps": [STEP]}],
}  # fmt: skip
FALSE = {**LINE, "t_end": 0.25}
# At a third of a period the cosine is -1/2, which no precision shows: on the left side, and below the floor.
SWELLING = {"kind": "fourier", "mean": 1.0, "period": 1.5, "cos": [0.25]}
REFUSED = {
    **LINE, "scene": {"table": "stem", "w": SWELLING, "h": 1.0}, "expect": [{"outcome": "rejected"}],
    "state": {**DOWN, "t": 0.5, "x": -0.875, "y": -2.0},
}  # fmt: skip
WIDE = {**LINE, "expect": [{"outcome": "collision", "steps": [{**STEP, "dt": ["0.4", "0.6"]}]}]}
TEXT, TRUE = json.dumps(LINE), "1 of 1 proved"
FILES: dict[str, tuple[str, int, str]] = {
    "true": (TEXT, 0, TRUE),
    "false": (json.dumps(FALSE), 1, "a/1: false: the answer is horizon"),
    "no flow": (json.dumps({**LINE, "kind": "flow"}), 1, "a/1: false: the path has 1 steps, or goes on"),
    "nested": ("[" * 100_000, 2, "lines.jsonl:1: nested too deeply"),
    "no line": (TEXT + "\n{}", 2, "unreadable after 1 claims: "),
    "its number": (f"{TEXT}\n\n{TEXT}\n{{}}", 2, "lines.jsonl:4: "),
    "a line cut": (f"{TEXT}\n{TEXT[:90]}", 2, "lines.jsonl:2: "),
    "no object": ("5", 2, "lines.jsonl:1: id must be given, as a str"),
    "a brace": ("{", 2, "lines.jsonl:1: Expecting property name"),
    "a line end of Unicode": (json.dumps({**LINE, "rule": "a\u2028b"}, ensure_ascii=False), 0, TRUE),
    "a key twice": (TEXT[:-1] + ', "id": "a/2"}', 2, "a key comes twice"),
    "digits": (TEXT.replace('"r": 1.0', f'"r": {"9" * 5000}'), 2, "lines.jsonl:1: Exceeds the limit"),
    "too many": (
        json.dumps({**LINE, "collisions": 999_999, "expect": [{"outcome": "collision"}]}),
        2,
        "kind or",
    ),
    "refused": (json.dumps(REFUSED), 0, TRUE),
    "no kind": (json.dumps({**LINE, "kind": "jump"}), 2, "kind or collisions are none"),
    "no step": (
        json.dumps({**LINE, "expect": [{"outcome": "collision", "steps": [5]}]}),
        2,
        "step must be an object",
    ),
    "nothing": ("", 2, "there is nothing to verify in this file"),
    "blank lines": ("\n \n\n", 2, "there is nothing to verify in this file"),
    "blank lines between": (f"\n{TEXT}\n\n", 0, TRUE),
    "wide": (json.dumps(WIDE), 0, TRUE),
}


def judge_text(options: list[str], text: str, tmp_path: Path, capsys: Any) -> tuple[int, str, str]:
    """Return exit code, standard output and standard error for a file."""
    path = tmp_path / "lines.jsonl"
    path.write_text(text, "utf-8")
    code = verify.main([*options, str(path)])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize("row", FILES.values(), ids=FILES)
def test_a_file_is_judged(row, tmp_path, capsys):
    text, code, word = row
    found, out, err = judge_text([], text, tmp_path, capsys)
    assert found == code
    assert word in (err if code == 2 else out)
    assert err.count("\n") == (code == 2)


def test_an_empty_file_among_others_is_an_error(tmp_path, capsys):
    (tmp_path / "a.jsonl").write_text(TEXT)
    (tmp_path / "b.jsonl").write_text("")
    assert verify.main([str(tmp_path / name) for name in ("a.jsonl", "b.jsonl")]) == 2
    out, err = capsys.readouterr()
    assert (out, "b.jsonl: there is nothing" in err) == ("", True)


def test_bytes_that_are_no_utf8_have_a_line_number(tmp_path, capsys):
    (tmp_path / "a.jsonl").write_bytes(TEXT.encode() + b"\n\xff{}\n")
    assert verify.main([str(tmp_path / "a.jsonl")]) == 2
    assert "a.jsonl:2: byte 1 is no UTF-8" in capsys.readouterr()[1]


# An id that would print a line of its own, move the cursor, hide what stands before, or print nothing at all.
NAMES = {
    "a line of its own": ("x\n2563 of 2563 proved", "x\\n2563 of 2563 proved"),
    "a carriage return": ("x\r2563 of 2563 proved", "x\\r2563"),
    "an escape of a terminal": ("\x1b[2J\x1b[1;1Hproved", "\\x1b[2J"),
    "one of eight bits": ("\x9b2Jproved", "\\x9b2J"),
    "backspaces": ("\x08\x08\x08proved", "\\x08"),
    "from right to left": ("\u202edevorp", "\\u202e"),
    "a line end of Unicode": ("a\u2028b", "\\u2028"),
    "a lone surrogate": ("a\ud800b", "a\\ud800b"),
    "words": ("1 of 1 proved", '"1 of 1 proved"'),
    "letters": ("müller/1", '"müller/1"'),
}


@pytest.mark.parametrize("row", NAMES.values(), ids=NAMES)
def test_an_id_cannot_print_what_was_not_found(row, tmp_path, capsys):
    name, printed = row
    text = "\n".join(json.dumps({**line, "id": name}) for line in (LINE, FALSE))
    code, out, err = judge_text([], text, tmp_path, capsys)
    first, last = out.split("\n")[:-1]
    assert (code, err, last) == (1, "", "1 of 2 proved")
    assert "lines.jsonl:2: " in first
    assert printed in first
    assert first.isprintable()


def test_the_name_of_a_field_and_of_a_file_are_escaped(tmp_path, capsys):
    code, out, err = judge_text([], json.dumps({**LINE, "x\ny": 1}), tmp_path, capsys)
    assert (code, out, err.count("\n"), "x\\ny" in err) == (2, "", 1, True)
    path = tmp_path / "a\nb.jsonl"
    path.write_text(json.dumps(FALSE))
    assert verify.main([str(path)]) == 1
    assert "a\\nb.jsonl:1: a/1: false" in capsys.readouterr()[0]


FORMS = {
    "line": (["colisions"], "line has an unknown field colisions"),
    "answer": (["expect", 0, "captured"], "an unknown field captured"),
    "step": (["expect", 0, "steps", 0, "t"], "step has an unknown field t"),
    "outcome of a step": (["expect", 0, "steps", 0, "outcome"], "step has an unknown field outcome"),
    "stays of a step": (["expect", 0, "steps", 0, "stays"], "step has an unknown field stays"),
    "further answer": (["expect", 1], "answer has an unknown field value"),
    "type of a field": (["condition"], "line has a field condition of another type"),
    "type in a step": (["expect", 0, "steps", 0, "allowance"], "step has a field allowance of another type"),
}


@pytest.mark.parametrize("row", FORMS.values(), ids=FORMS)
def test_a_field_that_a_line_does_not_have_is_refused_by_name(row, tmp_path, capsys):
    """A reader of the line may take the field for proved."""
    (*path, name), words = row
    record = json.loads(TEXT)
    part: Any = record
    for key in path:
        part = part[key]
    if isinstance(part, list):
        part.append({"outcome": "rejected", "value": 1})
    else:
        part[name] = "value"
    code, out, err = judge_text([], json.dumps(record), tmp_path, capsys)
    assert (code, out) == (2, "")
    assert words in err


@pytest.mark.parametrize("allowance", [[1.0] * 4, [1.0] * 4 + ["1"], [1.0] * 4 + [True]])
def test_an_allowance_is_five_numbers(allowance):
    record = json.loads(TEXT)
    record["expect"][0]["steps"][0]["allowance"] = allowance
    with pytest.raises(verify.Unreadable, match="five numbers"):
        verify.verify_line(record)


def test_enclosures_can_be_asked_to_be_narrow(tmp_path, capsys):
    for record, digits, words in (
        (WIDE, 1, "a/1: not proved: step 1: the enclosure of dt is not narrow to 1 digits"),
        (LINE, 300, TRUE),
    ):
        code, out, _ = judge_text(["--digits", str(digits)], json.dumps(record), tmp_path, capsys)
        assert (code, words in out) == (int(record is WIDE), True)


def test_the_corpus_is_narrow_to_17_digits():
    for line in lines():
        verify.require_narrow(line, 17)


def test_the_width_is_that_of_the_larger_end():
    record = plain(LINE)
    record["expect"][0]["steps"][0]["dt"] = ["0.5", "0.50005"]
    assert verify.verify_line(record, 4).status == "proved"
    record["expect"][0]["steps"][0]["dt"] = ["0.4999", "0.5"]
    assert verify.verify_line(record, 4).status == "not proved"
    record["expect"][0]["steps"][0]["x"] = ["-1E-300", "1E-300"]
    assert verify.verify_line(record, 1).status == "not proved"


def test_the_answer_that_must_be_narrow_is_the_proved_one():
    """A refusal may stand before it."""
    late = {**LINE, "state": {**DOWN, "t": 2.0**30}, "t_end": 2.0**30 + 9}
    for first, second in ((0, 1), (1, 0)):
        answers = [WIDE["expect"][0], {"outcome": "rejected"}]
        record = {**late, "expect": [answers[first], answers[second]]}
        assert verify.verify_line(record).status == "proved"
        assert verify.verify_line(record, 1).status == "not proved"


OPTIONS = {
    "none": ([], "required: FILE"),
    "unknown": (["--answer", "a"], "--answer"),
    "no number": (["--digits", "x", "a"], "'x' must be from 1 to 1000"),
    "too many digits": (["--digits", "1001", "a"], "must be from 1 to 1000"),
    "a bound that is none": (["--answers", "--within", "nan", "a"], "'nan' must be"),
    "for answers": (["--within", "4", "a"], "'--within'] goes with --answers"),
    "all, for answers": (["--all", "a"], "'--all'] goes with --answers"),
    "for proofs": (["--answers", "--digits", "4", "a"], "--digits is for proofs only"),
    "no file": (["nowhere.jsonl"], "nowhere.jsonl: No such file"),
    "a folder": ([str(CORPUS)], "Is a directory" if os.name == "posix" else "ermission"),
}


@pytest.mark.parametrize("row", OPTIONS.values(), ids=OPTIONS)
def test_a_wrong_command_is_one_line(row, capsys):
    arguments, words = row
    assert verify.main(arguments) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), words in err) == ("", 1, True)


@pytest.mark.parametrize("option", ["-h", "--help"])
def test_help_is_help(option, capsys):
    assert verify.main([option]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for word in ("--answers", "--digits", "--within", "--all", "--scene", "--t-end", "Exit code"):
        assert word in out


def run(*arguments: object, **streams: Any) -> "subprocess.CompletedProcess[bytes]":
    """Run the verifier as users do, with nothing of this project on its path."""
    command = [sys.executable, "-I", verify.__file__, *map(str, arguments)]
    return subprocess.run(command, timeout=100, **streams)


def test_the_file_runs_alone():
    done = run(CORPUS / "bend-nu-rate-fourier.jsonl", capture_output=True)
    assert (done.returncode, done.stderr, b" proved" in done.stdout) == (0, b"", True)


def test_a_dash_is_the_standard_input():
    done = run("-", capture_output=True, input=json.dumps(FALSE).encode())
    assert done.returncode == 1
    assert done.stdout.startswith(b"-:1: a/1: false")


def test_a_name_that_the_output_cannot_hold_is_printed(tmp_path):
    path = tmp_path / "a.jsonl"
    path.write_text(json.dumps({**FALSE, "id": "müller"}))
    command = [sys.executable, verify.__file__, str(path)]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, capture_output=True, timeout=100, env=environment)
    assert (done.returncode, b"m\\xfcller" in done.stdout) == (1, True)


@pytest.mark.skipif(os.name != "posix", reason="pipes and signals as on Unix")
def test_a_reader_that_goes_away_is_no_error():
    reader, writer = os.pipe()
    os.close(reader)
    done = run("-", input=TEXT.encode(), stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
def test_a_full_disk_is_one_line():
    with Path("/dev/full").open("wb") as full:
        done = run("-", input=TEXT.encode(), stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 2
    assert done.stderr.startswith(b"verify.py: cannot write the result: ")
    assert done.stderr.count(b"\n") == 1


@pytest.mark.skipif(os.name != "posix", reason="signals as on Unix")
def test_an_interrupt_is_one_line():
    command = [sys.executable, "-I", "-u", verify.__file__, "-"]
    pipe = subprocess.PIPE
    # A shell lets its background jobs ignore the signal, and those hand that on.
    hear = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, preexec_fn=hear) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(FALSE).encode() + b"\n" * 2**16)
        process.stdin.flush()
        assert b"false" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=100) == 130
        assert process.stderr is not None
        assert process.stderr.read() == b"verify.py: interrupted after 1 claims\n"


SOURCE = Path(verify.__file__).read_text("utf-8")


def test_an_old_python_is_told(monkeypatch):
    """It must parse the file to come to the guard, and run nothing before it but imports."""
    tree = ast.parse(SOURCE, feature_version=(3, 7))
    guard = next(place for place, node in enumerate(tree.body) if isinstance(node, ast.If))
    _, *before = tree.body[:guard]
    assert all(isinstance(node, ast.Import | ast.ImportFrom) for node in before)
    assert "__future__" not in {node.module for node in before if isinstance(node, ast.ImportFrom)}
    assert not any(isinstance(node, ast.NamedExpr | ast.Match) for node in ast.walk(tree))
    words = io.StringIO()
    monkeypatch.setattr(sys, "stderr", words)
    monkeypatch.setattr(sys, "version_info", (3, 6, 15))
    with pytest.raises(SystemExit) as stop:
        exec(compile(SOURCE, "verify.py", "exec"), dict(vars(SimpleNamespace(__name__="__main__"))))
    assert stop.value.code == 2
    assert words.getvalue() == "verify.py needs Python 3.10 or later\n"
