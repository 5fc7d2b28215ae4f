"""Validity of scenes over a whole period, and the geometry of a table at one time."""

from __future__ import annotations

import itertools
import math
import random
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpmath import MPContext, fp
from msgspec.structs import replace

from conformance.cases.scenes import Clock
from conformance.strategies import laws, scenes
from scene import (
    BangBang,
    Cap,
    Fourier,
    InvalidScene,
    Mushroom,
    Stem,
    catalogue,
    from_data,
    load,
    tables,
    to_data,
    validity,
)
from scene.exact import leg_intervals
from scene.geometry import area, rounded, table_at
from scene.laws import bounds, breakpoints, exact, shared_period, value
from scene.tables import laws as laws_of
from scene.validity import sign_on_legs

UP = math.nextafter(1.0, 2.0)
DOWN = math.nextafter(1.0, 0.0)


def is_valid(make, **laws):
    try:
        make(**laws)
    except InvalidScene:
        return False
    return True


def mushroom(**changed):
    return Mushroom(**{"r": 1.0, "h": 1.0, "nu": 0.5, **changed})


def wave(mean, amplitude):
    return Fourier(mean=mean, omega=1.0, cos=(amplitude,))


LEGS = BangBang(knots=((0.0, 1.0), (0.5, 0.5), (1.0, 1.0)))
TOUCHING = Fourier(mean=1 - 0.0625 - 0.125, omega=1.0, cos=(0.25, -0.125))


@pytest.mark.parametrize(
    ("make", "laws", "expected"),
    [
        (mushroom, {"nu": 1.0}, True),
        (mushroom, {"nu": UP}, False),
        (mushroom, {"nu": wave(0.5, 0.5 - 2.0**-20)}, True),
        (mushroom, {"nu": wave(0.625, 0.375)}, True),
        (mushroom, {"nu": wave(0.625, math.nextafter(0.375, 1.0))}, False),
        (mushroom, {"nu": wave(0.625, -0.375)}, True),
        (mushroom, {"nu": wave(0.625, -math.nextafter(0.375, 1.0))}, False),
        (mushroom, {"nu": LEGS}, True),
        (mushroom, {"nu": BangBang(knots=((0.0, 0.5), (0.5, UP), (1.0, 0.5)))}, False),
        (mushroom, {"nu": None, "w": 1.0}, True),
        (mushroom, {"nu": None, "w": UP}, False),
        (mushroom, {"nu": None, "w": wave(1.0, 0.5), "r": wave(1.0, 0.5)}, True),
        (mushroom, {"nu": None, "w": LEGS, "r": LEGS}, True),
        (mushroom, {"nu": None, "w": LEGS}, True),
        (mushroom, {"nu": None, "w": LEGS, "r": DOWN}, False),
        # w and r touch twice, at different phases of the same period.
        (mushroom, {"nu": None, "r": Fourier(mean=1.0, omega=1.0, cos=(0.25,)), "w": wave(0.5, -0.25)}, True),
        # 1 - nu = (1/2 - cos t)^2 / 4: touches at t = +-pi/3, where no sampling would land.
        (mushroom, {"nu": TOUCHING}, True),
        (mushroom, {"nu": replace(TOUCHING, mean=math.nextafter(TOUCHING.mean, 1.0))}, False),
        # No condition mixes kinds, so that nu may touch 1 beside legs of h.
        (mushroom, {"h": LEGS, "nu": Fourier(0.75, cos=(0.25,), period=1.0)}, True),
        (mushroom, {"h": LEGS, "nu": Fourier(0.75, cos=(math.nextafter(0.25, 1.0),), period=1.0)}, False),
        # A law that stands still needs no common period.
        (mushroom, {"r": Fourier(mean=1.0, omega=3.0, cos=(0.0,)), "h": LEGS}, True),
        (mushroom, {"slope": 0.5}, False),
        (mushroom, {"slope": math.nextafter(0.5, 0.0)}, True),
        (mushroom, {"slope": -4.0}, True),
        (Stem, {"w": 1.0, "h": 1.0, "slope": DOWN}, True),
        (Stem, {"w": 1.0, "h": 1.0, "slope": 1.0}, False),
        (Stem, {"w": wave(1.0, 0.5), "h": wave(1.0, 0.5), "slope": DOWN}, True),
        (Stem, {"w": 5e-324, "h": 1.0}, True),
        (Cap, {"r": wave(1.0, 1.0)}, False),
        (Cap, {"r": wave(1.0, DOWN)}, True),
        (Cap, {"r": Fourier(mean=1.0, omega=1.0, sin=(1.0,))}, False),
        (Cap, {"r": Fourier(mean=1.0, omega=1.0, sin=(-DOWN,))}, True),
        (Cap, {"r": BangBang(knots=((0.0, 1.0), (1.0, 0.0), (2.0, 1.0)))}, False),
        (Cap, {"r": BangBang(knots=((0.0, 1.0), (1.0, 5e-324), (2.0, 1.0)))}, True),
        (Cap, {"r": 0.0}, False),
        (Cap, {"r": -0.0}, False),
        (Cap, {"r": -1.0}, False),
    ],
)
def test_contact_is_decided_exactly(make, laws, expected):
    assert is_valid(make, **laws) == expected


