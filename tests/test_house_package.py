"""Which package imports which (import-linter holds it), and what is published: types, version, links."""

import ast
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import fast
import reference
import theory
from conformance import properties
from conformance.cases.corpus import archive
from conformance.vectors import manifest

ROOT = Path(__file__).parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = PYPROJECT["project"]
REPOSITORY = PROJECT["urls"]["Repository"]
PACKAGES = PYPROJECT["tool"]["importlinter"]["root_packages"]
CONTRACTS = PYPROJECT["tool"]["importlinter"]["contracts"]
# What the command `lint-imports` runs, in a process of its own: it reads the packages of its folder.
LINT = "from importlinter.cli import lint_imports_command as lint; lint()"
# The importer of a forbidden import, or the package whose modules import each other in a circle.
BROKEN = re.compile(r"^- +(?=\w)(\S+) -> |^No cycles are allowed in (\S+)\.$", re.MULTILINE)
# What imports by a text, which import-linter does not read, and the modules that need it: they wait.
BY_TEXT = re.compile(r"\b(?:import_module|__import__|run_module|find_spec)\b")
# By the one file that may use them: modules and names of a library that it does not document and may change,
# with a leading underscore or without. numba documents `numba.core.event`.
INSIDES = {
    "fast.kernel.numba_internals": (
        re.compile(r"numba\.core(?!\.event)\b|llvmlite\.binding\.ffi"),
        {"overloads", "stats", "library", "fndesc", "entry_point", "call_conv", "no_cfunc_wrapper", "_nrt"},
    ),
    "scene.mpmath_internals": (re.compile(r"mpmath\.(?:libmp|ctx_\w+)\b"), {"libmp", "_mpf_", "_mpi_"}),
}
# Documented all the same: of named tuples, enums, `os` and notebooks.
DOCUMENTED = {"_replace", "_make", "_fields", "_asdict", "_value_", "_exit", "_repr_html_"}
LATE = {"fast.__init__"}


def violations(root: Path) -> set[str]:
    """Return the modules whose imports the house forbids, and the packages with a circle."""
    told = subprocess.run(
        [sys.executable, "-c", LINT, "--no-cache"],
        cwd=root,
        env={**os.environ, "TERM": "dumb", "COLUMNS": "200"},  # neither colours nor broken lines
        capture_output=True,
        text=True,
    )
    print(told.stdout, told.stderr)
    texts = {
        path.relative_to(root).with_suffix("").as_posix().replace("/", "."): path.read_text("utf-8")
        for package in PACKAGES
        for path in (root / package).rglob("*.py")
    }
    assert f"Analyzed {len(texts)} files" in told.stdout, "a folder without __init__.py is not read"
    found = {importer or package for importer, package in BROKEN.findall(told.stdout)}
    assert bool(found) == bool(told.returncode)
    found |= {module for module, text in texts.items() if BY_TEXT.search(text)} - LATE
    own = {name for text in texts.values() for name in defined_names(text)} | DOCUMENTED
    return found | {module for module, text in texts.items() if private_names(module, text, own)}


def defined_names(text: str) -> Iterator[str]:
    """Yield the names that a module defines: functions, classes, variables, and attributes of `self`."""
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.Name(id=name, ctx=ast.Store()):
                yield name
            case ast.Attribute(value=ast.Name(id="self" | "cls"), attr=name, ctx=ast.Store()):
                yield name


def private_names(module: str, text: str, own: set[str]) -> set[str]:
    """Return the names of libraries' insides that a module uses, where it is not the one that may.

    Args:
        module: its name.
        text: its source.
        own: names with an underscore that are ours, or documented.
    """
    if module in INSIDES:
        return set()
    used: set[str] = set()
    names: set[str] = set()
    texts: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Import(names=aliases):
                used |= {alias.name for alias in aliases}
            case ast.ImportFrom(module=str(source), names=aliases):
                used |= {f"{source}.{alias.name}" for alias in aliases}
                names |= {alias.name for alias in aliases}
            case ast.Attribute(attr=name) | ast.keyword(arg=str(name)):
                names.add(name)
            case ast.Constant(value=str(name)):  # a key of options, or what `getattr` is given
                texts.add(name)
    found = {name for name in names if name.startswith("_") and not name.startswith("__")} - own
    for modules, inner in INSIDES.values():
        found |= (names | texts) & inner
        found |= {name for name in used if modules.search(name)}
    return found


