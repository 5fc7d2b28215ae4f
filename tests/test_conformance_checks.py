"""The checks: honest servers hold them, and each faulty server is refused by its own."""

from contextlib import nullcontext

import pytest
from hypothesis import find, settings
from support.depth import deep_among, deep_but
from support.faults import FAULTS, HARMLESS
from support.faulty_readers import refusing_lines
from support.faulty_steppers import answers_to, faulty

import reference
from conformance.mutants import COMMON, MUTANTS, PLAIN
from conformance.suite import checks
from conformance.suite import run as suite
from conformance.suite.checks import ensembles, requests, timing
from conformance.suite.checks.flows import MAX_STATES
from conformance.suite.checks.form import Draw, octaves, run_check
from conformance.suite.session import Session
from scene import BadInput, Cap, Mushroom, Rejected, State, Stem, from_data

SEEDS = 1, 2, 3
UNTIMED = [check for check in checks.checks_of() if not check.name.startswith(("profile", "promise/time"))]


@pytest.fixture
def hurried(monkeypatch):
    monkeypatch.setattr(timing, "N_TRIES", 2)
    monkeypatch.setattr(timing, "READABLE", 0.1)


def verdict_on(answer, name, seed=1):
    with Session(answer) as session:
        session.start()
        return run_check(next(check for check in checks.checks_of() if check.name == name), session, seed)


def same(request, answer):
    return answer(request)


def test_an_honest_server_holds_every_check():
    """A run of one that offers everything has all these cases, and no more."""
    run = suite.check(faulty(same), groups=["static-cap", *checks.GROUPS], seed=1)
    few = ("profile/mean-growth", "profile/reversal")  # particles, to tell anything
    expected = dict.fromkeys(suite.OTHER_CASES, "pass") | dict.fromkeys(few, "declined")
    assert {result.id: result.verdict for result in run.results if not result.level} == expected
    assert (run.objections(), run.exit_code()) == ([], 0)
    assert str(run.scope()).startswith(
        f"core {run.corpus}; cap; constant; step; trajectory, flow, time, mushroom, stem, fourier, bang-bang"
        " not graded; "
    )


# Of several that differ by a number, a wall or a profile alone, all but one; those that wait for a clock.
ALIKE = (
    *("a-tenth", "no-time", "remembering", "constant", "tenfold", "by-the-piece", "fleeing-a-faster-wall"),
    *(f"tired-at-{n}" for n in (50, 450, 1000, 2000)),
    *("straight-after-1000", "straight-after-2000", "impatient-after-512"),
    *(f"room-for-{n}" for n in (64, 256, 500)),
    *(
        "captured-in-blocks-of-16",
        "captured-in-blocks-of-32",
        "captured-in-blocks-of-64",
        "captured-up-to-100",
    ),
    *("remembering-6-digits", "remembering-9-digits", "remembering-12-digits"),
    *("flows-by-first-parts", "paths-by-first-parts", "particles-without-wall", "particles-by-place"),
    *("mouths-below-0.001-shut", "mouths-below-1e-05-shut"),
    *("mouths-above-0.999-whole", "mouths-above-0.99999-whole"),
    *("ties-within-0.0001-by-order", "ties-within-1e-08-by-order"),
    *("edge-wider-by-0.0001", "edge-wider-by-1e-06", "slopes-from--16-on"),
    *("scenes-by-1-samples", "absent-t-as-0", "absent-x-as-0", "absent-y-as-0", "absent-vx-as-0"),
    *("loose-paths", "loose-flows", "at-the-end-unchecked", "no-base-in-the-mouth-of-paths"),
    *("strictly-on-base", "strictly-on-left", "strictly-on-floor"),
)


@pytest.mark.parametrize("name", deep_among(FAULTS, *ALIKE))
def test_a_faulty_server_is_refused_in_one_of_three_runs(name, tally, hurried):
    check, verdict, fault = FAULTS[name]
    found = [verdict_on(faulty(fault), f"promise/{check}", seed) for seed in SEEDS[:1]]
    if found[0].verdict != verdict:
        found += [verdict_on(faulty(fault), f"promise/{check}", seed) for seed in SEEDS[1:]]
        tally["at a second or third seed"] += 1
    assert verdict in [result.verdict for result in found], found
    assert all(result.why.isprintable() for result in found)


@pytest.mark.parametrize(
    ("name", "is_refused"),
    {
        "no-utf8": lambda line: not line.isascii(),
        "no-escapes": lambda line: b"\\u" in line,
        "no-capital-e": lambda line: b"E+" in line or b"E-" in line,
        "64-KiB": lambda line: len(line) > 2**16,
        "512-KiB": lambda line: len(line) > 2**19,
    }.items(),
)
def test_a_server_that_cannot_read_some_lines_is_refused(name, is_refused):
    assert verdict_on(refusing_lines(is_refused), "promise/spelling").verdict == "fail", name


