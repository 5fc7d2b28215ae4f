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
from collections.abc import Callable

import numpy as np
from mpmath import fp
from numpy.typing import ArrayLike

from scene.geometry import table_at
from scene.laws import breakpoints, is_constant, value
from scene.refusal import BadInput, check_number
from scene.tables import Scene, cycle_length, laws
from theory.branches import DIGITS, Floats
from theory.curves import chaotic_zone
from theory.cycle import Cycle
from theory.given import finite_array
from theory.rates import kick_rates
from theory.volumes import NotCovered, as_mushroom, in_near_units, volumes_at

N_PANELS = (
    128  # of a cycle at first, cut at the laws' knots too; each is halved until its halves agree with it
)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)  # of a panel
SETTLED = 1e-6  # of the whole, by which a panel and its halves may differ
MAX_HALVINGS = 60
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
        BadInput: times are no finite numbers in one dimension, the mouth is below NARROWEST, or a rate is
            beyond binary64.
    """
    at = finite_array("times", times, 1)
    if not is_upright(scene):
        raise NotCovered(TILTED)
    scene, length, time = in_near_units(scene)
    at = np.ldexp(at, -time)
    now, volumes = table_at(fp, scene, at), volumes_at(np, scene, at)
    w, h, w_rate = (np.broadcast_to(x, at.shape) for x in (now.w, now.h, now.w_rate))
    excess = -2 * w_rate / w - kick_rates(scene, at)
    kept = np.array([kept_by_the_cap(float(nu)) for nu in volumes.nu])
    found: Floats = 16 * w * (h * excess) ** 2 / volumes.v_cha * (1 + kept) / (1 - kept)
    return _in_own_units(found, length - 2 * time)


def upright_spread(scene: Scene) -> float:
    """Return B in the variance B log(v) / v + O(1 / v) of log E of the uncaptured after one cycle.

    v is the speed at which the cycle begins, at the widest mouth. What is O(1 / v) is not known, and not
    small: the narrower the mouth, the oftener the cap hands flights back, and the later log(v) wins.

    Returns:
        B [length / time], right to 1e-4; 0 when no wall moves.

    Raises:
        NotCovered: not a mushroom, or its sides are tilted.
        BadInput: the mouth falls below NARROWEST, or B is beyond binary64.
        NotConverged: as `theory.predict`.
    """
    if not is_upright(scene):
        raise NotCovered(TILTED)
    scene, unit_length, unit_time = in_near_units(scene)
    cycle = Cycle.of(scene, DIGITS)
    if cycle.period is None:
        return 0.0
    start = float(cycle.start)
    begun = chaotic_zone(scene, [start]).log_energy[0]

    def growth(times: Floats) -> Floats:
        slower = np.exp(-(chaotic_zone(scene, times).log_energy - begun) / 2)
        return np.asarray(upright_rate(scene, times) * slower, dtype=np.float64)

    found = _integral(growth, _edges(scene, start, cycle_length(scene)))
    return float(_in_own_units(np.array(found), unit_length - unit_time))


def _in_own_units(found: Floats, exponent: int) -> Floats:
    with np.errstate(over="ignore"):
        own: Floats = np.ldexp(found, exponent)
    if not np.all(np.isfinite(own)):
        raise BadInput("the spread by upright sides is beyond binary64 in the scene's units")
    return own


def _edges(scene: Scene, start: float, length: float) -> Floats:
    """Return times from start to the cycle's end, rising, between which every law is one piece."""
    knots = np.array([float(t) for law in laws(scene).values() for t in breakpoints(law)])
    inside = start + (knots - start) % length
    even = start + length * np.arange(N_PANELS + 1) / N_PANELS
    return np.unique(np.concatenate([even, inside[inside < even[-1]]]))


def _integral(f: Callable[[Floats], Floats], edges: Floats) -> float:
    """Integrate f by panels, halved where f varies most: a narrow mouth or a leg may last an instant."""
    low, high = edges[:-1], edges[1:]
    whole = _panels(f, low, high)
    settled = 0.0
    for _ in range(MAX_HALVINGS):
        middle = (low + high) / 2
        low, high = np.stack([low, middle]), np.stack([middle, high])
        halves = _panels(f, low, high)
        both = halves.sum(axis=0)
        is_rough = np.abs(both - whole) > SETTLED * (settled + both.sum())
        settled += float(both[~is_rough].sum())
        low, high, whole = (x[:, is_rough].ravel() for x in (low, high, halves))
        if not whole.size:
            break
    return settled + float(whole.sum())


def _panels(f: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Return the integral of f from each low to each high."""
    half = (high - low)[..., None] / 2
    values = f((low[..., None] + half * (1 + NODES)).ravel()).reshape((*low.shape, len(NODES)))
    return np.asarray((half * values) @ WEIGHTS, dtype=np.float64)
