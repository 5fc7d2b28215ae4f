"""What a collision does to lanes: the bounce, the count of hits, captured stays; loops that are packed."""

from __future__ import annotations

from fast.kernel.arithmetic import dot, fma
from fast.kernel.compiling import packed, widest_registers

from fast.kernel.pools import (  # isort: skip
    CLOSED, DONE, H0, H1, H2, HIT, M0, M1, M2, NEVER, NEXT_H0, NEXT_H1, NEXT_H2, NEXT_M0, NEXT_M1,
    NEXT_M2, NEXT_R0, NEXT_R1, NEXT_R2, NEXT_R3, NEXT_T, NEXT_T_LOW, NEXT_VX, NEXT_VY, NEXT_W0, NEXT_W1,
    NEXT_W2, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW, N_ARC, N_BASE, N_FLOOR, N_LEFT, N_RIGHT, ON_ARC,
    ON_BASE, ON_FLOOR, ON_LEFT, ON_RIGHT, R0, R1, R2, R3, SINCE, SPIN, STAY_IN, STAY_OUT, T, T_LOW, UNTIL,
    VX, VY, W0, W1, W2, WALL, X, Y,
)  # fmt: skip
from fast.kernel.records import Place
from fast.kernel.walls import off_the_arc, off_the_arc_spinning

CLEARLY_CAPTURED = 1.05  # |L| over w v from which a particle moves to the disk's pool


@packed
def arrive(a, i, slope):
    """Take the laws and the place at the collision as the present ones."""
    a[T + i], a[T_LOW + i] = a[NEXT_T + i], a[NEXT_T_LOW + i]
    a[X + i], a[Y + i], a[WALL + i] = a[NEXT_X + i], a[NEXT_Y + i], a[HIT + i]
    a[R0 + i], a[R1 + i], a[R2 + i] = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
    a[R3 + i] = a[NEXT_R3 + i]
    a[W0 + i], a[W1 + i], a[W2 + i] = a[NEXT_W0 + i], a[NEXT_W1 + i], a[NEXT_W2 + i]
    a[H0 + i], a[H1 + i], a[H2 + i] = a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i]
    if slope is None:
        a[M0 + i], a[M1 + i], a[M2 + i] = a[NEXT_M0 + i], a[NEXT_M1 + i], a[NEXT_M2 + i]


@packed
def off_the_side(sign, vx, vy, m, rate):
    """Return the velocity after a hit on a side of slope m moving out at a rate; sign is 1 on the right."""
    inverse = 2.0 / fma(m, m, 1.0)
    tilt, out = 0.5 * inverse * (m - 1.0) * (m + 1.0), sign * vx
    return sign * fma(tilt, out, inverse * fma(m, vy, rate)), fma(inverse * m, out - rate, -tilt * vy)


