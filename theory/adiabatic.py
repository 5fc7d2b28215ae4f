"""The captured particles of a cycle, as functions of the mouth nu at which each is captured.

With a = V_cap / V_cha at capture and b the same at release,
    A(nu) = integral of a |d delta| from nu to nu_max,    p_cha = exp(-A)    (Eq:ps),
    B(nu) = integral of b |d delta| from nu to nu_max,    g = b / a          (Eq:g),
    s(nu) = log E1 / E0 = -log g + B - A                                     (Eq:lnE/E0),
    s_nc  = B - A at nu_min, for the particles never captured                (Eq:lnEnc/E0).
On every piece nu = nu_upper - (nu_upper - nu_lower) I(u), where I is the polynomial that
leaves 0 as u^p and reaches 1 as (1 - u)^q: with the piece's orders p, q all this is analytic in
u on [0, 1]. Intervals of u are halved until Chebyshev interpolation resolves them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import comb
from typing import Any, NamedTuple

from scene.refusal import BadInput
from theory.chebyshev import Grid
from theory.cycle import Cycle, Piece
from theory.volumes import delta, delta_slope

MAX_HALVINGS = 24  # a panel of 2^-24 of its piece: nearer singularities are given up


class NotConverged(BadInput):
    """The digits asked were not reached within the limits on work."""


class Panel(NamedTuple):
    """Values at the Chebyshev points of a part of a piece, nu falling.

    A and B run on from the panel before; `rate` is dA / dx with x in [0, 1] across the panel.
    """

    nu: list[Any]
    t_in: list[Any]
    t_out: list[Any]
    rate: list[Any]
    log_g: list[Any]
    A: list[Any]
    B: list[Any]

    @property
    def s(self) -> list[Any]:
        """Log E1 / E0 of a particle captured here. Source: Eq:lnE/E0."""
        return [b - a - log_g for a, b, log_g in zip(self.A, self.B, self.log_g, strict=True)]


@dataclass(frozen=True)
class Captures:
    """A cycle's captured particles, panel by panel from nu_max to nu_min."""

    cycle: Cycle
    grid: Grid
    panels: tuple[Panel, ...]

    @property
    def s_not_captured(self) -> Any:
        """Log E1 / E0 of the particles never captured. Source: Eq:lnEnc/E0."""
        return self.panels[-1].B[-1] - self.panels[-1].A[-1] if self.panels else self.cycle.ctx.zero

    @property
    def p_not_captured(self) -> Any:
        """Probability of staying in the chaotic zone. Source: Eq:ps at nu_min."""
        return self.cycle.ctx.exp(-self.panels[-1].A[-1]) if self.panels else self.cycle.ctx.one

    def mean(self, f: Callable[[Any], Any]) -> Any:
        """Return the mean of f(log E1 / E0) over all particles, the uncaptured ones included."""
        captured = self._integral(lambda panel: [f(s) for s in panel.s])
        return captured + self.p_not_captured * f(self.s_not_captured)

    def growth(self) -> Any:
        """Return m1, the integral of g - 1 - log g over the captured particles. Source: Eq:Erate."""
        ctx = self.cycle.ctx
        return self._integral(lambda panel: [ctx.expm1(log_g) - log_g for log_g in panel.log_g])

    def _integral(self, f: Callable[[Panel], list[Any]]) -> Any:
        # d p_ell = exp(-A) dA (Eq:dps/ps).
        ctx, total = self.cycle.ctx, self.cycle.ctx.zero
        for panel in self.panels:
            density = [rate * ctx.exp(-a) for rate, a in zip(panel.rate, panel.A, strict=True)]
            total += self.grid.integral([y * p for y, p in zip(f(panel), density, strict=True)])
        return total


