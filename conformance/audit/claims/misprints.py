"""Misprints that theory alone decides: M1 to M4, M10, M12, M13.

Each evaluates the printed form, which must fail, and the corrected one, which must hold, here and now:
nothing is recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import mpmath
from mpmath import fp

import scene as scenes
import theory
from conformance.audit.claims.printed import rounds_to
from conformance.audit.evidence import DIGITS, ClaimEvidence
from conformance.audit.finding import Check, Form
from conformance.audit.tolerances import exact, stated
from scene.laws import BangBang
from scene.tables import Mushroom, cycle_length

FORMS: tuple[Form, Form] = ("printed", "corrected")
ZERO = 1e-12  # float64 sums of a few hundred terms of order 10
N_LOOP = 256  # the trapezoid rule converges geometrically on smooth periodic loops


def rounds(what: str, printed: str, value: Any, form: Form) -> Check:
    """Check that theory rounds to a printed number."""
    return Check(what, rounds_to(printed, value), printed, float(value), form=form)


def half_angle(evidence: ClaimEvidence) -> Iterator[Check]:
    """M1: the mouth as printed, sin²(t), and with the half angle."""
    try:
        scenes.load("moving-cap-as-printed")
        message, is_valid = "valid", True
    except scenes.InvalidScene as error:
        message, is_valid = str(error).partition(": ")[2], False
    upright = Mushroom(  # valid, as its slope is 0: the loop can be solved
        r=scenes.Fourier(1.0, 1.0, (), (0.5,)),
        h=scenes.Fourier(1.0, 1.0, (), (-0.5,)),
        nu=scenes.Fourier(0.6, 1.0, (0.0, 0.4)),
    )
    as_printed, corrected = evidence.predict(upright), evidence.predict("moving-cap")
    yield stated("sin²(t): the table is valid through the cycle", is_valid, message, "valid", form="printed")
    yield stated(
        "sin²(t), slope 0: energy grows",
        bool(as_printed.m1 > ZERO),
        f"m1 = {mpmath.nstr(as_printed.m1, 3)}: t and pi - t see the same r, h",
        "m1 > 0",
        form="printed",
    )
    yield stated("sin²(t/2): the table is valid", True, "valid, by exact algebra", "valid", form="corrected")
    yield rounds("sin²(t/2): m1", "0.122768", corrected.m1, "corrected")
    yield rounds("sin²(t/2): p_nc", "0.38474", corrected.p_nc, "corrected")


def signs(evidence: ClaimEvidence) -> Iterator[Check]:
    """M2: the text's signs of a and b, and the captions'."""
    printed = {"m1": "0.122768", "p_nc": "0.38474", "log_e_nc": "-0.422465"}
    cases: tuple[tuple[str, str, Form], ...] = (
        ("moving-cap-reversed", "text, a = -0.5, b = 0.5", "printed"),
        ("moving-cap", "captions, a = 0.5, b = -0.5", "corrected"),
    )
    yield from (
        rounds(f"{label}: {name}", value, getattr(evidence.predict(scene), name), form)
        for scene, label, form in cases
        for name, value in printed.items()
    )
    for scene, label, form in cases:
        turn = loop_area(scene)
        what = f"{label}: the loop runs clockwise, as the caption of the cycle's figure says"
        yield stated(what, turn < 0, f"signed area {turn:+.4f}", "area < 0", form=form)


def loop_area(name: str) -> float:
    """Return the signed area of a loop in the plane (V_ell/V_cap, V_cap/V), anticlockwise positive."""
    return signed_area(*volume_loop(scenes.load(name), N_LOOP))


def volume_loop(table: scenes.Scene, n: int) -> tuple[list[float], list[float]]:
    """Return V_ell/V_cap and V_cap/V at n even times of one cycle, the plane of sec. 3.5."""
    points = _volumes(table, n)
    return [v.v_ell / v.v_cap for v in points], [v.v_cap / (v.v_cap + v.v_stem) for v in points]


def _volumes(table: scenes.Scene, n: int) -> list[theory.Volumes]:
    return [theory.volumes_at(fp, table, cycle_length(table) * k / n) for k in range(n)]


def signed_area(x: Sequence[float], y: Sequence[float]) -> float:
    """Return the area of a closed polygon, positive when it runs anticlockwise (the shoelace formula)."""
    n = len(x)
    return float(sum(x[k] * y[(k + 1) % n] - x[(k + 1) % n] * y[k] for k in range(n)) / 2)


def radius_squared(_evidence: ClaimEvidence) -> Iterator[Check]:
    """M3: the half disk x² + y² <= r, and x² + y² <= r², against V_cap = pi² r² = 2 pi times its area."""
    for r in (0.5, 1.5):
        for power, form in zip((1, 2), FORMS, strict=True):
            edge = mpmath.sqrt(mpmath.mpf(r) ** power)
            area = mpmath.quad(lambda x, edge=edge: mpmath.sqrt(edge**2 - x**2), [-edge, 0, edge])
            what = f"x² + y² <= r{'²' if power == 2 else ''}, r = {r}: 2 pi area"
            yield exact(what, 2 * mpmath.pi * area, theory.v_cap(mpmath.mp, r), ZERO, form=form)


def exponent_sign(evidence: ClaimEvidence) -> Iterator[Check]:
    """M4: exp(-∫ dV_ell/V_cha) and exp(+∫ dV_ell/V_cha) over the mouth's closing, sec. 4.1."""
    for name, paper in (("fixed-cap-anticlockwise", "0.843472"), ("fixed-cap-clockwise", "0.717894")):
        table = scenes.load(name)
        with mpmath.workdps(DIGITS):
            integral = _capture_integral(table)
            minus, plus = mpmath.exp(-integral), mpmath.exp(integral)
        theirs = evidence.predict(table).p_nc
        yield stated(
            f"exp(-∫), {name}: a probability", bool(minus <= 1), mpmath.nstr(minus, 8), "<= 1", form="printed"
        )
        yield rounds(f"exp(-∫), {name}: p_nc", paper, minus, "printed")
        yield rounds(f"exp(+∫), {name}: p_nc", paper, plus, "corrected")
        yield exact(f"exp(+∫), {name}: eq. (ps)", plus, theirs, 10.0 ** (5 - DIGITS), form="corrected")


