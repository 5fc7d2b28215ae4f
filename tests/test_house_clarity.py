"""One thought a line: packed assignments, names bound inside expressions, complexity, parameters, width.

A statement that assigns two unrelated things saves a line and costs each reader a second look. The bounds
hold for the packages in CLEAR.
"""

import ast
from collections.abc import Iterator
from functools import cache

import complexipy
import pytest
from test_house_files import texts

# Packages, and the folders of conformance, that are held to the bounds.
CLEAR = ("mushrooms", "conformance/cases", "conformance/grading", "scene", "reference")
MAX_PACKED = 10  # of 1,000 statements
MAX_COMPLEXITY = 15  # of a function: cognitive complexity, in which nesting counts
MAX_PARAMETERS = 10
MAX_WIDTH = 100  # columns
# Typer makes a command's options of the parameters of a function.
OF_OPTIONS = ("mushrooms/commands.py",)


def is_packed(node: ast.AST) -> bool:
    """Tell whether a statement assigns several values to as many names, and could as well be several.

    `a, b = f(x), g(y)` is packed. `a, b = pair` unpacks one thing, and `a, b = b, a + b` needs both values
    before it assigns one: a value reads a name that stands before it on the left.
    """
    if not isinstance(node, ast.Assign):
        return False
    target = node.targets[0]
    if not (isinstance(target, ast.Tuple | ast.List) and isinstance(node.value, ast.Tuple | ast.List)):
        return False
    names, values = target.elts, node.value.elts
    if len(names) != len(values):
        return False
    assigned = set[str]()
    for name, value in zip(names, values, strict=True):
        if assigned & names_in(value):
            return False
        assigned |= names_in(name)
    return True


def names_in(node: ast.AST) -> set[str]:
    """Return the names in an expression."""
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def statements(text: str) -> Iterator[ast.stmt]:
    """Yield the statements of a file without its docstrings and imports."""
    for node in ast.walk(ast.parse(text)):
        is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node, ast.stmt) and not (is_text or isinstance(node, ast.Import | ast.ImportFrom)):
            yield node


def share_packed(sources: dict[str, str]) -> float:
    """Return how many of 1,000 statements are packed assignments."""
    found = [is_packed(node) for text in sources.values() for node in statements(text)]
    return 1000 * sum(found) / len(found)


def bound_inside(sources: dict[str, str]) -> list[str]:
    """List where a name is bound inside an expression, as `file:line`."""
    return [
        f"{path}:{node.lineno}"
        for path, text in sources.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.NamedExpr)
    ]


def complex_functions(sources: dict[str, str]) -> list[str]:
    """List the functions that are too complex, as `file: name`."""
    return [
        f"{path}: {function.name}"
        for path, text in sources.items()
        for function in complexipy.code_complexity(text).functions
        if function.complexity > MAX_COMPLEXITY
    ]


def crowded_functions(sources: dict[str, str]) -> list[str]:
    """List the functions that take too many parameters, as `file: name`."""
    found = []
    for path, text in sources.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and path not in OF_OPTIONS:
                given = node.args
                n = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
                if n > MAX_PARAMETERS:
                    found.append(f"{path}: {node.name}")
    return found


def wide_lines(sources: dict[str, str]) -> list[str]:
    """List the lines that are too wide, as `file:line`."""
    return [
        f"{path}:{number}"
        for path, text in sources.items()
        for number, line in enumerate(text.splitlines(), 1)
        if len(line) > MAX_WIDTH
    ]


@cache
def sources_of(folder: str) -> dict[str, str]:
    """Return the text of every Python file of a folder, by its path."""
    found = {path: text for path, text in texts().items() if path.startswith(f"{folder}/")}
    assert found
    return found


@pytest.mark.parametrize("folder", CLEAR)
def test_a_statement_holds_one_thought(folder):
    assert share_packed(sources_of(folder)) <= MAX_PACKED
    assert bound_inside(sources_of(folder)) == []


@pytest.mark.parametrize("folder", CLEAR)
def test_functions_can_be_followed(folder):
    assert complex_functions(sources_of(folder)) == []
    assert crowded_functions(sources_of(folder)) == []


@pytest.mark.parametrize("folder", CLEAR)
def test_lines_fit_a_column(folder):
    assert wide_lines(sources_of(folder)) == []


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("a, b = f(x), g(y)", True),
        ("self.a, self.b = a, b", True),
        ("A, B = 1, 2", True),
        ("[a, b] = [f(x), 0]", True),
        ("a, b = b, a", False),
        ("a, b = b, a + b", False),
        ("low, high = low + x, high + y", True),
        ("a, b = pair", False),
        ("a, *rest = values", False),
        ("a = f(x), g(y)", False),
        ("a = b = 0", False),
    ],
)
def test_a_packed_assignment_is_told_from_others(line, wanted):
    (node,) = statements(line)
    assert is_packed(node) is wanted


DEEP = "def f(x):\n" + "".join(" " * depth + "if x:\n" for depth in range(1, 7)) + " " * 7 + "pass\n"
FLAT = "def f(x):\n" + " if x:\n  pass\n" * 15
PACKED = "a, b = 1, 2\n"
MANY = "def f(a, b, c, d, e, f, g, h, i, *, j, k): pass\ndef g(a, b, c, d, e, f, g, h, i, *, j): pass\n"


@pytest.mark.parametrize(
    ("checker", "text", "found"),
    [
        (share_packed, '"""Doc."""\nimport x\n' + PACKED + "c = 1\n" * 99, 10.0),
        (bound_inside, "if x:\n    print(y := 1)\n", ["mushrooms/a.py:2"]),
        (complex_functions, DEEP, ["mushrooms/a.py: f"]),
        (complex_functions, FLAT, []),
        (crowded_functions, MANY, ["mushrooms/a.py: f"]),
        (wide_lines, "x" * 101 + "\n" + "x" * 100, ["mushrooms/a.py:1"]),
    ],
)
def test_planted_knots_are_seen(checker, text, found):
    assert checker({"mushrooms/a.py": text}) == found
