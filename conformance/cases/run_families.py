"""Families of a run's questions: scenes that no file holds, and what is rare in random draws of them.

Where a family is for a wall, its questions are those that meet this wall first. A returning particle leaves
its wall slowly, off it by up to a quarter of what is allowed, and meets it again, which keeps the distance
out of f at the later hit too; in other units no flight time is long that seems so, or short. A law of many
legs has as many as a scene may have, and is asked about late in its period. A leaning stem is so deep that
a slope of 2^-22 to 2^-40 leads its sides together, or apart, by as much as they are apart. A hurried
particle is so much faster than the walls that they seem to stand, which its time and velocity show; a
waiting one comes to the base after hundreds of periods that no wall disturbs. A changed mouth is open when
the particle comes there and was not when it left the arc, or the other way round.
"""

from functools import partial
from math import sqrt

from conformance.cases.draw import Draw, Family, Question, Unfit
from conformance.cases.scenes import (
    KINDS,
    LONGEST,
    MOVING,
    TABLES,
    Clock,
    any_scene,
    clock,
    deep_wave,
    law,
    many_legs,
    off_its_wall,
    place,
    start,
    state,
    time,
    when,
)
from scene import Cap, Law, Mushroom, Scene, State, Stem, Wall
from scene.geometry import rounded
from scene.laws import MAX_KNOTS, bounds, is_constant
from scene.transforms import scaled, scaled_law, scaled_state

WALLS: tuple[tuple[str, Wall], ...] = tuple(
    (table.__name__.lower(), wall) for table in (Cap, Stem, Mushroom) for wall in table.walls
)
MOVABLE = tuple((table, wall) for table, wall in WALLS if wall != "base")
DEPTHS = 22, 40  # of a leaning stem, as powers of two of its width
UNITS = -44, 44  # powers of two that lengths and times are multiplied with, at most


def anywhere(table: str | None, wall: Wall | None, draw: Draw) -> Question:
    """Fly in any scene from any start; in a mushroom half of them on the wall's own side of the mouth."""
    of, site = any_scene(draw, table), None
    if table == "mushroom" and draw.pick((True, False)):
        site = "cap" if wall in ("arc", "base") else "stem"
    return Question(of, *start(draw, of, when(draw, of), site))


def from_the_base(draw: Draw) -> Question:
    """Leave the base of a mushroom, or the place where it was before the mouth opened."""
    of = any_scene(draw, "mushroom")
    return Question(of, *start(draw, of, when(draw, of), "base"))


def returning(table: str, wall: Wall, draw: Draw) -> Question:
    """Leave a wall slowly, a little off it, in any units; at times from just before the bounce."""
    of: Scene = any_scene(draw, table)
    if table == "mushroom" and wall != "arc" and draw.pick((True, False)):
        of = under_a_growing_cap(draw)
    at = {"t": when(draw, of), "site": wall, "speed": draw.power(-4, 1), "lift": draw.power(-5, -1)}
    leaving, t_end = state(draw, of, at | {"patience": 32.0})
    t_end = min(t_end, leaving.t + LONGEST / 2 * (of.period or 1.0))
    leaving = off_its_wall(draw, of, leaving, -3)
    length, units = draw.pick(range(UNITS[0], UNITS[1] + 1)), draw.pick(range(UNITS[0], UNITS[1] + 1))
    return Question(scaled(of, length, units), scaled_state(leaving, length, units), t_end * 2.0**units)


def under_a_growing_cap(draw: Draw) -> Mushroom:
    """Draw a mushroom whose mouth and sides move with its cap alone."""
    shared = clock(draw, MOVING)
    r = law(draw, 0.5, 2.0, shared)
    if is_constant(r):
        raise Unfit("the cap is at rest")
    return Mushroom(r=r, nu=draw.short(0.3, 0.9), h=law(draw, 0.5, 1.5, shared), slope=draw.short(-0.3, 0.05))


def many_knots(table: str, draw: Draw) -> Question:
    """Begin in the last part of a period that has as many legs as there may be."""
    period, low = draw.pick((0.5, 1.0, 1.5, 4.0)), draw.short(0.5, 1.5)
    legs = many_legs(draw, low, low * draw.between(1.05, 1.5), period, MAX_KNOTS - 1)
    of: Scene = Cap(r=legs)
    if table == "stem":
        of = Stem(w=law(draw, 0.5, 1.0, Clock("mixed", period)), h=legs, slope=draw.short(-0.5, 0.3))
    t = period * (draw.pick((0, 0, -1, 3)) + draw.between(0.75, 1.0))
    begun, t_end = start(draw, of, t)
    return Question(of, begun, min(t_end, t + period / 2))


def leaning(draw: Draw) -> Question:
    """Cross much of the depth of a stem that is next to upright, and of its width."""
    shared, depth = clock(draw, KINDS), draw.pick(range(DEPTHS[0], DEPTHS[1] + 1))
    w, h = law(draw, 0.25, 0.5, shared), law(draw, 0.5, 1.0, shared)
    part = draw.pick((1.0, -1.0)) * draw.between(0.1, 0.27)
    of = Stem(w=w, h=scaled_law(h, depth, 0), slope=part * bounds(w).lowest * 2.0**-depth)
    t, flight = time(draw, of), (of.period or 1.0) * draw.power(-4, 1)
    table, site = rounded(of, t), draw.pick(("stem", "left", "right", "floor"))
    x, y = place(draw, table, site)
    wall: Wall | None = next((name for name in of.walls if name == site), None)
    vx = draw.between(-1.0, 1.0) * table.w / flight
    vy = draw.pick((1.0, -1.0)) * draw.between(0.2, 1.0) * table.h / flight
    return Question(of, State(t, x, y, vx, vy, wall), t + 4 * flight)


