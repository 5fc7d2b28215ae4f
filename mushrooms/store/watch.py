"""What a long run shows while it goes on: how far it is, how fast, how long still, and who was lost."""

from __future__ import annotations

import sys
from types import TracebackType

from mushrooms.forecast import in_words
from mushrooms.store import conduct
from mushrooms.store.blocks import Block
from mushrooms.store.tally import RunTally
from mushrooms.terminal import progress_bar

WIDE = 110  # columns of a terminal that leave room for rates beside the bar
EVERY = 60.0  # seconds between lines where there is no terminal


class Watch:
    """A bar on a terminal, elsewhere a line a minute on stderr.

    Args:
        name: of the run.
        n_particles: in all.
        before: what was there already.
    """

    def __init__(self, name: str, n_particles: int, before: RunTally) -> None:
        self._name, self._n, self._before, self._all = name, n_particles, before, before
        self._bar, self._begin = progress_bar(), conduct.CLOCK()
        self._told = self._begin

    def __enter__(self) -> Watch:
        self._bar.__enter__()
        self._task = self._bar.add_task(self._name, total=self._n, completed=self._before.particles)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.__exit__(kind, error, trace)

    def tick(self, n_done: int) -> None:
        """Take note of the particles done in the block under way."""
        self._bar.update(self._task, completed=self._all.particles + n_done)
        if self._bar.disable and conduct.CLOCK() - self._told > EVERY:
            self._told = conduct.CLOCK()
            print(f"{self._name}: {self.text()}", file=sys.stderr, flush=True)

    def followed(self, block: Block) -> None:
        """Take note of a block."""
        self._all = self._all.merged(block.tally)
        if self._bar.console.width >= WIDE:  # the bar tells the rest
            self._bar.update(self._task, description=f"{self._name}\n{self._pace()}")
        self.tick(0)

    def text(self) -> str:
        """Return how far the run is, by the blocks that were followed."""
        left = self._n - self._all.particles
        rate = self._rate("particles")
        told = in_words(left / rate) + " left" if rate else "time left unknown"
        return f"{self._all.particles:,} of {self._n:,} particles, {told}, {self._pace()}"

    def _pace(self) -> str:
        rates = f"{self._rate('particles'):.3g} particles/s, {self._rate('collisions'):.2g} collisions/s"
        lost = self._all.particles - self._all.followed
        return f"{rates}, {lost} lost, {self._all.undecided} undecided"

    def _rate(self, what: str) -> float:
        """Return how many of them a second have been followed here."""
        n = getattr(self._all, what) - getattr(self._before, what)
        return float(n / max(conduct.CLOCK() - self._begin, 1e-9))
