"""The corpus: what it holds, that it is certified, and that no spoilt line and no false claim gets in."""

import hashlib
import json
import math
import shutil
from collections import Counter
from pathlib import Path

import msgspec
import pytest
from support.schemas import validator

from conformance.cases import corpus as made
from conformance.vectors import MANIFEST, BadCorpus, digest, load, manifest, request
from scene import BangBang, Fourier, catalogue, from_data
from scene.laws import bounds
from scene.protocol.messages import Command
from scene.tables import laws

CORPUS = Path(__file__).parent.parent / "conformance" / "corpus"
# As published, but for the allowance of grazing/37, which 1.3 states on both sides of a knot.
DIGEST_OF_1_0 = "e38a15536cf279f3eddc507f8bc0c9ba9dd65c5ff4dde817cbedc25e84b15878"
NEW_SINCE = {
    f"{name}.jsonl"
    for name in (
        "at-the-horizon",
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


@pytest.fixture(scope="module")
def corpus():
    return load("stress")


def features(vector):
    """Name what a vector has of which the corpus must hold enough."""
    answer, n = vector.expect[0], vector.collisions or 1
    yield vector.kind
    yield answer.outcome
    yield from (step.wall for step in answer.steps)
    if vector.kind == "flow":
        yield f"flow with {min(len(answer.stays), 2)} capture intervals"
        yield "flow without a hit" if n == 1 else "flow with hits"
        if answer.stays and answer.stays[-1][1] == len(answer.steps) - 1:
            yield "flow captured at t_end"
    if vector.kind != "step":
        yield from (f"more than {most} hits" for most in (60, 510) if n > most)


LEAST = {
    "step": 1500,
    "trajectory": 150,
    "flow": 200,
    **dict.fromkeys(("collision", "horizon", "undefined", "rejected"), 12),
    **dict.fromkeys(("arc", "base", "left", "right", "floor"), 100),
    **{f"flow with {n} capture intervals": 12 for n in (0, 1, 2)},
    "flow captured at t_end": 12,
    "flow without a hit": 5,
    # Errors that begin at the five hundredth collision are asked for, and grow where no number is lost.
    "more than 60 hits": 24,
    "more than 510 hits": 5,
}


def test_what_the_corpus_holds(corpus, tally):
    tally.update(f"{vector.level} {vector.kind}" for vector in corpus)
    counts = Counter(name for vector in corpus for name in features(vector))
    assert {name: counts[name] for name, least in LEAST.items() if counts[name] < least} == {}
    assert len({vector.id for vector in corpus}) == len(corpus)
    assert all(vector.id.startswith(f"{vector.group}/") for vector in corpus)
    assert all(vector.condition <= 1e8 for vector in corpus if vector.group.startswith("long"))
    groups = {vector.group for vector in corpus}
    assert {f"hard-case-{number:02}" for number in range(1, 49)} <= groups
    # One is no valid scene; the other asks nothing of a stepper that the rest do not, but of the theory.
    assert set(catalogue()) - {"moving-cap-as-printed"} <= groups
    assert {f"static-{table}" for table in ("cap", "stem", "mushroom")} <= groups
    assert sum(path.stat().st_size for path in CORPUS.iterdir()) < MOST_BYTES


def test_flows_end_at_their_horizon_and_capture_at_the_arc(corpus):
    for answer in (vector.expect[0] for vector in corpus if vector.kind == "flow"):
        assert answer.outcome == "horizon"
        assert [step.wall for step in answer.steps].index(None) == len(answer.steps) - 1
        assert all(answer.steps[begin].wall == "arc" and begin < end for begin, end in answer.stays)


def test_lines_published_with_1_0_are_unchanged():
    files = {name: file for name, file in manifest().files.items() if name not in NEW_SINCE}
    assert digest(files, ()) == DIGEST_OF_1_0


def periods(vector, time):
    return abs(float(time)) / (from_data(vector.scene).period or math.inf)


def laws_of(vector, kind=object):
    return [law for law in laws(from_data(vector.scene)).values() if isinstance(law, kind)]


# What groups promise: a number of each vector, its bound, and how many reach it.
PROMISES = [
    (
        "knots-off-zero",
        lambda v: max((abs(law.knots[0][0]) for law in laws_of(v, BangBang)), default=0),
        0.25,
        30,
    ),
    ("waiting", lambda v: periods(v, v.expect[0].steps[0].centre("dt")), 20, 25),
    ("waiting", lambda v: periods(v, v.expect[0].steps[0].centre("dt")), 100, 5),
    ("far-phase", lambda v: periods(v, v.state.t), 2**31, 20),
    ("far-mouth", lambda v: periods(v, v.state.t), 2**31, 20),
    (
        "many-harmonics",
        lambda v: max((len(law.harmonics()) for law in laws_of(v, Fourier)), default=0),
        4,
        20,
    ),
    ("mixed-laws", lambda v: len(set(map(type, laws_of(v)))), 2, 30),
    ("mixed-laws", lambda v: len(set(map(type, laws_of(v)))), 3, 10),
    # How near 1 nu comes, as a number that grows.
    ("mouth-nearly-whole", lambda v: 1 / (1 - bounds(from_data(v.scene).nu).highest), 0.99e9, 25),
]


@pytest.mark.parametrize(("group", "measure", "bound", "least"), PROMISES)
def test_groups_hold_what_they_promise(corpus, group, measure, bound, least):
    assert sum(measure(vector) >= bound for vector in corpus if vector.group == group) >= least


def test_levels_are_cumulative(corpus):
    core, extended = load(), load("extended")
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
    for line in lines()[::20]:
        validator("vector").validate(json.loads(line))


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
    for name in (FIRST, SECOND):
        (tmp_path / name).write_bytes(b"".join((CORPUS / name).read_bytes().splitlines(keepends=True)[:3]))
    write_manifest(tmp_path, {FIRST: 3, SECOND: 3})
    return tmp_path


def replace(path, old, new):
    path.write_bytes(path.read_bytes().replace(old, new, 1))


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


@pytest.mark.deep
def test_a_sample_is_made_again_bit_for_bit(corpus):
    there = {json.loads(line)["id"]: line for line in lines()}
    brief = [vector.id for vector in corpus if (vector.collisions or 1) <= 12]
    for name in brief[::50]:
        assert msgspec.json.encode(made.make(name)) == there[name], name


@pytest.mark.parametrize(
    "changes", [{"dt": ("1", "2")}, {"wall": "floor"}, {"allowance": (1.0, 2.0, 3.0, 4.0, 5.0)}]
)
def test_another_answer_does_not_agree_with_the_published_line(changes):
    line = made.published()["moving-cap/1"]
    known = line.expect[0]
    other = msgspec.structs.replace(known, steps=(msgspec.structs.replace(known.steps[0], **changes),))
    assert not made.agrees(msgspec.structs.replace(line, expect=(other,)), line)


def test_every_number_of_a_group_is_there_or_retired(corpus):
    there = {vector.id for vector in corpus} | set(manifest().retired)
    wanted = {f"{group}/{k}" for group, n in made.groups().items() for k in range(1, n + 1)}
    assert there == wanted
    assert set(made.RETIRED) == set(manifest().retired)
    assert manifest().corpus == made.VERSION


def test_no_such_level():
    with pytest.raises(BadCorpus, match="level = 'hard', must be one of core, extended, stress"):
        load("hard")


def test_the_command_writes_a_corpus_and_finds_what_differs(small, tmp_path, monkeypatch, capsys):
    two = {name: made.published()[name] for name in ("hard-case-06/1", "hard-case-45/1")}
    monkeypatch.setattr(made, "published", lambda: two)
    folder = tmp_path / "made"
    assert made.main(["--out", str(folder)]) == 0
    assert [path.name for path in folder.iterdir() if path.name.startswith(".")] == []
    assert len(load("stress", folder)) == 2
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
    old, new = ({vector.id: vector for vector in load("stress", at)} for at in (CORPUS, folder))
    assert new.items() > old.items()
    assert new.keys() - old.keys() == {f"hard-case-01/{made.groups()['hard-case-01'] + 1}", "steep/1"}
