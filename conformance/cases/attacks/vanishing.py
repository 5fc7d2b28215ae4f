"""Attacks on laws that all but vanish: their waves cancel to a part of 1e-4 to 1e-13, at any phase.

A value whose terms are known well may be known badly itself. What is looked for there is near such a wall by
parts of what is left of it: a place beside the mouth's edge, in the stem beside a side, above the floor, or a
flight to a wall that is next to nothing.
"""

from __future__ import annotations

import math

from mpmath import MPContext

from conformance.cases.attacks.case import Attack, Family, built
from conformance.cases.draws import Draw
from scene import Cap, Fourier, Mushroom, Scene, State, Stem
from scene.laws import value

FINE = MPContext()
FINE.prec = 300  # bits, of the place of a wall


def sunk(n: int, left: float, least: float = 0.0) -> Fourier:
    """Return ((1 - cos 2 pi (t - least)) / 2)^n + left, of period 1: flatter at its least the higher n is."""
    waves = [math.comb(2 * n, n - k) * (-1.0) ** k * 2.0 / 4.0**n for k in range(1, n + 1)]
    angles = [2 * math.pi * k * least for k in range(1, n + 1)]
    cos = tuple(wave * math.cos(angle) for wave, angle in zip(waves, angles, strict=True))
    sin = tuple(wave * math.sin(angle) for wave, angle in zip(waves, angles, strict=True))
    return Fourier(mean=math.comb(2 * n, n) / 4.0**n + left, cos=cos, sin=sin, period=1.0)


def _all_but_vanishing(draw: Draw) -> tuple[Fourier, float]:
    """Draw such a law of which little is left, and the time of its least."""
    n, least = draw.pick((1, 1, 2)), draw.pick((0.0, 0.25, draw.part(), draw.part()))
    law = sunk(n, 10.0 ** -draw.between(4.0, 13.0), least)
    # By rounding of the amplitudes it may vanish.
    return (law, least) if built(lambda: Cap(r=law)) else _all_but_vanishing(draw)


def nearly_shut(draw: Draw) -> Attack:
    """Start, or cross the mouth, beside a wall that all but vanishes, by a small part of what is left."""
    law, least = _all_but_vanishing(draw)
    t = least + draw.pick((0.0, 0.0, 1.0, -3.0)) + draw.pick((1.0, -1.0)) * 10.0 ** -draw.between(3.0, 8.0)
    size = value(FINE, law, FINE.mpf(t))
    part = draw.pick((1.0, -1.0)) * 10.0 ** -draw.between(4.0, 11.0)
    x = float(size * (1 + FINE.mpf(part))) * draw.pick((1.0, -1.0))
    how, made = draw.pick(("mouth", "side", "floor", "above")), Mushroom(r=1.5, w=law, h=1.0)
    if how == "floor":
        return Attack(Stem(w=1.0, h=law), State(t, 0.25, -abs(x), 0.0, 1.0), t + 1e-3)
    if how == "mouth":
        return Attack(made, State(t, x, 0.0, 0.0, -1.0), t + 1e-3)
    if how == "side":
        return Attack(made, State(t, x, -0.5, 0.0, -1.0), t + 1e-3)
    before = 2.0 ** -draw.pick(range(20, 40))  # and so much later, or as exactly as times are, at the mouth
    return Attack(made, State(t - before, x, before, 0.0, -1.0), t + 1e-3)


def all_but_gone(draw: Draw) -> Attack:
    """Fly to an arc, a floor or a side that is about to be, or has just been, next to nothing."""
    law, least = _all_but_vanishing(draw)
    t = least + draw.pick((0.0, 0.0, 1.0, -3.0)) + draw.pick((1.0, -1.0)) * 10.0 ** -draw.between(2.5, 7.0)
    speed = draw.power(-3, 7)
    made: Scene = Stem(w=1.0, h=law)
    start = State(t, 0.25, 0.0, draw.between(-0.1, 0.1) * speed, -speed, "base")
    which = draw.pick(("arc", "floor", "side"))
    if which == "arc":
        made, start = Cap(r=law), State(t, 0.0, 0.0, draw.between(-1.0, 1.0) * speed, speed, "base")
    elif which == "side":
        made, start = Stem(w=law, h=1.0), State(t, 0.0, -0.5, speed, draw.between(-1.0, 1.0) * speed)
    return Attack(made, start, t + 1.0)


FAMILIES = (
    Family(nearly_shut, "terms known to 2^-62 of themselves are taken for a sum known as well", True),
    Family(all_but_gone, "the same, where a wall is met", True),
)
