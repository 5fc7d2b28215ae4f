"""The verifier: its arithmetic against exact numbers, Arb and mpmath; forged and sampled claims."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterator
from fractions import Fraction
from random import Random

import flint
import pytest
from support.falsifier import Line, falsify, numbers
from support.forged_claims import KINDS, REFUSALS, draw, judge, pool
from support.truth import IS_DEEP

from conformance import verify
from scene import from_data
from scene.laws import value
from scene.tables import laws

N_CASES = int(os.environ.get("MUSHROOMS_INTERVALS", 3_000))
N_FORGERIES = int(os.environ.get("MUSHROOMS_FORGERIES", 300))
BITS = (24, 53, 128, 256, 512)
DECIMALS = 250
# What these make of a true line, sampling sees.
FALSIFIED = (
    "a number moved by widths",
    "a number moved by some 1e-15",
    "a number moved far",
    "a later root of the same wall",
    "a later root of another wall",
    "another wall named",
    "a hit missed",
    "a hit after t_end",
    "an answer called undefined",
    "two steps exchanged",
)


def draw_interval(random: Random, bits: int) -> verify.Interval:
    """Draw points, intervals of few and of many digits, and such that hold 0."""
    lo = random.choice((-1, 0, 1)) * random.getrandbits(random.choice((1, 8, bits, 2 * bits)))
    width = random.choice((0, 1, random.getrandbits(random.choice((4, bits)))))
    return verify.Interval(lo, lo + width, random.randint(-2 * bits, 8), bits)


def require_hull(found: verify.Interval, truths: list[Fraction], bits: int) -> None:
    """Require that an interval holds all numbers, and little more."""
    (low, high), spare = found.ends, max(map(abs, truths)) / 2 ** (bits - 2)
    assert min(truths) - spare <= low <= min(truths)
    assert max(truths) <= high <= max(truths) + spare


def check_rationals(random: Random, bits: int) -> None:
    """Sums, products, quotients and squares of rationals are known, and extreme at the ends."""
    a, b = draw_interval(random, bits), draw_interval(random, bits)
    for operation in (operator.add, operator.sub, operator.mul, operator.truediv):
        if operation is not operator.truediv or b.sign:
            require_hull(operation(a, b), [operation(p, q) for p in a.ends for q in b.ends], bits)
    holds_zero = [] if a.sign else [Fraction(0)]
    require_hull(a**2, [*(p * p for p in a.ends), *holds_zero], bits)
    k = random.randint(-9, 9)
    require_hull(a * k, [p * k for p in a.ends], bits)
    for point in (a.simplest(), a.cut()):
        assert a.ends[0] <= point.ends[0] == point.ends[1] <= a.ends[1]
    part = Fraction(random.getrandbits(bits), random.getrandbits(9) + 1)
    require_hull(verify.number(part, bits), [part], bits)


def check_circle(random: Random, bits: int) -> None:
    """Cosine and sine of turns: Arb's balls lie within, for points of the interval."""
    lo = random.choice((random.getrandbits(bits + 6), random.getrandbits(8) << (bits - 3)))
    lo, width = lo * random.choice((-1, 1)), random.choice((0, 1, random.getrandbits(bits - 8)))
    turns = verify.Interval(lo, lo + width, -bits, bits)
    turn = Fraction(lo + random.choice((0, width, width // 3)), 2**bits)
    found = verify.cos_sin(turns)
    with flint.ctx.workdps(DECIMALS):
        balls = flint.arb.sin_cos_pi_fmpq(2 * flint.fmpq(turn.numerator, turn.denominator))[::-1]
        for (low, high), ball in zip((interval.ends for interval in found), balls, strict=True):
            assert flint.fmpq(low.numerator, low.denominator) <= ball
            assert ball <= flint.fmpq(high.numerator, high.denominator)
            assert high - low <= Fraction(7 * width + 2**12, 2**bits)


def check_law(random: Random, bits: int) -> None:
    """A law and its derivatives over a stretch: mpmath's lie within, for points of the stretch."""
    line = random.choice(pool("answered"))
    scene, t, mp = verify.read_scene(line["scene"], [verify.WORK]), Fraction(line["state"]["t"]), numbers()
    name, law = random.choice(list(laws(from_data(line["scene"])).items()))
    begin = Fraction(random.getrandbits(40), 2**36)
    length = Fraction(random.getrandbits(20), 2 ** random.randint(16, 200)) * random.randint(0, 1)
    stretch = verify.join(verify.number(begin, bits), verify.number(begin + length, bits))
    jet = verify.law_jet(scene.laws[name], verify.Clock(scene, t, bits), stretch)
    point = t + begin + length * random.choice((0, 1, Fraction(1, 4)))
    with mp.workdps(DECIMALS):
        at = mp.mpf(point.numerator) / point.denominator
        ratios = [value(mp, law, at, order).as_integer_ratio() for order in (0, 1, 2)]
    for interval, ratio in zip(jet, ratios, strict=True):
        (low, high), number = interval.ends, Fraction(*map(int, ratio))
        around = (1 + abs(number)) / Fraction(10) ** 230
        assert low - around <= number <= high + around


CHECKS = (check_rationals, check_circle, check_law)


@pytest.mark.parametrize("check", CHECKS)
def test_arithmetic_loses_no_number(check):
    random = Random(check.__name__)
    for _ in range(N_CASES // len(CHECKS)):
        check(random, random.choice(BITS))


@pytest.mark.parametrize("bits", [*BITS, *verify.PRECISIONS])
def test_pi_lies_within(bits):
    low, high = verify.pi(bits).ends
    with flint.ctx.workprec(bits + 64):
        assert flint.fmpq(low.numerator, low.denominator) < flint.arb.pi()
        assert flint.arb.pi() < flint.fmpq(high.numerator, high.denominator)
    assert high - low < Fraction(64, 2**bits)


def round_inwards(lo: int, hi: int, exp: int, bits: int) -> verify.Interval:
    extra = max(0, max(lo.bit_length(), hi.bit_length()) - bits)
    return verify.Interval(-(-lo >> extra), hi >> extra, exp + extra, bits)


@pytest.mark.parametrize("check", CHECKS)
def test_a_number_that_is_lost_is_seen(check, monkeypatch):
    monkeypatch.setattr(verify, "rounded", round_inwards)
    with pytest.raises(AssertionError):
        test_arithmetic_loses_no_number(check)


def sample() -> Iterator[Line]:
    """Yield a line of each group, the first steps of a path; all lines in a deep run."""
    lines = [line for line in pool("answered") + pool("undefined") if line["kind"] != "flow"]
    for line in lines if IS_DEEP else {line["group"]: line for line in lines}.values():
        answer = line["expect"][0]
        yield {**line, "expect": [{**answer, "steps": answer.get("steps", [])[: None if IS_DEEP else 3]}]}


def test_no_forgery_is_accepted(tally):
    accepted = []
    for kind, line in draw(N_FORGERIES, 1):
        verdict = judge(line)
        tally[f"{kind}: {verdict}"] += 1
        if verdict not in REFUSALS:
            accepted.append((kind, verdict, line))
    assert accepted == []
    assert len(KINDS) <= N_FORGERIES


def test_a_line_has_one_budget_of_work(monkeypatch):
    monkeypatch.setattr(verify, "WORK", 2**10)
    line = next(line for line in pool("answered") if line["id"] == "longest-flow/1")
    assert verify.verify_line(line) == verify.Verdict("not proved", "the search takes too long")


def test_no_claim_of_the_corpus_is_falsified_by_sampling():
    assert [(line["id"], wrong) for line in sample() if (wrong := falsify(line, 100))] == []


@pytest.mark.parametrize("kind", FALSIFIED)
def test_a_false_claim_is_falsified_by_sampling(kind):
    name, forge = KINDS[kind]
    random, n_seen = Random(kind), 0
    lines = [line for line in pool(name) if line["kind"] != "flow"]
    while n_seen < 2:
        forged = forge(random, random.choice(lines))
        if forged:
            assert falsify(forged, 100), forged
            n_seen += 1
