"""Mutants that miss a hit, find one where there is none, or decide wrongly which is the first."""

from collections.abc import Iterator, Sequence

from conformance.mutants.mutant import COMMON, Plain, mutant
from conformance.mutants.walls import UPRIGHT, Heedless, Trusting
from conformance.plain.step import Flight
from scene import Outcome, Scene, State, Wall

Root = float | None
Hit = tuple[Wall, float] | None


@mutant(Flight, "bend")
def curvature_of_flight_forgotten(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Leaves v^2 out of the bound on f'' of the arc."""
    return plain(wall) - (2 * (flight.vx**2 + flight.vy**2) if wall == "arc" else 0.0)


@mutant(Flight, "bend")
def curvature_of_radius_forgotten(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Leaves r r'' out of the bound on f'' of the arc."""
    r = flight.bounds.get("r")
    return plain(wall) - (2 * r.highest * r.curvature if r and wall == "arc" else 0.0)


@mutant(Flight, "bend")
def curvature_of_floor_forgotten(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Takes the floor to move at constant velocity where it excludes earlier hits."""
    return 0.0 if wall == "floor" else plain(wall)


@mutant(Flight, "bend")
def curvature_of_side_without_product(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Leaves 2 nu' r' out of the bound on f'' of a side."""
    if wall not in UPRIGHT or "nu" not in flight.bounds:
        return plain(wall)
    return plain(wall) - 2 * flight.bounds["nu"].slope * flight.bounds["r"].slope


@mutant(Flight, "bend")
def curvature_of_hole_forgotten(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Leaves w'', or nu'' r, out of the bound on f'' of a side."""
    if wall not in UPRIGHT:
        return plain(wall)
    b = flight.bounds
    return plain(wall) - (b["w"].curvature if "w" in b else b["nu"].curvature * b["r"].highest)


@mutant(Flight, "bend")
def curvature_of_tilt_without_flight(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Leaves 2 slope' vy out of the bound on f'' of a side."""
    return plain(wall) - (2 * flight.bounds["slope"].slope * abs(flight.vy) if wall in UPRIGHT else 0.0)


@mutant(Flight, "bend")
def curvature_of_tilt_at_departure(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Bounds f'' of a tilting side by the depth of departure, though the flight goes deeper."""
    deeper = abs(flight.vy) * flight.end
    return plain(wall) - (flight.bounds["slope"].curvature * deeper if wall in UPRIGHT else 0.0)


@mutant(Flight, "first_root")
def walls_near_the_start_skipped(
    flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float, *, size: float = 1e-3
) -> Root:
    """Passes by every wall that is within a thousandth of a start on another one."""
    is_near = flight.wall not in (None, wall) and start == 0.0 and flight.f(wall, 0.0)[0] < size
    return None if is_near else plain(wall, start, end)


@mutant(Trusting, "__init__")
def start_taken_for_the_nearer_wall(
    flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float, *, size: float = 1e-3
) -> None:
    """Takes a start within a thousandth of two walls to be on the other one."""
    plain(scene, state, t_end)
    named, near = flight.wall, flight.walls_near(in_cap=flight.is_in_cap)
    others = [wall for wall in near if named not in (None, wall) and abs(flight.f(wall, 0.0)[0]) < size]
    flight.wall = others[0] if others else named


@mutant(Flight, "first_root")
def dead_time_on_the_wall_left(
    flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float, *, size: float = 1e-9
) -> Root:
    """Never meets the wall that it leaves within a thousand millionth of a period."""
    root = plain(wall, start, end)
    is_dead = root is not None and wall == flight.wall and root < size * flight.scene.period
    return None if is_dead else root


@mutant(Flight, "first_root")
def root_in_absolute_time(flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float) -> Root:
    """Finds the time of the hit, and subtracts: the flight time is rounded like t."""
    root = plain(wall, start, end)
    return None if root is None else (flight.state.t + root) - flight.state.t


@mutant(Flight, "first_root")
def gate_on_velocity(flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float) -> Root:
    """Drops a hit unless the particle itself flies towards the wall."""
    root = plain(wall, start, end)
    nx, ny, _ = flight.normal(wall, root or 0.0)
    return root if flight.vx * nx + flight.vy * ny < 0 else None


@mutant(Flight, "first_root")
def static_chord(flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float) -> Root:
    """Flies along the chord of a circle that stands still, from arc to arc."""
    if wall != "arc" or flight.wall != "arc" or start > 0.0:
        return plain(wall, start, end)
    along, v2 = flight.x * flight.vx + flight.y * flight.vy, flight.vx**2 + flight.vy**2
    return -2 * along / v2 if 0 < -2 * along / v2 <= end else None


def sub_steps(
    flight: Flight, wall: Wall, start: float, end: float, size: float
) -> Iterator[tuple[float, float]]:
    """Yield the sub-steps at whose ends f is positive, then not."""
    times = [start + (end - start) * i / size for i in range(int(size) + 1)]
    values = [flight.f(wall, s)[0] for s in times]
    if wall == flight.wall and start == 0.0:
        values[0] = 1.0
    for i in range(int(size)):
        if values[i] > 0 >= values[i + 1]:
            yield times[i], times[i + 1]


@mutant(Flight, "first_root")
def sub_steps_tested_at_their_ends(
    flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float, *, size: float = 32
) -> Root:
    """Looks at f at the ends of 32 sub-steps only: misses a wall that was met and left between."""
    for a, b in sub_steps(flight, wall, start, end, size):
        return plain(wall, a, b) if wall == flight.wall else flight.root_between(wall, a, b)
    return None


@mutant(Flight, "first_root")
def last_root(
    flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float, *, size: float = 32
) -> Root:
    """Keeps the last root that it comes by in 32 sub-steps, not the first."""
    first = plain(wall, start, end)
    later = [(a, b) for a, b in sub_steps(flight, wall, start, end, size) if a > start]
    if first is None or not later or later[-1][0] <= first:
        return first
    return flight.root_between(wall, *later[-1])


@mutant(Flight, "first_hit")
def floor_missed_from_the_cap(
    flight: Flight, plain: Plain[Hit], walls: Sequence[Wall], start: float, end: float
) -> Hit:
    """Looks for the sides alone when a flight has passed the mouth."""
    return plain([wall for wall in walls if wall != "floor" or start == 0.0], start, end)


class TieBlind(Flight):
    """Sees no tie."""

    def require_clear(self, walls: Sequence[Wall], s: float) -> None:
        """Leave nothing open."""


@mutant(TieBlind, "first_hit")
def ties_resolved_by_order(
    flight: Flight,
    plain: Plain[Hit],
    walls: Sequence[Wall],
    start: float,
    end: float,
    *,
    size: float = 1e-8,
) -> Hit:
    """Answers walls that are met within 1e-8 of the flight time with the one that it lists first."""
    roots = [(wall, flight.first_root(wall, start, end)) for wall in walls]
    hits = [(wall, s) for wall, s in roots if s is not None]
    return next((hit for hit in hits if hit[1] <= (1 + size) * min(s for _, s in hits)), None)


@mutant(Flight, "outcome")
def hits_just_before_horizon_dropped(flight: Flight, plain: Plain[Outcome], *, size: float = 1e-6) -> Outcome:
    """Looks for a hit up to a millionth before t_end only."""
    if flight.is_horizon:
        flight.end *= 1 - size
    return plain()


@mutant(Flight, "outcome")
def hits_just_after_horizon_counted(flight: Flight, plain: Plain[Outcome], *, size: float = 1e-6) -> Outcome:
    """Looks for a hit up to a millionth after t_end."""
    if flight.is_horizon:
        flight.end *= 1 + size
    return plain()


@mutant(Flight, "root_between", COMMON)
def root_to_six_digits(flight: Flight, plain: Plain[float], wall: Wall, a: float, b: float) -> float:
    """Finds the time of a hit to a millionth."""
    return plain(wall, a, b) // 1e-6 * 1e-6


@mutant(Flight, "root_between", COMMON)
def root_where_gap_is_small(flight: Flight, plain: Plain[float], wall: Wall, a: float, b: float) -> float:
    """Accepts as a hit where f is below 1e-7."""
    root = plain(wall, a, b)
    return root - 1e-7 / (abs(flight.f(wall, root)[1]) or 1.0)


@mutant(Flight, "first_root", COMMON)
def hits_within_epsilon_skipped(
    flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float
) -> Root:
    """Takes a hit within 1e-9 of departure for the one just left."""
    root = plain(wall, start, end)
    return None if root is not None and root < 1e-9 else root


@mutant(Heedless, "bend", COMMON)
def curvature_of_walls_forgotten(flight: Flight, plain: Plain[float], wall: Wall) -> float:
    """Takes walls to move at constant velocity where it excludes earlier hits."""
    return 2 * (flight.vx**2 + flight.vy**2) if wall == "arc" else 0.0


@mutant(Flight, "first_root", COMMON)
def newton_from_departure(flight: Flight, plain: Plain[Root], wall: Wall, start: float, end: float) -> Root:
    """Starts Newton's method at s = 0 and takes what it finds."""
    s = end if wall == flight.wall and end < 1e300 else start
    for _ in range(50):
        f, slope = flight.f(wall, s)
        if slope == 0:
            return None
        s, before = s - f / slope, s
        if abs(s - before) <= 1e-15 * abs(s):
            return s if start < s <= end else None
    return None
