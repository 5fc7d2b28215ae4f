"""Stems with upright sides: how flights nearly along the base spread the energies of the chaotic zone.

A flight at an angle alpha from the base stays in such a stem for a path of 2 h / alpha, all the while kicked
by the sides alone. The cap hands it back nearly as it came, so it comes again and again. A kick that lasts
as 1 / alpha has a mean square that diverges as the integral of d alpha / alpha, and only the walls' own time
ends it: the variance of log E falls as log(v) / v, not as 1 / v. Where sides lean inward flights must leave;
where they lean outward some stay in another way. Neither is computed here. theory/equations.md derives what
is, and says which steps are heuristic.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpmath import fp
from numpy.typing import ArrayLike

from scene.geometry import table_at
from scene.refusal import BadInput, check_number
from scene.tables import Scene
from theory.adiabatic import NotConverged
from theory.branches import Floats, solve_cycle, zone_of
from theory.finite_energy.rates import kick_rates_of
from theory.precision import finite_array
from theory.prepared import NotCovered, PreparedMushroom, prepare
from theory.volumes import volumes_of

# Panels of a cycle at first, cut at the laws' knots too; each is halved until its halves agree with it.
N_PANELS = 128
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)  # of a panel
SETTLED = 1e-6  # of the whole, by which a panel and its halves may differ
ROUNDING = 2.0**-45  # of what D is a difference of, relatively: laws, rates and volumes are right to less
MAX_HALVINGS = 60
MOST_PANELS = 2**16  # that are rough at once: a cycle of 255 legs has a thousand
NARROWEST = 1e-6  # mouth: what the cap does not keep goes as nu^2 and is lost to rounding below
TILTED = "sides are tilted: what is computed is of upright ones"


def is_upright(scene: Scene) -> bool:
    """Tell whether the sides of a mushroom are vertical at all times.

    Raises:
        NotCovered: not a mushroom.
    """
    return prepare(scene).is_upright


def kept_by_the_cap(nu: float) -> float:
    """Return the mean of alpha / alpha', where the cap turns a small angle alpha from the base into alpha'.

    This is the correlation between consecutive times spent in the stem, which are proportional to 1 / alpha.

    Args:
        nu: the mouth w / r, in [NARROWEST, 1].

    Raises:
        BadInput: nu is out of bounds.
    """
    return float(_kept(np.array([check_number("nu", nu)]))[0])


def _kept(nu: Floats) -> Floats:
    if np.any(outside := ~((nu >= NARROWEST) & (nu <= 1))):
        raise BadInput(f"nu = {nu[outside][0]}, must be in [{NARROWEST}, 1]")
    n = np.ceil(1 / nu)
    wide, turned = np.log1p(2 * nu), np.log(np.maximum(2 * n * nu - 1, 1.0))
    found: Floats = (wide + turned / n + (wide - turned) / (n + 1)) / (2 * nu)
    return found


def upright_rate(scene: Scene, times: ArrayLike) -> Floats:
    """Return the factor of log(v) / v in the growth of the chaotic zone's variance of log E.

    Args:
        scene: a mushroom with vertical sides.
        times: (T,) any times.

    Returns:
        (T,) d variance / dt = rate log(v) / v for particles of speed v [length / time^2].

    Raises:
        NotCovered: not a mushroom, or its sides are tilted.
        BadInput: times is not a one-dimensional array of finite numbers, the mouth is below NARROWEST, or a
            rate is beyond binary64.
    """
    at = finite_array("times", times, 1)
    near, length, time = _prepare_upright(scene).near
    return _in_own_units(_growth(near, np.ldexp(at, -time))[0], length - 2 * time)


def _prepare_upright(scene: Scene) -> PreparedMushroom:
    mushroom = prepare(scene)
    if not mushroom.is_upright:
        raise NotCovered(TILTED)
    return mushroom


def _growth(mushroom: PreparedMushroom, at: Floats) -> Floats:
    """Return `upright_rate` at times (T,), and what rounding may make of a rate of 0; shape (2, T)."""
    now = table_at(fp, mushroom.given, at)
    volumes = volumes_of(np, mushroom, at)
    w, r, h, w_rate, r_rate, h_rate = (
        np.broadcast_to(x, at.shape) for x in (now.w, now.r, now.h, now.w_rate, now.r_rate, now.h_rate)
    )
    excess = -2 * w_rate / w - kick_rates_of(mushroom, at)
    # All that excess is a sum of, without signs: w' may be nu' r + nu r', and the zone's kicks come of all.
    opening = np.abs(w_rate) + 2 * volumes.nu * np.abs(r_rate)
    zone = 2 * np.pi * (np.pi * r * np.abs(r_rate) + 2 * opening * h + 2 * w * np.abs(h_rate))
    rounding = ROUNDING * (2 * opening / w + zone / volumes.v_cha)
    kept = _kept(np.broadcast_to(volumes.nu, at.shape))
    factor = 16 * w * h**2 / volumes.v_cha * (1 + kept) / (1 - kept)
    found: Floats = np.stack([factor * excess**2, factor * rounding**2])
    return found


def upright_spread(scene: Scene) -> float:
    """Return B in the variance B log(v) / v + O(1 / v) of log E of particles never captured, in one cycle.

    v is the speed at the start of the cycle, when the mouth is widest. The O(1 / v) term is unknown and
    large, above all for narrow mouths.

    Returns:
        B [length / time], right to 1e-4 if each bang-bang leg lasts at least 4,096 ulps of its times. The
        contribution of a leg of 64 ulps is off by up to 1 %, that of a leg of 2 ulps by 10 %. A leg of one
        ulp is missed. B is 0 if no wall moves. If the table only changes its size, B is a rounding error far
        below 1.

    Raises:
        NotCovered: not a mushroom, or its sides are tilted.
        BadInput: the mouth falls below NARROWEST, or B is beyond binary64.
        NotConverged: as `theory.predict`; or some 65,000 panels do not resolve B.
    """
    mushroom, unit_length, unit_time = _prepare_upright(scene).near
    if mushroom.cycle is None:
        return 0.0
    start = solve_cycle(mushroom).start
    begun = zone_of(mushroom, np.array([start])).log_energy[0]

    def growth(times: Floats) -> Floats:
        slower = np.exp(-(zone_of(mushroom, times).log_energy - begun) / 2)
        return np.asarray(_growth(mushroom, times) * slower, dtype=np.float64)

    found = _integral(growth, _edges(mushroom, start))
    return float(_in_own_units(np.array(found), unit_length - unit_time))


def _in_own_units(found: Floats, exponent: int) -> Floats:
    with np.errstate(over="ignore"):
        own: Floats = np.ldexp(found, exponent)
    if not np.all(np.isfinite(own)):
        raise BadInput("the spread by upright sides is beyond binary64 in the scene's units")
    return own


def _edges(mushroom: PreparedMushroom, start: float) -> Floats:
    """Return times from start to the cycle's end, rising, between which every law is one piece."""
    length = mushroom.period
    inside = start + (np.array(mushroom.breakpoints) - start) % length
    even = start + length * np.arange(N_PANELS + 1) / N_PANELS
    return np.unique(np.concatenate([even, inside[inside < even[-1]]]))


