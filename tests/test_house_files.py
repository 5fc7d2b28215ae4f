"""Habits of the house that a newcomer would otherwise have to be told: paths, sizes, docstrings."""

import ast
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MAX_LINES = 400
# Files that may be longer, and why.
LONGER: dict[str, str] = {}
# Joined here so that this file does not contain what it forbids.
PLACES = ["/" + "work", ".." + "/shared", "/" + "home/ada", "/" + "Users/ada", "C:" + r"\Users\ada"]
FOREIGN = re.compile(
    "/"
    + r"work(?!\w)|\bshared"
    + r"/|(?<![\w.])/(?:home|Users|root|mnt)/\w|\b[A-Z]:\\{1,2}(?:Users|Documents)"
)


def project_files() -> list[Path]:
    """List the files of the project: those that git tracks or would track."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("needs the git checkout to know which files belong to the project")
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True).stdout
    return sorted(ROOT / name for name in set(names.split("\0")) if name and (ROOT / name).is_file())


def python_files() -> list[Path]:
    return [path for path in project_files() if path.suffix == ".py"]


def test_no_file_names_a_place_outside_the_project():
    found = []
    for path in project_files():
        for number, line in enumerate(path.read_text("utf-8", errors="ignore").splitlines(), 1):
            if FOREIGN.search(line):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()[:100]}")
    assert found == []


@pytest.mark.parametrize("place", PLACES)
def test_a_foreign_path_would_be_seen(place):
    assert FOREIGN.search(f"open('{place}/paper.tex')")


@pytest.mark.parametrize("line", [".github/workflows/ci.yml", "#!/usr/bin/env bash", "a/b", "shared by all"])
def test_an_innocent_path_is_left_alone(line):
    assert not FOREIGN.search(line)


def test_every_module_opens_with_a_docstring():
    bare = [
        str(path.relative_to(ROOT))
        for path in python_files()
        if not ast.get_docstring(ast.parse(path.read_text("utf-8")))
    ]
    assert bare == []


def test_files_stay_short():
    lengths = {
        path.relative_to(ROOT).as_posix(): len(path.read_bytes().splitlines()) for path in python_files()
    }
    long = {name: n for name, n in lengths.items() if n > MAX_LINES and name not in LONGER}
    assert long == {}


def test_every_dependency_says_why_it_is_there():
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    project = tomllib.loads(text)["project"]
    needed = project["dependencies"] + [
        d for group in project["optional-dependencies"].values() for d in group
    ]
    assert needed
    silent = [
        dependency
        for dependency in needed
        if not dependency.startswith(project["name"])
        and not re.search(rf'^\s*"{re.escape(dependency)}",\s*#\s*\w+', text, re.MULTILINE)
    ]
    assert silent == []
