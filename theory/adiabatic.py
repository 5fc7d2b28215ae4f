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
interpolation resolves them, each on as few points as will do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass
from functools import cached_property, reduce
from math import comb, log2
from typing import Any, NamedTuple

from scene.refusal import BadInput
from theory.chebyshev import Grid, WeightedPoints, convolve, even_degree, product
from theory.critical import solve_rising
from theory.cycle import GUARD, CapturePiece, Cycle, NuWell
from theory.precision import Binary
from theory.volumes import free_share

MAX_HALVINGS = 256  # a panel of 2^-256 of its piece
NARROWEST = 1e-20  # of the widest mouth: `tolerance` of the cycle and rounding stay far below what nu is

FEWEST = 16  # degree of the grid at which a part is first tried; its points are among those of the next
PROMISE = 0.92  # of the digits wanted, in proportion to its degree, are to be seen on such a grid


Sample = tuple[Any, Any, Any, Any, Any, Any]  # nu, t_in, t_out, dA / dx, dB / dx, log g


class NotConverged(BadInput):
    """The digits asked for were not reached within the limit of work."""


class Panel(NamedTuple):
    """Values at the Chebyshev points of a part of a piece, nu falling.

    A and B run on from the panel before; `rate` and `B_rate` are dA / dx and dB / dx with x in [0, 1] across
    the panel. p_cha is exp(-A).
    """

    grid: Grid
    descent: Descent
    nu: list[Any]
    t_in: list[Any]
    t_out: list[Any]
    rate: list[Any]
    B_rate: list[Any]
    log_g: list[Any]
    A: list[Any]
    B: list[Any]
    p_cha: list[Any]

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
    def passed(self) -> Any:
        """Probability of not being captured on its own panels."""
        return Binary.exp(self.A_top - self.A_end)

    @property
    def gain(self) -> Any:
        """Gain in log E of passing its own panels uncaptured."""
        return (self.B_end - self.B_top) - (self.A_end - self.A_top)

    @property
    def captured(self) -> WeightedPoints:
        """The particles captured on its own panels, from its top: d p_ell = exp(-A) dA."""
        share, gain = Binary.exp(self.A_top), self.B_top - self.A_top
        return [
            (share * weight * rate * p, s - gain)
            for panel in self.panels
            for weight, rate, p, s in zip(panel.grid.weights, panel.rate, panel.p_cha, panel.s, strict=True)
        ]

    @property
    def absorbed(self) -> Any:
        """-log of the probability of passing the whole well uncaptured (Eq:ps)."""
        return self.A_end - self.A_top + sum(child.absorbed for child in self.children)

    @property
    def s_nc(self) -> Any:
        """Gain in log E of passing it uncaptured (Eq:lnEnc/E0)."""
        return self.gain + sum(child.s_nc for child in self.children)


class Placed(NamedTuple):
    """A panel within its cycle.

    s: log E1 / E0 of a particle captured here and nowhere else (Eq:lnE/E0).
    s_before: gain of the wells, off the panel's own path, passed uncaptured before it.
    absorbed: -log of the probability of passing all wells off that path uncaptured.
    s_below: gain of passing uncaptured what lies below the panel's well's first value.
    """

    panel: Panel
    s: list[Any]
    s_before: Any
    absorbed: Any
    s_below: Any


