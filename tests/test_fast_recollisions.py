"""Starts on walls: re-collisions just after a knot, starts on two walls, starts a little off their wall.

A wall met again just after a knot of its law keeps its speed. A start may be a little off the wall that it
names: a flow from there goes where a path does. Captured particles are followed unfolded, in which a hop
along the arc and a chord through the base are one; but a hop keeps what distance from the arc a start was
given, and a flight that comes from the base does not.
"""

import math
import os

import numpy as np
import pytest
from support.answers_by_hand import SURE, UNDEFINED
from support.truth import proved_step

import fast
from conformance.cases.draw import Draw
from conformance.cases.scenes import Clock, point, scene as drawn_scene, state as drawn_state
from conformance.grading.agreement import compare
from scene import (
    BangBang,
    Cap,
    Collision,
    Fourier,
    Horizon,
    Mushroom,
    State,
    Stem,
    Undecided,
    Undefined,
)
from scene.geometry import rounded

N_RECOLLISIONS = int(os.environ.get("MUSHROOMS_RECOLLISIONS", "25"))


def plateaus(draw, low, high, shared):
    """Draw a law of legs some of which stand still; now and then a constant."""
    if draw.pick(range(3)) == 0:
        return draw.between(low, high)
    n, first, values = draw.pick((2, 3, 4)), draw.pick((0.0, 0.3125, -0.75)), [draw.between(low, high)]
    times = [first, *sorted(first + shared.rate * draw.between(0.02, 0.98) for _ in range(n))]
    for _ in range(n - 1):
        values.append(draw.pick((values[-1], draw.between(low, high))))
    legs = zip([*times, first + shared.rate], [values[-1], *values, values[-1]], strict=True)
    return BangBang(knots=tuple(legs))


def again(n):
    """Yield n recollisions: scene and state.

    Each start is on a wall that is met again just after a knot of its law, or while it turns: the wall has
    been at rest, or has moved with the particle, until nearly the hit. Its speed there is a multiple of the
    time since, which must be right relative to itself.
    """
    n_found, index = 0, 0
    while n_found < n:
        draw = Draw(f"recollision/{index}")
        index += 1
        scene = drawn_scene(
            draw,
            draw.pick(("stem", "mushroom", "mushroom")),
            Clock("bang-bang", draw.pick((0.5, 1.0, 3.5))),
            plateaus,
        )
        if scene.period is None:
            continue
        wall = draw.pick([wall for wall in scene.walls if wall != "base"])
        t = scene.period * (draw.pick(range(-3, 200)) + draw.part())
        away, along = draw.power(-60, 0), draw.power(-60, -3)
        leaving = {"t": t, "site": wall, "speed": along, "lift": away / along}
        start, _ = drawn_state(draw, scene, leaving)
        found = fast.next_collision(scene, start, t + 5.0)
        if isinstance(found, Collision) and found.wall == wall:
            n_found += 1
            yield scene, start


def wrong_answers(questions):
    """Return those of questions whose answers are off by more than four backward ulps."""
    return [
        (str(scene), str(state))
        for scene, state in questions
        if compare(
            fast.next_collision(scene, state, state.t + 5.0),
            proved_step(scene, state, state.t + 5.0),
            state,
            4.0,
        ).verdict
        != "pass"
    ]


def test_recollisions_are_right_to_four_backward_ulps():
    assert wrong_answers(again(N_RECOLLISIONS)) == []


@pytest.mark.parametrize("name", UNDEFINED)
def test_what_is_undefined_is_so_for_its_reason_or_undecided(name):
    """Of one wall alone nothing is told where another is: neither that it slides nor that it moves in."""
    scene, state, t_end, reason, _ = UNDEFINED[name]
    outcome = fast.next_collision(scene, state, t_end)
    assert outcome == Undefined(reason) or isinstance(outcome, Undecided)
    if name in SURE:
        paths = fast.trajectory(scene, state, 3), fast.fine_trajectory(scene, state, 3)
        assert [outcome, *(path.outcome for path in paths)] == [Undefined(reason)] * 3


BREATHING = Fourier(1.0, 2.0, cos=(1e-3,))
SCENES = {
    "a cap at rest": Cap(r=1.0),
    "a cap": Cap(r=BREATHING),
    "a mushroom": Mushroom(r=BREATHING, w=0.2, h=1.0, slope=0.05),
    "a stem": Stem(w=1.0, h=Fourier(1.0, 2.0, cos=(0.01,)), slope=0.1),
}
FARTHEST = 2.0**-21  # of a wall's size: half of what the protocol allows


def drawn(name, wall, n):
    """Yield states and horizons of those of n starts that leave a wall from up to FARTHEST off it."""
    scene = SCENES[name]
    for index in range(n):
        draw = Draw(f"{name}/{wall}/{index}")
        t, speed = draw.between(-20.0, 20.0), 10.0 ** draw.between(0.5, 2.0)
        table = rounded(scene, t)
        x, y = point(table, wall, draw.between(0.1, 0.9), draw.between(0.1, 0.9))
        nx, ny = table.normal(wall, x, y)
        size = {"arc": table.r, "floor": table.h}.get(wall, table.w or table.r)
        off = draw.pick((1.0, -1.0)) * size * FARTHEST * 10.0 ** -draw.between(0.0, 3.0)
        vx, vy = (speed * part for part in draw.direction())
        state = State(t, x + off * nx, y + off * ny, vx, vy, wall)
        t_end = t + draw.pick((0.3, 8.0)) / speed
        if isinstance(fast.next_collision(scene, state, t_end), Collision | Horizon):
            yield state, t_end


def differences(name, wall, n):
    """Yield how far apart flow and path end, of n starts: relative in velocity, and the hits of each wall.

    A flow that is lost on its way is infinitely far off.
    """
    scene = SCENES[name]
    for state, t_end in drawn(name, wall, n):
        path, flow = fast.trajectory(scene, state, 1000, t_end), fast.flow(scene, [state], t_end)
        end, arrived = path.outcome, flow.outcomes[0]
        if not isinstance(end, Horizon):
            continue
        if not isinstance(arrived, Horizon):
            yield math.inf, 0
            continue
        off = math.hypot(end.vx - arrived.vx, end.vy - arrived.vy) / math.hypot(end.vx, end.vy)
        hits = [path.walls.count(met) for met in ("arc", "base", "left", "right", "floor")]
        yield off, int(np.abs(flow.wall_counts[0] - hits).sum())


STARTS = [(name, wall) for name, scene in SCENES.items() for wall in scene.walls]


@pytest.mark.parametrize(("name", "wall"), STARTS)
def test_a_flow_goes_where_a_path_does(name, wall, tally):
    found = list(differences(name, wall, 60))
    tally[f"{name}, {wall}"] = len(found)
    assert len(found) > 10
    assert max(off for off, _ in found) < 1e-10
    assert not any(hits for _, hits in found)


def share_of_careful_steps(name, n, flights):
    """Return which share of collisions the lanes leave to the careful step, of n starts on the arc.

    Each is followed for so many flights of length 1, and at most to t = 25.
    """
    n_careful = n_collisions = 0
    for state, _ in drawn(name, "arc", n):
        flow = fast.flow(SCENES[name], [state], min(25.0, state.t + flights / math.hypot(state.vx, state.vy)))
        n_careful += int(flow.n_careful.sum())
        n_collisions += int(flow.wall_counts.sum())
    return n_careful / n_collisions


@pytest.mark.parametrize("name", ["a cap", "a mushroom"])
def test_the_lanes_know_who_has_left_the_arc_since(name):
    assert share_of_careful_steps(name, 60, math.inf) < 0.05