@packed
def bounce(a, n, slope, is_mushroom):
    """Bounce off the wall met, v - 2 f' grad f / |grad f|^2; count the hit; watch captured stays.

    A stay in the cap counts as captured from its first arc hit with |sin phi| > nu (angles before
    the bounce, eq. sinphi) to the hit at which that ended.
    """
    widest_registers()
    for i in range(n):
        m = a[NEXT_M0 + i] if slope is None else slope
        x, y, vx, vy, hit = a[NEXT_X + i], a[NEXT_Y + i], a[VX + i], a[VY + i], a[HIT + i]
        w = a[NEXT_W0 + i]
        place = Place(x, a[NEXT_X_LOW + i], y, a[NEXT_Y_LOW + i])
        off_x, off_y = off_the_arc(place, vx, vy, a[NEXT_R0 + i], a[NEXT_R1 + i])
        rate = fma(a[NEXT_M1 + i], y, a[NEXT_W1 + i]) if slope is None else a[NEXT_W1 + i]
        vx_s, vy_s = off_the_side(1.0 if hit == ON_RIGHT else -1.0, vx, vy, m, rate)
        vx_s = vx if hit == ON_FLOOR else vx_s
        vy_s = -vy - 2.0 * a[NEXT_H1 + i] if hit == ON_FLOOR else vy_s
        vx_s = vx if hit == ON_BASE else vx_s
        vy_s = -vy if hit == ON_BASE else vy_s
        vx_s = off_x if hit == ON_ARC else vx_s
        vy_s = off_y if hit == ON_ARC else vy_s
        vx_s = a[NEXT_VX + i] if a[DONE + i] > 0.0 else vx_s
        vy_s = a[NEXT_VY + i] if a[DONE + i] > 0.0 else vy_s
        spin = x * vy - y * vx
        beyond = spin * spin - w * w * fma(vx, vx, vy * vy)
        beyond = beyond if hit == ON_ARC else 0.0
        beyond = beyond if is_mushroom else 0.0  # > 0: captured
        t, begin, end = a[NEXT_T + i], a[STAY_IN + i], a[STAY_OUT + i]
        # At the arc: the stay begins, goes on, or (once, until captured again) ends.
        first_end = min(end, t) if begin < NEVER else end
        end = first_end if hit == ON_ARC else end
        end = NEVER if beyond > 0.0 else end
        begin = min(begin, t) if beyond > 0.0 else begin
        # Below the mouth: it is over, and kept if it spans an instant in question.
        last = min(end, t)
        kept = last if begin <= a[UNTIL + i] else NEVER
        kept = kept if a[SINCE + i] <= last else NEVER
        kept = kept if begin < NEVER else NEVER
        kept = kept if hit >= ON_LEFT else NEVER
        a[CLOSED + i] = kept
        left = NEVER if kept == NEVER else begin
        a[STAY_IN + i] = left if hit >= ON_LEFT else begin
        a[STAY_OUT + i] = NEVER if hit >= ON_LEFT else end
        spin = dot(x, vy_s, -y, vx_s)
        clearly = CLEARLY_CAPTURED * CLEARLY_CAPTURED * w * w * fma(vx_s, vx_s, vy_s * vy_s)
        spin = spin if spin * spin > clearly else 0.0
        a[SPIN + i] = spin if beyond > 0.0 else 0.0
        a[VX + i] = vx_s
        a[VY + i] = vy_s
        a[DONE + i] = 0.0
        a[N_ARC + i] += 1.0 if hit == ON_ARC else 0.0
        a[N_BASE + i] += 1.0 if hit == ON_BASE else 0.0
        a[N_LEFT + i] += 1.0 if hit == ON_LEFT else 0.0
        a[N_RIGHT + i] += 1.0 if hit == ON_RIGHT else 0.0
        a[N_FLOOR + i] += 1.0 if hit == ON_FLOOR else 0.0
        arrive(a, i, slope)


@packed
def rebound(a, n):
    """Bounce off the arc with the angular momentum of the whole stay, constant to the bit; count."""
    widest_registers()
    for i in range(n):
        x, y, vx, vy, spin = a[NEXT_X + i], a[NEXT_Y + i], a[VX + i], a[VY + i], a[SPIN + i]
        place = Place(x, a[NEXT_X_LOW + i], y, a[NEXT_Y_LOW + i])
        vx_s, vy_s = off_the_arc_spinning(place, vx, vy, a[NEXT_R0 + i], a[NEXT_R1 + i], spin)
        is_done = a[DONE + i]
        a[VX + i] = a[NEXT_VX + i] if is_done > 0.0 else vx_s
        a[VY + i] = a[NEXT_VY + i] if is_done > 0.0 else vy_s
        # A chord that crosses y = 0 hits the base; what careful did was counted there.
        crossed = 1.0 if a[Y + i] * y < 0.0 else 0.0
        a[N_ARC + i] += 1.0 - is_done
        a[N_BASE + i] += 0.0 if is_done > 0.0 else crossed
        a[DONE + i] = 0.0
        a[T + i], a[T_LOW + i], a[X + i], a[Y + i] = a[NEXT_T + i], a[NEXT_T_LOW + i], x, y
        a[R0 + i], a[R1 + i], a[R2 + i] = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
        a[R3 + i] = a[NEXT_R3 + i]
        a[W0 + i], a[W1 + i] = a[NEXT_W0 + i], a[NEXT_W1 + i]
