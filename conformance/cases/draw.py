"""One source of everything that is drawn at random: a stream of bits, and numbers made of them.

A stream is seeded by a key, and then the same on every machine and in every version of Python: only integer
bits are drawn, and floats come from + - * / and sqrt alone, so no libm takes part. Or Hypothesis draws the
bits (`conformance.strategies`), and shrinks them: of several options the first is the simplest.
"""

import math
import random
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


class Unfit(Exception):  # noqa: N818 (a finding about the draw)
    """What is drawn is no question of its kind, or has no certified answer; another must be drawn."""


class Draw:
    """A stream of numbers that depends on its key alone."""

    def __init__(self, key: str) -> None:
        self._random = random.Random(key)

    def bits(self, n: int) -> int:
        """Draw an integer of n bits: all that is ever drawn."""
        return self._random.getrandbits(n)

    def part(self) -> float:
        """Draw from (0, 1), even."""
        return (2 * self.bits(40) + 1) / 2**41

    def near_an_end(self) -> float:
        """Draw from (0, 1): even, or within 2^-k of an end, k up to 40."""
        if self.pick((True, True, False)):
            return self.part()
        near = self.power(-40, -1)
        return self.pick((near, 1 - near))

    def between(self, low: float, high: float) -> float:
        """Draw from (low, high), even."""
        return low + (high - low) * self.part()

    def short(self, low: float, high: float) -> float:
        """Draw a number of at most four decimals from [low, high], if it holds one."""
        least, most = math.ceil(low * 10_000), math.floor(high * 10_000)
        if most < least:
            return self.between(low, high)
        return (least + self.bits(30) % (most - least + 1)) / 10_000

    def pick(self, options: Sequence[T]) -> T:
        """Draw one of several."""
        return options[self.bits(30) % len(options)]

    def power(self, low: int, high: int) -> float:
        """Draw a power of two, low <= exponent <= high."""
        return 2.0 ** self.pick(range(low, high + 1))

    def direction(self) -> tuple[float, float]:
        """Draw a unit vector: a rational point of the circle, in any octant."""
        p = self.part()
        c, s = (1 - p * p) / (1 + p * p), 2 * p / (1 + p * p)
        if self.pick((False, True)):
            c, s = s, c
        return c * self.pick((1.0, -1.0)), s * self.pick((1.0, -1.0))

    def shuffle(self, items: list[T]) -> None:
        """Put a list into any order."""
        for n in range(len(items), 1, -1):
            i = self.pick(range(n))
            items[i], items[n - 1] = items[n - 1], items[i]
