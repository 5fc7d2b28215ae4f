"""Only sound interval operations: each encloses, and no other may be used."""

import ast
import operator
from fractions import Fraction
from pathlib import Path

import mpmath
import pytest
from hypothesis import given, strategies as st

import reference
from reference.arithmetic import Arithmetic, Enclosure, exact_ends, sign

FOLDER = Path(reference.__file__).parent
# What may be asked of an interval context. Nothing may be imported from mpmath: what is sound of it
# stands in `scene.mpmath_internals`.
SOUND = {"mpf", "make_mpf", "sqrt", "prec", "cos_sin"}

numbers = st.floats(-1e6, 1e6, allow_subnormal=False)


def misuses(source: str) -> list[str]:
    """List the uses of mpmath in a module that are not known to be sound."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            if owner.endswith("context") and node.attr not in SOUND:
                found.append(ast.unparse(node))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mpmath"):
            found.append(str(node.module))
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names if alias.name.startswith("mpmath")]
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and "BEYOND" not in ast.unparse(node):
            left = node.left
            if not isinstance(left, ast.Constant):
                found.append(ast.unparse(node))
    return found


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.name)
def test_modules_use_sound_operations_only(path):
    assert misuses(path.read_text("utf-8")) == []


@pytest.mark.parametrize(
    "line",
    [
        "y = self.context.exp(x)",
        "y = arithmetic.context.log(x)",
        "import mpmath.libmp.libmpi as exp",
        "from mpmath import mp, iv",
        "from mpmath.libmp import libmpi",
        "from mpmath.functions import zeta",
        "y = x**2",
    ],
)
def test_an_unsound_one_would_be_seen(line):
    assert misuses(line) != []


@pytest.mark.parametrize("operation", [operator.add, operator.sub, operator.mul, operator.truediv])
@given(a=numbers, b=numbers, width=st.floats(0, 10))
def test_rational_operations_enclose(operation, a, b, width):
    """At 8 bits or so, the result of exact operands lies within."""
    arithmetic = Arithmetic(1)
    x = arithmetic.context.mpf([a, a + width])
    y = arithmetic.number(b)
    if operation is operator.truediv and sign(y) == 0:
        return
    low, high = exact_ends(operation(x, y))
    for point in (Fraction(a), Fraction(a + width), (Fraction(a) + Fraction(a + width)) / 2):
        assert low <= operation(point, Fraction(b)) <= high


@given(numbers, st.floats(0, 10))
def test_squares_and_roots_enclose(a, width):
    arithmetic = Arithmetic(1)
    x = arithmetic.context.mpf([a, a + width])
    low, high = exact_ends(arithmetic.square(x))
    assert low >= 0
    for point in (Fraction(a), Fraction(a + width), Fraction(a) + Fraction(width) / 3):
        if Fraction(a) <= point <= Fraction(a + width):
            assert low <= point * point <= high
    if a >= 0:
        low, high = exact_ends(arithmetic.context.sqrt(x))
        assert low * low <= Fraction(a)
        assert Fraction(a + width) <= high * high


@given(st.floats(-1e4, 1e4), st.floats(0, 8), st.floats(0, 1))
def test_cosine_and_sine_enclose(a, width, share):
    """Any point of the argument, in 60 digits, lies within the image at 8 bits or so."""
    arithmetic = Arithmetic(1)
    cos, sin = arithmetic.cos_sin(arithmetic.context.mpf([a, a + width]))
    ctx = mpmath.MPContext()
    ctx.dps = 60
    point = ctx.mpf(a) + ctx.mpf(width) * ctx.mpf(share)
    if point <= ctx.mpf(a + width):
        assert cos.a <= ctx.cos(point) <= cos.b
        assert sin.a <= ctx.sin(point) <= sin.b


@pytest.mark.parametrize("k", range(-9, 10))
def test_extrema_within_are_seen(k):
    """Around each multiple of pi/2 the image holds the extreme value 1 or -1."""
    arithmetic = Arithmetic(30)
    quarter = arithmetic.number(k) * arithmetic.context.pi / 2 if k else arithmetic.zero
    around = quarter + arithmetic.context.mpf([-1e-20, 1e-20])
    cos, sin = arithmetic.cos_sin(around)
    image = cos if k % 2 == 0 else sin
    extreme = 1 if k % 4 in (0, 1) else -1
    assert image.a <= extreme <= image.b


def test_threads_take_turns_at_mpmaths_shared_pi(monkeypatch):
    """Whatever computes or reads it does so with the lock held."""
    module, seen, arithmetic = reference.arithmetic, [], Arithmetic(10)
    raw = module.raw

    def watched(honest):
        return lambda *given: seen.append(module.CONSTANTS.locked()) or honest(*given)

    monkeypatch.setattr(raw, "interval_cos_sin", watched(raw.interval_cos_sin))
    monkeypatch.setattr(raw, "pi", watched(raw.pi))
    arithmetic.cos_sin(arithmetic.number(1))
    assert len(seen) == 1
    arithmetic.turning(1.0, None, Fraction(100))
    arithmetic.turning(None, 3.0, Fraction(100))
    assert len(seen) == 5
    assert all(seen)

    class Unlocked:
        """A lock that holds nobody back: a reference that reads pi outside it would be seen."""

        __enter__ = __exit__ = locked = staticmethod(lambda *_: False)

    monkeypatch.setattr(module, "CONSTANTS", Unlocked())
    arithmetic.turning(1.0, None, Fraction(100))
    assert not any(seen[5:])
    assert seen[5:]
    source = "".join(path.read_text("utf-8") for path in FOLDER.glob("*.py"))
    assert "context.pi" not in source
    assert "ctx.pi" not in source


@given(st.floats(-1e300, 1e300), st.floats(0.125, 1e3), st.booleans())
def test_phases_lose_no_digit(t, number, is_period):
    """Less whole turns, the phase has the sine of omega t, however large t is."""
    arithmetic = Arithmetic(30)
    law = (None, number) if is_period else (number, None)
    omega, phase = arithmetic.turning(*law, Fraction(t))
    assert float(arithmetic.enclosure(phase).extent()) < 1e-28
    ctx = mpmath.MPContext()
    ctx.prec = 2300
    exact_omega = 2 * ctx.pi / ctx.mpf(number) if is_period else ctx.mpf(number)
    assert omega.a <= exact_omega <= omega.b
    _, sin = arithmetic.cos_sin(phase)
    truth, rounding = ctx.sin(exact_omega * ctx.mpf(t)), ctx.mpf(2) ** -1000  # of the 2300 bits, at t = 1e300
    assert ctx.mpf(sin.a) - rounding <= truth <= ctx.mpf(sin.b) + rounding


@pytest.mark.parametrize(("ends", "expected"), [((-1, 1), 0), ((0, 1), 0), ((1, 2), 1), ((-2, -1), -1)])
def test_an_undecided_sign_is_zero(ends, expected):
    assert sign(Arithmetic(10).context.mpf(ends)) == expected


@given(numbers, st.floats(0, 1e-3))
def test_centres_round_correctly(a, width):
    assert float(Enclosure(mpmath.mpf(a), mpmath.mpf(a + width))) == float(
        (Fraction(a) + Fraction(a + width)) / 2
    )


def exact(number):
    return Fraction(*map(int, number.as_integer_ratio()))


@given(numbers, st.floats(0, 1e9), st.integers(-1000, 0))
def test_an_enclosure_prints_as_one(a, width, shift):
    """With Python's usual 15 digits both ends would be shown as the same number."""
    low, high = (mpmath.ldexp(end, shift) for end in (a, a + width))
    middle, _, left = repr(Enclosure(low, high)).removeprefix("Enclosure(").removesuffix(")").partition(" ± ")
    middle, left = Fraction(middle if left else float(middle)), Fraction(left or 0)
    assert middle - left <= exact(low) <= exact(high) <= middle + left
    extent = exact(high) - exact(low)
    assert 2 * left <= Fraction(12, 10) * extent or extent == 0
