"""A law is asked through its interface: its kind is known in few places.

Of the packages, only the files in PLACES ask for a kind (docs/new-law.md). A table gives its mouth as
`scene.width`, so nobody needs to ask whether `w` or `nu` was given.
"""

import ast
from collections.abc import Iterator
from fractions import Fraction
from typing import get_args

import pytest
from test_house_files import PACKAGES, texts

import scene
from conformance.bench.baselines import _row
from fast.kernel.laws import row_of
from reference.arithmetic import Arithmetic
from reference.timeline import law_in_time
from scene.laws import WRITTEN
from scene.pieces import Period, Piece

KINDS = {kind.__name__ for kind in (scene.Constant, *WRITTEN)} | {piece.__name__ for piece in get_args(Piece)}
# What defines, compiles or encloses laws. The verifier has kinds of its own.
PLACES = {
    "scene/laws.py": "defines them",
    "fast/kernel/laws.py": "compiles them",
    "reference/timeline.py": "encloses them",
    "conformance/plain/step.py": "computes them, plainly",
    "conformance/bench/baselines.py": "lays them out for the engines in C",
}


def questions(text: str) -> Iterator[ast.AST]:
    """Yield what asks for the kind of a law, or whether a mouth was given by w or by nu."""
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Call(func=ast.Name(id="isinstance" | "issubclass")) if names_kind(node.args[1]):
                yield node
            case ast.MatchClass(cls=cls) if names_kind(cls):
                yield node
            case ast.Compare(left=ast.Attribute(attr="w" | "nu"), ops=[ast.Is() | ast.IsNot()]):
                yield node
            case ast.Compare() if calls_type(node) and names_kind(node):
                yield node
            case ast.Dict(keys=keys) if any(key is not None and is_kind(key) for key in keys):
                yield node


def is_kind(node: ast.AST) -> bool:
    """Tell whether an expression is a kind of law or of piece, by its own name or as an attribute."""
    return (isinstance(node, ast.Name) and node.id in KINDS) or (
        isinstance(node, ast.Attribute) and node.attr in KINDS
    )


def names_kind(node: ast.AST) -> bool:
    """Tell whether a kind stands anywhere in an expression."""
    return any(is_kind(part) for part in ast.walk(node))


def calls_type(node: ast.AST) -> bool:
    """Tell whether `type` is called in an expression."""
    return any(isinstance(part, ast.Call) and ast.unparse(part.func) == "type" for part in ast.walk(node))


def asking(sources: dict[str, str]) -> set[str]:
    """Return the files of the packages that ask."""
    ours = {path: text for path, text in sources.items() if path.startswith(PACKAGES)}
    return {path for path, text in ours.items() if any(questions(text))}


def test_the_kind_of_a_law_is_asked_for_in_few_places():
    asked = asking(texts())
    assert asked <= set(PLACES)
    # A place that asks no longer leaves the table; a class of laws need not ask for its own kind.
    assert set(PLACES) - {"scene/laws.py"} <= asked


class Unknown(scene.Law, frozen=True):
    """A kind of law that moves, and that no file in PLACES knows."""

    cycle = Period(1.0, None)


@pytest.mark.parametrize("ask", [lambda law: law_in_time(Arithmetic(30), law, Fraction(0)), row_of, _row])
def test_a_kind_that_is_not_known_is_refused(ask):
    with pytest.raises(TypeError, match=r"Unknown: .* this kind of law"):
        ask(Unknown())


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("isinstance(law, BangBang)", True),
        ("isinstance(law, Fourier | scene.BangBang)", True),
        ("isinstance(piece, (PolynomialPiece, int))", True),
        ("match law:\n    case Fourier(): pass", True),
        ("type(law) is Fourier", True),
        ("BangBang in {type(law) for law in laws}", True),
        ("kinds = {Constant: 1, Fourier: 2}", True),
        ("scene.nu is not None", True),
        ("scene.w is None", True),
        ("law = Fourier(mean=1.0, omega=1.0)", False),
        ("isinstance(scene, Mushroom)", False),
        ("law.is_constant", False),
        ("scene.width is None", False),
    ],
)
def test_a_planted_question_is_seen(line, wanted):
    assert asking({"theory/a.py": line}) == ({"theory/a.py"} if wanted else set())
    assert asking({"tests/a.py": line}) == set()
