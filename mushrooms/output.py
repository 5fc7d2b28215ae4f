"""What commands share: results as lines, what is shown while one waits, files, folders."""

import json
import math
import os
import platform
import shutil
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

from rich import progress
from rich.console import Console
from rich.table import Table

from conformance.files import named, part, write_files
from scene import BadInput

FIRST, EVERY = 20.0, 60.0  # seconds to the first line, and between lines, where there is no terminal
CLOCK = time.monotonic
UNITS = ((1.0, "seconds"), (60.0, "minutes"), (3600.0, "hours"), (86400.0, "days"))
# The kernels of `fast.kernel` that take more than three seconds to compile, and how long a command waits in
# all. `loop` is a step of the lanes.
SLOW_TO_COMPILE = {
    "scalar_step": "about half a minute",
    "loop": "about half a minute",
    "follow_particles": "about half a minute",
    "follow_path": "about half a minute",
    "fine_path": "about ten seconds",
}


@contextmanager
def announce_compilation() -> Iterator[None]:
    """Say on stderr when the fast stepper is compiled: numba tells when it has found nothing kept.

    What is compiled one after the other and takes a while together is announced once.
    """
    from numba.core import event

    from fast.kernel.numba_internals import cache_folder

    announced = set()

    class Announcer(event.Listener):  # type: ignore[misc]  # numba has no types
        def on_start(self, compilation: Any) -> None:
            compiled = compilation.data["dispatcher"]
            duration = SLOW_TO_COMPILE.get(compiled.py_func.__name__)
            is_ours = compiled.py_func.__module__.startswith("fast.")
            if is_ours and duration is not None and duration not in announced:
                announced.add(duration)
                what = f"compiling the fast stepper for this machine: {duration}"
                is_kept = cache_folder(compiled) is not None
                next_time = "kept for next time" if is_kept else "no folder can be written in to keep it"
                print(f"{what}; {next_time}", file=sys.stderr, flush=True)

        def on_end(self, compilation: Any) -> None:
            pass

    with event.install_listener("numba:compile", Announcer()):
        yield


def new_console(*, soft_wrap: bool = False) -> Console:
    """Return a console for stdout whose tables fit its width, or COLUMNS; a pipe has room enough for them."""
    size = shutil.get_terminal_size((140, 25))
    return Console(width=size.columns, height=size.lines, soft_wrap=soft_wrap, highlight=False)


def print_table(console: Console, table: Table) -> None:
    """Print a table in which no word and no number is cut: a terminal that is too narrow breaks the lines."""
    at_ease = console.options.update(max_width=10_000)
    console.width = max(console.width, console.measure(table, options=at_ease).minimum)
    console.print(table)


def progress_bar() -> progress.Progress:
    """Return a progress bar on stderr, silent where that is no terminal."""
    console = Console(stderr=True)
    return progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
        transient=True,
    )


class Watch:
    """Moves a bar on a terminal; elsewhere prints a line on stderr after 20 seconds, and then one a minute.

    Args:
        bar: see `progress_bar`.
        name: of the work.
        unit: what is counted.
    """

    def __init__(self, bar: progress.Progress, name: str, unit: str) -> None:
        self._bar, self._name, self._unit = bar, name, unit
        self._task = bar.add_task(name, total=None)
        self._begin, self._n_before, self._next = math.nan, 0, math.inf

    def update(self, n_done: int, n_total: int) -> None:
        """Take note of how many are done; the clock begins with the first call, when all is compiled."""
        now = CLOCK()
        if math.isnan(self._begin):
            self._begin, self._n_before, self._next = now, n_done, now + FIRST
        self._bar.update(self._task, completed=n_done, total=n_total)
        if self._bar.disable and now >= self._next:
            self._next = now + EVERY
            rate = (n_done - self._n_before) / max(now - self._begin, 1e-9)
            left = f"{format_duration((n_total - n_done) / rate)} left" if rate else "time left unknown"
            count = f"{n_done:,} of {n_total:,} {self._unit}"
            print(f"{self._name}: {count}, {left}", file=sys.stderr, flush=True)


def format_duration(seconds: float) -> str:
    """Return a duration in the unit that suits it."""
    size, unit = next(u for u in reversed(UNITS) if seconds >= 1.5 * u[0] or u is UNITS[0])
    n = seconds / size
    return f"{n:.2g} {unit}" if n < 10 or n > 1e6 else f"{n:.0f} {unit}"


def refuse_unheeded(options: Mapping[str, object], why: str) -> None:
    """Refuse options that nothing here would heed: their user would count on them.

    Args:
        options: by name; None is one that is not given, True one that has no value.
        why: nothing heeds them.

    Raises:
        BadInput: naming the first that is given.
    """
    for name, value in options.items():
        if value is not None:
            shown = repr(value) if isinstance(value, str) else value
            given = name if value is True else f"{name} = {shown}"
            raise BadInput(f"{given} would change nothing here: {why}")


