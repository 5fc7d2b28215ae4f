"""Misprints: each evaluates the printed form and the corrected one.

The check proves itself: a misprint stands only when its printed form fails and the corrected
one holds, both evaluated here and now, none recorded.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import ROUND_HALF_EVEN, Decimal
from typing import Any, NamedTuple

import mpmath
from mpmath import fp

import scene as scenes
import theory
from scene.laws import BangBang
from scene.tables import period

Predict = Callable[[scenes.Scene, int], theory.Prediction]

DIGITS = 30
ZERO = 1e-12  # float64 sums of a few hundred terms of order 10
N_LOOP = 256  # the trapezoid rule converges geometrically on smooth periodic loops


class Forms(NamedTuple):
    """Whether the printed and the corrected form hold, what each gives, and the right value."""

    printed_holds: bool
    corrected_holds: bool
    printed: str
    corrected: str
    value: str


def rounds_to(printed: str, value: Any) -> bool:
    """Tell whether an mpf, rounded to as many decimals as were printed, is the printed number."""
    number = Decimal(printed)
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)
    exact = Decimal(mpmath.nstr(value, DIGITS, min_fixed=-mpmath.inf, max_fixed=mpmath.inf))
    return exact.quantize(Decimal(1).scaleb(exponent), ROUND_HALF_EVEN) == number


def half_angle(predict: Predict) -> Forms:
    """M1: the mouth as printed, sin²(t), and with the half angle."""
    try:
        scenes.load("moving-cap-as-printed")
        printed, printed_holds = "the table is valid", True
    except scenes.InvalidScene as error:
        printed, printed_holds = f"invalid, {str(error).partition(': ')[2]}", False
    m1 = predict(scenes.load("moving-cap"), DIGITS).m1
    return Forms(
        printed_holds,
        rounds_to("0.122768", m1),
        printed,
        f"valid, m1 = {mpmath.nstr(m1, 8)}",
        mpmath.nstr(m1, 12),
    )


def signs(predict: Predict) -> Forms:
    """M2: the text's signs of a and b, and the captions'."""
    forms = []
    for name in ("moving-cap-reversed", "moving-cap"):
        result = predict(scenes.load(name), DIGITS)
        holds = (
            rounds_to("0.122768", result.m1)
            and rounds_to("0.38474", result.p_nc)
            and rounds_to("-0.422465", result.log_e_nc)
        )
        text = ", ".join(
            f"{field} = {mpmath.nstr(getattr(result, field), 6)}" for field in ("m1", "p_nc", "log_e_nc")
        )
        forms.append((holds, text, result.m1))
    (printed_holds, printed, _), (corrected_holds, corrected, m1) = forms
    return Forms(printed_holds, corrected_holds, printed, corrected, mpmath.nstr(m1, 12))


def exponent_sign(predict: Predict) -> Forms:
    """M4: exp(-∫ dV_ell/V_cha) and exp(+∫ dV_ell/V_cha) over the mouth's closing, sec. 4.1."""
    printed, corrected = [], []
    printed_holds = corrected_holds = True
    names = {"fixed-cap-anticlockwise": "0.843472", "fixed-cap-clockwise": "0.717894"}
    for name, paper in names.items():
        table = scenes.load(name)
        with mpmath.workdps(DIGITS):
            integral = _capture_integral(table)
            minus, plus = mpmath.exp(-integral), mpmath.exp(integral)
        printed_holds &= bool(minus <= 1) and rounds_to(paper, minus)
        theirs = predict(table, DIGITS).p_nc
        corrected_holds &= rounds_to(paper, plus) and abs(plus - theirs) < mpmath.mpf(10) ** (5 - DIGITS)
        printed.append(mpmath.nstr(minus, 8))
        corrected.append(mpmath.nstr(plus, 12))
    values = ", ".join(corrected)
    return Forms(printed_holds, corrected_holds, "p_nc = " + ", ".join(printed), "p_nc = " + values, values)


def _capture_integral(table: scenes.Scene) -> Any:
    # The integral of dV_ell/V_cha from w0 to w1 with r = 1 and h at rest, from the definitions of
    # sec. 2 in the variable w; theory integrates over time, so the two share nothing.
    assert isinstance(table, scenes.Mushroom)
    assert isinstance(table.w, BangBang)
    assert isinstance(table.h, BangBang)
    knots = table.w.knots
    closing = next(i for i in range(len(knots) - 1) if knots[i + 1][1] < knots[i][1])
    w1, w0 = mpmath.mpf(knots[closing][1]), mpmath.mpf(knots[closing + 1][1])
    h, slope = mpmath.mpf(table.h.knots[closing][1]), mpmath.mpf(table.slope)
    pi = mpmath.pi

    def rate(w: Any) -> Any:
        v_ell = 2 * pi * (mpmath.acos(w) - w * mpmath.sqrt(1 - w * w))
        v_cha = pi * pi + 2 * pi * (2 * w * h - h * h * slope) - v_ell
        return -4 * pi * mpmath.sqrt(1 - w * w) / v_cha

    return mpmath.quad(rate, [w0, w1])


def loop_plane(predict: Predict) -> Forms:
    """M12: area of the loop a = b = 0.5 in the summary's plane and in that of sec. 3.5."""
    table = scenes.load("moving-cap-trivial")
    shared = period(table)
    assert shared is not None
    span = shared.value(fp)
    points = [theory.volumes_at(fp, table, span * k / N_LOOP) for k in range(N_LOOP)]
    share = [v.v_ell / v.v_cap for v in points]
    summary = _area(share, [v.v_cha for v in points])
    section = _area(share, [v.v_cap / (v.v_cap + v.v_stem) for v in points])
    result = predict(table, DIGITS)
    grows = abs(result.m1) > ZERO
    return Forms(
        (abs(summary) > ZERO) == grows,
        (abs(section) > ZERO) == grows,
        f"area {summary:.4g} bounded, so growth is promised, yet m1 = {mpmath.nstr(result.m1, 3)}"
        f" (p_nc = {mpmath.nstr(result.p_nc, 6)})",
        f"area {section:.1g}, no growth, and none is found",
        f"m1 = {mpmath.nstr(result.m1, 3)}",
    )


def _area(x: list[float], y: list[float]) -> float:
    # Of the closed polygon, by the shoelace formula.
    n = len(x)
    return sum(x[k] * y[(k + 1) % n] - x[(k + 1) % n] * y[k] for k in range(n)) / 2


FORMS: dict[str, Callable[[Predict], Forms]] = {
    "half_angle": half_angle,
    "signs": signs,
    "exponent_sign": exponent_sign,
    "loop_plane": loop_plane,
}
