"""Habits of the house that a newcomer would otherwise have to be told: paths, sizes, names, docstrings."""

import ast
import math
import os
import re
import shutil
import subprocess
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("scene", "reference", "fast", "theory", "conformance", "mushrooms")
MAX_LINES = 700  # of a file
LANGUAGES = (".py", ".c", ".h", ".cpp", ".hpp", ".js", ".css")
MAX_FUNCTION = 60  # lines of a function, its decorators and docstring included
# Files, and functions by `file: name`, that may be longer, and why.
LONGER = {"conformance/verify.py": "one file that anyone can read and run, without installing anything"}
# Statements of a folder's Python files (nodes of `ast.stmt`), without docstrings: 3 % above what stood at the
# last raise, so that a mend never waits for a bound. A bound rises in the commit that adds a capability, and
# that commit says why. Tests have none: a regression test never has to buy its place.
MAX_STATEMENTS = {
    "scene": 1_980,
    "reference": 1_450,
    "fast": 3_728,
    "theory": 2_220,
    "conformance": 8_079,
    "mushrooms": 6_012,
    "docs": 242,
    ".ci": 65,
    "tests": math.inf,
}
MAX_ARGUMENTS = 8  # of a kernel: what belongs together is a record
# Python hands these a state number by number; a record would take longer than the step.
CROWDED = {"fast/kernel/single.py: single"}
# Complete in themselves, as examples for other people's steppers: their classes may have our names.
COMPLETE = ("conformance/harness/", "conformance/verify.py")
# Joined here so that this file does not contain what it forbids.
PLACES = ["/" + "work", ".." + "/shared", "/" + "home/ada", "/" + "Users/ada", "C:" + r"\Users\ada"]
FOREIGN = re.compile(
    "/"
    + r"work(?!\w)|\bshared"
    + r"/|(?<![\w.])/(?:home|Users|root|mnt)/\w|\b[A-Z]:\\{1,2}(?:Users|Documents)"
)


