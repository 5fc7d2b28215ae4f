"""The command line. Bad input of any kind is one line on stderr and exit code 2.

A command's module is imported when the command is used: the list of commands needs none of them.
"""

from __future__ import annotations

import errno
import io
import math
import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from decimal import Decimal, InvalidOperation
from importlib import import_module
from itertools import pairwise
from typing import IO, Annotated, Any, NamedTuple, NoReturn, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup
from typer.models import OptionInfo

PROGRAM = "mushrooms"
# Typer 0.26 carries a click of its own, older ones import it: this is the error class of the one in use.
UsageError: type[Any] = typer.BadParameter.__bases__[0]


INTERRUPTED = 130
MOST = Decimal(10) ** 30  # of a whole number on the command line, written with an exponent
NOTHING_KEPT = "nothing was written: files are written at the end"


class Listed(NamedTuple):
    """A command: where its function is, what the list says of it, an example, and what Ctrl-C leaves."""

    function: str
    summary: str
    example: str
    kept: str = NOTHING_KEPT


COMMANDS = {
    "scenes": Listed(
        "mushrooms.catalogue:list_scenes",
        "List the catalogue, or print a scene of it.",
        "moving-cap --toml > mine.toml",
    ),
    "theory": Listed(
        "mushrooms.predict:predict", "Print the paper's predictions for one cycle.", "moving-cap --digits 40"
    ),
    "draw": Listed(
        "mushrooms.draw:draw",
        "Draw a table during its cycle, or paths of particles in it.",
        "moving-cap --trajectory --seed 1 --out orbit.gif",
    ),
    "simulate": Listed(
        "mushrooms.simulate:simulate",
        "Simulate an ensemble.",
        "moving-cap --particles 25000 --energy 1e7 --seed 1 --out run",
        "finished blocks are in the folder of --out: --resume continues the run",
    ),
    "export": Listed(
        "mushrooms.store.export:export", "Write a finished run as one table.", "run --to run.csv"
    ),
    "attack": Listed(
        "mushrooms.attack:attack",
        "Ask our own steppers difficult questions.",
        "--family knot-at-event --cases 20000 --seed 1",
    ),
    "audit": Listed(
        "mushrooms.audit:audit",
        "Check the paper's claims.",
        "--only X2,L4 --out audit-report",
        "finished parts are in the folder of the report: --resume continues the audit",
    ),
    "bench": Listed("mushrooms.bench:bench", "Measure speed against error.", "--quick --out bench-report"),
    "check": Listed(
        "mushrooms.check:check", "Grade a stepper in any language.", "--html report.html -- ./my_stepper"
    ),
    "verify": Listed(
        "mushrooms.verify:verify",
        "Check a trajectory of your own, step by step.",
        "steps.csv --scene moving-cap --picture false.svg",
    ),
    "ask": Listed(
        "mushrooms.ask:ask",
        "Print one question of the test suite and its proved answer.",
        "near-corner/3 -- ./my_stepper",
    ),
}


class LateCommand(TyperCommand):
    """A command that is imported when it is used."""

    def __init__(self, name: str) -> None:
        super().__init__(name=name, help=COMMANDS[name].summary, rich_markup_mode=None)

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Return the context of the command itself, which acts in place of this one."""
        return command(self.name or "").make_context(*arguments, **options)


class Commands(TyperGroup):
    """All commands, none of them imported."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = {name: LateCommand(name) for name in COMMANDS}

    def invoke(self, context: Any) -> Any:
        """Run a command, and say what has ended too soon: typer would call that an interruption."""
        try:
            return super().invoke(context)
        except EOFError as error:
            raise OSError(f"a file or stream ended too soon: {error}") from error


def command(name: str) -> Any:
    """Import a command."""
    entry = COMMANDS[name]
    module, _, function = entry.function.partition(":")
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    epilog = f"Example: {PROGRAM} {name} {entry.example}"
    alone.command(name, epilog=epilog)(_with_parsers(getattr(import_module(module), function)))
    return typer.main.get_command(alone)


def _with_parsers(function: Any) -> Any:
    """Let every option that is a number be read by `_parser`, within the bounds that it declares."""
    function.__annotations__ = get_type_hints(function, include_extras=True)
    for name, hint in function.__annotations__.items():
        kinds = (hint.__origin__, *get_args(hint.__origin__)) if get_origin(hint) is Annotated else ()
        for option in hint.__metadata__ if int in kinds or float in kinds else ():
            if isinstance(option, OptionInfo) and option.parser is None:
                names = [*(option.param_decls or ()), f"--{name.replace('_', '-')}"]
                option.parser = _parser(names[0], int in kinds, option.min, option.max)
                option.metavar = option.metavar or ("N" if int in kinds else "X")
                option.min = option.max = None  # its help says them in words
    return function


def _parser(option: str, is_whole: bool, low: float | None, high: float | None) -> Callable[[Any], Any]:
    """Return what reads a number: a whole one from `low` on, or a finite one above `low`; up to `high`."""
    bounds = f">= {low}" if high is None else f"{low} to {high}"
    if not is_whole:
        bounds = f"finite and > {low}" if high is None else f"> {low} and at most {high}"

    def parse(text: Any) -> int | float:
        value = whole(text) if is_whole else number(text)
        if low is not None:
            is_in = value >= low if is_whole else low < value < math.inf
            if not is_in or (high is not None and value > high):
                raise UsageError(f"{option} = {value}, must be {bounds}")
        return value

    return parse


