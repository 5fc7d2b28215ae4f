"""Chebyshev interpolation and spectral integration at any precision.

Functions live on [0, 1], sampled at the n + 1 points (1 - cos(pi j / n)) / 2. What is analytic
around the interval converges geometrically in n (Clenshaw and Curtis, 1960). Endpoint
singularities are the caller's to remove.

Sums of cosines are taken by halving (Lee, 1984): those at even k are sums of cosines over half the points,
those at odd k two more such sums; n log n products in place of n^2. `even_degree` rounds a degree up to one
that halves well.

Distributions are weighted points, truncated power series lists of coefficients. The mean of a function over a
sum of two independent variables needs all pairs of their points. To keep the number of points small the pairs
are replaced by weights on a grid over their range. The weights give all polynomials up to the grid's degree
the same mean, so means of analytic functions converge geometrically; some of them may be negative.
"""

from itertools import pairwise
from operator import mul
from typing import Any

LEAST = 16  # degree up to which sums are taken one by one


class Grid:
    """The n + 1 Chebyshev points of [0, 1] in one number system, ends included; n even.

    Attributes:
        n: degree of the interpolants.
        points: ascending from exactly 0 to exactly 1.
        weights: Clenshaw-Curtis weights of the integral over [0, 1].
    """

    def __init__(self, ctx: Any, n: int) -> None:
        self.ctx = ctx
        self.n = n
        half = [*(ctx.cos(ctx.pi * m / n) for m in range(n // 2)), ctx.zero]
        quarter_turns = half + [-c for c in reversed(half[:-1])]  # cos(pi m / n), m = 0 ... n
        self._full_turn = quarter_turns + quarter_turns[-2:0:-1]
        self.points = [(1 - c) / 2 for c in quarter_turns]
        self._rows: dict[int, list[list[Any]]] = {}
        self.weights = self._clenshaw_curtis()

    def _sums_of_all(self, values: list[Any]) -> list[Any]:
        # cos(pi (n - j) k / n) = (-1)^k cos(pi j k / n): the second half of the sums repeats the first.
        n = len(values) - 1
        even, odd = _folded(values)
        step = self.n // n
        if n not in self._rows:
            turn = self._full_turn
            self._rows[n] = [
                [turn[j * k * step % (2 * self.n)] for j in range(n // 2 + 1)] for k in range(n + 1)
            ]
        return [self._product(odd if k % 2 else even, row) for k, row in enumerate(self._rows[n])]

    def _product(self, values: list[Any], row: list[Any]) -> Any:
        """Return the sum of products with the first numbers of a row."""
        return self.ctx.fsum(map(mul, values, row))

    def _cosine_sums(self, values: list[Any]) -> list[Any]:
        """Return the sums over j of values[j] cos(pi j k / n), k = 0 ... n."""
        n = len(values) - 1
        if n % 4 or n <= LEAST:
            return self._sums_of_all(values)
        even, odd = _folded(values)
        found = [self.ctx.zero] * (n + 1)
        found[::2], found[1::2] = self._cosine_sums(even), self._odd_sums(odd)
        return found

    def _odd_sums(self, values: list[Any]) -> list[Any]:
        """Return the sums over j of values[j] cos(pi j (2 k + 1) / (2 N)), j and k = 0 ... N - 1."""
        size = len(values)
        step = self.n // size  # cos(pi m / (2 N)) is cos(pi m (n / N) / (2 n)): N divides n / 2
        turn, around = self._full_turn, 2 * self.n
        if size % 2 or size <= LEAST // 2:
            key = -size
            if key not in self._rows:
                half = step // 2
                self._rows[key] = [
                    [turn[j * (2 * k + 1) * half % around] for j in range(size)] for k in range(size)
                ]
            return [self._product(values, row) for row in self._rows[key]]
        own = self._odd_sums(values[::2])
        odd = values[1::2]
        pairs = self._odd_sums([odd[0], *(a + b for a, b in pairwise(odd))])
        others = [pair / (2 * turn[(2 * k + 1) * step // 2]) for k, pair in enumerate(pairs)]
        first = [a + b for a, b in zip(own, others, strict=True)]
        return first + [a - b for a, b in zip(own[::-1], others[::-1], strict=True)]

    def coefficients(self, values: list[Any]) -> list[Any]:
        """Return the interpolant's coefficients c_k, f = sum c_k T_k(2 x - 1)."""
        found = self._interpolated(values)
        return [-c if k % 2 else c for k, c in enumerate(found)]

    def running_integral(self, coefficients: list[Any]) -> list[Any]:
        """Return the integral from 0 to each point of the function with these coefficients."""
        n = self.n
        c = [2 * coefficients[0], *coefficients[1:], self.ctx.zero, self.ctx.zero]
        # On [-1, 1] T_k integrates to T_(k+1) / (2 k + 2) - T_(k-1) / (2 k - 2); [0, 1] is half as long.
        terms = [self.ctx.zero] + [(c[k - 1] - c[k + 1]) / (4 * k) for k in range(1, n + 1)]
        signed = [-term if k % 2 else term for k, term in enumerate(terms)]
        at_zero = self.ctx.fsum(signed)
        return [total - at_zero for total in self._cosine_sums(signed)]

    def integral(self, values: list[Any]) -> Any:
        """Return the integral over [0, 1] of the function with these values at the points."""
        return self._product(values, self.weights)

    def quadrature(self, moments: list[Any]) -> list[Any]:
        """Return the weights at the points of a measure with these means of T_k(2 x - 1), k = 0 ... n."""
        return self._interpolated([-m if k % 2 else m for k, m in enumerate(moments)])

    def _interpolated(self, values: list[Any]) -> list[Any]:
        """Return 2 / n times the cosine sums, the first and the last value and sum counted half."""
        total = self._cosine_sums(_with_halved_ends(values))
        return _with_halved_ends([2 * x / self.n for x in total])

    def _clenshaw_curtis(self) -> list[Any]:
        n, ctx = self.n, self.ctx
        even = [ctx.one / (1 - k * k) if k % 2 == 0 else ctx.zero for k in range(n + 1)]
        return self._interpolated(even)


def even_degree(n: int) -> int:
    """Return a degree of at least n that halves at least twice, and a large one down to 2 LEAST."""
    unit = 1 << max((n // (2 * LEAST)).bit_length(), 3)
    return -(-n // unit) * unit


def _folded(values: list[Any]) -> tuple[list[Any], list[Any]]:
    """Return values[j] + values[n - j], j = 0 ... n / 2 (the middle once), and the differences, j < n / 2."""
    middle = (len(values) - 1) // 2
    pairs = list(zip(values[:middle], values[:middle:-1], strict=True))
    return [a + b for a, b in pairs] + [values[middle]], [a - b for a, b in pairs]


def _with_halved_ends(values: list[Any]) -> list[Any]:
    return [values[0] / 2, *values[1:-1], values[-1] / 2]


WeightedPoints = list[tuple[Any, Any]]  # weight and place


def convolve(grid: Grid, first: WeightedPoints, second: WeightedPoints) -> WeightedPoints:
    """Return the distribution of a sum of independent variables, on few points."""
    few, other = compressed(grid, first), compressed(grid, second)
    return compressed(grid, [(v * w, r + s) for v, r in few for w, s in other])


def compressed(grid: Grid, masses: WeightedPoints) -> WeightedPoints:
    """Return at most n + 1 points with the same means of polynomials up to degree n, the grid's."""
    if len(masses) <= grid.n + 1:
        return masses
    ctx = grid.ctx
    low, high = min(s for _, s in masses), max(s for _, s in masses)
    if high - low <= 16 * ctx.eps * max(abs(low), abs(high)):
        return [(ctx.fsum(w for w, _ in masses), low)]
    weights = [w for w, _ in masses]
    x = [2 * (s - low) / (high - low) - 1 for _, s in masses]
    older, old = [ctx.one] * len(x), x
    moments = [ctx.fsum(weights), ctx.fsum(map(mul, weights, x))]
    for _ in range(2, grid.n + 1):
        older, old = old, [2 * y * now - before for y, now, before in zip(x, old, older, strict=True)]
        moments.append(ctx.fsum(map(mul, weights, old)))
    places = [low + (high - low) * p for p in grid.points]
    return list(zip(grid.quadrature(moments), places, strict=True))


def product(p: list[Any], q: list[Any]) -> list[Any]:
    """Return the product of two power series, to the length they share."""
    return [sum(p[i] * q[k - i] for i in range(k + 1)) for k in range(len(p))]


def logarithm(ctx: Any, p: list[Any]) -> list[Any]:
    """Return the power series of log p, p[0] > 0, to the same length."""
    found = [ctx.log(p[0])]
    for k in range(1, len(p)):
        rest = sum(j * found[j] * p[k - j] for j in range(1, k))
        found.append((p[k] - rest / k) / p[0])
    return found
