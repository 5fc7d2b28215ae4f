"""Stems with upright sides: how flights nearly along the base spread the energies of the chaotic zone.

A flight at an angle alpha from the base stays in such a stem for a path of 2 h / alpha, all the while kicked
by the sides alone. The cap hands it back nearly as it came, so it comes again and again. A kick that lasts
as 1 / alpha has a mean square that diverges as the integral of d alpha / alpha, and only the walls' own time
ends it: the variance of log E falls as log(v) / v, not as 1 / v. Where sides lean inward flights must leave;
where they lean outward some stay in another way. Neither is computed here. theory/equations.md derives what
is, and says which steps are heuristic.
"""

from __future__ import annotations

import math

import numpy as np
from mpmath import fp
from numpy.typing import ArrayLike

from scene.geometry import table_at
from scene.laws import is_constant, value
from scene.refusal import BadInput, check_number
from scene.tables import Scene, cycle_length
from theory.branches import DIGITS, Floats
from theory.curves import chaotic_zone
from theory.cycle import Cycle
from theory.given import finite_array
from theory.rates import kick_rates
from theory.volumes import NotCovered, as_mushroom, volumes_at

N_TIMES = 2048  # steps of a cycle, the midpoint rule's
NARROWEST = 1e-6  # mouth: what the cap does not keep goes as nu^2 and is lost to rounding below
TILTED = "sides are tilted: what is computed is of upright ones"


def is_upright(scene: Scene) -> bool:
    """Tell whether a mushroom's sides are upright at all times.

    Raises:
        NotCovered: not a mushroom.
    """
    slope = as_mushroom(scene).slope
    return is_constant(slope) and value(fp, slope, 0.0) == 0


def kept_by_the_cap(nu: float) -> float:
    """Return the mean of alpha / alpha', where the cap turns a small angle alpha from the base into alpha'.

    That is how much of the next stay in the stem, which lasts as 1 / alpha', is foretold by this one.

    Args:
        nu: the mouth w / r, in [NARROWEST, 1].

    Raises:
        BadInput: nu is out of bounds.
    """
    nu = check_number("nu", nu)
    if not NARROWEST <= nu <= 1:
        raise BadInput(f"nu = {nu}, must be in [{NARROWEST}, 1]")
    n = math.ceil(1 / nu)
    wide, turned = math.log1p(2 * nu), math.log(max(2 * n * nu - 1, 1.0))
    return (wide + turned / n + (wide - turned) / (n + 1)) / (2 * nu)


def upright_rate(scene: Scene, times: ArrayLike) -> Floats:
    """Return the factor of log(v) / v in the growth of the chaotic zone's variance of log E.

    Args:
        scene: a mushroom with upright sides.
        times: (T,) any times.

    Returns:
        (T,) d variance / dt = rate log(v) / v for particles of speed v [length / time^2].

    Raises:
        NotCovered: not a mushroom, or its sides are tilted.
        BadInput: times are no finite numbers in one dimension, or the mouth is below NARROWEST.
    """
    at = finite_array("times", times, 1)
    if not is_upright(scene):
        raise NotCovered(TILTED)
    now, volumes = table_at(fp, scene, at), volumes_at(np, scene, at)
    w, h, w_rate = (np.broadcast_to(x, at.shape) for x in (now.w, now.h, now.w_rate))
    excess = -2 * w_rate / w - kick_rates(scene, at)
    kept = np.array([kept_by_the_cap(float(nu)) for nu in volumes.nu])
    found: Floats = 16 * w * h**2 * excess**2 / volumes.v_cha * (1 + kept) / (1 - kept)
    return found


def upright_spread(scene: Scene) -> float:
    """Return B in the variance B log(v) / v + O(1 / v) of log E of the uncaptured after one cycle.

    v is the speed at which the cycle begins, at the widest mouth. What is O(1 / v) is not known, and not
    small: the narrower the mouth, the oftener the cap hands flights back, and the later log(v) wins.

    Returns:
        B [length / time], right to a thousandth (worst for laws of many legs); 0 when no wall moves.

    Raises:
        NotCovered: not a mushroom, or its sides are tilted.
        BadInput: the mouth falls below NARROWEST.
        NotConverged: as `theory.predict`.
    """
    if not is_upright(scene):
        raise NotCovered(TILTED)
    cycle = Cycle.of(scene, DIGITS)
    if cycle.period is None:
        return 0.0
    start, step = float(cycle.start), cycle_length(scene) / N_TIMES
    times = np.asarray(start + step * (np.arange(N_TIMES) + 0.5), dtype=np.float64)
    slower = np.exp(-(chaotic_zone(scene, times).log_energy - chaotic_zone(scene, [start]).log_energy[0]) / 2)
    return float(step * (upright_rate(scene, times) @ slower))
