"""Questions: attacks find nothing wrong with our steppers, each family finds its fault.

Nothing false is certified. The corpus holds what it says, and no spoilt line gets in.
"""

import hashlib
import json
import os
import shutil
from fractions import Fraction
from pathlib import Path

import msgspec
import pytest
from support import faulty_references as faults
from support.depth import deep_but
from support.refusals import assert_refused
from support.schemas import validator
from support.tables import LIFT

import fast
import reference
from conformance import vectors
from conformance.cases import corpus as made
from conformance.cases.attacks import UnderAttack, confirmed, flown, line, run
from conformance.cases.certify import (
    FalseClaim,
    capture_intervals,
    certify,
    claimed_path,
    mark,
    proved_step,
)
from conformance.cases.draw import Question, Unfit
from conformance.cases.table import FAMILIES
from conformance.grading.agreement import compare
from conformance.plain import step as plain
from conformance.vectors import (
    MANIFEST,
    NUMBERS,
    BadCorpus,
    Expectation,
    File,
    certified,
    digest,
    manifest,
    request,
)
from conformance.verify import Verdict
from mushrooms.questions import STEPPERS
from scene import State, catalogue, from_data, load
from scene.protocol.messages import Command

N_ATTACKS = int(os.environ.get("MUSHROOMS_ATTACKS", "4"))
SEED = 2014

# Families, a faulty reference that they hunt, and how many cases find it out.
KILLS = [
    ("knot-at-event", faults.knots_unseen, 60),
    ("hit-at-end", faults.hit_at_end_counts, 10),
    ("tiny-slope", faults.residual_forgotten, 20),
    ("on-the-wall", faults.size_of_all_time, 30),
    ("corner-start", faults.corner_unseen, 20),
    ("corner-arrival", faults.tie_guessed, 20),
    ("brief-mushroom-arc", faults.ends_alone, 20),
    ("bend-nu-rate-fourier", faults.ends_alone, 20),
    ("across-a-knot", faults.rounded_rates, 60),
    ("extreme-scale", faults.overflowing, 40),
    ("rest-and-sweep", faults.resting, 20),
    ("thin-ring", faults.narrow_mouth, 60),
    ("nearly-shut", faults.rough_terms, 40),
    ("all-but-gone", faults.rough_terms, 40),
    ("anywhere", faults.period_from_zero, 10),
    ("anywhere", faults.blind_start, 20),
    ("anywhere", faults.few_harmonics, 20),
    ("anywhere", faults.rounded_omega, 20),
    ("anywhere", faults.reduced_time, 20),
    ("slow-towards-waves", faults.impatient, 10),
]
USUAL = sorted({"growing-stem", "steep", *(name for name, _, _ in KILLS)})


@pytest.mark.parametrize("name", deep_but(FAMILIES, *USUAL))
def test_our_steppers_survive(name, tally):
    (found,) = run([FAMILIES[name]], N_ATTACKS, SEED, STEPPERS["both"])
    tally.update(found.counts)
    assert found.cases["wrong"] == []
    assert found.slowest < 10.0
    if not FAMILIES[name].is_delicate:
        n_left = found.counts["undecided"] + found.counts["open"]
        # Both steppers may leave the same question: two more of few may be chance.
        assert n_left <= 0.2 * sum(found.counts.values()) + 4
    assert all(len(cases) == found.counts[kind] for kind, cases in found.cases.items())


@pytest.mark.parametrize("kill", KILLS)
def test_a_family_finds_its_fault(kill, monkeypatch):
    name, fault, n_cases = kill
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


EDGE = Question(load("frozen-mushroom"), State(0.0, 0.5, 0.5, 0.0, -1.0), 9.0)
PATH = ATTACK._replace(collisions=3)


