"""Phase-space volumes of the frozen mushroom at H = 1/2 (sec. 2).

A volume is 2 pi times an area, weighted by the share of directions; at energy E it is
sqrt(2 E) times larger. Every formula takes the number system first: `mpmath.fp` for floats,
an `MPContext` for many digits, `numpy` for arrays. Intervals are not handled. A `Volumes` may be copied and
pickled to the last digit. A single number of your own `MPContext` may not: mpmath rounds its copies.

Invariants and rates of energy follow from them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scene.precision import reduce_record
from scene.refusal import BadInput, check_number, shown
from scene.tables import Scene
from theory.precision import check_real, in_system
from theory.prepared import PreparedMushroom, prepare

WIDE = 0.75  # nu from which the island's share is summed as a series


class Volumes(NamedTuple):
    """Volumes of cap, stem, island and chaotic zone [length^2], and the mouth's nu = w / r."""

    v_cap: Any
    v_stem: Any
    v_ell: Any
    v_cha: Any
    nu: Any

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to keep every bit."""
        return reduce_record(self)


def v_cap(ctx: Any, r: Any) -> Any:
    """Return pi^2 r^2, the volume over the half disk of radius r [length]. Source: Eq:Vcap."""
    (r,) = in_system(ctx, r=r)
    return ctx.pi**2 * r * r


def v_stem(ctx: Any, w: Any, h: Any, slope: Any) -> Any:
    """Return 2 pi (2 w h - h^2 slope), the volume over the stem. Source: Eq:Vcap."""
    w, h, slope = in_system(ctx, w=w, h=h, slope=slope)
    return 2 * ctx.pi * (2 * w * h - h * h * slope)


def delta(ctx: Any, nu: Any) -> Any:
    """Return the island's share of the cap, (2 / pi) (acos nu - nu sqrt(1 - nu^2)).

    Near nu = 1 a series in 1 - nu avoids cancellation. The result is right to rounding, however small the
    island.

    Raises:
        BadInput: nu is outside [0, 1].

    Source: the equation after volisl.
    """
    nu = _checked_nu(ctx, nu)
    if isinstance(nu, np.ndarray):
        found, is_wide = np.empty(nu.shape), nu > WIDE
        found[is_wide], found[~is_wide] = _small_island(ctx, nu[is_wide]), _island(ctx, nu[~is_wide])
        return found
    return _small_island(ctx, nu) if nu > WIDE else _island(ctx, nu)


def _island(ctx: Any, nu: Any) -> Any:
    return 2 * (ctx.acos(nu) - nu * ctx.sqrt((1 - nu) * (1 + nu))) / ctx.pi


def _small_island(ctx: Any, nu: Any) -> Any:
    z = 1 - nu
    return 8 * z * ctx.sqrt(2 * z) * _integral_of_root(z / 2) / (3 * ctx.pi)


def _integral_of_root(x: Any) -> Any:
    """Return 3 / 2 times the integral over [0, 1] of sqrt(u) sqrt(1 - x u), by powers of x."""
    total, binomial, k = 1 + 0 * x, -x / 2, 1
    while np.any((more := total + 3 * binomial / (2 * k + 3)) != total):
        total, binomial, k = more, binomial * x * (2 * k - 1) / (2 * k + 2), k + 1
    return total


def free_share(ctx: Any, nu: Any) -> Any:
    """Return 1 - delta(nu), the share of the cap that is not island: right however narrow the mouth.

    Raises:
        BadInput: nu is outside [0, 1].
    """
    nu = _checked_nu(ctx, nu)
    return 2 * (ctx.asin(nu) + nu * ctx.sqrt((1 - nu) * (1 + nu))) / ctx.pi


def delta_slope(ctx: Any, nu: Any) -> Any:
    """Return d delta / d nu = -(4 / pi) sqrt(1 - nu^2).

    Raises:
        BadInput: nu is outside [0, 1].
    """
    nu = _checked_nu(ctx, nu)
    return -4 * ctx.sqrt((1 - nu) * (1 + nu)) / ctx.pi


def _checked_nu(ctx: Any, nu: Any) -> Any:
    (nu,) = in_system(ctx, nu=nu)
    if not (np.all((nu >= 0) & (nu <= 1)) if isinstance(nu, np.ndarray) else 0 <= nu <= 1):
        raise BadInput(f"nu = {nu}, must be in [0, 1]")
    return nu


def v_ell(ctx: Any, r: Any, nu: Any) -> Any:
    """Return delta(nu) V_cap, the island's volume. Source: volisl."""
    return v_cap(ctx, r) * delta(ctx, nu)


def v_cha(ctx: Any, r: Any, w: Any, h: Any, slope: Any) -> Any:
    """Return V_cap + V_stem - V_ell, the chaotic zone's volume. Source: vchs."""
    r, w, h, slope = in_system(ctx, r=r, w=w, h=h, slope=slope)
    _check_positive("r", r)
    return v_cap(ctx, r) * free_share(ctx, w / r) + v_stem(ctx, w, h, slope)


