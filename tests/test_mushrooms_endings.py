"""How a command ends: exit code and words, whatever ends it; signals and streams are left as they should be.

What a command does is replaced by what ends it.
"""

import errno
import io
import os
import signal
import sys
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from typing import Any

import pytest

from mushrooms import main, scenes as listing
from scene import BadInput


def ended(
    monkeypatch: pytest.MonkeyPatch, command_line: Callable[..., Any], work: Callable[[], object]
) -> tuple[object, str, str]:
    """Return the exit code of a command that does some work, and what it prints."""
    monkeypatch.setattr(listing, "print_scenes", lambda *_: work())
    return command_line("scenes")


def failing(error: BaseException) -> Callable[[], object]:
    def fail() -> None:
        raise error

    return fail


def caused(error: Exception, cause: BaseException, how: str) -> Exception:
    setattr(error, how, cause)
    return error


FULL = errno.ENOSPC, os.strerror(errno.ENOSPC)


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (BrokenPipeError(), 1, ""),
        (EOFError(), 2, "a file or stream ended too soon"),
        (BrokenExecutor("gone"), 2, "a process of this run was ended from outside: gone"),
        (MemoryError(), 2, "not enough memory"),
        (RecursionError("deep"), 2, "nested too deeply: deep"),
        (OSError(*FULL), 2, f"standard output cannot be written: {FULL[1]}"),
        (OSError(*FULL, "a.svg"), 2, f"'a.svg': {FULL[1]}"),
        (OSError(errno.ENOENT, "gone"), 2, "[Errno 2] gone"),
        (BadInput("x = 1, must be 2"), 2, "x = 1, must be 2"),
        (caused(ImportError("it failed"), KeyboardInterrupt(), "__cause__"), 130, "interrupted"),
        (caused(SystemError("it failed"), KeyboardInterrupt(), "__context__"), 130, "interrupted"),
    ],
)
def test_every_end_has_its_code_and_its_words(monkeypatch, command_line, error, code, words):
    said = f"mushrooms: {words}\n" if words else ""
    assert ended(monkeypatch, command_line, failing(error)) == (code, "", said)


@pytest.mark.parametrize("error", [ImportError("no module"), SystemError("bad"), ValueError("ours")])
def test_a_mistake_of_ours_is_no_line(monkeypatch, command_line, error):
    with pytest.raises(type(error), match=str(error)):
        ended(monkeypatch, command_line, failing(error))


def test_notes_of_an_error_are_told_in_its_line(monkeypatch, command_line):
    error = KeyboardInterrupt()
    error.add_note("half of it\nis kept")
    said = "mushrooms: interrupted; half of it is kept\n"
    assert ended(monkeypatch, command_line, failing(error)) == (130, "", said)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize(("is_ignored", "code"), [(True, 0), (False, 130)])
def test_a_signal_that_is_ignored_stays_ignored(monkeypatch, command_line, name, is_ignored, code):
    """`nohup` ignores the terminal that closes; others end as by the keyboard. Then all is as before."""
    number = getattr(signal, name)
    usual = signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL
    before = signal.signal(number, signal.SIG_IGN if is_ignored else usual)
    heard = signal.getsignal(number)
    try:
        ends = ended(monkeypatch, command_line, lambda: (os.kill(os.getpid(), number), time.sleep(0.01)))
        assert ends == (code, "", "mushrooms: interrupted\n" if code else "")
        assert signal.getsignal(number) is heard
    finally:
        signal.signal(number, before)


def test_closed_streams_take_everything(monkeypatch):
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, None)
    read = []

    def work(*_: object) -> None:
        read.append(sys.stdin.read())
        print("lost \ud800")
        print("lost \ud800", file=sys.stderr)

    monkeypatch.setattr(listing, "print_scenes", work)
    with pytest.raises(SystemExit) as stop:
        main.run(["scenes"])
    assert (stop.value.code, read) == (0, [""])
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        stream.close()


def test_a_letter_that_the_encoding_lacks_is_printed_by_its_number(monkeypatch):
    """A byte of a path that is no letter is printed as it is."""
    inner = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(inner, encoding="ascii"))
    monkeypatch.setattr(listing, "print_scenes", lambda *_: print("a\u03bd\u03bdb \udc80\udcff"))
    with pytest.raises(SystemExit):
        main.run(["scenes"])
    assert inner.getvalue() == b"a\\u03bd\\u03bdb \x80\xff\n"


def test_a_stream_that_fails_is_let_go(monkeypatch, tmp_path):
    """What cannot be flushed any more must not be tried again by the interpreter."""
    reader, writer = os.pipe()
    monkeypatch.setattr(sys, "stdout", os.fdopen(writer, "w"))
    monkeypatch.setattr(sys, "stderr", (tmp_path / "closed").open("w"))
    os.close(reader)

    def work(*_: object) -> None:
        print("x")
        sys.stderr.close()

    monkeypatch.setattr(listing, "print_scenes", work)
    with pytest.raises(SystemExit) as stop:
        main.run(["scenes"])
    assert stop.value.code == 1
    sys.stdout.close()  # now it goes to the null device