def whole(text: str | int) -> int:
    """Return a whole number, written as 1000, 1e3 or 1000.0.

    Raises:
        BadParameter: it is none.
    """
    try:
        number = Decimal(text)
        if number.is_finite() and number.copy_abs() < MOST and number == number.to_integral_value():
            return int(number)
    except InvalidOperation:
        pass
    from scene.refusal import shown  # not above: the list of commands needs no scene

    raise typer.BadParameter(f"{shown(text)} is not a whole number below {MOST:.0e} in size")


def number(text: str | float) -> float:
    """Return a number; whether it is finite, or in bounds, is for the command to say.

    Raises:
        BadParameter: it is none.
    """
    try:
        return float(text)
    except ValueError:
        from scene.refusal import shown

        raise typer.BadParameter(f"{shown(text)} is not a number") from None


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Particles between moving walls: theory, simulation and the audit of Oscillating mushrooms.",
    epilog="Example: mushrooms audit --out audit-report",
)


_notes = list[str]()  # of an interruption, in this call of `run`


def tell_interrupted(kept: str) -> None:
    """Say on stderr that the command was interrupted, and what is kept; a command that knows more says it."""
    _notes.append(kept)
    with suppress(OSError):  # the terminal may be what has gone, or be full: the exit code still tells
        print(f"{PROGRAM}: interrupted; {kept}", file=sys.stderr, flush=True)


def _end_as_by_keyboard() -> None:
    """Let SIGTERM and a terminal that closes do what Ctrl-C does, so that half-written files are removed.

    A batch system ends its jobs so. A signal that is ignored (`nohup`) stays ignored.
    """
    if threading.current_thread() is threading.main_thread():  # no other thread may
        for number in (getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)):
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)


def _is_of_an_interrupt(error: BaseException | None) -> bool:
    """Tell whether an error came of an interruption: a compiled module loaded then says that it failed."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def run(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit: 0 done, 1 a claim failed, 2 bad input, 130 interrupted."""
    _notes.clear()
    _make_printable()
    try:
        _call(sys.argv[1:] if arguments is None else arguments)
    finally:
        for stream in (sys.stdout, sys.stderr):
            _let_go(stream)


def _call(given: list[str]) -> NoReturn:
    _refuse_empty(given)
    try:
        _end_as_by_keyboard()
        code = typer.main.get_command(app)(given, prog_name=PROGRAM, standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED  # which typer makes of Ctrl-C itself, in some versions
    except BrokenPipeError:
        sys.exit(1)  # the reader has gone: nothing to say
    except UsageError as error:
        _refuse(error.format_message())
    except OSError as error:
        _refuse(_format_error(error))
    except ValueError as error:
        from scene.refusal import BadInput  # not above: the list of commands needs no scene

        if not isinstance(error, BadInput):
            raise
        _refuse(_name_option(str(error), given))
    except BrokenExecutor as error:
        _refuse(f"a process of this run was ended from outside: {error}")
    except (MemoryError, RecursionError) as error:
        what = "not enough memory" if isinstance(error, MemoryError) else "nested too deeply"
        _refuse(f"{what}: {error}".removesuffix(": "))
    except (ImportError, SystemError) as error:
        if not _is_of_an_interrupt(error):
            raise
        code = INTERRUPTED
    if code == INTERRUPTED:
        kept = next((COMMANDS[word].kept for word in given if word in COMMANDS), "")
        if kept and not _notes:
            tell_interrupted(kept)
    sys.exit(code if isinstance(code, int) else 0)


def _make_printable() -> None:
    """See to it that nothing fails for want of a place to print it, or of a letter, or of a width.

    Work is done before its result is printed: it must not be lost there. What was closed takes everything and
    keeps nothing, and no file that a command opens becomes its standard output. A letter that the encoding
    lacks is printed by its number. Of COLUMNS and LINES what is no number above 0 says nothing: `rich` would
    print tables of no width, or fail.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 (till the end)
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in ("strict", "surrogateescape"):
        sys.stdout.reconfigure(errors="backslashreplace")
    for name in ("COLUMNS", "LINES"):
        size = os.environ.get(name, "1")
        if not (size.isascii() and size.isdigit() and len(size) < 6 and int(size) > 0):
            del os.environ[name]


def _let_go(stream: IO[str]) -> None:
    """Leave nothing for the interpreter to flush at its end: what fails there makes every exit code 120."""
    try:
        stream.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):  # a stream that is no file of the system's
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _format_error(error: OSError) -> str:
    """Return what the system refused; of a file it gives the name (`conformance.files` sees to that)."""
    if error.filename is None and error.errno in (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EDQUOT):
        return f"standard output cannot be written: {error.strerror}"
    return str(error) if error.filename is None else f"{os.fsdecode(error.filename)!r}: {error.strerror}"


def _refuse_empty(given: list[str]) -> None:
    """Refuse an option or an argument of no text: for a path it would mean the folder that one is in."""
    for option, value in pairwise([*given, "-"]):
        if option == "--":
            return
        if not option.strip():
            _refuse("an argument is empty, must have a value")
        if option.startswith("--") and (not value.strip() or option.endswith("=")):
            _refuse(f"{option.rstrip('=')} is empty, must have a value")


def _name_option(message: str, given: list[str]) -> str:
    """Return a message that begins with the name of an argument in Python with that of the option given."""
    field, equals, rest = message.partition(" = ")
    option = f"--{field.replace('_', '-')}"
    return f"{option} = {rest}" if equals and any(word.split("=")[0] == option for word in given) else message


def _refuse(message: str) -> NoReturn:
    with suppress(OSError):  # where standard error is full, the exit code still tells
        print(f"{PROGRAM}: {' '.join(message.split())}", file=sys.stderr, flush=True)
    sys.exit(2)


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        from mushrooms import __version__

        print(f"{PROGRAM} {__version__}")
        raise typer.Exit


@app.callback()
def main(
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Hold the options that come before any command."""
