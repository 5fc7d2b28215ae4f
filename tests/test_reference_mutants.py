"""What the reference answers is known from closed forms, and by the law of reflection in plain mpmath.

Nothing here compares the reference with its own earlier results. Each faulty reference fails this battery.
Further answers: test_hard_cases.
"""

import math
import random
from fractions import Fraction

import mpmath
import pytest
from support import faulty_references as faults
from support.answers_by_hand import ANSWERS
from support.depth import deep_among
from support.tables import BREATHING, LEAP

import reference
from conformance.cases.delicate_families import sunk
from reference import chain, rational, start, timeline, walls
from reference.arithmetic import MAX_WORK, Arithmetic, sign
from reference.course import SIDES, Course
from reference.isolation import Isolator
from reference.jets import Jet
from reference.timeline import Legs, law_in_time
from reference.walls import MovingWalls
from reference.waves import Waves
from scene import BangBang, Cap, Fourier, InvalidState, Mushroom, Rejected, State, Stem, Undecided, Undefined
from scene.laws import value
from scene.tables import laws

TILTING = Mushroom(
    r=Fourier(mean=1.0, omega=1.0, sin=(0.125,)),
    nu=Fourier(mean=0.5, omega=1.0, cos=(0.125,)),
    h=Fourier(mean=1.0, omega=1.0, sin=(-0.25,)),
    slope=Fourier(mean=0.0625, omega=1.0, sin=(0.0625,)),
)
DIGITS = 20
TINY = Fraction(1, 10**40)


def hit(scene, state, wall, t_end=100.0, digits=DIGITS, **options):
    found = reference.next_collision(scene, state, t_end, digits=digits, **options)
    assert isinstance(found, reference.Collision)
    assert found.wall == wall
    return found


def answers_by_hand():
    for name, (scene, state, t_end, expected, numbers) in ANSWERS.items():
        for digits in (DIGITS, 200):
            found = reference.next_collision(scene, state, t_end, digits=digits)
            if isinstance(found, Undefined):
                assert found.reason == expected, name
                continue
            if expected == "rejected":
                assert isinstance(found, Rejected), name
                continue
            assert isinstance(found, reference.Collision | reference.Horizon), name
            assert getattr(found, "wall", "horizon") == expected, name
            end = found.after if isinstance(found, reference.Collision) else found.at
            for field, number in numbers.items():
                enclosure = found.dt if field == "dt" else getattr(end, field)
                assert enclosure.contains(number) or abs(enclosure.centre() - number) < TINY, name


def starts_where_a_wall_turns():
    """At rest where an arc turns: after quarters, a sixth, an eighth, a ninth (sin 40 + sin 20 = sin 80)."""
    waves = [
        (0.0, Fourier(1.0, period=1.0, cos=(-0.25,))),
        (-7.75, Fourier(1.0, period=1.0, sin=(-0.25,))),
        (0.5, Fourier(1.0, period=3.0, cos=(-0.25, 0.125))),
        (0.125, Fourier(1.0, period=1.0, cos=(-0.375, 0.0, 0.125))),
        (1.0, Fourier(1.0, period=9.0, cos=(0.25, -0.125, 0.0, 0.0625))),
    ]
    for t, r in waves:
        opposite = Fourier(1.0, period=r.period, cos=[-a for a in r.cos], sin=[-b for b in r.sin])
        for law, expected in ((r, reference.Horizon), (opposite, Undefined)):
            start = State(t, 0.0, float(value(mpmath.mp, law, t)), 0.0, 0.0, "arc")
            assert isinstance(reference.next_collision(Cap(r=law), start, t + 0.125), expected)


def starts():
    """One flight to each wall of a mushroom in which everything moves."""
    return [
        ("arc", State(0.5, 0.1, 0.3, 2.0, 3.0)),
        ("base", State(0.5, 0.9, 0.2, 0.25, -2.0)),
        ("right", State(0.5, 0.1, -0.3, 3.0, 0.5)),
        ("left", State(0.5, 0.1, -0.3, -3.0, -0.5)),
        ("floor", State(0.5, 0.1, -0.3, 0.25, -3.0)),
    ]


def wall_function(scene, wall):
    def law(name, t):
        return value(mpmath.mp, laws(scene)[name], t)

    def width(y, t):
        return law("nu", t) * law("r", t) + law("slope", t) * y

    return {
        "arc": lambda x, y, t: law("r", t) - mpmath.sqrt(x * x + y * y),
        "base": lambda x, y, t: y,
        "right": lambda x, y, t: width(y, t) - x,
        "left": lambda x, y, t: width(y, t) + x,
        "floor": lambda x, y, t: y + law("h", t),
    }[wall]


