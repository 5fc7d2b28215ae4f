"""Distributions as weighted points: sums of independent variables and truncated power series.

The mean of a function over a sum of two independent variables needs all pairs of their points. To keep the
number of points small the pairs are replaced by weights on a Chebyshev grid over their range. The weights
give all polynomials up to the grid's degree the same mean, so means of analytic functions converge
geometrically; some of the weights may be negative.
"""

from __future__ import annotations

from typing import Any

from theory.chebyshev import Grid

WeightedPoints = list[tuple[Any, Any]]  # weight and place


def shifted(atoms: WeightedPoints, weight: Any, shift: Any) -> WeightedPoints:
    """Return the points moved by `shift`, their weights times `weight`."""
    return [(weight * w, s + shift) for w, s in atoms]


def convolve(grid: Grid, first: WeightedPoints, second: WeightedPoints) -> WeightedPoints:
    """Return the distribution of a sum of independent variables, on few points."""
    few, other = compressed(grid, first), compressed(grid, second)
    return compressed(grid, [(v * w, r + s) for v, r in few for w, s in other])


def compressed(grid: Grid, atoms: WeightedPoints) -> WeightedPoints:
    """Return at most n + 1 points with the same means of polynomials up to degree n, the grid's."""
    if len(atoms) <= grid.n + 1:
        return atoms
    ctx = grid.ctx
    low, high = min(s for _, s in atoms), max(s for _, s in atoms)
    if high - low <= 16 * ctx.eps * max(abs(low), abs(high)):
        return [(ctx.fsum(w for w, _ in atoms), low)]
    weights = [w for w, _ in atoms]
    x = [2 * (s - low) / (high - low) - 1 for _, s in atoms]
    older, old = [ctx.one] * len(x), x
    moments = [ctx.fsum(weights), ctx.fdot(weights, x)]
    for _ in range(2, grid.n + 1):
        older, old = old, [2 * y * now - before for y, now, before in zip(x, old, older, strict=True)]
        moments.append(ctx.fdot(weights, old))
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
