"""One judge for hits, paths and flows, which needs no certified answer.

`follow` holds each hit to the state that the implementation itself gave before it: it is on its wall, where
the flight before leads, and turned round by it. A flight must also stay within the table: at N_PARTS places
on the way, and at its end, it is beyond no wall, and it passes y = 0 in the mouth alone. So a hit that comes
too late is seen, and one of the wrong wall of two. A flow is held to the path of the same particle: its
arrival, and its capture interval.

An implementation most of whose numbers are exact to rounding is held to FINE; one that looks for hits down to
a tolerance, as the vectors let pass, to COARSE.
"""

import math
from collections.abc import Mapping, Sequence
from math import hypot
from typing import Any

import numpy as np
from mpmath import fp

from conformance import plain
from conformance.properties import BOUND, SLACK
from conformance.suite.checks.form import FOREVER, Implementation
from conformance.suite.session import read_outcome
from scene import (
    Cap,
    Collision,
    Horizon,
    Mushroom,
    Outcome,
    Scene,
    State,
    Stem,
    Undecided,
)
from scene.geometry import table_at

FINE, COARSE = 2.0**-36, SLACK * BOUND  # of sizes
FLIGHT = 2.0**-48  # of sizes: a straight flight, of a stepper that is fine
LATE = 2.0**-50  # of t: what its last digits are
N_PARTS = 7  # places on the way
LEAST = 8  # numbers that tell how exact an implementation is
Errors = dict[str, list[float]]
UNCLEAR = (float("nan"), float("nan"))
ON_EDGE = 2.0**-28  # relative: nearer to the edge of capture rounding may decide
CARRIED = 2.0**-13  # of sizes: what bounces may make of rounding at most


def is_fine(errors: Sequence[float], fine: float) -> bool:
    """Tell whether errors are rounding, as a rule; of few nothing is known."""
    return len(errors) >= LEAST and bool(np.mean(np.asarray(errors) <= fine / 4) > 0.7)


def flaw_of(scene: Scene, start: State, path: Sequence[Outcome], errors: Errors) -> str:
    """Say what is wrong with the first hit, or horizon, to which no flight led; empty where all may be.

    Args:
        scene: of the path.
        start: of the path.
        path: its outcomes; only collisions and a horizon are looked at.
        errors: of the same implementation so far; those of this path are added.
    """
    ends = [at for at in path if isinstance(at, Collision | Horizon)]
    if not ends:
        return ""
    rows = np.array([[at.t, at.x, at.y, at.vx, at.vy] for at in (start, *ends)], dtype=float)
    before, after = rows[:-1].T, rows[1:].T
    dt = np.array([getattr(at, "dt", at.t - t) for at, t in zip(ends, rows[:-1, 0], strict=True)])
    walls = np.array([getattr(at, "wall", "") for at in ends])
    with np.errstate(all="ignore"):
        return _first_flaw(scene, start, before, after, dt, walls, errors)


