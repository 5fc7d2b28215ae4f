"""Which folder may import which, held by reading the source; a planted violation must be caught."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = {"scene", "reference", "fast", "theory", "conformance", "mushrooms"}
STEPPERS = {"reference", "fast"}
# What the files of a folder may import of ours, besides their own package; the deepest folder named here
# decides. The audit compares the steppers, and the generator certifies vectors: of `conformance` they alone
# meet steppers by import. The rest is given commands, or functions; the suite has questions drawn and proved
# by the generator (`conformance.generator.fresh`).
MAY_IMPORT = {
    "scene": set(),
    "reference": {"scene"},
    "fast": {"scene"},
    "theory": {"scene"},
    "conformance": {"scene", "theory"},
    "conformance/audit": {"scene", "theory"} | STEPPERS,
    "conformance/generator": {"scene", "theory"} | STEPPERS,
    "mushrooms": PACKAGES,
}
LOADERS = {"import_module", "__import__", "run_module", "find_spec"}


def imported(tree: ast.AST, package: list[str]) -> Iterator[str]:
    """Yield the dotted name of every module that a file of `package` imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from absolute(node.module or "", node.level, [a.name for a in node.names], package)
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            literals = [
                argument.value
                for argument in [*node.args, *(keyword.value for keyword in node.keywords)]
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str)
            ]
            if name in LOADERS:
                yield from (literal.lstrip(".") for literal in literals)


def absolute(module: str, level: int, names: list[str], package: list[str]) -> list[str]:
    """Resolve `from module import names`; one level up from a top package lies the house itself."""
    base = package[: len(package) - level + 1] if level else []
    stem = ".".join([*base, module] if module else base)
    return [stem] if stem else names


def violations(root: Path) -> list[str]:
    """List every import between the packages under `root` that the house forbids."""
    found = []
    for file in sorted(path for package in PACKAGES for path in (root / package).rglob("*.py")):
        path = file.relative_to(root)
        folder = next(parent.as_posix() for parent in path.parents if parent.as_posix() in MAY_IMPORT)
        allowed = MAY_IMPORT[folder] | {path.parts[0]}
        for name in imported(ast.parse(file.read_text("utf-8")), list(path.parts[:-1])):
            top = name.split(".")[0]
            if top in PACKAGES - allowed:
                found.append(f"{path.as_posix()} imports {name}")
    return found


def test_the_house_keeps_its_rules():
    assert violations(ROOT) == []


PLANTED = [
    ("reference/step.py", "from fast import kernel"),
    ("reference/step.py", "import fast.kernel as k"),
    ("reference/step.py", "import math, fast"),
    ("reference/step.py", "def f():\n    from fast.kernel import step"),
    ("reference/step.py", "from .. import fast"),
    ("reference/step.py", "from ..fast import kernel"),
    ("reference/deep/step.py", "from ...fast.kernel import step"),
    ("reference/step.py", "import importlib\nimportlib.import_module('fast')"),
    ("reference/step.py", "from importlib import import_module\nimport_module('fast.kernel')"),
    ("reference/step.py", "import importlib\nimportlib.import_module('..fast', package='reference.x')"),
    ("reference/step.py", "__import__('fast')"),
    ("fast/kernel.py", "from reference import step"),
    ("fast/kernel.py", "import theory"),
    ("theory/growth.py", "import conformance.claims"),
    ("scene/laws.py", "from reference import step"),
    ("scene/laws.py", "import mushrooms"),
    ("conformance/grading/grade.py", "import reference"),
    ("conformance/grading/grade.py", "import mushrooms"),
    ("conformance/vectors.py", "import fast"),
    ("conformance/suite/run.py", "from fast import next_collision"),
    ("conformance/bench/measure.py", "import reference"),
    ("conformance/second_proof/step.py", "from reference.certificate import Certificate"),
    ("conformance/mutants/kill_matrix.py", "from ..generator import x\nfrom ...reference import step"),
    ("conformance/auditors/claims.py", "import reference"),
    ("conformance/generator.py", "import reference"),
    ("conformance/audit/claims/growth.py", "import mushrooms"),
    ("conformance/generator/certify.py", "import mushrooms"),
]


@pytest.mark.parametrize(("path", "source"), PLANTED)
def test_a_planted_violation_is_caught(tmp_path, path, source):
    (tmp_path / path).parent.mkdir(parents=True)
    (tmp_path / path).write_text(source)
    assert len(violations(tmp_path)) == 1


ALLOWED = [
    (
        "reference/step.py",
        "from scene import State\nfrom . import proof\nfrom .proof import fast\nimport breakfast",
    ),
    (
        "reference/deep/step.py",
        "from ..proof import exclude\nimport importlib\nimportlib.import_module('mpmath')",
    ),
    ("conformance/audit/claims/growth.py", "import reference, fast, theory, scene"),
    ("conformance/generator/certify.py", "import reference, fast, theory, scene\nfrom .. import vectors"),
    ("mushrooms/main.py", "import reference, fast, theory, scene, conformance"),
]


@pytest.mark.parametrize(("path", "source"), ALLOWED)
def test_what_is_allowed_passes(tmp_path, path, source):
    (tmp_path / path).parent.mkdir(parents=True)
    (tmp_path / path).write_text(source)
    assert violations(tmp_path) == []
