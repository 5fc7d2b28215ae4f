"""Jacobians of steps and trajectories: differences, the symplectic form, backward ulps."""

import dataclasses
import math
import random
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from mpmath import fp
from support.truth import centre, jacobian_error, proved_step

import fast
import reference.path
from conformance.cases.certify import ask, condition_number, flight_of
from conformance.grading.agreement import compare
from conformance.strategies import scenes_and_states
from scene import BangBang, Cap, Fourier, Mushroom, State, load
from scene.laws import value

FROM_THE_CAP = State(0.3, 0.1, 0.2, 3.0, 4.0)


def presymplectic(vx, vy):
    """Return dx ^ dvx + dy ^ dvy - dt ^ d(v^2/2) as a matrix over (t, x, y, vx, vy)."""
    form = np.full((5, 5), Fraction(0))
    form[1, 3] = form[2, 4] = Fraction(1)
    form[0, 3:] = -vx, -vy
    return form - form.T


def is_kept(jacobian, before, after, tolerance):
    """Tell whether the map with this Jacobian keeps the form, to a share of its terms."""
    form = jacobian.T @ presymplectic(*after) @ jacobian
    size = max(1, *abs(jacobian).flat) ** 2 * (1 + max(map(abs, after)))
    return (abs(form - presymplectic(*before)) <= tolerance * size).all()


def centres(jacobian):
    return np.array([[centre(d) for d in row] for row in jacobian])


def state_jacobian(outcome):
    """Return d(t, x, y, vx, vy) after / before as exact centres: row dt becomes row t."""
    rows = centres(outcome.jacobian)
    rows[0, 0] += 1
    return rows


@settings(max_examples=120)
@given(scenes_and_states())
def test_step_keeps_the_symplectic_form(drawn):
    """In free flight starts (no residual) the step is symplectic in (x, y, vx, vy, t, E)."""
    scene, s, t_end = drawn
    free = State(s.t, s.x, s.y, s.vx, s.vy)
    outcome = reference.next_collision(scene, free, t_end, digits=40, is_differentiated=True)
    if not isinstance(outcome, reference.Collision):
        return
    before = Fraction(s.vx), Fraction(s.vy)
    after = centre(outcome.after.vx), centre(outcome.after.vy)
    assert is_kept(state_jacobian(outcome), before, after, Fraction(1, 10**25))


@pytest.mark.parametrize("scale", [Fraction(1001, 1000), Fraction(-1)])
@pytest.mark.parametrize("row", [0, 3, 4])
def test_a_spoilt_jacobian_does_not(row, scale):
    outcome = reference.next_collision(
        load("moving-cap"), FROM_THE_CAP, 9.0, digits=40, is_differentiated=True
    )
    rows = state_jacobian(outcome)
    rows[row] *= scale
    after = centre(outcome.after.vx), centre(outcome.after.vy)
    assert not is_kept(rows, (Fraction(3), Fraction(4)), after, Fraction(1, 10**25))


def test_trajectory_keeps_the_symplectic_form():
    path = reference.trajectory(load("moving-cap"), FROM_THE_CAP, 12, digits=40, is_differentiated=True)
    last = path.steps[-1].after
    after = centre(last.vx), centre(last.vy)
    assert is_kept(centres(path.jacobian), (Fraction(3), Fraction(4)), after, Fraction(1, 10**20))


@pytest.mark.parametrize(
    ("start", "walls"),
    [(FROM_THE_CAP, ["arc", "floor", "arc", "arc", "base"]), (State(0.3, 0.1, -0.2, 10.0, -27.0), ["floor"])],
)
def test_jacobian_against_differences(start, walls):
    assert jacobian_error(load("moving-cap"), start, walls) < 1e-9


def hops(rng):
    """Return a cap and a start on its arc, residual and all, from which the arc is met again and again."""
    r = Fourier(mean=1.0, omega=1.0, cos=(rng.choice((0.0, 0.1)),)) if rng.random() < 0.5 else 1.0
    t, angle, lift = rng.uniform(-3.0, 3.0), rng.uniform(0.05, 0.2), rng.uniform(0.02, 0.1)
    now, off = float(value(fp, r, t)), 1.0 + rng.uniform(-1.0, 1.0) * 2.0**-24
    x, y = now * off * math.cos(angle), now * off * math.sin(angle)
    return Cap(r=r), State(t, x, y, -4.0 * math.sin(angle + lift), 4.0 * math.cos(angle + lift), "arc")


