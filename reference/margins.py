"""Margins of a collision: how much must change until another answer is right."""

from typing import NamedTuple

from reference.arithmetic import Arithmetic, Enclosure, Interval, Undecidable
from reference.course import SIDES, Course, Hit
from scene import Wall


class Margins(NamedTuple):
    """Distances of a proved collision from degeneracy.

    Attributes:
        gap: time from the hit to the next wall that the straight flight would meet within the
            horizon [time]; None if there is none, or if it cannot be separated from the hit.
        corner: distance at the hit to the nearest other wall that bounds this part of the table
            [length], to first order: f / |grad f|.
        slope: |f'| at the hit, the speed of approach times |grad f|.
    """

    gap: Enclosure | None
    corner: Enclosure | None
    slope: Enclosure


def measure(course: Course, hit: Hit) -> Margins:
    """Measure a hit that `course` has found."""
    arithmetic = course.arithmetic
    others = [wall for wall in neighbours(course, hit.wall) if wall != hit.wall]
    distances = [distance(course, hit, wall) for wall in others]
    gaps = [gap for gap in (_gap(course, hit, wall) for wall in others) if gap is not None]
    return Margins(
        _least(arithmetic, gaps), _least(arithmetic, distances), arithmetic.enclosure(-hit.slope)
    )


def neighbours(course: Course, wall: Wall) -> tuple[Wall, ...]:
    """Return the walls that bound the part of the table in which this wall is met."""
    present = course.table.walls
    if wall == "arc" or (wall == "base" and "arc" in present):
        return ("arc", "base")
    return SIDES if "arc" in present else ("base", *SIDES)


def distance(course: Course, hit: Hit, wall: Wall) -> Interval:
    """Enclose f / |grad f| of a wall at the hit."""
    motion = course.motion
    arithmetic = course.arithmetic
    f_x, f_y, _ = motion.gradient(wall, hit.time)
    length = arithmetic.context.sqrt(arithmetic.square(f_x) + arithmetic.square(f_y))
    return motion.wall(wall, hit.time).f / length


def _gap(course: Course, hit: Hit, wall: Wall) -> Interval | None:
    try:
        later = course.hit_after(wall, course.arithmetic.upper(hit.time))
    except Undecidable:
        return None
    return None if later is None else later - hit.time


def _least(arithmetic: Arithmetic, numbers: list[Interval]) -> Enclosure | None:
    """Enclose the smallest of some enclosed numbers."""
    found: Enclosure | None = None
    for number in map(arithmetic.enclosure, numbers):
        found = (
            number
            if found is None
            else Enclosure(min(found.lo, number.lo), min(found.hi, number.hi))
        )
    return found
