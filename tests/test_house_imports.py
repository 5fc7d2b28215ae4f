"""Who may import whom: pyproject.toml says it, import-linter holds it, a planted violation is caught."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PACKAGES = PROJECT["tool"]["importlinter"]["root_packages"]
# What the command `lint-imports` runs, in a process of its own: it reads the packages of its folder.
LINT = "from importlinter.cli import lint_imports_command as lint; lint()"
# The importer of a forbidden import, or the package whose modules import each other in a circle.
BROKEN = re.compile(r"^- +(?=\w)(\S+) -> |^No cycles are allowed in (\S+)\.$", re.MULTILINE)
# What imports by a text, which import-linter does not read, and the modules that need it: they wait.
BY_TEXT = re.compile(r"\b(?:import_module|__import__|run_module|find_spec)\b")
# What numba may change from one release to the next: its passes, its code libraries, its dispatchers' inside.
PRIVATE = re.compile(r"numba\.core\.(?:compiler|\w+_passes)|JITCodeLibrary|\._(?:compile_for_args|insert)\b")
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
    return found | {module for module, text in texts.items() if PRIVATE.search(text)}


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
    "fast/kernel.py": "from reference import above",
    "fast/growth.py": "import theory",
    "fast/passes.py": "from numba.core.compiler import CompilerBase",
    "theory/growth.py": "import conformance.claims",
    "scene/laws.py": "from reference import above",
    "scene/tables.py": "import mushrooms",
    "conformance/claims.py": "import fast",
    "conformance/grading/agreement.py": "import reference",
    "conformance/grading/page.py": "import mushrooms",
    "conformance/verify.py": "from conformance import right",
    "conformance/auditors/claims.py": "from reference.above import proof",
    "conformance/audit/claims/growth.py": "import mushrooms",
    "conformance/cases/certify.py": "import mushrooms",
}
CIRCLES = {"theory", "conformance.suite"}  # of files, and of folders that have files without a circle
RIGHT = {
    "theory/cycle.py": "from theory import rates",
    "theory/rates.py": "def f():\n    import theory.cycle",
    "conformance/suite/ask/one.py": "from ..judge import two",
    "conformance/suite/ask/two.py": "",
    "conformance/suite/judge/one.py": "from conformance.suite.ask import two",
    "conformance/suite/judge/two.py": "",
    "reference/right.py": "from scene import State\nfrom . import proof\nfrom .proof import fast",
    "reference/proof.py": "import importlib.resources",
    "conformance/audit/claims/right.py": "import reference, fast, theory, scene",
    "conformance/cases/right.py": "import reference, fast, theory, scene\nfrom .. import right",
    "conformance/right.py": "import theory, scene",
    "mushrooms/main.py": "import reference, fast, theory, scene, conformance",
}


def test_planted_violations_are_caught_and_nothing_else(tmp_path):
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for name, source in {**FORBIDDEN, **RIGHT}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)
        for folder in list(path.parents)[: name.count("/")]:
            (folder / "__init__.py").touch()
    planted = {name.removesuffix(".py").replace("/", ".") for name in FORBIDDEN}
    assert violations(tmp_path) == planted | CIRCLES