@pytest.mark.parametrize(
    ("attack", "claim", "kind"),
    [
        (ATTACK, CLAIM, "agreed"),
        (ATTACK, None, "undecided"),
        (ATTACK, Expectation("rejected"), "wrong"),
        (ATTACK, Expectation("undefined", reason="corner"), "wrong"),
        (ATTACK, with_step(wall="base"), "wrong"),
        (ATTACK, msgspec.structs.replace(with_step(wall=None), outcome="horizon"), "wrong"),
        *((ATTACK, off(digits, name), "wrong") for digits in (16, 20) for name in NUMBERS),
        (EDGE, proved_step(*EDGE[:3]), "agreed"),
        (EDGE, Expectation("undefined", reason="corner"), "wrong"),
        # An undecided path is judged as far as it goes.
        (PATH, msgspec.structs.replace(CLAIM, outcome="undecided"), "undecided"),
        (PATH, msgspec.structs.replace(with_step(wall="base"), outcome="undecided"), "wrong"),
    ],
)
def test_a_claim_is_judged(monkeypatch, attack, claim, kind):
    for name in ("proved_step", "claimed_path"):
        monkeypatch.setattr(f"conformance.cases.attacks.{name}", lambda *_: claim)
    found = confirmed(attack)
    assert found.kind == kind
    assert (found.claim is not None) == (kind == "agreed")


def test_what_is_not_proved_is_open_and_listed(monkeypatch):
    """Steppers are held to nothing then."""
    shy = Verdict("not proved", "too hard")
    monkeypatch.setattr("conformance.cases.certify.verify_line", lambda record: shy)
    (found,) = run([FAMILIES["slow-towards-waves"]], 1, SEED, UnderAttack(fast.next_collision))
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

    (found,) = run([FAMILIES["slow-towards-waves"]], 1, SEED, UnderAttack(raising))
    assert "OverflowError" in found.cases["wrong"][0]


def test_the_command_prints_wrong_cases(command_line, tmp_path, monkeypatch):
    found = command_line(
        "attack", "--family", "slow-towards-waves", "--cases", 2, "--json", tmp_path / "a.json"
    )
    assert (found.code, found.err) == (0, "")
    assert "slow-towards-waves" in found.out
    (row,) = json.loads((tmp_path / "a.json").read_text())
    assert (row["cases"], row["wrong"], row["wrong_cases"], row["open_cases"]) == (2, 0, [], [])
    faults.impatient(monkeypatch)
    found = command_line("attack", "--family", "slow-towards-waves", "--cases", 2, "--stepper", "fast")
    assert found.code == 1
    assert "wrong: the reference claims what is false" in found.out
    assert '"family": "slow-towards-waves", "seed": 0' in found.out


@pytest.mark.parametrize(
    "arguments",
    [("--family", "no-such"), ("--cases", 0), ("--seed", -1), ("--stepper", "slow"), ("--json", "file.txt")],
)
def test_the_command_refuses_bad_input(command_line, arguments):
    assert_refused(command_line("attack", *arguments), str(arguments[1]))


@pytest.mark.parametrize(("status", "failure"), [("false", FalseClaim), ("not proved", Unfit)])
def test_what_the_verifier_does_not_prove_makes_no_vector(monkeypatch, status, failure):
    question = Question(load("moving-cap"), State(0.3, 0.1, 0.2, 3.0, 4.0), 9.0, 2, group="lie")
    assert certify(question, 1).collisions == 2
    monkeypatch.setattr("conformance.cases.certify.verify_line", lambda _: Verdict(status, "not so"))
    with pytest.raises(failure, match=f"lie/1 is {status}: not so"):
        certify(question, 1)


def test_allowances_bound_what_a_nudge_does():
    """A relative nudge e of every input moves each number by at most e times its allowance, nearly."""
    paths = [v for v in vectors.load("stress") if v.group == "moving-cap-trajectory"]
    path = next(v for v in paths if 5 <= len(v.expect[0].steps) <= 24)  # it meets several walls
    scene, s = from_data(path.scene), path.state
    e = 2.0**-45
    nudged = State(s.t * (1 + e), s.x * (1 - e), s.y * (1 + e), s.vx * (1 + e), s.vy * (1 - e), s.wall)
    n = len([step for step in path.expect[0].steps if step.wall])
    again = reference.trajectory(scene, nudged, n, digits=30).steps
    assert len(again) == n >= 4
    for step, found in zip(path.expect[0].steps, again, strict=False):
        got = [float(found.dt), *map(float, found.after[1:])]
        for name, allowed, number in zip(NUMBERS, step.allowance, got, strict=True):
            difference = abs(float(Fraction(getattr(step, name)[0]) - Fraction(number)))
            assert difference <= 1.01 * e * allowed + 2.0**-52 * abs(number)


