"""Mutants that have a wall, a bounce, or the mouth wrong."""

from collections.abc import Sequence
from math import hypot

from msgspec.structs import replace

from conformance.mutants.mutant import COMMON, Plain, mutant
from conformance.plain.step import ConstantMotion, Flight, Gap, LawValue, UndecidedError
from scene import Collision, Mushroom, Outcome, Scene, State, Wall

Normal = tuple[float, float, float]
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
        flight.laws[name] = ConstantMotion(flight.laws[name].value, 0.0)


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
