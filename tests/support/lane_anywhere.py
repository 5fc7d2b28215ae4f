"""Draws of scenes and starts of every kind that lanes know, for the search in lane_search.

Walls move as far and particles as slowly as lanes allow: near the least radius, mouths from half the cap to a
slit, deep floors, plateaus; starts on every wall.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpmath import fp

from fast.kernel import records
from fast.kernel.records import FloatArray
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, Stem
from scene.geometry import table_at
from scene.laws import value

Start = tuple[FloatArray, int]  # t, its low part, x, y, vx, vy as the kernels take them, and the wall's code
Draw = Callable[[int, np.random.Generator], tuple[Scene, list[Start]]]  # a scene and so many starts in it
# Codes of the walls that starts are drawn on, by their number, and how often each.
BELOW = (records.BASE, records.LEFT, records.RIGHT, records.FLOOR)
SHARES = {1: [1.0], 4: [0.25] * 4, 5: [0.6, 0.1, 0.1, 0.1, 0.1]}


class Group(NamedTuple):
    """How to draw a scene and starts, and whether particles move unfolded through the base."""

    draw: Draw
    is_captured: bool = False


def draw_scene(random: np.random.Generator) -> Scene:
    """Draw a scene that lanes know, its walls moving deeply."""
    kind, omega = random.random(), float(10.0 ** random.uniform(-0.5, 0.5))

    def law(least: float, most: float) -> Law:
        if random.random() < 0.25 or least == most:
            return float(least)
        # Smooth laws, laws with knots, or both in one scene.
        if kind < 0.5 or (kind < 0.7 and random.random() < 0.5):
            n, swing = int(random.choice([1, 1, 2, 5, 16])), 0.4999 * (most - least)
            turns, sizes = random.uniform(0, 2 * np.pi, n), random.random(n) / np.arange(1, n + 1) ** 2
            sizes *= swing / sizes.sum()
            cos, sin = (tuple(map(float, sizes * wave(turns))) for wave in (np.cos, np.sin))
            frequency = {"omega": omega} if kind < 0.5 else {"period": 1.0}
            return Fourier(mean=0.5 * (least + most), cos=cos, sin=sin, **frequency)
        inner = np.sort(random.uniform(0.05, 0.95, 3))
        ends = [float(v) for v in random.uniform(least, most, 3)]
        if random.random() < 0.5:
            ends[1] = ends[0]
        times = [0.0, *map(float, inner), 1.0]
        return BangBang(knots=tuple(zip(times, [ends[2], *ends, ends[2]], strict=True)))

    least_r = 10.0 ** random.uniform(-3, 0)
    r = law(least_r, random.uniform(least_r, 2.0))
    table = random.random()
    if table < 0.1:
        return Cap(r=r)
    least_h = 10.0 ** random.uniform(-2, 0.5)
    most_h = random.uniform(least_h, 4.0 + least_h)
    h = law(least_h, most_h)
    share = min(10.0 ** random.uniform(-3, 0.3), 0.95)
    lean = float(random.choice([0.0, random.uniform(-0.4, 0.4)]))

    def slope(size: float) -> Law:
        return law(*sorted((lean * size, -0.4 * size))) if random.random() < 0.5 else lean * size

    if table < 0.25:
        least_w = 10.0 ** random.uniform(-2, 0)
        return Stem(w=law(least_w, random.uniform(least_w, 1.5)), h=h, slope=slope(least_w / most_h))
    if random.random() < 0.2:  # a rim so narrow that a flight leaves the arc and is at once in the mouth
        return Mushroom(r=r, nu=1.0 - float(10.0 ** random.uniform(-4, -1)), h=h)
    if random.random() < 0.5:
        nu = law(share * 10.0 ** random.uniform(-2, 0), share)
        least_nu = 0.009 * share
        return Mushroom(r=r, nu=nu, h=h, slope=slope(least_nu * least_r / most_h))
    w = law(0.05 * share * least_r, share * least_r)
    return Mushroom(r=r, w=w, h=h, slope=slope(0.05 * share * least_r / most_h))


def draw_start(scene: Scene, random: np.random.Generator) -> Start:
    """Draw a start on a wall: the state as the kernels take it, and the wall's code."""
    t = _draw_time(scene, random)
    now = table_at(fp, scene, t)
    along, away = 10.0 ** random.uniform(-3, 1.5, 2) * random.choice([1.0, 1.0, 0.03])
    along *= random.choice([-1.0, 1.0])
    walls = (() if isinstance(scene, Stem) else (records.ARC,)) + (() if isinstance(scene, Cap) else BELOW)
    wall = int(random.choice(walls, p=SHARES[len(walls)]))
    if wall == records.ARC:
        x, y, vx, vy = _leave_the_arc(scene, t, along, away, random)
    elif wall == records.BASE:
        is_top = isinstance(scene, Stem)
        x = now.w * random.uniform(-1, 1) if is_top else now.w + (now.r - now.w) * random.random()
        y, vx, vy = 0.0, along, -away if is_top else away
    elif wall == records.FLOOR:
        x, y = now.half_width(-now.h) * random.uniform(-1, 1), -now.h
        vx, vy = along, away - now.h_rate
    else:
        y = -now.h * random.random()
        sign = 1.0 if wall == records.RIGHT else -1.0
        x = sign * now.half_width(y)
        vx, vy = sign * (now.w_rate + now.slope_rate * y + now.slope * along - away), along
    return np.array([t, 0.0, x, y, vx, vy]), wall


def _leave_the_arc(
    scene: Scene, t: float, along: float, away: float, random: np.random.Generator
) -> tuple[float, ...]:
    """Draw a place and a velocity on the arc."""
    now = table_at(fp, scene, t)
    angle = random.uniform(0.0, np.pi) if random.random() < 0.7 else 10.0 ** random.uniform(-3, 0)
    out = now.r_rate - away
    curl = now.r_rate**2 + now.r * value(fp, scene.r, t, 2)
    if random.random() < 0.5 and curl > 0.0:
        # The arc's function is just concave here, and will not stay so: it may dip, and come back before
        # the particle is down at y = 0.
        speed = np.sqrt(curl * (1.0 + 10.0 ** random.uniform(-3, 0.5)))
        out = now.r_rate - speed * 10.0 ** random.uniform(-5, -1)
        along = -np.sqrt(max(speed**2 - out**2, 0.0))
        angle = random.random()
    e_x, e_y = np.cos(angle), np.sin(angle)
    return now.r * e_x, now.r * e_y, out * e_x - along * e_y, out * e_y + along * e_x


def draw_anywhere(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw a scene and n starts in it."""
    scene = draw_scene(random)
    return scene, [draw_start(scene, random) for _ in range(n)]


def _draw_time(scene: Scene, random: np.random.Generator) -> float:
    """Draw a time, half of them a little before the least radius."""
    r = getattr(scene, "r", None)
    if isinstance(r, Fourier) and random.random() < 0.5:
        least = np.arctan2(-r.sin[0], -r.cos[0]) + random.normal() * 10.0 ** random.uniform(-3, 0)
        return float((least + 2 * np.pi * random.integers(0, 5)) / (r.omega or 2 * np.pi))
    return float(random.uniform(0, 9))