def _capture_integral(table: scenes.Scene) -> Any:
    # The integral of dV_ell/V_cha from w0 to w1 with r = 1 and h at rest, from the definitions of
    # sec. 2 in the variable w; theory integrates over time, so the two share nothing.
    w0, w1, h, _ = fixed_cap(table)
    slope = mpmath.mpf(table.slope)  # type: ignore[union-attr]
    return mpmath.quad(lambda w: island_slope(w) / chaotic_volume(w, h, slope), [w0, w1])


def fixed_cap(table: scenes.Scene) -> tuple[Any, Any, Any, Any]:
    """Return w0, w1 and h while the mouth closes and while it opens, of a scene of sec. 4.1."""
    assert isinstance(table, Mushroom)
    assert isinstance(table.w, BangBang)
    assert isinstance(table.h, BangBang)
    knots = table.w.knots
    closing = next(i for i in range(len(knots) - 1) if knots[i + 1][1] < knots[i][1])
    opening = next(i for i in range(len(knots) - 1) if knots[i + 1][1] > knots[i][1])
    w1, w0 = mpmath.mpf(knots[closing][1]), mpmath.mpf(knots[closing + 1][1])
    return w0, w1, mpmath.mpf(table.h.knots[closing][1]), mpmath.mpf(table.h.knots[opening][1])


def island_slope(w: Any) -> Any:
    """Return dV_ell/dw for r = 1, from V_ell = 2 pi (acos w - w sqrt(1 - w²))."""
    return -4 * mpmath.pi * mpmath.sqrt(1 - w * w)


