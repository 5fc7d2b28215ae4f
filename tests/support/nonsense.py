"""An implementation whose answers are nonsense of the right seq, now and then: no process, for many seeds.

`Nonsense` stands in for `conformance.suite.process.Process`. The fast stepper answers, and a share of its
answers is spoilt: numbers, walls, whole parts changed, or an answer to another command, or an error. Lines
stay lines of JSON: what is no JSON, or no line, is the saboteurs' business.
"""

from __future__ import annotations

import io
import json
import random
from typing import Any

import fast.__main__ as server
from conformance.suite.process import Trouble
from fast import next_collision
from scene.protocol.wire import serve
from support import fuzz

HUGE = (1e154, -1e200, 1e308, -1e308, 5e-324, 0.0, 2**62)


class Nonsense:
    """A process that answers at once, in part nonsense.

    Args:
        draw: decides what is spoilt, and how.
        share: of the answers that are.
    """

    def __init__(self, draw: random.Random, share: float) -> None:
        self.draw, self.share = draw, share

    def exchange(self, line: bytes, _: float) -> bytes:
        """Answer one line."""
        out = io.BytesIO()
        serve("n", next_collision, server.follow, [line], out, flow=server.carry, timer=server.clock)
        data = json.loads(out.getvalue())
        if "profiles" in data and self.draw.random() < 0.9:
            return out.getvalue()
        if self.draw.random() < self.share:
            data = {"seq": data.get("seq"), **self.spoilt(data)}
        return json.dumps(data).encode()

    def spoilt(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return a spoilt answer, without its seq."""
        data.pop("seq", None)
        how = self.draw.random()
        if how < 0.1:
            return {"error": "no\x07"}
        if how < 0.2:
            data = fuzz.answers(self.draw)
        elif how < 0.6:
            numbers = [path for path in fuzz.places(data) if type(fuzz.at(data, path)) is float]
            for path in self.draw.sample(numbers, min(len(numbers), self.draw.choice((1, 1, 2, 10)))):
                old = fuzz.at(data, path)
                new = self.draw.choice((*HUGE, *fuzz.NUMBERS, *(old * f for f in fuzz.FACTORS)))
                fuzz.at(data, path[:-1])[path[-1]] = new
        else:
            data = fuzz.spoil(self.draw, data)
        return data if isinstance(data, dict) and "seq" not in data else {"outcome": data}

    def finish(self, _line: bytes, _timeout: float) -> None:
        """End, or not."""
        if self.draw.random() < self.share:
            raise Trouble("timed-out", "still running")

    def kill(self) -> None:
        """Go."""
