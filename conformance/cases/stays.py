"""Captured stays of a flow, by proof.

An arc hit of a mushroom is captured when |x vy - y vx| > w(t) |v|, with the time and place of the hit and
the velocity before the bounce (docs/protocol.md). Which hits begin and end a stay follows from two things
alone: the order of the walls met, and for each arc hit whether it is captured. The reference's path proves
the first; the signs of (x vy - y vx)^2 - w^2 v^2, certain over the enclosures of each hit, are the second:
neither side of the inequality is negative, so squares compare as they do. A hit whose sign is open makes
the question unfit. So all states within the enclosures have their stays between the same hits, and when
these happen is enclosed with the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Literal

import reference
from conformance.vectors import NUMBERS, Certified, Expectation, certified
from reference.arithmetic import Arithmetic, Interval, sign
from reference.walls import EnclosedFlight, MovingWalls
from scene import Mushroom, Scene, State

# An arc hit of a mushroom, captured or not; a hit of left, right or floor; or what changes nothing.
Mark = Literal["captured", "free", "out", ""]


class OpenSign(Exception):  # noqa: N818 (a finding about the question)
    """Whether an arc hit is captured is not certain over its enclosures."""


def marks(scene: Scene, steps: Sequence[reference.Collision]) -> list[Mark]:
    """Return what each collision of a proved path means for captured stays.

    Raises:
        OpenSign: an arc hit is neither proved captured nor proved not to be.
    """
    found: list[Mark] = []
    for step in steps:
        if step.wall in ("left", "right", "floor"):
            found.append("out")
        elif step.wall == "arc" and isinstance(scene, Mushroom):
            found.append("captured" if _is_captured(scene, step) else "free")
        else:
            found.append("")
    return found


def stays(found: Sequence[Mark]) -> tuple[tuple[int, int], ...]:
    """Return begin and end of each stay as places in a path whose horizon comes after its last mark.

    A stay begins with its first captured hit. It ends with the first arc hit after its last captured one, or
    where the particle meets a wall of the stem if that comes first, or at the horizon.
    """
    spans: list[tuple[int, int]] = []
    begin: int | None = None
    end: int | None = None
    for place, mark in enumerate([*found, "out"]):
        if mark == "captured":
            begin, end = place if begin is None else begin, None
        elif mark == "free" and end is None:
            end = place
        elif mark == "out":
            if begin is not None:
                spans.append((begin, place if end is None else end))
            begin = end = None
    return tuple(spans)


def arrival(steps: Sequence[Certified], spans: Sequence[tuple[int, int]]) -> Expectation:
    """Return a flow's answer: of its path the hits that begin or end a stay, and the horizon.

    That is all that is asked. Each keeps its enclosures; dt is counted from the one kept before, and what
    may move it is the sum over the flights between.
    """
    kept = sorted({place for span in spans for place in span} | {len(steps) - 1})
    thinned = []
    for before, place in zip([-1, *kept], kept, strict=False):
        flown, last = steps[before + 1 : place + 1], steps[place]
        low, high = (sum(sides) for sides in zip(*(step.ends("dt") for step in flown), strict=True))
        numbers = {name: last.ends(name) for name in NUMBERS} | {"dt": (low, high)}
        allowance = [sum(step.allowance[0] for step in flown), *last.allowance[1:]]
        thinned.append(certified(numbers, allowance, last.wall))
    places = tuple((kept.index(begin), kept.index(end)) for begin, end in spans)
    return Expectation("horizon", tuple(thinned), stays=places)


def timing_condition(expected: Expectation, state: State) -> float:
    """Return the condition number of the times at which a flow's stays begin and end, the largest."""
    t, allowance, worst = state.t, abs(state.t), 0.0
    for step in expected.steps[:-1]:
        t, allowance = t + float(step.centre("dt")), allowance + step.allowance[0]
        worst = max(worst, allowance / abs(t) if t else inf)
    return worst


def _is_captured(scene: Mushroom, step: reference.Collision) -> bool:
    """Tell whether |x vy - y vx| > w |v|; the left side is the same all along the flight."""
    arithmetic, departure = Arithmetic(step.digits), step.departure

    def interval(enclosure: reference.Enclosure) -> Interval:
        return arithmetic.hull(*(arithmetic.point(end._mpf_) for end in enclosure))

    x, y, vx, vy = (interval(getattr(departure, name)) for name in ("x", "y", "vx", "vy"))
    flight = EnclosedFlight(departure.instant, x, y, vx, vy, interval(departure.begin))
    width = MovingWalls(arithmetic, scene, flight).width(interval(step.root)).f
    spin = arithmetic.square(x * vy - y * vx)
    found = sign(spin - arithmetic.square(width) * (arithmetic.square(vx) + arithmetic.square(vy)))
    if not found:
        raise OpenSign
    return found > 0
