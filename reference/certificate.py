"""Certificates: what proves an answer of this stepper, as plain data for a checker to re-prove.

Every number of a proof is dyadic and is written exactly, as "m*2^e"; the numbers of scene, state
and horizon are binary64 and stay numbers. A certificate holds nothing a checker must trust: which
walls have to be excluded, and how far, follows from scene and state. Undefined, undecided and
rejected outcomes have no certificate.
"""

from __future__ import annotations

import json
from itertools import zip_longest
from typing import Any

from mpmath.libmp import libmpf

from reference.arithmetic import Enclosure
from reference.isolation import Leaf
from reference.stepper import Collision, Horizon
from scene import Scene, State, to_data

VERSION = 1


def certificate(scene: Scene, state: State, t_end: float, outcome: Collision | Horizon) -> dict[str, Any]:
    """Write down what proves an outcome.

    Args:
        scene: table and laws of motion.
        state: position (x, y) [length], velocity (vx, vy) [length/time], wall being left or None.
        t_end: horizon [time].
        outcome: what `next_collision` answered to these.

    Returns:
        Plain data that JSON keeps to the bit: `scene`, `state` and `t_end` as given; `outcome`;
        `wall` and `dt` (the root interval [time]), None at a horizon; `after`, the enclosures of
        t, x, y, vx, vy after the bounce or at the horizon; `excluded`, for each wall its
        sub-intervals [start, end, kind] of flight time, in order. An enclosure is [lower, upper].
    """
    moment = outcome.after if isinstance(outcome, Collision) else outcome.at
    is_hit = isinstance(outcome, Collision)
    return {
        "certificate": VERSION,
        "scene": json.loads(json.dumps(to_data(scene))),  # lists for tuples
        "state": {name: getattr(state, name) for name in state.__struct_fields__},
        "t_end": t_end,
        "outcome": "collision" if is_hit else "horizon",
        "wall": outcome.wall if isinstance(outcome, Collision) else None,
        "dt": _ends(outcome.dt) if isinstance(outcome, Collision) else None,
        "after": {name: _ends(enclosure) for name, enclosure in moment._asdict().items()},
        "excluded": {wall: _stretches(leaves) for wall, leaves in outcome.proof.items()},
    }


def _ends(enclosure: Enclosure) -> list[str]:
    return [_dyadic(enclosure.lo._mpf_), _dyadic(enclosure.hi._mpf_)]


def _dyadic(raw: tuple[int, int, int, int]) -> str:
    sign, mantissa, exponent, _ = raw
    return f"{'-' if sign else ''}{int(mantissa)}*2^{int(exponent)}"


def _stretches(leaves: list[Leaf]) -> list[list[str]]:
    """Cut each sub-interval where the next begins: past a knot the law it was proved for has ended."""
    found = []
    for leaf, following in zip_longest(leaves, leaves[1:]):
        start, end = leaf.start._mpi_[0], leaf.end._mpi_[1]
        if following is not None and libmpf.mpf_lt(following.start._mpi_[0], end):
            end = following.start._mpi_[0]
        found.append([_dyadic(start), _dyadic(end), leaf.kind])
    return found
