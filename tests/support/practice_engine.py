"""An engine as people write it, for the moving cap of sec. 4.2, and what goes wrong with it in practice.

It looks for the wall met next by Newton's method, in plain doubles and absolute time, and checks nothing. It
is right as it stands, and has a switch for each of its mistakes. The rest of `ENSEMBLES` are mistakes of
whoever writes the numbers down.
"""

from collections.abc import Callable
from math import pi
from typing import Any

import numpy as np
from numba import njit

PERIOD = 2 * pi
ENERGY = 1e4
N_WRONG_SIGN = 30.0  # of a wall's speed: hits that are slower keep the right sign, or they stay near it


@njit
def laws(t, misprinted):
    """Return r, w, h and their rates: nu = 1 - .8 sin^2(t/2), or as printed with sin^2 t."""
    k = 2.0 if misprinted else 1.0
    r = 1 + 0.5 * np.sin(t)
    r1 = 0.5 * np.cos(t)
    nu = 0.6 + 0.4 * np.cos(k * t)
    nu1 = -0.4 * k * np.sin(k * t)
    return r, nu * r, 1 - 0.5 * np.sin(t), r1, nu1 * r + nu * r1, -r1


@njit
def flight(p, t, wall, slope, misprinted):
    """Return time and wall (0 arc, 1 mouth or base, 2 right, 3 left, 4 floor) that is met next."""
    x, y, vx, vy = p
    best = np.inf
    which = -1
    if wall != 1 and y * vy < 0:
        best = -y / vy
        which = 1
    if y > 0 or (y == 0 and vy > 0):
        r = laws(t, misprinted)[0]
        b = x * vx + y * vy
        c = x * x + y * y - r * r
        v2 = vx * vx + vy * vy
        s = (-b + np.sqrt(max(b * b - v2 * min(c, 0.0), 0.0))) / v2
        for _ in range(8):
            r, _, _, r1, _, _ = laws(t + s, misprinted)
            f = (x + vx * s) ** 2 + (y + vy * s) ** 2 - r * r
            s -= f / (2 * ((x + vx * s) * vx + (y + vy * s) * vy - r * r1))
        return (s, 0) if 0 < s < best else (best, which)
    for k in (2, 3, 4):
        if k == wall:
            continue
        sign = 1.0 if k == 2 else -1.0
        s = 0.0
        for _ in range(8):
            _, w, h, _, w1, h1 = laws(t + s, misprinted)
            if k == 4:
                f = y + vy * s + h
                f1 = vy + h1
            else:
                f = w + slope * (y + vy * s) - sign * (x + vx * s)
                f1 = w1 + slope * vy - sign * vx
            s = s - f / f1 if f1 < 0 else np.inf
            if not s < best:
                break
        if 0 < s < best:
            best = s
            which = k
    return best, which


@njit
def bounced(p, t, wall, slope, misprinted, has_wrong_sign):
    """Return the velocity after a wall: v - 2 (v.n - u) n with n outward."""
    x, y, vx, vy = p
    r, _, _, r1, w1, h1 = laws(t, misprinted)
    nx = x / r
    ny = y / r
    u = r1
    if wall == 4:
        nx = 0.0
        ny = -1.0
        u = h1
    elif wall >= 2:
        size = np.sqrt(1 + slope * slope)
        nx = (1.0 if wall == 2 else -1.0) / size
        ny = -slope / size
        u = w1 / size
    vn = vx * nx + vy * ny
    u = -u if has_wrong_sign and abs(vn) > N_WRONG_SIGN * abs(u) else u
    return vx - 2 * (vn - u) * nx, vy - 2 * (vn - u) * ny


