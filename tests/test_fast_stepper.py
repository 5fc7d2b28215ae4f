"""The fast step: what it does not guess, and what it got wrong once."""

from __future__ import annotations

import pytest
from support.from_python import from_python
from support.tables import CIRCLE, STATIC
from support.truth import proved_step

import fast
import reference
from conformance.grading.agreement import compare
from fast.kernel import arithmetic
from scene import (
    BangBang,
    Cap,
    Fourier,
    Horizon,
    Mushroom,
    State,
    Stem,
    Undecided,
    Undefined,
)


@pytest.mark.parametrize(
    ("scene", "state", "expected"),
    [
        (STATIC, State(0, 0.75, 0.0, 1.0, 0.0, "base"), Undefined("sliding")),
        (STATIC, State(0, 0.0, 0.0, 1.0, 0.0), Undefined("mouth-edge")),
        (STATIC, State(0, 0.25, 0.25, 1.0, -1.0), Undecided("the mouth's edge is hit within rounding")),
        (CIRCLE, State(0, 0.5, 0.5, 0.5, -0.5), Undecided("two walls are hit together within rounding")),
    ],
)
def test_what_it_does_not_guess(scene, state, expected):
    assert fast.next_collision(scene, state, 100.0) == expected


def test_rising_from_beside_the_mouths_edge_needs_no_decision():
    """On y = 0 with vy > 0 the flight is in the cap, whether it begins in the mouth or on the base.

    At the edge itself, exactly, it is undefined; binary64 leaves it undecided.
    """
    scene = Mushroom(r=1.4270501136779785, h=0.25, w=0.9501003301060614)
    edge = fast.next_collision(scene, State(0.0, 0.9501003301060614, 0.0, -0.005, 6e-19), 125.0)
    assert isinstance(edge, Undecided)
    for x in (0.9501003301060598, 0.9501003301060613, 0.9501003301060615, 0.9501003301060630):
        outcome = fast.next_collision(scene, State(0.0, x, 0.0, -0.005, 6e-19), 125.0)
        assert isinstance(outcome, Horizon)
        assert fast.next_collision(scene, State(0.0, x, 0.0, -0.005, 6e-19), 999.0).wall == "arc"


def wave(mean, *sin):
    return Fourier(mean=mean, omega=4.65574312210083, sin=sin)


