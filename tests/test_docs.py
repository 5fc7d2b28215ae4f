"""The documents hold: what they name exists, the tutorial's commands do what it says, examples are valid."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import pkgutil
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from support.schemas import MODULES, validator

from conformance import plain, vectors
from conformance.suite.answers import read_answer
from scene import BadInput, load
from scene.tables import laws

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
FENCE = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Changes that the tutorial asks its reader to make, by the number of the console block that they precede.
EDITS = {2: ("box.py", "2 * rate", "1 * rate"), 3: ("box.py", "1 * rate", "2 * rate")}


def blocks(document: str, language: str) -> list[tuple[str, str]]:
    """List the fenced blocks of a language: the name after it, and the text."""
    found = FENCE.findall((DOCS / document).read_text("utf-8"))
    return [(name, text) for kind, name, text in found if kind == language]


def matches(shown: str, output: str) -> bool:
    """Tell whether the output has the shown lines in this order; `...` stands for anything."""
    pattern = re.escape(shown.strip()).replace(r"\.\.\.", ".*?")
    return re.search(pattern, output, re.DOTALL) is not None


@pytest.mark.deep
def test_the_tutorial_does_what_it_says(tmp_path):
    """One block after the other, in the reader's folder."""
    for name, text in blocks("your-stepper.md", "python"):
        if name:
            (tmp_path / name).write_text(text)
    (tmp_path / "known.txt").write_text("static-stem/1\n")
    programs = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "140"}
    consoles = blocks("your-stepper.md", "console")
    assert len(consoles) >= 5
    for number, (_, text) in enumerate(consoles):
        command, _, shown = text.removeprefix("$ ").partition("\n")
        if number in EDITS:
            name, before, after = EDITS[number]
            file = tmp_path / name
            assert file.read_text().count(before) == 1
            file.write_text(file.read_text().replace(before, after))
        done = subprocess.run(
            command, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert matches(shown, done.stdout), done.stdout[-3000:] + done.stderr
        assert done.returncode == (1 if "not accepted" in shown or "though it is listed" in shown else 0)


@pytest.mark.deep
@pytest.mark.parametrize("name", ["one-node.sh", "energies.sh", "several-nodes.sh"])
def test_the_scripts_for_a_cluster_run(tmp_path, name):
    """With few particles, another port, and functions in place of SLURM's commands."""
    script = re.sub(r"--particles \S+", "--particles 64", dict(blocks("clusters.md", "bash"))[name])
    job = {"SLURM_CPUS_PER_TASK": "1", "SLURM_ARRAY_TASK_ID": "0", "SLURM_JOB_ID": "7"}
    done = subprocess.run(
        [
            "bash",
            "-c",
            'srun() { "$@"; }; hostname() { echo 127.0.0.1; }\n' + script.replace("8786", "18786"),
        ],
        env={**os.environ, **job, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"},
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0
    assert list(tmp_path.glob("run*/summary.json"))


def test_the_tutorial_holds_a_python_stepper_to_a_property():
    (snippet,) = (text for file, text in blocks("your-stepper.md", "python") if not file)
    given = {"my_stepper": plain.next_collision}
    exec(snippet, given)
    given["test_mirror"]()


def test_the_tutorials_stepper_guesses_no_hit_at_the_horizon(tmp_path, monkeypatch):
    for name, text in blocks("your-stepper.md", "python"):
        if name:
            (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    question = {"scene": {"w": 1.0, "h": 1.0}, "state": {"t": 0.0, "x": 0.0, "y": -0.5, "vx": 1.0, "vy": 0.0}}
    outcomes = [importlib.import_module("box").step({**question, "t_end": t})["outcome"] for t in (0.5, 1, 2)]
    assert outcomes == ["horizon", "undecided", "collision"]


def test_another_output_would_be_seen():
    assert matches("4 of 24 cases pass, ... s: not accepted", "4 of 24 cases pass, 1.0 s: not accepted")
    assert not matches("4 of 24 cases pass, ... s: not accepted", "5 of 24 cases pass, 1.0 s: not accepted")
    assert not matches("a\n...\nb", "b\na\n")


def test_the_figures_of_the_corpus_are_right():
    text = " ".join((DOCS / "corpus.md").read_text("utf-8").split())
    corpus = vectors.load("stress")
    kinds = Counter(vector.kind for vector in corpus)
    levels = Counter(vector.level for vector in corpus)
    assert (
        f"Corpus {vectors.manifest().corpus} holds {kinds['step']:,} steps, {kinds['trajectory']}"
        f" trajectories and {kinds['flow']} flows" in text
    )
    shown = "{core:,} of them at level core, {extended} at extended, {stress} at stress".format(**levels)
    assert shown in text
    [(name, example)] = blocks("corpus.md", "json")
    published = ROOT / "conformance" / "corpus" / f"{name.split('/')[0]}.jsonl"
    assert json.loads(example) in map(json.loads, published.read_text("utf-8").splitlines())


@pytest.mark.parametrize("name", MODULES)
def test_a_published_schema_is_what_its_module_makes(name):
    made = importlib.import_module(MODULES[name]).json_schema()
    assert validator(name).schema == json.loads(json.dumps(made))
    validator(name).check_schema(made)


def test_the_examples_of_the_protocol_fit_its_schema():
    """Every line of a block: > is a request, < an answer; together they show every kind of message."""
    kinds = {">": validator("protocol", "Request"), "<": validator("protocol", "Answer")}
    shown = set()
    for _, text in blocks("protocol.md", "json"):
        for line in text.splitlines():
            if line in ("> what?", "> [1,2]", '> {"cmd":"dance","seq":25}'):  # no requests, nor meant to be
                continue
            mark, message = line[0], json.loads(line[1:])
            if mark == "<" or message.get("seq") != 26:  # it lacks `vy`
                kinds[mark].validate(message)
            shown |= {message.get("cmd"), message.get("outcome"), *message}
    assert shown >= {"start", "echo", "step", "trajectory", "flow", "time", "stop"}
    assert shown >= {"collision", "horizon", "undefined", "undecided", "rejected", "error"}
    assert shown >= {"values", "profiles", "steps", "states", "ns"}


def test_the_examples_of_the_protocol_are_what_plain_answers():
    """To the bit: nothing in them takes a sine. The example in Python puts plain behind the protocol."""
    lines = [line for _, text in blocks("protocol.md", "json") for line in text.splitlines()]
    followers = [*lines[1:], ""]
    asked = [line[2:] for line in lines if line[0] == ">" and '"stop"' not in line]
    shown = [
        after[1:] for line, after in zip(lines, followers, strict=True) if line[0] == ">" and after[0] == "<"
    ]
    assert len(shown) == len(asked)  # each with its answer after it
    done = subprocess.run(
        [sys.executable, str(ROOT / "conformance" / "harness" / "python" / "stepper.py")],
        input="\n".join([*asked, '{"cmd":"stop"}']),
        capture_output=True,
        text=True,
        check=True,
    )
    answered = [json.loads(line) for line in done.stdout.splitlines()]
    expected = [json.loads(line) for line in shown]
    timed = next(i for i, answer in enumerate(expected) if "ns" in answer)
    assert answered[0].keys() == expected[0].keys()
    assert len(answered[timed].pop("ns")) == len(expected[timed].pop("ns"))
    assert answered[1:] == expected[1:]


def test_the_answers_that_stand_alone_in_the_protocol_are_read():
    lines = [line for _, text in blocks("protocol.md", "json") for line in text.splitlines()]
    pairs = zip(["", *lines], lines, strict=False)
    alone = [line[1:] for before, line in pairs if line[0] == "<" and before[:1] != ">"]
    found = [read_answer(line.encode(), "step", json.loads(line)["seq"]) for line in alone]
    assert [set(answer) for answer in found] == [{"error"}, {"outcome", "t", "x", "y", "vx", "vy"}]


MADE = DOCS / "generated"  # by the site, and named by pages that tests/test_docs_site.py makes pictures of
PAGES = sorted(
    path
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")]
    if not path.is_relative_to(MADE)
)
PACKAGES = ("scene", "reference", "fast", "theory", "conformance", "mushrooms")


def missing(page: Path, text: str) -> list[str]:
    """List what a page names and what is not there: files, folders, modules and what is in them, links.

    Not looked for are files without their folder, and reports that commands write.
    """
    named = re.findall(r"`([\w./-]+)`", text) + re.findall(r"(?<![\w/])tests/\w+\.py", text)
    paths = [name for name in named if re.fullmatch(r"(?:\.?\w[\w.-]*/)+(?:[\w-]+\.\w+)?", name)]
    paths = [path for path in paths if not re.match(r"[a-z]+-report/", path)]
    dotted = [name for name in named if re.fullmatch(rf"(?:{'|'.join(PACKAGES)})(?:\.[A-Za-z_]\w*)+", name)]
    modules = re.findall(rf"python -m ((?:{'|'.join(PACKAGES)})[\w.]*)", text)
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)
    return [
        *(path for path in paths if not ((ROOT / path).exists() or (page.parent / path).exists())),
        *(name for name in dotted if not is_found(name)),
        *(name for name in modules if importlib.util.find_spec(name) is None),
        *(
            link
            for link in links
            if not ((page.parent / link).exists() or (page.parent / link).is_relative_to(MADE))
        ),
    ]


def is_found(name: str) -> bool:
    """Tell whether a dotted name is a module, or something in one."""
    try:
        pkgutil.resolve_name(name)
    except (AttributeError, ModuleNotFoundError):
        return False
    return True


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_what_a_page_names_exists(page):
    assert missing(page, page.read_text("utf-8")) == []


def test_every_page_is_named_by_another():
    """The contents of the site do not count: who reads on does not look there."""
    aside = {DOCS / name for name in ("index.md", "changelog.md", "contributing.md")}
    links = {
        (page.parent / link).resolve()
        for page in PAGES
        if page != DOCS / "index.md"
        for link in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
    }
    pages = {page for page in PAGES if page.is_relative_to(DOCS) and not page.is_relative_to(DOCS / "api")}
    assert pages - aside <= links


@pytest.mark.parametrize(
    "planted",
    [
        "`fast/kernels/walls.py`",
        "`conformance/rooms/`",
        "`scene.tables.Walls`",
        "`conformance.second_provers`",
        "pytest tests/test_nothing.py",
        "`python -m conformance.casess`",
        "[glossary](docs/glossery.md)",
    ],
)
def test_a_name_of_nothing_is_found_out(planted):
    assert len(missing(ROOT / "README.md", planted)) == 1


def test_the_layout_has_a_line_for_every_folder():
    named = set(re.findall(r"\n\| `([a-z_/]+)/` \|", (ROOT / "CONTRIBUTING.md").read_text("utf-8")))
    files = [path for top in (*PACKAGES, "tests") for path in (ROOT / top).rglob("*")]
    folders = {path.parent.relative_to(ROOT).as_posix() for path in files if path.is_file()}
    assert named == {folder for folder in folders if "__pycache__" not in folder}


def test_the_entrance_stays_short():
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) < 150


def test_the_proof_names_what_exists():
    """Every place of the argument that the page names is in the reference or in the verifier."""
    text = (DOCS / "proof.md").read_text("utf-8")
    places = set(re.findall(r"`(?:reference\.)?([a-z_]+)\.([A-Za-z_.]+)`", text))
    assert len(places) >= 25
    for module, place in places:
        home = "conformance." if module == "verify" else "" if module == "reference" else "reference."
        pkgutil.resolve_name(f"{home}{module}:{place}")


def test_the_scenes_of_the_scene_page_are_what_it_says(tmp_path):
    """Every file of docs/scenes.md loads, in TOML and in JSON; those with a text block are refused by it."""
    refusals = dict(blocks("scenes.md", "text"))
    shown = Counter()
    for name, text in blocks("scenes.md", "toml"):
        (tmp_path / name).write_text(text, "utf-8")
        as_json = tmp_path / f"{name}.json"
        as_json.write_text(json.dumps({"$schema": "scene.schema.json", **tomllib.loads(text)}), "utf-8")
        if name in refusals:
            for path in (tmp_path / name, as_json):
                with pytest.raises(BadInput, match=re.escape(refusals[name].strip())):
                    load(path)
            continue
        table = load(tmp_path / name)
        assert load(as_json) == table
        shown.update([type(table).__name__, *(type(law).__name__ for law in laws(table).values())])
    assert set(shown) == {"Cap", "Stem", "Mushroom", "float", "Fourier", "BangBang"}
    assert len(refusals) == 1
