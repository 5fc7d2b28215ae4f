"""What every path is: each hit is on its wall, where the flight before leads, and turned round by it.

No answer is known beforehand. Each hit is held to the state that the implementation itself gave before it, so
a path of any length, in any scene, is checked. A flight must also stay within the table: at N_PARTS places on
the way, and at its end, it is beyond no wall, and it passes y = 0 in the mouth alone. So a hit that comes too
late is seen, and one of the wrong wall of two.

An implementation most of whose numbers are exact to rounding is held to FINE; one that looks for hits down to
a tolerance, as the vectors let pass, to COARSE.
"""

from collections.abc import Sequence
from math import hypot
from typing import Any

import numpy as np
from mpmath import fp

from conformance.plain.flow import CaptureInterval
from conformance.properties import BOUND, SLACK
from scene import Cap, Collision, Horizon, Mushroom, Outcome, Scene, State, Stem
from scene.geometry import half_width, table_at
from scene.laws import bounds, is_constant
from scene.tables import laws

FINE, COARSE = 2.0**-36, SLACK * BOUND  # of sizes
FLIGHT = 2.0**-48  # of sizes: a straight flight, of a stepper that is fine
LATE = 2.0**-50  # of t: what its last digits are
N_PARTS = 7  # places on the way
LEAST = 8  # numbers that tell how exact an implementation is
Errors = dict[str, list[float]]
UNCLEAR = (float("nan"), float("nan"))
ON_EDGE = 2.0**-28  # relative: nearer to the edge of capture rounding may decide


def is_fine(errors: Sequence[float], fine: float) -> bool:
    """Tell whether errors are rounding, as a rule; of few nothing is known."""
    return len(errors) >= LEAST and bool(np.quantile(errors, 0.7) <= fine / 4)


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
    if not np.isfinite(rows).all():
        return "has a number that is none"
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
    moving = (
        np.abs(table.r_rate) + np.abs(table.w_rate) + np.abs(table.h_rate) + np.abs(table.slope_rate) * size
    )
    late = LATE * np.maximum(np.abs(t0), np.abs(t))
    off_flight = np.hypot(x - x0 - vx0 * dt, y - y0 - vy0 * dt) / (size + speed * dt)
    f, steep, turn, away = 0.0 * t, 1.0 + 0.0 * t, 0.0 * t, 0.0 * t
    for wall in scene.walls:
        k = np.flatnonzero(walls == wall)
        at = table_at(fp, scene, t[k])
        f[k] = at.gap(wall, x[k], y[k])
        steep[k] = at.r if wall == "arc" else 1.0
        gx, gy = _gradient(scene, wall, at, x[k], y[k])
        rate, square = at.gap_rate(wall, x[k], y[k], vx0[k], vy0[k]), gx * gx + gy * gy
        kick = -2 * rate / square
        turn[k] = np.hypot(vx[k] - vx0[k] - kick * gx, vy[k] - vy0[k] - kick * gy)
        turn[k] /= speed[k] + np.abs(kick) * np.sqrt(square) + moving[k]
        away[k] = rate / np.sqrt(square) / (speed[k] + moving[k])
    # What a start is off its wall is taken out of f, so that the next hit of the same wall keeps it.
    now = table_at(fp, scene, start.t)
    first = 0.0 if start.wall is None else float(now.gap(start.wall, start.x, start.y))
    left, kept = np.append(start.wall or "", walls[:-1]), np.append(first, f[:-1])
    off_wall = np.abs(f - np.where(left == walls, kept, 0.0)) / steep / size
    straight = walls == ""
    turn[straight] = np.hypot(vx - vx0, vy - vy0)[straight] / np.maximum(speed, 1e-300)[straight]
    measured = {"place": off_wall, "bounce": turn, "flight": off_flight}
    for name, sizes in measured.items():
        errors.setdefault(name, []).extend(sizes[-LEAST:].tolist())
    is_exact = is_fine(errors["place"], FINE) and is_fine(errors["bounce"], FINE)
    place, flight = (FINE if is_exact else COARSE), (FLIGHT if is_fine(errors["flight"], FLIGHT) else COARSE)
    aside = 64 * (late + (0.0 if is_exact else COARSE) * np.abs(dt))  # of a time
    margin = place + aside * (speed + moving) / size
    # A wall that turns soon has another speed at a time that is rounded.
    known_laws = {name: bounds(law).curvature for name, law in laws(scene).items()}
    turning = sum(bend * (size if name in ("nu", "slope") else 1.0) for name, bend in known_laws.items())
    rounding = margin + aside * turning / (speed + moving)
    beyond = _beyond(scene, before, dt, walls, (x, y))
    beyond -= 2 * np.abs(kept) / np.append(now.r if start.wall == "arc" else 1.0, steep[:-1]) / size
    flaws = {
        "its time is not when the flight ends": np.abs(t - t0 - dt) > late / 2 + flight * np.abs(dt),
        "is off the flight before": off_flight > flight + 4 * late * speed / size,
        "is off its wall": off_wall > margin,
        "does not come from its wall's inside": away > rounding,
        "is not turned round by its wall": turn > 16 * rounding,
        "is beyond a wall, or was on the way": beyond > margin,
        "comes after nothing": dt < 0,
    }
    bad = {why: int(np.argmax(where)) for why, where in flaws.items() if where.any()}
    if not bad:
        return _not_kept(scene, start, after)
    why = min(bad, key=lambda name: bad[name])
    return f"outcome {bad[why] + 1} {why}"


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
        w = half_width(fp, scene, t0 + np.where(crosses, s, dt[:, None]))
        out = np.maximum(out, np.where(crosses, np.abs(x0 + vx0 * s) - w, -1.0))
        out = np.maximum(out, np.where(on_base, w - np.abs(x[:, -1:]), -1.0))
    return (out / table.size).max(axis=1)


def _not_kept(scene: Scene, start: State, after: Any) -> str:
    """Say what a table at rest does not keep: speed, and in a cap the size of the spin."""
    if not all(is_constant(law) for law in laws(scene).values()):
        return ""
    _, x, y, vx, vy = after
    speed = hypot(start.vx, start.vy)
    if (np.abs(np.hypot(vx, vy) - speed) > SLACK * BOUND * speed).any():
        return "has another speed than at the start, in a table at rest"
    spin = abs(start.x * start.vy - start.y * start.vx)
    allowed = SLACK * BOUND * float(table_at(fp, scene, start.t).size) * speed
    if isinstance(scene, Cap) and (np.abs(np.abs(x * vy - y * vx) - spin) > allowed).any():
        return "has another |x vy - y vx| than at the start, in a cap at rest"
    return ""


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
    stay = CaptureInterval()
    vx, vy = start.vx, start.vy
    for hit in hits:
        assert isinstance(hit, Collision)
        if hit.wall == "arc":
            reach = float(half_width(fp, scene, hit.t)) * hypot(vx, vy)
            spin = abs(hit.x * vy - hit.y * vx)
            if abs(spin - reach) <= ON_EDGE * reach:
                return UNCLEAR
            stay = stay.after(hit.t, spin > reach)
        elif hit.wall != "base" and stay.begin is not None:
            return stay.until(hit.t)
        vx, vy = hit.vx, hit.vy
    return stay.until(t_end)
