"""Degenerate scenes: on a grid of states reference and verifier never differ, and few are left open."""

import os
from collections import Counter
from fractions import Fraction
from itertools import islice

import pytest
from support.degenerate_grid import SCENES, lines

from conformance import verify

N_STATES = int(os.environ.get("MUSHROOMS_GRID", 140))
# Of 20,006 states, those that the verifier left open while it knew cosines at whole turns only. Now 9 are.
OPEN_AT_WHOLE_TURNS = 749


def judge_grid(n_states: int, tally: "Counter[str]") -> "Counter[str]":
    """Return how often the verifier says what of the reference's answers, over all scenes."""
    verdicts = Counter[str]()
    for name in SCENES:
        for line in lines(name, -(-n_states // len(SCENES))):
            status = verify.verify_line(line).status if line else "undecided by the reference"
            verdicts[status] += 1
            tally[f"{name}: {status}"] += 1
            assert status != "false", line
    return verdicts


def test_reference_and_verifier_never_differ(tally):
    verdicts = judge_grid(N_STATES, tally)
    assert verdicts["proved"] > 0.9 * verdicts.total()
    assert verdicts["not proved"] <= OPEN_AT_WHOLE_TURNS * verdicts.total() / 20_006 / 4


@pytest.mark.deep
def test_reference_and_verifier_never_differ_on_the_whole_grid(tally):
    verdicts = judge_grid(20_000, tally)
    assert verdicts.total() >= 20_000
    assert verdicts["not proved"] <= OPEN_AT_WHOLE_TURNS / 4


def test_every_scene_has_every_kind_of_answer():
    for name in SCENES:
        lacking = {"collision", "horizon", "undefined", "rejected"}
        for line in islice(lines(name, 100), 100):
            lacking -= {line["expect"][0]["outcome"]} if line else set()
            if not lacking:
                break
        assert lacking == set(), name


QUARTERS = {
    "cosine, at a quarter": ([0.25], [], Fraction(1, 4), 1),
    "cosine, at a half": ([0.25], [], Fraction(1, 2), Fraction(3, 4)),
    "cosine, before 0": ([0.25], [], Fraction(-1, 2), Fraction(3, 4)),
    "sine, at a quarter": ([], [0.25], Fraction(1, 4), Fraction(5, 4)),
    "sine, at three quarters": ([], [0.25], Fraction(7, 4), Fraction(3, 4)),
    "second harmonic, at an eighth": ([0.0, 0.25], [], Fraction(1, 8), 1),
    "third harmonic, at a quarter": ([], [0.0, 0.0, 0.25], Fraction(1, 4), Fraction(3, 4)),
    "third harmonic, at a twelfth": ([0.0, 0.0, 0.25], [], Fraction(1, 12), 1),
    "first harmonic, at an eighth": ([0.25], [], Fraction(1, 8), None),
    "both harmonics, at an eighth": ([0.25, 0.25], [], Fraction(1, 8), None),
}


@pytest.mark.parametrize("row", QUARTERS.values(), ids=QUARTERS)
@pytest.mark.parametrize("period", [2.0, 0.75])
def test_a_wave_is_exact_at_quarters_of_its_turn_only(row, period):
    """Where a value is given, the enclosure holds it too, at each precision, with the derivatives."""
    cos, sin, turns, right = row
    law = {"kind": "fourier", "mean": 1.0, "period": period, "cos": cos, "sin": sin}
    scene = verify.read_scene({"table": "cap", "r": law}, [verify.WORK])
    time = turns * Fraction(period)
    if right is None:
        with pytest.raises(verify.Unproved):
            verify.exact_jet(scene, time, 1, "r")
        return
    for bits in (128, 512):
        rate = verify.pi(bits) * 2 / verify.number(Fraction(period), bits)
        jet = verify.exact_jet(scene, time, 1, "r")
        zero = verify.number(0, bits)
        enclosed = verify.law_jet(scene.laws["r"], verify.Clock(scene, time, bits), zero)
        numbers = [verify.number(Fraction(part), bits) for part in jet]
        exact = numbers[0], numbers[1] * rate, numbers[2] * rate**2
        assert jet.f == right
        for one, other in zip(enclosed, exact, strict=True):
            assert not verify.is_below(one, other)
            assert not verify.is_below(other, one)


def test_with_omega_only_time_zero_is_exact():
    law = {"kind": "fourier", "mean": 1.0, "omega": 2.0, "cos": [0.25]}
    scene = verify.read_scene({"table": "cap", "r": law}, [verify.WORK])
    assert verify.exact_jet(scene, Fraction(0), 1, "r").f == Fraction(5, 4)
    for time in (Fraction(1), Fraction(1, 2)):
        with pytest.raises(verify.Unproved):
            verify.exact_jet(scene, time, 1, "r")
