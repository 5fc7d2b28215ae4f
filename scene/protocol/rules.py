"""The rules of protocol 1 in one table, and what may be answered to a question that breaks one.

Each rule is a condition on a part of a question, or of an answer. A question that keeps all rules
has one right answer, and no other passes. `otherwise` says what is answered to a question that
breaks the rule.

Readers of the table are:

- the page docs/protocol.md: `python -m scene.protocol.rules` prints its section;
- the JSON Schema: `limit_definitions` in `scene.load`, and `scene.protocol.messages`;
- `scene`, which checks scenes, laws and numbers, and the steppers, which check states;
- the makers of vectors and the grading: `may_be_refused`, `without_loose`, `does_undecided_pass`;
- the draws of good and bad questions: `conformance.cases.rules`, a function for each name.

The verifier states the rules again, because it imports nothing of ours.
tests/test_conformance_rules.py breaks each rule before each reader. CONTRIBUTING says how a rule is
added.
"""

from collections.abc import Mapping, Set
from enum import Enum
from fractions import Fraction
from math import log2
from textwrap import fill
from typing import Any, Literal, NamedTuple

import msgspec

from scene.laws import MAX_HARMONICS, MAX_KNOTS, WRITTEN
from scene.states import ON_WALL, State
from scene.tables import HIDDEN, Cap, Mushroom, Scene, Stem

LATE = 2**30  # periods from time 0, or units of time if nothing moves
LARGE = Fraction(10**100)
# pi to 99 decimals: the product of two binary64 numbers has 32 digits, and lies on one side of pi
# 2^31.
PI = Fraction(
    "3.14159265358979323846264338327950288419716939937510"
    "5820974944592307816406286208998628034825342117068"
)

TABLES: dict[str, type[msgspec.Struct]] = {"cap": Cap, "stem": Stem, "mushroom": Mushroom}
KINDS: dict[str, type[msgspec.Struct]] = {str(kind.__struct_config__.tag): kind for kind in WRITTEN}
OPTIONAL = {
    "slope",
    "w",
    "nu",
    "omega",
    "period",
    "cos",
    "sin",
}  # null stands for an absent one, if ignored

Part = Literal["scene", "law", "state", "request", "answer"]


class Duty(Enum):
    """What is answered where a rule is broken; the value is what the page says."""

    REJECT = "MUST be rejected"
    IGNORE = "MUST be rejected, or answered without the field"
    EITHER = "MAY be rejected, or answered by either value"
    MAY_REJECT = "MUST be answered rightly or rejected; `undecided` passes"
    ARRIVE = "MUST be answered `horizon` with the state itself"
    NO_NEXT = "MUST be answered `undefined`; `undecided` passes"
    WRONG_FORMAT = "the answer is `wrong-format`"

    @property
    def may_refuse(self) -> bool:
        """Tell whether `rejected` passes."""
        return self in (Duty.REJECT, Duty.IGNORE, Duty.EITHER, Duty.MAY_REJECT)

    @property
    def must_refuse(self) -> bool:
        """Tell whether nothing but `rejected` passes."""
        return self is Duty.REJECT


class ProtocolRule(NamedTuple):
    """A row of the table.

    Attributes:
        name: it names the rule for ever, here, on the page and in the draws.
        part: what it is about.
        condition: when it is kept, as the page says it.
        otherwise: what is answered if it is broken.
        why: the reason for what was decided; empty where it needs none.
        in_schema: whether the JSON Schema tells that it is broken. A schema knows no relations
            between numbers.
    """

    name: str
    part: Part
    condition: str
    otherwise: Duty
    why: str = ""
    in_schema: bool = False