def rounding_step(scene, state, t_end):
    """Step exactly, and round what comes out: no stepper in binary64 does better."""
    outcome = reference.next_collision(scene, state, t_end, digits=25)
    return outcome.rounded() if isinstance(outcome, reference.Collision) else outcome


@pytest.mark.parametrize(
    "index", [83, 199, 203], ids=["late", "wall across the table", "start beyond the wall"]
)
def test_a_path_ends_before_rounding_leads_elsewhere(index):
    """A wall crosses the table between two neighbours in binary64: no derivative says so."""
    vector = certify(FAMILIES["knot-at-event"].question(f"k/{index}"), 1)
    known, *further = vector.expect
    assert {one.outcome for one in further} <= {"rejected"}  # late, it may be refused
    path = plain.trajectory(
        from_data(vector.scene), vector.state, len(known.steps), vector.t_end, rounding_step
    )
    assert compare(path, known, vector.state, 4.0).verdict == "pass"


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


TOUCHING = Question(LIFT, State(0.0, 0.0, -1.0, 0.0, 0.0), 0.75)
# The chord x = w keeps exactly as far from the centre as the mouth's edge.
STATIC = load("frozen-mushroom")
CHORD = Question(STATIC, State(0.0, 0.5, 0.25, 0.0, 1.0), 0.75, 40, True)


@pytest.mark.parametrize(
    "call",
    [
        lambda: certify(TOUCHING._replace(group="touch"), 1),
        lambda: certify(CHORD._replace(group="edge"), 1),
        lambda: mark(STATIC, reference.trajectory(STATIC, CHORD.state, 1, 9.0).steps[0]),
    ],
)
def test_what_has_no_answer_makes_no_vector(call):
    """A touch; a hit on the edge of being captured."""
    with pytest.raises(Unfit):
        call()


CORPUS = Path(__file__).parent.parent / "conformance" / "corpus"
# As published, but for the allowance of grazing/37, which 1.3 states on both sides of a knot.
DIGEST_OF_1_0 = "e38a15536cf279f3eddc507f8bc0c9ba9dd65c5ff4dde817cbedc25e84b15878"
NEW_SINCE = {
    f"{name}.jsonl"
    for name in (
        "at-the-horizon",
        "no-time-left",
        "retraced-arc",
        "retraced-arc-trajectory",
        "flow",
        "flow-generated",
        "flow-tilted",
        "flow-bang-bang",
        "flow-starts-captured",
        "flow-stays",
        "flow-stay-interrupted",
        "flow-stay-at-the-end",
        "flow-brief",
        "long-flow",
        "longest-flow",
        "long-trajectory",
        "knots-off-zero",
        "waiting",
        "beside-a-wall",
        "far-phase",
        "far-mouth",
        "mouth-edge",
        "mouth-nearly-whole",
        "many-harmonics",
        "tilting-side",
        "mixed-laws",
        "deep-waves",
        *(
            f"bend-{term}-{kind}"
            for term in ("r-rate", "slope-rate", "nu-rate")
            for kind in ("fourier", "bang-bang")
        ),
    )
}
MOST_BYTES = 15e6
FIRST, SECOND = "moving-cap.jsonl", "untilted.jsonl"


def test_what_the_corpus_holds(corpus, tally):
    tally.update(f"{vector.level} {vector.kind}" for vector in corpus)
    assert len({vector.id for vector in corpus}) == len(corpus)
    assert all(vector.id.startswith(f"{vector.group}/") for vector in corpus)
    assert all(vector.condition <= 1e8 for vector in corpus if vector.group.startswith("long"))
    groups = {vector.group for vector in corpus}
    assert {f"hard-case-{number:02}" for number in range(1, 49)} <= groups
    # One is no valid scene; the other asks nothing of a stepper that the rest do not, but of the theory.
    assert set(catalogue()) - {"moving-cap-as-printed"} <= groups
    assert {f"static-{table}" for table in ("cap", "stem", "mushroom")} <= groups
    assert sum(path.stat().st_size for path in CORPUS.iterdir()) < MOST_BYTES


# Answers that 1.4 lists as rules permit them, and that 1.3 left out; and how many lines its files had.
ERRATA = {f"late-start/{k}": "rejected" for k in (4, 9, 15, 18, 25, 27, 28, 33, 37, 46)}
ERRATA |= {"hard-case-46/2": "collision"}
HAD = {"late-start": 50, "hard-case-46": 9}