def test_every_rule_has_its_faulty_server():
    assert {f"promise/{check}" for check, _, _ in FAULTS.values()} == {check.name for check in checks.RULES}


@pytest.mark.parametrize("name", deep_but(HARMLESS, "names no walls and keeps no flight times"))
def test_what_is_no_fault_holds_the_checks(name):
    groups, fault = HARMLESS[name]
    for check in [check for check in UNTIMED if check.name.startswith(groups)]:
        found = verdict_on(faulty(fault), check.name)
        assert found.verdict in ("pass", "unsupported"), (check.name, found.why)


def test_a_failure_can_be_pasted_as_a_test():
    """The case that is printed fails as it stands, for the same reason."""
    check, _, fault = FAULTS["slopes-from--1-on"]
    found = verdict_on(faulty(fault), f"promise/{check}")
    names = {"implementation": faulty(fault)}
    exec(found.paste, names)
    test = next(value for name, value in names.items() if name.startswith("test_"))
    with pytest.raises(AssertionError) as broken:
        settings(max_examples=1, database=None)(test)()
    assert str(broken.value).partition("\n")[0][:60] in found.why


def test_questions_are_a_strategy_too():
    scene, *_ = find(checks.questions("promise/endings", "step"), lambda asked: True)
    assert isinstance(scene, Mushroom | Cap | Stem)


def test_bad_states_are_bad_and_good_ones_good_by_the_reference(tally):
    """What a check asks must be so: the proving stepper says the same, and leaves nothing open."""
    for scene, request, why in requests.bad_states(Draw("1"), "step"):
        start = State(**request["state"])
        outcome = reference.next_collision(scene, start, request["t_end"])
        assert isinstance(outcome, Rejected) == bool(why), (scene, request, why, outcome)
        tally["bad" if why else "good"] += 1
    assert min(tally.values()) > 100


def test_bad_scenes_are_bad_and_good_ones_good_by_proof(tally):
    for data, _, why in requests.bad_scenes(Draw("1"), "step"):
        with pytest.raises(BadInput) if why else nullcontext():
            from_data(data)
        tally["bad" if why else "good"] += 1
    assert min(tally.values()) > 100


def test_no_size_is_a_constant():
    """Two seeds share no size, and each octave up to the bound is asked about."""
    one, other = (list(octaves(Draw(str(seed)), 1, MAX_STATES)) for seed in SEEDS[:2])
    assert not set(one) & set(other)
    assert [int(size).bit_length() for size in one] == list(range(12, 0, -1))


def flow_of(name: str):
    """Answer by a mutant of the plain stepper, or by itself, or of all particles of a flow but one."""
    stepper = (MUTANTS | COMMON | dict.fromkeys(("none", "one-too-few"), PLAIN))[name]

    def flow(scene, states, t_end):
        return stepper.flow(scene, states[name == "one-too-few" :], t_end)

    return lambda line: answers_to([line], stepper.step, stepper.trajectory, flow=flow)


# A slow particle is sooner done; 20 particles cannot tell anything from anything.
FEW, SLOW, LITTLE = (
    ensembles.Size(*size) for size in ((100, 1000.0, 0.08), (400, 20.0, 0.2), (20, 20.0, 0.3))
)


@pytest.mark.parametrize(
    ("name", "case", "size", "verdict"),
    [
        ("none", "work-identity", FEW, "pass"),
        ("none", "work-identity", LITTLE, "declined"),
        ("energy-kept", "work-identity", FEW, "fail"),
        pytest.param(
            "wall-velocity-once",
            "work-identity",
            FEW._replace(n_particles=400),
            "fail",
            marks=pytest.mark.deep,
        ),
        # Loses nearly all its particles.
        ("phase-restarts-at-each-step", "work-identity", FEW, "fail"),
        pytest.param("none", "captured-share", SLOW._replace(bias=0.1), "pass", marks=pytest.mark.deep),
        ("none", "captured-share", LITTLE, "declined"),
        ("hole-static", "captured-share", SLOW._replace(bias=0.1), "fail"),
        ("none", "mean-growth", FEW, "declined"),
        ("none", "reversal", FEW, "declined"),
        ("one-too-few", "work-identity", FEW, "wrong-format"),
        ("one-too-few", "captured-share", FEW, "wrong-format"),
    ],
)
def test_ensembles_tell_a_mutant_from_an_honest_stepper(monkeypatch, name, case, size, verdict):
    monkeypatch.setitem(ensembles.SIZES, "core", size)
    found = verdict_on(flow_of(name), f"profile/{case}", 3)
    assert found.verdict == verdict, found.why
