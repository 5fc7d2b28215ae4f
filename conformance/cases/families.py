"""Families of single steps and of short paths that the corpus began with.

A family's order of draws and its aim never change once published; a longer count only adds vectors.
"""

from collections.abc import Callable
from functools import partial

import msgspec

from conformance.cases.draw import Draw, Family, Question
from conformance.cases.scenes import MOVING, TABLES, Clock, clock, place, scene, state, time
from scene import Cap, Mushroom, Scene, State, Stem, from_data, load, to_data
from scene.geometry import rounded

MOVING_CAPS = ("moving-cap", "moving-cap-reversed", "moving-cap-trivial", "ergodic", "untilted")
FIXED = ("fixed-cap-anticlockwise", "fixed-cap-clockwise")
EVERY = (*MOVING_CAPS, *FIXED, "breathing-circle", "fermi-ulam")
CATALOGUE = {
    "moving-cap": "sec. 4.2",
    "moving-cap-reversed": "sec. 4.2",
    "moving-cap-trivial": "sec. 4.2",
    "ergodic": "sec. 4.2",
    "untilted": "sec. 4.2, discussion",
    "fixed-cap-anticlockwise": "sec. 4.1",
    "fixed-cap-clockwise": "sec. 4.1",
    "frozen-mushroom": "sec. 2",
    "breathing-circle": "sec. 3.1",
    "fermi-ulam": "introduction",
    "retraced-arc": "sec. 5",
}
REGIONS = {Cap: ("cap",), Stem: ("stem",), Mushroom: ("cap", "stem")}
WAIT = 16.0  # how long slow particles may fly [time]


def moving_scene(draw: Draw) -> Scene:
    """Draw a scene of any table that moves by waves, or by legs."""
    return scene(draw, draw.pick(TABLES), clock(draw, MOVING))


def soon(of: Scene, start: tuple[State, float]) -> Question:
    """Ask for a step of no more than some time."""
    return Question(of, start[0], min(start[1], start[0].t + WAIT))


def ordinary(scene_of: Callable[[Draw], Scene], draw: Draw) -> Question:
    """Ask for a flight in a scene, from anywhere."""
    of = scene_of(draw)
    return Question(of, *state(draw, of, {}))


def catalogue_path(name: str, draw: Draw) -> Question:
    """Ask for successive collisions there."""
    of = load(name)
    at = {"speed": draw.power(-1, 7) * draw.between(1.0, 2.0), "patience": draw.pick((4.0, 400.0))}
    return Question(of, *state(draw, of, at), draw.pick((6, 12, 24)))


def generated(table: str, kinds: tuple[str, ...], draw: Draw) -> Scene:
    """Draw a table with laws of some kinds."""
    return scene(draw, table, clock(draw, kinds))


def generated_path(table: str, draw: Draw) -> Question:
    """Ask for successive collisions in any such table."""
    of = scene(draw, table, clock(draw))
    at = {"speed": draw.power(0, 6), "patience": draw.pick((4.0, 400.0))}
    return Question(of, *state(draw, of, at), draw.pick((6, 12, 20)))


def whispering_gallery(draw: Draw) -> Question:
    """Leave the arc at a small angle, again and again."""
    of = load(draw.pick(("breathing-circle", "moving-cap", "frozen-mushroom")))
    at = {"site": "arc", "speed": draw.power(3, 6), "lift": draw.power(-6, -2), "patience": 400.0}
    return Question(of, *state(draw, of, at), 30)


def stem_path(draw: Draw) -> Question:
    """Follow a fast particle in a stem."""
    of = scene(draw, "stem", clock(draw, MOVING))
    at = {"speed": draw.power(2, 6), "patience": 400.0}
    return Question(of, *state(draw, of, at), 30)


def slow_particle(draw: Draw) -> Question:
    """Fly more slowly than the walls."""
    of = moving_scene(draw)
    return soon(of, state(draw, of, {"speed": draw.power(-12, -1), "patience": draw.pick((0.25, 4.0))}))