RULES = (
    ProtocolRule(
        "known-table", "scene", "`table` is cap, stem or mushroom", Duty.REJECT, in_schema=True
    ),
    ProtocolRule(
        "whole-scene", "scene", "no required field is missing", Duty.REJECT, in_schema=True
    ),
    ProtocolRule("scene-types", "scene", "each field has its type", Duty.REJECT, in_schema=True),
    ProtocolRule(
        "one-mouth",
        "scene",
        "a mushroom gives exactly one of `w` and `nu`",
        Duty.REJECT,
        in_schema=True,
    ),
    ProtocolRule("sizes", "scene", "r, h, w > 0 at all times", Duty.REJECT),
    ProtocolRule("mouth-in-base", "scene", "w <= r at all times", Duty.REJECT),
    ProtocolRule("sides-apart", "scene", "w > h slope at all times", Duty.REJECT),
    ProtocolRule(
        "one-period", "scene", "all laws that move have exactly the same period", Duty.REJECT
    ),
    ProtocolRule(
        "known-scene-fields",
        "scene",
        "the table has each of its fields",
        Duty.IGNORE,
        "A stepper SHOULD reject here, because a misspelt law would be taken for an absent one. "
        "It need not: many JSON libraries drop what they do not know.",
        in_schema=True,
    ),
    ProtocolRule(
        "texts",
        "scene",
        "`name` and `notes` are text without control characters other than tab and line ends",
        Duty.IGNORE,
        "They have no effect on the motion, so a stepper need not read them.",
        in_schema=True,
    ),
    ProtocolRule(
        "no-null",
        "scene",
        "no optional field of a scene or a law is null",
        Duty.IGNORE,
        "Many JSON libraries do not tell null from an absent field. Only `wall` may be null in a "
        "good question.",
        in_schema=True,
    ),
    ProtocolRule(
        "known-kind", "law", f"`kind` is {' or '.join(KINDS)}", Duty.REJECT, in_schema=True
    ),
    ProtocolRule(
        "one-rate",
        "law",
        "exactly one of `omega` and `period` is given",
        Duty.REJECT,
        in_schema=True,
    ),
    ProtocolRule(
        "positive-rate",
        "law",
        "`omega` > 0 and `period` > 0",
        Duty.REJECT,
        "With omega = 0 the law has no period. A negative omega is another way to write the same "
        "law.",
        in_schema=True,
    ),
    ProtocolRule(
        "harmonics",
        "law",
        f"`cos` and `sin` have at most {MAX_HARMONICS} numbers each",
        Duty.REJECT,
        "The proof that a scene is valid takes time that grows steeply with their number. A "
        "stepper that dropped the further ones would answer for another scene.",
        in_schema=True,
    ),
    ProtocolRule("knots", "law", f"there are 2 to {MAX_KNOTS} knots", Duty.REJECT, in_schema=True),
    ProtocolRule("rising-times", "law", "the times of the knots increase strictly", Duty.REJECT),
    ProtocolRule("closed-law", "law", "the last knot has the value of the first", Duty.REJECT),
    ProtocolRule(
        "exact-period",
        "law",
        "tn - t0 is a binary64 number, exactly",
        Duty.REJECT,
        "Otherwise no `period` of another law could equal it. Knots at 0.1, 0.5, 1.1 are refused, "
        "because 1.1 - 0.1 is no binary64 number.",
    ),
    ProtocolRule(
        "known-law-fields",
        "law",
        "the kind has each of the law's fields",
        Duty.IGNORE,
        in_schema=True,
    ),
    ProtocolRule(
        "whole-state", "state", "no required field is missing", Duty.REJECT, in_schema=True
    ),
    ProtocolRule("state-types", "state", "each field has its type", Duty.REJECT, in_schema=True),
    ProtocolRule(
        "known-wall", "state", "`wall` is null or the name of a wall", Duty.REJECT, in_schema=True
    ),
    ProtocolRule("own-wall", "state", "the table has the wall that is named", Duty.REJECT),
    ProtocolRule("inside", "state", "the particle is not beyond a wall", Duty.REJECT),
    ProtocolRule(
        "on-its-wall",
        "state",
        f"the particle is within 2^{log2(ON_WALL):.0f} of the size of the wall that it names",
        Duty.REJECT,
    ),
    ProtocolRule(
        "before-its-end",
        "state",
        "the particle is not past the end of the wall that it names",
        Duty.REJECT,
    ),
    ProtocolRule(
        "leaves-its-wall",
        "state",
        "a particle on one wall does not move into it, relative to the wall's own motion",
        Duty.REJECT,
    ),
    ProtocolRule(
        "one-wall",
        "state",
        "the particle is not on two walls at once",
        Duty.NO_NEXT,
        "In a corner and at the mouth's edge there is no normal, so nothing tells whether a "
        "particle moves into a wall: this holds whichever way it moves. The reason is corner or "
        "mouth-edge.",
    ),
    ProtocolRule(
        "lifts-off",
        "state",
        "a particle on a wall leaves it",
        Duty.NO_NEXT,
        "A particle along its wall has f' = 0 there, and f'' > 0 if it leaves. The reason is "
        "sliding, or tangency where f'' = 0 on a wall of a moving table.",
    ),
    ProtocolRule(
        "early",
        "state",
        "abs(t) is less than 2^30 periods, or 2^30 units of time if nothing moves",
        Duty.MAY_REJECT,
        "A phase so far from time 0 has few correct digits in binary64, before time 0 as well as "
        "after it. Therefore abs(t) counts. The period 2 pi / omega is the exact one.",
    ),
    ProtocolRule(
        "small",
        "state",
        "t, x, y, vx and vy are below 1e100 in size",
        Duty.MAY_REJECT,
        "Squares and cubes of larger numbers overflow.",
    ),
    ProtocolRule(
        "known-state-fields",
        "state",
        "the protocol has each of the state's fields",
        Duty.IGNORE,
        in_schema=True,
    ),
    ProtocolRule(
        "known-command", "request", "`cmd` is one of this page", Duty.REJECT, in_schema=True
    ),
    ProtocolRule(
        "whole-request", "request", "no required field is missing", Duty.REJECT, in_schema=True
    ),
    ProtocolRule(
        "request-types", "request", "each field has its type", Duty.REJECT, in_schema=True
    ),
    ProtocolRule("finite", "request", "each number is finite in binary64", Duty.REJECT),
    ProtocolRule(
        "sequence", "request", "`seq` is a whole number from 0 to 2^53", Duty.REJECT, in_schema=True
    ),
    ProtocolRule(
        "counts",
        "request",
        "`collisions` is a whole number >= 0 (in `time`, >= 1), `repeat` one >= 1",
        Duty.REJECT,
        in_schema=True,
    ),
    ProtocolRule("end-not-before", "request", "`t_end` >= state.t", Duty.REJECT),
    ProtocolRule(
        "time-left",
        "request",
        "`t_end` > state.t",
        Duty.ARRIVE,
        "A particle at t_end has arrived, and nothing is asked of its next flight. So this holds "
        "also for a particle in a corner, at the mouth's edge or along a wall, from which no "
        "flight is defined. A state that must be rejected is rejected.",
    ),
    ProtocolRule(
        "known-request-fields",
        "request",
        "the command has each of the fields",
        Duty.IGNORE,
        in_schema=True,
    ),
    ProtocolRule(
        "fields-once",
        "request",
        "no object has a field twice",
        Duty.EITHER,
        "JSON readers differ, and most do not tell.",
    ),
    ProtocolRule(
        "answer-fields-once",
        "answer",
        "no object has a field twice",
        Duty.WRONG_FORMAT,
        "The suite would have to choose one of two values. This holds for unknown fields, too.",
    ),
    ProtocolRule("same-seq", "answer", "`seq` is that of the request", Duty.WRONG_FORMAT),
    ProtocolRule(
        "finite-answers", "answer", "each number is finite in binary64", Duty.WRONG_FORMAT
    ),
    ProtocolRule(
        "capture-at-the-end",
        "answer",
        "only an entry `horizon` has a capture interval",
        Duty.WRONG_FORMAT,
    ),
)
BY_NAME = {rule.name: rule for rule in RULES}


