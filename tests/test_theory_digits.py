"""Many digits, solutions that are kept, and the lock on constants that all threads share.

Sums of cosines are taken by halving, roots found with few digits first, parts tried at few points. A solution
that is kept is the one that would be found again, and belongs to nobody.
"""

import threading
from typing import Any

import pytest
from mpmath import MPContext
from mpmath.libmp import libelefun

import theory
from scene import Fourier, Mushroom, load
from theory import Cycle, Prediction, mean_of, moments, precision, predict, prediction
from theory.adiabatic import captures
from theory.critical import MANY_BITS, solve_rising

# m1 of the moving cap to 100 digits, by sums of all cosines and every Newton step at full precision.
M1 = "0.1227679649373872211752779164798956665418006027565599953695922200419445092518695629088300949849377621"


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


@pytest.mark.parametrize(("name", "m1"), [("moving-cap", M1), ("moving-cap-trivial", "0")])
def test_many_digits_are_what_they_were(name, m1):
    """Where nothing is gained log g is rounding alone, which no number of points resolves, nor need they."""
    digits, told = 84, []
    found = captures(Cycle.of(load(name), digits), digits + 4, told.append)
    with found.binary.working():
        assert abs(found.growth() - found.binary.mpf(m1)) < found.binary.mpf(10) ** -digits
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)
    assert len(found.placed) < 50


# A particle may be captured twice in a cycle: wells within a well.
TWICE = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25), sin=(0.0625,)))


@pytest.fixture(autouse=True)
def _nothing_kept() -> None:
    prediction._place.cache_clear()


OTHER = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25), sin=(0.125,)))
QUESTIONS = [(load("moving-cap"), 3), (TWICE, 3), (OTHER, 3), (TWICE, 4)]


def figures(scene: Mushroom, digits: int) -> tuple[Prediction, list[Any]]:
    return predict(scene, digits), moments(scene, 2, digits)


def test_what_is_kept_is_what_would_be_found() -> None:
    """Another scene, or other digits, are another solution, in whatever order they are asked."""
    alone = []
    for question in QUESTIONS:
        prediction._place.cache_clear()
        alone.append(figures(*question))
    assert len(set(map(repr, alone))) == len(QUESTIONS)
    assert [figures(*question) for question in QUESTIONS * 2] == alone * 2


def test_nothing_is_solved_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor is it because a scene has a name."""
    first = figures(TWICE, 3)
    for name in ("captures", "refined"):
        monkeypatch.setattr(prediction, name, None)
    for scene in (TWICE, Mushroom(r=TWICE.r, h=TWICE.h, nu=TWICE.nu, name="named")):
        assert figures(scene, 3) == first


def test_nobody_is_touched_by_what_another_does_with_its_numbers() -> None:
    right = predict(TWICE, 3).strings(3)
    spoilt = predict(TWICE, 3)
    spoilt.m1.context.dps = 1
    again = predict(TWICE, 3)
    assert again.strings(3) == right
    assert again.m1.context is not spoilt.m1.context


def test_the_whole_of_it_is_told_as_done() -> None:
    told: list[tuple[int, float]] = []
    for _ in range(2):
        told.clear()
        predict(TWICE, 3, progress=lambda *done: told.append(done))
        assert told == sorted(told)
        assert {number for number, _ in told} == {1, 2}
        assert told[-1] == (2, 1.0)
    assert told == [(1, 1.0), (2, 1.0)]


def test_many_digits_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prediction, "FEW_DIGITS", 2)
    predict(TWICE, 3)
    assert prediction._place.cache_info().currsize == 0


def test_no_thread_computes_while_another_does() -> None:
    inside, go_on = threading.Event(), threading.Event()
    found: dict[str, Any] = {}

    def slow(s: Any) -> Any:
        inside.set()
        assert go_on.wait(60)
        return s

    first = threading.Thread(target=lambda: found.update(mean=mean_of(load("ergodic"), slow, 5)))
    second = threading.Thread(target=lambda: found.update(other=predict(load("ergodic"), 5)))
    first.start()
    assert inside.wait(60)
    second.start()
    second.join(1.0)
    is_waiting = second.is_alive()
    go_on.set()
    first.join(60)
    second.join(60)
    assert is_waiting
    assert (found["mean"], tuple(found["other"])) == (0, (1, 0, 0, 0, 1, 1))


def test_whatever_computes_with_mpmath_holds_the_lock() -> None:
    of_points = ("density_at", "cdf_at", "caustics", "capture_rate_at", "chaotic_zone")
    for name in ("predict", "mean_of", "moments", "cumulants", *of_points):
        assert hasattr(getattr(theory, name), "__wrapped__"), name
    for method in ("of", "t_in", "t_out", "release_time"):
        assert hasattr(getattr(theory.Cycle, method), "__wrapped__"), method


def test_constants_rest_once_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prediction, "FEW_DIGITS", 0)  # nothing is known already
    ctx = MPContext()
    ctx.dps = 200
    precision.settle(ctx)
    memo = libelefun.pi_fixed.__closure__[0].cell_contents
    known = memo.memo_prec
    assert known >= 4 * ctx.prec
    predict(load("fixed-cap-clockwise"), 12)
    assert abs(ctx.sin(+ctx.pi)) < ctx.mpf(10) ** -199
    assert memo.memo_prec == known