clocks = st.sampled_from([Clock("fourier", 1.0), Clock("bang-bang", 2.0), Clock("mixed", 2.0)])


@st.composite
def careless_mushrooms(draw):
    """Laws of mushrooms whose ranges overlap: about half of them are invalid."""
    clock = draw(clocks)
    found = {"r": draw(laws(0.25, 2.0, clock)), "h": draw(laws(0.25, 2.0, clock))}
    found["slope"] = draw(laws(-0.5, 0.75, clock))
    if draw(st.booleans()):
        return {**found, "nu": draw(laws(0.125, 1.25, clock))}
    return {**found, "w": draw(laws(0.125, 1.5, clock))}


N_SAMPLES = 128
CTX = MPContext()
CTX.dps = 30


def least_margin(found):
    """The smallest of all conditions of a mushroom with these laws over dense sampling, at 30 digits."""
    shared = shared_period(found.values())
    times = [CTX.mpf(0)]
    if shared is not None:
        times = [shared.value(CTX) * k / N_SAMPLES for k in range(N_SAMPLES)]
        times += [exact(CTX, t) for law in found.values() for t in breakpoints(law)]
    least = CTX.inf
    for t in times:
        at = {name: value(CTX, law, t) for name, law in found.items()}
        w = at["w"] if "w" in at else at["nu"] * at["r"]
        least = min(least, at["r"], at["h"], w, at["r"] - w, w - at["h"] * at["slope"])
    return least


def most_missed(given):
    """How far a condition may dip between two samples: bound on its curvature times spacing^2 / 8."""
    shared = shared_period(given.values())
    if shared is None:
        return 0.0

    def product(f, g):
        size_f, size_g = (max(abs(law.lowest), abs(law.highest)) for law in (f, g))
        return f.curvature * size_g + 2 * f.slope * g.slope + size_f * g.curvature

    found = {name: bounds(law) for name, law in given.items()}
    bend_w = found["w"].curvature if "w" in found else product(found["nu"], found["r"])
    bends = bend_w + found["r"].curvature + found["h"].curvature + product(found["h"], found["slope"])
    return bends * float(shared.value(CTX) / N_SAMPLES) ** 2 / 8


def test_the_proof_agrees_with_dense_sampling(tally):
    @given(careless_mushrooms())
    def agrees(found):
        least, proved = least_margin(found), is_valid(Mushroom, **found)
        tally["valid" if proved else "refused"] += 1
        if proved:
            assert least > -1e-25  # 30 digits: a contact may round to just below 0
        else:
            assert least <= most_missed(found)

    agrees()
    assert min(tally["valid"], tally["refused"]) >= 10


@given(scenes(), st.sampled_from(["r", "w", "nu", "h"]), st.floats(-2.0, -0.0))
def test_a_planted_defect_is_refused_by_name(scene, name, bad):
    data = to_data(scene)
    assume(data.get(name) is not None)
    data[name] = bad
    with pytest.raises(InvalidScene, match=f"^scene: {name} > 0 fails by "):
        from_data(data)


