"""Each rule of protocol 1 (`scene.protocol.rules`) before each of its readers, kept and broken.

The readers are the page, the JSON Schema, `scene`, the verifier, the grading, the reader of answers, and the
steppers. Each is asked questions on both sides of each rule. What a reader says must be what the rule says; a
faulty reader of each kind shows that a disagreement is seen.
"""

import json
import math
import subprocess
from collections import Counter
from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import msgspec
import pytest
from support.faulty_steppers import answers_to
from support.runnable import runnable
from support.schemas import DOCS, validator

import fast
import fast.__main__ as fast_server
import reference
import reference.__main__ as reference_server
from conformance import plain, verify
from conformance.cases.certify import claimed_path, with_further
from conformance.cases.rule_scenes import DRAWS, RuleCase
from conformance.cases.rules import sample
from conformance.grading import agreement
from conformance.harness.examples import FOLDER, compiled, find_examples, find_kit_examples
from conformance.harness.python.stepper import timed
from conformance.suite import sheet as sheets
from conformance.suite.process import CheckFailure
from conformance.suite.session import outcomes_of, read_answer
from conformance.suite.sheet import SheetQuestion
from conformance.vectors import Expectation, Vector
from scene import (
    Cap,
    Fourier,
    Horizon,
    InvalidState,
    Rejected,
    State,
    Undefined,
    from_data,
    laws as law_module,
)
from scene.protocol import rules
from scene.protocol.rules import BY_NAME, RULES, Duty, ProtocolRule, is_late, without_loose
from scene.states import ON_WALL, check_numbers

N_DRAWS = 6  # on each side of each rule
ASKED = [rule for rule in RULES if rule.part != "answer"]
ANSWERED = [rule for rule in RULES if rule.part == "answer"]
# Of a state that steppers judge: `scene` does not know where a particle is.
BY_PLACE = {"inside", "on-its-wall", "before-its-end", "leaves-its-wall", "one-wall", "lifts-off"}
# What a line of the corpus cannot break: it has no command, no seq and no counts.
BY_REQUEST = {
    "known-command", "whole-request", "request-types", "sequence", "counts", "known-request-fields",
    "fields-once",
}  # fmt: skip
RECORDED = [rule for rule in ASKED if rule.name not in BY_REQUEST]


def by_name(rule: ProtocolRule) -> str:
    return rule.name


every_asked = pytest.mark.parametrize("rule", ASKED, ids=by_name)
every_answered = pytest.mark.parametrize("rule", ANSWERED, ids=by_name)
every_recorded = pytest.mark.parametrize("rule", RECORDED, ids=by_name)


def sides(rule: ProtocolRule) -> list[tuple[RuleCase, bool]]:
    """Return questions on both sides of a rule, each with whether it is kept."""
    return [(sample(rule.name, key, is_kept), is_kept) for is_kept in (True, False) for key in range(N_DRAWS)]


def test_each_rule_is_drawn_and_none_else():
    assert set(DRAWS) == set(BY_NAME)
    assert len(BY_NAME) == len(RULES)


# The page


def of_the_page() -> str:
    page = (DOCS / "protocol.md").read_text("utf-8")
    return page.split("<!-- rules -->\n")[1].split("<!-- end of rules -->")[0].rstrip("\n") + "\n"


def test_the_page_has_the_table():
    assert of_the_page() == rules.page_section()


@pytest.mark.parametrize("rule", RULES, ids=by_name)
@pytest.mark.parametrize("change", ["name", "condition", "otherwise", "why"])
def test_a_rule_that_is_changed_is_not_on_the_page(rule, change, monkeypatch):
    if change == "otherwise":
        changed = rule._replace(otherwise=Duty.REJECT if rule.otherwise is not Duty.REJECT else Duty.IGNORE)
    else:
        changed = rule._replace(**{change: f"not {getattr(rule, change)}"})
    monkeypatch.setattr(rules, "RULES", tuple(changed if row is rule else row for row in RULES))
    assert of_the_page() != rules.page_section()


# The schema


def differs_in_schema(rule: ProtocolRule, valid: Any) -> list[Any]:
    """Return the questions of which a schema says something else than a rule."""
    return [
        drawn.request
        for drawn, is_kept in sides(rule)
        if valid.is_valid(drawn.request) != (is_kept or not rule.in_schema)
    ]