def _first_flaw(
    scene: Scene, start: State, before: Any, after: Any, dt: Any, walls: Any, errors: Errors
) -> str:
    t0, x0, y0, vx0, vy0 = before
    t, x, y, vx, vy = after
    table = table_at(fp, scene, t)
    size = table.size + 0.0 * t
    speed = np.hypot(vx0, vy0)
    moving = (table.r_rate, table.w_rate, table.h_rate, table.slope_rate * size)
    pace = speed + sum(map(np.abs, moving))
    late = LATE * np.maximum(np.abs(t0), np.abs(t))
    off_flight = np.hypot(x - x0 - vx0 * dt, y - y0 - vy0 * dt) / (size + speed * dt)
    f, steep, turn, away = _meet_walls(scene, before, after, walls, pace)
    # What a start is off its wall is taken out of f, so that the next hit of the same wall keeps it.
    now = table_at(fp, scene, start.t)
    first = 0.0 if start.wall is None else float(now.gap(start.wall, start.x, start.y))
    left, kept = np.append(start.wall or "", walls[:-1]), np.append(first, f[:-1])
    off_wall = np.abs(f - np.where(left == walls, kept, 0.0)) / steep / size
    turn = np.where(walls == "", np.hypot(vx - vx0, vy - vy0) / np.maximum(speed, 1e-300), turn)
    for name, sizes in (("place", off_wall), ("bounce", turn), ("flight", off_flight)):
        errors.setdefault(name, []).extend(sizes[-LEAST:].tolist())
    is_exact = is_fine(errors["place"], FINE) and is_fine(errors["bounce"], FINE)
    place, flight = (FINE if is_exact else COARSE), (FLIGHT if is_fine(errors["flight"], FLIGHT) else COARSE)
    aside = 64 * (late + (0.0 if is_exact else COARSE) * np.abs(dt))  # of a time
    margin = place + aside * pace / size
    # A wall that turns soon has another speed at a time that is rounded.
    turning = sum(
        law.bounds().curvature * (size if name in ("nu", "slope") else 1.0)
        for name, law in scene.laws.items()
    )
    rounding = margin + aside * turning / pace
    off_before = np.abs(kept) / np.append(now.r if start.wall == "arc" else 1.0, steep[:-1]) / size
    is_at_rest = scene.cycle is None
    gained = is_at_rest * np.abs(np.hypot(vx, vy) / hypot(start.vx, start.vy) - 1.0)
    spin = np.abs(np.abs(x * vy - y * vx) - abs(start.x * start.vy - start.y * start.vx))
    flaws = {
        "its time is not when the flight ends": np.abs(t - t0 - dt) > late / 2 + flight * np.abs(dt),
        "is off the flight before": off_flight > flight + 4 * late * speed / size,
        "is off its wall": off_wall > margin,
        "does not come from its wall's inside": away > rounding,
        "is not turned round by its wall": turn > 16 * rounding,
        "is beyond a wall, or was on the way": _beyond(scene, before, dt, walls, (x, y))
        > margin + 2 * off_before,
        "comes after nothing": dt < 0,
        "has another speed than at the start, in a table at rest": gained > SLACK * BOUND,
        "has another |x vy - y vx| than at the start, in a cap at rest": is_at_rest
        * isinstance(scene, Cap)
        * (spin > SLACK * BOUND * size * hypot(start.vx, start.vy)),
    }
    bad = {why: int(np.argmax(where)) for why, where in flaws.items() if where.any()}
    if not bad:
        return ""
    why = min(bad, key=lambda name: bad[name])
    return f"outcome {bad[why] + 1} {why}"


def _meet_walls(scene: Scene, before: Any, after: Any, walls: Any, pace: Any) -> tuple[Any, Any, Any, Any]:
    """Return f of each hit's wall, its scale, how far the bounce is off, and how fast f grows on arrival."""
    _, _, _, vx0, vy0 = before
    t, x, y, vx, vy = after
    f, steep, turn, away = 0.0 * t, 1.0 + 0.0 * t, 0.0 * t, 0.0 * t
    for wall in set(scene.walls).intersection(walls):
        k = np.flatnonzero(walls == wall)
        at = table_at(fp, scene, t[k])
        f[k] = at.gap(wall, x[k], y[k])
        steep[k] = at.r if wall == "arc" else 1.0
        gx, gy = _gradient(scene, wall, at, x[k], y[k])
        rate, square = at.gap_rate(wall, x[k], y[k], vx0[k], vy0[k]), gx * gx + gy * gy
        kick = -2 * rate / square
        turn[k] = np.hypot(vx[k] - vx0[k] - kick * gx, vy[k] - vy0[k] - kick * gy)
        turn[k] /= pace[k] + np.abs(kick) * np.sqrt(square)
        away[k] = rate / np.sqrt(square) / pace[k]
    return f, steep, turn, away


