"""The promise on what a table at rest conserves: speed and, in a half disk, spin, over hundreds of bounces.

A path passes as a vector when it is the exact path of a question off by `properties.BOUND`, and off by as
much itself. At rest every exact path keeps its speed for ever, and in a half disk the size of x vy - y vx,
which the arc leaves as it is and the base turns round. So however long a path is, neither may leave what it
was at the start by more than a few BOUND. Errors of single bounces do no harm as long as they do not all go
one way, as with a normal that is not quite a unit vector: a single answer hides what millions of bounces add
up. Over 400 bounces a loss of some 1e-11 at each is seen.

Each hit of a path must also lie on its wall, where the flight before leads by then, and turn the particle
round: who never moves keeps all speed. Nothing else ends a path, for these tables are closed and t_end is the
last of all times. Of a flow only what it arrives with is told, so its speed and spin are held, and neither
place nor time: `flow-arrivals` compares those with a path's.
"""

from __future__ import annotations

from math import hypot

from mpmath import fp

from conformance.properties import BOUND, SLACK
from conformance.suite.answers import read_outcome
from conformance.suite.process import Trouble
from conformance.suite.promises.questions import INSIDE, flown, follow_on, off_wall
from conformance.suite.session import Session, missing
from scene import Cap, Collision, Horizon, Mushroom, Outcome, Scene, State, Stem, Undecided, to_data
from scene.geometry import table_at

N_HITS, T_END = 400, 200.0  # of a path, and of a flow, which meets some hundreds
RESTING: tuple[Scene, ...] = (
    Cap(r=1.0),
    Stem(w=1.0, h=1.25, slope=0.1),
    Mushroom(r=1.0, w=0.5, h=1.0, slope=0.1),
)


def at_rest(session: Session) -> str:
    """Between walls at rest a particle keeps its speed, over many bounces too.

    Paths and flows are asked for in every table that is offered, each as far as it is offered.

    Raises:
        Trouble: fail for a speed or spin that is lost, in a path or at the end of a flow, and for a path that
            ends, or has a hit to which no flight leads; declined where nothing fails and a path ends
            undecided, or a flow; unsupported where nothing can be asked.
    """
    assert session.introduction is not None
    n_hits = n_flows = 0
    undecided = []
    for scene in RESTING:
        start, data = INSIDE[type(scene)], to_data(scene)
        if not all(missing(session.introduction, profile, data) for profile in ("step", "trajectory")):
            *path, last = follow_on(session, scene, start, N_HITS)
            if isinstance(last, Undecided):
                undecided.append(f"{data['table']}, hit {len(path) + 1} of a path: {last.reason}")
            else:
                path.append(last)
            _hold_path(scene, start, path)
            n_hits += len(path)
        if not missing(session.introduction, "flow", data):
            (found,) = flown(session, scene, [start], T_END)
            arrival = read_outcome({name: part for name, part in found.items() if name != "captured"}, 0.0)
            if isinstance(arrival, Undecided):
                undecided.append(f"{data['table']}, a flow: {arrival.reason}")
            else:
                _hold_kept(scene, start, arrival, "a flow")
                n_flows += 1
    if undecided:
        raise Trouble("declined", f"undecided: {undecided[0]}; {n_hits} hits, {n_flows} flows are kept")
    if not n_hits + n_flows:
        raise Trouble("unsupported", "no table is offered, or no laws that are constant")
    return f"{n_hits} hits, {n_flows} flows"


def _hold_path(scene: Scene, start: State, path: list[Outcome]) -> None:
    """Hold every hit of a path to the flight before, to its wall, and to what is kept."""
    before = start
    for number, hit in enumerate(path, 1):
        where = f"hit {number} of a path"
        if not isinstance(hit, Collision):
            raise Trouble("fail", f"{where} at rest is answered {hit}")
        _hold_kept(scene, start, hit, where)
        if flaw := _flaw(scene, before, hit):
            raise Trouble("fail", f"{where} at rest {flaw}: {hit} after {before}")
        before = hit.state()


def _flaw(scene: Scene, before: State, hit: Collision) -> str:
    """Say why no flight led to a hit; empty when one did. Times are right to a part of themselves."""
    if not (away := off_wall(scene, hit)) <= SLACK * BOUND:
        return f"is off its wall by {away:.3g} of the table's size"
    table, speed = table_at(fp, scene, hit.t), hypot(before.vx, before.vy)
    dt = hit.t - before.t
    off = hypot(hit.x - before.x - before.vx * dt, hit.y - before.y - before.vy * dt)
    if not off <= SLACK * BOUND * (float(table.size) + speed * abs(hit.t)):
        return f"is off the flight before by {off:.3g}"
    # Flights may vanish at corners, and then the time may seem to run back; but each comes to a wall.
    comes, leaves = (float(table.gap_rate(hit.wall, hit.x, hit.y, at.vx, at.vy)) for at in (before, hit))
    least = SLACK * BOUND * speed * (float(table.r) if hit.wall == "arc" else 1.0)
    return (
        "does not come from its wall's inside and go back there" if comes > least or leaves < -least else ""
    )


def _hold_kept(scene: Scene, start: State, found: Outcome, where: str) -> None:
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
