"""Conditions in which Fourier and bang-bang laws meet: proved where the two sides keep apart."""

from __future__ import annotations

import os
import random
from fractions import Fraction

import pytest
from mpmath import MPContext

from scene import BangBang, Fourier, InvalidScene, Mushroom, mixed
from scene.exact import leg_intervals
from scene.given import MAX_HARMONICS
from scene.laws import value
from scene.mixed import BITS, PI, PI_ERROR, TaylorBounds, jet, multiply, sign_on_legs, turns

N_SCENES = int(os.environ.get("MUSHROOMS_MIXED", "100"))


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


def test_pi_is_enclosed():
    assert rational(PI) < FINE.pi < rational(PI + PI_ERROR)


def test_turns_are_within_their_error():
    draw = random.Random("turns")
    worst = 0.0
    for _ in range(500):
        part = (
            Fraction(draw.getrandbits(200), 2**200)
            if draw.random() < 0.5
            else Fraction(draw.randint(-99, 99), 97)
        )
        for k, (cos, sin) in enumerate(turns(part, MAX_HARMONICS), 1):
            angle = 2 * k * rational(part)
            for found, true in ((cos, FINE.cospi(angle)), (sin, FINE.sinpi(angle))):
                error = abs(rational(Fraction(found, 2**BITS)) - true)
                assert error < rational(mixed.TURN_ERROR)
                worst = max(worst, float(error) * 2.0**BITS)
    assert worst < 2.0**10  # 2^13 are allowed


def test_jets_enclose_products():
    """f(m), and Taylor's bound within h of m, for products of both kinds."""
    draw = random.Random("jets")
    for _ in range(200):
        wave, legs = random_laws(draw)
        a, b = draw.choice(leg_intervals([legs]))
        m, h = (a + b) / 2, (b - a) / 2 / draw.choice((1, 4, 1024))
        found = multiply(jet(wave, m), jet(legs, m), h)
        assert abs(exactly(wave, m) * exactly(legs, m) - rational(found.value)) <= rational(found.value_error)
        for _ in range(8):
            t = m + h * Fraction(draw.randint(-1000, 1000), 1001)
            assert exactly(wave, t) * exactly(legs, t) > rational(found.least(h) - Fraction(1, 10**30))


def verdict_by_sampling(wave, legs, n: int) -> float:
    start, period = Fraction(legs.knots[0][0]), Fraction(wave.period)
    return min(
        float(exactly(wave, start + period * i / n) - exactly(legs, start + period * i / n)) for i in range(n)
    )


def decide(wave, legs):
    try:
        return Mushroom(r=wave, w=legs, h=1.0)
    except InvalidScene as refusal:
        return str(refusal)


@pytest.mark.deep
def test_the_proof_agrees_with_sampling(tally):
    """W <= r for w of legs and r of waves: random scenes, about half of them invalid."""
    draw = random.Random("scenes")
    for _ in range(N_SCENES):
        wave, legs = random_laws(draw)
        found, least = decide(wave, legs), verdict_by_sampling(wave, legs, 256)
        tally["valid" if isinstance(found, Mushroom) else "refused"] += 1
        if isinstance(found, Mushroom):
            assert least > 0
        else:
            assert "w <= r fails by" in found
            assert least < 0.02  # curvature times the square of the distance of samples
    assert min(tally["valid"], tally["refused"]) > N_SCENES // 6


class BendLost(TaylorBounds):
    """A faulty Jet: keeps the tangent and forgets the bound on the second derivative."""

    def least(self, h):
        return self.value - self.value_error - h * (abs(self.rate) + self.rate_error)


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


def test_a_lost_bend_is_caught(monkeypatch):
    """At the top of a wave the tangent is level: the mutant holds the wave to be as high all along."""
    terms = ((1, (Fourier(1.0, cos=(0.25,), period=1.0),)), (-1, (1.0,)))
    interval = [(Fraction(-2, 5), Fraction(2, 5))]
    assert sign_on_legs(terms, False, interval).holds is False
    monkeypatch.setattr(mixed.TaylorBounds, "least", BendLost.least)
    assert sign_on_legs(terms, False, interval).holds is True


def test_the_work_is_bounded(monkeypatch):
    wave, legs = dip(0.0)
    monkeypatch.setattr(mixed, "MAX_BOXES", 20)
    assert sign_on_legs(((1, (wave,)), (-1, (legs,))), False, leg_intervals([legs])).holds is None


def test_products_known_to_be_positive_need_no_proof(monkeypatch):
    """With slope 0 the stem is open wherever nu r > 0, however near to 0 that comes."""
    monkeypatch.setattr(mixed, "MAX_BOXES", 0)
    nu = Fourier(0.5, cos=(0.5 - 2.0**-40,), period=1.0)
    r = BangBang(((0.0, 1.0), (0.5, 5e-324), (1.0, 1.0)))
    assert Mushroom(r=r, nu=nu, h=1.0).nu == nu