def _gradient(scene: Scene, wall: str, table: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return the gradient of a wall's f."""
    if wall == "arc":
        return -2 * x, -2 * y
    if wall in ("base", "floor"):
        return 0.0, -1.0 if wall == "base" and isinstance(scene, Stem) else 1.0
    return (1.0 if wall == "left" else -1.0), table.slope


def _beyond(scene: Scene, before: Any, dt: Any, walls: Any, end: tuple[Any, Any]) -> Any:
    """Return how far flights were beyond a wall, as parts of the table's size; 0 or less for inside."""
    t0, x0, y0, vx0, vy0 = (column[:, None] for column in before)
    part = np.append((np.arange(N_PARTS) + 0.5) / (N_PARTS + 0.5), 1.0)
    s = part * dt[:, None]
    x, y = x0 + vx0 * s, y0 + vy0 * s
    x[:, -1], y[:, -1] = end
    table = table_at(fp, scene, t0 + s)
    # At an end y is 0 but for rounding; which part of the table it belongs to follows from the flight before.
    is_above = np.where(np.abs(y) > FINE * table.size, y > 0, y0 + vy0 * s / 2 > 0)
    above = np.maximum((x * x + y * y - table.r * table.r) / np.where(is_above, table.r, 1.0), -y)
    below = np.maximum(np.maximum(np.abs(x) - table.half_width(y), -table.h - y), y)
    out = (
        above
        if isinstance(scene, Cap)
        else below
        if isinstance(scene, Stem)
        else np.where(is_above, above, below)
    )
    if isinstance(scene, Mushroom):
        on_base = (walls == "base")[:, None]
        s = np.where(vy0 != 0, -y0 / np.where(vy0 != 0, vy0, 1.0), -1.0)
        crosses = (s > 0) & (s < dt[:, None]) & (y0 != 0) & ~on_base
        w = scene.width.value(fp, t0 + np.where(crosses, s, dt[:, None]))
        out = np.maximum(out, np.where(crosses, np.abs(x0 + vx0 * s) - w, -1.0))
        out = np.maximum(out, np.where(on_base, w - np.abs(x[:, -1:]), -1.0))
    return (out / table.size).max(axis=1)


def first_capture(
    scene: Mushroom, start: State, hits: Sequence[Outcome], t_end: float
) -> tuple[float, float] | None:
    """Return the first capture interval of a path, by docs/protocol.md; UNCLEAR where rounding decides.

    Args:
        scene: a mushroom.
        start: of the path.
        hits: its collisions up to t_end.
        t_end: [time].
    """
    path = plain.PlainPath(scene, start, t_end)
    for hit in hits:
        assert isinstance(hit, Collision)
        vx, vy = path.state.vx, path.state.vy
        reach = float(scene.width.value(fp, hit.t)) * hypot(vx, vy)
        spin = abs(hit.x * vy - hit.y * vx)
        if hit.wall == "arc" and not path.stays and abs(spin - reach) <= ON_EDGE * reach:
            return UNCLEAR
        path.watch(hit)
        path.state = hit.state()
    path.close(t_end)
    return path.stays[0] if path.stays else None


def follow(side: Implementation, scene: Scene, state: State, n: int, t_end: float = FOREVER) -> bool:
    """Hold the hits that follow a state to the flights before, and a flow to them."""
    walker = side.by("trajectory", "step", scene=scene) if side.profile == "flow" else side
    path = walker.path(scene, state, n, t_end)
    decided = [hit for hit in path if not isinstance(hit, Undecided)]
    for outcome in decided[:1]:
        assert isinstance(outcome, Collision | Horizon), f"{state} in {scene}: {outcome}"
    if flaw := flaw_of(scene, state, decided, side.errors):
        number = int(flaw.split()[1]) - 1
        before = decided[number - 1] if number else state
        raise AssertionError(f"{flaw}: {decided[number]}, after {before}, in {scene}")
    if side.profile == "flow" and len(decided) == len(path):
        return _arrives(side, walker, scene, state, path)
    return bool(decided)


def _arrives(
    side: Implementation, walker: Implementation, scene: Scene, state: State, path: list[Outcome]
) -> bool:
    """Compare a flow with a path: to the middle of its last flight, or to its horizon."""
    *hits, last = path
    if isinstance(last, Collision):
        t_end = last.t - last.dt / 2
        before = hits[-1].state() if hits else state  # type: ignore[union-attr]
        if not before.t < t_end < last.t:
            return False
        end = walker(scene, before, t_end)
    else:
        t_end, end = getattr(last, "t", state.t), last
    side.require_time("hits of a flow", len(hits))
    (found,) = side.flown(scene, [state], t_end)
    side.keep_pace("hits of a flow", len(hits))
    arrival = read_outcome(found)
    if isinstance(arrival, Undecided) or not isinstance(end, Horizon):
        return False
    # A bounce makes 4 times as much of an error, as a rule; a path of many hits is regular.
    fine = all(is_fine(side.errors.get(name, ()), FINE) for name in ("place", "bounce"))
    late = LATE * abs(end.t) / crossing(scene, State(end.t, end.x, end.y, end.vx, end.vy))
    grown = ((FINE if fine else COARSE) + 64 * late) * 4.0 ** min(len(hits), 16)
    assert distance(scene, arrival, end) <= min(grown, CARRIED), (
        f"{state}: {arrival} by flow, {end} by its path, in {scene}"
    )
    if isinstance(scene, Mushroom) and (stay := first_capture(scene, state, hits, t_end)) is not UNCLEAR:
        answered = found.get("captured")
        assert is_same_capture(answered, stay, t_end - state.t), (
            f"{state}: captured = {answered}, must be {stay}, in {scene}"
        )
    return True


def distance(scene: Scene, a: Outcome, b: Outcome) -> float:
    """Return how far two outcomes are apart: the worst of time, place and velocity, each by its size.

    Infinite for different outcomes or walls. Sizes are those of b, and for the place that of the table.
    """
    if type(a) is not type(b) or getattr(a, "wall", None) != getattr(b, "wall", None):
        return math.inf
    if not (isinstance(a, Collision | Horizon) and isinstance(b, Collision | Horizon)):
        return 0.0
    size = float(table_at(fp, scene, b.t).size)
    parts = (
        (abs(a.t - b.t), abs(b.t)),
        (math.hypot(a.x - b.x, a.y - b.y), size),
        (math.hypot(a.vx - b.vx, a.vy - b.vy), math.hypot(b.vx, b.vy)),
    )
    found = max(gap / extent if extent else (math.inf if gap else 0.0) for gap, extent in parts)
    return math.inf if math.isnan(found) else found


def answered_distance(
    scene: Scene, one: Mapping[str, Any], other: Mapping[str, Any], t: float, span: float = math.inf
) -> float:
    """Return how far two answered outcomes are apart, as `distance`; infinite for other capture intervals.

    Args:
        scene: of both.
        one: an outcome as it is answered.
        other: likewise.
        t: when the flight began.
        span: of time, by which capture intervals are measured.
    """
    if not is_same_capture(one.get("captured"), other.get("captured"), span):
        return math.inf
    return distance(scene, read_outcome(one, t), read_outcome(other, t))


def is_same_capture(a: Sequence[float] | None, b: Sequence[float] | None, span: float) -> bool:
    """Tell whether two capture intervals of one particle are equal up to amplified rounding."""
    if a is None or b is None:
        return a is b
    return all(abs(one - other) <= CARRIED * span for one, other in zip(a, b, strict=True))


def crossing(scene: Scene, state: State) -> float:
    """Return the time that a particle takes across its table."""
    return float(table_at(fp, scene, state.t).size) / math.hypot(state.vx, state.vy)