@njit(cache=True)
def cycle(p, t_end, slope, misprinted, has_wrong_sign, leak):
    """Follow a particle through a cycle; return its energy, and t_in and t_out of the stay at t = pi."""
    t = 0.0
    wall = -1
    begin = np.inf
    end = np.inf
    t_in = np.nan
    t_out = np.nan
    while True:
        s, wall = flight(p, t, wall, slope, misprinted)
        if not t + s < t_end:
            break
        t += s
        x = p[0] + p[2] * s
        y = p[1] + p[3] * s
        vx = p[2]
        vy = p[3]
        w = laws(t, misprinted)[1]
        if wall == 0:
            if abs(x * vy - y * vx) > w * np.hypot(vx, vy):
                begin = min(begin, t)
                end = np.inf
            elif begin < np.inf:
                end = min(end, t)
        elif wall >= 2 and begin < np.inf:
            if begin <= pi <= min(end, t):
                t_in = begin
                t_out = min(end, t)
            begin = end = np.inf
        if wall == 1:
            if abs(x) < w * (1 + leak) or vy > 0:
                x = max(min(x, w * (1 - 1e-9)), -w * (1 - 1e-9))
                y = 0.0
            else:
                y = 0.0
                vy = -vy
        else:
            vx, vy = bounced((x, y, vx, vy), t, wall, slope, misprinted, has_wrong_sign)
        p = (x, y, vx, vy)
    if begin <= pi <= min(end, t_end):
        t_in = begin
        t_out = min(end, t_end)
    return (p[2] ** 2 + p[3] ** 2) / 2, t_in, t_out


def starts(n: int, seed: int, *, on_the_wall: bool = False) -> Any:
    """Draw starts at t = 0, uniform in area and direction; or, wrongly, on the arc and nearly along it."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-1, 1, 8 * n), random.uniform(-1, 1, 8 * n)
    inside = np.where(y > 0, np.hypot(x, y) < 1, np.abs(x) < 1 + 0.1111 * y)
    x = x[inside][:n]
    y = y[inside][:n]
    angle = random.uniform(0, 2 * pi, n)
    if on_the_wall:
        turn = random.uniform(0, pi, n)
        x, y = (1 - 1e-9) * np.cos(turn), (1 - 1e-9) * np.sin(turn)
        angle = turn + pi * (0.5 + random.uniform(0.0, 0.1, n))
    v = np.sqrt(2 * ENERGY)
    return np.column_stack([x, y, v * np.cos(angle), v * np.sin(angle)])


def ensemble(
    n: int,
    seed: int,
    *,
    t_end: float = PERIOD,
    slope: float = 0.1111,
    misprinted: bool = False,
    has_wrong_sign: bool = False,
    leak: float = 0.0,
    on_the_wall: bool = False,
) -> dict[str, Any]:
    """Return the columns of an ensemble: E0, E1, t_in, t_out."""
    places = starts(n, seed, on_the_wall=on_the_wall)
    e1, t_in, t_out = np.array(
        [cycle(tuple(p), t_end, slope, misprinted, has_wrong_sign, leak) for p in places]
    ).T
    told = {"E0": np.full(n, ENERGY), "E1": e1, "t_in": t_in, "t_out": t_out}
    return {**told, "x0": places[:, 0], "y0": places[:, 1]} if on_the_wall else told


def in_single_precision(columns: dict[str, Any]) -> dict[str, Any]:
    """Write energies in 7 digits."""
    return {**columns, "E1": columns["E1"].astype(np.float32).astype(float)}


def without_the_captured(columns: dict[str, Any]) -> dict[str, Any]:
    """Drop whoever was captured."""
    free = np.isnan(columns["t_in"])
    return {name: column[free] for name, column in columns.items()}


def written_as(change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Return what writes down log E1/E0, changed, and nothing else."""
    return lambda columns: {"s": change(np.log(columns["E1"] / columns["E0"]))}


# By name: the switches of the engine, and what is done with its columns.
ENSEMBLES: dict[str, tuple[dict[str, Any], Callable[[dict[str, Any]], dict[str, Any]]]] = {
    "right": ({}, dict),
    "leaks at the mouth's corners": ({"leak": 0.006}, dict),
    "energies in single precision": ({}, in_single_precision),
    "wrong sign of the wall's speed": ({"has_wrong_sign": True}, dict),
    "captured particles dropped": ({}, without_the_captured),
    "E in place of log E": ({}, written_as(np.exp)),
    "starts on the wall": ({"on_the_wall": True}, dict),
    "misprinted protocol": ({"misprinted": True}, dict),
    "half a period": ({"t_end": PERIOD / 2}, dict),
    "slope 1/9": ({"slope": 1 / 9}, dict),
    "energies exchanged": ({}, written_as(np.negative)),
    "logarithms to base 10": ({}, written_as(lambda s: s / np.log(10))),
    "gains of speeds": ({}, written_as(lambda s: s / 2)),
    "gains less 1": ({}, written_as(np.expm1)),
    "no stays told": ({}, lambda columns: {name: columns[name] for name in ("E0", "E1")}),
}
