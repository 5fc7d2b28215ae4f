"""Mistakes that nearly everyone makes: a diagnosis names them, and they need no vector of their own.

Each is subsumed by a mutant that is more delicate, and so proves nothing of the suite.
"""

from __future__ import annotations

from math import hypot

from mpmath import fp
from msgspec.structs import replace

from conformance.mutants.mutant import COMMON, Plain, mutant
from conformance.mutants.walls import Heedless, Normal
from conformance.plain.motion import ConstantMotion, FourierMotion, LawValue
from conformance.plain.step import Flight
from scene import Collision, Fourier, Scene, State, Wall
from scene.laws import frequency

Root = float | None


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


def hold(flight: Flight, name: str) -> None:
    """Let a law stand still during a flight."""
    if name in flight.laws:
        flight.laws[name] = ConstantMotion(flight.laws[name].value, 0.0)


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


@mutant(FourierMotion, "__init__", COMMON)
def phase_restarts_at_each_step(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Follows a Fourier law from t = 0 whatever the time of departure."""
    plain(law, 0.0)


@mutant(FourierMotion, "__init__", COMMON)
def sine_and_cosine_swapped(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Takes the cosine amplitudes for the sine's."""
    plain(replace(law, cos=law.sin, sin=law.cos), t)


@mutant(FourierMotion, "__init__", COMMON)
def pi_too_short(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Reduces the phase of a Fourier law by 2 x 3.14159."""
    plain(law, t % (2 * 3.14159 / frequency(fp, law)))


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
