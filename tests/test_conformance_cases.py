"""Attacks find nothing wrong with our steppers, each family finds its fault; nothing false is certified."""

import dataclasses
import json
import math
import os
from fractions import Fraction

import msgspec
import pytest
from support import faulty_references as faults
from support.depth import deep_but
from support.refusals import assert_refused
from support.tables import LIFT

import fast
import reference
from conformance import vectors
from conformance.cases.attacks import UnderAttack, confirmed, flown, line, run
from conformance.cases.certify import (
    FalseClaim,
    Links,
    arrival,
    capture_intervals,
    certify,
    claimed_path,
    marks,
)
from conformance.cases.draw import Question, Unfit
from conformance.cases.flow_families import any_marks
from conformance.cases.prover import ask, flight_of, inputs_of, moved, proved_step
from conformance.cases.table import FAMILIES
from conformance.vectors import NUMBERS, Expectation, certified, four_digits
from conformance.verify import Verdict
from mushrooms.questions import steppers
from scene import State, from_data, load

N_ATTACKS = int(os.environ.get("MUSHROOMS_ATTACKS", "6"))
SEED = 2014

# Of families a faulty reference that they hunt, and how many cases find it out.
KILLS = {
    "knot-at-event": (faults.knots_unseen, 60),
    "hit-at-end": (faults.hit_at_end_counts, 10),
    "knots-off-zero": (faults.period_from_zero, 10),
    "tiny-slope": (faults.residual_forgotten, 20),
    "residual": (faults.residual_forgotten, 20),
    "on-the-wall": (faults.size_of_all_time, 30),
    "corner-start": (faults.corner_unseen, 20),
    "corner-arrival": (faults.tie_guessed, 20),
    "beside-a-wall": (faults.blind_start, 40),
    "brief-mushroom-arc": (faults.ends_alone, 20),
    "bend-nu-rate-fourier": (faults.ends_alone, 20),
    "rebounding-mushroom-arc": (faults.ends_alone, 20),
    "across-a-knot": (faults.rounded_rates, 60),
    "extreme-scale": (faults.overflowing, 40),
    "late-start": (faults.reduced_time, 20),
    "waiting": (faults.impatient, 10),
    "rest-and-sweep": (faults.resting, 20),
    "thin-ring": (faults.narrow_mouth, 60),
    "slow-towards-waves": (faults.swept_begins_alone, 10),
    "many-harmonics": (faults.few_harmonics, 10),
    "nearly-shut": (faults.rough_terms, 40),
    "all-but-gone": (faults.rough_terms, 40),
    "mixed-laws": (faults.rounded_omega, 20),
}
# Families of neither the corpus nor a run, and the new ones of a run.
ATTACKS = [name for name, family in FAMILIES.items() if not family.n_vectors]


@pytest.mark.parametrize("name", deep_but(ATTACKS, *sorted({*KILLS, "growing-stem", "steep"} & {*ATTACKS})))
def test_our_steppers_survive(name, tally):
    (found,) = run([FAMILIES[name]], N_ATTACKS, SEED, steppers("both"))
    tally.update(found.counts)
    assert found.cases["wrong"] == []
    assert found.slowest < 10.0
    if not FAMILIES[name].is_delicate:
        n_left = found.counts["undecided"] + found.counts["open"]
        # Both steppers may leave the same question: two more of few may be chance.
        assert n_left <= 0.2 * sum(found.counts.values()) + 4
    assert all(len(cases) == found.counts[kind] for kind, cases in found.cases.items())


@pytest.mark.parametrize("name", KILLS)
def test_a_family_finds_its_fault(name, monkeypatch):
    fault, n_cases = KILLS[name]
    fault(monkeypatch)
    attacks = (FAMILIES[name].question(f"{SEED}/{index}") for index in range(n_cases))
    assert any(confirmed(attack).kind == "wrong" for attack in attacks)


@pytest.mark.parametrize("name", FAMILIES)
def test_family_seed_and_index_name_a_case(name):
    lines = [line(FAMILIES[name].question(f"5/{index}"), 5, index) for index in (0, 1, 0)]
    assert lines[0] == lines[2] != lines[1]
    assert json.loads(lines[0])["family"] == name


SCENE = load("moving-cap")
STATE = State(0.1, 0.2, 0.3, 10.0, -3.0)
ATTACK = Question(SCENE, STATE, 10.0)
CLAIM = proved_step(SCENE, STATE, 10.0)


def with_step(**changes):
    (step,) = CLAIM.steps
    return msgspec.structs.replace(CLAIM, steps=(msgspec.structs.replace(step, **changes),))


def off(digits, name):
    """The claim that one number is another in a late digit."""
    ends = dict(zip(NUMBERS, map(CLAIM.steps[0].ends, NUMBERS), strict=True))
    ends[name] = [end * (1 + Fraction(1, 10**digits)) for end in ends[name]]
    return msgspec.structs.replace(CLAIM, steps=(certified(ends, [0.0] * 5, "arc"),))


