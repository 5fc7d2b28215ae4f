"""mpmath's constants are shared by all threads: theory holds a lock on them."""

import threading
from typing import Any

import pytest
from mpmath import MPContext
from mpmath.libmp import libelefun

import theory
from scene import load
from theory import mean_of, precision, predict, prediction


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
