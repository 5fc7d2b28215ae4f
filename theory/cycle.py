"""One cycle of a mushroom: its start, its period, when particles are captured and released (secs. 3.2, 3.5).

The cycle starts at a highest maximum of nu, where every particle that can leave the island has left
it. What stays in the island at all times, delta(nu_max) of the cap, takes no part.

Captures nest in the wells of nu(t). A particle captured as nu falls through a value is released when nu
first returns to it, so everything between is skipped by it. A well is an interval of time that nu enters
falling and leaves rising at one level, staying below between. From its top down to its highest inner peak a
fall and a rise face each other, cut into pieces over which law and branch are analytic; at the level of that
peak the well splits into wells that follow one another in time. Plateaus and inflections are allowed
everywhere. The binary64 numbers of a scene are exact; a swing of nu below 10^-(digits + 30) of its largest
value counts as none.

Parameters are the same functions of time as `evaluate` of a law's pieces. They are computed in
gmpy2's numbers, ten times as fast as mpmath's, with one sine and cosine for all laws and harmonics:
a cycle inverts nu(t) and takes volumes thousands of thousands of times. It is inverted in binary64
first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import lcm
from typing import Any, NamedTuple

from mpmath import fp

from scene.pieces import Period, Piece, PolynomialPiece, TrigonometricPiece, exact
from scene.precision import Decimals
from scene.refusal import BadInput, check_count
from scene.tables import Scene
from theory.critical import Span, solve_rising, spans
from theory.precision import MAX_DIGITS, Binary, guarded, one_of, settle
from theory.prepared import NotCovered, PreparedMushroom, prepare

# Digits beyond those asked. A loop that binary64 cannot tell from a trivial one has g - 1 ~ 1e-16 and
# m1 ~ 1e-32; with 40 more digits such an m1 still differs from zero.
GUARD = 40


@dataclass(frozen=True)
class Cycle:
    """One period of a mushroom, from the time at which nu starts to fall.

    Attributes:
        ctx: private number system, with GUARD more digits than asked for.
        digits: the digits asked for.
        start: time at which capture starts, the end of nu's maximum [time].
        period: the cycle's length [time]; None for a static table.
        nu_max: largest mouth.
        nu_min: smallest mouth.
        well: the captures in nested wells of nu; no pieces if nu is constant.
    """

    ctx: Any
    digits: int
    start: Any
    period: Any
    nu_max: Any
    nu_min: Any
    well: NuWell

    @classmethod
    @guarded
    def of(cls, scene: Scene, digits: int) -> Cycle:
        """Analyse a scene's motion.

        Args:
            scene: a valid mushroom, static ones included.
            digits: correct digits wanted, 1 to MAX_DIGITS.

        Raises:
            BadInput: no scene, or digits out of bounds.
            NotCovered: not a mushroom.

        Source: sec. 3.5, Eq:nu.
        """
        mushroom = prepare(scene)
        return cycle_of(mushroom, check_count("digits", digits, 1, MAX_DIGITS))

    @property
    def binary(self) -> Binary:
        """Numbers in which the cycle is solved."""
        return Binary(self.ctx)

    @property
    def pieces(self) -> tuple[CapturePiece, ...]:
        """All pieces of the tree of wells."""
        return tuple(self.well.all_pieces())

    @guarded
    def t_in(self, nu: Any) -> Any:
        """Return the first time in [start, start + period) at which nu falls through the given value.

        Raises:
            BadInput: no particle is captured at that nu.
        """
        nu = one_of(self.ctx, "nu", nu)
        return self._piece(nu).capture.time(nu)

    @guarded
    def t_out(self, nu: Any) -> Any:
        """Return the time at which nu next rises to the given value after `t_in`.

        Raises:
            BadInput: no particle is captured at that nu.
        """
        nu = one_of(self.ctx, "nu", nu)
        return self._piece(nu).release.time(nu)

    @guarded
    def release_time(self, t: Any) -> Any:
        """Return t_r(t), when a particle captured at time t is released; t itself if none is.

        Source: trelease.
        """
        t = one_of(self.ctx, "t", t)
        piece, within = self.capture_at(t)
        if piece is None:
            return t
        nu, _ = piece.capture.motion.nu(within)
        return piece.release.time(nu) + (t - within)

    def capture_at(self, t: Any) -> tuple[CapturePiece | None, Any]:
        """Return the piece on which particles are captured at time t, if any, and t less whole periods."""
        if self.period is not None:
            t -= self.ctx.floor((t - self.start) / self.period) * self.period
        for piece in self.pieces:
            if piece.capture.upper <= t < piece.capture.lower:
                return piece, t
        return None, t

    def _piece(self, nu: Any) -> CapturePiece:
        for piece in self.pieces:  # a well's own pieces come first: the first that fits is the earliest
            if piece.nu_lower <= nu <= piece.nu_upper:
                return piece
        given = self.ctx.nstr(nu, 15)
        if not self.pieces:
            raise BadInput(f"nu = {given}: nothing is captured, nu is constant")
        raise BadInput(f"nu = {given}, must be in [{float(self.nu_min):.6g}, {float(self.nu_max):.6g}]")


class MonotoneStretch(NamedTuple):
    """A part of a branch on which nu is strictly monotone: from `upper` at nu_upper to `lower`.

    critical: values at which nu would turn if its laws went on beyond the ends. There the time is singular,
        as a square root.
    """

    motion: MovingMushroom
    upper: Any
    lower: Any
    nu_upper: Any
    nu_lower: Any
    upper_order: int
    lower_order: int
    critical: tuple[Any, ...]

    def time(self, nu: Any) -> Any:
        """Return the time at which nu(t) = nu, nu_lower <= nu <= nu_upper."""
        binary = self.motion.binary
        with binary.working():
            return binary.given(self.changed(binary.taken).in_binary(binary.taken(nu)))

    def in_binary(self, nu: Any) -> Any:
        """Return `time` of a stretch whose ends are binary numbers, as nu is."""
        if nu >= self.nu_upper:
            return self.upper
        if nu <= self.nu_lower:
            return self.lower
        low, high = sorted((self.lower, self.upper))
        return self.motion.time(nu, low, high, self.upper < self.lower)

    def changed(self, change: Callable[[Any], Any]) -> MonotoneStretch:
        """Return the stretch with its numbers in another form."""
        numbers, critical = map(change, self[1:5]), tuple(map(change, self.critical))
        return MonotoneStretch._make((self.motion, *numbers, self.upper_order, self.lower_order, critical))

    def between(self, nu_upper: Any, nu_lower: Any, tolerance: Any) -> MonotoneStretch:
        """Return the part between two values; a value within tolerance of an end is that end."""
        cut = self._replace(nu_upper=nu_upper, nu_lower=nu_lower)
        if self.nu_upper - nu_upper > tolerance:
            cut = cut._replace(upper=self.time(nu_upper), upper_order=1)
        if nu_lower - self.nu_lower > tolerance:
            cut = cut._replace(lower=self.time(nu_lower), lower_order=1)
        return cut


class CapturePiece(NamedTuple):
    """Capture and release stretches over the same values of nu, from nu_upper down to nu_lower."""

    capture: MonotoneStretch
    release: MonotoneStretch

    @property
    def nu_upper(self) -> Any:
        """Largest nu of the piece."""
        return self.capture.nu_upper

    @property
    def nu_lower(self) -> Any:
        """Smallest nu of the piece."""
        return self.capture.nu_lower

    @property
    def top(self) -> tuple[Any, int]:
        """A value and an order p that make everything analytic in u, near nu = value - const u^p.

        The value is nu_upper or, where nothing is singular there, the nearest beyond at which something is.
        """
        order = 2 if self.nu_upper == 1 else 1  # sqrt(1 - nu^2) in d delta
        order = lcm(order, self.capture.upper_order, self.release.upper_order)
        return self._end(self.nu_upper, self.nu_upper - self.nu_lower, order)

    @property
    def bottom(self) -> tuple[Any, int]:
        """The same near nu_lower."""
        order = lcm(self.capture.lower_order, self.release.lower_order)
        return self._end(self.nu_lower, self.nu_lower - self.nu_upper, order)

    def _end(self, nu: Any, outward: Any, order: int) -> tuple[Any, int]:
        singular = (1, *self.capture.critical, *self.release.critical)
        near = [value for value in singular if 0 < (value - nu) / outward < 1]
        if order > 1 or not near:
            return nu, order
        return min(near, key=lambda value: abs(value - nu)), 2


class NuWell(NamedTuple):
    """Pieces from the top down to the level of the children, which follow one another in time."""

    pieces: tuple[CapturePiece, ...]
    children: tuple[NuWell, ...]

    def all_pieces(self) -> Iterator[CapturePiece]:
        """Yield the pieces of the whole tree, a well's own before its children's."""
        yield from self.pieces
        for child in self.children:
            yield from child.all_pieces()


@guarded
def cycle_of(mushroom: PreparedMushroom, digits: int) -> Cycle:
    """Return `Cycle.of` a mushroom that is prepared."""
    ctx = Decimals(digits + GUARD)
    settle(ctx)
    length = None if mushroom.cycle is None else mushroom.cycle.value(ctx)
    run = stretches(ctx, mushroom)
    if not run:
        nu, _ = MovingMushroom(ctx, mushroom, Fraction(0)).nu(ctx.zero)
        return Cycle(ctx, digits, ctx.zero, length, nu, nu, NuWell((), ()))
    found = nu_well(ctx, run, tolerance(ctx, run))
    levels = [nu for piece in found.all_pieces() for nu in (piece.nu_upper, piece.nu_lower)]
    return Cycle(ctx, digits, run[0].upper, length, max(levels), min(levels), found)


def stretches(ctx: Any, mushroom: PreparedMushroom) -> list[MonotoneStretch]:
    """Return one period's stretches in order of time, from a highest maximum of nu.

    The list is empty if nu is constant.
    """
    every = [(span, _stretch(ctx, mushroom, span)) for span in spans(ctx, mushroom)]
    small = tolerance(ctx, [s for _, s in every])
    found = [(span, s) for span, s in every if s.nu_upper - s.nu_lower > small]  # the others are plateaus
    tops = [i for i, (_, s) in enumerate(found) if is_fall(s) and not is_fall(found[i - 1][1])]
    if not tops:
        return []
    highest = max(found[i][1].nu_upper for i in tops)
    first = next(i for i in tops if highest - found[i][1].nu_upper <= small)
    next_spans = (_next_period(ctx, mushroom.cycle, span) for span, _ in found[:first])
    later = [_stretch(ctx, mushroom, span) for span in next_spans]
    return [s for _, s in found[first:]] + [s for s in later if s.nu_upper - s.nu_lower > small]


def nu_well(ctx: Any, run: list[MonotoneStretch], small: Any) -> NuWell:
    """Nest stretches, in order of time, that start falling from a level and end rising to it.

    Args:
        ctx: number system.
        run: the stretches.
        small: the `tolerance` of the whole period.
    """
    peaks = [i for i in range(1, len(run)) if is_fall(run[i]) and not is_fall(run[i - 1])]
    n_fall = next(i for i, s in enumerate(run) if not is_fall(s))
    last_fall = max(i for i, s in enumerate(run) if is_fall(s))
    fall, rise = run[:n_fall], run[last_fall + 1 :][::-1]
    if not peaks:
        return NuWell(_pieces(ctx, fall, rise, small), ())
    level = max(run[i].nu_upper for i in peaks)
    pieces: tuple[CapturePiece, ...] = ()
    if run[0].nu_upper - level > small:
        fall, rise = (_between(branch, ctx.inf, level, small) for branch in (fall, rise))
        pieces = _pieces(ctx, fall, rise, small)
    parts = [0, *(i for i in peaks if level - run[i].nu_upper <= small), len(run)]
    groups = [run[start:stop] for start, stop in pairwise(parts)]
    below = [_between(group, level, ctx.zero, small) for group in groups]
    return NuWell(pieces, tuple(nu_well(ctx, group, small) for group in below))


def is_fall(s: MonotoneStretch) -> bool:
    """Tell whether nu falls with time."""
    return bool(s.upper < s.lower)


def tolerance(ctx: Any, run: list[MonotoneStretch]) -> Any:
    """Return how far equal values of nu, reached along different branches, differ by rounding alone."""
    return ctx.mpf(10) ** (10 - ctx.dps) * max((s.nu_upper for s in run), default=ctx.one)


def _between(branch: list[MonotoneStretch], upper: Any, lower: Any, small: Any) -> list[MonotoneStretch]:
    """Return the parts of a branch on which nu lies between two values."""
    inside = [s for s in branch if s.nu_upper - lower > small and upper - s.nu_lower > small]
    return [s.between(min(s.nu_upper, upper), max(s.nu_lower, lower), small) for s in inside]


def _next_period(ctx: Any, shared: Period | None, span: Span) -> Span:
    assert shared is not None
    length = shared.value(ctx)
    return span._replace(
        start=span.start + length,
        end=span.end + length,
        inside=span.inside + (shared.length or Fraction(0)),
        critical=tuple(t + length for t in span.critical),
    )


def _stretch(ctx: Any, mushroom: PreparedMushroom, span: Span) -> MonotoneStretch:
    """Return the stretch of a span, or of a plateau what looks like one."""
    if not span.start < span.end:
        raise NotCovered(f"the mouth turns twice in so short a time that {ctx.dps} digits do not tell when")
    motion = MovingMushroom(ctx, mushroom, span.inside)
    ends = [
        (motion.nu(span.start)[0], span.start, span.start_order),
        (motion.nu(span.end)[0], span.end, span.end_order),
    ]
    (nu_lower, lower, lower_order), (nu_upper, upper, upper_order) = sorted(ends)
    critical = tuple(motion.nu(t)[0] for t in span.critical)
    return MonotoneStretch(motion, upper, lower, nu_upper, nu_lower, upper_order, lower_order, critical)


def _pieces(
    ctx: Any, capture: list[MonotoneStretch], release: list[MonotoneStretch], small: Any
) -> tuple[CapturePiece, ...]:
    values = sorted({nu for s in capture + release for nu in (s.nu_upper, s.nu_lower)}, reverse=True)
    cuts = [values[0]]
    for nu in values[1:]:
        if cuts[-1] - nu > small:
            cuts.append(nu)
    if abs(1 - cuts[0]) <= small:
        cuts[0] = ctx.one

    def over(branch: list[MonotoneStretch], nu_upper: Any, nu_lower: Any) -> MonotoneStretch:
        middle = (nu_upper + nu_lower) / 2
        whole = next(s for s in branch if s.nu_lower < middle < s.nu_upper)
        return whole.between(nu_upper, nu_lower, small)

    return tuple(CapturePiece(over(capture, a, b), over(release, a, b)) for a, b in pairwise(cuts))


class Parameter(NamedTuple):
    """A law as two functions of t and exp(i omega t)."""

    value: Callable[[Any, Any], Any]
    rate: Callable[[Any, Any], Any]


# Returns a number and its rate at a time.
Motion = Callable[[Any], tuple[Any, Any]]


class MovingMushroom:
    """The table in motion, valid on the span of time on which its laws keep their pieces.

    Attributes:
        ctx: mpmath's number system, in which questions are asked and answered.
        binary: that in which they are worked out.
    """

    def __init__(self, ctx: Any, mushroom: PreparedMushroom, time: Fraction) -> None:
        self.ctx, self.binary = ctx, Binary(ctx)
        self._made_of = ctx, mushroom, time
        pieces = {name: law.piece_at(time) for name, law in mushroom.laws.items()}
        width, radius = (law.piece_at(time) for law in mushroom.mouth)
        with self.binary.working():
            self._turn = _turning(self.binary, pieces.values())
            self._parameters = {name: _parameter(self.binary, piece) for name, piece in pieces.items()}
            self._half, self._4_by_pi = self.binary.one / 2, 4 / self.binary.pi
            self.mouth = _mouth(self.binary, (width, radius))
        self._rough_mouth = _mouth(fp, (width, radius))

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to make the same motion: its functions cannot be pickled."""
        return type(self), self._made_of

    def nu(self, t: Any) -> tuple[Any, Any]:
        """Return the mouth w / r at time t, and its rate. Source: Eq:nu, eq:dnu."""
        with self.binary.working():
            nu, rate = self.mouth(self.binary.taken(t))
            return self.binary.given(nu), self.binary.given(rate)

    def stem_share(self, t: Any, nu: Any) -> Any:
        """Return V_stem / V_cap at time t in binary numbers, where the mouth is nu. Source: Eq:Vcap."""
        turn = self._turn(t)
        r, h, slope = (self._parameters[name].value(t, turn) for name in ("r", "h", "slope"))
        depth = h / r
        return self._4_by_pi * depth * (nu - self._half * depth * slope)

    def time(self, nu: Any, low: Any, high: Any, is_falling: bool) -> Any:
        """Return the time in [low, high] at which a mouth that falls, or rises, is nu; in binary numbers."""
        sign = -1 if is_falling else 1

        def rising(mouth: Motion, level: Any) -> Motion:
            def excess(t: Any) -> tuple[Any, Any]:
                value, rate = mouth(t)
                return sign * (value - level), sign * rate

            return excess

        near = solve_rising(fp, rising(self._rough_mouth, float(nu)), float(low), float(high))
        return solve_rising(self.binary, rising(self.mouth, nu), low, high, self.binary.mpf(near))