@pytest.mark.parametrize(
    ("claim", "kind"),
    [
        (CLAIM, "agreed"),
        (None, "undecided"),
        (Expectation("rejected"), "wrong"),
        (Expectation("undefined", reason="corner"), "wrong"),
        (with_step(wall="base"), "wrong"),
        (msgspec.structs.replace(with_step(wall=None), outcome="horizon"), "wrong"),
        *((off(digits, name), "wrong") for digits in (16, 20) for name in NUMBERS),
    ],
)
def test_a_claim_is_judged(monkeypatch, claim, kind):
    assert CLAIM.steps[0].wall == "arc"
    monkeypatch.setattr("conformance.cases.attacks.proved_step", lambda *_: claim)
    found = confirmed(ATTACK)
    assert found.kind == kind
    assert (found.claim is not None) == (kind == "agreed")


def test_a_claim_of_another_reason_is_wrong(monkeypatch):
    edge = Question(load("frozen-mushroom"), State(0.0, 0.5, 0.5, 0.0, -1.0), 9.0)
    false = Expectation("undefined", reason="corner")
    assert confirmed(edge).claim == Expectation("undefined", reason="mouth-edge")
    monkeypatch.setattr("conformance.cases.attacks.proved_step", lambda *_: false)
    assert confirmed(edge).kind == "wrong"


@pytest.mark.parametrize(("claim", "kind"), [(CLAIM, "undecided"), (with_step(wall="base"), "wrong")])
def test_an_undecided_path_is_judged_as_far_as_it_goes(monkeypatch, claim, kind):
    path = msgspec.structs.replace(claim, outcome="undecided")
    monkeypatch.setattr("conformance.cases.attacks.claimed_path", lambda *_: path)
    assert confirmed(ATTACK._replace(collisions=3)).kind == kind


def test_what_is_not_proved_is_open_and_listed(monkeypatch):
    """Steppers are held to nothing then."""
    shy = Verdict("not proved", "too hard")
    monkeypatch.setattr("conformance.cases.certify.verify_line", lambda record: shy)
    (found,) = run([FAMILIES["waiting"]], 1, SEED, UnderAttack(fast.next_collision))
    assert found.counts["open"] == 2
    assert "too hard" in found.cases["open"][0]


def test_a_flow_is_judged():
    path = claimed_path(SCENE, STATE, 9, STATE.t + 0.1)
    assert [step.wall for step in path.steps] == ["arc", None]
    assert flown({"arc": 1, "base": 0}, path).kind == "agreed"
    assert flown({"arc": 1, "base": 1}, path).kind == "wrong"
    assert flown({"arc": 1}, CLAIM).kind == "open"
    assert flown(None, path).kind == "undecided"


def test_a_stepper_that_raises_is_a_finding():
    def raising(scene, state, t_end):
        raise OverflowError("too large")

    (found,) = run([FAMILIES["waiting"]], 1, SEED, UnderAttack(raising))
    assert "OverflowError" in found.cases["wrong"][0]


def test_the_command_prints_wrong_cases(command_line, tmp_path, monkeypatch):
    found = command_line("attack", "--family", "waiting", "--cases", 2, "--json", tmp_path / "a.json")
    assert (found.code, found.err) == (0, "")
    assert "waiting" in found.out
    (row,) = json.loads((tmp_path / "a.json").read_text())
    assert (row["cases"], row["wrong"], row["wrong_cases"], row["open_cases"]) == (2, 0, [], [])
    faults.impatient(monkeypatch)
    found = command_line("attack", "--family", "waiting", "--cases", 2, "--stepper", "fast")
    assert found.code == 1
    assert "wrong: the reference claims what is false" in found.out
    assert '"family": "waiting", "seed": 0' in found.out


@pytest.mark.parametrize(
    "arguments",
    [("--family", "no-such"), ("--cases", 0), ("--seed", -1), ("--stepper", "slow"), ("--json", "file.txt")],
)
def test_the_command_refuses_bad_input(command_line, arguments):
    assert_refused(command_line("attack", *arguments), str(arguments[1]))


def test_a_false_claim_makes_no_vector(monkeypatch):
    """The reference made to lie about where a particle is: the verifier refuses."""
    honest = reference.next_collision

    def lying(*arguments, **options):
        found = honest(*arguments, **options)
        x = reference.Enclosure(found.after.x.lo + 1, found.after.x.hi + 1)
        return dataclasses.replace(found, after=found.after._replace(x=x))

    monkeypatch.setattr(reference, "next_collision", lying)
    question = Question(load("moving-cap"), State(0.3, 0.1, 0.2, 3.0, 4.0), 9.0, group="lie")
    with pytest.raises(FalseClaim, match="lie/1 is false: "):
        certify(question, 1)


@pytest.mark.parametrize(("status", "failure"), [("false", FalseClaim), ("not proved", Unfit)])
def test_what_the_verifier_does_not_prove_makes_no_vector(monkeypatch, status, failure):
    question = Question(load("moving-cap"), State(0.3, 0.1, 0.2, 3.0, 4.0), 9.0, 2, group="lie")
    assert certify(question, 1).collisions == 2
    monkeypatch.setattr("conformance.cases.certify.verify_line", lambda _: Verdict(status, "not so"))
    with pytest.raises(failure, match=f"lie/1 is {status}: not so"):
        certify(question, 1)