def project_files() -> list[Path]:
    """List the files of the project: those that git tracks, and new ones beside them in a folder."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("needs the git checkout to know which files belong to the project")
    tracked = names_by_git("--cached")
    folders = {name.partition("/")[0] for name in tracked if "/" in name}
    # What a reader keeps at the top is not ours: an environment, a run, a scene.
    others = names_by_git("--others", "--exclude-standard")
    new = [name for name in others if name.partition("/")[0] in folders]
    return sorted(ROOT / name for name in {*tracked, *new} if (ROOT / name).is_file())


def names_by_git(*options: str) -> list[str]:
    """Return the names that `git ls-files` lists, also where the checkout belongs to another user."""
    command = ["git", "-c", "safe.directory=*", "ls-files", "-z", *options]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout
    return [os.fsdecode(name) for name in names.split(b"\0") if name]


def test_what_a_reader_keeps_in_the_checkout_is_no_file_of_the_project(tmp_path, monkeypatch):
    project_files()  # skips where there is no git
    for name in ("scene/old.py", "scene/new.py", "venv/lib/other.py", "run/summary.json", "notes.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    for words in (["init", "--quiet"], ["add", "scene/old.py"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    assert project_files() == [tmp_path / "scene" / "new.py", tmp_path / "scene" / "old.py"]


class Parsed(NamedTuple):
    """What the checks need of a Python file: they keep no trees, in which garbage is looked for."""

    has_docstring: bool
    n_statements: int
    functions: list[tuple[str, int, int]]  # name, lines with decorators and docstring, arguments
    classes: list[str]
    names: set[str]  # of functions, classes and variables, at any depth


@cache
def parsed(text: str) -> Parsed:
    tree = ast.parse(text)
    n_statements, functions, classes, names = 0, [], [], set()
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        n_statements += isinstance(node, ast.stmt) and not is_text
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            begin = min(d.lineno for d in [node, *node.decorator_list])
            functions.append((node.name, (node.end_lineno or 0) - begin + 1, len(node.args.args)))
        elif isinstance(node, ast.ClassDef):
            classes.append(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    names.update(classes, (name for name, _, _ in functions))
    return Parsed(ast.get_docstring(tree) is not None, n_statements, functions, classes, names)


def test_no_file_names_a_place_outside_the_project():
    found = []
    for path in project_files():
        text = path.read_text("utf-8", errors="ignore")
        found += [f"{path.relative_to(ROOT)}: {place[0]}" for place in FOREIGN.finditer(text)]
    assert found == []


INNOCENT = (".github/workflows/ci.yml", "#!/usr/bin/env bash", "a/b", "shared by all")


@pytest.mark.parametrize("line", [*(f"open('{place}/paper.tex')" for place in PLACES), *INNOCENT])
def test_a_foreign_path_would_be_seen(line):
    assert bool(FOREIGN.search(line)) == (line not in INNOCENT)


def test_every_module_opens_with_a_docstring():
    assert [path for path, text in texts().items() if not parsed(text).has_docstring] == []


def texts(suffixes: tuple[str, ...] = (".py",)) -> dict[str, str]:
    """Return the text of every file of the project, in these languages, by its path."""
    return {
        path.relative_to(ROOT).as_posix(): path.read_text("utf-8")
        for path in project_files()
        if path.suffix in suffixes
    }


def long_files(sources: dict[str, str]) -> list[str]:
    """List the files that are too long."""
    return [path for path, text in sources.items() if len(text.splitlines()) > MAX_LINES]


def long_functions(sources: dict[str, str]) -> list[str]:
    """List the functions that are too long, as `file: name`; one inside another counts as part of it too."""
    return [
        f"{path}: {name}"
        for path, text in sources.items()
        for name, n_lines, _ in parsed(text).functions
        if n_lines > MAX_FUNCTION
    ]


def large_folders(sources: dict[str, str]) -> dict[str, int]:
    """Return how many statements the folders have that exceed their bound, or have none."""
    counts = Counter[str]()
    for path, text in sources.items():
        counts[path.split("/")[0]] += parsed(text).n_statements
    return {folder: n for folder, n in counts.items() if n > MAX_STATEMENTS.get(folder, 0)}


def crowded_kernels(sources: dict[str, str]) -> list[str]:
    """List the kernels that take too many arguments, as `file: name`."""
    return [
        f"{path}: {name}"
        for path, text in sources.items()
        if path.startswith("fast/kernel/")
        for name, _, n_arguments in parsed(text).functions
        if n_arguments > MAX_ARGUMENTS
    ]


def repeated_classes(sources: dict[str, str]) -> dict[str, list[str]]:
    """Return the names that several classes of the packages have, with the files they are in."""
    places: dict[str, list[str]] = {}
    for path, text in sources.items():
        if path.startswith(PACKAGES) and not path.startswith(COMPLETE):
            for name in parsed(text).classes:
                places.setdefault(name, []).append(path)
    return {name: paths for name, paths in places.items() if len(paths) > 1}


def test_folders_files_and_functions_stay_short():
    in_python, in_any = texts(), texts(LANGUAGES)
    assert 100 < len(in_python) < len(in_any)
    long = {*long_files(in_any), *long_functions(in_python)}
    assert long - set(LONGER) == set()
    assert set(LONGER) - long == set(), "no longer needed"
    assert large_folders(in_python) == {}


def test_kernels_take_records_and_few_arguments():
    assert set(crowded_kernels(texts())) == CROWDED


def test_one_name_means_one_class():
    assert repeated_classes(texts()) == {}


BODY = "    pass\n"
LONG = "@decorated\n" + "def f():\n" + BODY * 59
METHOD = "class A:\n    async def g(self):\n" + "        pass\n" * 59
MOST = {"docs/a.py": '"""Doc."""' + "\nx" * MAX_STATEMENTS["docs"]}
CROWD = "def f(a, b, c, d, e, f, g, h, i): pass\ndef g(a, b, c, d, e, f, g, h): pass"
OURS = {"fast/a.py": "class Run: pass", "scene/b.py": "def f():\n    class Run: pass"}
THEIRS = {"tests/c.py": "class Run: pass", COMPLETE[0] + "python/d.py": "class Run: pass"}


@pytest.mark.parametrize(
    ("checker", "sources", "found"),
    [
        (long_files, {"fast/a.py": BODY * 701, "fast/b.py": BODY * 700}, ["fast/a.py"]),
        (long_functions, {"fast/a.py": LONG, "tests/b.py": METHOD}, ["fast/a.py: f"]),
        (long_functions, {"tests/b.py": METHOD + "        pass\n"}, ["tests/b.py: g"]),
        (large_folders, MOST, {}),
        (
            large_folders,
            {**MOST, "docs/b.py": "if x: y", "new/c.py": "x"},
            {"docs": MAX_STATEMENTS["docs"] + 2, "new": 1},
        ),
        (crowded_kernels, {"fast/kernel/a.py": CROWD, "fast/b.py": CROWD}, ["fast/kernel/a.py: f"]),
        (repeated_classes, OURS, {"Run": ["fast/a.py", "scene/b.py"]}),
        (repeated_classes, {"fast/a.py": "class Run: pass", **THEIRS}, {}),
    ],
)
def test_planted_lengths_and_names_are_seen(checker, sources, found):
    assert checker(sources) == found


def test_every_dependency_says_why_it_is_there():
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    project = tomllib.loads(text)["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    needed = {name for group in groups for name in group if not name.startswith(project["name"])}
    assert needed <= set(re.findall(r'^\s*"([^"]+)",\s*#\s*\w', text, re.MULTILINE))


def named_in(path: str) -> set[str]:
    """Return the names that a file gives to functions, classes and variables."""
    return parsed((ROOT / path).read_text("utf-8")).names if (ROOT / path).is_file() else set()


def stale(table: str) -> list[str]:
    """List what a table of planted faults names and the code does not hold."""
    found = []
    for row in re.findall(r"^\| (`.+) \|$", table, re.MULTILINE):
        faults, places, _, tests = row.split(" | ")
        pairs = re.findall(r"([\w/]+\.py):+(\w+)", f"{places} {tests}")
        found += [f"{path}:{name}" for path, name in pairs if name not in named_in(path)]
        files = {ROOT / path for path, _ in re.findall(r"([\w/]+\.py):(\w+)", places)}
        text = "".join(file.read_text("utf-8") for file in files if file.is_file())
        found += [fault for fault in re.findall(r"`([^`]+)`", faults) if fault not in text]
    return found


def test_every_planted_fault_is_there_and_so_is_its_test():
    assert stale((ROOT / "tests" / "planted_faults.md").read_text("utf-8")) == []


HERE = "tests/test_house_files.py"
SOUND = f"| `STALE` | {HERE}:STALE | words | {HERE}::test_a_stale_row_is_found |"
STALE = {
    "no such test": SOUND.replace("is_found", "is_lost"),
    "no such object": SOUND.replace(":STALE", ":FRESH"),
    "no such file": SOUND.replace(f"{HERE}::", "tests/test_no_file.py::"),
    "no such fault": SOUND.replace("`STALE`", f"`{'no' * 2}`"),
}


@pytest.mark.parametrize("name", STALE)
def test_a_stale_row_is_found(name):
    assert stale(SOUND) == []
    assert len(stale(STALE[name])) == 1
