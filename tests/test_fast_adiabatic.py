"""Laws of the breathing circle (sec. 3.1), with exponents measured and not only bounded."""

from __future__ import annotations

import numpy as np
import pytest

import fast
import reference
from reference.arithmetic import rational
from scene import State, load

SCENE = load("breathing-circle")
SPEEDS = (50.0, 200.0, 800.0, 3200.0)
ANGLE = 0.7  # of the velocity to the y axis


def arc_hits(speed: float, span: float):
    """Return t, impact angle and speed just before every arc hit."""
    start = State(0.0, 0.3, 0.2, speed * np.sin(ANGLE), speed * np.cos(ANGLE))
    path = fast.trajectory(SCENE, start, 200_000, t_end=span)
    before = np.vstack([[start.vx, start.vy], path.steps[:-1, 4:6]])
    on_arc = np.array(path.walls) == "arc"
    t, x, y = path.steps[on_arc, 1:4].T
    vx, vy = before[on_arc].T
    speed_before = np.hypot(vx, vy)
    sine = np.abs(x * vy - y * vx) / (speed_before * np.hypot(x, y))
    return t, np.arcsin(sine), speed_before


def exponent(sizes):
    """Return d log size / d log v by least squares."""
    return np.polyfit(np.log(SPEEDS), np.log(sizes), 1)[0]


def test_angle_changes_by_order_v_to_minus_2_a_hit():
    """Eq. cbm: phi' - phi = O(v^-2)."""
    sizes = [np.max(np.abs(np.diff(arc_hits(v, 6.0)[1]))) for v in SPEEDS]
    assert exponent(sizes) == pytest.approx(-2.0, abs=0.1)


def test_angle_and_v_r_are_kept_to_order_1_over_v():
    """Over a period, O(v) hits: phi and v r drift by O(1/v)."""
    angle, v_r = [], []
    for v in SPEEDS:
        t, phi, speed = arc_hits(v, 2 * np.pi)
        action = speed * (1 + 0.5 * np.sin(t))
        angle.append(np.ptp(phi))
        v_r.append(np.ptp(action) / action[0])
    assert exponent(angle) == pytest.approx(-1.0, abs=0.15)
    assert exponent(v_r) == pytest.approx(-1.0, abs=0.15)


def test_e_v_cap_is_invariant():
    """Sec. 3.1: E V_cap returns and stays, while E itself changes ninefold."""
    t, _, speed = arc_hits(3200.0, 2 * np.pi)
    energy = speed**2 / 2
    e_v_cap = energy * np.pi**2 * (1 + 0.5 * np.sin(t)) ** 2
    assert np.ptp(energy) / energy.min() > 7
    assert np.ptp(e_v_cap) / e_v_cap[0] < 10 / 3200.0


def test_angular_momentum_is_exact():
    """|L| at every hit, enclosed by the reference, contains the starting value."""
    start = State(0.0, 0.3, 0.2, 5.0, 7.0)
    path = reference.trajectory(SCENE, start, 40, digits=30)
    first = abs(0.3 * 7.0 - 0.2 * 5.0)
    for step in path.steps:
        x, y, vx, vy = ((rational(c.lo._mpf_) + rational(c.hi._mpf_)) / 2 for c in step.after[1:])
        assert abs(float(abs(x * vy - y * vx)) - first) < 1e-15


def test_angular_momentum_in_floats_drifts_like_rounding():
    start = State(0.0, 0.3, 0.2, 500.0, 700.0)
    path = fast.trajectory(SCENE, start, 20_000)
    _, _, x, y, vx, vy = path.steps.T
    drift = np.abs(np.abs(x * vy - y * vx) / 110.0 - 1)
    assert drift.max() < 20_000 * 4 * 2.0**-53
