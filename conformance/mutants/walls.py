"""Mutants that have a wall, a bounce, or the mouth wrong; and those that miss a hit, or find a false one.

The latter find a hit where there is none, or decide wrongly which is the first.
"""

from collections.abc import Iterator, Sequence
from math import hypot

from msgspec.structs import replace

from conformance.mutants.mutant import COMMON, Plain, mutant
from conformance.plain.step import ConstantMotion, Flight, Gap, LawValue, UndecidedError
from scene import Collision, Constant, Mushroom, Outcome, Scene, State, Wall

Normal = tuple[float, float, float]
Root = float | None
Hit = tuple[Wall, float] | None
UPRIGHT: tuple[Wall, ...] = ("left", "right")


class Heedless(Flight):
    """Goes on where the plain stepper would see that it must be wrong."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        """Return the first root, or None where it is open."""
        try:
            return super().first_root(wall, start, end)
        except UndecidedError:
            return None

    def require_clear(self, walls: Sequence[Wall], s: float) -> None:
        """Look at the horizon only."""
        if self.is_horizon and s == self.end:
            super().require_clear(walls, s)


class Trusting(Heedless):
    """Takes every state."""

    def refusal(self) -> Outcome | None:
        """Refuse nothing."""
        return None


@mutant(Flight, "normal")
def normal_without_cos(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Takes (1, slope) for a unit normal of a slanted side."""
    gap = flight.gap(wall, s)
    return (gap.fx, gap.fy, -gap.ft) if wall in UPRIGHT else plain(wall, s)