def _turning(system: Any, pieces: Iterable[Piece]) -> Callable[[Any], Any]:
    """Return exp(i omega t) as a function of t; laws that move share one omega."""
    cycles = [piece.cycle for piece in pieces if not piece.is_polynomial]
    if not cycles:
        return lambda t: None
    omega = cycles[0].frequency(system)
    return lambda t: system.expj(omega * t)


def _mouth(system: Any, pieces: tuple[Piece, Piece]) -> Motion:
    """Return w / r and its rate as a function of t, from the pieces of w and r."""
    turning, (width, radius) = _turning(system, pieces), (_parameter(system, piece) for piece in pieces)

    def mouth(t: Any) -> tuple[Any, Any]:
        turn = turning(t)
        r = radius.value(t, turn)
        nu = width.value(t, turn) / r
        return nu, (width.rate(t, turn) - nu * radius.rate(t, turn)) / r  # of a small r, r^2 would be 0

    return mouth


def _parameter(system: Any, piece: Piece) -> Parameter:
    if not piece.is_polynomial:
        return _wave(system, piece)
    if piece.end is not None:
        return _polynomial(system, piece)
    constant, zero = system.mpf(piece.level), system.zero
    return Parameter(lambda t, turn: constant, lambda t, turn: zero)


def _polynomial(system: Any, piece: PolynomialPiece) -> Parameter:
    """Sum a polynomial of time by Horner's scheme."""
    origin = exact(system, piece.origin)
    coefficients = [exact(system, number) for number in piece.coefficients]
    slopes = [k * c for k, c in enumerate(coefficients)][1:]

    def total(terms: list[Any], t: Any) -> Any:
        x = t - origin
        found = terms[-1]
        for a in terms[-2::-1]:
            found = a + x * found
        return found

    return Parameter(lambda t, _: total(coefficients, t), lambda t, _: total(slopes, t))


def _wave(system: Any, law: TrigonometricPiece) -> Parameter:
    """Sum waves by Horner's scheme in complex numbers."""
    omega, zero = law.cycle.frequency(system), system.mpc(0.0, 0.0)
    amplitudes = {k: system.mpc(c, -s) for k, c, s in law.harmonics}
    terms = [amplitudes.get(k, zero) for k in range(max(amplitudes), 0, -1)]
    slopes = [k * amplitudes.get(k, zero) for k in range(max(amplitudes), 0, -1)]

    def total(coefficients: list[Any], turn: Any) -> Any:
        found = zero
        for a in coefficients:
            found = (found + a) * turn
        return found

    return Parameter(
        lambda t, turn: law.mean + total(terms, turn).real, lambda t, turn: -omega * total(slopes, turn).imag
    )
