"""Chebyshev interpolation and spectral integration at any precision.

Functions live on [0, 1], sampled at the n + 1 points (1 - cos(pi j / n)) / 2. What is analytic
around the interval converges geometrically in n (Clenshaw and Curtis, 1960). Endpoint
singularities are the caller's to remove.
"""

from __future__ import annotations

from typing import Any

REACH = 8  # points that a forecast extrapolates from; more of them would save no further Newton steps


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
        half = [ctx.cos(ctx.pi * m / n) for m in range(n // 2)] + [ctx.zero]
        quarter_turns = half + [-c for c in reversed(half[:-1])]  # cos(pi m / n), m = 0 ... n
        full_turn = quarter_turns + quarter_turns[-2:0:-1]
        self._cosines = [[full_turn[j * k % (2 * n)] for j in range(n // 2 + 1)] for k in range(n + 1)]
        self.points = [(1 - c) / 2 for c in quarter_turns]
        self.weights = self._clenshaw_curtis()
        self._forecasts = [self._extrapolation(j) for j in range(n + 1)]

    def _cosine_sums(self, values: list[Any]) -> list[Any]:
        """Return the sums over j of values[j] cos(pi j k / n), k = 0 ... n."""
        # cos(pi (n - j) k / n) = (-1)^k cos(pi j k / n): the second half of the sums repeats the first.
        middle = self.n // 2
        pairs = list(zip(values[:middle], values[:middle:-1], strict=True))
        even, odd = [a + b for a, b in pairs] + [values[middle]], [a - b for a, b in pairs]
        return [self.ctx.fdot(odd if k % 2 else even, row) for k, row in enumerate(self._cosines)]

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
        return self.ctx.fdot(self.weights, values)

    def quadrature(self, moments: list[Any]) -> list[Any]:
        """Return the weights at the points of a measure with these means of T_k(2 x - 1), k = 0 ... n."""
        return self._interpolated([-m if k % 2 else m for k, m in enumerate(moments)])

    def _interpolated(self, values: list[Any]) -> list[Any]:
        """Return 2 / n times the cosine sums, the first and the last value and sum counted half."""
        total = self._cosine_sums(_with_halved_ends(values))
        return _with_halved_ends([2 * x / self.n for x in total])

    def forecast(self, values: list[Any]) -> Any:
        """Extrapolate a function known at the first points to the next one; None when none is known."""
        weights = self._forecasts[len(values)]
        return self.ctx.fdot(weights, values[-len(weights) :]) if weights else None

    def _extrapolation(self, j: int) -> list[Any]:
        # Lagrange weights at point j of the last points before it.
        known = self.points[max(0, j - REACH) : j]
        return [self.ctx.fprod((self.points[j] - x) / (y - x) for x in known if x != y) for y in known]

    def _clenshaw_curtis(self) -> list[Any]:
        n, ctx = self.n, self.ctx
        even = [ctx.mpf(1) / (1 - k * k) if k % 2 == 0 else ctx.zero for k in range(n + 1)]
        return self._interpolated(even)


def _with_halved_ends(values: list[Any]) -> list[Any]:
    return [values[0] / 2, *values[1:-1], values[-1] / 2]
