"""The captured particles of a cycle, as functions of the mouth nu at which each is captured.

With a = V_cap / V_cha at capture and b the same at release,
    A(nu) = integral of a |d delta| from nu to nu_max,    p_cha = exp(-A)    (Eq:ps),
    B(nu) = integral of b |d delta| from nu to nu_max,    g = b / a          (Eq:g),
    s(nu) = log E1 / E0 = -log g + B - A                                     (Eq:lnE/E0),
    s_nc  = B - A at nu_min, for the particles never captured                (Eq:lnEnc/E0).
With several captures A and B run along the path from the top of the tree of wells; a particle
not captured on a well's own pieces passes through its children one after another, a Markov chain whose
gains are independent and add up (theory/equations.md derives it).
On every piece nu = nu_upper - (nu_upper - nu_lower) I(u), where I is the polynomial that
leaves 0 as u^p and reaches 1 as (1 - u)^q: with the piece's orders p, q all this is analytic in
u on [0, 1]. Where nu would turn a hair beyond a piece's end, times are nearly singular there: nu_upper or
nu_lower is then that turn's, and the piece a part of [0, 1]. Intervals of u are halved until Chebyshev
interpolation resolves them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, reduce
from math import comb, log2
from typing import Any, NamedTuple

from scene.refusal import BadInput
from theory.chebyshev import Grid, WeightedPoints, convolve, even_degree, product, shifted
from theory.critical import solve_rising
from theory.cycle import CapturePiece, Cycle, NuWell
from theory.precision import Binary
from theory.volumes import free_share

MAX_HALVINGS = 256  # a panel of 2^-256 of its piece
NARROWEST = 1e-20  # of the widest mouth: `tolerance` of the cycle and rounding stay far below what nu is

FEWEST = 16  # degree of the grid at which a part is first tried; its points are among those of the next
PROMISE = 0.92  # of the digits wanted, in proportion to its degree, are to be seen on such a grid


class NotConverged(BadInput):
    """The digits asked for were not reached within the limit of work."""


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
        """What the wells on the path give to log E1 / E0 of a particle captured here. Source: Eq:lnE/E0."""
        return [b - a - log_g for a, b, log_g in zip(self.A, self.B, self.log_g, strict=True)]


class SolvedWell(NamedTuple):
    """A well resolved: its own panels and its children; A and B at its top and where the children begin."""

    panels: tuple[Panel, ...]
    children: tuple[SolvedWell, ...]
    A_top: Any
    B_top: Any
    A_end: Any
    B_end: Any

    @property
    def absorbed(self) -> Any:
        """-log of the probability of passing the whole well uncaptured (Eq:ps)."""
        return self.A_end - self.A_top + sum(child.absorbed for child in self.children)

    @property
    def s_nc(self) -> Any:
        """Gain in log E of passing it uncaptured (Eq:lnEnc/E0)."""
        own = (self.B_end - self.B_top) - (self.A_end - self.A_top)
        return own + sum(child.s_nc for child in self.children)


class Placed(NamedTuple):
    """A panel within its cycle.

    s_before, s_after: gains of the wells, off the panel's own path, passed uncaptured before and after it.
    absorbed: -log of the probability of passing them uncaptured.
    s_below: gain of passing uncaptured what lies below the panel's well's first value.
    """

    panel: Panel
    s_before: Any
    s_after: Any
    absorbed: Any
    s_below: Any

    @property
    def s(self) -> list[Any]:
        """Log E1 / E0 of a particle captured here and nowhere else. Source: Eq:lnE/E0."""
        return [s + self.s_before + self.s_after for s in self.panel.s]


@dataclass(frozen=True)
class Captures:
    """A cycle's captured particles: panels from nu_max to nu_min within each well.

    grids: on whose points panels may be sampled, by degree.
    """

    cycle: Cycle
    grids: dict[int, Grid]
    target: int
    root: SolvedWell

    @property
    def binary(self) -> Binary:
        """The numbers that all this is told in; they are to be computed with under its `working`."""
        return self.cycle.binary

    def grid(self, panel: Panel) -> Grid:
        """Return the grid on whose points a panel is sampled."""
        return self.grids[len(panel.nu) - 1]

    @property
    def s_not_captured(self) -> Any:
        """Log E1 / E0 of the particles never captured. Source: Eq:lnEnc/E0."""
        return self.root.s_nc

    @property
    def p_not_captured(self) -> Any:
        """Probability of staying in the chaotic zone. Source: Eq:ps at nu_min."""
        return self.binary.exp(-self.root.absorbed)

    @property
    def is_single(self) -> bool:
        """Tell whether a particle is captured at most once per cycle."""
        return not self.root.children

    @cached_property
    def placed(self) -> tuple[Placed, ...]:
        """All panels, a well's own before its children's."""
        zero = self.binary.zero
        return tuple(_placed(self.root, zero, zero, zero))

    @cached_property
    def point_masses(self) -> WeightedPoints:
        """The distribution of s as weighted points, exact for what the grid resolves."""
        return self._point_masses(self.root)

    def mean(self, f: Callable[[Any], Any]) -> Any:
        """Return the mean of f(log E1 / E0) over all particles, the uncaptured ones included."""
        return self.binary.fsum([w * f(s) for w, s in self.point_masses])

    def growth(self) -> Any:
        """Return m1, the integral of g - 1 - log g over all captures. Source: Eq:Erate."""
        binary, total = self.binary, self.binary.zero
        for panel in (placed.panel for placed in self.placed):
            density = [rate * binary.exp(-a) for rate, a in zip(panel.rate, panel.A, strict=True)]
            gain = [binary.expm1(log_g) - log_g for log_g in panel.log_g]
            total += self.grid(panel).integral([y * p for y, p in zip(gain, density, strict=True)])
        return total

    def taylor(self, q: Any, order: int) -> list[Any]:
        """Return the coefficients, up to `order`, of mean exp((q + x) s) in powers of x."""
        return self._taylor(self.root, self.binary.mpf(q), order)

    def captured(self, well: SolvedWell) -> WeightedPoints:
        """Return the particles captured on a well's own panels, from its top: d p_ell = exp(-A) dA."""
        exp, gain = self.binary.exp, well.B_top - well.A_top
        return [
            (weight * rate * exp(well.A_top - a), s - gain)
            for panel in well.panels
            for weight, rate, a, s in zip(self.grid(panel).weights, panel.rate, panel.A, panel.s, strict=True)
        ]

    def _point_masses(self, well: SolvedWell) -> WeightedPoints:
        binary = self.binary
        below: WeightedPoints = [(binary.one, binary.zero)]
        if well.children:
            grid = Grid(binary, 2 * (6 + self.target // 3))
            below = reduce(lambda x, y: convolve(grid, x, y), map(self._point_masses, well.children))
        spent = well.A_end - well.A_top
        passed = shifted(below, binary.exp(-spent), (well.B_end - well.B_top) - spent)
        return self.captured(well) + passed

    def _taylor(self, well: SolvedWell, q: Any, order: int) -> list[Any]:
        binary, spent = self.binary, well.A_end - well.A_top
        passed = _exponential(binary, binary.exp(-spent), (well.B_end - well.B_top) - spent, q, order)
        for child in well.children:
            passed = product(passed, self._taylor(child, q, order))
        terms = [_exponential(binary, w, s, q, order) for w, s in self.captured(well)]
        return [binary.fsum(column) for column in zip(passed, *terms, strict=True)]


def _exponential(binary: Binary, weight: Any, s: Any, q: Any, order: int) -> list[Any]:
    """Return the coefficients of weight exp((q + x) s) in powers of x."""
    terms = [weight * binary.exp(q * s)]
    for k in range(1, order + 1):
        terms.append(terms[-1] * s / k)
    return terms


def _placed(well: SolvedWell, before: Any, after: Any, absorbed: Any) -> Iterator[Placed]:
    for panel in well.panels:
        yield Placed(panel, before, after, absorbed, well.s_nc + well.B_top - well.A_top)
    for i, child in enumerate(well.children):
        early, late = well.children[:i], well.children[i + 1 :]
        yield from _placed(
            child,
            before + sum(other.s_nc for other in early),
            after + sum(other.s_nc for other in late),
            absorbed + sum(other.absorbed for other in early + late),
        )


class Headway:
    """How far a resolution has come: the share of its pieces that is sampled, which never falls."""

    def __init__(self, n_pieces: int, on_progress: Callable[[float], None] | None) -> None:
        self._n_pieces, self._on_progress = n_pieces, on_progress
        self._n_done, self._most = 0, 0.0

    def at(self, share: float) -> None:
        """Tell that a share of the present piece is sampled; of 1, that it is done."""
        # A part that turns out to be unresolved is sampled again by halves: the share waits for these.
        self._most = max(self._most, (self._n_done + share) / self._n_pieces)
        if self._on_progress is not None:
            self._on_progress(self._most)
        self._n_done += share == 1.0


def captures(cycle: Cycle, target: int, on_progress: Callable[[float], None] | None = None) -> Captures:
    """Resolve a cycle's captured particles by Chebyshev panels.

    Args:
        cycle: the cycle.
        target: decimals to which a, b and log g are resolved, at most digits + GUARD of the cycle.
        on_progress: called with the share of the work that is done, again and again.

    Raises:
        NotConverged: panels as small as `most_halvings` allows do not resolve it, or the mouth nearly closes.
    """
    if cycle.nu_min < NARROWEST * cycle.nu_max:
        share = cycle.ctx.nstr(cycle.nu_min / cycle.nu_max, 3)
        raise NotConverged(f"the mouth closes to {share} of its widest, must stay above {NARROWEST:g} of it")
    binary, headway = cycle.binary, Headway(len(cycle.pieces), on_progress)
    with binary.working():
        grids = grids_for(binary, target)
        start = binary.zero, binary.zero
        root = _solved_well(cycle, list(grids.values()), cycle.well, start, target, headway)
    return Captures(cycle, grids, target, root)


def grids_for(binary: Binary, target: int) -> dict[int, Grid]:
    """Return the grids, by degree from low to high, of which each has every other point of the next."""
    degrees = [even_degree(2 * (12 + target))]
    while (n := degrees[0] // 2) % 2 == 0 and n >= FEWEST:
        degrees.insert(0, n)
    return {n: Grid(binary, n) for n in degrees}


def _solved_well(
    cycle: Cycle, grids: list[Grid], well: NuWell, start: tuple[Any, Any], target: int, headway: Headway
) -> SolvedWell:
    A, B = start
    panels: list[Panel] = []
    for piece in well.pieces:
        panels += _resolved(cycle, grids, piece, (A, B), target, headway)
        A, B = panels[-1].A[-1], panels[-1].B[-1]
    children = tuple(_solved_well(cycle, grids, child, (A, B), target, headway) for child in well.children)
    return SolvedWell(tuple(panels), children, *start, A, B)


def _resolved(
    cycle: Cycle,
    grids: list[Grid],
    piece: CapturePiece,
    start: tuple[Any, Any],
    target: int,
    headway: Headway,
) -> list[Panel]:
    panels: list[Panel] = []
    descent, most = Descent(cycle.binary, piece), most_halvings(cycle)
    todo = [(0, 0)]  # part i of the piece's 2^halvings equal parts in u
    while todo:
        i, halvings = todo.pop()
        panel = _panel(cycle, grids, descent, (i, halvings), start, target, headway)
        if panel is not None:
            panels.append(panel)
            start = panel.A[-1], panel.B[-1]
        elif halvings < most:
            todo += [(2 * i + 1, halvings + 1), (2 * i, halvings + 1)]
        else:
            nu, _ = descent.at(i * 0.5**halvings)
            raise NotConverged(
                f"the cycle is not resolved to {target} digits near nu = {float(nu):.6g}"
                f" by panels of 2^-{most} of a piece"
            )
    headway.at(1.0)
    return panels


def most_halvings(cycle: Cycle) -> int:
    """Return how often a piece may be halved, which is enough wherever its functions have a singularity.

    Singularities on a branch lie at the values of nu at its knots and critical points. Values that differ by
    more than `theory.cycle.tolerance` are ends of pieces; what differs by less is one value. So a
    singularity is an end of the piece, or further off the end than the tolerance. Its orders, and its `top`
    and `bottom`, take away the nearest one at each end. A part as short as the tolerance is resolved whatever
    else is near, and so is any other that is shorter than its distance. What lies beside the real line may be
    nearer still, and is given up.
    """
    return min(MAX_HALVINGS, int((cycle.ctx.dps - 10) * log2(10)))


class Descent:
    """A piece as functions of x on [0, 1], along which nu falls.

    The polynomial I(u) takes nu from the piece's `top` to its `bottom`. Where these lie beyond its ends, the
    piece takes only a part of u.
    """

    def __init__(self, binary: Binary, piece: CapturePiece) -> None:
        self.binary, self.piece = binary, piece.changed(binary.taken)
        (self._top, p), (bottom, q) = self.piece.top, self.piece.bottom
        self._drop, self._orders, m = self._top - bottom, (p, q), p + q - 1
        self._powers = [(j, m - j, comb(m, j)) for j in range(p, m + 1)]
        self._start, stop = self._place(self.piece.nu_upper), self._place(self.piece.nu_lower)
        self._length = stop - self._start

    def at(self, x: Any) -> tuple[Any, Any]:
        """Return nu and d nu / dx."""
        share, slope = self._share(self._start + x * self._length)
        # Rounding of an end would cost half the digits of the time at which nu turns.
        ends = {0: self.piece.nu_upper, 1: self.piece.nu_lower}
        return ends.get(x, self._top - self._drop * share), -self._drop * slope * self._length

    def point(self, x: Any, width: Any) -> tuple[Any, ...]:
        """Return nu, t_in, t_out, dA / dy, dB / dy and log g at x, y from 0 to 1 over a part of x so wide."""
        binary, (nu, slope) = self.binary, self.at(x)
        root = binary.sqrt((1 - nu) * (1 + nu))
        free = 2 * (binary.asin(nu) + nu * root) / binary.pi
        stretches = self.piece.capture, self.piece.release
        t_in, t_out = (stretch.in_binary(nu) for stretch in stretches)
        shares = (s.motion.stem_share(t, nu) for s, t in zip(stretches, (t_in, t_out), strict=True))
        a, b = (1 / (free + share) for share in shares)  # V_cap / V_cha
        d_delta = -4 * root / binary.pi * slope * width
        return nu, t_in, t_out, a * d_delta, b * d_delta, binary.log(b / a)

    def _share(self, u: Any) -> tuple[Any, Any]:
        """Return I(u), the regularised incomplete beta function with integers p, q >= 1, and dI / du."""
        (p, q), v = self._orders, 1 - u
        share = sum(number * u**j * v**k for j, k, number in self._powers)
        return share, p * comb(p + q - 1, p) * u ** (p - 1) * v ** (q - 1)

    def _place(self, nu: Any) -> Any:
        wanted, one = (self._top - nu) / self._drop, self.binary.one
        if wanted in (0, 1):
            return wanted

        def rising(u: Any) -> tuple[Any, Any]:
            share, slope = self._share(u)
            return share - wanted, slope

        return solve_rising(self.binary, rising, self.binary.zero, one)


def _panel(
    cycle: Cycle,
    grids: list[Grid],
    descent: Descent,
    part: tuple[int, int],
    start: tuple[Any, Any],
    target: int,
    headway: Headway,
) -> Panel | None:
    """Sample a part of a piece and integrate from `start` = (A, B); None when it is not resolved.

    It is sampled on one grid after another, given up where one shows that the next will not do. Coefficients
    fall geometrically, or more slowly near a singularity: were that wrong, the part would only be halved once
    more than needed.
    """
    ctx, width, n = cycle.ctx, cycle.binary.ldexp(cycle.binary.one, -part[1]), grids[-1].n
    swing = cycle.binary.taken(free_share(ctx, cycle.nu_max) - free_share(ctx, cycle.nu_min))
    known: dict[int, tuple[Any, ...]] = {}
    for grid in grids:
        places = range(0, n + 1, n // grid.n)
        headway.at((part[0] + len(known) / (n + 2)) * 0.5 ** part[1])
        new = [k for k in places if k not in known]
        samples = [descent.point((part[0] + grids[-1].points[k]) * width, width) for k in new]
        known.update(zip(new, samples, strict=True))
        nu, t_in, t_out, dA, dB, log_g = (
            list(column) for column in zip(*map(known.get, places), strict=True)
        )
        c_A, c_B, c_g = map(grid.coefficients, (dA, dB, log_g))
        # Of a narrow mouth a and b are large, and A and B in proportion.
        tail = max(_tail(c_g), *(_tail(c) / max(swing, *map(abs, c)) for c in (c_A, c_B)))
        share = 1 if grid.n == n else PROMISE * grid.n / n
        if tail > cycle.binary.mpf(10) ** (-target * share):
            return None
    A, B = ([at + rise for rise in grid.running_integral(c)] for at, c in zip(start, (c_A, c_B), strict=True))
    return Panel(nu, t_in, t_out, dA, log_g, A, B)


def _tail(coefficients: list[Any]) -> Any:
    return max(abs(c) for c in coefficients[-max(len(coefficients) // 6, 3) :])