def may_be_refused(scene: Scene, state: State) -> bool:
    """Tell whether a good question may be rejected: a rule of duty MAY_REJECT is broken.

    Args:
        scene: table and laws.
        state: the start.
    """
    return is_late(scene, state.t) or is_large(state)


def is_large(state: State) -> bool:
    """Tell whether a state breaks the rule `small`."""
    return max(map(abs, (state.t, state.x, state.y, state.vx, state.vy))) >= LARGE


def is_late(scene: Scene, t: float) -> bool:
    """Tell whether a time breaks the rule `early`, exactly."""
    shared = scene.cycle
    if shared is None:
        return abs(t) >= LATE
    if shared.length is not None:
        return abs(Fraction(t)) >= LATE * shared.length
    assert shared.omega is not None
    half_turns = abs(Fraction(t)) * Fraction(shared.omega) / (2 * LATE)
    return half_turns >= PI


def without_loose(data: Any) -> tuple[Any, bool]:
    """Return a scene without the fields that may be ignored, and whether there were any.

    These are unknown fields of a scene or of its laws, optional ones that are null, and texts that
    may not stand there. Data that are no scene are returned as they are.
    """
    fields = _fields_of(data, "table", TABLES)
    if not fields:
        return data, False
    kept = {name: part for name, part in data.items() if name in fields}
    for name in ("name", "notes"):
        if name in kept and not (isinstance(kept[name], str) and HIDDEN.search(kept[name]) is None):
            del kept[name]
    for name in OPTIONAL & kept.keys():
        if kept[name] is None:
            del kept[name]
    is_loose = len(kept) < len(data)
    for name, law in kept.items():
        known = _fields_of(law, "kind", KINDS)
        if known:
            kept[name] = _without_loose_of(law, known)
            is_loose |= len(kept[name]) < len(law)
    return kept, is_loose


