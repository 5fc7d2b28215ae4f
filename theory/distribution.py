"""The distribution of s = log E1 / E0 over one cycle and over many, in binary64; how rare losses are.

One cycle: a point mass at s_nc; particles captured once, whose implicit density (Eq:lnE/E0 with Eq:ps) is
integrated exactly; those captured more often, a convolution on a lattice (right to about 1e-6).
Many cycles, taken as independent (sec. 4.2, Fig:n=10): powers of the Fourier transform of the
lattice distribution. The lattice's origin is the uncaptured energy, so the point mass is one of its points.
The mass of a particle between two points is shared among them so that mass and mean are kept; its variance
grows by at most step^2 / 4. So the step has to be small against what s does: it is STEP of the reach of s
in one cycle, which in a nearly trivial cycle may be far below 1. Far tails are
smaller than the rounding of the transform unless the distribution is first tilted by exp(q s).

With Phi(q) = mean exp(q s) over one cycle the probability of E_n < E_0 falls as exp(-n I),
I = -min log Phi (Cramer 1938). Phi is convex, Phi(-1) = Phi(0) = 1: its minimum lies between. The reversed
cycle has Phi(-1 - q) for Phi(q), hence the same I; a loop that is its own reverse has its minimum at -1/2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from mpmath import fp
from numpy.typing import ArrayLike, NDArray

from scene.precision import reduce_record
from scene.refusal import BadInput, check_count, check_number, shown
from scene.tables import Scene
from theory.adiabatic import Captures, least_exponential, mean_exponential
from theory.branches import UNRESOLVED, Branch, Floats, Node, X, at, noise, rising_edges, tree
from theory.precision import finite_array, guarded
from theory.prediction import converged

STEP = 2.0**-12  # the lattice's, at best, and as a share of one cycle's reach
LEAST_REACH = 1e-12  # of s in a cycle; below, its differences are partly rounding
MAX_POINTS = 2**20
MAX_CYCLES = 10_000
LEAST = 1e-24  # mean of s, a half of its variance: below, every particle keeps its energy
KEPT = 4 * UNRESOLVED  # of s: a smaller change is none: its sign is rounding
LARGEST_EXPONENT = 600.0  # exp of it stays finite, and so do sums

Complexes = NDArray[np.complex128]


class Energies:
    """The distribution of s over one cycle.

    Attributes:
        p_nc: probability of never being captured (Eq:ps).
        s_nc: s of the particles never captured (Eq:lnEnc/E0).
    """

    def __init__(self, root: Node) -> None:
        if not isinstance(root, Node):
            raise BadInput(f"root = {shown(root)}, must be a solved cycle: use theory.energies(scene)")
        self.root = root
        self.p_nc, self.s_nc = root.p_nc, root.s_nc
        self._often = Lattice(root, 1) if root.children else None

    def captured_below(self, s: Floats) -> Floats:
        """Return the probability of being captured and ending at or below each s."""
        s = finite_array("s", s)
        total = np.zeros_like(s)
        for branch in self.root.all_branches():
            total += np.exp(-branch.absorbed) * branch.below(branch.s, s, noise(branch.s))
        return total + self._often.often_below(s) if self._often else total

    def cdf(self, s: Floats) -> Floats:
        """Return the probability of log E1 / E0 <= s."""
        s = finite_array("s", s)
        return self.captured_below(s) + np.where(s >= self.s_nc - UNRESOLVED, self.p_nc, 0.0)

    def lost(self) -> float:
        """Return the probability of E1 < E0. Particles that keep it within rounding are not counted."""
        return float(self.cdf(np.array([-KEPT]))[0])


def energies(found: Energies | Scene) -> Energies:
    """Compute the distribution of energies of one cycle, to be used in further calls.

    Args:
        found: a valid mushroom, or an `Energies`, which is returned.

    Raises:
        NotCovered, NotConverged: as `theory.predict`.
    """
    return found if isinstance(found, Energies) else Energies(tree(found))


def energy_cdf(found: Energies | Scene, s: ArrayLike) -> Floats:
    """Return the probability of log E1 / E0 <= s, with the particles never captured.

    Args:
        found: from `energies`, or a scene to solve.
        s: any shape.

    Returns:
        An array of that shape. The error is about 1e-14, and larger near caustics: at most 1e-7. If a
        particle can be captured several times in a cycle, the error is about 1e-6. It may be larger if the
        range of s is below LEAST_REACH, or if most captured particles lie in a hundredth of this range.
        The particles never captured make a step at log_e_nc. At finite energy this step is a peak. So compare
        simulated energies with `Energies.captured_below`, or away from log_e_nc.

    Source: Eq:lnE/E0 with Eq:ps.
    """
    levels = finite_array("s", s)
    return energies(found).cdf(levels.ravel()).reshape(levels.shape)


def energy_density(scene: Scene, edges: ArrayLike) -> Floats:
    """Return the probability of being captured and ending with log E1 / E0 in each bin.

    Args:
        scene: as for `theory.predict`.
        edges: bin edges, rising, at least two; a histogram's.

    Returns:
        Probabilities, one per bin. Over all s they add up to 1 - p_nc: particles never captured do
        not count.

    Raises:
        BadInput: edges do not rise.
        NotCovered, NotConverged: as `theory.predict`.

    Source: Eq:lnE/E0 with Eq:ps.
    """
    bounds = rising_edges(edges)
    return np.diff(energies(scene).captured_below(bounds))


class Lattice:
    """A cycle's distribution of d = s - s_nc on equidistant points, by its Fourier transform.

    Args:
        root: the solved cycle.
        n_cycles: how many cycles' sum must fit.
        tilt: q; every probability is multiplied by exp(q d).
    """

    def __init__(self, root: Node, n_cycles: int, tilt: float = 0.0) -> None:
        one = _reach(root, root.s_nc)
        low, high = (n_cycles * d for d in one)
        # Densities are of order 1 / reach, and jump by as much: the error is of order (step / reach)^2.
        own = STEP * min(1.0, max(one[1] - one[0], LEAST_REACH))
        self.step = max(own, (high - low) / (MAX_POINTS - 16))
        self.n_points = 1 << int(np.ceil(np.log2((high - low) / self.step + 16)))
        self.first = int(np.floor(low / self.step)) - 4
        self.root, self.s_nc, self.tilt = root, root.s_nc, tilt
        self.places = self.step * (self.first + np.arange(self.n_points))
        self.transform = self._transform(root)

    def masses(self, transform: Complexes) -> Floats:
        """Return the masses at `places` that have this Fourier transform."""
        return np.roll(np.fft.irfft(transform, self.n_points), -self.first)

    def still(self) -> Complexes:
        """Return the transform of particles that keep their energy: in every well, or as the uncaptured do.

        They are a point mass at s = 0, which the lattice shares among its points.
        """
        kept = abs(self.s_nc) <= KEPT and not _is_still(self.root)
        return self._transform(self.root, KEPT) + (self.root.p_nc if kept else 0.0)

    def often_below(self, s: Floats) -> Floats:
        """Return the probability of being captured twice or more and ending at or below each s."""
        once = sum(np.exp(-b.absorbed) * self._captured(b) for b in self.root.all_branches())
        masses = self.masses(self.transform - self.root.p_nc - once)
        return np.interp(s - self.s_nc, self.places, cumulated(masses))

    def _transform(self, node: Node, most: float = math.inf) -> Complexes:
        """Return the transform of what a well does to particles whose s it changes by no more than `most`."""
        # From the well's top, d counted from its own uncaptured energy.
        passed = node.passed if abs(node.gain) <= most else 0.0
        found: Complexes = np.full(self.n_points // 2 + 1, passed, dtype=np.complex128)
        for child in node.children:
            found *= self._transform(child, most)
        # From the well's top, panel after panel.
        every = np.array([s for _, s in node.captured])
        gains = np.split(every, np.cumsum([len(branch.s) for branch in node.branches])[:-1])
        for branch, gain in zip(node.branches, gains, strict=False):
            if np.abs(gain).max() <= most:
                found += self._captured(branch) / node.p_top
        return found

    def _captured(self, branch: Branch) -> Complexes:
        s, p = at(branch.s, X), branch.chaotic(X)
        d = (s[1:] + s[:-1]) / 2 - self.s_nc
        mass = (p[:-1] - p[1:]) * np.exp(self.tilt * d)
        index = np.floor(d / self.step)
        right = d / self.step - index
        shared = np.zeros(self.n_points)
        np.add.at(shared, index.astype(int) % self.n_points, mass * (1 - right))
        np.add.at(shared, (index.astype(int) + 1) % self.n_points, mass * right)
        return np.fft.rfft(shared)


def cumulated(masses: Floats) -> Floats:
    """Return the distribution function at points whose masses lie spread around them."""
    return np.cumsum(masses) - masses / 2


def _is_still(node: Node) -> bool:
    """Tell whether the uncaptured keep their energy in every well."""
    return abs(node.gain) <= KEPT and all(map(_is_still, node.children))


def _reach(node: Node, s_nc: float) -> tuple[float, float]:
    """Return bounds on d = s - s_nc of all that may happen in a well."""
    inner = [_reach(child, s_nc) for child in node.children]
    own = [d for b in node.branches for d in (at(b.s, X).min() - s_nc, at(b.s, X).max() - s_nc)]
    return min([sum(low for low, _ in inner), *own]), max([sum(high for _, high in inner), *own])


class Sum:
    """log E_n / E0 after n independent cycles.

    Attributes:
        n_cycles: n.
        p_nc: probability of never being captured in n cycles.
        s_nc: log E_n / E0 of these particles.
        places: shape (m,), equidistant.
        masses: shape (m,), probabilities of all other particles around each place.
        step: distance between neighbouring places.
    """

    def __init__(self, root: Node, n_cycles: int, q: float = 0.0) -> None:
        if not isinstance(root, Node):
            raise BadInput(
                f"root = {shown(root)}, must be a solved cycle: use theory.sum_of_cycles(scene, n)"
            )
        n_cycles, q = check_count("n_cycles", n_cycles, 1, MAX_CYCLES), check_number("q", q)
        reach = n_cycles * max(abs(d) for d in _reach(root, root.s_nc))
        if abs(q) * reach > LARGEST_EXPONENT:
            raise BadInput(f"q = {q}, must be within +-{LARGEST_EXPONENT / reach:.6g} for {n_cycles} cycles")
        lattice = Lattice(root, n_cycles, q)
        norm = lattice.transform[0].real
        powers = (lattice.transform / norm) ** n_cycles - (root.p_nc / norm) ** n_cycles
        untilt = np.exp(n_cycles * np.log(norm) - q * lattice.places)
        self.n_cycles, self.step = n_cycles, lattice.step
        self.p_nc, self.s_nc = root.p_nc**n_cycles, n_cycles * root.s_nc
        self.masses = lattice.masses(powers) * untilt
        self.places = self.s_nc + lattice.places

    def mean_of(self, f: Callable[[Any], Any]) -> float:
        """Return the mean of f(log E_n / E0); f takes arrays."""
        return float(self.masses @ f(self.places) + self.p_nc * f(np.array([self.s_nc]))[0])

    def cdf(self, s: ArrayLike) -> Floats:
        """Return the probability of log E_n / E0 <= s."""
        levels = finite_array("s", s)
        captured = np.interp(levels, self.places, cumulated(self.masses))
        found: Floats = captured + np.where(levels >= self.s_nc, self.p_nc, 0.0)
        return found

    def density(self, s: ArrayLike) -> Floats:
        """Return the density of log E_n / E0 at s, for particles captured at least once."""
        found: Floats = np.interp(finite_array("s", s), self.places, self.masses / self.step)
        return found


def sum_of_cycles(found: Energies | Scene, n_cycles: int, *, q: float = 0.0) -> Sum:
    """Convolve n independent cycles.

    Args:
        found: from `energies`, or a scene to solve.
        n_cycles: n, 1 to MAX_CYCLES.
        q: exp(q s) weights the distribution in the calculation. With q = 0 all probabilities have an error
            of about 1e-12. With another q relative errors are small around the s with K'(q) = s / n
            (`theory.cumulants`), and large elsewhere.

    Returns:
        The distribution. Let R be the range of s in one cycle, at least LEAST_REACH. The mean n m1 is right
        to 1e-7 n R, and the variance n sd^2 to n (step^2 / 4 + 1e-7 R^2). Use q = -1 for the mean of exp(-s):
        it is right to n (step^2 / 4 + 1e-7 R). With q = 0 rounding spoils this mean: its error is larger by
        1e-15 exp(n L), where L is the largest loss in one cycle.

    Raises:
        BadInput: n_cycles out of bounds.
        NotCovered, NotConverged: as `theory.predict`.

    Source: sec. 4.2, Fig:n=10.
    """
    return Sum(energies(found).root, n_cycles, q)


class Rarity(NamedTuple):
    """How P(E_n < E_0) falls with n. The numbers are mpf.

    rate: I, per cycle; 0 if energies do not change.
    place: the q in (-1, 0) at which Phi is least; -1/2 if energies do not change.
    """

    rate: Any
    place: Any

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to keep every bit."""
        return reduce_record(self)


