"""No lane answer is wrong: the directed search, its mutants, and lanes asked by themselves.

`MUSHROOMS_LANE_ANSWERS=10000 pytest tests/test_fast_lane_search.py` searches deeper, in each group of draws.
"""

import os

import numpy as np
import pytest
from support.depth import deep_among
from support.faulty_kernels import faulty_lanes
from support.lane_corners import CORNERS
from support.lane_search import GROUPS, Round, search

import fast
import reference
from fast.batch import LaneRound, lane_steps
from fast.kernel import lanes, rows
from fast.step import WALL_NAMES
from scene import Cap, Collision, Mushroom, State

N_ANSWERS = int(os.environ.get("MUSHROOMS_LANE_ANSWERS", "150"))  # of each group of draws


@pytest.mark.parametrize("group", deep_among(GROUPS, "misled chord", "misled side"))
def test_no_lane_answer_is_wrong(group, tally):
    assert search(11, N_ANSWERS, tally, group) == []


@pytest.mark.parametrize("column", range(5))
def test_a_spoilt_lane_is_seen(column, monkeypatch, tally):
    """The comparison notices numbers that are off by 2^-47."""
    honest = Round.step

    def spoilt(pool, n):
        right, hits, numbers = honest(pool, n)
        numbers[:, column] *= 1.0 + 2.0**-47
        return right, hits, numbers

    monkeypatch.setattr(Round, "step", spoilt)
    assert search(1, 100, tally, "arc to base") != []


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
# What is taken out of lanes.py, and the group of draws and number of answers that miss it.
MUTANTS = {
    "the mouth's own curvature": (
        "side to arc",
        300,
        "doubt = k * depth * depth",
        "doubt = 0.0",
    ),
    "the sides before the mouth": ("side to arc", 300, "else gap - doubt", "else 1.0"),
    "concavity of the arc": (
        "arc to base",
        300,
        "min(v2 - bend, pushed)",
        "pushed",
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
        "place -= fma(abs(outset.vy), slack, blur)",
        "place = 1.0",
    ),
    "what Newton's step leaves": (
        "arc to stem",
        500,
        "result = rows.LATE if error < s else result",
        "result = rows.LATE",
    ),
    "how long the polynomials hold": (
        "arc to base",
        1000,
        "return rows.FAR if ahead <= 0.0 else result",
        "return result",
    ),
    "how long the radius was known before": (
        "base to arc",
        500,
        "known = known if hit == rows.ON_ARC else 1.0",
        "known = 1.0",
    ),
    "what Newton's step leaves of the place": (
        "up a deep stem",
        600,
        "return rows.NEVER if hit == rows.ON_ARC and error",
        "return rows.NEVER if hit != hit and error",
    ),
    "what a bounce hangs on": (
        "slow beside a plateau",
        100,
        "min(v2 - bend, pushed)",
        "v2 - bend",
    ),
    "the part of a velocity that a bounce turns": (
        "slow beside a plateau",
        400,
        "(abs(vy) if hit == rows.ON_FLOOR else abs(vx)) - limits.rate",
        "abs(vx) + abs(vy) - limits.rate",
    ),
    "what a moving slope turns": (
        "across a slope near zero",
        100,
        "quality = min(quality, told_slope(hit, there.m, vx, vy, limits))",
        "pass",
    ),
    "what a hop hangs on": (
        "early hop",
        1500,
        "return f, rate, sizes, min(known, told)",
        "return f, rate, sizes, known",
    ),
    "what a hop through the base hangs on": (
        "early hop through the base",
        1500,
        "return f, rate, sizes, min(known, told)",
        "return f, rate, sizes, known",
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
        "reach = max(a[rows.SURE + i], there.w)",
        "reach = a[rows.SURE + i]",
    ),
    "the mouth's curvature under a chord": (
        "captured beside a moving mouth",
        400,
        "fma(k_w * s, s, SAFETY * size)",
        "SAFETY * size",
    ),
    "the floor before the mouth": (
        "rising floor",
        6000,
        "else k_side + limits.lift",
        "else k_side",
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
        "return 1.0 if hit == rows.ON_BASE else first",
        "return 1.0 if hit != rows.ON_ARC else first",
    ),
}


