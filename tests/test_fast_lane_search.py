"""No lane answer is wrong: the directed search, its mutants, and lanes asked by themselves.

`MUSHROOMS_LANE_ANSWERS=10000 pytest tests/test_fast_lane_search.py` searches deeper, in each group of draws.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from support.depth import deep_among
from support.faulty_kernels import faulty_lanes
from support.lane_corners import CORNERS, at_the_end_of_a_chord
from support.lane_draws import GROUPS, draw_starts
from support.lane_draws import draw_scene as draw_directed_scene
from support.lane_search import ANYWHERE, Round, draw_scene, draw_start, search
from support.lane_ties import TIES, wrong_walls
from support.lane_traps import TRAPS

import fast
import reference
from fast.batch import LaneRound, lane_steps
from fast.kernel import lanes, pools, records
from fast.step import WALL_NAMES
from scene import Cap, Collision, Fourier, Mushroom, Rejected, State

N_ANSWERS = int(os.environ.get("MUSHROOMS_LANE_ANSWERS", "150"))  # of each group of draws


@pytest.mark.parametrize("group", deep_among([ANYWHERE, *GROUPS, *TRAPS], "misled chord", "misled side"))
def test_no_lane_answer_is_wrong(group, tally):
    assert search(11, N_ANSWERS, tally, group) == []


def test_the_arc_that_comes_and_goes_on_the_way_to_the_base():
    """Near the least radius f of the arc dips below zero and comes back: two hits, not one."""
    scene = Mushroom(r=Fourier(1.0, 1.0, (0.9,)), h=1.0, w=0.0005)
    state = State(
        3.116786370335045, 0.09723691417765834, 0.024502880446325, 0.05208237622567096, -0.29708987593890235
    )
    run = fast.flow(scene, [state], 3.377786370335045)
    assert run.wall_counts.tolist() == [[2, 1, 0, 0, 0]]


def test_lanes_alone_take_the_careful_steps_and_no_free_starts(tally):
    random = np.random.default_rng(8)
    for _ in range(12):
        scene = draw_scene(random)
        starts = [draw_start(scene, random) for _ in range(24)]
        rows = [(tuple(float(v) for v in np.delete(p, 1)), wall) for p, wall in starts]
        on_walls = [State(*row, WALL_NAMES[wall]) for row, wall in rows]
        free = [State(*row) for row, _ in rows]
        assert set(lane_steps(scene, free)) == {None}
        for state, found in zip(on_walls, lane_steps(scene, on_walls), strict=True):
            truth = fast.next_collision(scene, state, state.t + 1e3)
            if found is None or isinstance(truth, Rejected):
                continue
            tally["lane steps"] += 1
            assert isinstance(truth, Collision)
            assert (found.wall, found.dt) == (truth.wall, pytest.approx(truth.dt, rel=1e-6))
    assert tally["lane steps"] > 20


def test_lanes_that_took_free_starts_would_be_wrong(monkeypatch, tally):
    """A mutant of `lane_steps`: starts within the stem, on no wall, are taken to be in the cap."""
    scene, random = Mushroom(r=1.0, h=1.0, w=0.5), np.random.default_rng(8)
    free = [
        State(
            0.0, *map(float, (random.uniform(-0.4, 0.4), random.uniform(-0.9, -0.1), *random.normal(size=2)))
        )
        for _ in range(60)
    ]
    assert set(lane_steps(scene, free)) == {None}
    monkeypatch.setattr(LaneRound, "is_met", lambda *_: True)
    for state, found in zip(free, lane_steps(scene, free), strict=True):
        truth = fast.next_collision(scene, state, 1e3)
        assert isinstance(truth, Collision)
        tally["taken"] += found is not None
        tally["wrong walls"] += found is not None and found.wall != truth.wall
    assert tally["wrong walls"] > 0


def test_a_start_by_decree_is_left_to_the_careful_step():
    """Within 2^-20 of its wall a state is on it by definition; lanes know walls that they have met."""
    scene = Cap(r=1.0)
    exact, near = State(0.0, 0.0, 1.0, 0.3, -1.0, "arc"), State(0.0, 0.0, 1.0 - 2.0**-22, 0.3, -1.0, "arc")
    taken, left = lane_steps(Mushroom(r=1.0, h=1.0, w=0.5), [exact, near])
    assert isinstance(taken, Collision)
    assert left is None
    assert isinstance(fast.next_collision(scene, near, 9.0), Collision)


# A guess to third order is hardly ever misled. The checks that an arc is concave must not depend on that.
POORER_GUESS = "return fma(r1, r2, r0 * r3 * (1.0 / 3.0))", "return 0.0"
# What is taken out of aiming.py or lanes.py, and the group of draws and number of answers that miss it.
MUTANTS = {
    "the arc's chord on a flight to the base": (
        "arc to base",
        800,
        "return inside if hit == ON_BASE else place",
        "return 1.0 if hit == ON_BASE else place",
    ),
    "the mouth's own curvature": (
        "side to arc",
        300,
        "doubt = fma(excess, per_r, k_side)",
        "doubt = fma(excess, per_r, 0.0)",
    ),
    "the sides before the mouth": ("side to arc", 300, "min(gap - doubt, lift)", "lift"),
    "concavity of the arc": (
        ANYWHERE,
        4000,
        "concave = v2 - bend if hit == ON_ARC else 1.0",
        "concave = 1.0",
        *POORER_GUESS,
    ),
    "walls that are not met": (
        "side to arc",
        300,
        "return min(clear_r, min(clear_l, clear_f)) - far",
        "return 1.0",
    ),
    "the curvature of walls that are not met": (
        "side to arc",
        1500,
        "far = fma(k_side * s, s, blur)",
        "far = blur",
    ),
    "the part of the table that a wall is in": (
        "arc to stem",
        500,
        "place -= fma(abs(vy), fma(SAFETY, s, slack), SAFETY * abs(y))",
        "place = 1.0",
    ),
    "what Newton's step leaves": (
        "arc to stem",
        500,
        "result = LATE if error < s else result",
        "result = LATE",
    ),
    "how long the polynomials hold": (
        "arc to base",
        1000,
        "return FAR if ahead <= 0.0 else result",
        "return result",
    ),
    "how long the radius was known before": (
        "base to arc",
        500,
        "known = known if hit == ON_ARC else 1.0",
        "known = 1.0",
    ),
    "what Newton's step leaves of the place": (
        "up a deep stem",
        600,
        "return NEVER if hit == ON_ARC and error",
        "return NEVER if hit != hit and error",
    ),
    "what a bounce hangs on": (
        "slow beside a plateau",
        100,
        "return told if hit >= ON_LEFT else 1.0",
        "return 1.0",
    ),
    "what a hop hangs on": (
        "early hop",
        1500,
        "known = min(known, told_rate(a[T + i], r, r1, r2, sizes, limits))",
        "known = known + 0.0",
    ),
    "what a hop through the base hangs on": (
        "early hop through the base",
        1500,
        "quality = min(quality, told_rate(a[T + i], r, r1, r2, sizes, limits))",
        "quality = min(quality, 1.0)",
    ),
    "how far the series of a hop's turn serve": (
        "early hop",
        600,
        "LONGEST_TURN = 0.75",
        "LONGEST_TURN = 100.0",
    ),
    "the same through the base": (
        "early hop through the base",
        600,
        "LONGEST_TURN = 0.75",
        "LONGEST_TURN = 100.0",
    ),
    "the mouth under a chord": (
        "captured beside a moving mouth",
        500,
        "clear = spin * spin - (1.0 + 4.0 * SAFETY) * reach * reach * v2",
        "clear = 1.0",
    ),
    "the mouth at the end of a chord": (
        "captured beside a moving mouth",
        500,
        "reach = max(a[SURE + i], w)",
        "reach = a[SURE + i]",
    ),
    "the mouth's curvature under a chord": (
        "captured beside a moving mouth",
        400,
        "fma(k_w * s, s, SAFETY * size)",
        "SAFETY * size",
    ),
    "the floor before the mouth": (
        "corner over a rising floor",
        100,
        "min(gap - doubt, lift)",
        "gap - doubt",
    ),
    "concavity of the arc under a chord": (
        "misled chord",
        500,
        "min(first, v2 - bend))",
        "first)",
        *POORER_GUESS,
    ),
    "the slope of the side that is met": (
        "misled side",
        300,
        "return 1.0 if hit == ON_BASE else first",
        "return 1.0 if hit != ON_ARC else first",
    ),
}


@pytest.mark.parametrize("group", ["arc to stem", "side to moving arc", "captured under a moving arc"])
def test_uncompiled_lanes_give_the_bits_of_compiled_ones(group):
    """Mutants run uncompiled; what is not spoilt in them is what users run."""
    random, aim = np.random.default_rng(7), GROUPS[group]
    for _ in range(4):
        scene = draw_directed_scene(aim, random)
        starts = draw_starts(scene, aim, pools.LANES, random)
        one, other = (Round(scene, k, is_captured=aim.is_captured) for k in (lanes, faulty_lanes("", "")))
        for lane, start in enumerate(starts):
            one.fill(lane, *start)
            other.fill(lane, *start)
        for found, again in zip(one.step(len(starts)), other.step(len(starts)), strict=True):
            assert np.array_equal(found, again, equal_nan=True)


@pytest.mark.parametrize(
    "name",
    deep_among(
        MUTANTS,
        "concavity of the arc",
        "how long the polynomials hold",
        "how long the radius was known before",
        "the slope of the side that is met",
        "what Newton's step leaves",
        "what Newton's step leaves of the place",
    ),
)
def test_the_search_kills(name, tally):
    group, n, *changes = MUTANTS[name]
    wrong = search(1, n, tally, group, faulty_lanes(*changes))
    tally["wrong"] = len(wrong)
    assert wrong


def count_wrong_walls(draw, kernels, tally):
    random = np.random.default_rng(3)
    for _ in range(40):
        scene, starts = TIES[draw](pools.LANES, random)
        answered, wrong = wrong_walls(Round(scene, kernels), scene, starts)
        tally["answered"] += answered
        tally["wrong"] += wrong
        if wrong:
            break
    return tally["wrong"]


# Terms of rounding, and the draw of ties that misses each.
ROUNDING = {
    "the mouth's edge": (
        "at the mouth's edge",
        "doubt = fma(SAFETY * rise, fma(size + abs(x), rise, (abs(vx) + rate_w) * depth), doubt)",
        "doubt = doubt + 0.0",
    ),
    "the height at the end": (
        "at the end of the arc",
        "place -= fma(abs(vy), fma(SAFETY, s, slack), SAFETY * abs(y))",
        "place -= 0.0",
    ),
    "the base inside the arc": (
        "at the end of the arc",
        "inside = fma(-SAFETY, fma(abs(vx), s, limits.size + abs(x)), r - abs(x_s))",
        "inside = r - abs(x_s)",
    ),
    "walls that are not met": (
        "at the floor's corner",
        "blur)\n    return fma(fma(limits.lean, abs(outset.vy), abs(outset.vx)) + limits.rate, slack, far)",
        "0.0)\n    return far",
    ),
}


NO_SLACK = ("return slack if error < s else 0.0", "return 0.0")


def count_wrong_corners(draw, kernels, n_scenes, tally):
    random = np.random.default_rng(5)
    for _ in range(n_scenes):
        scene, starts = CORNERS[draw](pools.LANES, random)
        pool = Round(scene, kernels)
        for lane, start in enumerate(starts):
            pool.fill(lane, *start)
        right, hits, _ = pool.step(len(starts))
        for i in np.flatnonzero(right):
            code, _ = pool.careful(*starts[i])
            tally["answered"] += 1
            # What the careful step cannot decide, or refuses, it cannot contradict.
            tally["wrong"] += code < records.HORIZON and code != hits[i]
    return tally["wrong"]


@pytest.mark.parametrize("draw", CORNERS)
def test_a_hit_near_a_corner_is_on_the_right_side_of_it(draw, tally):
    """Where Newton's step leads, and not only where it begins."""
    assert count_wrong_corners(draw, lanes, 40, tally) == 0
    assert tally["answered"] > 300