def law_of_reflection():
    """V' = v - 2 (v.n - u) n, with n and u from numerical derivatives of the wall's equation."""
    with mpmath.workdps(50):
        for wall, q in starts():
            found = hit(TILTING, q, wall)
            f = wall_function(TILTING, wall)
            s = (found.dt.lo + found.dt.hi) / 2
            x, y, t = q.x + q.vx * s, q.y + q.vy * s, q.t + s
            assert abs(f(x, y, t)) < mpmath.mpf(10) ** -DIGITS
            for i in range(1, 50):
                assert f(q.x + q.vx * s * i / 50, q.y + q.vy * s * i / 50, q.t + s * i / 50) > 0
            f_x, f_y, f_t = (mpmath.diff(f, (x, y, t), n) for n in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
            push = 2 * (f_x * q.vx + f_y * q.vy + f_t) / (f_x**2 + f_y**2)
            assert abs((found.after.vx.lo) - (q.vx - push * f_x)) < mpmath.mpf(10) ** -15
            assert abs((found.after.vy.lo) - (q.vy - push * f_y)) < mpmath.mpf(10) ** -15


def differentiated():
    """The Jacobian's column by t is what moving the start in time by +-2^-20 shows."""
    q = State(0.5, 0.1, 0.3, 2.0, 3.0)
    found = hit(BREATHING, q, "arc", is_differentiated=True)
    ends = [
        hit(BREATHING, State(q.t + step, q.x, q.y, q.vx, q.vy), "arc") for step in (2.0**-20, -(2.0**-20))
    ]
    columns = zip(*((e.dt, *e.after[1:]) for e in ends), strict=True)
    for row, (plus, minus) in zip(found.jacobian, columns, strict=True):
        assert float(row[0]) == pytest.approx(float(plus.lo - minus.lo) * 2.0**19, abs=1e-8)


# A floor whose highest place is well below what its amplitudes add up to.
GRAZING = Stem(w=1.0, h=Fourier(mean=1.25, omega=1.0, cos=(0.125,), sin=(0.0, 0.125)))


def knot_within_an_enclosed_time():
    """The mouth is open when y = 0 is crossed; with its knot within the enclosure, nothing is said."""
    q = State(2.0**110, 0.3, 0.5, 0.02, 1.0)
    assert [step.wall for step in reference.trajectory(LEAP, q, 2).steps] == ["arc", "left"]
    for working in (6, 8, 10, 12, 15, 30, 60, 200):
        path = reference.trajectory(LEAP, q, 2, working=working)
        assert [step.wall for step in path.steps] in (["arc"], ["arc", "left"])
        assert len(path.steps) == 2 or (working <= 15 and isinstance(path.outcome, Undecided))


def floor_within_an_enclosed_time():
    """After the side, the floor begins to rise a little before or after it would be met."""
    for i in range(40):
        knot = 4096.0 + 1.0 + (i - 20) * 2.0**-24
        low = BangBang(
            knots=((4096.0, 1.0), (knot, 1.0), (knot + 2.0**-20, 0.5), (4104.0, 0.5), (4112.0, 1.0))
        )
        q = State(4096.0, 0.5, -0.25, 1.0, -0.75 + 2.0**-30)
        exact = reference.trajectory(Stem(w=1.0, h=low), q, 2, digits=20).steps
        assert len(exact) == 2
        truth = exact[-1]
        path = reference.trajectory(Stem(w=1.0, h=low), q, 2, working=8)
        for step in path.steps[1:]:
            assert step.dt.lo <= truth.dt.hi
            assert truth.dt.lo <= step.dt.hi
            assert step.after.vy.lo <= truth.after.vy.hi
            assert truth.after.vy.lo <= step.after.vy.hi


def ripples(mean, amplitude):
    """A law of sixteen harmonics, with a sine and a cosine each."""
    sin = tuple(amplitude * (-1) ** (k * k // 3) for k in range(16))
    return Fourier(mean=mean, omega=1.0, sin=sin, cos=tuple(amplitude * (-1) ** (k // 2) for k in range(16)))


def bounded_work():
    """A side of sixteen harmonics, approached by 1e-10 in a period over 1e10 of them: given up, and soon."""
    spent = [0]
    honest = Arithmetic.spend

    def watched(self, units):
        spent[0] += units
        assert spent[0] < MAX_WORK + 1_000
        honest(self, units)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Arithmetic, "spend", watched)
        slow = State(0.0, 0.5, -1.01, 1e-11, -1e-11)
        rough = Stem(w=ripples(1.0, 0.02), h=ripples(2.0, 0.05), slope=0.01)
        assert isinstance(reference.next_collision(rough, slow, 1e16, digits=DIGITS), Undecided)
    rests = State(0.0, 0.5, -1.01, 0.0, 0.0)
    assert isinstance(reference.next_collision(GRAZING, rests, 1e10, digits=DIGITS), reference.Horizon)


def starts_along_a_wall_that_rests():
    """Chords of a standing arc known so badly in the end that they may begin along it: given up at once.

    A constant law costs no work, so that only reasoning ends the search for a time at which f rises.
    """
    draw, n_cuts, honest = random.Random(3), [0], Isolator._split

    def watched(self, a, b):
        n_cuts[0] += 1
        assert n_cuts[0] < 500
        return honest(self, a, b)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Isolator, "_split", watched)
        for _ in range(300):
            place, speed = draw.uniform(0.1, 3.0), 10.0 ** draw.uniform(-1.0, 3.0)
            course = place + draw.choice((1.0, -1.0)) * draw.uniform(1.0, 1.5)
            vx, vy = -speed * math.cos(course), -speed * math.sin(course)
            start = State(0.0, math.cos(place), math.sin(place), vx, vy, "arc")
            n_cuts[0] = 0
            path = reference.trajectory(Cap(r=1.0), start, 40, working=draw.choice((6, 7, 8)))
            assert isinstance(path.outcome, Undecided | Rejected | None)


def slow_beside_waves():
    """Particles slower than a floor of waves that cancel at times, near it: no wall is skipped."""
    draw, context = random.Random(1), mpmath.MPContext()
    context.prec = 120
    for i in range(60):
        left, v, t = 10.0 ** -draw.uniform(1.0, 4.0), 10.0 ** -draw.uniform(0.0, 5.0), draw.random()
        floor = sunk(1 + i % 4, left, draw.random())
        height = (
            left * draw.uniform(0.5, 1.0) if i % 2 else float(value(context, floor, context.mpf(t))) * 0.9
        )
        start = State(t, 0.25, -height, 0.125 * v, v if i % 3 else -v)
        found = reference.next_collision(Stem(w=1.0, h=floor), start, t + 4.0, digits=DIGITS)
        assert isinstance(found, reference.Collision | reference.Horizon)
        is_hit = isinstance(found, reference.Collision)
        end = context.mpf(found.dt.lo if isinstance(found, reference.Collision) else 4)
        for j in range(300):
            s = end * j / 300
            assert value(context, floor, t + s) + start.y + start.vy * s > 0
        if is_hit and found.wall == "floor":
            assert abs(value(context, floor, t + end) + start.y + start.vy * end) < 1e-17


def slow_across_periods():
    """Particles that come to a wall within thousands of periods, whose waves never are all at their least."""
    draw, context = random.Random(3), mpmath.MPContext()
    context.prec = 120
    for i in range(12):
        law = Fourier(mean=1.0, period=1.0, sin=(0.1, 0.02, draw.uniform(-0.02, 0.02)), cos=(0.05,))
        v = 10.0 ** -draw.uniform(2.5, 5.5)
        scene, start = (
            (Stem(w=1.0, h=law), State(draw.random(), 0.25, -0.5, 0.125 * v, -v)),
            (Stem(w=law, h=1.0), State(draw.random(), 0.5, -0.5, v, 0.0)),
            (Cap(r=law), State(draw.random(), 0.0, 0.5, 0.0, v)),
        )[i % 3]
        end = context.mpf(hit(scene, start, ("floor", "right", "arc")[i % 3], t_end=1e9).dt.lo)
        place = 0.5 + v * end
        assert abs(value(context, law, start.t + end) - place) < 1e-14
        for j in range(1, 400):  # at a wall's least it is as near as it will be for a period
            s = end - j / 128
            assert value(context, law, start.t + s) > 0.5 + v * s


def waves_within_their_enclosures():
    """A law and its derivatives within intervals of all lengths, where waves cancel and elsewhere."""
    draw, arithmetic = random.Random(2), Arithmetic(DIGITS)
    fine = Arithmetic(2 * DIGITS)
    for i in range(120):
        law = sunk(1 + i % 6, 10.0 ** -draw.uniform(1.0, 8.0), draw.random())
        start, length = Fraction(draw.uniform(-2.0, 2.0)), Fraction(10.0 ** -draw.uniform(0.3, 15.0))
        whole = law_in_time(arithmetic, law, Fraction(0)).jet(arithmetic.between(start, start + length))
        for j in range(9):
            there = law_in_time(fine, law, Fraction(0)).jet(fine.dyadic(start + length * Fraction(j, 8)))
            for wide, thin in zip(whole, there, strict=True):
                assert thin in arithmetic.context.mpf(wide)


# The two that take seconds come last: most faults have been found out by then.
BATTERY = (
    knot_within_an_enclosed_time,
    answers_by_hand,
    starts_where_a_wall_turns,
    law_of_reflection,
    differentiated,
    starts_along_a_wall_that_rests,
    waves_within_their_enclosures,
    slow_beside_waves,
    slow_across_periods,
    floor_within_an_enclosed_time,
    bounded_work,
)


@pytest.mark.parametrize("check", BATTERY)
def test_the_reference_passes(check):
    check()


@faults.replacing(Isolator, "first_root")
def skip_the_first_root(honest, self, start, end):
    root = honest(self, start, end)
    if root is None:
        return None
    for i in range(1, 65):  # from where f > 0 again
        later = self.arithmetic.middle(root.time + (end - root.time) * self.arithmetic.number(i) / 65)
        if self.value(later) > 0:
            return honest(self, later, end)
    return None


@faults.replacing(Course, "_first_hit")
def exclude_nothing(honest, self, walls, start, limit):
    """The first wall in the list that is hit at all, others not asked."""
    for wall in walls:
        found = honest(self, (wall,), start, limit)
        if found is not None:
            return found
    return None


@faults.replacing(Course, "_first_hit")
def exclude_all_but_the_floor(honest, self, walls, start, limit):
    return honest(self, tuple(wall for wall in walls if wall != "floor") or walls, start, limit)


@faults.replacing(Legs, "jet")
def piece_in_the_middle(honest, self, s):
    """Of the pieces that an enclosed time may touch, the one in its middle is believed."""
    if s.delta == 0 or s.delta > 2.0**-10:
        return honest(self, s)
    middle = honest(self, self.arithmetic.middle(s))
    return Jet(middle.f + s.delta * middle.d1, middle.d1 + s.delta * middle.d2, middle.d2)


@faults.replacing(Isolator, "__init__")
def keep_the_residual(honest, self, arithmetic, jet, begin, residual=None, **options):
    honest(self, arithmetic, jet, begin, None, **options)


@faults.replacing(Course, "_beyond_crossing")
def edge_with_the_residual(honest, self, crossing):
    leaving, self.leaving = self.leaving, {}
    try:
        return honest(self, crossing)
    finally:
        self.leaving = leaving


@faults.replacing(Course, "_beyond_crossing")
def width_at_departure(honest, self, crossing):
    self.motion.width = lambda s: MovingWalls.width(self.motion, self.arithmetic.zero if s is crossing else s)
    return honest(self, crossing)


@faults.replacing(Course, "__init__")
def with_a_later_horizon(honest, self, scene, motion, leaving, is_flat, in_cap, end, exact):
    honest(self, scene, motion, leaving, is_flat, in_cap, None if end is None else end + 9, exact)


@faults.replacing(Course, "_beyond_crossing")
def open_always(honest, self, crossing):
    if not isinstance(self.scene, Mushroom):
        return honest(self, crossing)
    walls = SIDES if self.in_cap else ("arc",)
    return self._first_hit(walls, self.arithmetic.lower(crossing), None)


@faults.replacing(chain, "reflect")
def with_the_wall_reversed(honest, course, hit):
    f_t = course.motion.gradient(hit.wall, hit.time)[2]
    return honest(course, hit._replace(slope=hit.slope - 2 * f_t))


@faults.replacing(MovingWalls, "wall")
def swapped_sides(honest, self, wall, s):
    return honest(self, {"left": "right", "right": "left"}.get(wall, wall), s)


@faults.replacing(MovingWalls, "gradient")
def level_normal(honest, self, wall, s):
    f_x, f_y, f_t = honest(self, wall, s)
    return f_x, self.arithmetic.zero if wall in ("left", "right") else f_y, f_t


@faults.replacing(MovingWalls, "law")
def still_slope(honest, self, name, s):
    jet = honest(self, name, s)
    return Jet(jet.f, None, None) if name == "slope" else jet


@faults.replacing(MovingWalls, "width")
def width_with_still_nu(honest, self, s):
    if "nu" not in self.timeline.laws:
        return honest(self, s)
    nu, r = self.law("nu", s), self.law("r", s)
    return Jet(nu.f * r.f, None if r.d1 is None else nu.f * r.d1, None)


@faults.replacing(walls, "square")
def square_without_second_derivative(honest, arithmetic, p):
    if p.d1 is None:
        return Jet(arithmetic.square(p.f), None, None)
    return Jet(arithmetic.square(p.f), 2 * (p.f * p.d1), 2 * arithmetic.square(p.d1))


@faults.replacing(MovingWalls, "hessian")
def hessian_without_time(honest, self, wall, s):
    zero = self.arithmetic.zero
    two = self.arithmetic.number(-2)
    return (two, two, zero, zero) if wall == "arc" else (zero, zero, zero, zero)


@faults.replacing(start, "_judge_on_base")
def base_without_an_end(honest, scene, state, motion):
    """The arc is asked only whether the state is surely beyond it."""
    if sign(motion.wall("arc", motion.arithmetic.zero).f) < 0:
        raise InvalidState("beyond wall arc")
    return Undefined("sliding") if state.vy == 0 else None


@faults.replacing(Waves, "_powers")
def powers_of_later_times(honest, self, away):
    """As if the point of the expansion were the interval's begin."""
    later = self.arithmetic.hull(self.arithmetic.zero, away)
    return honest(self, later)


@faults.replacing(timeline.Timeline, "__init__")
def half_a_turn(honest, self, arithmetic, scene, instant):
    honest(self, arithmetic, scene, instant)
    self.turn = None if self.turn is None else self.turn / 2


@faults.replacing(Waves, "__init__")
def waves_without_a_remainder(honest, self, arithmetic, law, instant):
    honest(self, arithmetic, law, instant)
    self.bound = arithmetic.zero


@faults.replacing(Isolator, "_expanded")
def tangent_for_the_expansion(honest, self, whole, jet):
    """Without the second derivative's part."""
    return honest(self, whole, jet._replace(d2=self.arithmetic.zero))._replace(d2=jet.d2)


MUTANTS = {
    "waves without a remainder": waves_without_a_remainder,
    "odd powers of a negative time dropped": powers_of_later_times,
    "never reached from the first place": faults.swept_begins_alone,
    "never met in half a period": half_a_turn,
    "f by its tangent": tangent_for_the_expansion,
    "cut where nothing rises": faults.replacing(Isolator, "_require_rise")(
        lambda honest, self, a, b, cut: None
    ),
    "first root skipped": skip_the_first_root,
    "first wall in the list wins": exclude_nothing,
    "floor never asked": exclude_all_but_the_floor,
    "piece at the lower end of an enclosed time": faults.knots_unseen,
    "piece in the middle of an enclosed time": piece_in_the_middle,
    "sums of cosines are 0 by their factors alone": faults.replacing(rational, "_is_zero_sum")(
        lambda honest, factors: not factors
    ),
    "ties with the residual": faults.tie_with_the_residual,
    "mouth's edge with the residual": edge_with_the_residual,
    "met at the horizon is met": faults.hit_at_end_counts,
    "a start is on one wall at most": faults.corner_unseen,
    "a base without an end": base_without_an_end,
    "no limit to the work": faults.replacing(Arithmetic, "spend")(lambda honest, self, units: None),
    "mouth's width at departure": width_at_departure,
    "mouth always open": open_always,
    "base always closed": faults.replacing(Course, "_beyond_crossing")(
        lambda honest, self, crossing: self._base_hit(crossing)
    ),
    "residual kept": keep_the_residual,
    "wall velocity reversed in the bounce": with_the_wall_reversed,
    "half the kick": faults.replacing(chain, "reflect")(
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


@pytest.mark.parametrize("name", deep_among(MUTANTS, "half the kick", "no limit to the work"))
def test_a_mutant_is_killed(name, monkeypatch):
    """Killed by an answer that is wrong, or missing, not by a crash."""
    MUTANTS[name](monkeypatch)

    def battery():
        for check in BATTERY:
            check()

    with pytest.raises(AssertionError):
        battery()