def volumes_at(ctx: Any, scene: Scene, t: Any) -> Volumes:
    """Return the volumes of a mushroom frozen at time t.

    Args:
        ctx: number system.
        scene: a valid mushroom.
        t: time, a number of ctx; of numpy an array.

    Raises:
        NotCovered: the table is no mushroom.
        BadInput: no scene, no number system or no finite time.
    """
    mushroom = prepare(scene)
    (t,) = in_system(ctx, t=t)
    return volumes_of(ctx, mushroom, np.asarray(t) if ctx is np else t)


def volumes_of(ctx: Any, mushroom: PreparedMushroom, t: Any) -> Volumes:
    """Return `volumes_at` of a mushroom that is prepared, at a time that is a number of ctx."""
    r, h, slope = (mushroom.laws[name].value(ctx, t) for name in ("r", "h", "slope"))
    width, radius = mushroom.mouth
    nu = width.value(ctx, t) / radius.value(ctx, t)
    # A valid scene has nu <= 1: what exceeds it is rounding.
    nu = np.minimum(nu, 1.0) if ctx is np else min(nu, ctx.mpf(1))
    cap, stem = v_cap(ctx, r), v_stem(ctx, nu * r, h, slope)
    return Volumes(cap, stem, delta(ctx, nu) * cap, free_share(ctx, nu) * cap + stem, nu)


def energy(ctx: Any, vx: Any, vy: Any) -> Any:
    """Return H = (vx^2 + vy^2) / 2 [length^2 / time^2]. Source: sec. 2."""
    vx, vy = in_system(ctx, vx=vx, vy=vy)
    return (vx * vx + vy * vy) / 2


def sin_phi_hat(ctx: Any, x: Any, y: Any, vx: Any, vy: Any, r: Any) -> Any:
    """Return sin of the angle phi_hat; its absolute value is the adiabatic invariant of the cap.

    Each hit of the base changes its sign. A hit of an arc of speed u changes it only by O(u / v).

    Args:
        ctx: number system.
        x: position across [length].
        y: height over the base [length].
        vx: velocity across [length / time]; vx and vy must not both be 0.
        vy: velocity upward [length / time].
        r: radius of the cap [length].

    Returns:
        -(x vy - y vx) / (|v| r); in the cap a particle is captured if the absolute value exceeds nu.

    Raises:
        BadInput: an argument is not finite, r is not > 0, or the particle rests.

    Source: Eq:sinphi.
    """
    x, y, vx, vy, r = in_system(ctx, x=x, y=y, vx=vx, vy=vy, r=r)
    speed = ctx.hypot(vx, vy)
    if not np.all(speed > 0):
        raise BadInput("vx = vy = 0: a particle at rest has no direction")
    _check_positive("r", r)
    # Of lengths and speeds as large or small as binary64 holds, products would be beyond it.
    return (y / r) * (vx / speed) - (x / r) * (vy / speed)


def cap_invariant(ctx: Any, vx: Any, vy: Any, r: Any) -> Any:
    """Return E V_cap, constant while the particle stays in the cap. Source: sec. 3.1."""
    return energy(ctx, vx, vy) * v_cap(ctx, r)


def log_energy_rate_chaotic(v_cha: Any, v_cap: Any, v_cha_rate: Any, delta_rate: Any) -> Any:
    """Return d log E / dt in the chaotic zone, with the flux through the mouth.

    Args:
        v_cha: volume of the chaotic zone [length^2].
        v_cap: volume of the cap [length^2].
        v_cha_rate: d V_cha / dt.
        delta_rate: d delta / dt, positive while particles are captured.

    Source: Eq:dE.
    """
    _check_held(v_cha=v_cha, v_cap=v_cap, v_cha_rate=v_cha_rate, delta_rate=delta_rate)
    _check_positive("v_cha", v_cha)
    return -(v_cha_rate + v_cap * delta_rate) / v_cha


def log_energy_rate_island(v_cap: Any, v_cap_rate: Any) -> Any:
    """Return d log E / dt in the island, -V_cap' / V_cap. Source: Eq:dEe."""
    _check_held(v_cap=v_cap, v_cap_rate=v_cap_rate)
    _check_positive("v_cap", v_cap)
    return -v_cap_rate / v_cap


def _check_held(**numbers: object) -> None:
    """Refuse what is no finite real number, and integers whose quotients no float holds."""
    check_real(**numbers)
    for field, number in numbers.items():
        if isinstance(number, int):
            check_number(field, number)


def _check_positive(field: str, size: Any) -> None:
    if not np.all(size > 0):
        raise BadInput(f"{field} = {shown(size)}, must be > 0")
