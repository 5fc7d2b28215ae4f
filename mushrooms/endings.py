"""How a command ends: the exit code and the line.

Bad input of any kind is one line on stderr and exit code 2. What `mushrooms check` finds has its
code from `conformance.suite.result`.
"""

import codecs
import errno
import io
import os
import re
import sys
import warnings
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from itertools import pairwise
from typing import IO, Any

import typer

from mushrooms import environment
from mushrooms.commands import app
from mushrooms.interrupts import INTERRUPTED, PROGRAM, Listener

# Typer 0.26 carries a click of its own, older ones import it: this is the error class of the one in
# use.
UsageError: type[Any] = typer.BadParameter.__bases__[0]
REFUSED = 2
HELP = {"--help", "--version"}  # they import no library that reads the environment
# What ends a command through no fault of its input, in words.
ENDS: dict[type[Exception], str] = {
    EOFError: "a file or stream ended too soon",
    BrokenExecutor: "a process of this run was ended from outside",
    MemoryError: "not enough memory",
    RecursionError: "nested too deeply",
}
# Libraries that read the environment when they are imported, and how the names of their variables
# begin.
CONFIGURED_BY = {
    "numba": "NUMBA_",
    "llvmlite": "LLVMLITE_",
    "matplotlib": "MPL",
    "numpy": "NPY_",
    "zarr": "ZARR_",
}
AS_GIVEN = "mushrooms.as_given"  # what to do with a letter that cannot be encoded
QUOTED = re.compile(r"""'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*\"""")
LOST_BYTE = re.compile(r"\\udc([89a-f][0-9a-f])")


def call(given: list[str], listener: Listener) -> int:
    """Run a command; return the exit code, and tell the listener that the command has ended."""
    _make_printable()
    format_before = warnings.formatwarning
    warnings.formatwarning = _format_warning  # type: ignore[assignment]  # it needs no place
    try:
        code = _end_of(given, listener)
        listener.end(code)
    finally:
        warnings.formatwarning = format_before
        for stream in (sys.stdout, sys.stderr):
            _let_go(stream)
    return code


def _end_of(given: list[str], listener: Listener) -> int:
    """Run a command and say how it ended; whatever ends it after a signal, it was interrupted."""
    try:
        code = _invoke(given)
    except (KeyboardInterrupt, Exception) as error:
        if listener.has_heard or _is_made_of_an_interrupt(error):
            listener.end(INTERRUPTED)
            return _tell(INTERRUPTED, "interrupted", error)
        return _refuse(error)
    return _tell(INTERRUPTED, "interrupted") if listener.has_heard else code


def _invoke(given: list[str]) -> int:
    """Run a command, but not by typer's `main`.

    That one calls a file that ends too soon an interruption.
    """
    _refuse_empty(given)
    if not HELP.intersection(given):
        _check_environment()
    try:
        with typer.main.get_command(app).make_context(PROGRAM, list(given)) as context:
            code = context.command.invoke(context)
    except typer.Exit as stop:  # of --help and --version, too
        code = stop.exit_code
    sys.stdout.flush()
    return code or 0


def _check_environment() -> None:
    """Refuse a variable of the environment before a library that reads it is imported."""
    what = environment.bad_variable()
    if what is not None:
        raise UsageError(what)