@dataclass(frozen=True)
class Captures:
    """A cycle's captured particles: panels from nu_max to nu_min within each well."""

    cycle: Cycle
    target: int
    root: SolvedWell

    @property
    def binary(self) -> Binary:
        """The numbers that all this is told in; they are to be computed with under its `working`."""
        return self.cycle.binary

    @property
    def p_not_captured(self) -> Any:
        """Probability of staying in the chaotic zone. Source: Eq:ps at nu_min."""
        return self.binary.exp(-self.root.absorbed)

    @cached_property
    def placed(self) -> tuple[Placed, ...]:
        """All panels, a well's own before its children's."""
        zero = self.binary.zero
        return tuple(_placed(self.root, zero, zero, zero))

    def growth(self) -> Any:
        """Return m1, the integral of g - 1 - log g over all captures. Source: Eq:Erate."""
        total = self.binary.zero
        for panel in (placed.panel for placed in self.placed):
            columns = zip(panel.rate, panel.B_rate, panel.log_g, panel.p_cha, strict=True)
            total += panel.grid.integral([(b - a - a * log_g) * p for a, b, log_g, p in columns])
        return total

    def taylor(self, q: Any, order: int) -> list[Any]:
        """Return the coefficients, up to `order`, of mean exp((q + x) s) in powers of x."""
        return mean_exponential(self.binary, self.root, q, order)

    def point_masses(self, well: SolvedWell | None = None) -> WeightedPoints:
        """Return the distribution of s as weighted points, exact for what grids resolve; of a well or all."""
        binary, well = self.binary, well or self.root
        below: WeightedPoints = [(binary.one, binary.zero)]
        if well.children:
            grid = Grid(binary, 2 * (6 + self.target // 3))
            below = reduce(lambda x, y: convolve(grid, x, y), map(self.point_masses, well.children))
        return well.captured + [(well.passed * w, s + well.gain) for w, s in below]


def mean_exponential(system: Any, well: Any, q: Any, order: int) -> list[Any]:
    """Return the coefficients, up to `order`, of the mean of exp((q + x) s) over a well in powers of x.

    Args:
        system: number system.
        well: a `SolvedWell`, or a `theory.branches.Node` in binary64.
        q: the exponent.
        order: the highest power.
    """
    passed = _exponential(system, well.passed, well.gain, q, order)
    for child in well.children:
        passed = product(passed, mean_exponential(system, child, q, order))
    terms = [_exponential(system, w, s, q, order) for w, s in well.captured]
    return [system.fsum(column) for column in zip(passed, *terms, strict=True)]


def least_exponential(system: Any, well: Any) -> Any:
    """Return the q in (-1, 0) at which the mean of exp(q s) over a well is least."""

    def slope(q: Any) -> tuple[Any, Any]:
        _, first, second = mean_exponential(system, well, q, 2)
        return first, 2 * second

    return solve_rising(system, slope, -system.one, system.zero)


def _exponential(system: Any, weight: Any, s: Any, q: Any, order: int) -> list[Any]:
    """Return the coefficients of weight exp((q + x) s) in powers of x."""
    terms = [weight * system.exp(q * s)]
    for k in range(1, order + 1):
        terms.append(terms[-1] * s / k)
    return terms


def _placed(well: SolvedWell, before: Any, after: Any, absorbed: Any) -> Iterator[Placed]:
    for panel in well.panels:
        s = [s + before + after for s in panel.s]
        yield Placed(panel, s, before, absorbed, well.s_nc + well.B_top - well.A_top)
    for i, child in enumerate(well.children):
        early, late = well.children[:i], well.children[i + 1 :]
        yield from _placed(
            child,
            before + sum(other.s_nc for other in early),
            after + sum(other.s_nc for other in late),
            absorbed + sum(other.absorbed for other in early + late),
        )


def silent(_: float) -> None:
    """Tell nobody of progress."""


class Headway:
    """How far a resolution has come: the share of its pieces that is sampled, which never falls."""

    def __init__(self, n_pieces: int, on_progress: Callable[[float], None]) -> None:
        self._n_pieces, self._on_progress = n_pieces, on_progress
        self._n_done, self._most = 0, 0.0

    def at(self, share: float) -> None:
        """Tell that a share of the present piece is sampled; of 1, that it is done."""
        # A part that turns out to be unresolved is sampled again by halves: the share waits for these.
        self._most = max(self._most, (self._n_done + share) / self._n_pieces)
        self._on_progress(self._most)
        self._n_done += share == 1.0


def captures(cycle: Cycle, target: int, on_progress: Callable[[float], None] = silent) -> Captures:
    """Resolve a cycle's captured particles by Chebyshev panels.

    Args:
        cycle: the cycle.
        target: decimals to which times, a, b and log g are resolved, at most digits + GUARD of the cycle.
        on_progress: called with the share of the work that is done, again and again.

    Raises:
        NotConverged: panels of 2^-MAX_HALVINGS of a piece do not resolve it, or the mouth nearly closes.
    """
    if cycle.nu_min < NARROWEST * cycle.nu_max:
        share = cycle.ctx.nstr(cycle.nu_min / cycle.nu_max, 3)
        raise NotConverged(f"the mouth closes to {share} of its widest, must stay above {NARROWEST:g} of it")
    binary, headway = cycle.binary, Headway(len(cycle.pieces), on_progress)
    with binary.working():
        degrees = [even_degree(2 * (12 + target))]
        while (n := degrees[0] // 2) % 2 == 0 and n >= FEWEST:
            degrees.insert(0, n)
        grids = [Grid(binary, n) for n in degrees]  # each has every other point of the next

        def resolved(piece: CapturePiece) -> list[Sampled]:
            return _resolved(cycle, grids, piece, target, headway)

        root = _solved_well(cycle.well, (binary.zero, binary.zero), resolved)
    return Captures(cycle, target, root)


def refined(found: Captures, on_progress: Callable[[float], None] = silent) -> Captures:
    """Return captured particles by the same panels with twice the points, half of which are known.

    Args:
        found: from `captures`.
        on_progress: as for `captures`.
    """
    binary, headway = found.binary, Headway(len(found.placed), on_progress)
    with binary.working():
        grids = {n: Grid(binary, 2 * n) for n in {placed.panel.grid.n for placed in found.placed}}

        def doubled(panel: Panel) -> list[Sampled]:
            grid, known = grids[panel.grid.n], list(zip(*panel[2:8], strict=True))
            samples = _with_between(known, grid, panel.descent)
            headway.at(1.0)
            return [(grid, panel.descent, samples)]

        root = _solved_well(found.root, (binary.zero, binary.zero), doubled)
    target = min(int(2 * PROMISE * found.target), found.cycle.digits + GUARD - 8)
    return Captures(found.cycle, target, root)


def _solved_well(
    well: NuWell | SolvedWell, start: tuple[Any, Any], sampled: Callable[[Any], list[Sampled]]
) -> SolvedWell:
    """Integrate over a well from A and B at its top, each of its parts sampled by a function."""
    A, B = start
    panels: list[Panel] = []
    for part in well.pieces if isinstance(well, NuWell) else well.panels:
        for found in sampled(part):
            panels.append(_panel(*found, (A, B)))
            A, B = panels[-1].A[-1], panels[-1].B[-1]
    children = tuple(_solved_well(child, (A, B), sampled) for child in well.children)
    return SolvedWell(tuple(panels), children, *start, A, B)


def _resolved(
    cycle: Cycle, grids: list[Grid], piece: CapturePiece, target: int, headway: Headway
) -> list[Sampled]:
    """Sample a piece, in parts as short as the grids need."""
    parts: list[Sampled] = []
    swing = cycle.binary.taken(free_share(cycle.ctx, cycle.nu_max) - free_share(cycle.ctx, cycle.nu_min))
    # Singularities on a branch lie at the values of nu at its knots and critical points. Values that differ
    # by more than `theory.cycle.tolerance` are ends of pieces; what differs by less is one value. So a
    # singularity is an end of the piece, or further off the end than the tolerance. Its orders, and its `top`
    # and `bottom`, take away the nearest one at each end. A part as short as the tolerance is resolved
    # whatever else is near, and so is any other that is shorter than its distance. What lies beside the real
    # line may be nearer still, and is given up.
    most = min(MAX_HALVINGS, int((cycle.ctx.dps - 10) * log2(10)))
    todo = [Descent(cycle.binary, piece)]
    while todo:
        descent = todo.pop()
        found = _sampled(grids, descent, target, swing, headway)
        if found is not None:
            parts.append(found)
        elif descent.halvings < most:
            todo += descent.halves()
        else:
            nu, _ = descent.at(0)
            raise NotConverged(
                f"the cycle is not resolved to {target} digits near nu = {float(nu):.6g}"
                f" by panels of 2^-{most} of a piece"
            )
    headway.at(1.0)
    return parts


class Descent:
    """A piece, or one of the 2^halvings equal parts of it, as functions of x on [0, 1], along which nu falls.

    The polynomial I(u) takes nu from the piece's `top` to its `bottom`. Where these lie beyond its ends, the
    piece takes only a part of u.
    """

    def __init__(self, binary: Binary, piece: CapturePiece) -> None:
        self.binary, self.number, self.halvings = binary, 0, 0
        self.piece = CapturePiece(*(stretch.changed(binary.taken) for stretch in piece))
        (self._top, p), (bottom, q) = self.piece.top, self.piece.bottom
        self._drop, self._orders, m = self._top - bottom, (p, q), p + q - 1
        self._powers = [(j, m - j, comb(m, j)) for j in range(p, m + 1)]
        self._start, stop = self._place(self.piece.nu_upper), self._place(self.piece.nu_lower)
        self._length, self._2_by_pi = stop - self._start, 2 / binary.pi

    def halves(self) -> list[Descent]:
        """Return the two halves, the later one first."""
        late, early = copy(self), copy(self)
        late.number, early.number = 2 * self.number + 1, 2 * self.number
        late.halvings = early.halvings = self.halvings + 1
        return [late, early]

    def at(self, x: Any) -> tuple[Any, Any]:
        """Return nu and d nu / dx."""
        width = self.binary.ldexp(self._length, -self.halvings)
        share, slope = self._share(self._start + (self.number + x) * width)
        nu = self._top - self._drop * share
        # Rounding of an end would cost half the digits of the time at which nu turns.
        if x + self.number == 0:
            nu = self.piece.nu_upper
        elif x + self.number == 1 << self.halvings:
            nu = self.piece.nu_lower
        return nu, -self._drop * slope * width

    def point(self, x: Any) -> Sample:
        """Return nu, t_in, t_out, dA / dx, dB / dx and log g at x."""
        binary, (nu, slope) = self.binary, self.at(x)
        root = binary.sqrt((1 - nu) * (1 + nu))
        free = self._2_by_pi * (binary.asin(nu) + nu * root)
        capture, release = self.piece
        t_in, t_out = capture.in_binary(nu), release.in_binary(nu)
        d_delta = -2 * self._2_by_pi * root * slope
        a = 1 / (free + capture.motion.stem_share(t_in, nu))  # V_cap / V_cha
        b = 1 / (free + release.motion.stem_share(t_out, nu))
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


Sampled = tuple[Grid, Descent, list[Sample]]  # a part of a piece on a grid that resolves it


def _sampled(
    grids: list[Grid], descent: Descent, target: int, swing: Any, headway: Headway
) -> Sampled | None:
    """Sample a part of a piece on the first grid that resolves it; None when none does.

    It is given up where a grid shows that the next will not do. Coefficients fall geometrically, or more
    slowly near a singularity: were that wrong, the part would only be halved once more than needed.
    """
    samples = [descent.point(x) for x in grids[0].points[::2]]
    for grid in grids:
        headway.at((descent.number + 1 - grids[0].n / grid.n) * 0.5**descent.halvings)
        samples = _with_between(samples, grid, descent)
        _, *columns = map(list, zip(*samples, strict=True))
        *times, c_A, c_B, c_g = map(grid.coefficients, columns)
        # Of a narrow mouth a and b are large, and A and B in proportion. Where only the mouth moves, times
        # may be less smooth than these.
        tails = [_tail(c) / max(swing, *map(abs, c)) for c in (c_A, c_B)]
        tail = max(_tail(c_g), *tails, *(_tail(c) / max(map(abs, c)) for c in times))
        n_digits = -descent.binary.log10(tail)
        if n_digits >= target:
            return grid, descent, samples
        if n_digits < target * PROMISE * grid.n / grids[-1].n:
            break
    return None


def _with_between(known: list[Sample], grid: Grid, descent: Descent) -> list[Sample]:
    """Return samples at all points of a grid, of which those at every other one are known."""
    new = [descent.point(x) for x in grid.points[1::2]]
    samples = [*known, *new]
    samples[::2], samples[1::2] = known, new
    return samples


def _panel(grid: Grid, descent: Descent, samples: list[Sample], start: tuple[Any, Any]) -> Panel:
    """Integrate over a part of a piece from `start`."""
    nu, t_in, t_out, rate, B_rate, log_g = map(list, zip(*samples, strict=True))
    A, B = (
        [at + rise for rise in grid.running_integral(grid.coefficients(values))]
        for at, values in zip(start, (rate, B_rate), strict=True)
    )
    p_cha = [descent.binary.exp(-a) for a in A]
    return Panel(grid, descent, nu, t_in, t_out, rate, B_rate, log_g, A, B, p_cha)


def _tail(coefficients: list[Any]) -> Any:
    return max(abs(c) for c in coefficients[-max(len(coefficients) // 6, 3) :])
