"""Kernels with one line changed: a comparison of another test module finds each."""

import pytest
from support.depth import deep_but
from support.faulty_kernels import value_of

ELSEWHERE = (
    "test_fast_recollisions",
    "any(off > 1e-10 or hits for wall, n in (('arc', 16), ('base', 60))"
    " for off, hits in differences('a cap', wall, n))",
)
# The module and the expression that finds a fault; the file, what stands there, and what the fault has.
FAULTS = {
    "a start that has left its arc is still taken as given": (
        "test_fast_recollisions",
        "share_of_careful_steps('a mushroom', 8, 30.0) > 0.4",
        *("follow.py", "a[rows.AS_GIVEN + i] = 0.0", "a[rows.AS_GIVEN + i] = 1.0"),
    ),
    "a start off its arc is not taken as given": (
        *ELSEWHERE,
        *("follow.py", "and a[rows.AS_GIVEN + i] == 0.0", "and a[rows.AS_GIVEN + i] < 2.0"),
    ),
    "a start below y = 0 is taken to be on the arc": (
        *ELSEWHERE,
        *("rows.py", "if a[Y + i] < 0.0 and a[WALL + i] == ON_ARC:", "if a[Y + i] < 0.0:"),
    ),
    "a start in the disk is taken to be on the arc": (
        *ELSEWHERE,
        *("follow.py", "if pool == DISK and a[rows.WALL + i] == rows.ON_ARC:", "if pool == DISK:"),
    ),
    "sides are looked for below the floor": (
        "test_fast_horizons",
        "fast.next_collision(WAVING, MISSED, 50.0).wall == 'left'",
        "scalar_step.py",
        *("for candidate in (FLOOR, LEFT, RIGHT):", "for candidate in (LEFT, RIGHT, FLOOR):"),
    ),
    "the time of a hop is known to its own last bit only": (
        "test_fast_recollisions",
        "wrong_answers(again(60)) != []",
        "scalar_step.py",
        "s_low, rest = rest_of_hop(s, f, slope_s, particle, scene, anchors), 0.0",
        "s_low, rest = 0.0, 0.0",
    ),
    "a wall that has come back": (
        "test_fast_horizons",
        "judge('after a spike')[1] > 0",
        *("scalar_step.py", "if side > 0 and s < limit:", "if s < 0.0:"),
    ),
    "the mouth's own motion": (
        "test_fast_horizons",
        "judge('beside a moving mouth')[1] > 0",
        *("walls.py", "rounding * (abs(vx) + drift)", "rounding * abs(vx)"),
    ),
    "what is wrong with f' on the way": (
        "test_fast_horizons",
        "judge('along a leaning side')[1] > 0",
        *("scalar_step.py", "(error + slope_error * h) / -slope", "error / -slope"),
    ),
    # Few questions: with rough phases some take minutes.
    "rough phases beside a wall that is nearly shut": (
        "test_fast_stepper",
        "len(attack('nearly-shut', 25, 3).cases['wrong']) > 0",
        *("laws.py", "CANCELLED = 2.0**-4", "CANCELLED = 0.0"),
    ),
    "rough phases beside a wall that is all but gone": (
        "test_fast_stepper",
        "len(attack('all-but-gone', 25, 1).cases['wrong']) > 0",
        *("laws.py", "CANCELLED = 2.0**-4", "CANCELLED = 0.0"),
    ),
}


# Each compiles a copy of the kernels, tens of seconds.
@pytest.mark.parametrize("name", deep_but(FAULTS, "sides are looked for below the floor"))
def test_a_changed_line_is_found(name, tmp_path):
    assert value_of(tmp_path, *FAULTS[name])


@pytest.mark.deep
def test_the_same_copy_without_a_fault_is_right(tmp_path):
    assert (
        value_of(tmp_path, "test_fast_horizons", "fast.next_collision(WAVING, MISSED, 50.0).wall") == "floor"
    )
