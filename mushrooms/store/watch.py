"""What a long run shows while it goes on: how far it is, how fast, how long still, and who was lost."""

from __future__ import annotations

import sys
from types import TracebackType

from mushrooms.forecast import in_words
from mushrooms.store import conduct
from mushrooms.store.blocks import Block
from mushrooms.store.tally import RunTally
from mushrooms.terminal import progress_bar

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

    def kept(self, block: Block) -> None:
        """Take note of a block."""
        self._all = self._all.merged(block.tally)
        self._bar.update(self._task, description=f"{self._name}: {self.text()}")
        self.tick(0)

    def text(self) -> str:
        """Return how far the run is, by the blocks that are kept."""
        now, seconds = self._all, max(conduct.CLOCK() - self._begin, 1e-9)
        n_here = now.particles - self._before.particles
        rate = n_here / seconds
        left = in_words((self._n - now.particles) / rate) + " left" if rate else "time left unknown"
        collisions = (now.collisions - self._before.collisions) / seconds
        lost = now.particles - now.followed
        return (
            f"{now.particles:,} of {self._n:,} particles, {rate:.3g} a second, {left},"
            f" {collisions:.2g} collisions a second, {lost} lost, {now.undecided} undecided"
        )
