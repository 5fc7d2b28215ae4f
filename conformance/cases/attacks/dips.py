"""Attacks between the ends of a flight: a wall that passes the particle and comes back, and walls seen late.

Near its least value a breathing wall comes towards the particle and goes again. A particle that is slow there
sees f fall below 0 and come back (or nearly) while it flies to another wall, whose end of the flight alone
shows nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from conformance.cases.attacks.case import Attack, Family
from conformance.cases.draws import Draw
from scene import BangBang, Fourier, Law, Mushroom, State

DEPTH = 0.9  # the moving length is 1 - 0.9 cos(t - turn): least, 0.1, at t = turn
LEAST = 1.0 - DEPTH


BREATHING: Law = Fourier(mean=1.0, omega=1.0, cos=(DEPTH,))
DEPTHS: tuple[Law, ...] = (1.0, BREATHING)
MOUTHS: tuple[Law, ...] = (0.3, Fourier(mean=0.3, omega=1.0, cos=(0.1,)))
RADII: tuple[Law, ...] = (0.5, Fourier(mean=0.8, omega=1.0, sin=(0.2,)))


def _miss(draw: Draw) -> float:
    """Draw how deep f falls below 0, relative to the least length; negative for a near miss."""
    depth: float = 10.0 ** -draw.between(1.0, 10.0)
    return depth * draw.pick((1.0, 1.0, 1.0, -1.0))


def arc_dips(draw: Draw) -> Attack:
    """The arc passes the particle and comes back on its way to the base or the mouth."""
    while True:
        angle = math.pi * draw.pick((draw.part(), 0.3 * draw.part(), 1 - 0.3 * draw.part()))
        rho = LEAST * (1 + _miss(draw))
        x, y = rho * math.cos(angle), rho * math.sin(angle)
        speed, (vx, vy) = 0.3 * draw.part(), draw.direction()
        vx, vy = speed * vx, -speed * abs(vy)
        # f = r^2 - |x|^2 is least where r r' = x v; near the turn r' is DEPTH times the time since.
        turn = math.pi + (x * vx + y * vy) / (LEAST * DEPTH)
        before = draw.between(0.001, 0.3)
        state = State(turn - before, x - vx * before, y - vy * before, vx, vy)
        radius = 1.0 + DEPTH * math.cos(state.t)
        if math.hypot(state.x, state.y) < radius * (1 - 1e-9):
            break
    w = draw.pick((0.0005, 0.01, 0.05, 0.09))
    scene = Mushroom(r=BREATHING, h=draw.pick(DEPTHS), w=w)
    t_end = state.t + before + draw.between(0.0, 0.6)
    return _asked(draw, scene, state, t_end)


def _breath(t: float) -> tuple[float, float]:
    """Return the breathing length and its rate."""
    return 1.0 + DEPTH * math.cos(t), -DEPTH * math.sin(t)


def arc_dips_on_rebound(draw: Draw) -> Attack:
    """As `arc_dips`, but the flight begins with a hit of the arc, as it does in a batch under way.

    The speed is such that f'' = 2 (r'^2 + r r'' - v^2) is next to 0 at the start and negative later, near
    the least radius: to second order in time the arc is not met.
    """
    while True:
        t = math.pi + 0.3 * draw.between(-1.0, 0.3)
        r, rate = _breath(t)
        bend = rate * rate - r * DEPTH * math.cos(t)
        least_bend = LEAST * DEPTH
        v2 = least_bend + (bend - least_bend) * draw.between(0.0, 1.1)
        angle = math.pi * draw.part()
        nx, ny = -math.cos(angle), -math.sin(angle)
        # The normal points inside, against the radius: the arc moves along it by -rate.
        away = 10.0 ** -draw.between(1.0, 5.0) - rate
        if v2 <= away * away:
            continue
        along = math.sqrt(v2 - away * away) * draw.pick((1.0, -1.0))
        vx, vy = away * nx - along * ny, away * ny + along * nx
        if vy < 0 and _arc_dips(t, -r * nx, -r * ny, vx, vy):
            break
    back = 2 * (away + rate)
    before = 10.0 ** -draw.between(2.0, 5.0) * r
    vx, vy = vx - back * nx, vy - back * ny
    state = State(t - before, -r * nx - vx * before, -r * ny - vy * before, vx, vy)
    if not (state.y > 0 and math.hypot(state.x, state.y) < _breath(state.t)[0] * (1 - 1e-9)):
        return arc_dips_on_rebound(draw)
    scene = Mushroom(r=BREATHING, h=1.0, w=draw.pick((0.0005, 0.01, 0.05, 0.09)))
    return _asked(draw, scene, state, t + draw.between(0.1, 0.6))


def _arc_dips(t: float, x: float, y: float, vx: float, vy: float) -> bool:
    return _dips(lambda s: _breath(t + s)[0] - math.hypot(x + vx * s, y + vy * s), -y / vy)


def _dips(f: Callable[[float], float], end: float) -> bool:
    """Tell whether f, 0 at 0, rises, falls below 0 and is above 0 again at the end, on a grid."""
    values = [f(end * i / 64) for i in range(1, 65)]
    return values[0] > 0 and min(values) < 0 < values[-1]


def rebound_dips(draw: Draw) -> Attack:
    """The floor or a side hits a particle, is left behind, catches up on its way elsewhere and falls back."""
    while True:
        t, lift = draw.between(0.05, 1.55), 10.0 ** -draw.between(0.3, 4.0)
        length, rate = _breath(t)
        speed = lift - rate
        if _length_dips(t, speed):
            break
    before = 10.0 ** -draw.between(2.0, 5.0)
    inward = speed - 2 * lift
    start = -length - inward * before
    along = 0.05 * draw.between(-1.0, 1.0)
    t_end = t + draw.between(0.0, 3.0) + length / speed
    if draw.pick((True, True, False)):
        scene = Mushroom(r=draw.pick(RADII), h=BREATHING, w=draw.pick(MOUTHS))
        return _asked(draw, scene, State(t - before, 0.0, start, along, inward), t_end)
    scene = Mushroom(r=2.0, h=1.0, w=BREATHING)
    return _asked(draw, scene, State(t - before, start, -0.5, inward, along), t_end)


def _length_dips(t: float, speed: float) -> bool:
    length = _breath(t)[0]
    return _dips(lambda s: speed * s + _breath(t + s)[0] - length, length / speed)


def floor_from_stem(draw: Draw) -> Attack:
    """The floor overtakes a particle, or nearly, on its flight from the stem through the mouth to the arc."""
    vy = 0.4 * draw.part()
    # f = y + h is least where vy + h' = 0; near the turn h' is DEPTH times the time since.
    turn = math.pi - vy / DEPTH
    y = -(1.0 + DEPTH * math.cos(turn)) * (1 + _miss(draw))
    before = draw.between(0.001, 0.5)
    while y - vy * before <= -(1.0 + DEPTH * math.cos(turn - before)) * (1 - 1e-9):
        before *= 1.5
    vx = 0.3 * draw.between(-1.0, 1.0)
    scene = Mushroom(r=draw.pick(RADII), h=BREATHING, w=draw.pick(MOUTHS))
    x = -vx * before * draw.part()
    state = State(turn - before, min(max(x, -0.19), 0.19), y - vy * before, vx, vy)
    return _asked(draw, scene, state, turn + draw.between(0.0, 6.0))


def side_dips(draw: Draw) -> Attack:
    """A side that leans and breathes passes a slow particle in the stem and comes back."""
    vx, vy = 0.2 * draw.between(-1.0, 1.0), 0.3 * draw.between(-1.0, 1.0)
    slope = draw.pick((0.0, 0.02, -0.3))
    turn = math.pi + (vx - slope * vy) / DEPTH
    y = -0.5
    x = (1.0 + DEPTH * math.cos(turn) + slope * y) * (1 + _miss(draw))
    before = draw.between(0.001, 0.5)
    while x - vx * before >= (1.0 + DEPTH * math.cos(turn - before) + slope * (y - vy * before)) * (1 - 1e-9):
        before *= 1.5
    side = draw.pick((1.0, -1.0))
    state = State(turn - before, side * (x - vx * before), y - vy * before, side * vx, vy)
    if not -1.5 < state.y < 0:
        return side_dips(draw)
    scene = Mushroom(r=2.0, w=BREATHING, h=1.5, slope=slope)
    return _asked(draw, scene, state, turn + draw.between(0.0, 3.0))


def _asked(draw: Draw, scene: Mushroom, state: State, t_end: float) -> Attack:
    """Ask for all collisions up to the horizon, or for the first one."""
    if draw.pick((True, True, False)):
        return Attack(scene, state, t_end, n_collisions=40, is_flow=True)
    return Attack(scene, state, t_end)


def met_again_across_knot(draw: Draw) -> Attack:
    """A wall met again across a knot: it is left just before one and met just after another."""
    period = draw.pick((0.5, 1.0, 3.0))
    parts = sorted(draw.part() for _ in range(draw.pick((2, 3, 4))))
    values = [draw.between(0.6, 2.0) for _ in (0, *parts)]
    if draw.pick((True, True, False)):
        values[2] = values[1]  # a plateau: the wall waits, then goes on
    times = [0.0, *(period * part for part in parts), period]
    law = BangBang(knots=tuple(zip(times, [*values, values[0]], strict=True)))
    turns = period * draw.pick((0, 0, 1, 100, 1000))
    leg = draw.pick(range(1, len(times) - 1))
    t = turns + times[leg] - (times[leg] - times[leg - 1]) * 10.0 ** -draw.between(0.5, 6.0)
    now, rate = _value(law, t - turns)
    wall = draw.pick(("floor", "arc", "left"))
    lift, along = 10.0 ** -draw.between(1.0, 15.0), 0.1 * draw.between(-1.0, 1.0)
    t_end = t + 4 * period
    if wall == "floor":
        scene = Mushroom(r=1.9, h=law, nu=0.3)
        return Attack(scene, State(t, 0.01, -now, along, lift - rate, "floor"), t_end)
    if wall == "arc":
        return Attack(Mushroom(r=law, h=1.0, w=0.3), State(t, 0.0, now, along, rate - lift, "arc"), t_end)
    scene = Mushroom(r=4.0, h=1.0, w=law, slope=draw.pick((0.0, 0.0, -0.1)))
    y = -0.5 if scene.slope == 0.0 else -0.25
    x = -(now + y * float(scene.slope)) if isinstance(scene.slope, float) else -now
    return Attack(scene, State(t, x, y, lift - rate, 0.0, "left"), t_end)


def _value(law: BangBang, t: float) -> tuple[float, float]:
    """Return a law's value and rate at a time of its first period, rounded."""
    for (t0, v0), (t1, v1) in zip(law.knots, law.knots[1:], strict=False):
        if t0 <= t <= t1:
            pull, middle = 4 * (v1 - v0) / (t1 - t0) ** 2, (t0 + t1) / 2
            if t < middle:
                return v0 + pull * (t - t0) ** 2 / 2, pull * (t - t0)
            return v1 - pull * (t1 - t) ** 2 / 2, pull * (t1 - t)
    raise ValueError(f"t = {t} is outside the first period")


FAMILIES = (
    Family(arc_dips, "the arc is looked at only where a flight ends, though it came by"),
    Family(arc_dips_on_rebound, "lanes look at the arc only where a flight to the base ends"),
    Family(rebound_dips, "lanes forget the wall just left on the way to another"),
    Family(floor_from_stem, "the floor is forgotten on a flight from the stem to the arc"),
    Family(side_dips, "a side is looked at only where a flight ends, though it came by"),
    Family(met_again_across_knot, "the time within a leg is rounded to the period's ulp"),
)