def is_leaning(of: Scene) -> bool:
    """Tell whether a scene is such a stem."""
    return isinstance(of, Stem) and bounds(of.h).highest > 2.0 ** (DEPTHS[0] - 2) * bounds(of.w).highest


def changed_mouth(draw: Draw) -> Question:
    """Leave the arc for a place that the mouth's edge passes during the flight there.

    Most come down upright, as far from the centre as that place: these are captured at one of the two
    times and not at the other.
    """
    of = any_scene(draw, "mushroom")
    t, length = when(draw, of), of.period or 1.0
    flight, now = length * draw.power(-6, -1) * draw.between(0.5, 1.0), rounded(of, t)
    widths = now.w, rounded(of, t + flight).w
    to = draw.pick((1.0, -1.0)) * draw.between(min(widths), max(widths))
    x, y = place(draw, now, "arc")
    if draw.pick((True, True, True, False)) and abs(to) < now.r:
        x = to * draw.between(0.9, 1.0)
        y = sqrt(now.r**2 - x**2)
    return Question(of, State(t, x, y, (to - x) / flight, -y / flight, "arc"), t + LONGEST * length)


def hurried(draw: Draw) -> Question:
    """Cross a table in next to no part of its period: at 2^30 the walls do stand within 1e-9."""
    of = under_a_growing_cap(draw)
    at = {"speed": draw.power(16, 22) * draw.between(1.0, 2.0), "patience": 8.0}
    return Question(of, *state(draw, of, at | {"t": time(draw, of)}))


def vibrating(table: str, draw: Draw) -> Question:
    """Wait for 16 to 512 periods of walls that move by little, in which none comes near."""
    shared, part = clock(draw, MOVING), draw.power(-12, -8)

    def moving() -> Law:
        size = draw.short(0.5, 2.0)
        return law(draw, size * (1.0 - part), size * (1.0 + part), shared)

    of: Cap | Stem = (
        Cap(r=moving()) if table == "cap" else Stem(w=moving(), h=moving(), slope=draw.short(-0.2, 0.1))
    )
    if not of.period:
        raise Unfit("the walls are at rest")
    wide, high = (bounds(law).lowest for law in ((of.r, of.r) if isinstance(of, Cap) else (of.w, of.h)))
    flight = of.period * draw.power(5, 9) * draw.between(0.5, 1.0)
    way, y, t = (1.0 if table == "cap" else -1.0), high * draw.between(0.05, 0.3), time(draw, of)
    xs = wide * draw.between(-0.3, 0.3), wide * draw.between(-0.3, 0.3)
    return Question(of, State(t, xs[0], way * y, (xs[1] - xs[0]) / flight, -way * y / flight), t + 4 * flight)


def deep_waves(draw: Draw) -> Question:
    """Ask about walls of whose laws the mean less all amplitudes says that they may vanish."""
    shared, table = clock(draw, ("fourier",)), draw.pick(TABLES)
    of: Scene
    if table == "cap":
        of = Cap(r=deep_wave(draw, 0.05, 1.5, shared.rate))
    elif table == "stem":
        of = Stem(w=deep_wave(draw, 0.05, 1.0, shared.rate), h=deep_wave(draw, 0.1, 2.0, shared.rate))
    else:
        nu = deep_wave(draw, 0.02, 0.9, shared.rate)
        of = Mushroom(r=deep_wave(draw, 0.05, 1.5, shared.rate), h=draw.short(0.5, 1.5), nu=nu)
    return Question(of, *state(draw, of, {"speed": draw.power(-4, 2), "patience": draw.pick((1.0, 4.0))}))


FAMILIES = (
    Family(
        "deep-waves",
        "amplitudes that add up to more than the mean of a law that is positive all the same",
        deep_waves,
        weight=6,
    ),
    Family("anywhere", "a flight in a scene that no file holds", partial(anywhere, None, None), weight=30),
    *(
        Family(
            f"anywhere-{table}-{wall}",
            "a flight in a scene that no file holds",
            partial(anywhere, table, wall),
            weight=6,
            meets=wall,
        )
        for table, wall in WALLS
    ),
    *(
        Family(
            f"returning-{table}-{wall}",
            "a wall just left is met again: no flight is too short for that, in any unit",
            partial(returning, table, wall),
            weight=2,
            meets=wall,
        )
        for table, wall in MOVABLE
    ),
    Family(
        "many-knots-cap",
        "laws of as many legs as there may be",
        partial(many_knots, "cap"),
        weight=2,
        meets="arc",
    ),
    Family(
        "many-knots-stem",
        "laws of as many legs as there may be",
        partial(many_knots, "stem"),
        weight=2,
        meets="floor",
    ),
    *(
        Family(f"leaning-{wall}", "sides are taken for upright", leaning, weight=4, meets=wall)
        for wall in ("left", "right")
    ),
    *(
        Family(
            f"changed-mouth-{wall}",
            "the mouth is looked at where a flight begins",
            changed_mouth,
            weight=1,
            meets=wall,
        )
        for wall in Mushroom.walls
        if wall != "arc"
    ),
    Family("hurried", "walls are taken to stand, for particles so fast", hurried, weight=4, meets="arc"),
    Family("from-the-base", "no start names the base where the mouth is open now", from_the_base, weight=3),
    *(
        Family(
            f"vibrating-{table}",
            "a particle that meets nothing for many periods is given up",
            partial(vibrating, table),
            weight=3,
            meets="base",
        )
        for table in ("cap", "stem")
    ),
)