@every_asked
def test_the_schema_of_the_protocol_knows_a_rule(rule):
    assert not differs_in_schema(rule, validator("protocol", "Request"))


@pytest.mark.parametrize("rule", [rule for rule in RULES if rule.part in ("scene", "law")], ids=by_name)
def test_the_schema_of_scene_files_knows_a_rule(rule):
    scenes = validator("scene")
    for drawn, is_kept in sides(rule):
        assert scenes.is_valid(drawn.request["scene"]) == (is_kept or not rule.in_schema), drawn


LIMITS = {
    "harmonics": ("Fourier", "cos", "maxItems"),
    "knots": ("BangBang", "knots", "maxItems"),
    "positive-rate": ("Fourier", "omega", "exclusiveMinimum"),
    "texts": ("Cap", "name", "pattern"),
    "counts": ("Time", "repeat", "minimum"),
}


@pytest.mark.parametrize("name", LIMITS)
def test_a_schema_without_a_limit_is_seen(name):
    form, field, limit = LIMITS[name]
    schema = json.loads(json.dumps(validator("protocol", "Request").schema))
    del schema["$defs"][form]["properties"][field][limit]
    laxer = validator("protocol").__class__(schema)
    assert [
        drawn for drawn in (sample(name, key, False) for key in range(64)) if laxer.is_valid(drawn.request)
    ]


# scene


def check_only(scene: Any, state: State, t_end: float) -> Any:
    """Answer what `scene` says of a question, and no more."""
    try:
        check_numbers(scene, state, t_end)
    except InvalidState as refusal:
        return Rejected(str(refusal))
    return Horizon(t_end, state.x, state.y, state.vx, state.vy)


def check_path(scene: Any, state: State, n: int, t_end: float = math.inf) -> list[Any]:
    return [check_only(scene, state, min(t_end, 1e300))] if n else []


def check_time(scene: Any, state: State, n: int, repeat: int) -> Any:
    return [1] * repeat, check_only(scene, state, 1e300)


Server = Any
IN_SCENE: Server = partial(answers_to, step=check_only, follow=check_path, timer=check_time)


def outcomes(server: Server, text: str) -> list[str]:
    answer = json.loads(server([text.encode() + b"\n"]))
    return [part.get("outcome", "error") for part in outcomes_of(answer)]


def differs_in_scene(rule: ProtocolRule, n: int = N_DRAWS) -> list[Any]:
    """Return the questions that `scene` should refuse and does not, or refuses and should not."""
    due = rule.otherwise in (Duty.REJECT, Duty.IGNORE) and rule.name not in BY_PLACE
    asked = [(sample(rule.name, key, is_kept), is_kept) for is_kept in (True, False) for key in range(n)]
    found = []
    for drawn, is_kept in asked:
        is_refused = outcomes(IN_SCENE, drawn.text()) == ["rejected"]
        may_be_either = rule.name == "no-null"  # a w that is null is taken for absent, a slope is not
        if is_refused != (due and not is_kept) and not (may_be_either and not is_kept):
            found.append((drawn, is_refused))
    return found


@every_asked
def test_scene_knows_a_rule(rule):
    assert not differs_in_scene(rule)


@pytest.mark.parametrize(("name", "limit"), [("harmonics", "MAX_HARMONICS"), ("knots", "MAX_KNOTS")])
def test_a_scene_with_another_limit_is_seen(name, limit, monkeypatch):
    monkeypatch.setattr(law_module, limit, 1000)
    assert differs_in_scene(BY_NAME[name])


# The verifier, and the grading: of lines


@cache
def line_of(rule: ProtocolRule, key: int, is_kept: bool) -> Vector:
    """Return a question as a line of the corpus, with all answers that the rule permits."""
    drawn = sample(rule.name, key, is_kept)
    request = json.loads(json.dumps(drawn.request))
    fields = {name: part for name, part in request["state"].items() if name in State.__struct_fields__}
    data, is_loose = without_loose(request["scene"])
    is_loose |= len(fields) < len(request["state"])
    if drawn.as_read is None:
        expect = (Expectation("rejected"),)
        state = State(0.0, 0.125, 0.25, 0.0, 0.0)
    else:
        scene, state = from_data(data), State(**fields)
        found = claimed_path(scene, state, 1, request["t_end"])
        assert found.outcome in ("collision", "horizon", "undefined"), drawn
        expect = with_further(found, scene, state, is_loose=is_loose)
    return Vector(
        id="rule/1",
        group="rule",
        level="stress",
        kind="trajectory",
        rule=rule.name,
        source="protocol",
        scene=request["scene"],
        state=state,
        t_end=request["t_end"] if math.isfinite(request["t_end"]) else 0.0,
        expect=expect,
    )


