"""From one flight to the next: the bounce, and the exact instant at which the new flight is described.

A collision's time is enclosed, so the state after it is carried along the new line of flight to an
exact instant within that enclosure. There place and velocity are boxes and the time is a number; the
flight itself begins a little before or after, at an enclosed flight time (`EnclosedFlight.begin`).
"""

from fractions import Fraction
from typing import NamedTuple

from reference.answers import Moment, ProvedCollision, ProvedHorizon
from reference.arithmetic import Interval, exact_ends
from reference.course import FOR_EVER, Course, Hit
from reference.walls import EnclosedFlight, MovingWalls
from scene import Stem


class Bounce(NamedTuple):
    """What follows a hit: t, x, y, vx, vy just after it, and the next flight."""

    moment: tuple[Interval, Interval, Interval, Interval, Interval]
    flight: EnclosedFlight


def reflect(course: Course, hit: Hit) -> tuple[Interval, Interval]:
    """Return v - 2 f' grad f / |grad f|^2, the velocity after a hit: v - 2 (v.n - u) n (sec. 3.1)."""
    f_x, f_y, _ = course.motion.gradient(hit.wall, hit.time)
    factor = 2 * hit.slope / (course.arithmetic.square(f_x) + course.arithmetic.square(f_y))
    return course.flight.vx - factor * f_x, course.flight.vy - factor * f_y


def bounce(course: Course, hit: Hit) -> Bounce:
    """Reflect at a hit, and describe the next flight at an exact instant close to it."""
    arithmetic, q, s = course.arithmetic, course.flight, hit.time
    vx, vy = reflect(course, hit)
    is_base = hit.wall == "base"
    x, y = q.x + q.vx * s, arithmetic.zero if is_base else q.y + q.vy * s
    t = arithmetic.between(*(q.instant + end for end in exact_ends(arithmetic.inflated(s))))
    # The new line of flight at that instant, a little before or after the hit.
    near = arithmetic.middle(s)
    begin = s - near
    x_near = q.x + q.vx * near + (q.vx - vx) * begin
    y_near = -vy * begin if is_base else q.y + q.vy * near + (q.vy - vy) * begin
    box = map(arithmetic.inflated, (x_near, y_near, vx, vy, begin))
    following = EnclosedFlight._make((q.instant + exact_ends(near)[0], *box))
    x, y, vx, vy = map(arithmetic.inflated, (x, y, vx, vy))
    return Bounce((t, x, y, vx, vy), following)


def fly_on(course: Course, hit: Hit, after: Bounce) -> Course:
    """Return the flight that follows a hit. The wall keeps its residual if it was left before."""
    arithmetic, scene = course.arithmetic, course.scene
    leaving = {hit.wall: course.leaving.get(hit.wall, arithmetic.zero)}
    in_cap = hit.wall == "arc" or (hit.wall == "base" and not isinstance(scene, Stem))
    end = None if course.end is None else course.end + course.flight.instant - after.flight.instant
    return Course(scene, MovingWalls(arithmetic, scene, after.flight), leaving, False, in_cap, end, None)


def collision(course: Course, hit: Hit, after: Bounce) -> ProvedCollision:
    """Return a collision free of its working precision."""
    arithmetic, flight = course.arithmetic, course.flight
    close = arithmetic.enclosure
    return ProvedCollision(
        hit.wall,
        close(arithmetic.inflated(hit.time - flight.begin)),
        Moment(*map(close, after.moment)),
        close(hit.slope),
        arithmetic.digits,
        EnclosedFlight._make((flight.instant, *map(close, flight[1:]))),
        close(hit.time),
    )


def horizon(course: Course) -> ProvedHorizon:
    """Return the state at a horizon that no collision comes before."""
    arithmetic, flight = course.arithmetic, course.flight
    end = Fraction(FOR_EVER) if course.end is None else course.end
    s = arithmetic.dyadic(end)
    t = arithmetic.dyadic(flight.instant + end)
    at = (flight.x + flight.vx * s, flight.y + flight.vy * s, flight.vx, flight.vy)
    moment = Moment(*map(arithmetic.enclosure, (t, *map(arithmetic.inflated, at))))
    return ProvedHorizon(moment, arithmetic.digits)