def before_errata(vector):
    """Return a line as it was before 1.4."""
    left_out = ERRATA.get(vector.id)
    expect = tuple(known for known in vector.expect if known.outcome != left_out)
    return msgspec.structs.replace(vector, expect=expect)


def before_1_4(name):
    """Return a file as its manifest had it before 1.4."""
    held = [json.loads(line)["id"] for line in (CORPUS / name).read_text("utf-8").splitlines()]
    held = [id_ for id_ in held if int(id_.partition("/")[2]) <= HAD.get(id_.partition("/")[0], 10**6)]
    data = vectors.encode([before_errata(made.published()[id_]) for id_ in held])
    return File(hashlib.sha256(data).hexdigest(), len(held))


def test_lines_published_with_1_0_have_their_answers_and_no_less():
    """An erratum adds an answer that a rule permits, and changes nothing else."""
    files = {name: before_1_4(name) for name in manifest().files if name not in NEW_SINCE}
    assert digest(files, ()) == DIGEST_OF_1_0
    for name, answer in ERRATA.items():
        assert answer in {known.outcome for known in made.published()[name].expect}


def test_a_line_that_leaves_out_an_answer_is_made_anew(tmp_path, monkeypatch, capsys):
    """Its first answer stays as it was published."""
    there = {name: made.published()[name] for name in ("late-start/1", "late-start/4", "hard-case-46/2")}
    monkeypatch.setattr(
        made, "published", lambda: {name: before_errata(line) for name, line in there.items()}
    )
    folder = tmp_path / "made"
    assert made.main(["--out", str(folder), "--errata"]) == 0
    assert {vector.id: vector for vector in vectors.load("stress", folder)} == there
    said = capsys.readouterr().out
    assert "late-start/4: made anew\nhard-case-46/2: made anew\n" in said
    assert "late-start/1:" not in said


def test_levels_are_cumulative(corpus):
    core, extended = vectors.load(), vectors.load("extended")
    assert {v.level for v in core} == {"core"}
    assert {v.level for v in extended} == {"core", "extended"}
    assert 1000 <= len(core) < len(extended) < len(corpus)
    assert all(v.condition <= 1e6 for v in core)
    assert all(v.condition <= 1e12 or v.expect[1:] for v in extended)


def test_requests_are_of_the_protocol_and_tell_no_answer(corpus):
    decoder = msgspec.json.Decoder(Command)
    for seq, vector in enumerate(corpus):
        asked = request(vector, seq)
        decoder.decode(msgspec.json.encode(asked))
        assert set(asked) <= {"cmd", "seq", "scene", "state", "states", "t_end", "collisions"}
        assert json.loads(json.dumps(asked)) == asked


def lines():
    return [line for path in sorted(CORPUS.glob("*.jsonl")) for line in path.read_bytes().splitlines()]


def test_lines_fit_the_schema():
    some = lines()[::20]
    assert len(some) > 100
    for text in some:
        validator("vector").validate(json.loads(text))


def first_step(data):
    return data["expect"][0]["steps"][0]


SPOILT_LINES = {
    "level": lambda d: d.update(level="easy"),
    "colour": lambda d: d.update(colour="red"),
    "t_end": lambda d: d.pop("t_end"),
    "id": lambda d: d.update(id="moving cap 1"),
    "wall": lambda d: first_step(d).update(wall="roof"),
    "dt": lambda d: first_step(d).update(dt=["0.1"]),
    "x": lambda d: first_step(d).update(x=["0.1", "nan"]),
    "vy": lambda d: first_step(d).update(vy=["1E+99999", "1E+99999"]),
    "allowance": lambda d: first_step(d).update(allowance=[1, 2, 3, 4]),
    "expect": lambda d: d.update(expect=[]),
    "collisions": lambda d: d.update(collisions=0),
}


@pytest.mark.parametrize("name", SPOILT_LINES)
def test_a_spoilt_line_is_refused(name, tmp_path):
    """By the schema; and by `load`, even where the manifest has been made to fit."""
    spoilt = json.loads((CORPUS / FIRST).read_bytes().splitlines()[0])
    SPOILT_LINES[name](spoilt)
    assert not validator("vector").is_valid(spoilt)
    (tmp_path / "spoilt.jsonl").write_text(json.dumps(spoilt) + "\n")
    write_manifest(tmp_path, {"spoilt.jsonl": 1})
    with pytest.raises(BadCorpus, match=r"spoilt.jsonl:1: .*"):
        vectors.load("core", tmp_path)