@pytest.mark.parametrize("name", sorted(set(catalogue()) - {"moving-cap-as-printed"}))
def test_the_catalogue_is_valid(name):
    scene = load(name)
    assert scene.name == name
    assert scene.notes
    if isinstance(scene, Mushroom):
        assert least_margin(laws_of(scene)) > -1e-25


def test_the_moving_cap_as_printed_is_refused():
    # min (w - h tan theta) = -0.0667 with the printed t.
    with pytest.raises(InvalidScene, match=r"w > h slope fails by -0\.066\d* near t = .*, where r = "):
        load("moving-cap-as-printed")


BY_OMEGA, BY_PERIOD = wave(1.0, 0.1), Fourier(mean=1.0, period=1.0, cos=(0.1,))


@pytest.mark.parametrize(
    ("r", "h", "message"),
    [
        (BY_OMEGA, LEGS, "r has period 6.2831853071795862 and h has 1.0: .* r gives omega, .* period = 1.0"),
        (LEGS, BY_OMEGA, "h gives omega, so its period is irrational: give it period = 1.0 instead"),
        (BY_OMEGA, BY_PERIOD, "r gives omega, so its period is irrational: give it period = 1.0 instead"),
        (
            BY_OMEGA,
            Fourier(1.0, 2.0, (0.1,)),
            "must share one period exactly; .* further back in cos and sin",
        ),
        (BY_PERIOD, Fourier(1.0, period=0.5, cos=(0.1,)), "r has period 1.0 and h has 0.5: .* cos and sin"),
        (BY_PERIOD, BangBang(((0.0, 1.0), (1.0, 2.0), (2.0, 1.0))), "h has 2.0: .* repeat the knots"),
        *(
            (Fourier(1.0, period=p, cos=(0.1,)), Fourier(1.0, period=q, cos=(0.1,)), "a whole number of each")
            for p, q in itertools.permutations((1e300, 1.0, 1e-300), 2)
        ),
        (BY_OMEGA, Fourier(1.0, 2**0.5, (0.1,)), "let both have a period that holds a whole number of each"),
        (
            LEGS,
            BangBang(((0.0, 1.0), (1.0, 2.0), (2.0, 1.0))),
            "h has 2.0: .* repeat the knots of the shorter",
        ),
    ],
)
def test_the_message_says_how_laws_come_to_share_a_period(r, h, message):
    with pytest.raises(InvalidScene, match=message) as refusal:
        mushroom(r=r, h=h)
    assert "must share one period exactly" in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1


# Conditions in which Fourier and bang-bang laws meet: proved where the two sides keep apart.
FINE = MPContext()
FINE.prec = 400  # bits, far more than the proofs work with


def rational(x: Fraction):
    return FINE.mpf(x.numerator) / x.denominator


def exactly(law, t: Fraction):
    """Evaluate a law, all but exactly."""
    return value(FINE, law, rational(t))


def random_laws(draw: random.Random):
    """Draw w and r of one period, of different kinds, whose ranges overlap."""
    period = draw.choice((0.5, 1.0, 3.0, 2.0**-30))
    n_cos, n_sin = draw.randint(0, 4), draw.randint(1, 4)
    amplitudes = [draw.uniform(-0.15, 0.15) for _ in range(n_cos + n_sin)]
    wave = Fourier(draw.uniform(1.2, 1.8), cos=amplitudes[:n_cos], sin=amplitudes[n_cos:], period=period)
    start = draw.choice((0.0, -7.25 * period, 2.0**20 * period))
    places = sorted({0, 64, *(draw.randint(1, 63) for _ in range(draw.randint(1, 5)))})
    values = [draw.uniform(0.5, 1.4) for _ in places[1:]]
    knots = [
        (start + place * period / 64, value)
        for place, value in zip(places, [*values, values[0]], strict=True)
    ]
    return wave, BangBang(knots)


