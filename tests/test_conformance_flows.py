"""Flows of the corpus: between which hits a capture interval lies, and what is written."""

import math
from collections import Counter

import pytest

import reference
from conformance.cases.certify import Links, arrival, capture_intervals, certify, marks
from conformance.cases.draw import Question, Unfit
from conformance.cases.flow_families import any_marks
from conformance.cases.prover import ask, flight_of, inputs_of, moved
from conformance.vectors import four_digits, load
from scene import State
from scene import load as load_scene


@pytest.fixture(scope="module")
def corpus():
    return load("stress")


def test_flows_end_as_flows_may(corpus):
    """Without a stay, with several, with one that is on at t_end; before any hit, and after hundreds."""
    flows = [vector for vector in corpus if vector.kind == "flow"]
    answers = [vector.expect[0] for vector in flows]
    assert {answer.outcome for answer in answers} == {"horizon"}
    assert min(Counter(min(len(answer.stays), 2) for answer in answers).values()) >= 12
    assert sum(bool(a.stays) and a.stays[-1][1] == len(a.steps) - 1 for a in answers) >= 12
    assert sum(vector.collisions == 1 for vector in flows) >= 5
    for answer in answers:
        assert [step.wall for step in answer.steps].index(None) == len(answer.steps) - 1
        assert all(answer.steps[begin].wall == "arc" and begin < end for begin, end in answer.stays)


def test_some_paths_are_long(corpus):
    """Errors that begin at the five hundredth collision are asked for, and grow where no number is lost."""
    hits = [vector.collisions for vector in corpus if vector.kind != "step"]
    assert sum(n > 60 for n in hits) >= 24
    assert sum(n > 510 for n in hits) >= 5
    assert all(vector.condition <= 1e8 for vector in corpus if vector.group.startswith("long"))


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


MUSHROOM = load_scene("moving-cap")
GALLERY = State(3.0, 0.0, 0.5, 2.0, 0.25)


ASKED = Question(MUSHROOM, GALLERY, 6.0, 40, any_marks, group="gallery")


def test_a_hit_on_the_edge_of_being_captured_makes_no_vector():
    """The chord x = w keeps exactly as far from the centre as the mouth's edge."""
    static = load_scene("frozen-mushroom")
    edge = State(0.0, 0.5, 0.25, 0.0, 1.0)
    with pytest.raises(Unfit):
        marks(static, reference.trajectory(static, edge, 1, 9.0).steps)
    with pytest.raises(Unfit):
        certify(Question(static, edge, 0.75, 40, any_marks, group="edge"), 1)


def test_a_flow_keeps_of_its_path_what_is_asked():
    path = reference.trajectory(MUSHROOM, GALLERY, 40, 6.0)
    steps, found = certify(ASKED._replace(flow=None), 1).expect[0].steps, marks(MUSHROOM, path.steps)
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
    path = reference.trajectory(MUSHROOM, GALLERY, 12, 9.0)
    links, held = Links(MUSHROOM, GALLERY, 9.0), []
    for found in path.steps:
        state = links.state
        allowance = links.add(found)
        proved = flight_of(ask(MUSHROOM, state, 9.0), state, 9.0)
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
