"""The event-driven stepper of `baselines.c` as an ordinary user of numba would write it: scalar, no checks.

Laws and states are arrays of the forms that `conformance.bench.baselines` documents.
"""

from __future__ import annotations

import math

from numba import njit

# Walls, tables, laws, and the rows of the laws, by the numbers that `baselines.c` knows them by; the half
# width of the mouth is WIDTH times FACTOR.
ARC, BASE, LEFT, RIGHT, FLOOR, NONE = range(6)
CAP, STEM, MUSHROOM = range(3)
CONSTANT, FOURIER, BANG_BANG = range(3)
R, WIDTH, FACTOR, H, SLOPE = range(5)
MOST_NEWTON = 30


@njit(error_model="numpy")
def _bang_bang(law, t):
    n = int(law[1])
    first, last = law[4], law[2 + 2 * n]
    u = first + (t - first) % (last - first)
    i = 4
    while i < 2 * n and u >= law[i + 2]:
        i += 2
    leg, change = law[i + 2] - law[i], law[i + 3] - law[i + 1]
    part = (u - law[i]) / leg
    if part < 0.5:
        return law[i + 1] + 2 * change * part * part, 4 * change * part / leg
    part = 1 - part
    return law[i + 3] - 2 * change * part * part, 4 * change * part / leg


@njit(error_model="numpy")
def _at(law, t):
    if law[0] == CONSTANT:
        return law[2], 0.0
    if law[0] == BANG_BANG:
        return _bang_bang(law, t)
    value, rate = law[2], 0.0
    for k in range(1, int(law[1]) + 1):
        a, b, k_omega = law[2 + 2 * k], law[3 + 2 * k], k * law[3]
        c, s = math.cos(k_omega * t), math.sin(k_omega * t)
        value += a * c + b * s
        rate += k_omega * (b * c - a * s)
    return value, rate


@njit(error_model="numpy")
def _mouth(laws, t):
    width, width_rate = _at(laws[WIDTH], t)
    factor, factor_rate = _at(laws[FACTOR], t)
    return width * factor, width_rate * factor + width * factor_rate


@njit(error_model="numpy")
def _gap(laws, wall, t, x, y, vx, vy):
    if wall == ARC:
        r, v = _at(laws[R], t)
        return r * r - x * x - y * y, 2 * r * v - 2 * (x * vx + y * vy), -2 * x, -2 * y
    if wall == FLOOR:
        h, v = _at(laws[H], t)
        return y + h, vy + v, 0.0, 1.0
    w, v = _mouth(laws, t)
    lean, lean_rate = _at(laws[SLOPE], t)
    side = 1.0 if wall == LEFT else -1.0
    return w + lean * y + side * x, v + lean_rate * y + lean * vy + side * vx, side, lean


@njit(error_model="numpy")
def _newton(laws, wall, t, x, y, vx, vy, s):
    for _ in range(MOST_NEWTON):
        inside, rate, _, _ = _gap(laws, wall, t + s, x + s * vx, y + s * vy, vx, vy)
        change = inside / rate
        s -= change
        if abs(change) <= 1e-8 * abs(s):
            break
    return s if s > 0 else math.inf


@njit(error_model="numpy")
def _arc_time(laws, t, x, y, vx, vy):
    r, v = _at(laws[R], t)
    square, along = vx * vx + vy * vy - v * v, x * vx + y * vy - r * v
    root = math.sqrt(max(along * along + square * (r * r - x * x - y * y), 0.0))
    return _newton(laws, ARC, t, x, y, vx, vy, (root - along) / square)


@njit(error_model="numpy")
def _stem_time(laws, last, t, x, y, vx, vy):
    first, soonest = NONE, math.inf
    for wall in (FLOOR, LEFT, RIGHT):
        inside, rate, _, _ = _gap(laws, wall, t, x, y, vx, vy)
        if wall != last and rate < 0:
            s = _newton(laws, wall, t, x, y, vx, vy, -inside / rate)
            if s < soonest:
                first, soonest = wall, s
    return first, soonest


@njit(error_model="numpy")
def _next_hit(laws, table, t, x, y, vx, vy, last):
    is_in_cap = table == CAP
    if table == MUSHROOM:
        is_in_cap = last in (ARC, BASE) or (last == NONE and (y > 0 or (y == 0 and vy > 0)))
    dt = 0.0
    while True:
        if vy < 0 if is_in_cap else vy > 0:
            s = -y / vy
            there = abs(x + s * vx)
            is_open = table != CAP and there < _mouth(laws, t + s)[0]
            if is_open or (is_in_cap and there < _at(laws[R], t + s)[0]):
                dt, t, x, y = dt + s, t + s, x + s * vx, 0.0
                if table == MUSHROOM and is_open:
                    is_in_cap = not is_in_cap
                    continue
                return dt, t, x, y, vx, -vy, float(BASE)
        first, s = ARC, 0.0
        if is_in_cap:
            s = _arc_time(laws, t, x, y, vx, vy)
        else:
            first, s = _stem_time(laws, last, t, x, y, vx, vy)
        if s == math.inf:
            return math.inf, t, x, y, vx, vy, float(NONE)
        dt, t, x, y = dt + s, t + s, x + s * vx, y + s * vy
        _, rate, gx, gy = _gap(laws, first, t, x, y, vx, vy)
        push = 2 * rate / (gx * gx + gy * gy)
        return dt, t, x, y, vx - push * gx, vy - push * gy, float(first)


@njit(error_model="numpy")
def next_hits(laws, table, states, hits):
    """Fill `hits` with the next collision of each state; no wall and infinite time where there is none."""
    for i in range(len(states)):
        t, x, y, vx, vy, last = states[i]
        for j, number in enumerate(_next_hit(laws, table, t, x, y, vx, vy, float(last))):
            hits[i, j] = number


@njit(error_model="numpy")
def follow(laws, table, states, t_end, most, n_times):
    """Follow each state to t_end or for `most` collisions, n_times; returns the collisions of all."""
    n_hits = 0
    for _ in range(n_times):
        for i in range(len(states)):
            t, x, y, vx, vy, last = states[i]
            for _ in range(most):
                if t >= t_end:
                    break
                _, t, x, y, vx, vy, last = _next_hit(laws, table, t, x, y, vx, vy, last)
                if last == NONE:
                    break
                n_hits += 1
    return n_hits
