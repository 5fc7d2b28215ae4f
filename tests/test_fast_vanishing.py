"""Walls that all but vanish: what is left of them is known as well as any other size.

Their waves cancel to a part of 1e-4 to 1e-13, and terms known to 2^-62 of themselves would not do.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from mpmath import MPContext
from support.faulty_kernels import output_of
from support.from_python import from_python

import fast
import reference
from conformance.cases.attacks import UnderAttack, run, stepped
from conformance.cases.certify import proved_step
from conformance.cases.delicate_families import sunk
from conformance.cases.table import FAMILIES
from fast.batch import lane_steps
from fast.kernel.lane_laws import law_at
from fast.kernel.records import DEPTH
from fast.pieces import laws_in_lanes
from scene import Fourier, Horizon, Mushroom, State, Stem
from scene.laws import value

NAMES = ("nearly-shut", "all-but-gone")
N_ATTACKS = int(os.environ.get("MUSHROOMS_ATTACKS", "100"))
CTX = MPContext()
CTX.dps = 50


@pytest.mark.parametrize("name", NAMES)
def test_no_answer_is_wrong(name, tally):
    (found,) = run([FAMILIES[name]], N_ATTACKS, 1, UnderAttack(fast.next_collision, is_proved=False))
    tally.update(found.counts)
    assert found.cases["wrong"] == []
    assert found.counts["agreed"] > N_ATTACKS // 3


@pytest.mark.parametrize(("name", "seed"), [("nearly-shut", 3), ("all-but-gone", 1)])
def test_with_rough_phases_some_would_be(tmp_path, name, seed):
    """Few questions: with rough phases some take minutes."""
    program = f"""
import fast
from conformance.cases.attacks import UnderAttack, run
from conformance.cases.table import FAMILIES
(found,) = run([FAMILIES[{name!r}]], 25, {seed}, UnderAttack(fast.next_collision, is_proved=False))
print(len(found.cases['wrong']))
"""
    assert int(output_of(tmp_path, program, "laws.py", "CANCELLED = 2.0**-4", "CANCELLED = 0.0")) > 0


def test_who_is_inside_a_mouth_of_1e_13_is_let_through_it():
    w = Fourier(mean=0.5000000000001, cos=(-0.38242109364224425,), sin=(-0.3221088436188455,), period=1.0)
    scene, t = Mushroom(r=1.5, w=w, h=1.0), 0.11140847644675131
    start = State(t, 1.0265573708885821e-13, 6.975390845030978e-11, 0.0, -1.0)
    assert isinstance(fast.next_collision(scene, start, t + 0.01), Horizon)
    assert isinstance(reference.next_collision(scene, start, t + 0.01), reference.Horizon)


@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("left", [1e-4, 1e-6, 1e-8])
def test_lanes_meet_what_is_left(n, left, tally):
    """As the careful step does: within the four backward ulps of every answer."""
    random, scene = np.random.default_rng(n), Stem(w=1.0, h=sunk(n, left))
    starts = []
    for _ in range(100):
        t, v = 10.0 ** random.uniform(-6.0, -1.5), 10.0 ** random.uniform(-1.0, 3.0)
        starts.append(State(float(t), 0.1, 0.0, float(0.1 * v * random.normal()), float(-v), "base"))
    for start, answer in zip(starts, lane_steps(scene, starts), strict=True):
        if answer is None:
            continue
        judged = stepped(answer, proved_step(scene, start, start.t + 100.0), start)
        tally[judged.kind] += 1
        assert judged.kind == "agreed", judged
    assert tally["agreed"] > 30


def worst_of_lanes(law, spoil):
    """Return how far polynomials are from a law, in units of 2^-53 of its value where each piece serves."""
    scene = Stem(w=1.0, h=law)
    in_lanes, worst = laws_in_lanes(scene), 0.0
    p, degree = in_lanes.pieces, (0,) * in_lanes.degree
    for i in range(len(p.begins)):
        out = p.coefficients[i, DEPTH].copy()
        if spoil:
            out[0] += 2.0**-54  # as waves would be rounded that add up to the mean
        for u in (-p.limits[i], 0.5 * p.limits[i], p.limits[i]):
            found = from_python(law_at)(out, 0, 1, u, u, degree)[0]
            true = value(CTX, law, sum(map(CTX.mpf, (*p.references[i], u))))
            worst = max(worst, float(abs(found - true) / true) * 2.0**53)
    return worst


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_piece_is_right_to_a_few_last_places_however_little_is_left(turn):
    law = sunk(4, 1e-6, turn)
    assert worst_of_lanes(law, spoil=False) < 8.0
    assert worst_of_lanes(law, spoil=True) > 100.0
