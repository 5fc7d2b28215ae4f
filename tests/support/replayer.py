"""Answers by memory: a program that knows the corpus and its certified answers, and no physics at all.

With a seed it also knows by which transform every vector is asked in the run of that seed. What it does not
know it answers by `undecided`, or with the last answer that it gave.
"""

import json
from collections.abc import Sequence
from typing import Any

import msgspec

from conformance import vectors
from conformance.grading.agreement import middle
from conformance.suite.session import AnswerLine
from conformance.suite.symmetry import Transform, draw_transform
from support.faulty_steppers import Answer, Line, faulty, starts

UNDECIDED = {"outcome": "undecided", "reason": "not in the book"}


def remembered(seed: int | None, groups: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the certified answer to every question of some groups, as it will be asked."""
    found = {}
    for vector in (v for v in vectors.load("stress") if v.group in groups):
        transform = Transform() if seed is None else draw_transform(vector, seed)
        inverse = transform._replace(length=-transform.length, time=-transform.time)
        found[_key(vectors.request(transform.apply(vector), 0))] = inverse.restore(certified_answer(vector))
    return found


def certified_answer(vector: vectors.Vector) -> dict[str, Any]:
    """Return the answer in the middle of the enclosures, rounded, as it comes over the wire."""
    steps = msgspec.to_builtins(middle(vector.expect[0], vector.state))
    if vector.kind == "trajectory":
        return {"steps": steps}
    if vector.kind == "step":
        return dict(steps[-1])
    times, stays = [vector.state.t, *(step["t"] for step in steps)], vector.expect[0].stays
    stay = [times[place + 1] for place in stays[0]] if stays else None
    return {"states": [{**steps[-1], "captured": stay}]}


def _key(request: dict[str, Any]) -> str:
    return json.dumps({name: part for name, part in request.items() if name != "seq"}, sort_keys=True)


def replayer(seed: int | None, is_bold: bool, groups: Sequence[str]) -> AnswerLine:
    """Return what answers lines by memory; a bold one says of what it does not know what it said last."""
    known, last = remembered(seed, groups), UNDECIDED

    def fault(request: Line, answer: Answer) -> Line:
        nonlocal last
        if request.get("cmd") in ("start", "echo") or any("vy" not in state for state in starts(request)):
            return answer(request)
        found = known.get(_key(request), last if is_bold else UNDECIDED)
        if request["cmd"] == "step":
            last = found
        if request["cmd"] == "flow" and "states" not in found:
            found = {"states": [UNDECIDED] * len(request["states"])}
        return {"seq": request["seq"], **found}

    return faulty(fault)
