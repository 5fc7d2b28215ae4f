"""Questions whose answers are known by hand, for every stepper that proves its answers.

Numbers are fractions, or roots of fractions to sixty digits.
"""

from fractions import Fraction
from math import isqrt

from msgspec.structs import replace

from scene import BangBang, Cap, Fourier, Mushroom, State, Stem
from support.tables import BOX, CIRCLE, LIFT, STATIC


def root(number):
    """Return a square root to sixty digits."""
    return Fraction(isqrt(number.numerator * 10**120 // number.denominator), 10**60)


def by_hand(scene, state, expected, t_end=100.0, **numbers):
    """Return a question, the wall met or "horizon" or why it is undefined, and what is known of dt, x..."""
    return scene, state, t_end, expected, {name: Fraction(number) for name, number in numbers.items()}


# Swept by the floor when 8 t^2 = 1/4.
SWEPT = root(Fraction(1, 32))
# w = 1/2 at t = 1, when y = 0 is crossed at x = 5/8: it was open there before.
CLOSING = Mushroom(r=1.0, h=1.0, w=BangBang(knots=((0.0, 0.75), (1.0, 0.5), (2.0, 0.75))))
FALLING = State(0.0, 0.75, 0.5, 0.0, -0.5)
# Left of a wall by 1.5 2^-300 by rounding: with that removed, the wall is met before the top.
TILTED = Stem(w=BangBang(knots=((0.0, 1.0), (1.0, 2.0), (2.0, 1.0))), h=4.0, slope=-(2.0**-300))
TILTING = replace(TILTED, slope=BangBang(knots=((-0.25, 0.0), (0.75, -(2.0**-300)), (1.75, 0.0))))
ON_THE_SIDE = State(0.25, -1.125, -1.5, 0.0, 1.0, "left")
VIOLENT = Cap(r=BangBang(((0.0, 1.0), (1.0, 1.0), (1.0 + 2.0**-20, 0.5), (2.0, 0.5), (4.0, 1.0))))
# Its radius is 1 to 70 decimals, and not exactly at any time but t = 0.
SWAYING = Mushroom(r=Fourier(1.0, 1.0, sin=(1e-70,)), h=1.0, w=0.5)
# Its half-width is 1 at the mouth and 2e10 below: there x is rounded by more than 2^-20, after any bounce.
DEEP = Stem(w=1.0, h=2.0**18, slope=-(2.0**18) / 3)
IN_THE_DEEP = State(0.0, 18325211273.533333, -209715.40000000002, -1e10, 0.0, "right")
ACROSS = 1 + Fraction(DEEP.slope) * Fraction(IN_THE_DEEP.y) + Fraction(IN_THE_DEEP.x)
ANSWERS = {
    "a side of which x is rounded off": by_hand(DEEP, IN_THE_DEEP, "left", dt=ACROSS / 10**10),
    "along the mouth to its edge at t_end": by_hand(
        STATIC, State(0.0, 0.25, 0.0, 0.25, 0.0), "horizon", t_end=1.0, x=Fraction(1, 2)
    ),
    "a chord": by_hand(CIRCLE, State(0.0, 0.25, 0.5, 2.0, 1.0), "arc", dt=(root(Fraction(71, 16)) - 1) / 5),
    "from the arc": by_hand(CIRCLE, State(0.0, 0.0, 1.0, 1.0, -0.75, "arc"), "arc", dt=Fraction(24, 25)),
    "swept by the floor": by_hand(LIFT, State(0.0, 0.0, -1.75, 0.0, 0.0), "floor", dt=SWEPT, vy=32 * SWEPT),
    "swept, moving along": by_hand(LIFT, State(0.0, 0.0, -1.875, 0.5, 0.0), "floor", dt=0.125, vx=0.5, vy=4),
    # Before the floor's second rise would meet it: where 1 + 8 (t - 1/2)^2 = 5/4 + t / 8.
    "first of two": by_hand(
        LIFT, State(0.0, 0.0, -1.25, 0.0, -0.125), "floor", dt=(65 - root(Fraction(641))) / 128
    ),
    "right before floor": by_hand(BOX, State(0.0, 0.75, -0.5, 1.0, -1.0), "right", dt=0.25),
    "left before floor": by_hand(BOX, State(0.0, -0.75, -0.5, -1.0, -1.0), "left", dt=0.25),
    "floor before right": by_hand(BOX, State(0.0, 0.25, -0.75, 1.0, -1.0), "floor", dt=0.25),
    "base before right": by_hand(BOX, State(0.0, 0.25, -0.25, 1.0, 1.0), "base", dt=0.25),
    "through the mouth": by_hand(STATIC, State(0.0, 0.25, 0.5, 0.0, -1.0), "floor", dt=1.5),
    "beside the mouth": by_hand(STATIC, State(0.0, 0.75, 0.5, 0.0, -1.0), "base", dt=0.5),
    "a closing mouth": by_hand(CLOSING, State(0.0, 0.625, 0.25, 0.0, -0.25), "base", dt=1),
    "met just as a violent leg begins": by_hand(VIOLENT, State(0.0, 0.0, 0.5, 0.0, 0.5), "arc", dt=1),
    # An ulp outside the side that it leaves, and moving away: it passes the mouth.
    "the edge as the wall left sees it": by_hand(
        STATIC, State(0.0, -0.5 - 2.0**-53, -0.25, 2.0**-66, 1.0, "left"), "arc"
    ),
    "a residual, removed before a corner": by_hand(TILTED, ON_THE_SIDE, "left", 3.0),
    "a residual, removed before the horizon": by_hand(TILTING, ON_THE_SIDE, "left", 1.75),
    "a residual inside": by_hand(replace(TILTED, slope=2.0**-300), ON_THE_SIDE, "base", 3.0),
    "nothing met": by_hand(BOX, State(0.0, 0.0, -0.5, 1.0, 0.0), "horizon", 0.5, x=0.5),
    "met exactly at the horizon": by_hand(BOX, State(0.0, 0.25, -0.25, 1.0, -0.75), "horizon", 0.75),
    "the base exactly at the horizon": by_hand(STATIC, FALLING, "horizon", 1.0),
    "the base after the horizon": by_hand(STATIC, FALLING, "horizon", 1.0 - 2.0**-53),
    "the base before the horizon": by_hand(STATIC, FALLING, "base", 1.0 + 2.0**-52, dt=1),
    "arc and base of a mushroom": by_hand(STATIC, State(0.0, 0.0, 0.5, 1.0, -0.5), "corner"),
    "arc and base": by_hand(CIRCLE, State(0.0, 0.5, 0.5, 0.5, -0.5), "corner"),
    "corner": by_hand(BOX, State(0.0, 0.5, -0.5, 0.5, -0.5), "corner"),
    "corner above": by_hand(BOX, State(0.0, 0.5, -0.5, 0.5, 0.5), "corner"),
    "corner of the floor, through the mouth": by_hand(STATIC, State(0.0, 0.125, 0.5, 0.25, -1.0), "corner"),
    "mouth's edge from above": by_hand(STATIC, State(0.0, 0.25, 0.25, 1.0, -1.0), "mouth-edge"),
    "mouth's edge from below": by_hand(STATIC, State(0.0, 0.25, -0.25, 1.0, 1.0), "mouth-edge"),
    "along the mouth": by_hand(STATIC, State(0.0, 0.0, 0.0, 1.0, 0.0), "mouth-edge"),
    "along the base": by_hand(STATIC, State(0.0, 0.75, 0.0, 1.0, 0.0, "base"), "sliding"),
    "along the base, unnamed": by_hand(STATIC, State(0.0, 0.75, 0.0, 1.0, 0.0), "sliding"),
    "along a side": by_hand(BOX, State(0.0, 1.0, -0.5, 0.0, 1.0, "right"), "sliding"),
    # f' = f'' = 0 is a tangency, and sliding only along a base or where nothing moves.
    "at rest beside a side at rest": by_hand(BOX, State(0.0, 1.0, -0.5, 0.0, 0.0, "right"), "sliding", 0.1),
    "the same where others move": by_hand(LIFT, State(0.0, 1.0, -1.0, 0.0, 0.0, "right"), "tangency", 0.1),
    "pushed by the floor": by_hand(LIFT, State(0.0, 0.0, -2.0, 0.0, 0.0, "floor"), "sliding"),
    "on two walls": by_hand(STATIC, State(0.0, 1.0, 0.0, -0.1, -1.0, "arc"), "corner"),
    "on arc and base": by_hand(CIRCLE, State(0.0, 1.0, 0.0, -1.0, 0.1, "arc"), "corner"),
    "on side and base": by_hand(BOX, State(0.0, 1.0, 0.0, -1.0, -0.1, "right"), "corner"),
    "on side and floor": by_hand(STATIC, State(0.0, 0.5, -1.0, -1.0, 1.0, "right"), "corner"),
    "where the base ends, level": by_hand(STATIC, State(0.0, 1.0, 0.0, -1.0, 0.0), "corner"),
    "where the base ends, upwards": by_hand(STATIC, State(0.0, -1.0, 0.0, 1.0, 1.0), "corner"),
    "where the base ends, downwards": by_hand(STATIC, State(0.0, 1.0, 0.0, -1.0, -1.0), "corner"),
    "where the base ends, inside by 1e-71": by_hand(SWAYING, State(0.5, 1.0, 0.0, -1.0, 0.0), "sliding"),
    "where the base ends, beyond by 1e-71": by_hand(SWAYING, State(-0.5, 1.0, 0.0, -1.0, 0.0), "rejected"),
    "where the base ends, named": by_hand(STATIC, State(0.0, 1.0, 0.0, -1.0, 0.0, "base"), "corner"),
    "where a cap's base ends, named": by_hand(CIRCLE, State(0.0, -1.0, 0.0, 1.0, -1.0, "base"), "corner"),
    "where a stem's top ends, named": by_hand(BOX, State(0.0, 1.0, 0.0, -1.0, 0.0, "base"), "corner"),
    "where the floor ends, along it": by_hand(STATIC, State(0.0, 0.5, -1.0, -1.0, 0.0, "floor"), "corner"),
    "where the floor ends, into it": by_hand(STATIC, State(0.0, 0.5, -1.0, -1.0, -1.0, "floor"), "corner"),
    "where the floor ends, along a side": by_hand(STATIC, State(0.0, 0.5, -1.0, 0.0, 1.0, "right"), "corner"),
    "at the edge": by_hand(STATIC, State(0.0, -0.5, 0.0, 1.0, 0.3, "left"), "mouth-edge"),
    "the edge of a mouth as wide as the cap": by_hand(
        Mushroom(r=1.0, h=1.0, nu=1.0), State(0.0, 1.0, 0.0, -0.5, 1.0), "mouth-edge"
    ),
    "at the edge, level": by_hand(STATIC, State(0.0, -0.5, 0.0, 1.0, 0.0, "left"), "mouth-edge"),
    "at the edge, downwards": by_hand(STATIC, State(0.0, 0.5, 0.0, -1.0, -0.3, "right"), "mouth-edge"),
}
REASONS = ("corner", "mouth-edge", "sliding", "tangency")
UNDEFINED = {name: row for name, row in ANSWERS.items() if row[3] in REASONS}
# Beside the base, and where nothing moves, binary64 can tell: y = 0 exactly.
SURE = {name for name, row in UNDEFINED.items() if name[:3] in ("on ", "at ") and row[1].y == 0}
SURE.add("at rest beside a side at rest")
