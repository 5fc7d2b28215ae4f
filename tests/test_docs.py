"""The documents hold: what they name exists, commands and code do what they say, numbers are the code's."""

import doctest
import importlib
import importlib.util
import json
import math
import os
import pkgutil
import re
import shlex
import socket
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest
from mpmath import fp
from support.depth import deep_but
from support.schemas import MODULES, validator

import fast
import theory
from conformance import plain
from conformance.cases.generated import ROUND
from conformance.cases.table import FAMILIES
from conformance.mutants import MUTANTS
from conformance.suite.checks.bad_input import MOST_SAMPLES
from conformance.suite.checks.flows import MAX_STATES
from conformance.suite.checks.paths import MAX_HITS, MAX_LATE, MAX_WAIT, NEAREST, STEEPEST
from conformance.suite.result import MAX_DECLINED_OF_PART, VERDICTS, declines_too_much
from conformance.suite.session import read_answer
from docs import figures, pictures
from fast.kernel.fates import MOST_TO_A_TIME
from fast.kernel.follow import LANE_ROWS
from fast.validation import MAX_CYCLES, MOST_IN_CYCLES
from mushrooms.commands import MOST_ON_DISK
from mushrooms.orbits import MAX_COLLISIONS, MAX_ORBITS
from mushrooms.simulate import MOST_IN_MEMORY
from mushrooms.store import conduct
from mushrooms.store.spec import FIELDS, RunSpec, Shape, shape_of
from reference.arithmetic import MAX_WORK
from scene import BadInput, from_data, load
from scene.laws import MAX_HARMONICS, MAX_KNOTS
from scene.load import catalogue, catalogue_text
from theory.distribution import loss_probability

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Changes that the tutorial asks its reader to make, by the number of the console block that they precede.
EDITS = {2: ("box.py", "2 * rate", "1 * rate"), 4: ("box.py", "1 * rate", "2 * rate")}


def fences(document: str) -> list[tuple[str, str]]:
    """List the first line and the text of each fenced block of a page."""
    return FENCE.findall((DOCS / document).read_text("utf-8"))


def blocks(document: str, language: str) -> list[tuple[str, str]]:
    """List the fenced blocks of a language: the name after it, and the text."""
    found = [(*first.partition(" "), text) for first, text in fences(document)]
    return [(name, text) for kind, _, name, text in found if kind == language]


def write_tutorial(folder: Path) -> None:
    """Write the files of the tutorial into a folder."""
    for name, text in blocks("your-stepper.md", "python"):
        if name:
            (folder / name).write_text(text)


def matches(shown: str, output: str) -> bool:
    """Tell whether the output has the shown lines in this order; `...` stands for anything."""
    pattern = re.escape(shown.strip()).replace(r"\.\.\.", ".*?")
    return re.search(pattern, output, re.DOTALL) is not None