def _without_loose_of(law: Mapping[str, Any], known: tuple[str, ...]) -> dict[str, Any]:
    """Return a law's fields without unknown ones, and without optional ones that are null."""
    found = {field: part for field, part in law.items() if field in known}
    return {name: part for name, part in found.items() if not (part is None and name in OPTIONAL)}


def _fields_of(data: Any, tag: str, forms: Mapping[str, type[msgspec.Struct]]) -> tuple[str, ...]:
    """Return the fields that an object may have by its tag.

    None where it is no object of any form.
    """
    form = (
        forms.get(data[tag])
        if isinstance(data, Mapping) and isinstance(data.get(tag), str)
        else None
    )
    return (tag, *form.__struct_fields__) if form else ()


def does_undecided_pass(outcomes: Set[str]) -> bool:
    """Tell whether `undecided` passes for a question, by the outcomes that are listed as right.

    It does where a right answer may be refused: `undecided` says as little.
    """
    return {"rejected"} < outcomes


def page_section() -> str:
    """Return the section of docs/protocol.md that is made of this table."""
    lines: list[str] = []
    titles = {
        "scene": "A scene",
        "law": "A law",
        "state": "A state",
        "request": "A request",
        "answer": "An answer",
    }
    for part, title in titles.items():
        rows = [rule for rule in RULES if rule.part == part]
        lines += [f"**{title}.**", "", "| rule | kept if | otherwise |", "| --- | --- | --- |"]
        lines += [f"| {rule.name} | {rule.condition} | {rule.otherwise.value} |" for rule in rows]
        reasons = [f"- *{rule.name}.* {rule.why}" for rule in rows if rule.why]
        lines += ["", *(fill(reason, 118, subsequent_indent="  ") for reason in reasons), ""]
    return "\n".join(lines).replace("\n\n\n", "\n\n").strip() + "\n"


if __name__ == "__main__":
    print(page_section(), end="")
