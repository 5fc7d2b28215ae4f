"""Faulty references: the reference with one mistake in it.

A family of attacks hunts it, or a battery of answers known by hand (`MUTANTS`). Each is a function that makes
its mistake through pytest's monkeypatch, which mends it afterwards.
"""

from bisect import bisect_right
from collections.abc import Callable
from fractions import Fraction
from math import fmod, pi
from typing import Any

import pytest

from reference import chain, rational, start, timeline, walls
from reference.arithmetic import Arithmetic, exact_ends, is_below, sign
from reference.course import SIDES, Course, Hit
from reference.isolation import Isolator
from reference.jets import Jet, multiply
from reference.timeline import Legs
from reference.walls import MovingWalls
from reference.waves import Waves
from scene import InvalidState, Mushroom, Undefined
from scene.laws import bounds
from scene.tables import laws

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
    low = self.instant + exact_ends(s)[0]
    turn = (low - self.starts[0]) // self.period * self.period
    return self._on(bisect_right(self.starts, low - turn) - 1, turn, s)


@replacing(Legs, "__init__")
def period_from_zero(honest, self, arithmetic, law, instant):
    """Knots are taken to begin at time 0."""
    honest(self, arithmetic, law, instant + Fraction(law.knots[0][0]))


@replacing(rational, "is_zero")
def tie_with_the_residual(_, scene, state, wall, s):
    """Ties are judged by f, not by f - f(0)."""
    return rational.wall_jet(scene, state, wall, s).f.is_zero()


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
def size_of_all_time(honest, scene, wall, motion):
    """A state is on the wall it names by the largest size of all time."""
    return motion.arithmetic.number(max(bounds(law).highest for law in laws(scene).values()))


@replacing(start, "_walls_near")
def corner_unseen(honest, scene, state):
    """A state that names a wall is on no other."""
    return [] if state.wall else honest(scene, state)


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
    if start._mpi_ != self.begin._mpi_:
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


@replacing(chain, "reflect")
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
    part = Jet(self.arithmetic.number(Fraction(999, 1000)), None, None)
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


@replacing(Isolator, "first_root")
def skip_the_first_root(honest, self, start, end):
    root = honest(self, start, end)
    if root is None:
        return None
    for i in range(1, 65):  # from where f > 0 again
        later = self.arithmetic.middle(root.time + (end - root.time) * self.arithmetic.number(i) / 65)
        if self.value(later) > 0:
            return honest(self, later, end)
    return None


@replacing(Course, "_first_hit")
def exclude_nothing(honest, self, walls, start, limit):
    """The first wall in the list that is hit at all, others not asked."""
    for wall in walls:
        found = honest(self, (wall,), start, limit)
        if found is not None:
            return found
    return None


@replacing(Course, "_first_hit")
def exclude_all_but_the_floor(honest, self, walls, start, limit):
    return honest(self, tuple(wall for wall in walls if wall != "floor") or walls, start, limit)


@replacing(Legs, "jet")
def piece_in_the_middle(honest, self, s):
    """Of the pieces that an enclosed time may touch, the one in its middle is believed."""
    if s.delta == 0 or s.delta > 2.0**-10:
        return honest(self, s)
    middle = honest(self, self.arithmetic.middle(s))
    return Jet(middle.f + s.delta * middle.d1, middle.d1 + s.delta * middle.d2, middle.d2)


@replacing(Isolator, "__init__")
def keep_the_residual(honest, self, arithmetic, jet, begin, residual=None, **options):
    honest(self, arithmetic, jet, begin, None, **options)


@replacing(Course, "_beyond_crossing")
def edge_with_the_residual(honest, self, crossing):
    leaving, self.leaving = self.leaving, {}
    try:
        return honest(self, crossing)
    finally:
        self.leaving = leaving


@replacing(Course, "_beyond_crossing")
def width_at_departure(honest, self, crossing):
    self.motion.width = lambda s: MovingWalls.width(self.motion, self.arithmetic.zero if s is crossing else s)
    return honest(self, crossing)


@replacing(Course, "__init__")
def with_a_later_horizon(honest, self, scene, motion, leaving, is_flat, in_cap, end, exact):
    honest(self, scene, motion, leaving, is_flat, in_cap, None if end is None else end + 9, exact)


@replacing(Course, "_beyond_crossing")
def open_always(honest, self, crossing):
    if not isinstance(self.scene, Mushroom):
        return honest(self, crossing)
    walls = SIDES if self.in_cap else ("arc",)
    return self._first_hit(walls, self.arithmetic.lower(crossing), None)


@replacing(chain, "reflect")
def with_the_wall_reversed(honest, course, hit):
    f_t = course.motion.gradient(hit.wall, hit.time)[2]
    return honest(course, hit._replace(slope=hit.slope - 2 * f_t))