@pytest.mark.parametrize("draw", CORNERS)
def test_without_slack_hits_are_beyond_corners(draw, tally):
    assert count_wrong_corners(draw, faulty_lanes(*NO_SLACK), 6, tally) > 0


def count_wrong_chords(kernels, n_scenes, tally):
    random = np.random.default_rng(7)
    for _ in range(n_scenes):
        scene, starts = at_the_end_of_a_chord(pools.LANES, random)
        pool = Round(scene, kernels)
        for lane, start in enumerate(starts):
            pool.fill(lane, *start)
        right, _, rows = pool.step(len(starts))
        for i in np.flatnonzero(right):
            t, _, *numbers = starts[i][0].tolist()
            proved = reference.next_collision(scene, State(t, *numbers, wall="arc"), t + 10.0, digits=25)
            tally["answered"] += 1
            tally["wrong"] += proved.wall != ("base" if rows[i, 2] < 0.0 else "arc")
    return tally["wrong"]


def test_a_chord_ends_on_the_right_side_of_the_base(tally):
    """The careful step leaves those open; the proof has them."""
    assert count_wrong_chords(lanes, 12, tally) == 0
    assert tally["answered"] > 50


def test_without_slack_a_chord_ends_beyond_the_base(tally):
    assert count_wrong_chords(faulty_lanes(*NO_SLACK), 6, tally) > 0


@pytest.mark.parametrize("draw", TIES)
def test_no_tie_within_rounding_is_answered_wrongly(draw, tally):
    assert count_wrong_walls(draw, lanes, tally) == 0


@pytest.mark.parametrize("name", ROUNDING)
def test_the_ties_kill(name, tally):
    draw, old, new = ROUNDING[name]
    assert count_wrong_walls(draw, faulty_lanes(old, new), tally) > 0
