"""Attacks find nothing wrong with our steppers, and every family finds the mistake that it hunts."""

from __future__ import annotations

import json
import os
from fractions import Fraction

import pytest
from flint import arb
from hypothesis import given, settings
from support import faulty_provers as faults
from support.depth import deep_among
from support.refusals import assert_refused

from conformance.attacks import FAMILIES, Attack, Claim, UnderAttack, line, run
from conformance.attacks.search import as_certified, flown, proved, stepped, truths
from conformance.grading.agreement import middle
from conformance.second_stepper import Answer, next_collision
from conformance.strategies import adversarial
from mushrooms.attack_steppers import prove, steppers
from scene import Collision, Horizon, Rejected, State, Undecided, Undefined, load

N_ATTACKS = int(os.environ.get("MUSHROOMS_ATTACKS", "6"))
SEED = 2014

# Of every family a faulty stepper, and how many cases find it out.
KILLS = {
    "knot-at-event": (faults.one_piece, 60),
    "hit-at-knot": (faults.faulty(faults.knots_unseen), 20),
    "knots-anywhere": (faults.faulty(faults.period_from_zero), 10),
    "tiny-slope": (faults.faulty(faults.residual_forgotten), 20),
    "flattening-slope": (faults.faulty(faults.residual_forgotten), 30),
    "arc-residual": (faults.faulty(faults.residual_forgotten), 40),
    "floor-residual": (faults.faulty(faults.residual_forgotten), 20),
    "on-the-wall": (faults.faulty(faults.size_of_all_time), 30),
    "corner-start": (faults.faulty(faults.corner_unseen), 20),
    "side-at-mouth": (faults.faulty(faults.corner_unseen), 20),
    "corner-arrival": (faults.faulty(faults.tie_guessed), 20),
    "hit-at-end": (faults.faulty(faults.hit_at_end_counts), 10),
    "near-another-wall": (faults.faulty(faults.blind_start), 20),
    "arc-dips": (faults.faulty(faults.ends_alone), 60),
    "arc-dips-on-rebound": (faults.faulty(faults.ends_alone), 20),
    "rebound-dips": (faults.faulty(faults.ends_alone), 20),
    "floor-from-stem": (faults.faulty(faults.ends_alone), 20),
    "side-dips": (faults.faulty(faults.ends_alone), 20),
    "met-again-across-knot": (UnderAttack(stepper=faults.rounded_rates), 60),
    "extreme-scale": (faults.overflowing, 40),
    "late-phase": (faults.reduced_time, 20),
    "long-wait": (faults.impatient, 10),
    "rest-and-sweep": (faults.resting, 20),
    "narrow-base": (faults.faulty(faults.narrow_mouth), 60),
    "slow-towards-waves": (faults.faulty(faults.swept_begins_alone), 10),
    "many-harmonics": (faults.faulty(faults.few_harmonics), 10),
    "nearly-shut": (faults.faulty(faults.rough_terms), 40),
    "all-but-gone": (faults.faulty(faults.rough_terms), 40),
    "mixed-laws": (faults.faulty(faults.rounded_omega), 20),
}


def test_every_family_has_its_fault():
    assert set(KILLS) == set(FAMILIES)
    assert len(FAMILIES) >= 15


@pytest.mark.parametrize("name", deep_among(FAMILIES, "arc-dips-on-rebound", "long-wait"))
def test_our_steppers_survive(name, tally):
    (found,) = run([FAMILIES[name]], N_ATTACKS, SEED, steppers("both"))
    tally.update(found.counts)
    assert found.wrong == []
    assert found.slowest < 10.0
    if not FAMILIES[name].is_delicate:
        assert found.counts["undecided"] <= 0.2 * sum(found.counts.values()) + 2


@pytest.mark.parametrize("name", KILLS)
def test_a_family_finds_its_fault(name):
    fault, n_cases = KILLS[name]
    faulty = fault if isinstance(fault, UnderAttack) else UnderAttack(fault)
    (found,) = run([FAMILIES[name]], n_cases, SEED, faulty)
    assert found.wrong


@pytest.mark.parametrize("name", FAMILIES)
def test_family_seed_and_index_name_a_case(name):
    family = FAMILIES[name]
    lines = [line(name, 5, index, family.attack(5, index)) for index in (0, 1, 0)]
    assert lines[0] == lines[2] != lines[1]
    assert json.loads(lines[0])["family"] == name


@settings(max_examples=30)
@given(adversarial())
def test_the_strategy_draws_attacks(attack):
    assert attack.t_end is not None or attack.n_collisions is not None


@settings(max_examples=5)
@given(adversarial("long-wait"))
def test_the_strategy_draws_one_family(attack):
    assert attack.t_end > attack.state.t + 10


