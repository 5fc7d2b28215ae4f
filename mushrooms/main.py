"""The command line: what runs a command, and the exit code and the line in which it ends.

Bad input of any kind is one line on stderr and exit code 2.
"""

import errno
import io
import os
import signal
import sys
import threading
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from itertools import pairwise
from typing import IO, Any, NoReturn

import typer

from mushrooms import environment
from mushrooms.commands import app

PROGRAM = "mushrooms"
# Typer 0.26 carries a click of its own, older ones import it: this is the error class of the one in use.
UsageError: type[Any] = typer.BadParameter.__bases__[0]
REFUSED, INTERRUPTED = 2, 130
HELP = {"--help", "--version"}  # they import no library that reads the environment
# What ends a command through no fault of its input, in words.
ENDS: dict[type[Exception], str] = {
    EOFError: "a file or stream ended too soon",
    BrokenExecutor: "a process of this run was ended from outside",
    MemoryError: "not enough memory",
    RecursionError: "nested too deeply",
}


def run(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit: 0 done, 1 a claim failed, 2 bad input, 130 interrupted."""
    _make_printable()
    try:
        _call(sys.argv[1:] if arguments is None else arguments)
    finally:
        for stream in (sys.stdout, sys.stderr):
            _let_go(stream)


def _call(given: list[str]) -> NoReturn:
    """Run a command, not by typer's `main`, which calls a file that ends too soon an interruption."""
    try:
        _end_as_by_keyboard()
        _refuse_empty(given)
        if not HELP.intersection(given):
            _check_environment()
        try:
            with typer.main.get_command(app).make_context(PROGRAM, list(given)) as context:
                code = context.command.invoke(context)
        except typer.Exit as stop:  # of --help and --version, too
            code = stop.exit_code
        sys.stdout.flush()
    except KeyboardInterrupt as error:
        code = _tell(INTERRUPTED, "interrupted", error)
    except BrokenPipeError:
        code = 1  # the reader has gone: nothing to say
    except UsageError as error:
        code = _tell(REFUSED, error.format_message())
    except OSError as error:
        code = _tell(REFUSED, _format_error(error), error)
    except tuple(ENDS) as error:
        what = next(words for kind, words in ENDS.items() if isinstance(error, kind))
        code = _tell(REFUSED, f"{what}: {error}".removesuffix(": "))
    except ValueError as error:
        from scene.refusal import BadInput  # not above: the list of commands needs no scene

        refused = str(error) if isinstance(error, BadInput) else environment.name_backend(error)
        if refused is None:
            raise
        code = _tell(REFUSED, refused)
    except (ImportError, SystemError) as error:
        # A compiled module that is loaded when an interrupt comes says that it failed.
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, KeyboardInterrupt):
            cause = cause.__cause__ or cause.__context__
        if cause is None:
            raise
        code = _tell(INTERRUPTED, "interrupted", cause)
    sys.exit(code or 0)


def _end_as_by_keyboard() -> None:
    """Let SIGTERM and a terminal that closes do what Ctrl-C does, so that half-written files are removed.

    A batch system ends its jobs so. A signal that is ignored (`nohup`) stays ignored.
    """
    if threading.current_thread() is threading.main_thread():  # no other thread may
        for number in (getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)):
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)


def _refuse_empty(given: list[str]) -> None:
    """Refuse an option or an argument of no text: for a path it would mean the folder that one is in."""
    for before, word in pairwise(["", *given]):
        if word == "--":
            return
        if not word.strip() or (word.startswith("--") and word.endswith("=")):
            name = next((option for option in (word, before) if option.startswith("--")), "an argument")
            raise UsageError(f"{name.rstrip('=')} is empty, must have a value")


def _check_environment() -> None:
    """Refuse a variable of the environment before a library that reads it is imported."""
    what = environment.bad_variable()
    if what is not None:
        raise UsageError(what)


def _tell(code: int, message: str, error: BaseException | None = None) -> int:
    """Say on stderr in one line how a command ends, with the notes of the error; return the exit code."""
    text = "; ".join([message, *getattr(error, "__notes__", [])])
    with suppress(OSError):  # standard error may be full, or its terminal gone: the exit code still tells
        print(f"{PROGRAM}: {' '.join(text.split())}", file=sys.stderr, flush=True)
    return code


def _format_error(error: OSError) -> str:
    """Return what the system refused; of a file it gives the name (`conformance.files` sees to that)."""
    if error.filename is None and error.errno in (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EDQUOT):
        return f"standard output cannot be written: {error.strerror}"
    return str(error) if error.filename is None else f"{os.fsdecode(error.filename)!r}: {error.strerror}"


def _make_printable() -> None:
    """See to it that nothing fails for want of a place to print it, or of a letter.

    Work is done before its result is printed: it must not be lost there. What was closed takes everything and
    keeps nothing, and no file that a command opens becomes its standard output. A letter that the encoding
    lacks is printed by its number.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 (till the end)
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in ("strict", "surrogateescape"):
        sys.stdout.reconfigure(errors="backslashreplace")


def _let_go(stream: IO[str]) -> None:
    """Leave nothing for the interpreter to flush at its end: what fails there makes every exit code 120."""
    try:
        stream.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):  # a stream that is no file of the system's
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
