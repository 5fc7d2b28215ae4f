"""Mutants whose single flights are right, and that err from hit to hit or in the capture interval."""

from math import hypot

from msgspec.structs import replace

from conformance.mutants.laws import single
from conformance.mutants.mutant import Plain, mutant
from conformance.plain.step import CaptureInterval, Flight, PlainPath, misses_mouth, width
from scene import Collision, Mushroom, Outcome, State
from scene.protocol.wire import Captured

Arrival = tuple[Outcome, Captured]


@mutant(PlainPath, "report")
def speed_drifts_after_five_hundred_hits(
    path: PlainPath, plain: Plain[Collision], hit: Collision, *, size: float = 500
) -> Collision:
    """Loses a hundred thousandth of its speed at every hit after the five hundredth."""
    kept = 1.0 if path.n_hits <= size else 1 - 1e-5
    return replace(hit, vx=kept * hit.vx, vy=kept * hit.vy)


@mutant(PlainPath, "report")
def energy_frozen_after_fifty_hits(
    path: PlainPath, plain: Plain[Collision], hit: Collision, *, size: float = 50
) -> Collision:
    """Keeps its speed after fifty hits, whatever the walls do."""
    if path.n_hits <= size:
        return hit
    kept = hypot(path.state.vx, path.state.vy) / (hypot(hit.vx, hit.vy) or 1.0)
    return replace(hit, vx=kept * hit.vx, vy=kept * hit.vy)


@mutant(PlainPath, "departure")
def velocity_in_float32(path: PlainPath, plain: Plain[State], hit: Collision) -> State:
    """Keeps the velocity from hit to hit in binary32."""
    return replace(hit.state(), vx=single(hit.vx), vy=single(hit.vy))


@mutant(PlainPath, "departure")
def clock_drifts_by_hits(path: PlainPath, plain: Plain[State], hit: Collision) -> State:
    """Loses a ten millionth of every flight time."""
    return replace(hit.state(), t=hit.t - 1e-7 * hit.dt)


@mutant(PlainPath, "is_captured")
def captured_by_velocity_after(path: PlainPath, plain: Plain[bool], scene: Mushroom, hit: Collision) -> bool:
    """Asks whether an arc hit is captured with the speed after the bounce."""
    return misses_mouth(width(scene, hit.t), hit, hit.vx, hit.vy)


@mutant(PlainPath, "is_captured")
def captured_by_mouth_at_departure(
    path: PlainPath, plain: Plain[bool], scene: Mushroom, hit: Collision
) -> bool:
    """Asks whether an arc hit is captured with the mouth that was there at departure."""
    return misses_mouth(width(scene, path.state.t), hit, path.state.vx, path.state.vy)


@mutant(PlainPath, "is_captured")
def captured_by_mouth_at_start(path: PlainPath, plain: Plain[bool], scene: Mushroom, hit: Collision) -> bool:
    """Asks whether an arc hit is captured with the mouth as it was at time 0."""
    return misses_mouth(width(scene, 0.0), hit, path.state.vx, path.state.vy)


@mutant(PlainPath, "is_captured")
def captured_by_ratio_for_width(path: PlainPath, plain: Plain[bool], scene: Mushroom, hit: Collision) -> bool:
    """Compares the distance from the centre with w / r in place of w."""
    radius = Flight.motion(scene.laws["r"], hit.t).value
    return misses_mouth(width(scene, hit.t) / radius, hit, path.state.vx, path.state.vy)


@mutant(PlainPath, "is_captured")
def captured_in_one_sense_only(path: PlainPath, plain: Plain[bool], scene: Mushroom, hit: Collision) -> bool:
    """Compares x vy - y vx without its size: a particle that turns clockwise is never captured."""
    vx, vy = path.state.vx, path.state.vy
    return hit.x * vy - hit.y * vx > width(scene, hit.t) * hypot(vx, vy)


@mutant(PlainPath, "is_captured")
def capture_edge_moved(
    path: PlainPath, plain: Plain[bool], scene: Mushroom, hit: Collision, *, size: float = 0.05
) -> bool:
    """Takes a hit for captured though it misses that by five parts in a hundred."""
    return misses_mouth((1 - size) * width(scene, hit.t), hit, path.state.vx, path.state.vy)


@mutant(PlainPath, "watch")
def capture_ends_for_good_at_free_hit(path: PlainPath, plain: Plain[None], hit: Collision) -> None:
    """Ends a capture interval for good at the first arc hit that is not captured."""
    plain(hit)
    if path.stay.end is not None:
        path.close(hit.t)


@mutant(PlainPath, "watch")
def capture_ends_below_only(path: PlainPath, plain: Plain[None], hit: Collision) -> None:
    """Lets a capture go on through arc hits that are not captured, until a wall of the stem is met."""
    plain(hit)
    path.stay = CaptureInterval(path.stay.begin)


class Remembering(PlainPath):
    """A path that knows when the arc was last hit before."""

    before: float | None = None


@mutant(Remembering, "watch")
def capture_begins_with_the_hit_before(path: Remembering, plain: Plain[None], hit: Collision) -> None:
    """Begins a capture interval with the arc hit before its first captured one."""
    is_free = path.stay.begin is None
    plain(hit)
    if is_free and path.stay.begin is not None and path.before is not None:
        path.stay = CaptureInterval(path.before)
    path.before = hit.t if hit.wall == "arc" else path.before


@mutant(PlainPath, "watch")
def capture_begins_at_the_start(path: PlainPath, plain: Plain[None], hit: Collision) -> None:
    """Begins the capture of a particle that starts captured with the start, not with its first hit."""
    begin, is_free = path.state.t, path.stay.begin is None
    plain(hit)
    if path.n_hits == 1 and is_free and path.stay.begin is not None:
        path.stay = CaptureInterval(begin)


@mutant(PlainPath, "arrival")
def capture_at_the_end_forgotten(path: PlainPath, plain: Plain[Arrival]) -> Arrival:
    """Reports no capture interval that is still on at t_end."""
    outcome, captured = plain()
    return outcome, None if captured and captured[1] == path.t_end else captured


@mutant(PlainPath, "arrival")
def longest_capture_reported(path: PlainPath, plain: Plain[Arrival]) -> Arrival:
    """Reports the longest capture interval in place of the first."""
    outcome, _ = plain()
    return outcome, max(path.stays, key=lambda stay: stay[1] - stay[0], default=None)


@mutant(PlainPath, "arrival")
def slope_ignored_in_flow(path: PlainPath, plain: Plain[Arrival]) -> Arrival:
    """Carries particles of a flow as if the sides were upright; its steps are right."""
    if "slope" in path.scene.laws:
        path.scene = replace(path.scene, slope=0.0)
    return plain()