SCENE = load("moving-cap")
STATE = State(0.1, 0.2, 0.3, 10.0, -3.0)
ANSWER = next_collision(SCENE, STATE, 10.0)


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (lambda c: c, "agreed"),
        (lambda c: Undecided("shy"), "undecided"),
        (lambda c: Collision("floor", c.dt, c.t, c.x, c.y, c.vx, c.vy), "wrong"),
        (lambda c: Collision(c.wall, c.dt * (1 + 1e-14), c.t, c.x, c.y, c.vx, c.vy), "wrong"),
        (lambda c: Horizon(10.0, c.x, c.y, c.vx, c.vy), "wrong"),
    ],
)
def test_a_step_is_judged(spoil, kind):
    (right,) = middle(as_certified([ANSWER], STATE), STATE)
    assert stepped(spoil(right), ANSWER, STATE).kind == kind


def off(digits, number):
    """The claim that one number is another in a late digit."""

    def spoil(enclosed):
        ends = list(enclosed.ends)
        ends[number] = tuple(end * (1 + Fraction(1, 10**digits)) for end in ends[number])
        return enclosed._replace(ends=ends)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (lambda enclosed: enclosed, "agreed"),
        (lambda _: Undecided("shy"), "undecided"),
        (lambda _: Rejected("no"), "wrong"),
        (lambda enclosed: enclosed._replace(wall="base"), "wrong"),
        (lambda enclosed: enclosed._replace(wall=None), "wrong"),
        *((off(digits, number), "wrong") for digits in (16, 18, 20, 30) for number in range(5)),
    ],
)
def test_a_claim_is_judged(spoil, kind):
    assert ANSWER.wall == "arc"
    (right,) = prove(Attack(SCENE, STATE, 10.0)).answers
    assert proved(Claim([spoil(right)]), [ANSWER], STATE).kind == kind


def test_a_claim_of_another_reason_or_a_false_certificate_is_wrong():
    edge = Answer("undefined", reason="mouth-edge")
    assert proved(Claim([Undefined("corner")]), [edge], STATE).kind == "wrong"
    assert proved(Claim([Undefined("mouth-edge")]), [edge], STATE).kind == "agreed"
    scene, state = load("frozen-mushroom"), State(0.0, 0.1, 0.2, 0.3, 0.4)
    true = prove(Attack(scene, state, 9.0))
    answers = truths(Attack(scene, state, 9.0))
    assert proved(true, answers, state).kind == "agreed"
    false = true._replace(certificate={**true.certificate, "wall": "floor"})
    assert proved(false, answers, state).kind == "wrong"


def test_a_claim_beyond_the_path_is_wrong():
    (right,) = faults.claim([ANSWER]).answers
    assert proved(Claim([right, right]), [ANSWER], STATE).kind == "wrong"
    assert proved(Claim([right]), [Answer("undecided")], STATE).kind == "open"


def test_a_flow_is_judged():
    path = [ANSWER, Answer("horizon", numbers=(arb(0),) * 5)]
    assert flown({"arc": 1, "base": 0}, path).kind == "agreed"
    assert flown({"arc": 1, "base": 1}, path).kind == "wrong"
    assert flown(None, path).kind == "undecided"


def test_a_stepper_that_raises_is_a_finding():
    def raising(attack):
        raise OverflowError("too large")

    (found,) = run([FAMILIES["long-wait"]], 1, SEED, UnderAttack(raising))
    assert "OverflowError" in found.wrong[0]


def test_truths_follow_the_question():
    attack = FAMILIES["arc-dips"].attack(1, 0)
    assert len(truths(attack._replace(n_collisions=None))) == 1


def test_the_command_prints_wrong_cases(command_line, tmp_path, monkeypatch):
    found = command_line("attack", "--family", "long-wait", "--cases", 2, "--json", tmp_path / "a.json")
    assert (found.code, found.err) == (0, "")
    assert "long-wait" in found.out
    (row,) = json.loads((tmp_path / "a.json").read_text())
    assert (row["cases"], row["wrong"], row["wrong_cases"]) == (2, 0, [])
    monkeypatch.setattr("mushrooms.attack_steppers.prove", faults.impatient)
    found = command_line("attack", "--family", "long-wait", "--cases", 2, "--stepper", "reference")
    assert found.code == 1
    assert "wrong: proved, but step 1: horizon, must be" in found.out
    assert '"family": "long-wait", "seed": 0' in found.out


@pytest.mark.parametrize(
    "arguments",
    [("--family", "no-such"), ("--cases", 0), ("--seed", -1), ("--stepper", "slow"), ("--json", "file.txt")],
)
def test_the_command_refuses_bad_input(command_line, arguments):
    assert_refused(command_line("attack", *arguments), str(arguments[1]))
