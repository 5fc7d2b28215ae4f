"""Faulty references: each of these mutants must fail a battery that the reference itself passes."""

from __future__ import annotations

import pytest
from support.depth import deep_among
from support.reference_battery import BATTERY

from reference import chain, rational, start, timeline, walls, waves
from reference.arithmetic import Arithmetic, exact_ends, sign
from reference.course import SIDES, Course
from reference.isolation import Isolator
from reference.jets import Jet
from reference.walls import MovingWalls
from scene import InvalidState, Mushroom, Undefined

first_root = Isolator.first_root
first_hit = Course._first_hit
beyond_crossing = Course._beyond_crossing
never_reached = Isolator._is_never_reached
isolator_init = Isolator.__init__
course_init = Course.__init__
wall_of = MovingWalls.wall
gradient = MovingWalls.gradient
law_of = MovingWalls.law
width_of = MovingWalls.width
reflect = chain.reflect
wall_jet = rational.wall_jet
legs_jet = timeline.Legs.jet
waves_init, powers_of = waves.Waves.__init__, waves.Waves._powers
expanded = Isolator._expanded
timeline_init = timeline.Timeline.__init__


def skip_the_first_root(self, start, end):
    root = first_root(self, start, end)
    if root is None:
        return None
    for i in range(1, 65):  # from where f > 0 again
        later = self.arithmetic.middle(root.time + (end - root.time) * self.arithmetic.number(i) / 65)
        if self.value(later) > 0:
            return first_root(self, later, end)
    return None


def exclude_nothing(self, walls, start, limit):
    """The first wall in the list that is hit at all, others not asked."""
    for wall in walls:
        found = first_hit(self, (wall,), start, limit)
        if found is not None:
            return found
    return None


def exclude_all_but_the_floor(self, walls, start, limit):
    return first_hit(self, tuple(wall for wall in walls if wall != "floor") or walls, start, limit)


def piece_at_the_lower_end(self, s):
    """Only the piece of a law that holds where an enclosed time begins."""
    low = self.instant + exact_ends(s)[0]
    turn = (low - self.starts[0]) // self.period * self.period
    i = timeline.bisect_right(self.starts, low - turn) - 1
    return self._on(i, turn, s)


def piece_in_the_middle(self, s):
    """Of the pieces that an enclosed time may touch, the one in its middle is believed."""
    if s.delta == 0 or s.delta > 2.0**-10:
        return legs_jet(self, s)
    middle = legs_jet(self, self.arithmetic.middle(s))
    return Jet(middle.f + s.delta * middle.d1, middle.d1 + s.delta * middle.d2, middle.d2)


def keep_the_residual(self, arithmetic, jet, begin, residual=None, **options):
    isolator_init(self, arithmetic, jet, begin, None, **options)


def tie_with_the_residual(scene, state, wall, s):
    jet = wall_jet(scene, state, wall, s)
    return jet is not None and jet[0] == 0


def edge_with_the_residual(self, crossing):
    leaving, self.leaving = self.leaving, {}
    try:
        return beyond_crossing(self, crossing)
    finally:
        self.leaving = leaving


def width_at_departure(self, crossing):
    self.motion.width = lambda s: width_of(self.motion, self.arithmetic.zero if s is crossing else s)
    return beyond_crossing(self, crossing)


def with_a_later_horizon(self, scene, motion, leaving, is_flat, in_cap, end, exact):
    course_init(self, scene, motion, leaving, is_flat, in_cap, None if end is None else end + 9, exact)


def met_before_the_horizon(self, hit):
    return False


def one_wall_at_most(scene, state):
    return [state.wall] if state.wall else start_walls(scene, state)


start_walls = start._walls_near


def open_always(self, crossing):
    if not isinstance(self.scene, Mushroom):
        return beyond_crossing(self, crossing)
    walls = SIDES if self.in_cap else ("arc",)
    return self._first_hit(walls, self.arithmetic.lower(crossing), None)


def with_the_wall_reversed(course, hit):
    f_t = course.motion.gradient(hit.wall, hit.time)[2]
    return reflect(course, hit._replace(slope=hit.slope - 2 * f_t))


def swapped_sides(self, wall, s):
    return wall_of(self, {"left": "right", "right": "left"}.get(wall, wall), s)


def level_normal(self, wall, s):
    f_x, f_y, f_t = gradient(self, wall, s)
    return f_x, self.arithmetic.zero if wall in ("left", "right") else f_y, f_t


def still_slope(self, name, s):
    jet = law_of(self, name, s)
    return Jet(jet.f, None, None) if name == "slope" else jet


def width_with_still_nu(self, s):
    if "nu" not in self.timeline.laws:
        return width_of(self, s)
    nu, r = self.law("nu", s), self.law("r", s)
    return Jet(nu.f * r.f, None if r.d1 is None else nu.f * r.d1, None)


