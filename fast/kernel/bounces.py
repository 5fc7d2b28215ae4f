"""What a collision does to a lane: the bounce, and what is known of capture intervals."""

from __future__ import annotations

import numpy as np

from fast.kernel.arithmetic import dot, fma, short_sum
from fast.kernel.compiling import packed
from fast.kernel.pools import (
    CAPTURED,
    CLEARLY,
    N_ARC,
    N_BASE,
    N_FLOOR,
    N_LEFT,
    N_RIGHT,
    NOT_YET,
    ON_ARC,
    ON_BASE,
    ON_FLOOR,
    ON_LEFT,
    ON_RIGHT,
    OVER,
)

ONE = np.float64(1.0)  # its quotient by 0 is infinite without the compiler too
CLEARLY_BEYOND = 1.05 * 1.05  # (L / (w v))^2 from which a particle moves to the disk's pool


@packed
def out_of_arc(place, vx, vy, r, rate):
    """Return r r' - (x vx + y vy) and x^2 + y^2 at a place on the arc, each as a sum of two floats.

    The low parts matter: without them the velocity after a bounce is off by four units in its last place.
    """
    x, x_low, y, y_low = place
    p, push = y * vy, r * rate
    q = fma(x, vx, p)
    out, low = short_sum(-q, push)
    low += fma(r, rate, -push) - (fma(y, vy, -p) + fma(x_low, vx, y_low * vy))
    large, small = max(abs(x), abs(y)), min(abs(x), abs(y))
    square = large * large
    rho2 = fma(small, small, square)
    rho2_low = fma(small, small, square - rho2) + fma(large, large, -square)
    return out, low, rho2, fma(2.0, fma(x, x_low, y * y_low), rho2_low)


@packed
def divided(a, low, b, b_low, inverse):
    """Return (a + low) / (b + b_low) as a sum of two floats, `inverse` being 1 / b."""
    quotient = a * inverse
    return quotient, (fma(-quotient, b, a) + fma(-quotient, b_low, low)) * inverse


@packed
def off_the_arc(place, vx, vy, r, rate):
    """Return the velocity after a hit on the arc: v - 2 f' grad f / |grad f|^2 = v - 2 (v.n - r') n."""
    out, low, rho2, rho2_low = out_of_arc(place, vx, vy, r, rate)
    push, low = divided(2.0 * out, 2.0 * low, rho2, rho2_low, ONE / rho2)
    x, x_low, y, y_low = place
    return fma(push, x, vx) + fma(push, x_low, low * x), fma(push, y, vy) + fma(push, y_low, low * y)


@packed
def off_the_arc_spinning(place, vx, vy, r, rate, spin):
    """Return the velocity after a hit on the arc where the angular momentum is known to be `spin`."""
    x, x_low, y, y_low = place
    # Twice r r' less the velocity out goes out.
    out, low, rho2, rho2_low = out_of_arc(place, vx, vy, 2.0 * r, rate)
    inverse = ONE / rho2
    a, b = dot(out, x, -spin, y), dot(out, y, spin, x)
    a_low = fma(low, x, fma(out, x_low, -spin * y_low))
    b_low = fma(low, y, fma(out, y_low, spin * x_low))
    a, a_low = divided(a, a_low, rho2, rho2_low, inverse)
    b, b_low = divided(b, b_low, rho2, rho2_low, inverse)
    return a + a_low, b + b_low


@packed
def off_the_side(sign, vx, vy, m, rate):
    """Return the velocity after a hit on a side of slope m moving out at a rate; sign is 1 on the right."""
    inverse = 2.0 / fma(m, m, 1.0)
    tilt, out = 0.5 * inverse * (m - 1.0) * (m + 1.0), sign * vx
    return sign * fma(tilt, out, inverse * fma(m, vy, rate)), fma(inverse * m, out - rate, -tilt * vy)


@packed
def off_the_wall(hit, place, vx, vy, at_hit, slope):
    """Return the velocity after a hit, v - 2 f' grad f / |grad f|^2, by the laws at the hit."""
    off_x, off_y = off_the_arc(place, vx, vy, at_hit.r, at_hit.r1)
    m, rate = (at_hit.m, fma(at_hit.m1, place.y, at_hit.w1)) if slope is None else (slope, at_hit.w1)
    vx_s, vy_s = off_the_side(1.0 if hit == ON_RIGHT else -1.0, vx, vy, m, rate)
    vx_s = vx if hit == ON_FLOOR else vx_s
    vy_s = -vy - 2.0 * at_hit.h1 if hit == ON_FLOOR else vy_s
    vx_s = vx if hit == ON_BASE else vx_s
    vy_s = -vy if hit == ON_BASE else vy_s
    return off_x if hit == ON_ARC else vx_s, off_y if hit == ON_ARC else vy_s


@packed
def stay_after(stay, hit, place, v, w):
    """Return whether a particle is captured after a hit, from whether it was, and v before the bounce.

    It is at a hit of the arc with |sin phi| > nu (eq. sinphi), |L| > w v, and until the next of the arc.
    """
    vx, vy, v2 = v
    spin, edge = fma(place.x, vy, -place.y * vx), w * w * v2
    at_arc = min(stay, OVER)
    at_arc = CAPTURED if spin * spin > edge else at_arc
    at_arc = CLEARLY if spin * spin > CLEARLY_BEYOND * edge else at_arc
    after = at_arc if hit == ON_ARC else stay
    return NOT_YET if hit >= ON_LEFT else after


@packed
def count_hit(a, i, hit):
    """Count a hit of a wall."""
    a[N_ARC + i] += 1.0 if hit == ON_ARC else 0.0
    a[N_BASE + i] += 1.0 if hit == ON_BASE else 0.0
    a[N_LEFT + i] += 1.0 if hit == ON_LEFT else 0.0
    a[N_RIGHT + i] += 1.0 if hit == ON_RIGHT else 0.0
    a[N_FLOOR + i] += 1.0 if hit == ON_FLOOR else 0.0
