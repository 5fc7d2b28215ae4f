"""Many digits: sums of cosines by halving, roots found with few digits first, parts tried at few points."""

import pytest
from mpmath import MPContext

import scene
from theory.adiabatic import captures
from theory.chebyshev import Grid
from theory.critical import MANY_BITS, solve_rising
from theory.cycle import Cycle

# m1 of the moving cap to 100 digits, by sums of all cosines and every Newton step at full precision.
M1 = "0.1227679649373872211752779164798956665418006027565599953695922200419445092518695629088300949849377621"


@pytest.fixture(scope="module")
def ctx():
    found = MPContext()
    found.dps = 120
    return found


def values(ctx, n):
    """Return n + 1 numbers that fall from 1 to 1e-100."""
    return [ctx.mpf(10) ** (-100 * j / ctx.mpf(n)) * ((7 * j) % 11 - 5) for j in range(n + 1)]


@pytest.mark.parametrize("n", [208, 216])
def test_sums_by_halving_are_the_sums_of_all(ctx, n):
    grid, given = Grid(ctx, n), values(ctx, n)
    truth = grid._sums_of_all(given)
    found = grid._cosine_sums(given)
    assert max(abs(a - b) for a, b in zip(found, truth, strict=True)) < ctx.mpf(10) ** -115
    direct = ctx.fsum(v * ctx.cos(ctx.pi * j * 5 / n) for j, v in enumerate(given))
    assert abs(direct - found[5]) < ctx.mpf(10) ** -115


def test_halves_put_together_wrongly_would_be_seen(ctx):
    class Unmirrored(Grid):
        """Does not turn the second half round."""

        def _odd_sums(self, given):
            found = super()._odd_sums(given)
            return found[: len(found) // 2] + found[len(found) // 2 :][::-1]

    n, given = 208, values(ctx, 208)
    found, truth = Unmirrored(ctx, n)._cosine_sums(given), Grid(ctx, n)._sums_of_all(given)
    assert max(abs(a - b) for a, b in zip(found, truth, strict=True)) > 1e-3


def test_a_root_has_all_its_digits_and_is_found_with_few():
    found = MPContext()
    found.prec = 4 * MANY_BITS
    precisions = []

    def rising(x):
        precisions.append(found.prec)
        return found.exp(x) - 3, found.exp(x)

    root = solve_rising(found, rising, found.mpf(0), found.mpf(2))
    assert abs(root - found.log(3)) < found.ldexp(1, 3 - found.prec)
    assert found.prec == 4 * MANY_BITS
    assert sum(p == found.prec for p in precisions) <= 2
    assert min(precisions) <= MANY_BITS


def test_many_digits_are_what_they_were():
    digits, told = 84, []
    found = captures(Cycle.of(scene.load("moving-cap"), digits), digits + 4, told.append)
    with found.binary.working():
        assert abs(found.growth() - found.binary.mpf(M1)) < found.binary.mpf(10) ** -digits
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)


def test_many_digits_of_a_cycle_that_gains_nothing():
    """Its log g is rounding alone, which no number of points resolves, nor need they."""
    digits = 84
    found = captures(Cycle.of(scene.load("moving-cap-trivial"), digits), digits + 4)
    with found.binary.working():
        assert abs(found.growth()) < found.binary.mpf(10) ** -digits
    assert len(found.placed) < 50
