"""Answers by memory: a program that knows the corpus and its certified answers, and no physics at all.

With a seed it also knows in which disguise every vector is asked in the run of that seed. What it does not
know it answers as it is told to: `undecided`, or with the last answer that it gave.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

import msgspec

from conformance import vectors
from conformance.grading.agreement import middle
from conformance.suite.disguise import Disguise, asked, drawn_disguise, published

INTRODUCTION = {
    "protocol": 1,
    "name": "replayer",
    "version": "1",
    "language": "none",
    "profiles": ["step", "trajectory", "flow"],
    "tables": ["cap", "stem", "mushroom"],
    "laws": ["constant", "fourier", "bang-bang"],
}


def command(seed: int | None, otherwise: str, groups: Sequence[str]) -> list[str]:
    """Return the command line of a replayer that knows some groups."""
    return [sys.executable, __file__, str(seed), otherwise, *groups]


def remembered(seed: int | None, groups: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the certified answer to every question of some groups, as it will be asked."""
    found = {}
    for vector in (v for v in vectors.load("stress") if v.group in groups):
        disguise = Disguise() if seed is None else drawn_disguise(vector, seed)
        inverse = disguise._replace(length=-disguise.length, time=-disguise.time)
        found[_key(vectors.request(asked(vector, disguise), 0))] = published(
            certified_answer(vector), inverse
        )
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


def main(seed: int | None, otherwise: str, groups: Sequence[str]) -> None:
    """Speak protocol 1."""
    known, last = remembered(seed, groups), {"outcome": "undecided", "reason": "not in the book"}
    for line in sys.stdin:
        request = json.loads(line)
        if request["cmd"] == "stop":
            return
        if request["cmd"] == "start":
            answer = INTRODUCTION
        elif request["cmd"] == "echo":
            answer = {"values": request["values"]}
        else:
            is_whole = request["cmd"] != "step" or "vy" in request["state"]
            undecided = {"outcome": "undecided" if is_whole else "rejected", "reason": "not in the book"}
            guess = undecided if otherwise == "undecided" or not is_whole else last
            answer = known.get(_key(request), guess)
            if request["cmd"] == "step" and is_whole:
                last = answer
            if request["cmd"] == "flow" and "states" not in answer:
                answer = {"states": [undecided] * len(request["states"])}
            answer = {"seq": request["seq"], **answer}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main(None if sys.argv[1] == "None" else int(sys.argv[1]), sys.argv[2], sys.argv[3:])
