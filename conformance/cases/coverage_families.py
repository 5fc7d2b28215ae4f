"""Families for inputs that few tests have: late times, long waits, places near walls, laws of many terms."""

from collections.abc import Iterator

import msgspec

from conformance.cases.draw import Draw, Family, Question
from conformance.cases.scenes import TABLES, Clock, clock, deep_wave, law, scene, state, time
from scene import BangBang, Cap, Mushroom, Scene, State, Stem, load
from scene.geometry import rounded
from scene.tables import laws

CATALOGUE = (
    "moving-cap",
    "moving-cap-reversed",
    "moving-cap-trivial",
    "ergodic",
    "untilted",
    "fixed-cap-anticlockwise",
    "fixed-cap-clockwise",
    "breathing-circle",
    "fermi-ulam",
)


def knots_off_zero(draw: Draw) -> Question:
    """Ask about a bang-bang law whose first knot is not at 0, at times of either sign."""
    first, length = draw.pick(((0.3, 0.25), (-0.7, 0.5), (-0.7, 1.0), (-0.7, 1.5), (17.3, 0.5), (-0.25, 1.0)))
    of = scene(draw, draw.pick(TABLES), Clock("bang-bang", length))
    last = first + length  # the period, exactly, is a binary64 number for each of these

    def moved(knots: tuple[tuple[float, float], ...]) -> BangBang:
        inner = [(first + t, value) for t, value in knots[1:-1]]
        return BangBang(knots=((first, knots[0][1]), *inner, (last, knots[-1][1])))

    off = {name: moved(found.knots) for name, found in laws(of).items() if isinstance(found, BangBang)}
    of = msgspec.structs.replace(of, **off)
    t = time(draw, of) - (of.period or 1.0) * draw.pick((0, 0, 1, 3, 40))
    at = {"t": t, "speed": draw.power(-2, 4), "patience": 8.0}
    return Question(of, *state(draw, of, at))


def waiting(draw: Draw) -> Question:
    """Ask about a particle that drifts for many periods through a part of the table that no wall sweeps."""
    shared = Clock(draw.pick(("fourier", "bang-bang", "mixed")), draw.pick((0.5, 1.0, 4.0)))
    n_periods = draw.pick((20, 20, 100)) * draw.between(1.0, 1.25)
    table = draw.pick(TABLES)
    of: Scene
    if table == "cap":
        of = Cap(r=law(draw, 1.0, 1.25, shared))
    elif table == "stem":
        of = Stem(w=law(draw, 1.0, 1.25, shared), h=law(draw, 2.0, 2.5, shared))
    else:
        nu, h = law(draw, 0.3, 0.6, shared), law(draw, 1.0, 1.25, shared)
        of = Mushroom(r=law(draw, 1.0, 1.25, shared), nu=nu, h=h)
    x, y = draw.between(-0.2, 0.2), draw.between(0.1, 0.4) * (-1.0 if table == "stem" else 1.0)
    t, (vx, vy) = time(draw, of), draw.direction()
    speed = 0.8 / (n_periods * (of.period or shared.rate))
    start = State(t, x, y, speed * vx, speed * vy)
    return Question(of, start, t + 4.0 / speed)


def beside_a_wall(draw: Draw) -> Question:
    """Ask about a start on one wall very near another."""
    of = scene(draw, draw.pick(TABLES), clock(draw))
    t = time(draw, of)
    near = 10.0 ** -draw.pick(range(3, 13)) * draw.between(1.0, 2.0)
    site, x, y = draw.pick(list(_near_corners(of, t, near)))
    side = draw.pick((1.0, -1.0))
    if site in ("left", "right"):
        site = "left" if side < 0 else "right"
    at = {"t": t, "site": site, "place": (side * x, y), "speed": draw.power(-1, 6), "patience": 16.0}
    return Question(of, *state(draw, of, at))


def _near_corners(of: Scene, t: float, near: float) -> Iterator[tuple[str, float, float]]:
    """Yield sites with places of positive x, on one wall and so near (relative) to another."""
    now = rounded(of, t)
    if not isinstance(of, Stem):
        yield "arc", now.r * (1 - near * near) ** 0.5, now.r * near
        yield "base", now.r * (1 - near), 0.0
    if isinstance(of, Mushroom):
        yield "base", now.w + (now.r - now.w) * near, 0.0
    if not isinstance(of, Cap):
        for depth in (near, 1 - near):
            yield ("right", *now.stem_point("right", 1.0, depth))
        yield ("floor", *now.stem_point("floor", 1 - near, 1.0))
    if isinstance(of, Stem):
        yield "base", now.w * (1 - near), 0.0


def far_phase(draw: Draw) -> Question:
    """Ask about a start more than 2^31 periods late, where binary64 still resolves the phase."""
    turns = float(draw.power(31, 34) + draw.pick(range(2**20)))
    shared = Clock(draw.pick(("fourier", "bang-bang", "mixed")), draw.pick((0.5, 1.0, 4.0)))
    of = scene(draw, draw.pick(TABLES), shared)
    t = draw.pick((1.0, 1.0, -1.0)) * (turns + draw.pick(range(64)) / 64) * (of.period or shared.rate)
    # A stepper may refuse times at which much of a phase is lost in rounding, if it says so.
    return Question(of, *state(draw, of, {"t": t, "speed": draw.power(0, 4)}), also=("rejected",))


def many_harmonics(draw: Draw) -> Question:
    """Ask about laws of four to sixteen."""
    of = scene(draw, draw.pick(TABLES), Clock("harmonics", draw.pick((1.0, 3.0, 8.0))))
    at = {"speed": draw.power(-3, 4), "patience": draw.pick((4.0, 16.0))}
    return Question(of, *state(draw, of, at))


def mixed_laws(draw: Draw) -> Question:
    """Ask about waves and legs side by side."""
    of = scene(draw, draw.pick(("stem", "mushroom", "mushroom")), Clock("mixed", draw.pick((0.5, 1.0, 4.0))))
    return Question(of, *state(draw, of, {"speed": draw.power(-2, 6)}))


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


def late_start(draw: Draw) -> Question:
    """Begin as late as binary64 allows, or a million periods late."""
    if draw.pick((False, True)):
        of, most = scene(draw, draw.pick(TABLES), Clock("constant")), 44
    else:
        of, most = load(draw.pick(CATALOGUE)), 20
    t = draw.power(8, most) * draw.between(1.0, 2.0)
    return Question(of, *state(draw, of, {"t": t}))


FAMILIES = (
    Family(
        "knots-off-zero",
        "knots that begin at another time than 0, before or after the start",
        knots_off_zero,
        "sec. 4.1",
        40,
    ),
    Family("waiting", "a hit after tens of periods of flight", waiting, "hard case 11", 40),
    Family(
        "beside-a-wall",
        "a start on a wall, very near another: neither is taken for the other",
        beside_a_wall,
        "hard case 30",
        50,
    ),
    Family("far-phase", "a phase more than 2^31 periods late", far_phase, "hard case 39", 30),
    Family(
        "many-harmonics", "four to sixteen harmonics: all of them count", many_harmonics, "hard case 15", 30
    ),
    Family("late-start", "a late start: dt keeps its precision", late_start, "hard cases 38, 39", 50),
    Family("mixed-laws", "laws of every kind in one scene, of one period", mixed_laws, n_vectors=40),
    Family(
        "deep-waves",
        "amplitudes that add up to more than the mean of a law that is positive all the same",
        deep_waves,
        n_vectors=30,
        weight=6,
    ),
)