def test_a_wall_met_again_and_again_keeps_a_residual_that_moves_with_the_first_start():
    """On the second hop, too, the residual is f(0) of the start: held fixed, the chain would be wrong."""
    rng = random.Random(7)
    for n in (1, 2, 2, 3):
        assert jacobian_error(*hops(rng), ["arc"] * n) < 1e-9


def test_a_residual_held_fixed_after_the_first_hop_is_found_out(monkeypatch):
    honest = reference.path.step_jacobian

    def fixed(course, hit):
        leaving = course.leaving if course.flight.begin == 0 else {}
        return honest(dataclasses.replace(course, leaving=leaving), hit)

    monkeypatch.setattr(reference.path, "step_jacobian", fixed)
    rng = random.Random(7)
    assert jacobian_error(*hops(rng), ["arc"]) < 1e-9
    assert jacobian_error(*hops(rng), ["arc", "arc"]) > 1e-3


def test_condition_number_of_a_grazing_hit():
    """A graze with v_n / v = e has derivatives of order 1/e: the measure stays fair."""
    scene = load("frozen-mushroom")
    state = State(0.0, 0.0, 1.0 - 2.0**-30, 1.0, 0.0)
    flight = flight_of(ask(scene, state, 10.0), state, 10.0)
    largest = max(abs(d) for row in flight.jacobian for d in row)
    assert 1e3 < largest < 1e6
    truth = proved_step(scene, state, 10.0)
    assert compare(fast.next_collision(scene, state, 10.0), truth, state, 16.0).kind == "agrees"
    condition = condition_number(flight.centre(), flight.allowance(state))
    assert 1e7 < condition < 1e10  # dt is sqrt(2) 2^-15, its derivative by y 2^15 / sqrt(2)


def test_condition_number_of_a_head_on_hit():
    """Along a radius from the centre: dt = 1/v and v' = -v have condition 1."""
    state = State(0.0, 0.0, 0.0, 0.0, 2.0)
    flight = flight_of(ask(Cap(r=1.0), state, 10.0), state, 10.0)
    assert condition_number(flight.centre(), flight.allowance(state)) == 1.0


@pytest.mark.parametrize("time", [1.0, 0.5], ids=["at a knot", "in the middle of a leg"])
def test_at_a_knot_the_sensitivity_is_that_of_the_steeper_side(time):
    """Starts that differ by single roundings meet the wall on either side of a jump of its acceleration."""
    law = BangBang(((0.0, 1.0), (1.0, 0.6), (1.5, 0.85), (4.0, 1.0)))
    begin, v = time - 0.75, 0.9
    x = v * (time - begin) - float(value(fp, law, time))
    starts = [State(begin + k * math.ulp(begin), x, -0.5, -v, 0.01) for k in range(-3, 4)]
    found = [proved_step(Mushroom(r=2.0, h=2.0, w=law, slope=0.0), s, 10.0).steps[0] for s in starts]
    times = [Fraction(s.t) + step.centre("dt") for s, step in zip(starts, found, strict=True)]
    assert {step.wall for step in found} == {"left"}
    assert min(times) < time < max(times)
    steepness = [step.allowance[3] for step in found]
    assert min(steepness) > 0.999 * max(steepness)


def test_a_hit_just_before_a_knot_is_not_held_to_the_leg_before_alone():
    """Rounding moves the hit by 6e-17 over a knot beyond which the mouth accelerates 40 times as much."""
    knots = (
        (-0.7119462478359613, 0.49512399995280476),
        (-0.5866977437708769, 0.43470125731491827),
        (-0.21194624783596128, 0.43722517904960634),
        (1.2880537521640387, 0.49512399995280476),
    )
    table = Mushroom(r=1.9961775733737999, h=0.3929973578450618, w=BangBang(knots), slope=0.02106190796508007)
    place, velocity = (
        (-0.23916496289503963, 0.12367447731517013),
        (-0.8384924649634439, -1.7491212604217496),
    )
    state = State(-1.007335620199992, *place, *velocity)
    found = compare(fast.next_collision(table, state, 10.0), proved_step(table, state, 10.0), state)
    assert found.kind == "agrees"
    assert found.ulps < 4