def test_what_has_no_answer_makes_no_vector():
    touching = State(0.0, 0.0, -1.0, 0.0, 0.0)
    with pytest.raises(Unfit):
        certify(Question(LIFT, touching, 0.75, group="touch"), 1)


def test_allowances_bound_what_a_nudge_does():
    """A relative nudge e of every input moves each number by at most e times its allowance, nearly."""
    paths = [v for v in vectors.load("stress") if v.group == "moving-cap-trajectory"]
    path = next(v for v in paths if 5 <= len(v.expect[0].steps) <= 24)  # it meets several walls
    scene, s = from_data(path.scene), path.state
    e = 2.0**-45
    nudged = State(s.t * (1 + e), s.x * (1 - e), s.y * (1 + e), s.vx * (1 + e), s.vy * (1 - e), s.wall)
    n = len([step for step in path.expect[0].steps if step.wall])
    for step, found in zip(
        path.expect[0].steps, reference.trajectory(scene, nudged, n, digits=30).steps, strict=False
    ):
        got = [float(found.dt), *map(float, found.after[1:])]
        for name, allowed, number in zip(NUMBERS, step.allowance, got, strict=True):
            difference = abs(float(Fraction(getattr(step, name)[0]) - Fraction(number)))
            assert difference <= 1.01 * e * allowed + 2.0**-52 * abs(number)


@pytest.mark.parametrize(
    ("found", "spans"),
    [
        ([], []),
        (["", "free", "out"], []),
        (["captured"], [(0, 1)]),
        (["", "captured", "", "captured"], [(1, 4)]),
        (["captured", "free", "free"], [(0, 1)]),
        (["captured", "out", "free"], [(0, 1)]),
        (["free", "captured", "free", "", "out"], [(1, 2)]),
        (["captured", "free", "captured", "", "free", "out"], [(0, 4)]),
        (["captured", "free", "captured"], [(0, 3)]),
        (["captured", "out", "out", "", "captured", "free"], [(0, 1), (4, 5)]),
    ],
)
def test_stays_by_what_hits_mean(found, spans):
    """Base hits ("") change nothing, free hits between captured ones do not divide a stay."""
    assert list(capture_intervals(found)) == spans


GALLERY = State(3.0, 0.0, 0.5, 2.0, 0.25)


ASKED = Question(SCENE, GALLERY, 6.0, 40, any_marks, group="gallery")


def test_a_hit_on_the_edge_of_being_captured_makes_no_vector():
    """The chord x = w keeps exactly as far from the centre as the mouth's edge."""
    static = load("frozen-mushroom")
    edge = State(0.0, 0.5, 0.25, 0.0, 1.0)
    with pytest.raises(Unfit):
        marks(static, reference.trajectory(static, edge, 1, 9.0).steps)
    with pytest.raises(Unfit):
        certify(Question(static, edge, 0.75, 40, any_marks, group="edge"), 1)


def test_a_flow_keeps_of_its_path_what_is_asked():
    path = reference.trajectory(SCENE, GALLERY, 40, 6.0)
    steps, found = certify(ASKED._replace(flow=None), 1).expect[0].steps, marks(SCENE, path.steps)
    assert {"captured", ""} <= set(found)
    kept = arrival(steps, capture_intervals(found))
    assert certify(ASKED, 1).expect == (kept,)
    assert certify(ASKED, 1).collisions == len(path.steps) + 1
    assert len(kept.steps) < len(steps)
    for place, end in zip(kept.stays[0], capture_intervals(found)[0], strict=True):
        flown = [sum(step.ends("dt")[side] for step in kept.steps[: place + 1]) for side in (0, 1)]
        truth = [sum(step.ends("dt")[side] for step in steps[: end + 1]) for side in (0, 1)]
        assert flown[0] <= truth[0] <= truth[1] <= flown[1]
        assert kept.steps[place].allowance[1:] == steps[end].allowance[1:]
    assert kept.steps[-1].x == steps[-1].x


def test_chained_allowances_are_those_of_sums_without_rounding():
    """One entry at a time and by fsum, as the first corpus was made."""
    path = reference.trajectory(SCENE, GALLERY, 12, 9.0)
    links, held = Links(SCENE, GALLERY, 9.0), []
    for found in path.steps:
        state = links.state
        allowance = links.add(found)
        proved = flight_of(ask(SCENE, state, 9.0), state, 9.0)
        held.append([[[float(i == j) for j in range(5)] for i in range(5)], inputs_of(state)])
        expected = [0.0] * 5
        for link in held:
            rows = [
                [math.fsum(a * b[j] for a, b in zip(row, link[0], strict=True)) for j in range(5)]
                for row in proved.jacobian
            ]
            expected = [a + moved(row, link[1]) for a, row in zip(expected, rows, strict=True)]
            link[0] = [[a + b for a, b in zip(rows[0], link[0][0], strict=True)], *rows[1:]]
        assert [four_digits(part) for part in allowance] == [four_digits(part) for part in expected]