def judge(line: Any, by: ModuleType) -> str:
    """Return what a verifier says of a line, or that it breaks down, as one without a requirement may."""
    try:
        return str(by.verify_line(line).status)
    except ArithmeticError:
        return "broken down"


def verdicts(rule: ProtocolRule, key: int, is_kept: bool, by: ModuleType = verify) -> dict[str, str]:
    """Return what the verifier says of a line, and of the line with an answer more or one less."""
    drawn, vector = sample(rule.name, key, is_kept), line_of(rule, key, is_kept)
    line = json.loads(msgspec.json.encode(vector))
    line |= {name: drawn.request[name] for name in ("scene", "state", "t_end")}
    answers = line["expect"]
    refusal = {"outcome": "rejected"}
    horizon = {"outcome": "horizon", "steps": []}
    found = {"as it is": judge(line, by)}
    if refusal not in answers:
        found["with a refusal"] = judge({**line, "expect": [*answers, refusal]}, by)
        found["a refusal alone"] = judge({**line, "expect": [refusal]}, by)
    elif len(answers) == 1:
        found["another answer"] = judge({**line, "expect": [horizon]}, by)
    for answer in answers if len(answers) > 1 else []:
        fewer = [other for other in answers if other is not answer]
        found[f"without {answer['outcome']}"] = judge({**line, "expect": fewer}, by)
    return found


def differs_in_verifier(rule: ProtocolRule, by: ModuleType = verify, n: int = N_DRAWS) -> list[Any]:
    """Return the lines that are not proved, or are proved with an answer more or less than permitted."""
    return [
        (sample(rule.name, key, is_kept), found)
        for is_kept in (True, False)
        for key in range(n)
        if (found := verdicts(rule, key, is_kept, by)).pop("as it is") != "proved"
        or "proved" in found.values()
        or not found
    ]


@every_recorded
def test_the_verifier_knows_a_rule(rule):
    assert not differs_in_verifier(rule)


SOURCE = (DOCS.parent / "conformance" / "verify.py").read_text("utf-8")
WEAKER = {
    "harmonics": ("MOST_WAVES = 16", "MOST_WAVES = 99"),
    "knots": ("MOST_KNOTS = 256", "MOST_KNOTS = 999"),
    "positive-rate": ("(omega or period or 0) > 0", "(omega or period or 1) > 0"),
    "rising-times": ("t < u, Refused", "t <= u, Refused"),
    "exact-period": ('read_number("period", period) == period', "True"),
    "known-state-fields": ("scene.is_loose or is_more or", "scene.is_loose or"),
    "known-law-fields": ("is_loose |= is_more", "pass"),
    "no-null": ("(value is not None or name not in OPTIONAL)", "True"),
    "texts": ("is_loose |= not all(", "not all("),
    "early": ("LATE = 2**30", "LATE = 2**31"),
    "small": ("LARGE = Fraction(10**100)", "LARGE = Fraction(10**101)"),
    "time-left": ("if state.t < t_end:\n            raise", "raise"),
    "end-not-before": ("state.t <= t_end, Refused", "True, Refused"),
}


@pytest.mark.parametrize("name", WEAKER)
def test_a_verifier_with_another_rule_is_seen(name):
    piece, other = WEAKER[name]
    assert SOURCE.count(piece) == 1
    weak = ModuleType("weak")
    exec(compile(SOURCE.replace(piece, other), "weak", "exec"), weak.__dict__)
    assert differs_in_verifier(BY_NAME[name], weak, 24)


def test_the_verifier_states_the_same_numbers():
    assert verify.LATE == rules.LATE
    assert verify.LARGE == rules.LARGE
    assert Fraction(ON_WALL) == verify.NEAR
    assert law_module.MAX_HARMONICS == verify.MOST_WAVES
    assert law_module.MAX_KNOTS == verify.MOST_KNOTS
    assert set(verify.OPTIONAL) == rules.OPTIONAL
    for table, form in rules.TABLES.items():
        assert {*verify.LAWS[table], "name", "notes"} == set(form.__struct_fields__)
    for kind, form in (("wave", Fourier), ("legs", rules.KINDS["bang-bang"])):
        assert set(verify.LAW_FIELDS[kind]) == {"kind", *form.__struct_fields__}