def write_manifest(folder, names, **changes):
    files = {
        name: {"sha256": hashlib.sha256((folder / name).read_bytes()).hexdigest(), "vectors": n}
        for name, n in names.items()
    }
    text = "\n".join(f"{name} {file['sha256']}" for name, file in sorted(files.items()))
    data = {"corpus": "1.0", "digest": hashlib.sha256(text.encode()).hexdigest(), "files": files, **changes}
    (folder / MANIFEST).write_text(json.dumps(data))


@pytest.fixture
def small(tmp_path):
    """A corpus of two files."""
    for name in (FIRST, SECOND):
        (tmp_path / name).write_bytes(b"".join((CORPUS / name).read_bytes().splitlines(keepends=True)[:3]))
    write_manifest(tmp_path, {FIRST: 3, SECOND: 3})
    return tmp_path


def replace(path, old, new):
    path.write_bytes(path.read_bytes().replace(old, new, 1))


TWICE = "twice.jsonl"
# What is done to the small corpus, and what `load` then says of it.
SPOILT = {
    "changed number": (lambda at: replace(at / SECOND, b"0", b"1"), r"untilted.jsonl: sha256 = .*, must be"),
    "missing file": (lambda at: (at / SECOND).unlink(), r"untilted.jsonl cannot be read"),
    "no manifest": (lambda at: (at / MANIFEST).unlink(), r"manifest.json cannot be read"),
    "broken manifest": (lambda at: (at / MANIFEST).write_text("{"), r"manifest.json: "),
    "wrong digest": (lambda at: write_manifest(at, {FIRST: 3}, digest="0" * 64), r"digest = 0+, must fit"),
    "hidden retirement": (
        lambda at: write_manifest(at, {FIRST: 3}, retired=["untilted/1"]),
        r"digest = .*, must fit",
    ),
    "wrong count": (lambda at: write_manifest(at, {FIRST: 2}), r"moving-cap.jsonl: 3 vectors, must be 2"),
    "a file twice": (
        lambda at: write_manifest(Path(shutil.copy(at / FIRST, at / TWICE)).parent, {FIRST: 3, TWICE: 3}),
        r"id moving-cap/1 appears twice, must be unique",
    ),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_corpus_is_refused(small, name):
    spoil, words = SPOILT[name]
    assert len(vectors.load("stress", small)) == 6
    spoil(small)
    with pytest.raises(BadCorpus, match=words):
        vectors.load("stress", small)


def test_a_sample_is_made_again(corpus):
    """Allowances of paths and what is kept of flows included."""
    there = {json.loads(line)["id"]: line for line in lines()}
    steps = [vector.id for vector in corpus if vector.kind == "step"]
    paths = [vector.id for vector in corpus if vector.kind != "step" and vector.collisions <= 12]
    for name in (*steps[::200], *paths[::50]):
        assert msgspec.json.encode(made.make(name)) == there[name], name


@pytest.mark.parametrize(
    "changes", [{"dt": ("1", "2")}, {"wall": "floor"}, {"allowance": (1.0, 2.0, 3.0, 4.0, 5.0)}]
)
def test_another_answer_does_not_agree_with_the_published_line(changes):
    line = made.published()["moving-cap/1"]
    known = line.expect[0]
    other = msgspec.structs.replace(known, steps=(msgspec.structs.replace(known.steps[0], **changes),))
    assert not made.agrees(msgspec.structs.replace(line, expect=(other,)), line)


@pytest.mark.parametrize(("size", "other", "does_agree"), [
    (1e-200, 0.0, False),  # an allowance that is all there is, in tiny units
    (1e-200, 5e-200, False),
    (1e-200, 1.001e-200, True),
    (1e200, 1e160, False),
    (1.0, 1e-40, False),
])  # fmt: skip
def test_allowances_are_compared_in_units_of_any_size(size, other, does_agree):
    line = scaled_step(size, [size] * 5)
    assert made.agrees(line, line)
    assert made.agrees(line, scaled_step(size, [other] + [size] * 4)) == does_agree


@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_an_allowance_that_vanishes_may_be_rounding(size):
    """Of y = 0 on a base the allowance is 0, or what 30 digits leave of the place."""
    assert made.agrees(
        scaled_step(size, [size, size, 0.0, size, size]),
        scaled_step(size, [size, size, 1e-31 * size, size, size]),
    )


@pytest.mark.parametrize("name", ["x", "y", "vx", "vy"])
def test_a_coordinate_that_vanishes_is_compared_by_the_size_of_its_vector(name):
    def line(rounding):
        known = scaled_step(1.0, [1.0] * 5)
        allowance = [rounding if number == name else 1.0 for number in vectors.NUMBERS]
        step = msgspec.structs.replace(
            known.expect[0].steps[0], **{name: ("0", "0")}, allowance=tuple(allowance)
        )
        return msgspec.structs.replace(
            known, expect=(msgspec.structs.replace(known.expect[0], steps=(step,)),)
        )

    assert made.agrees(line(0.0), line(1e-31))
    assert made.agrees(line(1e-31), line(0.0))
    assert not made.agrees(line(0.0), line(1e-29))


def scaled_step(size, allowance):
    """Return a line whose numbers have a size."""
    line = made.published()["moving-cap/1"]
    ends = (f"{size}", f"{size}")
    step = msgspec.structs.replace(
        line.expect[0].steps[0], dt=ends, x=ends, y=ends, vx=ends, vy=ends, allowance=tuple(allowance)
    )
    return msgspec.structs.replace(line, expect=(msgspec.structs.replace(line.expect[0], steps=(step,)),))


def test_every_number_of_a_group_is_there_or_retired(corpus):
    there = {vector.id for vector in corpus} | set(manifest().retired)
    wanted = {f"{group}/{k}" for group, n in made.groups().items() for k in range(1, n + 1)}
    assert there == wanted
    assert set(made.RETIRED) == set(manifest().retired)
    assert manifest().corpus == made.VERSION


def test_the_command_writes_a_corpus_and_finds_what_differs(small, tmp_path, monkeypatch, capsys):
    two = {name: made.published()[name] for name in ("hard-case-06/1", "hard-case-45/1")}
    monkeypatch.setattr(made, "published", lambda: two)
    folder = tmp_path / "made"
    assert made.main(["--out", str(folder)]) == 0
    assert [path.name for path in folder.iterdir() if path.name.startswith(".")] == []
    assert len(vectors.load("stress", folder)) == 2
    assert made.main(["--out", str(folder), "--check"]) == 0
    assert made.main(["--out", str(small), "--check"]) == 1
    assert "hard-case-06/1: differs" in capsys.readouterr().out
    assert made.main(["--out", str(tmp_path / "none"), "--check"]) == 2
    assert "manifest.json cannot be read" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        made.main(["--jobs", "0"])


def test_new_questions_are_added_to_their_groups(tmp_path):
    question = {name: json.loads(lines()[0])[name] for name in ("rule", "source", "scene", "state", "t_end")}
    file, folder = tmp_path / "new.jsonl", tmp_path / "made"
    of_family = {"family": "steep", "seed": 1, "index": 0}
    file.write_text("\n".join(map(json.dumps, (question | {"group": "hard-case-01"}, of_family))))
    assert made.main(["--out", str(folder), "--add", str(file)]) == 0
    old, new = ({vector.id: vector for vector in vectors.load("stress", at)} for at in (CORPUS, folder))
    assert new.items() > old.items()
    assert new.keys() - old.keys() == {f"hard-case-01/{made.groups()['hard-case-01'] + 1}", "steep/1"}


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"family": "none"}',
        '{"family": "steep", "seed": 1}',
        '{"group": "g"}',
        # A path that meets nothing is no vector.
        '{"group":"g","kind":"trajectory","rule":"r","source":"s","scene":{"table":"cap","r":1.0},"t_end":0.0,'
        '"state":{"t":0.0,"x":0.0,"y":0.5,"vx":0.0,"vy":0.0}}',
    ],
)
def test_what_is_no_question_is_not_added(text, tmp_path, capsys):
    file = tmp_path / "new.jsonl"
    file.write_text(text)
    assert made.main(["--out", str(tmp_path / "made"), "--add", str(file)]) == 2
    assert capsys.readouterr().err.startswith("conformance.cases: new.jsonl:1: ")
    assert not (tmp_path / "made").exists()
