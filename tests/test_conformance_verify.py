"""The verifier: its arithmetic against exact numbers, Arb and mpmath; forged and sampled claims; files."""

import json
import operator
import os
import subprocess
import sys
from collections.abc import Iterator
from fractions import Fraction
from random import Random
from typing import Any

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
N_FORGERIES = int(os.environ.get("MUSHROOMS_FORGERIES", 120))
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
    """Yield a line of every second group, the first step of a path; all lines in a deep run."""
    lines = [line for line in pool("answered") + pool("undefined") if line["kind"] != "flow"]
    by_group = {line["group"]: line for line in lines}
    for line in lines if IS_DEEP else list(by_group.values())[::2]:
        answer = line["expect"][0]
        yield {**line, "expect": [{**answer, "steps": answer.get("steps", [])[: None if IS_DEEP else 1]}]}


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
    lines = [
        line for line in pool(name) if line["kind"] != "flow" and len(line["expect"][0].get("steps", ())) < 6
    ]
    while n_seen < 2:
        forged = forge(random, random.choice(lines))
        if forged:
            assert falsify(forged, 100), forged
            n_seen += 1


CAP: dict[str, Any] = {"table": "cap", "r": 1.0}
DOWN = {"t": 0, "x": 0, "y": 0.5, "vx": 0, "vy": -1.0}
UP = {"t": 0.5, "x": 0, "y": 0, "vx": 0, "vy": 1.0, "wall": "base"}
ASIDE = {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 0.75, "vy": 1.0}
ARC = {
    "t": 0.4431513611335565, "x": 0.3323635208501674, "y": 0.9431513611335565,
    "vx": -0.042636479149832596, "vy": -1.2492726406376256, "wall": "arc",
}  # fmt: skip
LATE = {**DOWN, "t": 0.25, "y": 0.25}
FALLING = {**DOWN, "t": -0.5}
TINY = {"table": "cap", "r": 2.0**-130}
ANSWERS: list[tuple[dict[str, Any], int, str]] = [
    ({"scene": CAP, "state": DOWN, "steps": [UP]}, 0, "base, within 0 backward ulps"),
    ({"scene": CAP, "state": ASIDE, "steps": [ARC]}, 0, "arc, within 0."),
    ({"scene": CAP, "state": DOWN, "t_end": 0.25, "steps": [LATE]}, 0, "the horizon, within 0"),
    ({"scene": CAP, "state": ASIDE, "steps": [{**ARC, "t": 0.4431515}]}, 1, "step 1: false: arc, within"),
    (
        {"scene": CAP, "state": ASIDE, "steps": [{**ARC, "wall": "base"}]},
        1,
        "step 1: false: arc is met first",
    ),
    (
        {"scene": CAP, "state": ASIDE, "steps": [ARC, {**ARC, "t": 2.4}]},
        1,
        "step 2: false: base is met first",
    ),
    (
        {
            "scene": TINY,
            "state": {**DOWN, "y": 2.0**-131, "vy": -(2.0**-130)},
            "steps": [{**UP, "x": 2.0**-131, "vy": 2.0**-130}],
        },
        1,
        "step 1: false",
    ),
    ({"scene": CAP, "state": FALLING, "steps": [{**UP, "t": 0.0, "x": 1e-16}]}, 0, "base, within"),
    ({"scene": CAP, "state": LATE, "t_end": 0.25, "steps": [LATE]}, 0, "the horizon, within 0"),
    ({"scene": CAP, "state": DOWN, "steps": [{**UP, "t": float("inf")}]}, 1, "t is no finite number"),
    ({"scene": CAP, "state": DOWN, "steps": [5]}, 2, "a step must be given, as a dict"),
    ({"scene": {"table": "cap", "r": -1.0}, "state": DOWN, "steps": []}, 2, "r breaks its bound"),
    ({"scene": CAP, "state": DOWN}, 2, "steps must be given, as a list"),
]
LINE = {
    "id": "a/1", "kind": "step", "scene": CAP, "state": DOWN, "t_end": 9.0,
    "expect": [{"outcome": "collision", "steps": [{
        "wall": "base", "dt": ["0.5", "0.5"], "x": ["0", "0"], "y": ["0", "0"], "vx": ["0", "0"],
        "vy": ["1", "1"],
    }]}],
}  # fmt: skip
# It is on the left side at an irrational phase, as far as any precision shows, and far below the floor.
SWELLING = {"kind": "fourier", "mean": 1.0, "period": 2.0, "sin": [0.25]}
REFUSED = {
    **LINE, "scene": {"table": "stem", "w": SWELLING, "h": 1.0}, "expect": [{"outcome": "rejected"}],
    "state": {**DOWN, "t": 0.5, "x": -1.25, "y": -2.0},
}  # fmt: skip
FILES: list[tuple[str, int, str]] = [
    (json.dumps(LINE), 0, "1 of 1 proved"),
    (json.dumps({**LINE, "t_end": 0.25}), 1, "a/1: false: the answer is horizon"),
    (json.dumps({**LINE, "kind": "flow"}), 1, "a/1: false: the path has 1 steps, or goes on"),
    ("[" * 100_000, 2, "unreadable after 0 claims"),
    (json.dumps(LINE) + "\n{}", 2, "unreadable after 1 claims"),
    ("{", 2, "unreadable after 0 claims"),
    (json.dumps({**LINE, "rule": "a\u2028b"}, ensure_ascii=False), 0, "1 of 1 proved"),
    (json.dumps(LINE)[:-1] + ', "id": "a/2"}', 2, "a key comes twice"),
    (json.dumps({**LINE, "scene": {"table": 0}}).replace("0}", f"{'9' * 5000}}}"), 2, "unreadable after 0"),
    (json.dumps({**LINE, "collisions": 999_999, "expect": [{"outcome": "collision"}]}), 2, "kind or"),
    (json.dumps(REFUSED), 0, "1 of 1 proved"),
    (json.dumps({**LINE, "kind": "jump"}), 2, "kind or collisions are none"),
    (json.dumps({**LINE, "expect": [{"outcome": "collision", "steps": [5]}]}), 2, "dt must be given"),
]


def call(*arguments: str) -> tuple[int, str]:
    """Run the file as its users do, and return the exit code and all it prints."""
    command = [sys.executable, "-I", verify.__file__, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout + done.stderr


ROWS = [
    *[(["--answers"], json.dumps(data), code, word) for data, code, word in ANSWERS],
    *[([], text, code, word) for text, code, word in FILES],
]


@pytest.mark.parametrize(("options", "text", "code", "word"), ROWS, ids=range(len(ROWS)))
def test_a_file_is_judged(options: list[str], text: str, code: int, word: str, tmp_path: Any) -> None:
    path = tmp_path / "lines.jsonl"
    path.write_text(text, "utf-8")
    found, printed = call(*options, str(path))
    assert found == code
    assert word in printed


def test_no_file_is_no_proof() -> None:
    assert call()[0] == call("nowhere.jsonl")[0] == 2
