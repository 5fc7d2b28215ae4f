"""A start may be a little off the wall that it names. A flow from there goes where a path does.

Captured particles are followed unfolded, in which a hop along the arc and a chord through the base are one;
but a hop keeps what distance from the arc a start was given, and a flight that comes from the base does not.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.depth import deep_but

import fast
from scene import Cap, Collision, Fourier, Horizon, Mushroom, State, Stem
from scene.geometry import rounded

BREATHING = Fourier(1.0, 2.0, cos=(1e-3,))
SCENES = {
    "a cap at rest": Cap(r=1.0),
    "a cap": Cap(r=BREATHING),
    "a mushroom": Mushroom(r=BREATHING, w=0.2, h=1.0, slope=0.05),
    "a stem": Stem(w=1.0, h=Fourier(1.0, 2.0, cos=(0.01,)), slope=0.1),
}
FARTHEST = 2.0**-21  # of a wall's size: half of what the protocol allows


def drawn(random, scene, wall):
    """Draw a state that leaves a wall from up to FARTHEST off it, inside or outside; None if it does not."""
    t, off = random.uniform(-20.0, 20.0), random.choice((-1.0, 1.0)) * FARTHEST * 10 ** -random.uniform(0, 3)
    now, along = rounded(scene, t), random.uniform(0.1, 0.9)
    if wall == "arc":
        r = now.r * (1.0 - abs(off))  # farther out, near the base, another wall might be crossed
        x, y = r * math.cos(math.pi * along), r * math.sin(math.pi * along)
    elif wall == "base":
        wide = now.w if isinstance(scene, Stem) else now.r
        x, y = random.choice((-1.0, 1.0)) * wide * (0.3 + 0.6 * along), off * wide
    elif wall == "floor":
        x, y = 0.1 * (2.0 * along - 1.0), -now.h * (1.0 + off)
    else:
        y = -now.h * along
        x = (now.w + now.slope * y) * (1.0 + off) * (1.0 if wall == "right" else -1.0)
    speed, turn = 10 ** random.uniform(0.5, 2.0), random.uniform(0.0, 2.0 * math.pi)
    state = State(t, x, y, speed * math.cos(turn), speed * math.sin(turn), wall)
    t_end = t + random.choice((0.3, 8.0)) / speed
    met = fast.next_collision(scene, state, t_end)
    return (state, t_end) if isinstance(met, Collision | Horizon) else None


def differences(name, wall, n):
    """Yield how far apart flow and path end, of n starts: relative in velocity, and the hits of each wall.

    A flow that is lost on its way is infinitely far off.
    """
    scene, random = SCENES[name], np.random.default_rng(5)
    for _ in range(n):
        start = drawn(random, scene, wall)
        if start is None:
            continue
        state, t_end = start
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


@pytest.mark.parametrize("start", deep_but(STARTS, *STARTS[2:5]))
def test_a_flow_goes_where_a_path_does(start, tally):
    name, wall = start
    found = list(differences(name, wall, 60))
    tally[f"{name}, {wall}"] = len(found)
    assert len(found) > 10
    assert max(off for off, _ in found) < 1e-10
    assert not any(hits for _, hits in found)


def share_of_careful_steps(name, n, flights):
    """Return which share of collisions the lanes leave to the careful step, of n starts on the arc.

    Each is followed for so many flights of length 1, and at most to t = 25.
    """
    scene, random, n_careful, n_collisions = SCENES[name], np.random.default_rng(6), 0, 0
    for state, _ in filter(None, (drawn(random, scene, "arc") for _ in range(n))):
        flow = fast.flow(scene, [state], min(25.0, state.t + flights / math.hypot(state.vx, state.vy)))
        n_careful += int(flow.n_careful.sum())
        n_collisions += int(flow.wall_counts.sum())
    return n_careful / n_collisions


@pytest.mark.parametrize("name", ["a cap", "a mushroom"])
def test_the_lanes_know_who_has_left_the_arc_since(name):
    assert share_of_careful_steps(name, 60, math.inf) < 0.05
