"""Adiabatic invariants of the cap and the rates at which energy drifts in each zone (sec. 3).

The particle has mass 1. Every formula takes the number system first, or needs none.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scene.refusal import BadInput, check_number, shown
from theory.given import check_real, in_system
from theory.volumes import v_cap


def energy(ctx: Any, vx: Any, vy: Any) -> Any:
    """Return H = (vx^2 + vy^2) / 2 [length^2 / time^2]. Source: sec. 2."""
    vx, vy = in_system(ctx, vx=vx, vy=vy)
    return (vx * vx + vy * vy) / 2


def sin_phi_hat(ctx: Any, x: Any, y: Any, vx: Any, vy: Any, r: Any) -> Any:
    """Return sin of the angle phi_hat; its modulus is the cap's adiabatic invariant.

    Each hit of the base turns its sign. Between hits, and from arc hit to arc hit, it stays but for O(u / v).

    Args:
        ctx: number system.
        x: position across [length].
        y: height over the base [length].
        vx: velocity across; vx and vy must not both be 0.
        vy: velocity upward.
        r: radius of the cap [length].

    Returns:
        -(x vy - y vx) / (|v| r); in the cap the particle is captured when its modulus exceeds nu.

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
