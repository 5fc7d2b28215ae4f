"""What we use of mpmath's inside has the meaning that we rely on: each name, against exact numbers."""

import ast
import inspect
from fractions import Fraction

import mpmath
import pytest
from mpmath import libmp

from scene import mpmath_internals as raw
from scene.precision import intervals

BITS = 20
LONG = Fraction(2**70 + 1, 2**30)  # more bits than BITS, and than binary64 has


def value(number):
    """Return the rational that a raw number stands for, by the definition of a raw number."""
    sign, mantissa, exponent, bits = number
    assert int(mantissa).bit_length() == bits
    return (-1) ** sign * int(mantissa) * Fraction(2) ** exponent


def interval(low, high):
    return raw.from_parts(low, 0), raw.from_parts(high, 0)


@pytest.mark.parametrize("number", [Fraction(0), Fraction(3), Fraction(-5, 8), LONG, -LONG])
def test_a_raw_number_is_sign_mantissa_and_exponent(number):
    shift = number.denominator.bit_length() - 1
    found = raw.from_parts(number.numerator, -shift)
    assert value(found) == number
    mantissa, exponent = raw.parts(found)
    assert int(mantissa) * Fraction(2) ** exponent == number
    assert Fraction(*map(int, raw.to_rational(found))) == number
    assert raw.sign(found) == (number > 0) - (number < 0)
    assert raw.number(mpmath.mp.make_mpf(found)) == found
    system = intervals(BITS)
    assert raw.ends(system.make_mpf((found, found))) == (found, found)


@pytest.mark.parametrize("number", [2**70 + 1, -(2**70) - 1])
@pytest.mark.parametrize(("direction", "off"), [(raw.DOWN, -1), (raw.UP, 1)])
def test_integers_are_rounded_as_is_said(number, direction, off):
    found = value(raw.from_int(number, BITS, direction))
    assert 0 < off * (found - number) < Fraction(abs(number), 2 ** (BITS - 1))
    assert value(raw.from_int(number)) == number


@pytest.mark.parametrize("number", [0.1, -0.1, 5e-324, 1.7976931348623157e308])
def test_floats_are_rounded_as_is_said(number):
    low, high = (value(raw.from_float(number, BITS, direction)) for direction in (raw.DOWN, raw.UP))
    assert low <= Fraction(number) <= high
    assert high - low < abs(Fraction(number)) / 2 ** (BITS - 2)
    assert value(raw.from_float(number, 53, raw.DOWN)) == Fraction(number)


def test_raw_numbers_are_compared_exactly():
    least = raw.from_parts(1, -3000)
    one, more = raw.from_parts(1, 0), raw.add(raw.from_parts(1, 0), least)
    for function, found in ((raw.is_less, [False, True, False]), (raw.is_greater, [False, False, True])):
        assert [bool(function(a, b)) for a, b in ((one, one), (one, more), (more, one))] == found


def test_sums_and_shifts_are_exact_and_a_difference_is_rounded():
    one, least = raw.from_parts(1, 0), raw.from_parts(1, -3000)
    assert value(raw.add(one, least)) == 1 + Fraction(1, 2**3000)
    assert value(raw.shifted(raw.from_parts(3, 0), -5)) == Fraction(3, 32)
    assert value(raw.subtract(one, least, BITS, raw.DOWN)) == 1 - Fraction(1, 2**BITS)
    assert value(raw.subtract(one, least, BITS, raw.UP)) == 1


def test_a_number_is_rounded_to_the_nearest():
    for above, nearest in ((1, 0), (3, 4)):  # half way between two: to the even one
        number = raw.from_parts(2**BITS + above, 0)
        assert value(raw.rounded(number, BITS, raw.NEAREST)) == 2**BITS + nearest


def test_pi_is_enclosed():
    low, high = (value(raw.pi(300, direction)) for direction in (raw.DOWN, raw.UP))
    assert low < high < low + Fraction(1, 2**297)
    with mpmath.workprec(400):
        pi = Fraction(*map(int, (+mpmath.mp.pi).as_integer_ratio()))
    assert low < pi < high


def test_a_square_is_never_negative():
    low, high = map(value, raw.interval_square(interval(-3, 2), BITS))
    assert (low, high) == (0, 9)


def test_cosine_and_sine_of_an_interval_enclose():
    cos, sin = raw.interval_cos_sin(interval(1, 4), BITS)
    assert value(cos[0]) == -1  # pi lies within
    assert Fraction("0.5403") <= value(cos[1]) <= Fraction("0.5404")
    assert Fraction("-0.7569") <= value(sin[0]) <= Fraction("-0.7568")
    assert value(sin[1]) == 1


OPERATIONS = {"__add__": (7, 11), "__sub__": (-5, -1), "__mul__": (10, 28), "__truediv__": (2 / 7, 4 / 5)}


@pytest.mark.parametrize("name", raw.INTERVAL_OPERATIONS)
def test_operations_of_intervals_enclose(name):
    a, b = interval(2, 4), interval(5, 7)
    direct = raw.INTERVAL_OPERATIONS[name](a, b, BITS)
    low, high = map(value, direct)
    assert low <= Fraction(OPERATIONS[name][0]) + Fraction(1, 2**40)
    assert high >= Fraction(OPERATIONS[name][1]) - Fraction(1, 2**40)
    assert high - low <= Fraction(OPERATIONS[name][1]) - Fraction(OPERATIONS[name][0]) + Fraction(1, 2**16)
    system = mpmath.ctx_iv.MPIntervalContext()  # one without our operations
    system.prec = BITS
    quick = raw.quick_operation(system.mpf, name, BITS)
    x, y = system.make_mpf(a), system.make_mpf(b)
    assert raw.ends(quick(x, y)) == raw.ends(getattr(x, name)(y)) == direct
    assert raw.ends(quick(x, 5)) == raw.ends(getattr(x, name)(5))


def test_constants_that_are_known_are_not_computed_again():
    """Threads read them then without a change between two reads."""
    raw.know_constants(5000)
    for constant in (libmp.libelefun.pi_fixed, libmp.libelefun.ln2_fixed, libmp.libelefun.ln10_fixed):
        memo = inspect.getclosurevars(constant).nonlocals["f"]
        before = memo.memo_prec
        assert before >= 5000
        constant(4000)
        assert memo.memo_prec == before


def test_a_system_of_intervals_has_a_precision_of_its_own():
    made = raw.MPIntervalContext()
    made.prec = BITS
    assert intervals(300).prec == 300
    assert made.prec == BITS
    third = made.mpf(1) / 3
    low, high = map(value, raw.ends(third))
    assert low < Fraction(1, 3) < high


def test_each_name_is_tested_here():
    source = ast.parse(inspect.getsource(inspect.getmodule(value)))
    used = {
        node.attr
        for node in ast.walk(source)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "raw"
    }
    public = {name for name, found in vars(raw).items() if not name.startswith("_")}
    imported = {"Any", "Callable", "attrgetter", "libelefun", "libmpf", "libmpi"}
    assert public - imported - {"Raw", "RawInterval"} <= used