def chaotic_volume(w: Any, h: Any, slope: Any) -> Any:
    """Return V_cha for r = 1, from sec. 2."""
    pi = mpmath.pi
    v_ell = 2 * pi * (mpmath.acos(w) - w * mpmath.sqrt(1 - w * w))
    return pi * pi + 2 * pi * (2 * w * h - h * h * slope) - v_ell


def cone(_evidence: ClaimEvidence) -> Iterator[Check]:
    """M10: where the cone |x| <= w + y tan theta must still be open: y = h as printed, or y = -h."""
    w, h, slope = mpmath.mpf("0.5"), mpmath.mpf(1), mpmath.mpf("0.5")  # w = h tan: the stem just closes
    volume = theory.v_stem(mpmath.mp, w, h, slope)
    for end, form in zip((h, -h), FORMS, strict=True):
        width = w + end * slope
        area = mpmath.quad(lambda y: 2 * (w + y * slope), sorted([0, end]))
        label = "y = h" if end > 0 else "y = -h"
        yield exact(f"{label}: w = h tan is where the cone closes", width, 0, ZERO, form=form)
        yield exact(f"{label}: 2 pi area is V_stem", 2 * mpmath.pi * area, volume, ZERO, form=form)


def loop_plane(evidence: ClaimEvidence) -> Iterator[Check]:
    """M12: area of the loop a = b = 0.5 in the summary's plane and in that of sec. 3.5."""
    table = scenes.load("moving-cap-trivial")
    share, part = volume_loop(table, N_LOOP)
    summary = signed_area(share, [v.v_cha for v in _volumes(table, N_LOOP)])
    section = signed_area(share, part)
    result = evidence.predict("moving-cap-trivial")
    grows = abs(result.m1) > ZERO
    m1 = f"m1 = {mpmath.nstr(result.m1, 3)}, p_nc = {mpmath.nstr(result.p_nc, 6)}"
    yield stated(
        "plane (V_cha, flux): an area means growth",
        (abs(summary) > ZERO) == grows,
        f"area {summary:.4g}, yet {m1}",
        "area and growth, or neither",
        form="printed",
    )
    yield stated(
        "plane (V_ell/V_cap, V_cap/V): an area means growth",
        (abs(section) > ZERO) == grows,
        f"area {section:.1g}, {m1}",
        "area and growth, or neither",
        form="corrected",
    )


def measures(evidence: ClaimEvidence) -> Iterator[Check]:
    """M13: whose share p_cha is, and which volume the set H = E has."""
    table = Mushroom(r=1.0, h=scenes.Fourier(1.0, 1.0, (), (0.5,)), nu=scenes.Fourier(0.5, 1.0, (0.4,)))
    start = theory.volumes_at(fp, table, 0.0)  # nu = 0.9 at most: an island remains
    p_nc = float(evidence.predict(table).p_nc)
    free = start.v_cha / (start.v_cap + start.v_stem)
    energy, area = 2.0, 1.0
    printed = 2 * fp.pi * fp.sqrt(2 * energy) * area
    rate = 2 * fp.pi * ((energy + 1) - (energy - 1)) * area / 2  # of the volume below H = E: a disk times A
    what = "n_cha/n_0 and n_cha/n_cha(t0) agree for any loop (nu from 0.1 to 0.9)"
    yield exact(what, p_nc * free, p_nc, ZERO, form="printed")
    what = "they agree when nu reaches 1, as in every loop of the paper"
    yield exact(
        what, theory.volumes_at(fp, scenes.load("moving-cap"), 0.0).v_ell, 0.0, ZERO, form="corrected"
    )
    what = "volume of H = E, E = 2, A = 1, as Liouville's measure: 2 pi sqrt(2E) A"
    yield exact(what, printed, rate, ZERO, form="printed")
    what = "2 pi A for every E: as V(D0) is defined, and all the paper's ratios need"
    yield exact(what, 2 * fp.pi * area, rate, ZERO, form="corrected")


CHECKS = {
    "M1": half_angle,
    "M2": signs,
    "M3": radius_squared,
    "M4": exponent_sign,
    "M10": cone,
    "M12": loop_plane,
    "M13": measures,
}