def graded(vector: Vector, outcome: str) -> str:
    """Return the verdict on an answer to a line: the certified one, or one without numbers."""
    if outcome == "right":
        known = next(one for one in vector.expect if one.outcome != "rejected")
        parts = msgspec.to_builtins(agreement.middle(known, vector.state))
    else:
        parts = [{"outcome": outcome, "reason": "corner" if outcome == "undefined" else "a reason"}]
        if outcome == "horizon":
            state = vector.state
            parts = [
                {"outcome": "horizon", "t": vector.t_end, "x": state.x, "y": state.y, "vx": 9.0, "vy": 9.0}
            ]
    return agreement.grade(vector, {"steps": parts}).verdict


def differs_in_grading(rule: ProtocolRule, n: int = N_DRAWS) -> list[Any]:
    """Return the lines whose grades are not what a rule says."""
    found = []
    for is_kept in (True, False):
        for key in range(n):
            vector = line_of(rule, key, is_kept)
            has_right = any(one.outcome != "rejected" for one in vector.expect)
            may_refuse = not is_kept and rule.otherwise.may_refuse
            is_open = (may_refuse and has_right) or vector.expect[0].outcome == "undefined"
            wanted = {
                "rejected": "pass" if may_refuse else "fail",
                "undecided": "pass" if is_open else "declined",
                "horizon": "fail",
            }
            wanted |= {"right": "pass"} if has_right else {}
            if not is_kept and rule.otherwise is Duty.ARRIVE:
                wanted |= {"undefined": "fail"}
            given = {answer: graded(vector, answer) for answer in wanted}
            if given != wanted:
                found.append((vector, given, wanted))
    return found


@every_recorded
def test_the_grading_knows_a_rule(rule):
    assert not differs_in_grading(rule)


def test_a_grading_with_another_rule_is_seen(monkeypatch):
    monkeypatch.setattr(agreement, "does_undecided_pass", lambda outcomes: False)
    assert differs_in_grading(BY_NAME["early"])


# The reader of answers


@every_answered
def test_the_reader_of_answers_knows_a_rule(rule):
    for drawn, is_kept in sides(rule):
        request = drawn.request
        if is_kept:
            read_answer(drawn.answer.encode(), request["cmd"], request["seq"])
            continue
        with pytest.raises(CheckFailure) as refused:
            read_answer(drawn.answer.encode(), request["cmd"], request["seq"])
        assert refused.value.verdict == rule.otherwise.name.lower().replace("_", "-")


# The steppers

STEPPERS: dict[str, Server] = {
    "reference": partial(
        answers_to, step=reference_server.step, follow=reference_server.follow, timer=reference_server.clock
    ),
    "plain": partial(
        answers_to, step=plain.next_collision, follow=plain.trajectory, flow=plain.flow, timer=timed
    ),
    "fast": partial(
        answers_to,
        step=fast.next_collision,
        follow=fast_server.follow,
        flow=fast_server.carry,
        timer=fast_server.clock,
    ),
}


def as_profile(drawn: RuleCase, profile: str) -> RuleCase:
    """Ask for a path or a flow in place of a step, where a step is asked for."""
    if (
        drawn.request.get("cmd") != "step"
        or profile == "step"
        or not isinstance(drawn.request.get("state"), dict)
    ):
        return drawn

    def changed(request: Any) -> Any:
        if request is None:
            return None
        if profile == "trajectory":
            return {**request, "cmd": "trajectory", "collisions": 1}
        return {
            **{n: p for n, p in request.items() if n != "state"},
            "cmd": "flow",
            "states": [request["state"]],
        }

    return RuleCase(changed(drawn.request), changed(drawn.as_read))


def differs_in_stepper(
    rule: ProtocolRule, server: Server, profile: str = "step", n: int = N_DRAWS
) -> list[Any]:
    """Return the questions that a stepper answers otherwise than a rule says; it may be undecided."""
    found = []
    for is_kept in (True, False):
        for drawn in (as_profile(sample(rule.name, key, is_kept), profile) for key in range(n)):
            given = outcomes(server, drawn.text())
            right = right_answers(rule, drawn, is_kept, profile)
            if given not in right:
                found.append((drawn, given, right))
    return found


