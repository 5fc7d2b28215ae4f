"""The sum of many cycles by saddle point, tails included: what convolutions of the lattice must come to.

With K(q) = log mean exp(q s), the density of log E_n / E0 at n x is
    exp(n (K(q) - q x)) / sqrt(2 pi n K''(q)) (1 + (k4 / 8 - 5 k3^2 / 24) / n),  K'(q) = x,
with k3, k4 the standardised derivatives (Daniels 1954), and the tail follows Lugannani and Rice (1980).
Where the sum has a smooth density, relative errors are O(n^-2) for the density and O(n^-1) or better for the
tail. The formulas spread the atom of particles never captured, p_nc^n, over its neighbourhood: where it is
not small they are wrong near n s_nc.
"""

from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from scene.tables import Scene
from theory.branches import Floats, Node
from theory.chebyshev import logarithm, product
from theory.distribution import Energies, energies

LARGEST_EXPONENT = 300.0  # exp of it and its square stay finite
BISECTIONS = 80
NEAR_MEAN = 1e-3  # of |w|: nearer, the difference 1/u - 1/w is its limit to about this


class Saddle:
    """Cumulant generating function of one cycle's s = log E1 / E0, and sums of n cycles.

    Args:
        found: from `energies`, or a scene to solve, in which energies change.

    Attributes:
        slowest, fastest: K' at the ends of the usable q: the reach of s / n.
    """

    def __init__(self, found: Energies | Scene) -> None:
        self._root = energies(found).root
        self._largest = LARGEST_EXPONENT / _size(self._root)
        ends = self.cumulants(np.array([-self._largest, self._largest]))[1]
        self.slowest, self.fastest = float(ends[0]), float(ends[1])

    def cumulants(self, q: ArrayLike) -> Floats:
        """Return K, K', ..., K'''' at each q; shape (5, n)."""
        found = logarithm(np, list(_series(self._root, np.atleast_1d(q))))
        return np.array([factorial(k) * c for k, c in enumerate(found)])

    def place(self, x: ArrayLike) -> Floats:
        """Return the q at which K'(q) = x, slowest < x < fastest."""
        wanted = np.atleast_1d(x)
        assert np.all((self.slowest < wanted) & (wanted < self.fastest))
        low, high = np.full_like(wanted, -self._largest), np.full_like(wanted, self._largest)
        for _ in range(BISECTIONS):
            q = (low + high) / 2
            is_low = self.cumulants(q)[1] < wanted
            low, high = np.where(is_low, q, low), np.where(is_low, high, q)
        return (low + high) / 2

    def density(self, s: ArrayLike, n_cycles: int) -> Floats:
        """Return the density of log E_n / E0 at s, in the order of s, flat."""
        x = np.ravel(s) / n_cycles
        q = self.place(x)
        K, _, K2, K3, K4 = self.cumulants(q)
        correction = 1 + (K4 / K2**2 / 8 - 5 * K3**2 / K2**3 / 24) / n_cycles
        density: Floats = np.exp(n_cycles * (K - q * x)) / np.sqrt(2 * np.pi * n_cycles * K2) * correction
        return density

    def above(self, s: ArrayLike, n_cycles: int) -> Floats:
        """Return the probability of log E_n / E0 > s, flat; where it is near 1, use `below`."""
        return self._tail(s, n_cycles, 1.0)

    def below(self, s: ArrayLike, n_cycles: int) -> Floats:
        """Return the probability of log E_n / E0 < s, flat."""
        return self._tail(s, n_cycles, -1.0)

    def _tail(self, s: ArrayLike, n_cycles: int, side: float) -> Floats:
        x = np.ravel(s) / n_cycles
        q = self.place(x)
        K, _, K2, K3, _ = self.cumulants(q)
        w = np.sign(q) * np.sqrt(2 * n_cycles * np.maximum(q * x - K, 0.0))
        u = q * np.sqrt(n_cycles * K2)
        is_near = np.abs(w) < NEAR_MEAN
        at_mean = -K3 / K2**1.5 / (6 * np.sqrt(n_cycles))
        gap = np.where(is_near, at_mean, 1 / np.where(is_near, 1, u) - 1 / np.where(is_near, 1, w))
        tail: Floats = ndtr(-side * w) + side * np.exp(-w * w / 2) / np.sqrt(2 * np.pi) * gap
        return tail


def _series(node: Node, q: Floats) -> Floats:
    """Return mean exp((q + x) s) over a well, from its top, as coefficients of x^0 ... x^4: (5, n)."""
    orders = np.arange(5)
    factorials = np.array([factorial(k) for k in orders])
    powers = node.s[None, :] ** orders[:, None] / factorials[:, None]
    captured: Floats = (powers * node.weights) @ np.exp(np.outer(node.s, q))
    passed = node.passed * np.exp(node.gain * q) * (node.gain**orders / factorials)[:, None]
    for child in node.children:
        passed = np.array(product(list(passed), list(_series(child, q))))
    total: Floats = captured + passed
    return total


def _size(node: Node) -> float:
    """Return a bound on |s| over a well."""
    inner = sum(_size(child) for child in node.children)
    return max(abs(node.gain) + inner, float(np.max(np.abs(node.s), initial=0.0)))