def square_without_second_derivative(arithmetic, p):
    if p.d1 is None:
        return Jet(arithmetic.square(p.f), None, None)
    return Jet(arithmetic.square(p.f), 2 * (p.f * p.d1), 2 * arithmetic.square(p.d1))


def hessian_without_time(self, wall, s):
    zero = self.arithmetic.zero
    two = self.arithmetic.number(-2)
    return (two, two, zero, zero) if wall == "arc" else (zero, zero, zero, zero)


def base_without_an_end(scene, state, motion):
    """The arc is asked only whether the state is surely beyond it."""
    if sign(motion.wall("arc", motion.arithmetic.zero).f) < 0:
        raise InvalidState("beyond wall arc")
    return Undefined("sliding") if state.vy == 0 else None


def never_reached_from_the_first_place(self, a, b):
    """Where the flight is at b is not asked."""
    with pytest.MonkeyPatch.context() as patch:
        if ask := self.is_never_met:
            patch.setattr(self, "is_never_met", lambda s: s is b or ask(s))
        return never_reached(self, a, b)


def powers_of_later_times(self, away):
    """As if the point of the expansion were the interval's begin."""
    later = self.arithmetic.hull(self.arithmetic.zero, away)
    return powers_of(self, later)


def half_a_turn(self, arithmetic, scene, instant):
    timeline_init(self, arithmetic, scene, instant)
    self.turn = None if self.turn is None else self.turn / 2


def waves_without_a_remainder(self, arithmetic, law, instant):
    waves_init(self, arithmetic, law, instant)
    self.bound = arithmetic.zero


def tangent_for_the_expansion(self, whole, jet):
    """Without the second derivative's part."""
    return expanded(self, whole, jet._replace(d2=self.arithmetic.zero))._replace(d2=jet.d2)


MUTANTS = {
    "waves without a remainder": (waves.Waves, "__init__", waves_without_a_remainder),
    "odd powers of a negative time dropped": (waves.Waves, "_powers", powers_of_later_times),
    "never reached from the first place": (
        Isolator,
        "_is_never_reached",
        never_reached_from_the_first_place,
    ),
    "never met in half a period": (timeline.Timeline, "__init__", half_a_turn),
    "f by its tangent": (Isolator, "_expanded", tangent_for_the_expansion),
    "cut where nothing rises": (Isolator, "_require_rise", lambda self, a, b, cut: None),
    "first root skipped": (Isolator, "first_root", skip_the_first_root),
    "first wall in the list wins": (Course, "_first_hit", exclude_nothing),
    "floor never asked": (Course, "_first_hit", exclude_all_but_the_floor),
    "piece at the lower end of an enclosed time": (timeline.Legs, "jet", piece_at_the_lower_end),
    "piece in the middle of an enclosed time": (timeline.Legs, "jet", piece_in_the_middle),
    "sums of cosines are 0 by their factors alone": (rational, "_is_zero_sum", lambda factors: not factors),
    "ties with the residual": (rational, "is_zero", tie_with_the_residual),
    "mouth's edge with the residual": (Course, "_beyond_crossing", edge_with_the_residual),
    "met at the horizon is met": (Course, "_is_at_horizon", met_before_the_horizon),
    "a start is on one wall at most": (start, "_walls_near", one_wall_at_most),
    "a base without an end": (start, "_judge_on_base", base_without_an_end),
    "no limit to the work": (Arithmetic, "spend", lambda self, units: None),
    "mouth's width at departure": (Course, "_beyond_crossing", width_at_departure),
    "mouth always open": (Course, "_beyond_crossing", open_always),
    "base always closed": (
        Course,
        "_beyond_crossing",
        lambda self, crossing: self._base_hit(crossing),
    ),
    "residual kept": (Isolator, "__init__", keep_the_residual),
    "wall velocity reversed in the bounce": (chain, "reflect", with_the_wall_reversed),
    "half the kick": (
        chain,
        "reflect",
        lambda course, hit: reflect(course, hit._replace(slope=hit.slope / 2)),
    ),
    "left and right swapped": (MovingWalls, "wall", swapped_sides),
    "normal of a slanted side level": (MovingWalls, "gradient", level_normal),
    "slope's derivative dropped": (MovingWalls, "law", still_slope),
    "product rule of nu r dropped": (MovingWalls, "width", width_with_still_nu),
    "r r'' dropped": (walls, "square", square_without_second_derivative),
    "second derivatives by time dropped": (MovingWalls, "hessian", hessian_without_time),
    "horizon overrun": (Course, "__init__", with_a_later_horizon),
}


@pytest.mark.parametrize("check", BATTERY)
def test_the_reference_passes(check):
    check()


@pytest.mark.parametrize("name", deep_among(MUTANTS, "half the kick", "no limit to the work"))
def test_a_mutant_is_killed(name, monkeypatch):
    """Killed by an answer that is wrong, or missing, not by a crash."""
    monkeypatch.setattr(*MUTANTS[name])

    def battery():
        for check in BATTERY:
            check()

    with pytest.raises(AssertionError):
        battery()
