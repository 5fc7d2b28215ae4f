"""Faulty references: the reference with one mistake in it.

A family of attacks hunts it. Each is a function that makes its mistake through pytest's monkeypatch, which
mends it afterwards. Others, of test_reference_mutants, are killed by a battery of answers known by hand.
"""

from collections.abc import Callable
from fractions import Fraction
from math import fmod, pi
from typing import Any

import pytest

from reference import path, rational, start
from reference.arithmetic import Arithmetic, exact_ends, is_below, sign
from reference.course import Course, Hit
from reference.isolation import Isolator
from reference.jets import Jet, multiply
from reference.timeline import Legs, Waves
from reference.walls import MovingWalls
from scene.mpmath_internals import ends

Fault = Callable[[pytest.MonkeyPatch], None]


def replacing(owner: object, name: str) -> Callable[[Callable[..., Any]], Fault]:
    """Turn a function into the mistake of using it for an honest one, which it is given first."""
    honest = getattr(owner, name)

    def make_fault(mistake: Callable[..., Any]) -> Fault:
        def mistaken(*args: Any, **options: Any) -> Any:
            return mistake(honest, *args, **options)

        return lambda monkeypatch: monkeypatch.setattr(owner, name, mistaken)

    return make_fault


@replacing(Legs, "jet")
def knots_unseen(honest, self, s):
    """The piece that holds where an interval begins is taken to hold on all of it."""
    return self._on(self.law.leg_at(self.instant + exact_ends(s)[0]), s)


@replacing(Legs, "__init__")
def period_from_zero(honest, self, arithmetic, law, instant):
    """Knots are taken to begin at time 0."""
    honest(self, arithmetic, law, instant + Fraction(law.knots[0][0]))


@replacing(rational, "is_zero")
def tie_with_the_residual(_, table, state, wall, s):
    """Ties are judged by f, not by f - f(0)."""
    return rational.wall_jet(table, state, wall, s).f.is_zero()


@replacing(Isolator, "value")
def late_value_with_the_residual(honest, self, s):
    """All that is far from the start is judged by f, not by f - f(0)."""
    is_late = is_below(self.arithmetic.power_of_two(-20), s)
    return self.jet(s).f if is_late else honest(self, s)


def residual_forgotten(monkeypatch):
    """Ties are judged by f, not by f - f(0), and so is all that is far from the start."""
    tie_with_the_residual(monkeypatch)
    late_value_with_the_residual(monkeypatch)


@replacing(start, "_distance_of")
def size_of_all_time(honest, table, wall, motion):
    """A state is on the wall it names by the largest size of all time."""
    return motion.arithmetic.number(max(law.bounds().highest for law in table.laws.values()))


@replacing(start, "_walls_near")
def corner_unseen(honest, table, state):
    """A state that names a wall is on no other."""
    return [] if state.wall else honest(table, state)


def hit_at_end_counts(monkeypatch):
    """A wall that is met exactly at the horizon is met before it."""
    monkeypatch.setattr(Course, "_is_at_horizon", lambda self, hit: False)
    monkeypatch.setattr(Course, "_require_before_end", lambda self, hit: None)


@replacing(Course, "_tied")
def tie_guessed(honest, self, hits, limit):
    """Of walls met together the first is answered."""
    return hits[0]


@replacing(Isolator, "first_root")
def blind_start(honest, self, start, end):
    """No wall is met in the first 1e-3 of a flight."""
    if ends(start) != ends(self.begin):
        return honest(self, start, end)
    later = self.arithmetic.upper(start + (end - start) / 1024)
    return honest(self, later, end) if sign(self.value(later)) > 0 else None


@replacing(Isolator, "first_root")
def ends_alone(honest, self, start, end):
    """A wall is met only if f is below 0 at the end of the search."""
    return None if sign(self.value(end)) > 0 else honest(self, start, end)


@replacing(Isolator, "_is_never_reached")
def swept_begins_alone(honest, self, a, b):
    """A wall is not met over many periods if it never comes to where the flight is at their begin."""
    with pytest.MonkeyPatch.context() as patch:
        if ask := self.is_never_met:
            patch.setattr(self, "is_never_met", lambda s: s is b or ask(s))
        return honest(self, a, b)


@replacing(path, "reflect")
def rounded_rates(honest, course, hit):
    """The wall's speed is taken at the time of day as it rounds to binary64."""
    time = Fraction(float(course.flight.instant + exact_ends(hit.time)[0])) - course.flight.instant
    slope = course.motion.wall(hit.wall, course.arithmetic.dyadic(time)).d1
    return honest(course, hit._replace(slope=slope))


@replacing(Arithmetic, "turning")
def reduced_time(honest, self, omega, period, instant):
    """Whole periods, rounded to binary64, are taken off a time."""
    return honest(self, omega, period, Fraction(fmod(float(instant), period or 2 * pi / omega)))


@replacing(Arithmetic, "turning")
def rounded_omega(honest, self, omega, period, instant):
    """A period is turned into an omega in binary64."""
    return honest(self, omega or 2 * pi / period, None, instant)


@replacing(Waves, "__init__")
def rough_terms(honest, self, arithmetic, law, instant):
    """A law is known to 2^-62 of its mean only, however small it is."""
    honest(self, arithmetic, law, instant)
    self.mean = self.mean * arithmetic.number(1 + Fraction(1, 2**62))


@replacing(Waves, "__init__")
def few_harmonics(honest, self, arithmetic, law, instant):
    """Harmonics beyond the third are dropped."""
    honest(self, arithmetic, law, instant)
    self.terms = self.terms[:3]


@replacing(Course, "_beyond_crossing")
def narrow_mouth(honest, self, crossing):
    """The mouth is taken to be narrower by 1e-3 of itself."""
    part = Jet(self.arithmetic.number(Fraction(999, 1000)), self.arithmetic.zero, self.arithmetic.zero)
    self.motion.width = lambda s: multiply(MovingWalls.width(self.motion, s), part)
    return honest(self, crossing)


def giving_up(is_given_up: Callable[[Course, Any], bool]) -> Fault:
    """Return the mistake of finding no wall on certain flights."""

    @replacing(Course, "_first_hit")
    def none_met(honest, self, walls, start, limit):
        found = honest(self, walls, start, limit)
        return None if is_given_up(self, found) else found

    return none_met


# Nothing is met where (x . v)^2 is no binary64 number; after 10 units of time; by what rests, or nearly.
overflowing = giving_up(
    lambda course, _: (
        not 2.0**-511 <= abs(course.exact.x * course.exact.vx + course.exact.y * course.exact.vy) <= 2.0**511
    )
)
impatient = giving_up(lambda _, hit: isinstance(hit, Hit) and float(exact_ends(hit.time)[0]) > 10)
resting = giving_up(lambda course, _: sum(abs(float(v.mid)) for v in course.flight[3:5]) < 2.0**-20)
