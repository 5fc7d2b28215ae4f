"""The promise on what a table at rest conserves: speed and, in a half disk, spin, over hundreds of bounces.

A path passes as a vector when it is the exact path of a question off by `properties.BOUND`, and off by as
much itself. At rest every exact path keeps its speed for ever, and in a half disk the size of x vy - y vx,
which the arc leaves as it is and the base turns round. So however long a path is, neither may leave what it
was at the start by more than a few BOUND. Errors of single bounces do no harm as long as they do not all go
one way, as with a normal that is not quite a unit vector: a single answer hides what millions of bounces add
up.
"""

from __future__ import annotations

from math import hypot

from conformance.properties import BOUND, SLACK
from conformance.suite.answers import read_outcome
from conformance.suite.process import Trouble
from conformance.suite.questions import INSIDE, flown, follow
from conformance.suite.session import Session, missing
from scene import Cap, Collision, Horizon, Mushroom, Outcome, Scene, State, Stem, Undecided, to_data

N_HITS, T_END = 400, 200.0  # of a path, and of a flow, which meets some hundreds
RESTING: tuple[Scene, ...] = (
    Cap(r=1.0),
    Stem(w=1.0, h=1.25, slope=0.1),
    Mushroom(r=1.0, w=0.5, h=1.0, slope=0.1),
)


def at_rest(session: Session) -> str:
    """Between walls at rest a particle keeps its speed, over many bounces too.

    Raises:
        Trouble: fail for a speed or spin that is lost; declined where a path ends undecided.
    """
    assert session.introduction is not None
    n_hits = n_flows = 0
    for scene in RESTING:
        start, data = INSIDE[type(scene)], to_data(scene)
        if not all(missing(session.introduction, profile, data) for profile in ("step", "trajectory")):
            path = follow(session, scene, start, N_HITS)
            for number, hit in enumerate(path, 1):
                _hold(scene, start, hit, f"hit {number} of a path")
            n_hits += len(path)
        if not missing(session.introduction, "flow", data):
            (found,) = flown(session, scene, [start], T_END)
            arrival = read_outcome({name: part for name, part in found.items() if name != "captured"}, 0.0)
            if not isinstance(arrival, Undecided):
                _hold(scene, start, arrival, "a flow")
                n_flows += 1
    if not n_hits + n_flows:
        raise Trouble("unsupported", "no table is offered, or no laws that are constant")
    return f"{n_hits} hits, {n_flows} flows"


def _hold(scene: Scene, start: State, found: Outcome, where: str) -> None:
    """Hold speed, and in a cap the size of the spin, to those at the start."""
    if not isinstance(found, Collision | Horizon):
        raise Trouble("fail", f"{where} at rest is answered {found}")
    speed, after = hypot(start.vx, start.vy), hypot(found.vx, found.vy)
    if not abs(after - speed) <= SLACK * BOUND * speed:
        raise Trouble("fail", f"{where} at rest: speed {speed!r} has become {after!r}")
    if not isinstance(scene, Cap):
        return
    assert isinstance(scene.r, float)
    spin, after = (abs(at.x * at.vy - at.y * at.vx) for at in (start, found))
    if not abs(after - spin) <= SLACK * BOUND * scene.r * speed:
        raise Trouble("fail", f"{where} at rest: |x vy - y vx| = {spin!r} has become {after!r}")
