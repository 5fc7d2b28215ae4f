"""Minima of nu, against brute force: between two, nu rises to one peak and then falls."""

from itertools import pairwise

import numpy as np
import pytest
from mpmath import fp
from support.depth import deep_among

from scene import BangBang, Cap, Fourier, Mushroom, Stem, load
from scene import mouth as module
from scene.laws import values
from scene.mouth import mouth_minima
from scene.tables import period

N_SAMPLES = 1 << 13
ROUNDING = 2.0**-42


def mouth(scene, phases):
    """Return nu at phases of the cycle, which begins with the first knot, or at time 0."""
    start = next((law.knots[0][0] for law in (scene.r, scene.w, scene.nu) if isinstance(law, BangBang)), 0.0)
    shared = period(scene)
    times = start + (float(shared.value(fp)) if shared else 1.0) * phases
    return values(scene.nu, times) if scene.w is None else values(scene.w, times) / values(scene.r, times)


def fault(scene, found, n_samples=N_SAMPLES):
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
    for _ in range(300):
        scene = drawn(random, kind)
        found = mouth_minima(scene)
        assert fault(scene, found) is None, (fault(scene, found), found, scene)
        several += len(found) > 1
        tally[f"{kind}: narrowings"] += len(found)
    assert several > 50


def wave(mean, cos=(), sin=()):
    return Fourier(mean=mean, omega=1.0, cos=cos, sin=sin)


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