def print_pairs(pairs: dict[str, Any], as_json: bool, meanings: Mapping[str, str] | None = None) -> None:
    """Print names, their values and what they mean, a line each; or all as JSON, which keeps every digit.

    A value `x` with a standard error `x_se` is rounded to the error's second digit, and so is `x_theory`.
    """
    if as_json:
        print(json.dumps(pairs, indent=2))
        return
    width = max(map(len, pairs))
    texts = {name: _rounded(name, pairs) for name in pairs}
    longest = max(map(len, texts.values()))
    for name, text in texts.items():
        meaning = (meanings or {}).get(name)
        print(f"{name:<{width}}  {text:<{longest}}  {meaning}" if meaning else f"{name:<{width}}  {text}")


def _rounded(name: str, pairs: dict[str, Any]) -> str:
    value, error = pairs[name], pairs.get(f"{name.removesuffix('_se').removesuffix('_theory')}_se")
    if value is None:
        return "–"
    if not (isinstance(value, float) and isinstance(error, float) and 0 < error < math.inf):
        return str(value)
    places = 1 - math.floor(math.log10(error))
    return f"{value:.{max(places, 0)}f}"


def write_report(folder: Path, data: str, text: str, page: str, as_json: bool) -> None:
    """Write report.json, report.txt and report.html together, and print one of the first two."""
    write_files(folder, {"report.json": data, "report.txt": text, "report.html": page})
    print(data if as_json else text, end="")
    if not as_json:
        print(f"Report: {folder / 'report.html'}")


LOCK = ".lock"


@contextmanager
def writable_folder(path: Path) -> Iterator[Path]:
    """Make a folder, prove that files can be written in it, and tidy up if the work fails.

    Args:
        path: the folder; missing parents are made too.

    Raises:
        BadInput: one line naming the path and what is wrong with it.
    """
    made = []
    folder = path
    while not os.path.lexists(folder):
        made.append(folder)
        folder = folder.parent
    try:
        path.mkdir(parents=True, exist_ok=True)
        _probe(path / "probe")
    except (FileExistsError, NotADirectoryError):
        raise BadInput(f"output {str(path)!r}: {str(folder)!r} is a file, must be a folder") from None
    except OSError as error:
        _remove_empty(made)
        raise BadInput(f"output {str(path)!r} must be a writable folder: {error.strerror}") from None
    try:
        yield path
    except BaseException:
        _remove_empty(made)
        raise


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder; meanwhile all others are refused it, here and in another process.

    The system lets go of it when the process ends, however it ends. No clock and no process number decides.

    Args:
        folder: an existing folder that can be written in.

    Raises:
        BadInput: it is held.
    """
    path = folder / LOCK
    with path.open("a+", encoding="utf-8") as file:
        try:
            _hold(file)
            # A holder that has just ended may have removed the file that we opened.
            is_ours = os.path.samestat(os.fstat(file.fileno()), path.stat())
        except OSError:
            is_ours = False
        if not is_ours:
            file.seek(0)
            holder = file.read(200) or "another process"
            raise BadInput(f"folder {str(folder)!r} is in use by {holder}: one run at a time")
        try:
            file.truncate(0)
            # Past the buffer: what a full disk does not take would stay in it, and fail unnamed on closing.
            with named(path):
                os.write(file.fileno(), f"process {os.getpid()} on {platform.node()}".encode())
            yield
        finally:
            with suppress(PermissionError):  # Windows removes no open file; one that is not held is harmless
                path.unlink(missing_ok=True)


def _hold(file: TextIO) -> None:
    """Lock an open file, or raise OSError at once; the system unlocks it when the process ends."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(2**30)  # what is locked cannot be read there, and the holder's name is to be read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def check_file(path: Path | None, suffixes: tuple[str, ...]) -> None:
    """Prove that a file of one of these kinds can be written at `path`, if one is asked for.

    Raises:
        BadInput: one line naming the path and what is wrong with it.
    """
    if path is None:
        return
    if path.suffix not in suffixes:
        raise BadInput(f"output {str(path)!r}: its ending must be one of {', '.join(suffixes)}")
    if path.is_dir():
        raise BadInput(f"output {str(path)!r} is a folder, must be a file")
    try:
        _probe(path)
    except OSError as error:
        raise BadInput(f"output {str(path)!r} cannot be written: {error.strerror}") from None


def _probe(path: Path) -> None:
    part(path).write_bytes(b"")
    part(path).unlink()


def _remove_empty(folders: list[Path]) -> None:
    with suppress(OSError):  # one that is not empty stays, and so do those around it
        for folder in folders:
            folder.rmdir()