def _is_made_of_an_interrupt(error: BaseException | None) -> bool:
    """Tell whether an error was made of an interrupt, as by a module that was being loaded."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _refuse(error: BaseException) -> int:
    """Say what was wrong with the input, or with the machine.

    Raise the error if it is our own fault.
    """
    if isinstance(error, BrokenPipeError):
        return 1  # the reader has gone: nothing to say
    if isinstance(error, UsageError):
        return _tell(REFUSED, error.format_message())
    if isinstance(error, OSError):
        return _tell(REFUSED, _format_error(error), error)
    for kind, words in ENDS.items():
        if isinstance(error, kind):
            return _tell(REFUSED, f"{words}: {error}".removesuffix(": "))
    from scene.refusal import BadInput  # not above: the list of commands needs no scene

    if isinstance(error, BadInput):
        return _tell(REFUSED, str(error))
    variables = _variables_behind(error)
    if variables:
        return _tell(REFUSED, f"environment variable {' or '.join(variables)}: {error}")
    raise error


def _variables_behind(error: BaseException) -> list[str]:
    """Return the variables that configure a library, if it fails while it is imported.

    Their values stand beside them.
    """
    being_imported = set[str]()
    library = ""
    at = error.__traceback__
    while at is not None:
        library = str(at.tb_frame.f_globals.get("__name__")).partition(".")[0]
        if at.tb_frame.f_code.co_name == "<module>":
            being_imported.add(library)
        at = at.tb_next
    prefix = CONFIGURED_BY.get(library)
    if prefix is None or library not in being_imported:
        return []
    return [
        f"{name} = {value!r}"
        for name, value in sorted(os.environ.items())
        if name.startswith(prefix)
    ]


def _format_warning(message: Warning | str, *_place: object) -> str:
    """Return a warning of a library in one line, the first of it."""
    return f"{PROGRAM}: warning: {str(message).strip().partition(chr(10))[0]}\n"


def _refuse_empty(given: list[str]) -> None:
    """Refuse an option or an argument of no text.

    As a path it would mean the current folder.
    """
    for before, word in pairwise(["", *given]):
        if word == "--":
            return
        if not word.strip() or (word.startswith("--") and word.endswith("=")):
            name = next(
                (option for option in (word, before) if option.startswith("--")), "an argument"
            )
            raise UsageError(f"{name.rstrip('=')} is empty, must have a value")


def _tell(code: int, message: str, error: BaseException | None = None) -> int:
    """Say on stderr in one line how a command ends, with the notes of the error.

    Return the exit code.
    """
    text = "; ".join([message, *getattr(error, "__notes__", [])])
    with suppress(
        OSError
    ):  # standard error may be full, or its terminal gone: the exit code still tells
        print(
            f"{PROGRAM}: {_quote_for_shells(' '.join(text.split()))}", file=sys.stderr, flush=True
        )
    return code


def _format_error(error: OSError) -> str:
    """Return what the system refused.

    Of a file it gives the name (`scene.files.writer` sees to that).
    """
    if error.filename is None and error.errno in (
        errno.ENOSPC,
        errno.EIO,
        errno.EBADF,
        errno.EDQUOT,
    ):
        return f"standard output cannot be written: {error.strerror}"
    return (
        str(error)
        if error.filename is None
        else f"{os.fsdecode(error.filename)!r}: {error.strerror}"
    )


def _make_printable() -> None:
    """See to it that nothing fails for want of a place to print it, or of a letter.

    Work is done before its result is printed: it must not be lost there. What was closed takes
    everything and keeps nothing, and no file that a command opens becomes its standard output. A
    letter that the encoding lacks is printed by its number.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    codecs.register_error(AS_GIVEN, _encode_as_given)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=AS_GIVEN)


def _encode_as_given(error: UnicodeError) -> tuple[bytes | str, int]:
    """Print a byte of a path that is no letter as the byte it is.

    Another letter that lacks by its number.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letter = error.object[error.start]
    if "\udc80" <= letter <= "\udcff":
        return bytes([ord(letter) - 0xDC00]), error.start + 1
    return letter.encode("ascii", "backslashreplace").decode(), error.start + 1


def _quote_for_shells(text: str) -> str:
    """Write quoted paths as shells read them, if they hold bytes that are no letters.

    They then begin with a dollar sign.
    """

    def quote(found: re.Match[str]) -> str:
        word = found[0][1:-1]
        if LOST_BYTE.search(word) is None:
            return found[0]
        inside = word.replace("'", r"\'") if found[0].startswith('"') else word
        return "$'" + LOST_BYTE.sub(r"\\x\1", inside) + "'"

    return QUOTED.sub(quote, text)


def _let_go(stream: IO[str]) -> None:
    """Leave nothing for the interpreter to flush at its end.

    What fails there makes every exit code 120.
    """
    try:
        stream.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):  # a stream that is no file of the system's
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
