"""A trajectory of the reference, proved again in Arb: each step for every state it may start from.

The first step starts from the exact state. After a collision the certificate describes the next flight at an
exact instant, by a box of places and velocities there and by the flight times between which the flight
begins. It is proved here that the box holds every state which the step before may lead to, that
the residual of the wall left is the one that the step before took out, and then, for all of the
box at once, which wall is met first. Time is exact, so every piece of a law that an enclosed time may
touch is known, knots included.
"""

from __future__ import annotations

from typing import Any

from flint import arb, fmpq

from conformance.arb.flight import Line
from conformance.arb.numbers import ZERO, Number, dyadic, exact, hull, interval
from conformance.second_proof.exclusion import Refuted
from conformance.second_proof.signs import SignedFlight, flight_from
from conformance.second_proof.step import StepProof, opened
from conformance.second_proof.undefined import check_undefined
from scene import Wall

BOX = ("x", "y", "vx", "vy")
Begin = tuple[fmpq, fmpq]


def check_path(certificate: dict[str, Any]) -> None:
    """Prove a trajectory's certificate again.

    Args:
        certificate: the plain data of `reference.certificate.path_certificate`.

    Raises:
        Refuted: naming the step and what does not hold.
    """
    with opened(certificate) as scene:
        flight = flight_from(scene, certificate["state"])
        begin: Begin = (ZERO, ZERO)
        t_end = None if certificate["t_end"] is None else exact(certificate["t_end"])
        for number, claim in enumerate(certificate["steps"], 1):
            try:
                end = None if t_end is None else t_end - flight.line.t
                if claim["outcome"] == "undefined":
                    if number > 1 or end is None:
                        raise Refuted("only the first step can be undefined, before a horizon")
                    check_undefined(flight, claim, end)
                    _require_last(certificate, number)
                    return
                step = StepProof(flight, begin, claim, end, is_exact=number == 1)
                root = step.check()
                if root is None:
                    _require_last(certificate, number)
                    return
                if number < len(certificate["steps"]):
                    flight, begin = _next(step, root, certificate["steps"][number])
            except Refuted as reason:
                raise Refuted(f"step {number}: {reason}") from None


def _require_last(certificate: dict[str, Any], number: int) -> None:
    if number != len(certificate["steps"]):
        raise Refuted("a path goes on where it has ended")


def _next(step: StepProof, root: Begin, claim: dict[str, Any]) -> tuple[SignedFlight, Begin]:
    """Return the flight after a collision, shown to hold all that the collision may lead to."""
    assert step.wall is not None
    old, s = step.flight.line, hull(*root)
    departure = claim["departure"]
    instant = dyadic(departure["instant"])
    near = instant - old.t
    _, _, y, vx, vy = step.moment(*root)
    back: Number = near - s  # from the collision to the instant
    truth = {"x": _carried(old.x, old.vx, vx, near, s), "vx": vx, "vy": vy}
    truth["y"] = y + vy * back if step.wall == "base" else _carried(old.y, old.vy, vy, near, s)
    box = []
    for name in BOX:
        low, high = interval(departure[name])
        if not (arb(low) <= truth[name] and truth[name] <= arb(high)):
            raise Refuted(f"the next step's {name} does not hold where this one leads")
        box.append(low if low == high else hull(low, high))
    begin = interval(departure["begin"])
    if not (begin[0] <= root[0] - near and root[1] - near <= begin[1]):
        raise Refuted("the next step does not begin where this one ends")
    residuals = _residuals(step.flight, step.wall, departure["residuals"])
    return SignedFlight(step.flight.table, Line(instant, *box), step.wall, residuals), begin


def _carried(place: Number, speed: Number, later: Number, near: fmpq, s: Number) -> Number:
    """Return where the new line of flight is at the instant, by way of the old one: no cancellation."""
    return place + speed * near + (speed - later) * (s - near)


def _residuals(old: SignedFlight, wall: Wall, claimed: dict[str, Any]) -> dict[Wall, Number]:
    """Return the residual of the wall just met, as it is known here: what was taken out before, or 0."""
    if set(claimed) != {wall}:
        raise Refuted("the next step does not leave the wall that was met")
    truth = old.residuals.get(wall, ZERO)
    if not arb(truth).overlaps(hull(*interval(claimed[wall]))):
        raise Refuted("the residual of the wall met is not carried on")
    return {} if wall == "base" else {wall: truth}