@mutant(Flight, "normal")
def side_velocity_without_cos(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Takes dw/dt for the normal velocity of a slanted side."""
    nx, ny, u = plain(wall, s)
    return nx, ny, -flight.gap(wall, s).ft if wall in UPRIGHT else u


@mutant(Flight, "normal")
def floor_velocity_sign(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Takes a floor that rises for one that sinks."""
    nx, ny, u = plain(wall, s)
    return nx, ny, -u if wall == "floor" else u


@mutant(Flight, "gap", COMMON)
def tilt_rate_sign(flight: Flight, plain: Plain[Gap], wall: Wall, s: float) -> Gap:
    """Has the sign of d(slope)/dt wrong in the velocity of a side."""
    gap = plain(wall, s)
    return gap._replace(ft=2 * flight.width(s).rate - gap.ft) if wall in UPRIGHT else gap


@mutant(Flight, "gap")
def left_side_upright(flight: Flight, plain: Plain[Gap], wall: Wall, s: float) -> Gap:
    """Slants the right side only."""
    w = flight.width(s) if wall == "left" else None
    return Gap(w.value + flight.x, w.rise + flight.vx * s, w.rate, 1.0, 0.0) if w else plain(wall, s)


@mutant(Trusting, "gap", COMMON)
def sides_slant_from_the_floor(flight: Flight, plain: Plain[Gap], wall: Wall, s: float) -> Gap:
    """Takes w for the half-width at the floor, not at the mouth."""
    gap = plain(wall, s)
    if wall not in UPRIGHT:
        return gap
    slope, h = flight.laws["slope"].at(s), flight.laws["h"].at(s)
    rise = gap.rise + slope.now * h.now - slope.value * h.value
    ft = gap.ft + slope.rate * h.now + slope.now * h.rate
    return gap._replace(start=gap.start + slope.value * h.value, rise=rise, ft=ft)


def hold(flight: Flight, name: str) -> None:
    """Let a law stand still during a flight."""
    if name in flight.laws:
        flight.laws[name] = ConstantMotion(Constant(flight.laws[name].value), 0.0)


@mutant(Flight, "__init__")
def floor_static(flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float) -> None:
    """Lets the floor stand still during a flight."""
    plain(scene, state, t_end)
    hold(flight, "h")


@mutant(Flight, "width", COMMON)
def hole_not_scaled_by_radius(flight: Flight, plain: Plain[LawValue], s: float) -> LawValue:
    """Takes nu for the half-width of the mouth."""
    return flight.laws["nu"].at(s) if "nu" in flight.laws else plain(s)


@mutant(Flight, "walls_near")
def arc_goes_on_below(flight: Flight, plain: Plain[tuple[Wall, ...]], *, in_cap: bool) -> tuple[Wall, ...]:
    """Meets the arc in the stem too, where the circle goes on below the mouth."""
    is_below = isinstance(flight.scene, Mushroom) and not in_cap
    return (*plain(in_cap=in_cap), "arc") if is_below else plain(in_cap=in_cap)


@mutant(Flight, "walls_near")
def base_bounce_ignored(flight: Flight, plain: Plain[tuple[Wall, ...]], *, in_cap: bool) -> tuple[Wall, ...]:
    """Lets a particle through the closed base of a cap or the top of a stem."""
    return tuple(wall for wall in plain(in_cap=in_cap) if wall != "base")


@mutant(Heedless, "collision")
def corners_turn_back(
    flight: Flight, plain: Plain[Collision], wall: Wall, s: float, *, size: float = 1e-6
) -> Collision:
    """Turns the velocity round where two walls are met within a millionth of each other."""
    hit = plain(wall, s)
    near = flight.walls_near(in_cap=hit.y > 0 or (flight.is_in_cap and wall == "base"))
    others = [other for other in near if other not in (wall, flight.wall)]
    is_corner = any(flight.f(other, s)[0] <= size for other in others)
    return replace(hit, vx=-flight.vx, vy=-flight.vy) if is_corner else hit


@mutant(Heedless, "is_mouth_open")
def mouth_tested_at_departure(flight: Flight, plain: Plain[bool], s: float) -> bool:
    """Asks at departure how wide the mouth is."""
    return abs(flight.x + flight.vx * s) < flight.width(0.0).now


@mutant(Heedless, "is_mouth_open")
def mouth_tested_with_place_of_departure(flight: Flight, plain: Plain[bool], s: float) -> bool:
    """Asks at the place of departure whether the mouth is open."""
    return abs(flight.x) < flight.width(s).now


@mutant(Heedless, "is_mouth_open")
def mouth_tested_at_end_of_sub_step(flight: Flight, plain: Plain[bool], s: float) -> bool:
    """Crosses y = 0 in sub-steps and asks at the end of one: it cuts the mouth's corner."""
    step = 0.01 * flight.width(0.0).now / (abs(flight.vx) + abs(flight.vy))
    return plain((s // step + 1) * step)


@mutant(Heedless, "is_mouth_open")
def mouth_tested_at_horizon(flight: Flight, plain: Plain[bool], s: float) -> bool:
    """Asks at t_end how wide the mouth is."""
    return abs(flight.x + flight.vx * s) < flight.width(min(flight.t_end - flight.state.t, 1e9)).now


@mutant(Heedless, "is_mouth_open")
def mouth_wider_by_a_millionth(flight: Flight, plain: Plain[bool], s: float, *, size: float = 1e-6) -> bool:
    """Lets a particle through the mouth that hits the base within a millionth of its edge."""
    return abs(flight.x + flight.vx * s) < flight.width(s).now + size


@mutant(Heedless, "is_mouth_open")
def mouth_narrower_by_a_millionth(
    flight: Flight, plain: Plain[bool], s: float, *, size: float = 1e-6
) -> bool:
    """Bounces a particle off the base that passes the mouth within a millionth of its edge."""
    return abs(flight.x + flight.vx * s) < flight.width(s).now - size


@mutant(Flight, "is_mouth_open")
def narrow_mouth_taken_as_shut(flight: Flight, plain: Plain[bool], s: float, *, size: float = 1e-3) -> bool:
    """Takes a mouth below a thousandth of the radius as shut."""
    return flight.width(s).now >= size * flight.laws["r"].at(s).now and plain(s)


@mutant(Heedless, "is_mouth_open")
def wide_mouth_taken_as_whole(flight: Flight, plain: Plain[bool], s: float, *, size: float = 1e-3) -> bool:
    """Takes a mouth within a thousandth of the radius as the whole base."""
    return flight.width(s).now > (1 - size) * flight.laws["r"].at(s).now or plain(s)


@mutant(Flight, "__init__")
def pushed_off_by_a_billionth(
    flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float
) -> None:
    """Starts a flight from a wall a thousand millionth inside it."""
    plain(scene, state, t_end)
    if flight.wall is not None:
        nx, ny, _ = flight.normal(flight.wall, 0.0)
        flight.x, flight.y, flight.known = flight.x + 1e-9 * nx, flight.y + 1e-9 * ny, {}


@mutant(Flight, "normal", COMMON)
def wall_velocity_dropped(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Bounces as if every wall stood still."""
    return *plain(wall, s)[:2], 0.0


@mutant(Flight, "normal", COMMON)
def wall_velocity_once(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Adds u where 2 u is due."""
    nx, ny, u = plain(wall, s)
    return nx, ny, u / 2


@mutant(Flight, "normal", COMMON)
def wall_velocity_sign(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Takes a wall that comes for one that goes."""
    nx, ny, u = plain(wall, s)
    return nx, ny, -u


@mutant(Flight, "normal", COMMON)
def wall_velocity_at_departure(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Kicks with the speed that the wall had at departure."""
    return *plain(wall, s)[:2], plain(wall, 0.0 if flight.x or flight.y else s)[2]


@mutant(Flight, "normal", COMMON)
def normal_at_departure(flight: Flight, plain: Plain[Normal], wall: Wall, s: float) -> Normal:
    """Reflects about the normal at the place of departure."""
    return *plain(wall, 0.0 if flight.x or flight.y else s)[:2], plain(wall, s)[2]


@mutant(Flight, "bounce", COMMON)
def energy_kept(
    flight: Flight, plain: Plain[tuple[float, float]], wall: Wall, s: float
) -> tuple[float, float]:
    """Rescales the velocity after each bounce to the speed before."""
    vx, vy = plain(wall, s)
    kept = hypot(flight.vx, flight.vy) / (hypot(vx, vy) or 1.0)
    return kept * vx, kept * vy


@mutant(Flight, "__init__", COMMON)
def arc_static(flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float) -> None:
    """Lets the arc stand still during a flight."""
    plain(scene, state, t_end)
    hold(flight, "r")


@mutant(Flight, "__init__", COMMON)
def slope_at_departure(flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float) -> None:
    """Holds the slope of the sides still during a flight."""
    plain(scene, state, t_end)
    hold(flight, "slope")


@mutant(Flight, "width", COMMON)
def hole_static(flight: Flight, plain: Plain[LawValue], s: float) -> LawValue:
    """Lets the mouth and the sides stand still during a flight."""
    return plain(0.0)._replace(rate=0.0)


@mutant(Heedless, "is_mouth_open", COMMON)
def mouth_tested_to_the_right_only(flight: Flight, plain: Plain[bool], s: float) -> bool:
    """Tests x < w instead of |x| < w."""
    return flight.x + flight.vx * s < flight.width(s).now


@mutant(Flight, "is_mouth_open", COMMON)
def base_closed(flight: Flight, plain: Plain[bool], s: float) -> bool:
    """Has no mouth."""
    return False


@mutant(Flight, "collision", COMMON)
def left_and_right_exchanged(flight: Flight, plain: Plain[Collision], wall: Wall, s: float) -> Collision:
    """Calls the left side right."""
    exchanged: dict[str, Wall] = {"left": "right", "right": "left"}
    return replace(plain(wall, s), wall=exchanged.get(wall, wall))


@mutant(Flight, "collision", COMMON)
def place_not_moved(flight: Flight, plain: Plain[Collision], wall: Wall, s: float) -> Collision:
    """Gives the place of departure for that of the hit."""
    return replace(plain(wall, s), x=flight.x, y=flight.y)


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