def _integral(f: Callable[[Floats], Floats], edges: Floats) -> float:
    """Integrate f by panels, halved where f varies most: a narrow mouth or a leg may last an instant.

    Args:
        f: of times (T,), a square and the square of the rounding in what is squared; shape (2, T).
        edges: of the first panels.

    Raises:
        NotConverged: too many panels differ from their halves, or panels too small.
    """
    low, high = edges[:-1], edges[1:]
    whole = _panels(f, low, high)[0]
    settled = 0.0
    for _ in range(MAX_HALVINGS):
        middle = (low + high) / 2
        low, high = np.stack([low, middle]), np.stack([middle, high])
        halves, roundings = _panels(f, low, high)
        both, rounding = halves.sum(axis=0), roundings.sum(axis=0)
        # (x + e)^2 is off by 2 x e + e^2. By less panels need not agree: halved, they were halved for ever.
        by_rounding = 2 * np.sqrt(both * rounding) + rounding
        is_rough = np.abs(both - whole) > np.maximum(SETTLED * (settled + both.sum()), by_rounding)
        settled += float(both[~is_rough].sum())
        low, high, whole = (x[:, is_rough].ravel() for x in (low, high, halves))
        if not whole.size:
            return settled
        if whole.size > MOST_PANELS:
            break
    raise NotConverged(f"the spread by upright sides is not resolved near t = {low[0]:.6g} of the cycle")


def _panels(f: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Return the integrals of f's two rows from each low to each high; shape (2, *low.shape)."""
    half = (high - low)[..., None] / 2
    values = f((low[..., None] + half * (1 + NODES)).ravel()).reshape((2, *low.shape, len(NODES)))
    return np.asarray((half * values) @ WEIGHTS, dtype=np.float64)
