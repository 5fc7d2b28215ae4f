"""Validity of scenes over a whole period, the geometry of a table at one time, and minima of nu."""

import itertools
import math
import random
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from mpmath import MPContext, fp
from msgspec.structs import replace
from support.depth import deep_among

from conformance.cases.scenes import Clock
from conformance.strategies import laws, scenes
from scene import (
    BangBang,
    Cap,
    Constant,
    Fourier,
    InvalidScene,
    Mushroom,
    Stem,
    catalogue,
    from_data,
    load,
    mouth as module,
    to_data,
    validity,
)
from scene.exact import leg_intervals
from scene.geometry import area, rounded, table_at
from scene.laws import law_of, shared_cycle
from scene.mouth import mouth_minima
from scene.pieces import exact
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


def wave(mean, cos=(), sin=()):
    return Fourier(mean=mean, omega=1.0, cos=cos, sin=sin)


LEGS = BangBang(knots=((0.0, 1.0), (0.5, 0.5), (1.0, 1.0)))
TOUCHING = Fourier(mean=1 - 0.0625 - 0.125, omega=1.0, cos=(0.25, -0.125))


@pytest.mark.parametrize(
    ("make", "laws", "expected"),
    [
        (mushroom, {"nu": 1.0}, True),
        (mushroom, {"nu": UP}, False),
        (mushroom, {"nu": wave(0.5, (0.5 - 2.0**-20,))}, True),
        (mushroom, {"nu": wave(0.625, (0.375,))}, True),
        (mushroom, {"nu": wave(0.625, (math.nextafter(0.375, 1.0),))}, False),
        (mushroom, {"nu": wave(0.625, (-0.375,))}, True),
        (mushroom, {"nu": wave(0.625, (-math.nextafter(0.375, 1.0),))}, False),
        (mushroom, {"nu": LEGS}, True),
        (mushroom, {"nu": BangBang(knots=((0.0, 0.5), (0.5, UP), (1.0, 0.5)))}, False),
        (mushroom, {"nu": None, "w": 1.0}, True),
        (mushroom, {"nu": None, "w": UP}, False),
        (mushroom, {"nu": None, "w": wave(1.0, (0.5,)), "r": wave(1.0, (0.5,))}, True),
        (mushroom, {"nu": None, "w": LEGS, "r": LEGS}, True),
        (mushroom, {"nu": None, "w": LEGS}, True),
        (mushroom, {"nu": None, "w": LEGS, "r": DOWN}, False),
        # w and r touch twice, at different phases of the same period.
        (
            mushroom,
            {"nu": None, "r": Fourier(mean=1.0, omega=1.0, cos=(0.25,)), "w": wave(0.5, (-0.25,))},
            True,
        ),
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
        (Stem, {"w": wave(1.0, (0.5,)), "h": wave(1.0, (0.5,)), "slope": DOWN}, True),
        (Stem, {"w": 5e-324, "h": 1.0}, True),
        (Cap, {"r": wave(1.0, (1.0,))}, False),
        (Cap, {"r": wave(1.0, (DOWN,))}, True),
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
    shared = shared_cycle(map(law_of, found.values()))
    times = [CTX.mpf(0)]
    if shared is not None:
        times = [shared.value(CTX) * k / N_SAMPLES for k in range(N_SAMPLES)]
        times += [exact(CTX, t) for law in found.values() for t in law_of(law).breakpoints()]
    least = CTX.inf
    for t in times:
        at = {name: law_of(law).value(CTX, t) for name, law in found.items()}
        w = at["w"] if "w" in at else at["nu"] * at["r"]
        least = min(least, at["r"], at["h"], w, at["r"] - w, w - at["h"] * at["slope"])
    return least


def most_missed(given):
    """How far a condition may dip between two samples: bound on its curvature times spacing^2 / 8."""
    shared = shared_cycle(map(law_of, given.values()))
    if shared is None:
        return 0.0

    def product(f, g):
        size_f, size_g = (max(abs(law.lowest), abs(law.highest)) for law in (f, g))
        return f.curvature * size_g + 2 * f.slope * g.slope + size_f * g.curvature

    found = {name: law_of(law).bounds() for name, law in given.items()}
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
        assert least_margin(scene.laws) > -1e-25


def test_the_moving_cap_as_printed_is_refused():
    # min (w - h tan theta) = -0.0667 with the printed t.
    with pytest.raises(InvalidScene, match=r"w > h slope fails by -0\.066\d* near t = .*, where r = "):
        load("moving-cap-as-printed")


BY_OMEGA, BY_PERIOD = wave(1.0, (0.1,)), Fourier(mean=1.0, period=1.0, cos=(0.1,))


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
    return law_of(law).value(FINE, rational(t))


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
        at_m, over = validity.enclose([(1, (wave, legs)), (-1, (Constant(0.5),))], m, h)
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
    terms = ((1, (Fourier(1.0, cos=(0.25,), period=1.0),)), (-1, (Constant(1.0),)))
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
        assert rounded(scene, t).normal(wall, float(x), float(y)) == pytest.approx((f_x / size, f_y / size))
        assert now.receding(wall, float(y)) == pytest.approx(f_t / size)
        assert float(now.gap_rate(wall, x, y, 3, -2)) == pytest.approx(3 * f_x - 2 * f_y + f_t)


@pytest.mark.parametrize("scene", SCENES)
def test_corners_lie_on_two_walls_or_on_the_mouth_s_edge(scene):
    now = rounded(scene, 0.3)
    for region, walls in (("cap", ("arc", "base")), ("stem", ("left", "right", "floor", "base"))):
        present = [wall for wall in walls if wall in scene.walls]
        if len(present) > 1:
            corners = list(now.corners(region))
            assert len(corners) >= 2
            for x, y in corners:
                near = sum(abs(now.gap(wall, x, y)) <= 1e-15 * now.size for wall in present)
                assert near >= 1 + (abs(x) != now.w or isinstance(scene, Stem))


N_PHASES = 1 << 13
ROUNDING = 2.0**-42


def mouth(scene, phases):
    """Return nu at phases of the cycle, which begins with the first knot, or at time 0."""
    start = next((law.knots[0][0] for law in (scene.r, scene.w, scene.nu) if isinstance(law, BangBang)), 0.0)
    shared = scene.cycle
    times = start + (float(shared.value(fp)) if shared else 1.0) * phases
    laws = scene.laws
    return laws["nu"].values(times) if "nu" in laws else laws["w"].values(times) / laws["r"].values(times)


def fault(scene, found, n_samples=N_PHASES):
    """Say what is wrong with minima of nu: between two, nu must rise, then fall, by more than rounding."""
    if not found:
        nu = mouth(scene, np.arange(n_samples) / n_samples)
        return None if np.ptp(nu) <= ROUNDING * nu.max() else "nu moves, and no minimum was found"
    if list(found) != sorted(found) or not 0.0 < found[0] <= found[-1] <= 1.0:
        return f"{found} do not rise in (0, 1]"
    for before, after in pairwise([*found, found[0] + 1.0]):
        nu = mouth(scene, np.linspace(before, after, n_samples))
        small, top = ROUNDING * nu.max(), int(np.argmax(nu))
        rise, fall = np.maximum.accumulate(nu[: top + 1]), np.minimum.accumulate(nu[top:])
        if np.any(nu[: top + 1] < rise - small):
            return f"nu falls after {before}, before its peak"
        if np.any(nu[top:] > fall + small):
            return f"nu rises before {after}, after its peak"
        if nu[top] <= max(nu[0], nu[-1]) + small / 256:
            return f"no peak between {before} and {after}"
    return None


def fourier(random, mean, swing, n_harmonics, clock):
    sizes = random.uniform(-1, 1, size=(2, n_harmonics)) * random.integers(0, 2, size=(2, n_harmonics))
    sizes *= swing / max(np.abs(sizes).sum(), 1e-3)
    return Fourier(mean=mean, **clock, cos=tuple(sizes[0].tolist()), sin=tuple(sizes[1].tolist()))


def bang_bang(random, low, high, span, start):
    """Draw knots with values from three levels: plateaus, equal minima and equal maxima are common."""
    n = int(random.integers(2, 9))
    levels = np.round(random.uniform(low, high, size=3), int(random.integers(1, 17)))
    levels = np.clip(levels, low, high)
    values = [float(levels[random.integers(3)]) for _ in range(n)]
    times = np.sort(random.choice(np.arange(1, 256), size=n - 1, replace=False)) / 256 * span
    knots = [(start + float(t), v) for t, v in zip([0.0, *times], values, strict=True)]
    return BangBang(knots=(*knots, (start + span, values[0])))


def drawn(random, kind):
    span = float(2.0 ** random.integers(-3, 4))
    clock = {"period": span} if kind == "mixed" else {"omega": float(random.uniform(0.1, 9.0))}

    def law(low, high, is_wave):
        if is_wave:
            n, mean = int(random.integers(1, 7)), float((low + high) / 2)
            return fourier(random, mean, (high - low) / 2 * 0.99, n, clock)
        return bang_bang(random, low, high, span, float(random.integers(-4, 5)) / 8 * span)

    waves = {"fourier": (True, True), "bang-bang": (False, False), "mixed": (True, False)}[kind]
    first, second = waves if random.random() < 0.5 else waves[::-1]
    shape = random.integers(3) if kind != "mixed" else 1
    if shape == 0:
        return Mushroom(r=1.0, h=1.0, nu=law(0.2, 1.0, first))
    r = law(0.8, 1.5, second) if shape == 1 else float(random.uniform(0.8, 1.5))
    return Mushroom(r=r, h=1.0, w=law(0.1, 0.79, first))


@pytest.mark.parametrize("kind", deep_among(["fourier", "bang-bang", "mixed"], "fourier", "mixed"))
def test_random_laws(kind, tally):
    random = np.random.default_rng(11)
    several = 0
    for _ in range(150):
        scene = drawn(random, kind)
        found = mouth_minima(scene)
        assert fault(scene, found) is None, (fault(scene, found), found, scene)
        several += len(found) > 1
        tally[f"{kind}: narrowings"] += len(found)
    assert several > 25


def knots(*pairs):
    return BangBang(knots=pairs)


DIP = knots((0.0, 1.0), (1.0, 0.5), (2.0, 0.5), (4.0, 1.0))
NAMED = {
    "one wave": (Mushroom(r=1.0, h=1.0, nu=wave(0.6, (0.4,))), (0.5,)),
    "equal minima": (Mushroom(r=wave(1.0, (), (0.3,)), h=1.0, nu=wave(0.6, (0.0, 0.25))), (0.25, 0.75)),
    "a minimum as the cycle begins": (Mushroom(r=1.0, h=1.0, nu=wave(0.6, (-0.4,))), (1.0,)),
    "a plateau": (Mushroom(r=1.0, h=1.0, w=DIP), (0.375,)),
    "a plateau over the cycle's end": (
        Mushroom(r=1.0, h=1.0, w=knots((0.0, 0.5), (1.0, 0.5), (2.0, 1.0), (3.5, 0.5), (4.0, 0.5))),
        (0.0625,),
    ),
    "a plateau that ends a cycle and begins the next": (
        Mushroom(r=1.0, h=1.0, w=knots((0.0, 0.5), (1.0, 0.5), (2.0, 1.0), (3.0, 0.5), (4.0, 0.5))),
        (1.0,),
    ),
    "plateaus, equal": (
        Mushroom(
            r=1.0,
            h=1.0,
            w=knots((0, 1), (1, 1), (2, 0.3), (3, 0.3), (4, 1), (5, 1), (6, 0.3), (7, 0.3), (8, 1)),
        ),
        (0.3125, 0.8125),
    ),
    "a rest in a fall is none": (
        Mushroom(r=1.0, h=1.0, w=knots((0, 1), (1, 0.7), (2, 0.7), (3, 0.3), (4, 1))),
        (0.75,),
    ),
    # nu' = (1 - cos t) (cos t + 1/2) / 2, with a double zero at t = 0
    "a flat inflection is none": (Mushroom(r=1.0, h=1.0, nu=wave(0.5, (0.0, 0.0), (0.25, -0.125))), (2 / 3,)),
    # nu = 0.9 - 0.4 (1 - cos t)^2 / 4 upside down: nu''' too vanishes at the minimum
    "a quartic minimum": (Mushroom(r=1.0, h=1.0, nu=wave(0.65, (-0.2, 0.05))), (1.0,)),
    "the mouth moves with the cap": (
        Mushroom(r=DIP, h=1.0, w=knots(*((t, v / 2) for t, v in DIP.knots))),
        (),
    ),
    "only the cap moves": (Mushroom(r=DIP, h=1.0, w=0.25), (1.0,)),
    "nu stands still": (Mushroom(r=DIP, h=1.0, nu=0.5), ()),
    "all stand still": (load("frozen-mushroom"), ()),
    "touches 1 twice": (Mushroom(r=1.0, h=1.0, nu=wave(0.75, (0.0, 0.25))), (0.25, 0.75)),
    "no mouth": (Cap(r=DIP), ()),
    "a stem has no mouth": (Stem(w=DIP, h=1.0), ()),
}


@pytest.mark.parametrize("name", NAMED)
def test_named_mouths(name):
    scene, expected = NAMED[name]
    assert mouth_minima(scene) == pytest.approx(expected, rel=1e-12, abs=0)


def test_scales_and_short_legs():
    """At any scale, beside legs of 2^-20 to 2^-60 of the period: as many as the values of the knots say."""
    random = np.random.default_rng(77)
    for _ in range(60):
        length, span = (2.0 ** int(n) for n in random.integers(-300, 300, size=2))
        n, levels = int(random.integers(2, 7)), random.uniform(0.1, 0.7, 3) * length
        times = np.sort(random.random(n - 1))
        times[0] = 2.0 ** -int(random.integers(20, 60)) if random.random() < 0.5 else times[0]
        times[-1] = 1.0 - 2.0 ** -int(random.integers(20, 53)) if random.random() < 0.3 else times[-1]
        times = [0.0, *sorted(set(times.tolist()))]
        values = [float(levels[random.integers(3)]) for _ in times]
        pairs = [(t * span, v) for t, v in zip(times, values, strict=True)]
        scene = Mushroom(r=length, h=length, w=knots(*pairs, (span, values[0])))
        steps = [v for before, v in pairwise([values[-1], *values]) if v != before]
        neighbours = zip([*steps[-1:], *steps], steps, [*steps[1:], *steps[:1]], strict=False)
        assert len(mouth_minima(scene)) == sum(before > v < after for before, v, after in neighbours)


def test_narrowings_are_exact_to_rounding():
    """Where nu = 0.5 + a cos t + b cos 2t, |a| < 4 b, it is least at cos t = -a / 4b."""
    random = np.random.default_rng(5)
    for b, share in random.uniform((0.05, -0.9), (0.1, 0.9), size=(200, 2)).tolist():
        a = 4 * b * share
        exact = np.arccos(-a / (4 * b)) / (2 * np.pi)
        found = mouth_minima(Mushroom(r=1.0, h=1.0, nu=wave(0.5, (a, b))))
        assert found == pytest.approx((exact, 1 - exact), rel=2.0**-48)


FAULTS = {
    "the first narrowing only": lambda found: found[:1],
    "the least and the greatest averaged": lambda found: (0.5 * (found[0] + found[-1]),),
    "one is left out": lambda found: found[1:],
    "a little late": lambda found: tuple(min(phase + 2e-4, 1.0) for phase in found),
    "peaks for valleys": lambda found: tuple(0.5 * (a + b) % 1 for a, b in pairwise([*found, found[0] + 1])),
}


@pytest.mark.parametrize("name", FAULTS)
def test_wrong_narrowings_are_seen(name):
    scene, _ = NAMED["equal minima"]
    assert fault(scene, mouth_minima(scene)) is None
    assert fault(scene, tuple(sorted(FAULTS[name](mouth_minima(scene))))) is not None


def test_a_zero_left_out_is_seen(monkeypatch):
    """The comparison kills a search that looks at the cuts alone."""
    scene = Mushroom(r=wave(1.0, (), (0.3,)), h=1.0, w=wave(0.5, (0.2, 0.1)))
    assert fault(scene, mouth_minima.__wrapped__(scene)) is None
    monkeypatch.setattr(module, "_zeros", lambda w, r, cuts: np.empty(0))
    assert fault(scene, mouth_minima.__wrapped__(scene)) is not None
