"""The verifier: its arithmetic against exact numbers, Arb and mpmath; forged claims; needed requirements.

Its requirements are needed: without one of these it proves a claim that it refuses. A requirement is a piece
of `conformance/verify.py`, and what stands there without it. The weaker verifier answers a question; that
answer, written as a line of a corpus, is the forgery. Other rows change one field of a true line.
"""

import itertools
import operator
import os
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

import flint
import pytest
from support.forged_claims import KINDS, REFUSALS, draw, judge, lines, plain, pool

from conformance import verify
from conformance.vectors import certified
from scene import from_data
from scene.precision import decimals

N_CASES = int(os.environ.get("MUSHROOMS_INTERVALS", 1_500))
N_FORGERIES = int(os.environ.get("MUSHROOMS_FORGERIES", 66))
BITS = (24, 53, 128, 256, 512)
DECIMALS = 250


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
    scene, t, mp = (
        verify.read_scene(line["scene"], [verify.WORK]),
        Fraction(line["state"]["t"]),
        decimals(DECIMALS),
    )
    name, law = random.choice(list(from_data(line["scene"]).laws.items()))
    begin = Fraction(random.getrandbits(40), 2**36)
    length = Fraction(random.getrandbits(20), 2 ** random.randint(16, 200)) * random.randint(0, 1)
    stretch = verify.join(verify.number(begin, bits), verify.number(begin + length, bits))
    jet = verify.law_jet(scene.laws[name], verify.Clock(scene, t, bits), stretch)
    point = t + begin + length * random.choice((0, 1, Fraction(1, 4)))
    at = mp.mpf(point.numerator) / point.denominator
    ratios = [law.value(mp, at, order).as_integer_ratio() for order in (0, 1, 2)]
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
    """Rounded inwards, an interval may also be empty; then a phase or a sign is open."""
    random, n_seen = Random(check.__name__), 0
    monkeypatch.setattr(verify, "rounded", round_inwards)
    monkeypatch.setattr(verify, "pi", verify.pi.__wrapped__)
    for _ in range(N_CASES // len(CHECKS)):
        try:
            check(random, random.choice(BITS))
        except AssertionError:
            n_seen += 1
        except verify.Unproved:
            continue
    assert n_seen > 0
    monkeypatch.undo()
    for bits in BITS:
        test_pi_lies_within(bits + 8)  # as sines ask for it: a false pi stays in no cache


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


def vertical_flow(n: int) -> dict[str, Any]:
    """Return the true flow of n steps of a particle on the axis of a mushroom at rest: x = vx = 0."""
    t_end = 2.0 * n - 2.25
    is_up = n % 2 == 0
    y, vy = ("-0.75", "1") if is_up else ("0.75", "-1")
    null = ["0", "0"]
    step = {"dt": [str(t_end)] * 2, "x": null, "y": [y] * 2, "vx": null, "vy": [vy] * 2}
    return {
        "id": "a/1", "kind": "flow", "scene": {"table": "mushroom", "r": 1.0, "w": 0.5, "h": 1.0},
        "state": {"t": 0, "x": 0, "y": 0.5, "vx": 0, "vy": -1.0}, "t_end": t_end, "collisions": n,
        "expect": [{"outcome": "horizon", "steps": [step]}],
    }  # fmt: skip


@pytest.mark.parametrize("n", [201, pytest.param(16_001, marks=pytest.mark.deep)])
def test_a_long_flow_along_the_axis_is_proved(n):
    assert verify.verify_line(vertical_flow(n)) == verify.Verdict("proved")


def test_zero_keeps_its_exponent():
    """It fell by 127 a bounce, and sums shifted ever longer integers: 16,001 steps took a minute."""
    line = vertical_flow(201)
    scene = verify.read_scene(line["scene"], [verify.WORK])
    path = verify.walk(scene, verify.read_state(scene, line["state"]), Fraction(line["t_end"]), 128)
    for step in path:
        assert max(abs(number.exp) for number in step.numbers.values()) < 1_000
    for a, b in itertools.product((verify.Interval(0, 0, -5_000, 64), verify.number(3, 64)), repeat=2):
        if 0 in (a.lo, b.lo):
            assert (a * b).exp == 0


def test_work_grows_with_precision():
    """With 4,096 bits a part takes some ten times as long as with 128."""
    line = vertical_flow(5)
    spent = []
    for bits in (128, 4096):
        work = [verify.WORK]
        verify.check_line(line, lambda work=work: verify.read_scene(line["scene"], work), bits)
        spent.append(verify.WORK - work[0])
    assert 8 * spent[0] < spent[1] < 64 * spent[0]


CAP: dict[str, Any] = {"table": "cap", "r": 1.0}
SOURCE = Path(verify.__file__).read_text("utf-8")
STEM: dict[str, Any] = {"table": "stem", "w": 1.0, "h": 1.0}
MUSHROOM: dict[str, Any] = {"table": "mushroom", "r": 1.0, "w": 0.5, "h": 1.0}


def legs(*knots: list[float]) -> dict[str, Any]:
    return {"kind": "bang-bang", "knots": list(knots)}


def waves(mean: float, *sin: float) -> dict[str, Any]:
    return {"kind": "fourier", "mean": mean, "omega": 1.0, "cos": [], "sin": list(sin)}


SHAKEN = {**STEM, "h": waves(1.0, 0.25)}
OPENING = {**MUSHROOM, "w": legs([0.0, 0.25], [0.5, 0.75], [4.0, 0.25])}
SPIKE = {**STEM, "h": legs([0.0, 1.0], [4.0, 1.0], [4.25, 0.5], [4.5, 1.0], [8.0, 1.0])}
# What is taken out, what stands there without it; a question: scene, (t, x, y, vx, vy, wall), t_end, hits.
Row = tuple[str, str, dict[str, Any], tuple[Any, ...], float, int]
REQUIREMENTS: dict[str, Row] = {
    "the base is met beside the mouth": (
        "(in_cap and -1 in signs)", "in_cap",
        MUSHROOM, (0.0, 0.25, 0.5, 0.0, -1.0, None), 9.0, 1,
    ),
    "the mouth is that of the crossing": (
        "self.f(wall, crossing).f.sign", "self.f(wall, self.begin).f.sign",
        OPENING, (0.0, 0.5, 0.5, 0.0, -1.0, None), 9.0, 1,
    ),
    "walls of the other part are asked": (
        'hit = self.first_hit(SIDES if in_cap else ("arc",), crossing.low, end, None)', "hit = None",
        MUSHROOM, (0.0, 0.25, 0.5, 0.0, -1.0, None), 9.0, 1,
    ),
    "walls of this part are asked": (
        'hit = self.first_hit(("arc",) if in_cap else SIDES, self.begin.low, crossing or end, exact)',
        "hit = None",
        CAP, (0.0, 0.75, 0.25, 4.0, -0.5, None), 9.0, 1,
    ),
    "all walls of a part are asked": (
        'SIDES = ("left", "right", "floor")', 'SIDES = ("left", "right")',
        STEM, (0.0, 0.0, -0.5, 0.25, -1.0, None), 9.0, 1,
    ),
    "the residual is taken out": (
        "f=jet.f - self.residual", "f=jet.f",
        SHAKEN, (0.0, 0.0, -1.0 + 2.0**-22, 0.0, -0.24, "floor"), 9.0, 1,
    ),
    "the residual stays with its wall": (
        "residual = flight.residual if wall == flight.wall else clock.zero", "residual = clock.zero",
        SHAKEN, (0.0, 0.0, -1.0 + 2.0**-22, 0.0, -0.24, "floor"), 9.0, 2,
    ),
    "one wall is first": (
        "if all(hit is best or is_below(best[1], hit[1]) for hit in hits) and is_below(\n"
        "            best[1], limit\n        ):",
        "if True:",
        STEM, (0.0, 0.5, -0.5, 0.5, -0.5, None), 9.0, 1,
    ),
    "a start lies on one wall": (
        'require(len(on) < 2, Undefined("corner"))', "on = on[:1]",
        CAP, (0.0, 1.0, 0.0, -1.0, 1.0, "arc"), 9.0, 1,
    ),
    "a side ends at the mouth's edge": (
        'Undefined("mouth-edge"),\n    )\n    require(len(on)',
        'Undefined("mouth-edge"),\n    ) if on and 0 else require(len(on)',
        MUSHROOM, (0.0, -0.5, 0.0, 1.0, -0.25, "left"), 9.0, 1,
    ),
    "a start lies inside": (
        "others = [name for name in walls if name != wall]", "others = list[str]()",
        CAP, (0.0, 0.0, -0.25, 0.25, 1.0, None), 9.0, 1,
    ),
    "a start moves away from its wall": (
        "    require(slope >= 0, Refused", "    slope = abs(slope)\n    require(True, Refused",
        STEM, (0.0, 0.125, 0.0, 1.0, 1.0, "base"), 9.0, 1,
    ),
    "a start lies on its wall": (
        "NEAR = Fraction(1, 2**20)", "NEAR = Fraction(1)",
        STEM, (0.0, 0.0, -0.75, 0.25, 1.0, "floor"), 9.0, 1,
    ),
    "where a flight begins f must grow": (
        "return bool(self.is_flat and jet.d2.sign > 0)", "return True",
        {**STEM, "h": legs([0.0, 1.0], [1.0, 0.5], [2.0, 1.0])},
        (0.0, 0.0, -1.0, 0.25, 2.0**-5, "floor"), 2.0, 1,
    ),
    "concave: f > 0 at the end": (
        "(jet.d2.hi <= 0 and is_positive_at_end)", "(jet.d2.hi <= 0)",
        CAP, (0.0, 0.0, 0.5, 0.75, 1.0, None), 0.75, 1,
    ),
    "falling: f > 0 at the end": (
        "jet.d1.sign < 0 and is_positive_at_end:", "jet.d1.sign < 0:",
        SPIKE, (0.0, 0.0, -0.5, 0.0, -0.0625, None), 4.1875, 1,
    ),
    "as evaluated: f > 0": (
        "if jet.f.sign > 0:", "if jet.f.sign >= 0:",
        SHAKEN, (0.0, 0.0, -0.5, 0.25, -1.0, None), 1.0, 1,
    ),
    "centred: the second order counts": (
        "at.f + at.d1 * u + jet.d2 * u**2 * half", "at.f + at.d1 * u",
        SPIKE, (0.0, 0.0, -0.75, 0.0, 0.0, None), 7.0, 1,
    ),
    "never reached: from neither end": (
        "for end in (s.high, s.low))", "for end in (s.low,))",
        SHAKEN, (0.0, 0.0, -0.5, 0.0, -(2.0**-10), None), 2000.0, 1,
    ),
    "never reached: for a whole period": (
        "rest.first_root(wall, zero, turn.high) is None", "rest.first_root(wall, zero, zero) is None",
        {**STEM, "h": waves(1.0, 0.25)}, (0.0, 0.0, -0.5, 0.0, -(2.0**-10), None), 2000.0, 1,
    ),
    "a wave turns between its ends": (
        "join(first[i], last[i], *tops[i], *lows[i])", "join(first[i], last[i])",
        {**STEM, "h": waves(1.0, 0.0, 0.0, 0.25)}, (0.0, 0.0, -0.8, 0.0, 0.001, None), 30.0, 1,
    ),
    "a law has knots": (
        "if since < leg.end and leg.begin <= until:", "if leg.begin <= since < leg.end:",
        {**STEM, "h": legs([0.0, 1.0], [1.0, 2.0], [2.0, 1.0])}, (0.0, 0.0, -0.5, 0.0, -0.5, None), 1.875, 1,
    ),
    "a wave is rational at quarters of its turn only": (
        "quarters.denominator == 1 and (scene.period", "(scene.period",
        {"table": "cap", "r": {"kind": "fourier", "mean": 1.0, "period": 1.5, "cos": [-0.25]}},
        (0.5, 0.0, 0.75, 1.0, -0.5, None), 9.0, 1,
    ),
    "a wave whose period is irrational is rational at time 0 only": (
        "quarters.denominator == 1 and (scene.period or time == 0)", "True",
        {"table": "cap", "r": {"kind": "fourier", "mean": 1.0, "omega": 1.0, "cos": [-0.25]}},
        (1.0, 0.0, 0.75, 1.0, -0.5, None), 9.0, 1,
    ),
    "a scene is valid": (
        "    require_valid(scene)\n", "",
        {**STEM, "slope": 1.5}, (0.0, 0.125, -0.25, 0.0, -1.0, None), 9.0, 1,
    ),
    "a period is a binary64 number": (
        'require(read_number("period", period) == period, Refused("the period is no binary64 number"))', "",
        {**STEM, "h": legs([0.1, 1.0], [0.5, 0.75], [1.1, 1.0])}, (0.0, 0.0, -0.25, 0.0, -1.0, None), 9.0, 1,
    ),
    "a name is text": (
        "all(isinstance(text, str) and not HIDDEN.search(text) for text in texts)", "True",
        {**STEM, "name": 5}, (0.0, 0.0, -0.25, 0.0, -1.0, None), 9.0, 1,
    ),
    "notes hide nothing": (
        "isinstance(text, str) and not HIDDEN.search(text)", "isinstance(text, str)",
        {**STEM, "notes": "\x07"}, (0.0, 0.0, -0.25, 0.0, -1.0, None), 9.0, 1,
    ),
    "laws share a period": (
        'require(len(rates) < 2, Refused("laws that move must share one period"))', "",
        {**SHAKEN, "w": {**waves(1.0, 0.25), "omega": 2.0}}, (0.0, 0.0, -0.25, 0.0, -1.0, None), 9.0, 1,
    ),
    "the horizon comes after the start": (
        'require(state.t <= t_end, Refused("t_end is before state.t"))', "",
        STEM, (1.0, 0.0, -0.25, 0.0, -1.0, None), 0.5, 1,
    ),
}  # fmt: skip
# What the weaker verifier cannot prove of its own true answer: the other way round.
COMPLETIONS: dict[str, Row] = {
    "a wall where the search ends": (
        "BEYOND + UNIT * self.bits", "BEYOND",
        {"table": "cap", "r": 8000.0}, (0.0, 0.0, 3901.0, 0.0, 1.0, None), 4096.0, 1,
    ),
    "a value where derivatives are irrational": (
        "scene.omega or Fraction(rate), Fraction)", "scene.omega, Fraction)",
        {"table": "cap", "r": {"kind": "fourier", "mean": 1.0, "period": 2.0, "cos": [0.25], "sin": [0.25]}},
        (0.0, 0.0, 0.5, 0.0, 0.375, None), 2.0, 1,
    ),
    "a start where only f'' is irrational": (
        "bend = flight.f(wall, flight.clock.zero).d2.sign", "bend = 0",
        {**STEM, "h": {"kind": "fourier", "mean": 1.0, "period": 2.0, "cos": [-0.25]}},
        (0.0, 0.0, -0.75, 0.0, 0.0, "floor"), 1.5, 1,
    ),
    "a particle that rests": (
        "if self.clock.turn and not speed:", "if False:",
        {"table": "cap", "r": {**waves(2.0, *[0.03125] * 16), "cos": [0.03125] * 16}},
        (0.0, 0.0, 0.5, 0.0, 0.0, None), 1e308, 1,
    ),
}  # fmt: skip


def widen(steps: list[Any], low: str, high: str) -> list[Any]:
    """Return a path whose numbers are enclosed widely, all but the last x, whose ends are moved."""
    wide = [{**step, **{name: ["-1E9", "1E9"] for name in verify.NUMBERS}} for step in steps]
    ends = [str(Decimal(end) + Decimal(by)) for end, by in zip(steps[-1]["x"], (low, high), strict=True)]
    return [*wide[:-1], wide[-1] | {"x": ends}]


# Requirements on the line itself, and a change to a true line: its id, where, and what stands there then.
REJECTED = [{"outcome": "rejected"}]
LINES: dict[str, tuple[str, str, str, list[Any], Any]] = {
    "numbers lie in their enclosures": (
        "low <= least and most <= high", "True",
        "ergodic-trajectory/1", ["expect", 0, "steps", -1, "x"],
        lambda ends: [str(Decimal(end) + Decimal("1e-20")) for end in ends],
    ),
    "a number lies above the low end": (
        "low <= least and most <= high", "most <= high",
        "ergodic-trajectory/1", ["expect", 0, "steps"], lambda steps: widen(steps, "1e-20", "1"),
    ),
    "a number lies below the high end": (
        "low <= least and most <= high", "low <= least",
        "ergodic-trajectory/1", ["expect", 0, "steps"], lambda steps: widen(steps, "-1", "-1e-20"),
    ),
    "low ends lie below": (
        "require(low <= most and", "low = least\n    require(",
        "moving-cap/1", ["expect", 0, "steps", 0, "dt", 0], "0.0067",
    ),
    "digits are those of ASCII": (
        "[0-9]{1,400}(", r"\d{1,400}(",
        "moving-cap/1", ["expect", 0, "steps", 0, "dt", 0], lambda low: low.replace("0", "\u0660", 1),
    ),
    "the wall is named": (
        'require(\n            claim.get("wall") == step.wall,', "require(\n            True,",
        "moving-cap/1", ["expect", 0, "steps", 0, "wall"], "base",
    ),
    "the reason is compared": (
        "if name not in listed}", 'if name not in listed} | {"reason": reason}',
        "hard-case-23/1", ["expect", 0, "reason"], "corner",
    ),
    "the outcome is compared": (
        "if name not in listed}", "if name not in listed} | {'outcome': right['outcome']}",
        "hard-case-23/1", ["expect", 0, "outcome"], "horizon",
    ),
    "a collision has no reason": (
        "if name not in listed}", "if name not in [*listed, 'reason']}",
        "moving-cap/1", ["expect", 0, "reason"], "corner",
    ),
    "a step has no stays": (
        "if name not in listed}", "if name not in [*listed, 'stays']}",
        "moving-cap/1", ["expect", 0, "stays"], [],
    ),
    "no answer is added": (
        "all(other in permitted for other in others)", "True",
        "moving-cap/1", ["expect"], lambda answers: [*answers, {"outcome": "undecided"}],
    ),
    "stays are compared": (
        "claimed == places and str(claimed) == str(places)", "True",
        "flow-generated/20", ["expect", 0, "stays", 0], [1, 2],
    ),
    "stays are whole numbers": (
        "claimed == places and str(claimed) == str(places)", "claimed == places",
        "flow-generated/20", ["expect", 0, "stays", 0, 0], lambda place: float(place),
    ),
    "a path is as long as it says": (
        "len(found) == count and", "",
        "flow-generated/20", ["collisions"], 500,
    ),
    "a path is listed whole": (
        "count if kind == \"flow\" else min(count, len(steps) + 1)", "min(count, len(steps) or count)",
        "at-the-horizon/9", ["collisions"], 999_999,
    ),
    "rejected is for what is late": (
        "LATE = 2**30", "LATE = 2**29", "hard-case-39/2", ["state", "t"], 2.0**29,
    ),
    "numbers round to binary64": (
        "return Fraction(float(value ",
        "return Fraction(float(inf if abs(value) > sys.float_info.max else value ",
        "moving-cap/1", [], {"t_end": 2**1024 - 2**970 - 1, "expect": REJECTED},
    ),
    "a line has known fields only": (
        "    require_known(record)\n", "",
        "moving-cap/1", [], {"captured": True},
    ),
    "a step has known fields only": (
        'require_form("step", step)', "pass",
        "moving-cap/1", ["expect", 0, "steps", 0, "t"], ["7", "8"],
    ),
    # Both ways: what a rule permits is listed, once.
    "a refusal of what may be refused is listed": (
        "others.count(answer) == 1", "True",
        "far-phase/1", ["expect"], lambda expect: expect[:1],
    ),
    "a further answer is listed once": (
        "others.count(answer) == 1", "answer in others",
        "far-phase/1", ["expect"], lambda expect: [*expect, *REJECTED],
    ),
    "undecided beside undefined is listed": (
        "others.count(answer) == 1", "True",
        "hard-case-06/1", ["expect"], lambda expect: expect[:1],
    ),
    # A field that may be ignored, or null, leaves a choice: to refuse is one answer of two.
    "a schema leaves a choice": (
        "if scene.is_loose or is_more or", "if is_more or",
        "moving-cap/1", [], lambda line: {"scene": {**line["scene"], "$schema": "x"}},
    ),
    "a mushroom whose w is null leaves a choice": (
        "if scene.is_loose or is_more or", "if is_more or",
        "moving-cap/1", [], lambda line: {"scene": {**line["scene"], "w": None}},
    ),
    "a law whose period is null leaves a choice": (
        "is_loose |= is_more", "pass",
        "breathing-circle/1", [],
        lambda line: {"scene": {"table": "cap", "r": {**line["scene"]["r"], "period": None}}},
    ),
    "an unknown field of a state leaves a choice": (
        "scene.is_loose or is_more or is_extreme", "scene.is_loose or is_extreme",
        "moving-cap/1", ["state"], lambda state: {**state, "mass": 1.0},
    ),
    "lateness counts before time 0": (
        "number(abs(state.t) * scene.omega", "number(state.t * scene.omega",
        "late-start/58", ["expect"], lambda expect: expect[:1],
    ),
    "pi is not 22 / 7": (
        "- pi(bits)\n", "- number(Fraction(22, 7), bits)\n",
        "late-start/56", ["expect"], lambda expect: expect[:1],
    ),
    "a particle at the end has arrived": (
        "if state.t < t_end:\n            raise", "raise",
        "no-time-left/23", ["expect"],
        lambda expect: [{"outcome": "undefined", "reason": "sliding"}, {"outcome": "undecided"}],
    ),
}  # fmt: skip


def weaken(piece: str, other: str) -> ModuleType:
    """Return the verifier without a requirement."""
    assert SOURCE.count(piece) == 1, piece
    module = ModuleType("weak")
    exec(compile(SOURCE.replace(piece, other), "weak", "exec"), module.__dict__)
    return module


def forge(weak: ModuleType, scene: dict[str, Any], state: tuple[Any, ...], t_end: float, n: int) -> Any:
    """Return the line that a weak verifier would write."""
    fields = dict(zip((*verify.FIELDS, "wall"), state, strict=True))
    table = weak.read_scene(scene, [weak.WORK])
    found = weak.walk(table, weak.read_state(table, fields), Fraction(t_end), 256)
    steps = list(itertools.islice(found, n))
    ends = [{name: number.ends for name, number in step.numbers.items()} for step in steps]
    written = [
        plain(certified(around, [0.0] * 5, step.wall)) for around, step in zip(ends, steps, strict=True)
    ]
    outcome = "collision" if steps[-1].wall else "horizon"
    return {
        "id": "forged/1", "kind": "trajectory", "scene": scene, "state": fields, "t_end": t_end,
        "collisions": n, "expect": [{"outcome": outcome, "steps": written}],
    }  # fmt: skip


@pytest.mark.parametrize("row", REQUIREMENTS.values(), ids=REQUIREMENTS)
def test_a_requirement_on_flights_is_needed(row: Row) -> None:
    weak = weaken(*row[:2])
    line = forge(weak, *row[2:])
    assert weak.verify_line(line).status == "proved"
    assert verify.verify_line(line).status != "proved"


@pytest.mark.parametrize("row", COMPLETIONS.values(), ids=COMPLETIONS)
def test_a_true_claim_is_proved(row: Row, monkeypatch: Any) -> None:
    line, weak = forge(verify, *row[2:]), weaken(*row[:2])
    for module in (weak, verify):
        monkeypatch.setattr(module, "WORK", 2**12)
    assert verify.verify_line(line).status == "proved"
    assert judge(line, weak) != "proved"


@pytest.mark.parametrize("row", LINES.values(), ids=LINES)
def test_a_requirement_on_lines_is_needed(row: tuple[str, str, str, list[Any], Any]) -> None:
    piece, other, id_, path, value = row
    line = plain(next(line for line in lines() if line["id"] == id_))
    part: Any = line
    for step in path[:-1]:
        part = part[step]
    if path:
        part[path[-1]] = value(part[path[-1]]) if callable(value) else value
    else:
        line |= value(line) if callable(value) else value
    assert weaken(piece, other).verify_line(line).status == "proved"
    assert judge(line) != "proved"


WIDER = ["0.004", "0.008"]  # holds dt of moving-cap/1
NARROWNESS: dict[str, tuple[str, str, list[Any]]] = {
    "digits are asked": ("if digits is not None:", "if False:", []),
    "all numbers are asked": (
        "in NUMBERS:\n            low, high = map", "in NUMBERS[1:]:\n            low, high = map", [],
    ),
    "the proved answer is asked": ("answer, _ = claim_of(record)", 'answer = record["expect"][0]', REJECTED),
}  # fmt: skip


@pytest.mark.parametrize("row", NARROWNESS.values(), ids=NARROWNESS)
def test_a_requirement_on_widths_is_needed(row: tuple[str, str, list[Any]]) -> None:
    piece, other, before = row
    line = plain(next(line for line in lines() if line["id"] == "moving-cap/1"))
    if before:
        line |= {"scene": {**line["scene"], "$schema": "x"}}
    line["expect"] = [*before, *line["expect"]]
    weak = weaken(piece, other)
    assert verify.verify_line(line, 17) == weak.verify_line(line, 17) == verify.Verdict("proved")
    line["expect"][-1]["steps"][0]["dt"] = WIDER
    assert verify.verify_line(line).status == weak.verify_line(line, 17).status == "proved"
    assert verify.verify_line(line, 17).status == "not proved"