def fast_wall(draw: Draw) -> Question:
    """Do so in a scene of the catalogue."""
    of = load(draw.pick(EVERY))
    return soon(of, state(draw, of, {"speed": draw.power(-10, 0), "patience": 2.0}))


def skipping(draw: Draw) -> Question:
    """Leave a wall at a small angle to it."""
    of = moving_scene(draw)
    at = {"site": draw.pick([w for w in of.walls if w != "base"]), "lift": draw.power(-40, -3)}
    return soon(of, state(draw, of, at))


def grazing(draw: Draw) -> Question:
    """Begin at the middle of a chord, next to the arc."""
    of = scene(draw, draw.pick(("cap", "mushroom")), clock(draw))
    t = time(draw, of)
    r, (c, s) = rounded(of, t).r, draw.direction()
    rho = r * (1 - draw.power(-50, -6))
    speed, turn = draw.power(0, 10), draw.pick((1.0, -1.0))
    start = State(t, rho * c, rho * abs(s), -turn * speed * abs(s), turn * speed * c)
    return Question(of, start, t + 8 * r / speed + 1.0)


def near_corner(draw: Draw) -> Question:
    """Fly to a place next to where a corner will be then."""
    of = scene(draw, draw.pick(TABLES), clock(draw))
    t = time(draw, of)
    now, speed = rounded(of, t), draw.power(0, 8)
    site = draw.pick(REGIONS[type(of)])
    x, y = place(draw, now, site)
    flight = now.size / speed * draw.between(0.25, 1.0)
    there = rounded(of, t + flight)
    corner = draw.pick(there.corners(site))
    off = there.size * draw.power(-50, -8)
    c, s = draw.direction()
    vx, vy = (corner[0] + off * c - x) / flight, (corner[1] + off * s - y) / flight
    return Question(of, State(t, x, y, vx, vy), t + 4 * flight)


def through_mouth(draw: Draw) -> Question:
    """Come to y = 0 near the mouth."""
    of = (
        load(draw.pick((*MOVING_CAPS, *FIXED)))
        if draw.pick((False, True))
        else scene(draw, "mushroom", clock(draw))
    )
    t = time(draw, of)
    now, speed = rounded(of, t), draw.power(0, 7)
    x, y = place(draw, now, draw.pick(("cap", "stem")))
    flight = now.size / speed * draw.between(0.25, 1.0)
    aim = draw.between(-1.2, 1.2) * rounded(of, t + flight).w
    return Question(of, State(t, x, y, (aim - x) / flight, -y / flight), t + 8 * flight)


def knot_in_flight(draw: Draw) -> Question:
    """Fly slowly between walls that move by legs."""
    if draw.pick((False, True)):
        of = load(draw.pick(FIXED))
    else:
        of = scene(draw, draw.pick(("stem", "mushroom")), Clock("bang-bang", draw.pick((0.5, 1.0))))
    return soon(of, state(draw, of, {"speed": draw.power(-4, 1), "patience": 8.0}))


def late_start(draw: Draw) -> Question:
    """Begin as late as binary64 allows, or a million periods late."""
    if draw.pick((False, True)):
        of, most = scene(draw, draw.pick(TABLES), Clock("constant")), 44
    else:
        of, most = load(draw.pick(EVERY)), 20
    t = draw.power(8, most) * draw.between(1.0, 2.0)
    return Question(of, *state(draw, of, {"t": t}))


def horizon(draw: Draw) -> Question:
    """End before a wall is met."""
    of = load(draw.pick(EVERY)) if draw.pick((False, True)) else scene(draw, draw.pick(TABLES), clock(draw))
    at = {"patience": draw.pick((0.0, 2.0**-20, 2.0**-4, 2.0**-4, 0.125))}
    return Question(of, *state(draw, of, at))