def right_answers(
    rule: ProtocolRule, drawn: RuleCase, is_kept: bool, profile: str = "step"
) -> list[list[str]]:
    """Return the outcomes that a stepper may answer a question with."""
    right = [["undecided"]]
    if drawn.as_read is not None:
        right.append(outcomes(STEPPERS["reference"], json.dumps(as_step(drawn.as_read, profile))))
    if not is_kept and rule.otherwise.may_refuse:
        right.append(["rejected"])
    return right


def as_step(request: Any, profile: str) -> Any:
    """Return the step that asks what a flow of one particle does up to its end, or before its first hit."""
    if profile != "flow" or request.get("cmd") != "flow":
        return request
    (state,) = request["states"]
    return {**{n: p for n, p in request.items() if n != "states"}, "cmd": "step", "state": state}


@every_asked
@pytest.mark.parametrize("name", STEPPERS)
def test_a_stepper_knows_a_rule(name, rule):
    assert not differs_in_stepper(rule, STEPPERS[name])


# Without the compiler the lanes' unused quotients warn.
@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
@pytest.mark.parametrize("profile", ["trajectory", "flow"])
@pytest.mark.parametrize("name", ["plain", "fast"])
def test_a_particle_at_the_end_has_arrived_in_each_profile(name, profile):
    """A path of one step and a flow end as a step does, from each kind of start."""
    for key in range(40):
        drawn = as_profile(sample("time-left", key, False), profile)
        assert outcomes(STEPPERS[name], drawn.text())[-1] in ("horizon", "undecided"), drawn


def test_a_particle_at_the_end_is_drawn_from_each_kind_of_start():
    """As many of each kind, but for chance; a particle with time left is inside its table."""
    kinds = Counter()
    for key in range(120):
        asked, kept = (sample("time-left", key, is_kept).request for is_kept in (False, True))
        scene, start = from_data(asked["scene"]), State(**asked["state"])
        assert asked["t_end"] == start.t
        following = reference.next_collision(scene, start, start.t + 1.0, digits=10)
        if isinstance(following, Undefined):
            kinds[following.reason if following.reason in ("corner", "mouth-edge") else "along a wall"] += 1
        elif abs(start.t) > 1e6:
            kinds["early"] += 1
        else:
            kinds["on a wall" if start.wall else "mouth" if start.y == 0 else "inside"] += 1
        assert kept["t_end"] > kept["state"]["t"]
        assert kept["state"]["wall"] is None
        assert kept["state"]["y"] != 0
    assert set(kinds) == {"corner", "mouth-edge", "along a wall", "early", "on a wall", "mouth", "inside"}
    assert min(kinds.values()) >= 5, kinds


def test_steppers_decide_what_arrives():
    """Along a wall that stands still, and in the mouth, no rounding leaves anything open."""
    for name, server in STEPPERS.items():
        told = [outcomes(server, sample("time-left", key, False).text()) for key in range(60)]
        assert told.count(["horizon"]) > 40, (name, told)


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    """Start the examples and the kit's engine that can be built here, by language."""
    folder = tmp_path_factory.mktemp("examples")
    found = find_examples(folder) | find_kit_examples(folder)
    started = {}
    for language in ("C", "JavaScript", "C++, next hit"):
        if found[language].command:
            command = found[language].command
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            started[language] = found[language], subprocess.Popen(command, **pipes)
        else:
            started[language] = found[language], None
    yield started
    for _, process in started.values():
        if process is not None:
            process.kill()
            process.communicate()


@pytest.mark.parametrize("language", ["C", "JavaScript", "C++, next hit"])
def test_an_example_knows_the_rules(language, examples):
    example, process = examples[language]
    if process is None:
        assert example.is_absent, example.why_not
        pytest.skip(example.why_not)

    def exchange(lines):
        process.stdin.write(b"".join(lines))
        process.stdin.flush()
        return process.stdout.readline()

    for rule in ASKED:
        assert not differs_in_stepper(rule, exchange), rule.name


