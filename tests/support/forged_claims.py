"""Forged claims: false lines of the corpus, which the verifier must not prove.

`false_answers` and `bad_questions` say why each kind is false. What is drawn depends on the seed alone.

    python -m tests.support.forged_claims N [SEED]

draws N forgeries, of each kind in turn, and has them verified. It prints how many of each kind are called
false, how many not proved; and each one that is proved, or that ends in an error. Then it exits with 1.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import cycle, islice
from random import Random
from types import ModuleType
from typing import NamedTuple

from conformance import verify

from . import bad_questions as bad
from . import false_answers as false
from .falsifier import Line

KINDS: dict[str, tuple[str, false.Forge]] = {
    "a number moved by widths": ("answered", partial(false.move, 0)),
    "a number moved by some 1e-15": ("answered", partial(false.move, 8)),
    "a number moved far": ("answered", partial(false.move, 22)),
    "the ends of an enclosure exchanged": ("answered", false.exchange_ends),
    "a later root of the same wall": ("returning", partial(false.meet_later, True)),
    "a later root of another wall": ("hit", partial(false.meet_later, False)),
    "another wall named": ("answered", false.rename_wall),
    "a hit missed": ("hit", false.miss),
    "a hit after t_end": ("hit", false.meet_too_late),
    "a horizon after a hit": ("horizon", false.fly_on),
    "the wall being left met at once": ("hit", false.meet_at_once),
    "the residual kept": ("again", false.keep_residual),
    "a shut mouth passed": ("mushroom", false.pass_shut_mouth),
    "an open mouth met": ("mushroom", false.hit_open_mouth),
    "a knot ignored": ("knots", false.ignore_knot),
    "an answer called undefined": ("step", false.call_undefined),
    "undefined for another reason": ("undefined", false.call_undefined),
    "a tie broken": ("undefined", false.break_tie),
    "a step left out": ("trajectory", false.leave_out_step),
    "two steps exchanged": ("trajectory", false.exchange_steps),
    "a path ended early": ("trajectory", false.end_path),
    "a capture interval moved": ("stays", partial(false.change_stays, "move")),
    "a capture interval dropped": ("stays", partial(false.change_stays, "drop")),
    "a capture interval added": ("flow", partial(false.change_stays, "add")),
    "steps of a flow miscounted": ("flow", false.miscount),
    "a refusal permitted": ("core", partial(false.permit_refusal, False)),
    "nothing but a refusal": ("core", partial(false.permit_refusal, True)),
    "a false answer permitted": ("step", false.permit_falsehood),
    "a field spoiled": ("answered", false.spoil),
    "a corner left": ("step", bad.leave_corner),
    "a start off its wall": ("leaving", bad.leave_wall),
    "a start beyond a wall": ("step", bad.start_beyond),
    "a start into its wall": ("leaving", bad.start_into_wall),
    "a horizon before the start": ("step", bad.end_in_the_past),
    "bad input answered": ("rejected", bad.answer_bad_input),
    "a scene broken": ("step", bad.break_scene),
    "a law broken": ("step", bad.break_law),
    "a slow particle missed": ("step", bad.miss_slow_particle),
}
POOLS: dict[str, Callable[[Line, Line], object]] = {
    "answered": lambda line, answer: answer.get("steps"),
    "step": lambda line, answer: line["kind"] == "step" and answer.get("steps"),
    "hit": lambda line, answer: line["kind"] == "step" and answer["outcome"] == "collision",
    "returning": lambda line, answer: (
        POOLS["hit"](line, answer) and line["group"] in ("waiting", "through-mouth")
    ),
    "horizon": lambda line, answer: line["kind"] == "step" and answer["outcome"] == "horizon",
    "again": lambda line, answer: (
        line["kind"] == "step"
        and line["state"]["wall"] in [step.get("wall", "") for step in answer.get("steps", ())]
    ),
    "leaving": lambda line, answer: line["kind"] == "step" and answer.get("steps") and line["state"]["wall"],
    "mushroom": lambda line, answer: POOLS["step"](line, answer) and line["scene"]["table"] == "mushroom",
    "knots": lambda line, answer: POOLS["step"](line, answer) and "knots" in str(line["scene"]),
    "trajectory": lambda line, answer: line["kind"] == "trajectory" and len(answer["steps"]) > 1,
    "flow": lambda line, answer: line["kind"] == "flow" and 1 < line.get("collisions", 1) < 60,
    "stays": lambda line, answer: POOLS["flow"](line, answer) and answer.get("stays"),
    "undefined": lambda line, answer: answer["outcome"] == "undefined",
    "rejected": lambda line, answer: (
        answer["outcome"] == "rejected" and line["scene"].get("table") in false.WALLS
    ),
    "core": lambda line, answer: line["level"] == "core" and len(line["expect"]) == 1 and answer.get("steps"),
}


class Forgery(NamedTuple):
    """A false claim, its kind, and the id of the true line that it was made from."""

    kind: str
    source: str
    line: Line


@cache
def pool(name: str) -> list[Line]:
    """Return the lines of the corpus that some kinds of forgery begin with."""
    return [line for line in false.lines() if POOLS[name](line, line["expect"][0])]


def draw(n: int, seed: int) -> Iterator[Forgery]:
    """Yield n forgeries, of each kind in turn."""
    random = Random(seed)
    for kind, (name, forge) in islice(cycle(KINDS.items()), n):
        forged = None
        while forged is None:
            line = random.choice(pool(name))
            forged = forge(random, line)
        yield Forgery(kind, line["id"], forged)


def judge(line: Line, verifier: ModuleType = verify) -> str:
    """Return a verifier's word on a line, "unreadable" and other errors included."""
    try:
        return str(verifier.verify_line(line).status)
    except verifier.Unreadable:
        return "unreadable"
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def main(n: int, seed: int = 1) -> int:
    """Have n forgeries verified; return 1 if one is accepted, or ends in an error."""
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    n_wrong, began = 0, time.monotonic()
    for kind, source, line in draw(n, seed):
        status = judge(line)
        counts[kind][status] += 1
        if status not in ("false", "not proved", "unreadable"):
            n_wrong += 1
            print(f"{kind}, from {source}: {status}\n{json.dumps(line)}", flush=True)
    for kind, found in counts.items():
        print(f"{kind:35}" + "".join(f"{k:>6} {status}" for status, k in sorted(found.items())))
    print(f"{n_wrong} of {n} accepted or in error, seed {seed}, {time.monotonic() - began:.0f} s")
    return bool(n_wrong)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