def test_conditions_are_enclosed():
    """A product of both kinds at m, and everywhere within h of m."""
    draw = random.Random("enclosed")
    for _ in range(200):
        wave, legs = random_laws(draw)
        a, b = draw.choice(leg_intervals([legs]))
        m, h = (a + b) / 2, (b - a) / 2 / draw.choice((1, 4, 1024))
        at_m, over = validity.enclose([(1, (wave, legs)), (-1, (0.5,))], m, h)
        assert at_m.delta < 1e-30
        for t in (m, *(m + h * Fraction(draw.randint(-1000, 1000), 1001) for _ in range(8))):
            assert over.a < exactly(wave, t) * exactly(legs, t) - 0.5 < over.b


def decide(wave, legs):
    try:
        return Mushroom(r=wave, w=legs, h=1.0)
    except InvalidScene as refusal:
        return str(refusal)


def dip(gap: float):
    """Return w and r that touch but for `gap` at t = 1/2, in mid-leg, where nothing is sampled."""
    legs = BangBang(((0.0, 1.0), (0.375, 1.0), (0.625, 1.0), (0.6875, 0.9), (1.0, 1.0)))
    return Fourier(1.25 + gap, cos=(0.25,), period=1.0), legs


@pytest.mark.parametrize("gap", [2.0**-3, 2.0**-20, 2.0**-50])
def test_a_near_contact_is_decided(gap):
    assert isinstance(decide(*dip(gap)), Mushroom)
    assert "w <= r fails by" in decide(*dip(-gap))


def test_a_contact_is_refused_in_words():
    message = decide(*dip(0.0))
    assert "w <= r cannot be shown near t = 0.5" in message
    assert "touch" in message
    assert len(message.splitlines()) == 1


def test_a_lost_slope_is_caught(monkeypatch):
    """At the top of a wave it is level: the mutant holds the wave to be as high all along."""
    terms = ((1, (Fourier(1.0, cos=(0.25,), period=1.0),)), (-1, (1.0,)))
    interval, honest = [(Fraction(-2, 5), Fraction(2, 5))], validity.enclose
    assert sign_on_legs(terms, False, interval).holds is False
    monkeypatch.setattr(validity, "enclose", lambda terms, m, h: (honest(terms, m, h)[0],) * 2)
    assert sign_on_legs(terms, False, interval).holds is True


def test_the_work_is_bounded(monkeypatch):
    wave, legs = dip(0.0)
    monkeypatch.setattr(validity, "MAX_BOXES", 20)
    assert sign_on_legs(((1, (wave,)), (-1, (legs,))), False, leg_intervals([legs])).holds is None


def test_products_known_to_be_positive_need_no_proof(monkeypatch):
    """With slope 0 the stem is open wherever nu r > 0, however near to 0 that comes."""
    monkeypatch.setattr(validity, "MAX_BOXES", 0)
    nu = Fourier(0.5, cos=(0.5 - 2.0**-40,), period=1.0)
    r = BangBang(((0.0, 1.0), (0.5, 5e-324), (1.0, 1.0)))
    assert Mushroom(r=r, nu=nu, h=1.0).nu == nu


WAVE = Fourier(0.2, 1.5, (0.05,), (0.02,))
SCENES = [
    Cap(r=Fourier(1.0, 1.5, (0.25,))),
    Stem(w=Fourier(1.0, 1.5, (0.125,)), h=Fourier(2.0, 1.5, (), (0.5,)), slope=WAVE),
    Mushroom(r=Fourier(1.0, 1.5, (), (0.25,)), nu=Fourier(0.6, 1.5, (0.1,)), h=2.0, slope=WAVE),
    load("moving-cap"),
    load("fixed-cap-anticlockwise"),
]
TIMES = (0.0, 0.3, 2.7)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("t", TIMES)
def test_the_area_is_that_of_the_outline(scene, t):
    """By the shoelace formula over an arc of 20,000 chords, and of the trapezoid."""
    total = 0.0
    for line in table_at(fp, scene, t).outline(20_000):
        x, y = np.transpose(line)
        total += abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
    assert area(scene, t) == pytest.approx(total, rel=1e-8)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("t", TIMES)