SLIT = Mushroom(
    r=wave(0.875, 0.11862087249745074), h=wave(2.098803758621216, 1.8488037586195343),
    w=wave(0.2600053250788279, 0.052338038691819494),
)  # fmt: skip
GRAZING = State(1.3409481355317923, 0.0, 0.0, -2.1066059217309278e-16, -1.1467828510215512)
REST = 1.1677015281036474
RESTING = BangBang(
    (
        (0.0, 2.1896091243577565), (0.18958107597645885, REST), (0.261809659609697, REST),
        (0.2870035976351556, 0.3360244714926794), (0.5, 2.1896091243577565),
    )
)  # fmt: skip
HARDLY = BangBang(
    ((0.0, 1.0), (1.0, 1.0 + 2.0**-30), (2.0, 1.0), (2.0 + 2.0**-8, 1.0 + 2.0**-30), (4.0, 1.0))
)
# Steps that were wrong once: scene, state, horizon.
FOUND = {
    # Nearly level with a side that comes close much later; the floor is met first, whatever the horizon.
    "the floor before a graze of a side": (SLIT, GRAZING, 5.0),
    "the same with a late horizon": (SLIT, GRAZING, 1e6),
    # 2 x / v, up to the wall's own bend: 10^-21 of a unit of time.
    "the shortest hop along an arc of legs": (
        Cap(r=BangBang(((1.875, 2.0), (2.011962890625, 0.25), (5.0562744140625, 0.25), (5.0625, 2.0)))),
        State(9.562506079673767, 1.5308084989341915e-17, 0.25, -19218.24325704075, 0.0, "arc"),
        10.5,
    ),
    "the shortest hop along an arc of waves": (
        Cap(r=Fourier(0.7535362243652344, 2.4063210487365723, (-0.2517681121823882, 0.05943409717650916))),
        State(0.0, 3.436372446831787e-17, 0.5612022093593554, -325.5383901035782, 0.0, "arc"),
        1.0,
    ),
    # Off the arc by 2^-29 of its radius: what is left of that there is rounded, and more than the hop.
    "the shortest hop from off the arc": (
        Cap(r=0.25),
        State(0.0, 0.0, 0.2499999995343387, 0.45, -1.788139347702611e-08, "arc"),
        1.0,
    ),
    "a floor met again across a knot keeps its speed": (
        Mushroom(r=1.9226618138907277, h=RESTING, nu=0.3133864674412362),
        State(
            59.7010171193737, 0.008512276997033654, -REST,
            -0.0874566283705382, 5.536225002296594e-15, "floor",
        ),
        100.0,
    ),
    # f(0) is taken out of f, so the wall that is left is met where the place says that it never comes.
    "off the floor by more than it moves": (
        Stem(w=1.0, h=HARDLY),
        State(1.0, 0.0, -1.0 + 2.0**-22, 0.0, 2.0**-34, "floor"),
        100.0,
    ),
    "off a side by more than it moves": (
        Stem(w=HARDLY, h=1.0),
        State(1.0, 1.0 - 2.0**-22, -0.5, -(2.0**-34), 0.0, "right"),
        100.0,
    ),
    "off the arc by more than it moves": (
        Cap(r=HARDLY),
        State(1.0, 0.0, 1.0 - 2.0**-22, 0.0, -(2.0**-34), "arc"),
        100.0,
    ),
    # 4.2 to 8.8 backward ulps when x vx + y vy was taken to be as wrong as its terms.
    "off an arc at rest, in a mushroom": (
        Mushroom(r=0.75, h=0.5, w=0.1875),
        State(0.0, -0.328266938939661, 0.6743447065645082, -0.7329946145091972, -0.35681736360616867, "arc"),
        5.0,
    ),
    "off an arc at rest": (
        Cap(r=0.75),
        State(
            -1.0728890015279906, -0.5979211190136294, 0.45275783645519563,
            9.219797969326965, 12.175849603416522, "arc",
        ),
        5.0,
    ),
    "off an arc of waves": (
        Cap(r=Fourier(1.0, 1.0, (0.1,))),
        State(0.0, -0.7076949518471228, 0.8421210043688356, 316.2147131789378, 265.7379895907578, "arc"),
        5.0,
    ),
    "off an arc of legs": (
        Cap(r=BangBang(((0.0, 1.0), (1.0, 1.2), (2.0, 1.0)))),
        State(0.0, -0.32022388584106987, 0.9473418892569404, -230.18778701388953, -77.80889726144164, "arc"),
        5.0,
    ),
    # Both factors' bounds are negative, their product is above the mouth's least width.
    "a product of two lower bounds below 0": (
        Mushroom(
            r=Fourier(1.0, cos=(0.9, 0.0, -0.35), period=1.0),
            h=1.0,
            nu=Fourier(0.5, cos=(0.45, 0.0, -0.17), period=1.0),
        ),
        State(0.297, -0.024, -0.56, -0.035, -0.87),
        2.297,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FOUND)
def test_what_was_wrong_once_is_right(name):
    scene, state, t_end = FOUND[name]
    truth = proved_step(scene, state, t_end)
    assert truth.outcome == "collision"
    found = compare(fast.next_collision(scene, state, t_end), truth, state, 4.0)
    assert found.kind == "agrees", found


def test_an_arc_that_dips_below_zero_and_comes_back_on_the_way_to_the_base():
    scene = Mushroom(r=Fourier(1.0, 1.0, (0.9,)), h=1.0, w=0.0005)
    place = 0.09723691417765834, 0.024502880446325
    state = State(3.116786370335045, *place, 0.05208237622567096, -0.29708987593890235)
    t_end = 3.377786370335045
    truth = reference.trajectory(scene, state, 9, t_end)
    walls = [step.wall for step in truth.steps]
    assert walls == fast.trajectory(scene, state, 9, t_end).walls == ["arc", "arc", "base"]
    assert fast.flow(scene, [state], t_end).wall_counts.tolist() == [[2, 1, 0, 0, 0]]


def test_python_may_call_a_kernel():
    """It runs as it is written, before and after compiled callers used it; a fused operation refuses."""
    for _ in range(2):
        assert arithmetic.two_sum(1.0, 2.0**-60) == (1.0, 2.0**-60)
        assert from_python(arithmetic.two_sum)(1.0, 2.0**-60) == (1.0, 2.0**-60)
        with pytest.raises(NotImplementedError, match="fma"):
            arithmetic.sine_cosine(1.0, 0.0, 1.0, 0.5, 0.0)
        from_python(arithmetic.sine_cosine)(1.0, 0.0, 1.0, 0.5, 0.0)
