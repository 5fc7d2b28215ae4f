"""How rare it is to end with less energy after many cycles.

Cycles are independent, so with Phi(q) = mean exp(q s) over one of them the probability of E_n < E_0 falls
as exp(-n I), I = -min log Phi (Cramer 1938). Phi is convex, Phi(-1) = Phi(0) = 1: its minimum lies between.
The reversed cycle has Phi(-1 - q) for Phi(q), hence the same I; a loop that is its own reverse has its
minimum at -1/2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from scene.refusal import BadInput, check_count
from scene.tables import Scene
from theory.adiabatic import Captures
from theory.branches import Floats, Node
from theory.chebyshev import product
from theory.critical import solve_rising
from theory.distribution import KEPT, MAX_CYCLES, Energies, Lattice, cumulated, energies
from theory.precision import guarded
from theory.prediction import converged

LEAST = 1e-24  # mean of s, a half of its variance: below, every particle keeps its energy


class Rarity(NamedTuple):
    """How P(E_n < E_0) falls with n. The numbers are mpf.

    rate: I, per cycle; 0 if energies do not change.
    place: the q in (-1, 0) at which Phi is least; -1/2 if energies do not change.
    """

    rate: Any
    place: Any


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

    def slope(q: Any) -> tuple[Any, Any]:
        p = found.taylor(q, 2)
        return p[1], 2 * p[2]

    place = solve_rising(binary, slope, -binary.one, binary.zero, -binary.one / 2)
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
    slopes = _series(found.root, np.array([-1.0, 0.0]))[1]
    if not slopes[0] < -LEAST < LEAST < slopes[1]:
        raise BadInput("every particle keeps its energy in this cycle: nobody loses")
    place = brentq(lambda q: float(_series(found.root, np.array([q]))[1, 0]), -1.0, 0.0)
    return found.lost() if n_cycles == 1 else _lost(found, n_cycles, place)


def _series(node: Node, q: Floats) -> Floats:
    """Return mean exp((q + x) s) over a well, from its top, as coefficients of x^0 and x^1: (2, n)."""
    orders = np.arange(2)
    captured: Floats = (node.s[None, :] ** orders[:, None] * node.weights) @ np.exp(np.outer(node.s, q))
    passed = node.passed * np.exp(node.gain * q) * node.gain ** orders[:, None]
    for child in node.children:
        passed = np.array(product(list(passed), list(_series(child, q))))
    total: Floats = captured + passed
    return total


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