def test_rates_and_normals_are_derivatives_of_the_gap(scene, t):
    """Central differences in 50 digits, at a point of every wall."""
    ctx = MPContext()
    ctx.dps = 50
    now, e = table_at(ctx, scene, t), ctx.mpf(10) ** -15
    before, after = (table_at(ctx, scene, ctx.mpf(t) + s * e) for s in (-1, 1))
    r = float(now.r)
    for wall in scene.walls:
        place = {"arc": (r * 0.6, r * 0.8)}.get(wall) or now.stem_point(wall, 0.3, 0.4)
        x, y = map(ctx.mpf, place)
        assert abs(now.gap(wall, x, y)) < 1e-15 * float(now.size)
        slopes = [
            (now.gap(wall, x + e, y) - now.gap(wall, x - e, y)) / (2 * e),
            (now.gap(wall, x, y + e) - now.gap(wall, x, y - e)) / (2 * e),
            (after.gap(wall, x, y) - before.gap(wall, x, y)) / (2 * e),
        ]
        f_x, f_y, f_t = map(float, slopes)
        size = math.hypot(f_x, f_y)
        assert now.rounded().normal(wall, float(x), float(y)) == pytest.approx((f_x / size, f_y / size))
        assert now.receding(wall, float(y)) == pytest.approx(f_t / size)
        assert float(now.gap_rate(wall, x, y, 3, -2)) == pytest.approx(3 * f_x - 2 * f_y + f_t)


@pytest.mark.parametrize("scene", SCENES)
def test_corners_lie_on_two_walls_or_on_the_mouth_s_edge(scene):
    now = rounded(scene, 0.3)
    for region, walls in (("cap", ("arc", "base")), ("stem", ("left", "right", "floor", "base"))):
        present = [wall for wall in walls if wall in scene.walls]
        if len(present) > 1:
            for x, y in now.corners(region):
                near = sum(abs(now.gap(wall, x, y)) <= 1e-15 * now.size for wall in present)
                assert near >= 1 + (abs(x) != now.w or isinstance(scene, Stem))


@pytest.mark.parametrize("scene", SCENES[1:3])
def test_points_of_the_stem_are_uniform_in_its_area(scene):
    """The share of the area above each point is its first number, by the trapezoid's formula."""
    now = rounded(scene, 0.3)
    a, b = np.random.default_rng(1).random((2, 100))
    x, depth = now.uniform_in_stem(a, b)
    assert depth * (2 * now.w - now.slope * depth) == pytest.approx(a * now.stem_area())
    assert x / now.half_width(-depth) == pytest.approx(2 * b - 1)


def refusals():
    """Refuse caps, mouths and stems of every size, and of legs that begin far from 0."""
    found = []
    for size, omega in itertools.product((2.0**-500, 1.0, 2.0**500), (2.0**-300, 1.0, 2.0**20)):
        r = Fourier(mean=size, omega=omega, cos=(0.1 * size,), sin=(0.0, 0.9 * size, 0.6 * size))
        h = Fourier(mean=1.5 * size, omega=omega, cos=(0.0, 0.2 * size), sin=(0.3 * size,))
        found += [(Cap, {"r": r}), (Stem, {"w": h, "h": h, "slope": replace(wave(1.0, 0.1), omega=omega)})]
    for start, length in itertools.product((0.0, -7.25, 2.0**17, 2.0**19, 2.0**40), (1.0, 2.0**-30)):
        knots = [(start * length + length * k / 4, v) for k, v in enumerate((0.5, 0.9, 1.25, 0.75, 0.5))]
        found += [(mushroom, {"nu": BangBang(knots)}), (mushroom, {"nu": None, "w": BangBang(knots)})]
    return found


@pytest.mark.deep
def test_floats_find_the_same_instant_to_show(monkeypatch):
    def messages():
        tables._prove.cache_clear()
        shown = []
        for make, found in refusals():
            with pytest.raises(InvalidScene) as refusal:
                make(**found)
            shown.append(str(refusal.value))
        return shown

    quick = messages()
    monkeypatch.setattr(validity, "_least", lambda condition, start, span, n: range(n))
    assert messages() == quick
