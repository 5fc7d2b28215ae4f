"""The event-driven stepper of `baselines.c` as an ordinary user of numba would write it: scalar, no checks.

Laws and states are arrays of the forms that `conformance.bench.baselines` documents.
"""

from __future__ import annotations

import math

from numba import njit

from conformance.bench import codes

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
    if law[0] == codes.CONSTANT:
        return law[2], 0.0
    if law[0] == codes.BANG_BANG:
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
    width, width_rate = _at(laws[codes.WIDTH], t)
    factor, factor_rate = _at(laws[codes.FACTOR], t)
    return width * factor, width_rate * factor + width * factor_rate


@njit(error_model="numpy")
def _gap(laws, wall, t, x, y, vx, vy):
    if wall == codes.ARC:
        r, v = _at(laws[codes.R], t)
        return r * r - x * x - y * y, 2 * r * v - 2 * (x * vx + y * vy), -2 * x, -2 * y
    if wall == codes.FLOOR:
        h, v = _at(laws[codes.H], t)
        return y + h, vy + v, 0.0, 1.0
    w, v = _mouth(laws, t)
    lean, lean_rate = _at(laws[codes.SLOPE], t)
    side = 1.0 if wall == codes.LEFT else -1.0
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
    r, v = _at(laws[codes.R], t)
    square, along = vx * vx + vy * vy - v * v, x * vx + y * vy - r * v
    root = math.sqrt(max(along * along + square * (r * r - x * x - y * y), 0.0))
    return _newton(laws, codes.ARC, t, x, y, vx, vy, (root - along) / square)


@njit(error_model="numpy")
def _stem_time(laws, last, t, x, y, vx, vy):
    first, soonest = codes.NONE, math.inf
    for wall in (codes.FLOOR, codes.LEFT, codes.RIGHT):
        inside, rate, _, _ = _gap(laws, wall, t, x, y, vx, vy)
        if wall != last and rate < 0:
            s = _newton(laws, wall, t, x, y, vx, vy, -inside / rate)
            if s < soonest:
                first, soonest = wall, s
    return first, soonest


@njit(error_model="numpy")
def _next_hit(laws, table, t, x, y, vx, vy, last):
    is_in_cap = table == codes.CAP
    if table == codes.MUSHROOM:
        is_in_cap = last in (codes.ARC, codes.BASE) or (last == codes.NONE and (y > 0 or (y == 0 and vy > 0)))
    dt = 0.0
    while True:
        if vy < 0 if is_in_cap else vy > 0:
            s = -y / vy
            there = abs(x + s * vx)
            is_open = table != codes.CAP and there < _mouth(laws, t + s)[0]
            if is_open or (is_in_cap and there < _at(laws[codes.R], t + s)[0]):
                dt, t, x, y = dt + s, t + s, x + s * vx, 0.0
                if table == codes.MUSHROOM and is_open:
                    is_in_cap = not is_in_cap
                    continue
                return dt, t, x, y, vx, -vy, float(codes.BASE)
        first, s = codes.ARC, 0.0
        if is_in_cap:
            s = _arc_time(laws, t, x, y, vx, vy)
        else:
            first, s = _stem_time(laws, last, t, x, y, vx, vy)
        if s == math.inf:
            return math.inf, t, x, y, vx, vy, float(codes.NONE)
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
                if last == codes.NONE:
                    break
                n_hits += 1
    return n_hits
