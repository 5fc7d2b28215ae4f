"""Progress of a long run: how far it is, how fast, how much time is left, and how many were lost."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from mushrooms.forecast import in_words
from mushrooms.store.tally import RunTally
from mushrooms.terminal import progress_bar

WIDE = 110  # columns of a terminal that leave room for rates beside the bar
FIRST, EVERY = 20.0, 60.0  # seconds to the first line, and between lines, where there is no terminal
CLOCK = time.monotonic


class Watch:
    """A bar on a terminal; elsewhere a line on stderr after 20 seconds, and then one a minute.

    Args:
        name: of the run.
        n_particles: in all.
        before: of the particles that were finished before.
    """

    def __init__(self, name: str, n_particles: int, before: RunTally) -> None:
        self._name, self._n, self._before, self._all = name, n_particles, before, before
        self._bar, self._done = progress_bar(), before.particles
        self._begin: float | None = None

    def __enter__(self) -> Watch:
        self._bar.__enter__()
        self._task = self._bar.add_task(self._name, total=self._n, completed=self._done)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.__exit__(kind, error, trace)

    def update(self, n_done: int) -> None:
        """Take note of how many particles are finished."""
        if self._begin is None:  # all is checked and compiled
            self._begin = CLOCK()
            self._next = self._begin + FIRST
        self._done = n_done
        wide = self._bar.console.width >= WIDE
        self._bar.update(
            self._task, completed=n_done, description=f"{self._name}\n{self._pace()}" if wide else self._name
        )
        if self._bar.disable and CLOCK() > self._next:
            self._next = CLOCK() + EVERY
            print(f"{self._name}: {self.text()}", file=sys.stderr, flush=True)

    def add(self, tally: RunTally) -> None:
        """Take note of a finished block."""
        self._all = self._all.merged(tally)

    def text(self) -> str:
        """Return how far the run is."""
        left, rate = self._n - self._done, self._rate()
        told = in_words(left / rate) + " left" if rate else "time left unknown"
        return f"{self._done:,} of {self._n:,} particles, {told}, {self._pace()}"

    def _pace(self) -> str:
        lost = self._all.particles - self._all.followed
        return f"{self._rate():.3g} particles/s, {lost} lost, {self._all.undecided} undecided"

    def _rate(self) -> float:
        """Return how many particles a second have been followed here."""
        return (self._done - self._before.particles) / max(CLOCK() - (self._begin or 0.0), 1e-9)
