"""One cycle of a mushroom with a single interval of capture (secs. 3.2, 3.5).

From its maximum nu falls along a capture branch to its minimum and rises along a release
branch back, with plateaus and inflections allowed on both. A particle captured at nu leaves
where the release branch has the same nu, so nu itself parametrises the cycle. It is cut into
pieces at every value where a law or a branch is not analytic. Cycles with several intervals
of capture are refused.

The binary64 numbers of a scene are exact; a swing of nu below 10^-(digits + 30) counts as none.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import lcm
from typing import Any, NamedTuple

from mpmath import MPContext

from scene.refusal import BadInput
from scene.tables import Mushroom, Scene, period
from theory.critical import Span, solve_rising, spans
from theory.motion import Motion
from theory.volumes import NotCovered, as_mushroom

# Digits beyond those asked. Loops that binary64 cannot tell from trivial ones have g - 1 ~ 1e-16 and
# m1 ~ 1e-32: with 40 digits to spare such an m1 is still told from zero.
GUARD = 40


class Stretch(NamedTuple):
    """A part of a branch on which nu is strictly monotone: from `upper` at nu_upper to `lower`."""

    motion: Motion
    upper: Any
    lower: Any
    nu_upper: Any
    nu_lower: Any
    upper_order: int
    lower_order: int

    def time(self, nu: Any, guess: Any = None) -> Any:
        """Return the time at which nu(t) = nu, nu_lower <= nu <= nu_upper."""
        if nu >= self.nu_upper:
            return self.upper
        if nu <= self.nu_lower:
            return self.lower
        sign = 1 if self.upper > self.lower else -1

        def rising(t: Any) -> tuple[Any, Any]:
            value, rate = self.motion.nu(t)
            return sign * (value - nu), sign * rate

        low, high = sorted((self.lower, self.upper))
        return solve_rising(self.motion.ctx, rising, low, high, guess)

    def between(self, nu_upper: Any, nu_lower: Any, tolerance: Any) -> Stretch:
        """Return the part between two values; a value within tolerance of an end is that end."""
        cut = self._replace(nu_upper=nu_upper, nu_lower=nu_lower)
        if self.nu_upper - nu_upper > tolerance:
            cut = cut._replace(upper=self.time(nu_upper), upper_order=1)
        if nu_lower - self.nu_lower > tolerance:
            cut = cut._replace(lower=self.time(nu_lower), lower_order=1)
        return cut


class Piece(NamedTuple):
    """Capture and release stretches over the same values of nu, from nu_upper down to nu_lower."""

    capture: Stretch
    release: Stretch

    @property
    def nu_upper(self) -> Any:
        """Largest nu of the piece."""
        return self.capture.nu_upper

    @property
    def nu_lower(self) -> Any:
        """Smallest nu of the piece."""
        return self.capture.nu_lower

    @property
    def upper_order(self) -> int:
        """Order p that makes everything analytic in u near nu = nu_upper - const u^p."""
        top = 2 if self.nu_upper == 1 else 1  # sqrt(1 - nu^2) in d delta
        return lcm(top, self.capture.upper_order, self.release.upper_order)

    @property
    def lower_order(self) -> int:
        """The same near nu_lower."""
        return lcm(self.capture.lower_order, self.release.lower_order)


@dataclass(frozen=True)
class Cycle:
    """One period of a mushroom, from the time at which nu starts to fall.

    Attributes:
        ctx: private number system, GUARD digits wider than asked.
        digits: the digits asked.
        start: time at which capture starts, the end of nu's maximum [time].
        period: the cycle's length [time]; None for a static table.
        nu_max: largest mouth.
        nu_min: smallest mouth.
        pieces: from nu_max down to nu_min; none when nu is constant.
    """

    ctx: Any
    digits: int
    start: Any
    period: Any
    nu_max: Any
    nu_min: Any
    pieces: tuple[Piece, ...]

    @classmethod
    def of(cls, scene: Scene, digits: int) -> Cycle:
        """Analyse a scene's motion.

        Args:
            scene: a valid mushroom, static ones included.
            digits: correct digits wanted, >= 1.

        Raises:
            BadInput: digits < 1.
            NotCovered: not a mushroom, or several intervals of capture per period.

        Source: sec. 3.5, Eq:nu.
        """
        mushroom = as_mushroom(scene)
        if digits < 1:
            raise BadInput(f"digits = {digits}, must be >= 1")
        ctx = MPContext()
        ctx.dps = digits + GUARD
        shared = period(mushroom)
        length = shared.value(ctx) if shared else None
        capture, release = _branches(ctx, mushroom)
        if not capture:
            nu, _ = Motion(ctx, mushroom, Fraction(0)).nu(ctx.zero)
            return cls(ctx, digits, ctx.zero, length, nu, nu, ())
        pieces = _pieces(ctx, capture, release)
        highest, lowest = pieces[0].nu_upper, pieces[-1].nu_lower
        return cls(ctx, digits, capture[0].upper, length, highest, lowest, pieces)

    def t_in(self, nu: Any) -> Any:
        """Return the time in [start, start + period) at which nu falls through the given value.

        Raises:
            BadInput: no particle is captured at that nu.
        """
        return self._piece(nu).capture.time(nu)

    def t_out(self, nu: Any) -> Any:
        """Return the time at which nu next rises to the given value.

        Raises:
            BadInput: no particle is captured at that nu.
        """
        return self._piece(nu).release.time(nu)

    def release_time(self, t: Any) -> Any:
        """Return t_r(t), when a particle captured at time t is released; t itself if none is.

        Source: trelease.
        """
        t = self.ctx.mpf(t)
        if self.period is None:
            return t
        shift = self.ctx.floor((t - self.start) / self.period) * self.period
        for piece in self.pieces:
            if piece.capture.upper <= t - shift < piece.capture.lower:
                nu, _ = piece.capture.motion.nu(t - shift)
                return piece.release.time(nu) + shift
        return t

    def _piece(self, nu: Any) -> Piece:
        for piece in self.pieces:
            if piece.nu_lower <= nu <= piece.nu_upper:
                return piece
        if not self.pieces:
            raise BadInput(f"nu = {nu}: nothing is captured, nu is constant")
        raise BadInput(f"nu = {nu}, must be in [{float(self.nu_min):.6g}, {float(self.nu_max):.6g}]")


def _branches(ctx: Any, scene: Mushroom) -> tuple[list[Stretch], list[Stretch]]:
    """Return the capture and the release branch, each from nu_max to nu_min."""
    found = [(span, s) for span in spans(ctx, scene) if (s := _stretch(ctx, scene, span)) is not None]
    falls = [s.upper < s.lower for _, s in found]
    starts = [i for i, fall in enumerate(falls) if fall and not falls[i - 1]]
    if not starts:
        return [], []
    if len(starts) > 1:
        raise NotCovered(f"one interval of capture per period is covered: this cycle has {len(starts)}")
    later = [_stretch(ctx, scene, _next_period(ctx, scene, span)) for span, _ in found[: starts[0]]]
    cycle = [s for _, s in found[starts[0] :]] + [s for s in later if s is not None]
    n = sum(falls)
    return cycle[:n], cycle[: n - 1 : -1]


def _next_period(ctx: Any, scene: Mushroom, span: Span) -> Span:
    shared = period(scene)
    assert shared is not None
    length = shared.value(ctx)
    return span._replace(
        start=span.start + length, end=span.end + length, inside=span.inside + (shared.length or Fraction(0))
    )


def _stretch(ctx: Any, scene: Mushroom, span: Span) -> Stretch | None:
    """Return the stretch of a span; None on a plateau."""
    motion = Motion(ctx, scene, span.inside)
    ends = [
        (motion.nu(span.start)[0], span.start, span.start_order),
        (motion.nu(span.end)[0], span.end, span.end_order),
    ]
    (nu_lower, lower, lower_order), (nu_upper, upper, upper_order) = sorted(ends)
    if nu_upper - nu_lower <= _tolerance(ctx):
        return None
    return Stretch(motion, upper, lower, nu_upper, nu_lower, upper_order, lower_order)


def _pieces(ctx: Any, capture: list[Stretch], release: list[Stretch]) -> tuple[Piece, ...]:
    tolerance = _tolerance(ctx)
    values = sorted({nu for s in capture + release for nu in (s.nu_upper, s.nu_lower)}, reverse=True)
    cuts = [values[0]]
    for nu in values[1:]:
        if cuts[-1] - nu > tolerance:
            cuts.append(nu)
    if abs(1 - cuts[0]) <= tolerance:
        cuts[0] = ctx.one

    def over(branch: list[Stretch], nu_upper: Any, nu_lower: Any) -> Stretch:
        middle = (nu_upper + nu_lower) / 2
        whole = next(s for s in branch if s.nu_lower < middle < s.nu_upper)
        return whole.between(nu_upper, nu_lower, tolerance)

    return tuple(Piece(over(capture, a, b), over(release, a, b)) for a, b in pairwise(cuts))


def _tolerance(ctx: Any) -> Any:
    # Equal values of nu reached along the two branches differ by rounding alone.
    return ctx.mpf(10) ** (10 - ctx.dps)