def captures(cycle: Cycle, target: int) -> Captures:
    """Resolve a cycle's captured particles by Chebyshev panels.

    Args:
        cycle: the cycle.
        target: decimals to which a, b and log g are resolved, at most digits + GUARD of the cycle.

    Raises:
        NotConverged: panels as small as 2^-MAX_HALVINGS of a piece do not resolve it.
    """
    grid = Grid(cycle.ctx, 2 * (12 + target))
    tolerance = cycle.ctx.mpf(10) ** -target
    panels: list[Panel] = []
    A = B = cycle.ctx.zero
    for piece in cycle.pieces:
        todo = [(0, 0)]  # part i of the piece's 2^halvings equal parts in u
        while todo:
            i, halvings = todo.pop()
            panel = _panel(cycle, grid, piece, (i, halvings), (A, B), tolerance)
            if panel is not None:
                panels.append(panel)
                A, B = panel.A[-1], panel.B[-1]
            elif halvings < MAX_HALVINGS:
                todo += [(2 * i + 1, halvings + 1), (2 * i, halvings + 1)]
            else:
                nu, _ = _descent(cycle.ctx, piece, cycle.ctx.ldexp(i, -halvings))
                raise NotConverged(
                    f"the cycle is not resolved to {target} digits near nu = {float(nu):.6g}"
                    f" by panels of 2^-{MAX_HALVINGS} of a piece"
                )
    return Captures(cycle, grid, tuple(panels))


def _panel(
    cycle: Cycle, grid: Grid, piece: Piece, part: tuple[int, int], start: tuple[Any, Any], tolerance: Any
) -> Panel | None:
    """Sample a part of a piece and integrate from `start` = (A, B); None when it is not resolved."""
    ctx, width = cycle.ctx, cycle.ctx.ldexp(1, -part[1])
    levels: list[Any] = []
    t_in: list[Any] = []
    t_out: list[Any] = []
    dA, dB, log_g = [], [], []
    for x in grid.points:
        nu, slope = _descent(ctx, piece, (part[0] + x) * width)
        t_in.append(piece.capture.time(nu, grid.forecast(t_in)))
        t_out.append(piece.release.time(nu, grid.forecast(t_out)))
        before = piece.capture.motion.volumes(t_in[-1], nu)
        after = piece.release.motion.volumes(t_out[-1], nu)
        a, b = before.v_cap / before.v_cha, after.v_cap / after.v_cha
        d_delta = delta_slope(ctx, nu) * slope * width
        levels.append(nu)
        dA.append(a * d_delta)
        dB.append(b * d_delta)
        log_g.append(ctx.log(b / a))
    c_A, c_B = grid.coefficients(dA), grid.coefficients(dB)
    swing = delta(ctx, cycle.nu_min) - delta(ctx, cycle.nu_max)
    if _tail(c_A) > tolerance * swing or _tail(c_B) > tolerance * swing:
        return None
    if _tail(grid.coefficients(log_g)) > tolerance:
        return None
    A = [start[0] + rise for rise in grid.running_integral(c_A)]
    B = [start[1] + rise for rise in grid.running_integral(c_B)]
    return Panel(levels, t_in, t_out, dA, log_g, A, B)


def _descent(ctx: Any, piece: Piece, u: Any) -> tuple[Any, Any]:
    """Return nu and d nu / du at u in [0, 1], nu falling along I(u).

    I is the regularised incomplete beta function with integer parameters p, q >= 1.
    """
    p, q, v = piece.upper_order, piece.lower_order, 1 - u
    m, drop = p + q - 1, piece.nu_upper - piece.nu_lower
    share = ctx.fsum(comb(m, j) * u**j * v ** (m - j) for j in range(p, m + 1))
    slope = -drop * p * comb(m, p) * u ** (p - 1) * v ** (q - 1)
    # The end itself is nu_lower: rounding there would cost half the digits of the vertex's time.
    return (piece.nu_upper - drop * share if v else piece.nu_lower), slope


def _tail(coefficients: list[Any]) -> Any:
    return max(abs(c) for c in coefficients[-(len(coefficients) // 6) :])
