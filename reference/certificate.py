"""Certificates: what proves an answer of this stepper, as plain data for a checker to re-prove.

Every number of a proof is dyadic and is written exactly, as "m*2^e", but the instant of an undefined
outcome, a rational "p/q"; the numbers of scene, state and horizon are binary64 and stay numbers. A
certificate holds nothing a checker must trust: which walls have to be excluded, and how far,
follows from scene and state. Undecided and rejected outcomes claim nothing and have none.
"""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import zip_longest
from typing import Any

from mpmath.libmp import libmpf

from reference.answers import Departure, ProvedCollision, ProvedHorizon, Trajectory
from reference.arithmetic import Enclosure
from reference.course import UndefinedProof
from reference.isolation import Leaf
from reference.step import proof_of_undefined
from scene import BadInput, Scene, State, Undefined, check_scene, to_data
from scene.refusal import shown

VERSION = 2


def certificate(
    scene: Scene, state: State, t_end: float, outcome: ProvedCollision | ProvedHorizon | Undefined
) -> dict[str, Any]:
    """Write down what proves an outcome of `next_collision`.

    Args:
        scene: table and laws of motion.
        state: position (x, y) [length], velocity (vx, vy) [length/time], wall being left or None.
        t_end: horizon [time].
        outcome: what `next_collision` answered to these.

    Returns:
        Plain data that JSON keeps to the bit: `scene`, `state` and `t_end` as given; `outcome`; and
        what `_claim` or `_undefined` adds.

    Raises:
        BadInput: `outcome` has no proof, or is undefined and not the answer to these.
    """
    question = _question(scene, state, t_end)
    if not isinstance(outcome, ProvedCollision | ProvedHorizon | Undefined):
        raise BadInput(
            f"outcome = {shown(outcome)}, must be a proved collision, horizon or undefined outcome"
        )
    if isinstance(outcome, Undefined):
        return question | _undefined(outcome, proof_of_undefined(scene, state, t_end))
    return question | _claim(outcome)


def path_certificate(scene: Scene, state: State, t_end: float | None, path: Trajectory) -> dict[str, Any]:
    """Write down what proves a trajectory: `steps`, each with its `departure`.

    A departure is the exact `instant`, enclosures of x, y, vx, vy there and of the flight time at
    which the flight begins, and the `residuals` of the wall being left. Undecided ends claim nothing.

    Raises:
        BadInput: `path` is none, or ends undefined and does not follow from these.
    """
    if not isinstance(path, Trajectory):
        raise BadInput(f"path = {shown(path)}, must be a Trajectory of the reference")
    steps = [_claim(step) | {"departure": _departure(step.departure)} for step in path.steps]
    if isinstance(path.outcome, ProvedHorizon) and t_end is not None:
        steps.append(_claim(path.outcome) | {"departure": _departure(path.outcome.departure)})
    if isinstance(path.outcome, Undefined):
        if t_end is None:
            raise BadInput("t_end = None, must be a time after the undefined instant")
        steps.append(_undefined(path.outcome, proof_of_undefined(scene, state, t_end)))
    return _question(scene, state, t_end) | {"steps": steps}


def _question(scene: Scene, state: State, t_end: float | None) -> dict[str, Any]:
    check_scene(scene)
    if not isinstance(state, State):
        raise BadInput(f"state = {shown(state)}, must be a State")
    return {
        "certificate": VERSION,
        "scene": json.loads(json.dumps(to_data(scene))),  # lists for tuples
        "state": {name: getattr(state, name) for name in state.__struct_fields__},
        "t_end": t_end,
    }


def _claim(outcome: ProvedCollision | ProvedHorizon) -> dict[str, Any]:
    """Return the claim of one flight.

    `wall`, `dt` (flight time [time]) and `root` (the same from the departure's instant), None at a horizon;
    `after`, the enclosures of t, x, y, vx, vy after the bounce or at the horizon; `excluded`, for
    each wall its sub-intervals [start, end, kind] of flight time, in order. An enclosure is
    [lower, upper].
    """
    hit = outcome if isinstance(outcome, ProvedCollision) else None
    moment = outcome.after if isinstance(outcome, ProvedCollision) else outcome.at
    return {
        "outcome": "collision" if hit else "horizon",
        "wall": hit.wall if hit else None,
        "dt": _ends(hit.dt) if hit else None,
        "root": _ends(hit.root) if hit else None,
        "after": {name: _ends(enclosure) for name, enclosure in moment._asdict().items()},
        "excluded": {wall: _stretches(leaves) for wall, leaves in outcome.proof.items()},
    }


def _undefined(outcome: Undefined, proof: UndefinedProof) -> dict[str, Any]:
    """Return the claim that a flight ends nowhere.

    `reason`; `instant`, the flight time at which it ends (0/1: at the start; None: at the root of a wall);
    `walls` met together then; `roots`, an interval around the first root of each that is searched
    for; `excluded` as for a collision.
    """
    instant = proof.instant
    roots = {wall: _interval(time) for wall, time in proof.roots.items()}
    return {
        "outcome": "undefined",
        "reason": outcome.reason,
        "instant": None if instant is None else f"{instant.numerator}/{instant.denominator}",
        "walls": list(proof.walls),
        "roots": roots,
        "excluded": {wall: _stretches(leaves) for wall, leaves in proof.excluded.items()},
    }


def _departure(departure: Departure) -> dict[str, Any]:
    numbers = {name: _ends(getattr(departure, name)) for name in ("x", "y", "vx", "vy", "begin")}
    residuals = {wall: _ends(f) for wall, f in departure.residuals.items()}
    return {"instant": _rational(departure.instant), **numbers, "residuals": residuals}


def _rational(number: Fraction) -> str:
    """Write an exact instant, whose denominator is a power of two."""
    return f"{number.numerator}*2^{1 - number.denominator.bit_length()}"


def _interval(interval: Any) -> list[str]:
    return [_dyadic(end) for end in interval._mpi_]


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
