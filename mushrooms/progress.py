"""What is shown while one waits: a bar or lines on stderr, and the news of a compilation."""

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich import progress
from rich.console import Console

FIRST = 20.0  # seconds to the first line, where there is no terminal
EVERY = 60.0  # seconds between lines
CLOCK = time.monotonic
UNITS = ((1.0, "seconds"), (60.0, "minutes"), (3600.0, "hours"), (86400.0, "days"))
# The kernels of `fast.kernel` that take more than three seconds to compile, and how long a command
# waits in all. `loop` is a step of the lanes.
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
                next_time = (
                    "kept for next time" if is_kept else "no folder can be written in to keep it"
                )
                print(f"{what}; {next_time}", file=sys.stderr, flush=True)

        def on_end(self, compilation: Any) -> None:
            pass

    with event.install_listener("numba:compile", Announcer()):
        yield


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
    """Moves a bar on a terminal; elsewhere prints a line on stderr after 20 s, then one a minute.

    Args:
        bar: see `progress_bar`.
        name: of the work.
        unit: what is counted.
    """

    def __init__(self, bar: progress.Progress, name: str, unit: str) -> None:
        self._bar = bar
        self._name = name
        self._unit = unit
        self._task = bar.add_task(name, total=None)
        self._begin = math.nan
        self._n_before = 0
        self._next = math.inf

    def update(self, n_done: int, n_total: int) -> None:
        """Take note of how many are done.

        The clock begins with the first call, when all is compiled.
        """
        now = CLOCK()
        if math.isnan(self._begin):
            self._begin = now
            self._n_before = n_done
            self._next = now + FIRST
        self._bar.update(self._task, completed=n_done, total=n_total)
        if self._bar.disable and now >= self._next:
            self._next = now + EVERY
            rate = (n_done - self._n_before) / max(now - self._begin, 1e-9)
            left = (
                f"{format_duration((n_total - n_done) / rate)} left"
                if rate
                else "time left unknown"
            )
            count = f"{n_done:,} of {n_total:,} {self._unit}"
            print(f"{self._name}: {count}, {left}", file=sys.stderr, flush=True)


def format_duration(seconds: float) -> str:
    """Return a duration in the unit that suits it."""
    size, unit = next(u for u in reversed(UNITS) if seconds >= 1.5 * u[0] or u is UNITS[0])
    n = seconds / size
    return f"{n:.2g} {unit}" if n < 10 or n > 1e6 else f"{n:.0f} {unit}"
