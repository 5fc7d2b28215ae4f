"""The corpus: what it holds, that it is certified, and that no spoilt line and no false claim gets in."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import shutil
from collections import Counter
from fractions import Fraction
from pathlib import Path

import msgspec
import pytest
from support.schemas import validator
from support.tables import LIFT

import reference
from conformance.generator import __main__ as generate
from conformance.generator.certify import Refuted, certify
from conformance.generator.coverage_families import coverage_families
from conformance.generator.draws import wire_form
from conformance.generator.families import CATALOGUE
from conformance.generator.flow_families import flow_families
from conformance.generator.links import Unfit
from conformance.generator.question import Question
from conformance.vectors import MANIFEST, NUMBERS, BadCorpus, digest, load, manifest, request
from conformance.verify import Verdict
from scene import BadInput, BangBang, Fourier, State, catalogue, from_data
from scene import load as load_scene
from scene.laws import bounds
from scene.protocol.messages import Command
from scene.tables import cycle_length, laws

CORPUS = Path(__file__).parent.parent / "conformance" / "corpus"
N_STEPS, N_TRAJECTORIES, N_FLOWS = 36, 4, 4  # made again, bit for bit
DIGEST_OF_1_0 = "7b4dfba08bb334232cba9faca64601138b9b7b53a4b45b5984747379d26c70eb"
NEW_IN_1_1 = {
    f"{name}.jsonl"
    for name in (
        "at-the-horizon",
        "retraced-arc",
        "retraced-arc-trajectory",
        *(family.group for family in [*flow_families(), *coverage_families()]),
    )
}
MOST_BYTES = 15e6


@pytest.fixture(scope="module")
def corpus():
    return load("stress")


def test_what_the_corpus_holds(corpus, tally):
    tally.update(f"{vector.level} {vector.kind}" for vector in corpus)
    kinds = Counter(vector.kind for vector in corpus)
    assert kinds["step"] >= 1500
    assert kinds["trajectory"] >= 150
    assert kinds["flow"] >= 200
    assert len({vector.id for vector in corpus}) == len(corpus)
    assert all(vector.id.startswith(f"{vector.group}/") for vector in corpus)
    groups = {vector.group for vector in corpus}
    assert {f"hard-case-{number:02}" for number in range(1, 49)} <= groups
    # One is no valid scene; the other asks nothing of a stepper that the rest do not, but of the theory.
    assert set(CATALOGUE) == set(catalogue()) - {"moving-cap-as-printed"} <= groups
    assert {f"static-{table}" for table in ("cap", "stem", "mushroom")} <= groups
    outcomes = Counter(vector.expect[0].outcome for vector in corpus)
    assert min(outcomes[kind] for kind in ("collision", "horizon", "undefined", "rejected")) >= 12
    walls = Counter(step.wall for vector in corpus for step in vector.expect[0].steps)
    assert min(walls[wall] for wall in ("arc", "base", "left", "right", "floor")) >= 100
    assert sum(path.stat().st_size for path in CORPUS.iterdir()) < MOST_BYTES


def test_lines_published_with_1_0_are_unchanged():
    files = {name: file for name, file in manifest().files.items() if name not in NEW_IN_1_1}
    assert digest(files, ()) == DIGEST_OF_1_0


def periods_late(vector):
    return abs(vector.state.t) / (cycle_length(from_data(vector.scene)) or math.inf)


def periods_in_flight(vector):
    (step,) = vector.expect[0].steps
    return float(step.centre("dt")) / (cycle_length(from_data(vector.scene)) or math.inf)


def first_knot(vector):
    found = [law for law in laws(from_data(vector.scene)).values() if isinstance(law, BangBang)]
    return abs(found[0].knots[0][0]) if found else 0.0


def most_harmonics(vector):
    found = [law for law in laws(from_data(vector.scene)).values() if isinstance(law, Fourier)]
    return max((len(law.harmonics()) for law in found), default=0)


def kinds_of_laws(vector):
    return len({type(law) for law in laws(from_data(vector.scene)).values()})


def sharpness_of_edge(vector):
    """How near 1 nu comes, as a number that grows."""
    return 1 / (1 - float(bounds(from_data(vector.scene).nu).highest))


@pytest.mark.parametrize(
    ("group", "measure", "bound", "least"),
    [
        ("knots-off-zero", first_knot, 0.25, 30),
        ("waiting", periods_in_flight, 20, 25),
        ("waiting", periods_in_flight, 100, 5),
        ("far-phase", periods_late, 2**31, 20),
        ("far-mouth", periods_late, 2**31, 20),
        ("many-harmonics", most_harmonics, 4, 20),
        ("mixed-laws", kinds_of_laws, 2, 30),
        ("mixed-laws", kinds_of_laws, 3, 10),
        ("mouth-nearly-whole", sharpness_of_edge, 0.99e9, 25),
    ],
)
def test_groups_hold_what_they_promise(corpus, group, measure, bound, least):
    assert sum(measure(vector) >= bound for vector in corpus if vector.group == group) >= least


def test_levels_are_cumulative(corpus):
    core, extended = load(), load("extended")
    assert {v.level for v in core} == {"core"}
    assert {v.level for v in extended} == {"core", "extended"}
    assert len(core) < len(extended) < len(corpus)
    assert all(v.condition <= 1e6 for v in core)
    assert all(v.condition <= 1e12 or v.expect[1:] for v in extended)
    assert len(core) >= 1000


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
    for line in lines()[::20]:
        validator("vector").validate(json.loads(line))


def spoilt_lines():
    line = json.loads((CORPUS / "moving-cap.jsonl").read_bytes().splitlines()[0])

    def spoil(change):
        spoilt = json.loads(json.dumps(line))
        change(spoilt)
        return spoilt

    def step(data):
        return data["expect"][0]["steps"][0]

    return {
        "level": spoil(lambda d: d.update(level="easy")),
        "colour": spoil(lambda d: d.update(colour="red")),
        "t_end": spoil(lambda d: d.pop("t_end")),
        "id": spoil(lambda d: d.update(id="moving cap 1")),
        "wall": spoil(lambda d: step(d).update(wall="roof")),
        "dt": spoil(lambda d: step(d).update(dt=["0.1"])),
        "x": spoil(lambda d: step(d).update(x=["0.1", "nan"])),
        "vy": spoil(lambda d: step(d).update(vy=["1E+99999", "1E+99999"])),
        "allowance": spoil(lambda d: step(d).update(allowance=[1, 2, 3, 4])),
        "expect": spoil(lambda d: d.update(expect=[])),
        "collisions": spoil(lambda d: d.update(collisions=0)),
    }


@pytest.mark.parametrize("name", spoilt_lines())
def test_a_spoilt_line_is_refused(name, tmp_path):
    """By the schema; and by `load`, even where the manifest has been made to fit."""
    spoilt = spoilt_lines()[name]
    assert not validator("vector").is_valid(spoilt)
    (tmp_path / "spoilt.jsonl").write_text(json.dumps(spoilt) + "\n")
    write_manifest(tmp_path, {"spoilt.jsonl": 1})
    with pytest.raises(BadCorpus, match=r"spoilt.jsonl:1: .*"):
        load("core", tmp_path)


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
    for name in ("moving-cap.jsonl", "untilted.jsonl"):
        (tmp_path / name).write_bytes(b"".join((CORPUS / name).read_bytes().splitlines(keepends=True)[:3]))
    write_manifest(tmp_path, {"moving-cap.jsonl": 3, "untilted.jsonl": 3})
    return tmp_path


def replace(path, old, new):
    path.write_bytes(path.read_bytes().replace(old, new, 1))


FIRST, SECOND = "moving-cap.jsonl", "untilted.jsonl"
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
        lambda at: write_manifest(
            shutil.copy(at / FIRST, at / "again.jsonl").parent, {FIRST: 3, "again.jsonl": 3}
        ),
        r"id moving-cap/1 appears twice",
    ),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_corpus_is_refused(small, name):
    spoil, words = SPOILT[name]
    assert len(load("stress", small)) == 6
    spoil(small)
    with pytest.raises(BadCorpus, match=words):
        load("stress", small)


def test_an_unknown_level_is_refused():
    with pytest.raises(BadCorpus, match="level = 'hard', must be one of core, extended, stress"):
        load("hard")


def sample():
    """Ids spread over the corpus."""
    found = load("stress")
    steps = [v.id for v in found if v.kind == "step"]
    paths = [v.id for v in found if v.kind == "trajectory" and len(v.expect[0].steps) <= 12]
    flows = [v.id for v in found if v.kind == "flow" and v.collisions <= 12]
    kinds = ((steps, N_STEPS), (paths, N_TRAJECTORIES), (flows, N_FLOWS))
    return [name for names, n in kinds for name in names[:: len(names) // n][:n]]


@pytest.mark.deep
def test_a_sample_is_made_again_bit_for_bit():
    there = {json.loads(line)["id"]: line for line in lines()}
    ids = sample()
    assert len(ids) == N_STEPS + N_TRAJECTORIES + N_FLOWS
    for name in ids:
        group, number = name.split("/")
        assert msgspec.json.encode(generate.make(group, int(number))) == there[name], name


def test_every_number_of_a_group_is_there_or_retired(corpus):
    there = {vector.id for vector in corpus} | set(manifest().retired)
    wanted = {f"{g}/{n}" for g, makers in generate.groups().items() for n in range(1, len(makers) + 1)}
    assert there == wanted
    assert set(generate.RETIRED) == set(manifest().retired)
    assert manifest().corpus == generate.VERSION


@pytest.mark.parametrize(("group", "number"), [("moving-cap", 0), ("moving-cap", 10**6), ("no-such", 1)])
def test_no_vector_of_that_name(group, number):
    with pytest.raises(BadInput, match=f"{group}/{number}"):
        generate.make(group, number)


def test_the_command_writes_a_corpus_and_finds_what_differs(small, tmp_path, monkeypatch, capsys):
    makers = {name: generate.groups()[name] for name in ("hard-case-06", "hard-case-45")}
    monkeypatch.setattr(generate, "groups", lambda: makers)
    folder = tmp_path / "made"
    assert generate.main(["--out", str(folder), "--most", "1"]) == 0
    assert [path.name for path in folder.iterdir() if path.name.startswith(".")] == []
    assert len(load("stress", folder)) == 2
    assert generate.main(["--out", str(folder), "--most", "1", "--check"]) == 0
    assert generate.main(["--out", str(small), "--most", "1", "--check"]) == 1
    assert "hard-case-06/1: differs" in capsys.readouterr().out
    assert generate.main(["--out", str(tmp_path / "none"), "--most", "1", "--check"]) == 2
    assert "manifest.json cannot be read" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        generate.main(["--most", "0"])


def test_a_false_claim_makes_no_vector(monkeypatch):
    """The reference made to lie about where a particle is: the verifier refuses."""
    honest = reference.next_collision

    def lying(*arguments, **options):
        found = honest(*arguments, **options)
        x = reference.Enclosure(found.after.x.lo + 1, found.after.x.hi + 1)
        return dataclasses.replace(found, after=found.after._replace(x=x))

    monkeypatch.setattr(reference, "next_collision", lying)
    question = Question(
        "lie", "", "", wire_form(load_scene("moving-cap")), State(0.3, 0.1, 0.2, 3.0, 4.0), 9.0
    )
    with pytest.raises(Refuted, match="lie/1 is false: "):
        certify(question, 1)


@pytest.mark.parametrize(("status", "failure"), [("false", Refuted), ("not proved", Unfit)])
def test_what_the_verifier_does_not_prove_makes_no_vector(monkeypatch, status, failure):
    scene, start = load_scene("moving-cap"), State(0.3, 0.1, 0.2, 3.0, 4.0)
    question = Question("lie", "", "", wire_form(scene), start, 9.0, collisions=2)
    assert certify(question, 1).collisions == 2
    monkeypatch.setattr("conformance.generator.certify.verify_line", lambda _: Verdict(status, "not so"))
    with pytest.raises(failure, match=f"lie/1 is {status}: not so"):
        certify(question, 1)


def test_what_has_no_answer_makes_no_vector():
    touching = State(0.0, 0.0, -1.0, 0.0, 0.0)
    with pytest.raises(Unfit):
        certify(Question("touch", "", "", wire_form(LIFT), touching, 0.75), 1)


def test_allowances_bound_what_a_nudge_does(path):
    """A relative nudge e of every input moves each number by at most e times its allowance, nearly."""
    scene, s = from_data(path.scene), path.state
    e = 2.0**-45
    nudged = State(s.t * (1 + e), s.x * (1 - e), s.y * (1 + e), s.vx * (1 + e), s.vy * (1 - e), s.wall)
    n = len([step for step in path.expect[0].steps if step.wall])
    moved = reference.trajectory(scene, nudged, n, digits=30)
    for step, found in zip(path.expect[0].steps, moved.steps, strict=False):
        for name, allowed in zip(NUMBERS, step.allowance, strict=True):
            got = found.dt if name == "dt" else getattr(found.after, name)
            difference = abs(float(Fraction(getattr(step, name)[0]) - Fraction(float(got))))
            assert difference <= 1.01 * e * allowed + 2.0**-52 * abs(float(got))


def test_the_first_step_of_a_trajectory_is_that_of_a_step(path):
    question = Question("alone", "", "", path.scene, path.state, path.t_end)
    (alone,) = certify(question, 1).expect[0].steps
    first = path.expect[0].steps[0]
    assert (first.wall, first.allowance) == (alone.wall, alone.allowance)
    for name in NUMBERS:
        (low, high), (inner_low, inner_high) = getattr(first, name), getattr(alone, name)
        assert Fraction(low) <= Fraction(inner_low) <= Fraction(inner_high) <= Fraction(high)
