"""Requirements of the verifier are needed: without one of these it proves a claim that it refuses.

A requirement is a piece of `conformance/verify.py`, and what stands there without it. The weaker verifier
answers a question; that answer, written as a line of a corpus, is the forgery. Other rows change one field
of a true line.
"""

import itertools
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from support.forged_claims import judge, lines, plain

from conformance import verify
from conformance.vectors import certified

SOURCE = Path(verify.__file__).read_text("utf-8")
CAP: dict[str, Any] = {"table": "cap", "r": 1.0}
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
        "(jet.d1.sign < 0 and is_positive_at_end)", "jet.d1.sign < 0",
        SPIKE, (0.0, 0.0, -0.5, 0.0, -0.0625, None), 4.1875, 1,
    ),
    "as evaluated: f > 0": (
        "if jet.f.sign > 0 or", "if jet.f.sign >= 0 or",
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
# Requirements on the line itself, and a change to a true line: its id, where, and what stands there then.
REJECTED = [{"outcome": "rejected"}]
LINES: dict[str, tuple[str, str, str, list[Any], Any]] = {
    "numbers lie in their enclosures": (
        "low <= least and most <= high", "True",
        "ergodic-trajectory/1", ["expect", 0, "steps", -1, "x"],
        lambda ends: [str(Decimal(end) + Decimal("1e-20")) for end in ends],
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
        "hard-case-23/1", ["expect", 0, "outcome"], "rejected",
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
        "all(other in allowed for other in others)", "True",
        "moving-cap/1", ["expect"], lambda answers: [*answers, {"outcome": "undecided"}],
    ),
    "stays are compared": (
        "claimed == places and str(claimed) == str(places)", "True",
        "flow-stays/1", ["expect", 0, "stays", 0], [1, 2],
    ),
    "stays are whole numbers": (
        "claimed == places and str(claimed) == str(places)", "claimed == places",
        "flow-stays/1", ["expect", 0, "stays", 0, 0], lambda place: float(place),
    ),
    "a path is as long as it says": (
        "len(found) == count and", "",
        "flow-stays/1", ["collisions"], 500,
    ),
    "a path is listed whole": (
        "count if kind == \"flow\" else min(count, len(steps) + 1)", "min(count, len(steps) or count)",
        "moving-cap-trajectory/1", ["collisions"], 999_999,
    ),
    "rejected is for what is late": (
        "LATE, LARGE = 2**30,", "LATE, LARGE = 2**29,", "hard-case-39/2", ["state", "t"], 2.0**29,
    ),
    "numbers round to binary64": (
        "return Fraction(float(value ",
        "return Fraction(float(inf if abs(value) > sys.float_info.max else value ",
        "moving-cap/1", [], {"t_end": 2**1024 - 2**970 - 1, "expect": REJECTED},
    ),
    "a schema is passed over": (
        '{"$schema", "table"', '{"table"',
        "moving-cap/1", [], lambda line: {"scene": {**line["scene"], "$schema": "x"}, "expect": REJECTED},
    ),
    "a mushroom may give w as null": (
        "and data.get(name) is None", "and False",
        "moving-cap/1", [], lambda line: {"scene": {**line["scene"], "w": None}, "expect": REJECTED},
    ),
    "a law may give period as null": (
        "rates.count(None) == 1", "rates.count(None) == 1 and 'period' not in data",
        "breathing-circle/1", [],
        lambda line: {
            "scene": {"table": "cap", "r": {**line["scene"]["r"], "period": None}}, "expect": REJECTED,
        },
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
