"""Where nu(t) turns, stalls or rests, by exact algebra.

With w = nu r or nu itself a law, nu' has the sign of N = w' r - w r' (or of the law's own
derivative). On a bang-bang leg N is a polynomial in time, over a Fourier period one in
x = tan(omega t / 2), both with rational coefficients: Sturm's theorem isolates every root and
repeated division gives its multiplicity, so no critical point is missed however close two
are. Between neighbouring ones nu is strictly monotone or at rest.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from math import floor
from typing import Any, NamedTuple

from scene import exact
from scene.exact import half_angle, leg_intervals, leg_polynomial
from scene.laws import Law
from scene.pieces import exact as number
from theory.prepared import NotCovered, PreparedMushroom

MANY_BITS = 512  # beyond which Newton's method begins with fewer


class Span(NamedTuple):
    """A time interval on which nu is monotone and every law is analytic.

    Near its ends nu departs from its value there as |t - end|^order. `critical` are times, beyond its ends
    too, at which nu would turn if its laws went on there as they are in the interval.
    """

    start: Any
    end: Any
    start_order: int
    end_order: int
    inside: Fraction
    critical: tuple[Any, ...]


def spans(ctx: Any, mushroom: PreparedMushroom) -> list[Span]:
    """Cut one period into spans, in order of time; an empty list when nu never changes.

    Args:
        ctx: number system of the times [time].
        mushroom: as it is prepared.

    Raises:
        NotCovered: a factor is polynomials of time and the other waves; or nu' is beyond a parabola.

    Source: eq:dnu.
    """
    width, radius = mushroom.mouth
    if width.is_constant and radius.is_constant:
        return []
    jointed = mushroom.jointed
    if width.is_polynomial and radius.is_polynomial:
        return list(_polynomial_spans(ctx, jointed, width, radius))
    if not (width.is_trigonometric and radius.is_trigonometric):
        raise NotCovered(
            "nu = w / r of a Fourier and a bang-bang law: give the mouth by `nu`, a law of one kind"
        )
    shared = mushroom.cycle
    assert shared is not None
    found = _fourier_spans(ctx, shared.value(ctx), width, radius)
    if not jointed:
        return found
    assert shared.length is not None
    cuts = [begin % shared.length for begin, _ in leg_intervals(jointed)]
    return _cut(ctx, found, cuts, shared.length)


def _cut(ctx: Any, found: list[Span], cuts: list[Fraction], whole: Fraction) -> list[Span]:
    """Cut spans of a Fourier mouth where bang-bang laws of radius, depth or slope are not analytic.

    The ends of the spans are rounded to the context's precision; a cut that lies nearer to an end than that
    rounding is taken for the end itself.
    """
    length = number(ctx, whole)
    near = ctx.ldexp(length, 16 - ctx.prec)
    pieces = []
    for span in found:
        times = [(span.start, span.start_order)]
        first, last = (floor(t / length) for t in (span.start, span.end))
        for turn in range(first - 1, last + 2):
            for cut in cuts:
                time = number(ctx, cut + turn * whole)
                if span.start + near < time < span.end - near:
                    times.append((time, 1))
        times = [*sorted(times), (span.end, span.end_order)]
        for (a, m), (b, n) in pairwise(times):
            inside = Fraction(*map(int, ((a + b) / 2).as_integer_ratio()))
            pieces.append(Span(a, b, m, n, inside, span.critical))
    return pieces


def _polynomial_spans(ctx: Any, jointed: Sequence[Law], width: Law, radius: Law) -> Iterator[Span]:
    """Cut a period of laws that are polynomials of time between the joints of all moving laws."""
    for a, b in leg_intervals(jointed):
        w, r = leg_polynomial(width, a), leg_polynomial(radius, a)
        slope = exact.add(
            exact.multiply(exact.derivative(w), r),
            exact.scale(exact.multiply(w, exact.derivative(r)), Fraction(-1)),
        )
        if len(slope) > 3:
            raise NotCovered(
                "nu = w / r of polynomials beyond parabolas: give the mouth by `nu`, a cubic at most"
            )
        begin, last = number(ctx, a), (number(ctx, b), _multiplicity_at(slope, b - a))
        turns = [(begin + x, m) for x, m in _roots(ctx, slope, Fraction(0), b - a)]
        times = [(begin, _multiplicity_at(slope, Fraction(0))), *turns, last]
        powers = (number(ctx, c) for c in slope)  # cubes cancel in w' r - w r'
        critical = tuple(begin + x for x in quadratic_roots(ctx, *powers))
        for (start, m), (end, n) in pairwise(times):
            yield Span(start, end, 1 + m, 1 + n, (a + b) / 2, critical)


def _fourier_spans(ctx: Any, length: Any, width: Law, radius: Law) -> list[Span]:
    (w, n_w), (r, n_r) = half_angle(width), half_angle(radius)
    (dw, _), (dr, _) = half_angle(width, 1), half_angle(radius, 1)
    slope = exact.add(exact.multiply(dw, r), exact.scale(exact.multiply(w, dr), Fraction(-1)))
    if not slope:
        return []
    found = [(ctx.zero + length / 2, 2 * (n_w + n_r) - (len(slope) - 1))]  # x = infinity
    bound = exact.root_bound(slope)
    for x, multiplicity in _roots(ctx, slope, -bound, bound):
        time = length * ctx.atan(x) / ctx.pi
        found.append((time if time >= 0 else time + length, multiplicity))
    found = sorted((t, m) for t, m in found if m > 0)
    later = [*found[1:], (found[0][0] + length, found[0][1])]
    return [
        Span(a, b, 1 + m, 1 + n, Fraction(0), (a, b)) for (a, m), (b, n) in zip(found, later, strict=True)
    ]


def _multiplicity_at(p: exact.Polynomial, x: Fraction) -> int:
    n = 0
    while p and exact.at(p, x) == 0:
        p, n = exact.divide(p, [-x, Fraction(1)])[0], n + 1
    return n


def _roots(ctx: Any, p: exact.Polynomial, a: Fraction, b: Fraction) -> list[tuple[Any, int]]:
    """Return the distinct roots in the open interval (a, b), in order, with their multiplicities."""
    sturms, rest = [], p  # a root of multiplicity m is one of the first m
    while len(rest) > 1:
        sturms.append(exact.Sturm(rest))
        rest = exact.divide(rest, sturms[-1].root_free_of_squares)[0]
    if not sturms:
        return []
    simple = sturms[0].root_free_of_squares
    found, todo = [], [(a, b)]
    while todo:
        left, right = todo.pop()
        n = sturms[0].n_roots(left, right)
        if n == 0:
            continue
        # In an interval of length 1 Newton's method, kept in it, comes to all digits.
        if n == 1 and right - left <= 1 and exact.at(simple, left) != 0 != exact.at(simple, right):
            found.append((left, right, sum(s.n_roots(left, right) for s in sturms)))
            continue
        middle = (left + right) / 2
        if exact.at(simple, middle) == 0:
            found.append((middle, middle, _multiplicity_at(p, middle)))
        todo += [(left, middle), (middle, right)]
    return [(_refined(ctx, simple, left, right), multiplicity) for left, right, multiplicity in sorted(found)]


def _refined(ctx: Any, simple: exact.Polynomial, left: Fraction, right: Fraction) -> Any:
    """Return the only root of a polynomial in [left, right]; the ends are one if it is met exactly."""
    if left == right:
        return number(ctx, left)
    low, high = number(ctx, left), number(ctx, right)
    coefficients = [number(ctx, a) for a in reversed(simple)]
    sign = 1 if exact.at(simple, right) > 0 else -1

    def rising(x: Any) -> tuple[Any, Any]:
        value = slope = ctx.zero
        for c in coefficients:
            value, slope = value * x + c, slope * x + value
        return sign * value, sign * slope

    return solve_rising(ctx, rising, low, high)


def quadratic_roots(ctx: Any, c: Any = 0, b: Any = 0, a: Any = 0) -> list[Any]:
    """Return the roots of c + b x + a x^2; the real part of complex ones."""
    half = b / 2
    root = ctx.sqrt(max(half * half - a * c, ctx.zero))
    q = -half - root if b > 0 else root - half
    return [over / under for over, under in ((q, a), (c, q)) if under]


def solve_rising(ctx: Any, f: Any, low: Any, high: Any, guess: Any = None) -> Any:
    """Find the root of a rising function by Newton's method, kept in its bracket by bisection.

    At many digits the root is first found to five eighths of them, and so on down: a step of Newton's method
    doubles the digits, so that one step with all of them is enough.

    Args:
        ctx: number system.
        f: function returning (value, slope), negative at low, positive at high.
        low: lower end of the bracket.
        high: upper end.
        guess: first trial; the middle by default.
    """
    if ctx.prec > MANY_BITS:
        with ctx.workprec(5 * ctx.prec // 8):
            guess = solve_rising(ctx, f, low, high, guess)
    # A step as small as half the digits is followed by one below rounding.
    close, eps = ctx.ldexp(high - low, -int(ctx.prec) // 2), ctx.eps
    x = (low + high) / 2 if guess is None or not low < guess < high else guess
    for trial in range(20 + 4 * int(ctx.prec)):
        value, slope = f(x)
        if value == 0:
            break
        low, high = (x, high) if value < 0 else (low, x)
        newton = x - value / slope if slope > 0 else high + 1
        # The ends belong to the bracket: at convergence x is one of them. Bisecting now and then
        # bounds the work whatever the function.
        is_trusted = low <= newton <= high and (trial < 20 or trial % 2 == 0)
        step = (newton if is_trusted else (low + high) / 2) - x
        x += step
        if (is_trusted and abs(step) <= close) or high - low <= eps * abs(x):
            break
    return x
