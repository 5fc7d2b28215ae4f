"""What heats fastest: four-leg loops in floats against the theory, their bounds, the moving cap's phases."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest

import theory
from mushrooms.figures.heating import Loop, fastest, moving_cap, phase_diagram, supremum
from scene import BangBang, Mushroom

PAGE = Path(__file__).parent.parent / "docs" / "heating.md"


def as_scene(loop: Loop) -> Mushroom:
    """Return an upright mushroom that runs a loop in four legs."""
    h1, h0, w0, w1 = loop
    w = BangBang(((0.0, w1), (0.25, w0), (0.5, w0), (0.75, w1), (1.0, w1)))
    h = BangBang(((0.0, h1), (0.25, h1), (0.5, h0), (0.75, h0), (1.0, h1)))
    return Mushroom(r=1.0, h=h, w=w)


@pytest.mark.parametrize("loop", [Loop(6.0, 2.0, 0.3), Loop(6.0, 0.1, 0.02), Loop(1.0, 3.0, 0.5, 0.9)])
def test_a_loop_in_floats_is_the_theory_of_its_scene(loop):
    assert loop.m1 == pytest.approx(float(theory.predict(as_scene(loop), 8).m1), rel=2e-5)


def test_a_loop_gains_more_the_deeper_it_closes_the_shallower_it_opens_the_narrower_it_gets():
    for h1, h0, w0 in itertools.product((1.0, 5.0, 30.0), (0.01, 0.3), (0.01, 0.4)):
        here = Loop(h1, h0, w0).m1
        assert Loop(1.3 * h1, h0, w0).m1 > here
        assert Loop(h1, 0.7 * h0, w0).m1 > here
        assert Loop(h1, h0, 0.7 * w0).m1 > here
        assert here < supremum(w0, h1) < supremum(w0)


def test_the_supremum_is_approached_and_has_no_bound_without_one_on_the_mouth():
    assert Loop(1e7, 0.0, 0.1).m1 == pytest.approx(supremum(0.1), rel=1e-4)
    for w0 in (1e-3, 1e-6, 1e-12):
        assert supremum(w0) == pytest.approx(math.log(math.pi / 4 / w0), rel=1e-3)


def test_the_fastest_loop_is_not_beaten_by_its_neighbours():
    best, rate = fastest(0.02, 0.1)
    assert rate == pytest.approx(best.m1 / best.path)
    for h1, w0 in itertools.product((0.9, 1.0, 1.1), (1.0, 1.2)):
        assert Loop(best.h1 * h1, 0.1, 0.02 * w0).m1 / Loop(best.h1 * h1, 0.1, 0.02 * w0).path <= rate * (
            1 + 1e-6
        )


def test_the_moving_cap_is_trivial_in_phase_and_gains_with_the_square_of_the_amplitude():
    found = phase_diagram(np.array([0.0, math.pi / 2, math.pi]), np.array([0.1, 0.2]))
    assert np.abs(found[:, 0]).max() < 1e-12
    assert found[1, 2] / found[0, 2] == pytest.approx(4, rel=0.05)
    assert (found[:, 2] > found[:, 1]).all()
    assert theory.predict(moving_cap(4.0, 0.6, 0.6), 6).m1 > 0


def test_the_page_says_what_the_code_finds():
    lines = [line for line in PAGE.read_text("utf-8").splitlines() if re.match(r"\| [\d.]+ \|", line)]
    numbers = [list(map(float, re.findall(r"[\d.]+", line))) for line in lines]
    loops, rates = ([row for row in numbers if len(row) == n] for n in (4, 5))
    assert (len(loops), len(rates)) == (3, 3)
    for h0, h1, w0, m1 in loops:
        assert Loop(h1, h0, w0).m1 == pytest.approx(m1, abs=6e-5)
    for h0, narrowest, w0, h1, rate in rates:
        best, found = fastest(narrowest, h0)
        assert (best.h1, best.w0) == (pytest.approx(h1, abs=6e-3), pytest.approx(w0, rel=1e-3))
        assert found == pytest.approx(rate, abs=6e-6)