@pytest.mark.deep
def test_the_tutorial_does_what_it_says(tmp_path):
    """One block after the other, in the reader's folder."""
    write_tutorial(tmp_path)
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
    """With few particles, a free port, and functions in place of SLURM's commands."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    script = re.sub(r"--particles \S+", "--particles 64", dict(blocks("clusters.md", "bash"))[name])
    job = {"SLURM_CPUS_PER_TASK": "1", "SLURM_ARRAY_TASK_ID": "0", "SLURM_JOB_ID": "7"}
    done = subprocess.run(
        [
            "bash",
            "-c",
            'srun() { "$@"; }; hostname() { echo 127.0.0.1; }\n' + script.replace("8786", str(port)),
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
    write_tutorial(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    question = {"scene": {"w": 1.0, "h": 1.0}, "state": {"t": 0.0, "x": 0.0, "y": -0.5, "vx": 1.0, "vy": 0.0}}
    outcomes = [importlib.import_module("box").step({**question, "t_end": t})["outcome"] for t in (0.5, 1, 2)]
    assert outcomes == ["horizon", "undecided", "collision"]


def test_another_output_would_be_seen():
    assert matches("4 of 24 cases pass, ... s: not accepted", "4 of 24 cases pass, 1.0 s: not accepted")
    assert not matches("4 of 24 cases pass, ... s: not accepted", "5 of 24 cases pass, 1.0 s: not accepted")
    assert not matches("a\n...\nb", "b\na\n")


@pytest.mark.parametrize(
    "page", sorted({path for path in DOCS.glob("*.md") if "<!-- figures" in path.read_text()})
)
def test_the_numbers_of_a_page_are_those_of_its_command(page):
    """If this fails, `python -m docs.figures` writes them anew."""
    text = page.read_text("utf-8")
    assert figures.refreshed(text) == text


def test_every_region_of_numbers_is_on_a_page():
    marked = [
        name for page in DOCS.glob("*.md") for _, name, *_ in figures.REGION.findall(page.read_text("utf-8"))
    ]
    assert sorted(marked) == sorted(figures.REGIONS)


def test_a_number_that_is_out_of_date_is_replaced():
    stale = (DOCS / "speed.md").read_text("utf-8").replace("| fast, lanes | 12 |", "| fast, lanes | 11 |")
    assert "| fast, lanes | 12 |" in figures.refreshed(stale)


def test_the_vector_of_the_corpus_page_is_published():
    [(name, example)] = blocks("corpus.md", "json")
    published = ROOT / "conformance" / "corpus" / f"{name.split('/')[0]}.jsonl"
    assert json.loads(example) in map(json.loads, published.read_text("utf-8").splitlines())


@pytest.mark.parametrize("name", MODULES)
def test_a_published_schema_is_what_its_module_makes(name):
    """But for the indents of docstrings, which Python 3.13 leaves out."""
    made = importlib.import_module(MODULES[name]).json_schema()
    kept, again = (re.sub(r"\\n +", r"\\n", json.dumps(one)) for one in (validator(name).schema, made))
    assert json.loads(kept) == json.loads(again)
    validator(name).check_schema(made)


def protocol_lines() -> list[str]:
    """List the messages that the page on the protocol shows: > is a request, < an answer."""
    return [line for _, text in blocks("protocol.md", "json") for line in text.splitlines()]


def test_the_examples_of_the_protocol_fit_its_schema():
    """Every line of a block: > is a request, < an answer; together they show every kind of message."""
    kinds = {">": validator("protocol", "Request"), "<": validator("protocol", "Answer")}
    shown = set()
    for line in protocol_lines():
        if line in ("> what?", "> [1,2]", '> {"cmd":"dance","seq":25}'):  # no requests, nor meant to be
            continue
        mark, message = line[0], json.loads(line[1:])
        if mark == "<" or message.get("seq") != 26:  # it lacks `vy`
            kinds[mark].validate(message)
        shown |= {message.get("cmd"), message.get("outcome"), *message}
    commands = {"start", "echo", "step", "trajectory", "flow", "time", "stop"}
    outcomes = {"collision", "horizon", "undefined", "undecided", "rejected", "error"}
    assert shown >= commands | outcomes | {"values", "profiles", "steps", "states", "ns"}


def test_the_examples_of_the_protocol_are_what_plain_answers():
    """To the bit: nothing in them takes a sine. The example in Python puts plain behind the protocol."""
    lines = [line for line in protocol_lines() if line != '> {"cmd":"stop"}']
    pairs = [(line[2:], after[1:]) for line, after in pairwise(lines) if line[0] == ">"]
    done = subprocess.run(
        [sys.executable, str(ROOT / "conformance" / "harness" / "python" / "stepper.py")],
        input="\n".join([*(asked for asked, _ in pairs), '{"cmd":"stop"}']),
        capture_output=True,
        text=True,
        check=True,
    )
    answered = [json.loads(line) for line in done.stdout.splitlines()]
    expected = [json.loads(shown) for _, shown in pairs]
    timed = next(i for i, answer in enumerate(expected) if "ns" in answer)
    assert answered[0].keys() == expected[0].keys()
    assert len(answered[timed].pop("ns")) == len(expected[timed].pop("ns"))
    assert answered[1:] == expected[1:]


def test_the_answers_that_stand_alone_in_the_protocol_are_read():
    pairs = pairwise(["", *protocol_lines()])
    alone = [line[1:] for before, line in pairs if line[0] == "<" and before[:1] != ">"]
    found = [read_answer(line.encode(), "step", json.loads(line)["seq"]) for line in alone]
    assert [set(answer) for answer in found] == [{"error"}, {"outcome", "t", "x", "y", "vx", "vy"}]


MADE = DOCS / "generated"  # by the site
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
    aside = {DOCS / name for name in ("index.md", "changelog.md", "contributing.md", "equations.md")}
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
    made = re.compile(r"(^|/)(\.|__pycache__)")  # by tools: caches
    assert named == {folder for folder in folders if not made.search(folder)}


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
        shown.update([type(table).__name__, *(type(law.as_field()).__name__ for law in table.laws.values())])
    assert set(shown) == {"Cap", "Stem", "Mushroom", "float", "Fourier", "BangBang"}
    assert len(refusals) == 1


# Blocks that another test runs, by page and first line; "" is a line for a shell that installs something.
RUN_ELSEWHERE = {
    "your-stepper.md": {"python", "console"},  # the tutorial, one block after the other
    "scenes.md": {"toml", "text", "python", "console"},  # files loaded, doctests
    "protocol.md": {"json"},  # against the schema and the plain stepper
    "corpus.md": {"json"},  # the published line
    "cite.md": {"bibtex"},  # test_house_package
    "clusters.md": {"bash"},  # with few particles
    "audit.md": {"", "none"},  # test_mushrooms_audit: the commands, and the runs that they make; a region
    "ensembles.md": {"", "python"},  # test_mushrooms_simulate, with fewer particles
}
INSTALLS = ("pip install", "mushrooms --version", "git clone", "cd oscillating-mushrooms")


API = [
    (page.name, name)
    for page in sorted((DOCS / "api").glob("*.md"))
    for name in re.findall(r"automodule:: (\S+)", page.read_text("utf-8"))
]


def undocumented(page: str, name: str) -> list[str]:
    """List the public names of a module that `dir` does not find, or that its page says nothing of.

    The page says what the docstring does of a function or class under its own name, and names the others.
    """
    module, text = importlib.import_module(name), (DOCS / "api" / page).read_text("utf-8")
    made_here = [
        n for n, one in vars(module).items() if n[0] != "_" and getattr(one, "__module__", 0) == name
    ]
    public = getattr(module, "__all__", made_here)
    own = [n for n in public if getattr(getattr(module, n), "__name__", "") == n]
    told = {n for n in own if getattr(module, n).__doc__}
    return [n for n in public if not (n in dir(module) and (n in told or f"`{n}`" in text))]


@pytest.mark.parametrize(("page", "name"), API)
def test_every_public_name_is_found_and_documented(page, name):
    assert undocumented(page, name) == []


def test_a_public_name_that_is_hidden_is_seen(monkeypatch):
    module = importlib.import_module("fast")
    monkeypatch.setattr(module, "nowhere", 1, raising=False)
    monkeypatch.setattr(module, "__all__", ["nowhere", *module.__all__])
    assert undocumented("fast.md", "fast") == ["nowhere"]
    monkeypatch.setattr(module, "__dir__", list)
    assert set(undocumented("fast.md", "fast")) >= {"simulate", "Ensemble"}


@pytest.mark.parametrize("name", ["start.md", "theory.md", "your-scene.md", "scenes.md"])
def test_the_python_of_a_page_does_what_it_says(name):
    found = doctest.testfile(str(DOCS / name), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert found.attempted >= 4
    assert found.failed == 0


@pytest.mark.parametrize("name", deep_but(["start.md", "your-scene.md", "scenes.md"], "scenes.md"))
def test_the_commands_of_a_page_do_what_they_say(command_line, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    assert "console" in {first for first, _ in fences(name)}
    for first, text in fences(name):
        kind, _, file = first.partition(" ")
        if kind == "toml":
            (tmp_path / file).write_text(text, "utf-8")
        if kind != "console":
            continue
        command, _, shown = text.removeprefix("$ mushrooms ").partition("\n")
        command, _, target = command.partition(" > ")
        code, out, _ = command_line(*shlex.split(command))
        assert code == 0
        if target:
            (tmp_path / target).write_text(out, "utf-8")
            load(tmp_path / target)
        assert matches(shown, out), out


@pytest.mark.deep
def test_the_pictures_of_the_pages_are_made(tmp_path):
    """All of them, by the code that stands above each; a page shows every picture that it makes."""
    n_made = 0
    for page in DOCS.glob("*.md"):
        shown = re.findall(r"\]\(gallery/([^)]+)\)", page.read_text("utf-8"))
        pictures.draw(page, tmp_path)
        made = [name for name, _ in pictures.blocks(page)]
        n_made += len(made)
        assert sorted(made) == sorted(shown)
        for name in made:
            start = {".svg": b"<?xml", ".png": b"\x89PNG", ".gif": b"GIF89a"}[Path(name).suffix]
            assert (tmp_path / name).read_bytes().startswith(start)
    assert n_made > 10


def test_the_repository_holds_the_pictures_of_its_pages():
    """If this fails, `python -m docs.pictures` makes them anew."""
    assert json.loads((pictures.GALLERY / "blocks.json").read_bytes()) == pictures.digests()
    made = {name for page in DOCS.glob("*.md") for name, _ in pictures.blocks(page)}
    assert {path.name for path in pictures.GALLERY.iterdir()} == made | {"blocks.json"}


def test_a_block_that_fails_is_not_passed_over(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python a.svg\nfigure = nothing\n```\n")
    with pytest.raises(NameError):
        pictures.draw(page, tmp_path / "pictures")


def is_run(name: str, first: str, text: str) -> bool:
    """Tell whether a test runs a block of a page."""
    kind = first.partition(" ")[0]
    return (
        kind in RUN_ELSEWHERE.get(name, ())
        or kind.startswith("{")  # a directive: Sphinx acts on it, and warnings are errors
        or (kind == "python" and (" " in first or text.startswith(">>>")))
        or kind in ("console", "toml")
        or all(line.startswith(INSTALLS) for line in text.splitlines())
    )


def unaccounted(name: str, page: str) -> list[str]:
    """List the first lines of blocks that no test runs."""
    return [first for first, text in FENCE.findall(page) if not is_run(name, first, text)]


def test_every_block_of_the_site_is_run():
    pages = [path for path in DOCS.rglob("*.md") if "generated" not in path.parts]
    assert {
        page.name: missed for page in pages if (missed := unaccounted(page.name, page.read_text("utf-8")))
    } == {}
    runs = {
        page.name for page in pages if re.search(r"^(```console|>>>)", page.read_text("utf-8"), re.MULTILINE)
    }
    assert runs == {f"{name}.md" for name in ("start", "your-scene", "theory", "scenes", "your-stepper")}


@pytest.mark.parametrize(
    "planted", ["```python\nx = 1\n```\n", "```\nrm -r x\n```\n", "```yaml\na: 1\n```\n"]
)
def test_a_block_that_nobody_runs_is_seen(planted):
    assert len(unaccounted("start.md", planted)) == 1


def test_scenes_are_printed_as_files_to_begin_from(command_line, tmp_path):
    for name in catalogue():
        assert command_line("scenes", name, "--toml").out == catalogue_text(name).rstrip("\n") + "\n"
    assert from_data(command_line("scenes", "moving-cap", "--json").data()) == load("moving-cap")


BENCH = json.loads((DOCS / "bench" / "bench.json").read_bytes())


def sentence_of_the_knots() -> str:
    """Evaluate the bang-bang law of docs/scenes.md at a quarter of its first leg."""
    page = (ROOT / "docs" / "scenes.md").read_text("utf-8")
    r = from_data(tomllib.loads(page.split("```toml bang-bang.toml")[1].split("```")[0])).r
    (start, first), (end, second) = r.knots[:2]
    linear = (3 * first + second) / 4
    return f"at {(t := start + (end - start) / 4)} the value is {r.value(fp, t)}, not {linear}"


def row_of_losses(name: str, label: str) -> str:
    """Return the row of theory/equations.md for P(E_n < E_0) of a scene."""
    energies = theory.energies(load(name))
    numbers = [loss_probability(energies, n) for n in (1, 10, 30, 100)]
    return f"| {label} | {' | '.join(f'{number:.4f}'[1:] for number in numbers)} |"


def words_of_rare_errors() -> str:
    (grazing,) = [p for p in BENCH["points"] if (p["solver"], p["workload"]) == ("lean C", "grazing")]
    n = BENCH["questions"] + grazing["further"]
    wrong = grazing["wrong"] + grazing["astray"]
    return (
        f"all these questions but {wrong}. These {wrong} flights leave the arc almost tangentially"
        f" (workload `grazing`, {n:,} questions)"
    )


def words_of_declining() -> str:
    """Find how few of some answers are too many."""
    least = [
        f"{next(k for k in range(n + 1) if declines_too_much(k, n, MAX_DECLINED_OF_PART))} of {n}"
        for n in (4, 20, 50)
    ]
    assert not declines_too_much(3, 3, MAX_DECLINED_OF_PART)
    return (
        f"So {least[0]}, {least[1]} or {least[2]} answers are more than {MAX_DECLINED_OF_PART:.0%}".replace(
            "%", " %"
        )
    )


def words_of_a_finite_energy() -> str:
    scene = load("fixed-cap-anticlockwise")
    limit, there = float(theory.predict(scene, 6).m1), theory.at_energy(scene, 1e5).mean_s
    return f"for `fixed-cap-anticlockwise` m1 is {limit:.4f} in the limit, and {there:.4f} at energy 1e5"


def words_of_the_retraced_arc() -> str:
    scene = load("retraced-arc")
    found = theory.predict(scene, 6).strings(6)
    there = theory.at_energy(scene, 1e6).mean_s
    return (
        f"m1 = {found['m1']}, p_nc = {found['p_nc']} and s_nc = 0. A simulation at energy 1e6 gave"
        f" mean s = 0.0546 +- 0.0019. The prediction for that energy is {there:.4f}."
    )


def size_of_the_audit() -> str:
    n_bytes = 0
    for made in json.loads((ROOT / "docs" / "audit" / "report.json").read_bytes())["runs"]:
        spec = RunSpec(
            from_data(made["scene"]), *(made[x] for x in ("energy", "cycles", "seed")), tuple(made["phases"])
        )
        block = conduct.block_of_new(spec, made["particles"], threads=2)
        shape = shape_of(spec, made["particles"], block)
        n_bytes += -(-made["particles"] // block) * block * shape.bytes_of_a_particle
    return f"{n_bytes / 1e9:.1f} GB for a full audit"


def words_of_whole_arrays() -> str:
    whole = [f"`{name}`" for name, field in FIELDS.items() if field.kind.startswith("int")]
    return f"-1 in arrays of whole numbers ({', '.join(sorted(whole))})"


BYTES = Shape(1, 1, 1, 1, 0, 1).bytes_of_a_particle
NS = {p["solver"]: median(p["ns"]) for p in BENCH["points"] if p["workload"] == "moving-cap-1e7"}
TEN = {10**k: f"10^{k}" for k in range(12)}
# What a page says of numbers that code knows: the page, and what must stand in it, its spaces as one.
FIGURES: dict[str, tuple[str, Callable[[], str]]] = {
    "bang-bang law": ("docs/scenes.md", sentence_of_the_knots),
    "mutants": ("README.md", lambda: f"{len(MUTANTS)} deliberately broken steppers"),
    "attacks": ("CHANGELOG.md", lambda: f"{len(FAMILIES)} families of seeded questions"),
    "harmonics": ("docs/scenes.md", lambda: f"Up to {MAX_HARMONICS} each"),
    "knots": ("docs/scenes.md", lambda: f"Up to {MAX_KNOTS} knots"),
    "laws": (
        "docs/limits.md",
        lambda: f"{MAX_HARMONICS} harmonics, or a bang-bang law of at most {MAX_KNOTS} ",
    ),
    "particles": (
        "docs/limits.md",
        lambda: f"| {TEN[MOST_IN_MEMORY]} in memory, {TEN[MOST_ON_DISK]} with `--out` |",
    ),
    "cycles": ("docs/limits.md", lambda: f"| cycles of a run | {TEN[MAX_CYCLES]} |"),
    "collisions": (
        "docs/limits.md",
        lambda: f"| {TEN[MOST_IN_CYCLES]} in a run; {TEN[MOST_TO_A_TIME]} in `fast.flow`",
    ),
    "orbits": ("docs/limits.md", lambda: f"| {MAX_ORBITS}, with {TEN[MAX_COLLISIONS]} collisions each |"),
    "times": ("README.md", lambda: f"| {NS['fast, lanes']:.0f} ns |"),
    "times of others": ("README.md", lambda: f"| {NS['lean C']:.0f} ns |"),
    "time of a call": ("README.md", lambda: f"| {NS['fast, a call'] / 1e3:.1f} µs |"),
    "time of a proof": ("README.md", lambda: f"| {NS['proof, 50 digits'] / 1e6:.1f} ms |"),
    "fresh questions": (
        "docs/protocol.md",
        lambda: f"{ROUND} questions ({2 * ROUND} above core)",
    ),
    "legs": ("docs/protocol.md", lambda: f"up to {MAX_KNOTS - 1} legs"),
    "bounds of hits": ("docs/detection.md", lambda: f"hits of a path | 2 | 2^{MAX_HITS.bit_length() - 1}"),
    "bounds of states": (
        "docs/detection.md",
        lambda: f"of a flow | 1 | 2^{MAX_STATES.bit_length() - 1}",
    ),
    "bounds of waits": ("docs/detection.md", lambda: f"one flight | 1 | 2^{MAX_WAIT.bit_length() - 1}"),
    "share of the period": ("docs/detection.md", lambda: f"is broken | 1/{MOST_SAMPLES} | 1/4"),
    "work of a step": ("docs/proof.md", lambda: f"the limit is {MAX_WORK:,.0f} of them"),
    "lane": ("docs/ensembles.md", lambda: f"{LANE_ROWS} numbers, the array `lanes`, {8 * LANE_ROWS} bytes"),
    "room": ("docs/ensembles.md", lambda: f"{BYTES} bytes a particle for one cycle with one narrowing"),
    "audit": ("docs/audit.md", size_of_the_audit),
    "blocks": ("docs/ensembles.md", lambda: f"by default {conduct.LEAST_BLOCK} to {conduct.MOST_BLOCK},"),
    "fill values": ("docs/ensembles.md", words_of_whole_arrays),
    **{f"fast.{name}": ("docs/api/fast.md", partial("fast.{} ".format, name)) for name in fast.__all__},
    "digits of a path": (
        "docs/limits.md",
        lambda: f"after about {BENCH['growth']['lasts']['binary64 (plain Python)']:.0f} collisions",
    ),
    "rare errors": ("docs/speed.md", words_of_rare_errors),
    "digits lost": (
        "docs/speed.md",
        lambda: f"energy 1e4, {BENCH['growth']['rate']:.2f} correct decimal digits are lost per",
    ),
    "late starts": ("docs/detection.md", lambda: f"periods from t = 0 | 1 | 2^{MAX_LATE.bit_length() - 1}"),
    "distances": ("docs/detection.md", lambda: f"or 1 - w / r | 2^{math.log2(NEAREST):.0f} | 2^-2"),
    "slopes": ("docs/detection.md", lambda: f"either sign | 2^-24 | 2^{math.log2(STEEPEST):.0f}"),
    "limits of declining": ("docs/protocol.md", words_of_declining),
    "verdicts": (
        "docs/glossary.md",
        lambda: f"gives each case one of {({9: 'nine'})[len(VERDICTS)]} verdicts",
    ),
    "limit of m1": ("docs/start.md", words_of_a_finite_energy),
    "retraced arc": ("theory/equations.md", words_of_the_retraced_arc),
    **{
        name: ("theory/equations.md", partial(row_of_losses, name, label))
        for name, label in {
            "moving-cap": "moving cap",
            "moving-cap-reversed": "moving cap reversed",
            "fixed-cap-anticlockwise": "fixed cap, anticlockwise",
            "fixed-cap-clockwise": "fixed cap, clockwise",
        }.items()
    },
}


@pytest.mark.parametrize("name", FIGURES)
def test_a_number_on_a_page_is_what_the_code_says(name):
    page, said = FIGURES[name]
    assert said() in " ".join((ROOT / page).read_text("utf-8").split())