@replacing(MovingWalls, "wall")
def swapped_sides(honest, self, wall, s):
    return honest(self, {"left": "right", "right": "left"}.get(wall, wall), s)


@replacing(MovingWalls, "gradient")
def level_normal(honest, self, wall, s):
    f_x, f_y, f_t = honest(self, wall, s)
    return f_x, self.arithmetic.zero if wall in ("left", "right") else f_y, f_t


@replacing(MovingWalls, "law")
def still_slope(honest, self, name, s):
    jet = honest(self, name, s)
    return Jet(jet.f, None, None) if name == "slope" else jet


@replacing(MovingWalls, "width")
def width_with_still_nu(honest, self, s):
    if "nu" not in self.timeline.laws:
        return honest(self, s)
    nu, r = self.law("nu", s), self.law("r", s)
    return Jet(nu.f * r.f, None if r.d1 is None else nu.f * r.d1, None)


@replacing(walls, "square")
def square_without_second_derivative(honest, arithmetic, p):
    if p.d1 is None:
        return Jet(arithmetic.square(p.f), None, None)
    return Jet(arithmetic.square(p.f), 2 * (p.f * p.d1), 2 * arithmetic.square(p.d1))


@replacing(MovingWalls, "hessian")
def hessian_without_time(honest, self, wall, s):
    zero = self.arithmetic.zero
    two = self.arithmetic.number(-2)
    return (two, two, zero, zero) if wall == "arc" else (zero, zero, zero, zero)


@replacing(start, "_judge_on_base")
def base_without_an_end(honest, scene, state, motion):
    """The arc is asked only whether the state is surely beyond it."""
    if sign(motion.wall("arc", motion.arithmetic.zero).f) < 0:
        raise InvalidState("beyond wall arc")
    return Undefined("sliding") if state.vy == 0 else None


@replacing(Waves, "_powers")
def powers_of_later_times(honest, self, away):
    """As if the point of the expansion were the interval's begin."""
    later = self.arithmetic.hull(self.arithmetic.zero, away)
    return honest(self, later)


@replacing(timeline.Timeline, "__init__")
def half_a_turn(honest, self, arithmetic, scene, instant):
    honest(self, arithmetic, scene, instant)
    self.turn = None if self.turn is None else self.turn / 2


@replacing(Waves, "__init__")
def waves_without_a_remainder(honest, self, arithmetic, law, instant):
    honest(self, arithmetic, law, instant)
    self.bound = arithmetic.zero


@replacing(Isolator, "_expanded")
def tangent_for_the_expansion(honest, self, whole, jet):
    """Without the second derivative's part."""
    return honest(self, whole, jet._replace(d2=self.arithmetic.zero))._replace(d2=jet.d2)


MUTANTS: dict[str, Fault] = {
    "waves without a remainder": waves_without_a_remainder,
    "odd powers of a negative time dropped": powers_of_later_times,
    "never reached from the first place": swept_begins_alone,
    "never met in half a period": half_a_turn,
    "f by its tangent": tangent_for_the_expansion,
    "cut where nothing rises": replacing(Isolator, "_require_rise")(lambda honest, self, a, b, cut: None),
    "first root skipped": skip_the_first_root,
    "first wall in the list wins": exclude_nothing,
    "floor never asked": exclude_all_but_the_floor,
    "piece at the lower end of an enclosed time": knots_unseen,
    "piece in the middle of an enclosed time": piece_in_the_middle,
    "sums of cosines are 0 by their factors alone": replacing(rational, "_is_zero_sum")(
        lambda honest, factors: not factors
    ),
    "ties with the residual": tie_with_the_residual,
    "mouth's edge with the residual": edge_with_the_residual,
    "met at the horizon is met": hit_at_end_counts,
    "a start is on one wall at most": corner_unseen,
    "a base without an end": base_without_an_end,
    "no limit to the work": replacing(Arithmetic, "spend")(lambda honest, self, units: None),
    "mouth's width at departure": width_at_departure,
    "mouth always open": open_always,
    "base always closed": replacing(Course, "_beyond_crossing")(
        lambda honest, self, crossing: self._base_hit(crossing)
    ),
    "residual kept": keep_the_residual,
    "wall velocity reversed in the bounce": with_the_wall_reversed,
    "half the kick": replacing(chain, "reflect")(
        lambda honest, course, hit: honest(course, hit._replace(slope=hit.slope / 2))
    ),
    "left and right swapped": swapped_sides,
    "normal of a slanted side level": level_normal,
    "slope's derivative dropped": still_slope,
    "product rule of nu r dropped": width_with_still_nu,
    "r r'' dropped": square_without_second_derivative,
    "second derivatives by time dropped": hessian_without_time,
    "horizon overrun": with_a_later_horizon,
}