@pytest.mark.parametrize("group", ["side to moving arc", "captured under a moving arc"])
def test_uncompiled_lanes_give_the_bits_of_compiled_ones(group):
    """Mutants run uncompiled; what is not spoilt in them is what users run."""
    random, aim = np.random.default_rng(7), GROUPS[group]
    for _ in range(4):
        scene, starts = aim.draw(rows.LANES, random)
        one, other = (Round(scene, k, is_captured=aim.is_captured) for k in (lanes, faulty_lanes("", "")))
        one.fill_all(starts)
        other.fill_all(starts)
        for found, again in zip(one.step(len(starts)), other.step(len(starts)), strict=True):
            assert np.array_equal(found, again, equal_nan=True)


@pytest.mark.parametrize(
    "name",
    deep_among(
        MUTANTS,
        "concavity of the arc under a chord",
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
    """Count the lane answers near corners that name another wall than the one that is proved to be first."""
    random = np.random.default_rng(5)
    for _ in range(8):
        scene, starts = CORNERS[draw](rows.LANES, random)
        pool = Round(scene, kernels)
        pool.fill_all(starts)
        right, hits, steps = pool.step(len(starts))
        for i in np.flatnonzero(right):
            (t, _, *place), wall = starts[i]
            start = State(float(t), *map(float, place), WALL_NAMES[wall])
            proved = reference.next_collision(scene, start, start.t + 10.0, digits=25)
            found = "base" if pool.is_disk and steps[i, 2] < 0.0 else WALL_NAMES[int(hits[i])]
            tally["answered"] += 1
            tally["wrong"] += isinstance(proved, reference.Collision) and proved.wall != found
        if tally["wrong"]:
            break
    return tally["wrong"]


@pytest.mark.parametrize("draw", CORNERS)
def test_a_hit_near_a_corner_is_on_the_right_side_of_it(draw, tally):
    """Where Newton's step leads, and not only where it begins."""
    assert count_wrong_walls(draw, lanes, tally) == 0
    assert tally["answered"] > 100 or "resting" in draw  # there lanes refuse nearly all


NO_SLACK = ("return slack if error < s else 0.0", "return 0.0")
# Terms of rounding and a check, and a draw of corners that misses each.
ROUNDING = {
    "the mouth's edge": (
        "a resting mouth's edge",
        "doubt = fma(SAFETY * rise, fma(size + abs(x), rise, (abs(vx) + rate_w) * depth), doubt)",
        "doubt = doubt + 0.0",
    ),
    "the height at the end": (
        "the end of a resting arc",
        "place -= fma(abs(outset.vy), slack, blur)",
        "place -= 0.0",
    ),
    "the arc on a flight to the base": (
        "the end of the arc",
        "return inside if hit == rows.ON_BASE else place",
        "return 1.0 if hit == rows.ON_BASE else place",
    ),
    "the base inside the arc": (
        "the end of a resting arc",
        "inside = (r - abs(end.x)) - blur",
        "inside = r - abs(end.x)",
    ),
    "walls that are not met": (
        "a resting floor's corner",
        "blur)\n    return fma(fma(limits.lean, abs(outset.vy), abs(outset.vx)) + limits.rate, slack, far)",
        "0.0)\n    return far",
    ),
    "the slack of a hit of the arc": ("the end of the arc", *NO_SLACK),
    "the slack of a hit of a side": ("the edge of the mouth", *NO_SLACK),
    "the slack of a chord": ("the end of a chord", *NO_SLACK),
}


@pytest.mark.parametrize("name", ROUNDING)
def test_without_a_term_of_rounding_hits_are_beyond_corners(name, tally):
    draw, *change = ROUNDING[name]
    assert count_wrong_walls(draw, faulty_lanes(*change), tally) > 0