@guarded
def rarity(scene: Scene, digits: int = 15) -> Rarity:
    """Return the rate at which P(E_n < E_0) falls.

    Args:
        scene: as for `theory.predict`.
        digits: correct significant digits wanted.

    Raises:
        NotCovered, NotConverged: as `theory.predict`.
    """
    return Rarity(*converged(scene, digits, _least))


def _least(found: Captures) -> tuple[Any, ...]:
    binary = found.binary
    size = max((abs(s) for _, s in found.point_masses()), default=binary.zero)
    if size < binary.mpf(10) ** -found.target:
        return binary.zero, -binary.one / 2

    place = least_exponential(binary, found.root)
    return -binary.log(found.taylor(place, 0)[0]), place


def loss_probability(found: Energies | Scene, n_cycles: int) -> float:
    """Return the probability of E_n < E_0 after n independent cycles.

    A particle that keeps its energy does not count as a loss.

    Args:
        found: from `theory.energies`, or a scene to solve.
        n_cycles: n, 1 to 10,000.

    Returns:
        The probability, with a relative error of about 1e-4; 0 if it is below the range of binary64.

    Raises:
        BadInput: n_cycles out of bounds, or every particle keeps its energy.
        NotCovered, NotConverged: as `theory.predict`.
    """
    n_cycles, found = check_count("n_cycles", n_cycles, 1, MAX_CYCLES), energies(found)
    slopes = [mean_exponential(fp, found.root, q, 1)[1] for q in (-1.0, 0.0)]
    if not slopes[0] < -LEAST < LEAST < slopes[1]:
        raise BadInput("every particle keeps its energy in this cycle: nobody loses")
    return found.lost() if n_cycles == 1 else _lost(found, n_cycles, least_exponential(fp, found.root))


def _lost(found: Energies, n: int, place: float) -> float:
    """Sum the lattice's masses, tilted by exp(place s), below s = 0, its point mass apart."""
    lattice = Lattice(found.root, n, place)
    norm, still = lattice.transform[0].real, lattice.still()
    still_free = 0.0 if abs(found.s_nc) <= KEPT else found.p_nc
    powers = (lattice.transform / norm) ** n - (still / norm) ** n - (still_free / norm) ** n
    s = n * found.s_nc + lattice.places
    # Gains above are as far as they were tilted up, and would be nothing but rounding, blown up.
    near = s < 2 * lattice.step
    untilt = np.exp(n * np.log(norm) - place * lattice.places[near])
    captured = np.interp(0.0, s[near], cumulated(lattice.masses(powers)[near] * untilt))
    return float(captured + (still_free**n if found.s_nc < 0 else 0.0))