# Rules that a question in CSV can break. It has no types, no optional fields, and no empty name of a wall.
IN_FILES = (
    "sizes", "one-rate", "positive-rate", "harmonics", "own-wall", "known-wall", "inside", "on-its-wall",
    "leaves-its-wall", "one-wall", "lifts-off", "early", "small", "finite", "end-not-before", "time-left",
)  # fmt: skip


def caps_of(rule: ProtocolRule, is_kept: bool, n: int) -> list[RuleCase]:
    """Return the first n questions on one side of a rule that the example in Fortran answers."""
    found = []
    for key in range(200):
        drawn = sample(rule.name, key, is_kept)
        scene, state = drawn.request["scene"], drawn.request["state"]
        law = scene.get("r")
        is_bang_bang = isinstance(law, dict) and law.get("kind") == "bang-bang"
        if scene.get("table") == "cap" and not is_bang_bang and state.get("wall") != "" and len(found) < n:
            found.append(drawn)
    assert len(found) == n, rule.name
    return found


def answers_in_files(command: tuple[str, ...], folder: Path, cases: list[RuleCase]) -> list[str]:
    """Return the outcomes of a program that reads questions in CSV and answers in CSV."""
    questions = {
        str(seq).encode(): SheetQuestion("rule", seq, drawn.request) for seq, drawn in enumerate(cases)
    }
    asked = SimpleNamespace(questions=questions, level="core", seed=1, fresh=[])
    assert sheets.write_tables(asked, folder) == len(cases)
    done = subprocess.run(command, cwd=folder, capture_output=True, check=True)
    answers = folder / "answers.csv"
    answers.write_bytes(done.stdout)
    lines = sheets.read_answers(answers).lines
    return [json.loads(lines[seq])[0]["outcome"] for seq in range(len(cases))]


@pytest.mark.parametrize("name", IN_FILES)
def test_the_example_in_files_knows_a_rule(name, tmp_path):
    command = runnable(compiled("Fortran", ["-O2"], FOLDER / "fortran" / "caps.f90", tmp_path / "caps"))
    rule = BY_NAME[name]
    # Rounding leaves open on which side of the arc of a tiny cap a particle is.
    may_be_open = name == "sizes" or rule.otherwise in (Duty.NO_NEXT, Duty.ARRIVE)
    for is_kept in (True, False):
        cases = caps_of(rule, is_kept, 8)
        folder = tmp_path / str(is_kept)
        folder.mkdir()
        for drawn, given in zip(cases, answers_in_files(command, folder, cases), strict=True):
            right = right_answers(rule, drawn, is_kept)
            assert [given] in right, drawn
            assert given != "undecided" or may_be_open, drawn


def old_end(scene: Any, state: State, t_end: float) -> Any:
    """Answer as if a particle at the end had to fly on."""
    outcome = plain.next_collision(scene, state, t_end + 1.0)
    return outcome if isinstance(outcome, Undefined) else plain.next_collision(scene, state, t_end)


def blind_to_the_end(scene: Any, state: State, t_end: float) -> Any:
    return plain.next_collision(scene, state, max(t_end, state.t))


def early_only(scene: Any, state: State, t_end: float) -> Any:
    """Refuse all times at or after 0, which no rule permits."""
    return Rejected("late") if state.t > 0 else plain.next_collision(scene, state, t_end)


@pytest.mark.parametrize(
    ("name", "step"),
    [("time-left", old_end), ("end-not-before", blind_to_the_end), ("early", early_only)],
)
def test_a_stepper_with_another_rule_is_seen(name, step):
    server = partial(answers_to, step=step, follow=plain.trajectory)
    assert differs_in_stepper(BY_NAME[name], server, n=40)


# Lateness


def test_lateness_is_decided_at_adjacent_floats_on_both_sides_of_time_0():
    for law in (1.0, Fourier(mean=1.0, omega=3.7, cos=(0.1,)), Fourier(mean=1.0, period=0.3, cos=(0.1,))):
        scene = Cap(r=law)
        bound = 2.0**30 * (scene.period or 1.0)
        around = [bound]
        for _ in range(3):
            around = [math.nextafter(around[0], 0.0), *around, math.nextafter(around[-1], math.inf)]
        told = [is_late(scene, t) for t in around]
        assert told == sorted(told)
        assert len(set(told)) == 2
        assert told == [is_late(scene, -t) for t in around]