def test_the_house_keeps_its_rules():
    assert violations(ROOT) == set()


FORBIDDEN = {
    "reference/above.py": "from fast import kernel",
    "reference/renamed.py": "import fast.kernel as k",
    "reference/several.py": "import math, fast",
    "reference/inside.py": "def f():\n    from fast.kernel import step",
    "reference/typed.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import fast",
    "reference/deep/step.py": "from fast.kernel import step",
    "reference/text.py": "import importlib\nimportlib.import_module('fast')",
    "reference/short.py": "from importlib import import_module as load\nload('fast.kernel')",
    "reference/builtin.py": "__import__('fast')",
    "fast/step.py": "from reference import above",
    "fast/growth.py": "import theory",
    "fast/passes.py": "from numba.core.compiler import CompilerBase",
    "fast/passes_too.py": "from numba import core\ncore.compiler",
    "fast/address.py": "def at(entry, arguments):\n    return entry.overloads[arguments].fndesc",
    "fast/uncounted.py": "from numba import njit\nkernel = njit(_nrt=False)",
    "fast/unwrapped.py": "HOW = {'no_cfunc_wrapper': True}",
    "scene/ends.py": "def ends(x):\n    return x._mpi_",
    "scene/by_text.py": "from operator import attrgetter\nends = attrgetter('_mpi_')",
    "theory/raw.py": "from mpmath.libmp import libmpf",
    "theory/raw_too.py": "from mpmath import libmp",
    "theory/bits.py": "import mpmath.ctx_iv",
    "mushrooms/hidden.py": "import matplotlib\nmatplotlib.figure.Figure()._suptitle",
    "theory/growth.py": "import conformance.claims",
    "scene/laws.py": "from reference import above",
    "scene/tables.py": "import mushrooms",
    "conformance/claims.py": "import fast",
    "conformance/grading/agreement.py": "import reference",
    "conformance/grading/page.py": "import mushrooms",
    "conformance/verify.py": "from conformance import right",
    "conformance/audit/claims.py": "from reference.above import proof",
    "mushrooms/audit/claims/growth.py": "from mushrooms.audit import page",
    "mushrooms/audit/session/kept.py": "import mushrooms.store",
    "conformance/cases/certify.py": "import mushrooms",
}
CIRCLES = {"theory", "conformance.suite"}  # of files, and of folders that have files without a circle
RIGHT = {
    "theory/cycle.py": "from theory import rates",
    "theory/rates.py": "def f():\n    import theory.cycle",
    "theory/own.py": "def _made(self):\n    self._x = 1\n    return self\n_made(0)._x",
    "fast/heard.py": "from numba.core import event",
    "fast/kernel/numba_internals.py": "def at(entry):\n    return entry.overloads",
    "scene/mpmath_internals.py": "from mpmath.libmp import libmpf",
    "conformance/audit/numbers.py": "from scipy.stats import norm",
    "conformance/suite/ask/one.py": "from ..judge import two",
    "conformance/suite/ask/two.py": "",
    "conformance/suite/judge/one.py": "from conformance.suite.ask import two",
    "conformance/suite/judge/two.py": "",
    "reference/right.py": "from scene import State\nfrom . import proof\nfrom .proof import fast",
    "reference/proof.py": "import importlib.resources",
    "mushrooms/audit/claims/right.py": "import reference, fast, theory, scene",
    "conformance/cases/right.py": "import reference, fast, theory, scene\nfrom .. import right",
    "conformance/right.py": "import theory, scene",
    "mushrooms/main.py": "import reference, fast, theory, scene, conformance",
}


def files_named(contract: dict[str, list[str]]) -> list[str]:
    """Return files for the modules of `mushrooms` that a contract names: it asks for all of them."""
    names = [*contract.get("source_modules", ()), *contract.get("forbidden_modules", ())]
    return [f"{name.replace('.', '/')}/__init__.py" for name in names if name.startswith("mushrooms.")]