def scales(draw: Draw) -> Question:
    """Ask in a table that stands still, of any size."""
    of = scene(draw, draw.pick(TABLES), Clock("constant"))
    start, t_end = state(draw, of, {"t": 0.0})
    length = 2.0 ** draw.pick(range(-60, 61))
    data = to_data(of)
    data |= {name: data[name] * length for name in data.keys() & {"r", "w", "h"}}
    grown = State(0.0, start.x * length, start.y * length, start.vx, start.vy, start.wall)
    return Question(from_data(data), grown, t_end * length)


def refused_state(draw: Draw) -> Question:
    """Begin outside the table."""
    of = scene(draw, draw.pick(TABLES), clock(draw))
    start, t_end = state(draw, of, {"site": draw.pick(REGIONS[type(of)])})
    far = draw.pick((1.5, 4.0, 1e6)) * rounded(of, start.t).size
    c, s = draw.direction()
    return Question(of, msgspec.structs.replace(start, x=start.x + far * c, y=start.y + far * s), t_end)


def _of_the_catalogue(name: str, source: str) -> list[Family]:
    n_paths = 16 if name in ("moving-cap", *FIXED) else 11
    aim, paths = f"a flight in the scene {name}", f"successive collisions in the scene {name}"
    return [
        Family(name, aim, partial(ordinary, lambda _: load(name)), source, 50),
        Family(f"{name}-trajectory", paths, partial(catalogue_path, name), source, n_paths),
    ]


def _generated(table: str) -> list[Family]:
    still, moving = ("constant",), ("fourier", "bang-bang", "constant")
    paths = f"successive collisions in a generated {table}"
    return [
        Family(
            f"static-{table}",
            f"a flight in a static {table}",
            partial(ordinary, partial(generated, table, still)),
            n_vectors=20,
        ),
        Family(
            f"generated-{table}",
            f"a flight in a generated {table}",
            partial(ordinary, partial(generated, table, moving)),
            n_vectors=90,
        ),
        Family(f"generated-{table}-trajectory", paths, partial(generated_path, table), n_vectors=10),
    ]


FAMILIES = (
    *(row for name, source in CATALOGUE.items() for row in _of_the_catalogue(name, source)),
    *(row for table in TABLES for row in _generated(table)),
    Family(
        "whispering-gallery",
        "a whispering gallery: angular momentum is kept while r moves",
        whispering_gallery,
        "sec. 3.1; hard cases 2, 3",
        10,
    ),
    Family("stem-trajectory", "many collisions in a stem", stem_path, n_vectors=10),
    Family("slow-particle", "a particle slower than the walls", slow_particle, "hard cases 8 to 15", 60),
    Family(
        "fast-wall",
        "a wall that overtakes or recedes: gate on f', not on v",
        fast_wall,
        "hard cases 8, 11",
        40,
    ),
    Family(
        "skipping",
        "a wall is left at a grazing angle, relative to the wall: the next hit may be very near",
        skipping,
        "hard cases 2, 3, 9, 10",
        60,
    ),
    Family("grazing", "a chord close to the arc", grazing, "hard case 1", 60),
    Family("near-corner", "a hit beside a corner or the mouth's edge", near_corner, "hard cases 23, 30", 90),
    Family(
        "through-mouth",
        "the width of the mouth when it is reached decides",
        through_mouth,
        "sec. 2; hard cases 24, 26",
        60,
    ),
    Family(
        "knot-in-flight",
        "a law changes its piece during the flight",
        knot_in_flight,
        "sec. 4.1; hard case 36",
        60,
    ),
    Family("late-start", "a late start: dt keeps its precision", late_start, "hard cases 38, 39", 50),
    Family("horizon", "nothing is met before t_end", horizon, "protocol 1", 50, wanted="horizon"),
    Family("scales", "tables of any size: no absolute tolerance", scales, "hard cases 16, 40", 50),
    Family(
        "refused-state", "a state outside the table", refused_state, "hard case 45", 30, wanted="rejected"
    ),
)