def test_planted_violations_are_caught_and_nothing_else(tmp_path):
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    named = {file: "" for contract in CONTRACTS for file in files_named(contract)}
    for name, source in {**named, **FORBIDDEN, **RIGHT}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)
        for folder in list(path.parents)[: name.count("/")]:
            (folder / "__init__.py").touch()
    planted = {name.removesuffix(".py").replace("/", ".") for name in FORBIDDEN}
    assert violations(tmp_path) == planted | CIRCLES


def published_readme(text: str) -> str:
    """Return the README as a package index shows it."""
    for change in PYPROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(change["pattern"], change["replacement"], text)
    return text


def test_every_package_says_that_it_is_typed():
    for package in PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]:
        assert (ROOT / package / "py.typed").is_file()


@pytest.mark.parametrize(
    ("function", "argument", "name"),
    [
        (fast.simulate, "scene", "Scene"),
        (reference.next_collision, "scene", "Scene"),
        (theory.energy_cdf, "s", "ArrayLike"),
        (properties.check_mirror, "stepper", "Stepper"),
    ],
)
def test_signatures_name_their_types(function, argument, name):
    """Evaluated, an alias shows in help() and on the pages as the long union that it stands for."""
    assert function.__annotations__[argument] == name


def test_the_published_readme_has_no_relative_link():
    readme = (ROOT / "README.md").read_text("utf-8")
    published = published_readme(readme)
    raw = REPOSITORY.replace("https://github.com/", "https://raw.githubusercontent.com/") + "/main/"
    links, found = (re.findall(r"\]\(([^)]+)\)", text) for text in (readme, published))
    assert len(links) > 20
    for link, address in zip(links, found, strict=True):
        start = raw if link.endswith(".svg") else f"{REPOSITORY}/blob/main/"
        assert address == (link if link.startswith("https://") else start + link)
    assert published_readme(published) == published


def test_the_citation_is_of_this_version():
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"\nrepository-code: {REPOSITORY}\n" in citation
    assert PROJECT["authors"] == [{"name": "The Oscillating Mushrooms authors"}]
    assert "family-names: Gelfreich" in citation
    assert PROJECT["urls"]["Paper"].endswith(re.search(r"doi: (\S+)", citation)[1])
    assert {PROJECT["version"], PROJECT["urls"]["Paper"], REPOSITORY} <= set(
        re.findall(r"[^\s(){},]+", (ROOT / "docs" / "cite.md").read_text("utf-8"))
    )


def test_ci_runs_the_two_commands_that_the_readme_gives():
    readme = (ROOT / "README.md").read_text("utf-8")
    commands = re.findall(r"^(pip install .*) && (.*)$", readme, re.MULTILINE)
    assert commands == [("pip install -e .", "mushrooms audit"), ("pip install -e '.[test]'", "pytest")]
    script = (ROOT / ".ci" / "run").read_text("utf-8")
    for install, then in commands:
        (line,) = [line for line in script.splitlines() if f"{{ {install} && " in line]
        assert re.search(rf" {then}( |\))", line)


@pytest.mark.parametrize("name", ["ci.yml", "release.yml"])
def test_what_the_workflows_run_exists(name):
    text = (ROOT / ".github" / "workflows" / name).read_text("utf-8")
    for path in re.findall(r"\.ci/[\w.]+", text):
        assert (ROOT / path).is_file()
    assert text.count("id-token: write") == 1  # only the job that publishes may sign


def test_the_archive_of_the_corpus_proves_itself(tmp_path, capsys):
    """Twice the same bytes; what is in it needs nothing else."""
    for name in ("a.zip", "b.zip"):
        assert archive(tmp_path / name) == 0
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    told = capsys.readouterr().out
    assert hashlib.sha256((tmp_path / "a.zip").read_bytes()).hexdigest() in told
    assert manifest().digest in told
    with zipfile.ZipFile(tmp_path / "a.zip") as members:
        members.extractall(tmp_path)
    command = [sys.executable, "-I", "verify.py", "corpus/static-cap.jsonl"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.endswith(" proved\n")
