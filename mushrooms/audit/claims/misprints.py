"""Single formulas of the paper: misprints M1 to M4, M10, M12, M13; identities I and N.

A misprint's printed form must fail, and the corrected one hold, here and now: nothing is recorded.
I claims hold for every cycle by theory and are held against simulations; N claims are checks of
formulas against each other.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import mpmath
import numpy as np
from mpmath import fp

import scene as scenes
import theory
from mushrooms.audit.claim import DIGITS, Check, ClaimEvidence, Form
from mushrooms.audit.claims.finite_energy import Figure, captured_change, less_bias
from mushrooms.audit.runs import at_knots, scene_of
from mushrooms.audit.tolerances import close, exact, half_unit, mean, stated
from scene import State
from scene.geometry import table_at
from scene.tables import Mushroom

FORMS: tuple[Form, Form] = ("printed", "corrected")
ZERO = 1e-12  # float64 sums of a few hundred terms of order 10
N_HITS = 500
N_LOOP = 256  # the trapezoid rule converges geometrically on smooth periodic loops
NAMES = ("fixed-cap-anticlockwise", "fixed-cap-clockwise", "moving-cap", "moving-cap-reversed")
N_DRAWN_LOOPS = 6
INVERSE = Figure(
    "simulation", lambda s: mean(np.exp(-s.gain)), lambda f: f.mean_of_exp(-1), "mean_s"
)
SIMULATED = (
    "fixed-cap-anticlockwise@1e9",
    "fixed-cap-clockwise@1e9",
    "moving-cap@1e6",
    "moving-cap@1e7",
    "moving-cap-reversed@1e6",
)


def rounds(what: str, printed: str, value: Any, form: Form) -> Check:
    """Check that theory rounds to a printed number."""
    found = float(value)
    return Check(what, abs(found - float(printed)) <= half_unit(printed), printed, found, form=form)


def half_angle(evidence: ClaimEvidence) -> list[Check]:
    """M1: the mouth as printed, sin²(t), and with the half angle."""
    try:
        scenes.load("moving-cap-as-printed")
        message = "valid"
        is_valid = True
    except scenes.InvalidScene as error:
        message = str(error).partition(": ")[2]
        is_valid = False
    upright = Mushroom(  # valid, as its slope is 0: the loop can be solved
        r=scenes.Fourier(1.0, 1.0, (), (0.5,)),
        h=scenes.Fourier(1.0, 1.0, (), (-0.5,)),
        nu=scenes.Fourier(0.6, 1.0, (0.0, 0.4)),
    )
    as_printed = evidence.predict(upright)
    corrected = evidence.predict("moving-cap")
    return [
        stated(
            "sin²(t): the table is valid through the cycle",
            is_valid,
            message,
            "valid",
            form="printed",
        ),
        stated(
            "sin²(t), slope 0: energy grows",
            bool(as_printed.m1 > ZERO),
            f"m1 = {mpmath.nstr(as_printed.m1, 3)}: t and pi - t see the same r, h",
            "m1 > 0",
            form="printed",
        ),
        stated(
            "sin²(t/2): the table is valid",
            True,
            "valid, by exact algebra",
            "valid",
            form="corrected",
        ),
        rounds("sin²(t/2): m1", "0.122768", corrected.m1, "corrected"),
        rounds("sin²(t/2): p_nc", "0.38474", corrected.p_nc, "corrected"),
    ]


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
        yield stated(
            f"{label}: the loop runs clockwise, as the caption of the cycle's figure says",
            turn < 0,
            f"signed area {turn:+.4f}",
            "area < 0",
            form=form,
        )


def loop_area(name: str) -> float:
    """Return the signed area of a loop in the plane (V_ell/V_cap, V_cap/V).

    It is positive anticlockwise.
    """
    return signed_area(*volume_loop(scenes.load(name), N_LOOP))


def volume_loop(table: scenes.Scene, n: int) -> tuple[list[float], list[float]]:
    """Return V_ell/V_cap and V_cap/V at n even times of one cycle, the plane of sec. 3.5."""
    points = _volumes(table, n)
    return [v.v_ell / v.v_cap for v in points], [v.v_cap / (v.v_cap + v.v_stem) for v in points]


def _volumes(table: scenes.Scene, n: int) -> list[theory.Volumes]:
    return [theory.volumes_at(fp, table, table.period * k / n) for k in range(n)]


def signed_area(x: Sequence[float], y: Sequence[float]) -> float:
    """Return the area of a closed polygon by the shoelace formula, positive if anticlockwise."""
    n = len(x)
    return float(sum(x[k] * y[(k + 1) % n] - x[(k + 1) % n] * y[k] for k in range(n)) / 2)


def radius_squared(evidence: ClaimEvidence) -> Iterator[Check]:
    """M3: the half disk x² + y² <= r has an area ~ r, that of r² has r².

    E V_cap is kept by the captured.
    """
    sample = evidence.sample("moving-cap@1e7")
    r = scene_of(sample.run).laws["r"]
    first, last = (fp.log(r.value(fp, 2 * fp.pi * phase)) for phase in (7 / 16, 9 / 16))
    gain = captured_change(sample, 6, 8)
    # E is seen since the last hit, half a chord before on average, in which log r changes by u/v.
    band = 2 * float(r.bounds().slope) / sample.speed / abs(last - first)
    for power, form in zip((1, 2), FORMS, strict=True):
        bound = "r²" if power == 2 else "r"
        what = f"x² + y² <= {bound}: E goes as 1 / area of the cap, as r to the power"
        found = mean(-gain / (last - first))
        yield close(
            what,
            found,
            power,
            band=band,
            scale=0.5,
            form=form,
            against=(f"{3 - power}", 3.0 - power),
        )


def exponent_sign(evidence: ClaimEvidence) -> Iterator[Check]:
    """M4: exp(-∫ dV_ell/V_cha) and exp(+∫ dV_ell/V_cha) over the mouth's closing, sec. 4.1."""
    for name, paper in (
        ("fixed-cap-anticlockwise", "0.843472"),
        ("fixed-cap-clockwise", "0.717894"),
    ):
        w0, w1, h, _, slope = fixed_cap(name)
        with mpmath.workdps(DIGITS):
            integral = mpmath.quad(partial(capture_rate, h=h, slope=slope), [w0, w1])
            minus = mpmath.exp(-integral)
            plus = mpmath.exp(integral)
        theirs = evidence.predict(name).p_nc
        yield from [
            stated(
                f"exp(-∫), {name}: a probability",
                bool(minus <= 1),
                mpmath.nstr(minus, 8),
                "<= 1",
                form="printed",
            ),
            rounds(f"exp(-∫), {name}: p_nc", paper, minus, "printed"),
            rounds(f"exp(+∫), {name}: p_nc", paper, plus, "corrected"),
            exact(
                f"exp(+∫), {name}: eq. (ps)", plus, theirs, 10.0 ** (5 - DIGITS), form="corrected"
            ),
        ]


def fixed_cap(name: str) -> tuple[Any, Any, Any, Any, Any]:
    """Return w0, w1, h while the mouth closes and while it opens, and slope (sec. 4.1)."""
    laws = scenes.load(name).laws
    widths = at_knots(laws["w"])
    depths = at_knots(laws["h"])
    closing = next(i for i in range(len(widths) - 1) if widths[i + 1] < widths[i])
    opening = next(i for i in range(len(widths) - 1) if widths[i + 1] > widths[i])
    w1 = mpmath.mpf(widths[closing])
    w0 = mpmath.mpf(widths[closing + 1])
    h_closing = mpmath.mpf(depths[closing])
    h_opening = mpmath.mpf(depths[opening])
    return w0, w1, h_closing, h_opening, mpmath.mpf(laws["slope"].level)


# In the variable w, with r = 1 and h at rest, from the definitions of sec. 2. Theory integrates
# over time, so the two share nothing.


def capture_rate(w: Any, h: Any, slope: Any) -> Any:
    """Return dV_ell/dw over V_cha, from V_ell = 2 pi (acos w - w sqrt(1 - w²))."""
    return -4 * mpmath.pi * mpmath.sqrt(1 - w * w) / chaotic_volume(w, h, slope)


def chaotic_volume(w: Any, h: Any, slope: Any) -> Any:
    """Return V_cha."""
    pi = mpmath.pi
    v_ell = 2 * pi * (mpmath.acos(w) - w * mpmath.sqrt(1 - w * w))
    return pi * pi + 2 * pi * (2 * w * h - h * h * slope) - v_ell


def cone(evidence: ClaimEvidence) -> Iterator[Check]:
    """M10: which end the cone |x| <= w + y tan theta has.

    It is y = h as printed, or y = -h. The walls that particles meet tell.
    """
    table = scenes.load("frozen-mushroom")
    done = evidence.steppers.trajectory(table, State(0.0, 0.1, -0.2, 0.3, -1.0), N_HITS, fp.inf)
    now = table_at(fp, table, 0.0)
    x = done.steps[:, 2]
    y = done.steps[:, 3]
    at = {
        wall: np.array([met == wall for met in done.walls]) for wall in ("left", "right", "floor")
    }
    sides = at["left"] | at["right"]
    floor = at["floor"]
    lowest = float(y.min())
    for end, form in zip((now.h, -now.h), FORMS, strict=True):
        label = "y = h" if end > 0 else "y = -h"
        yield exact(
            f"{label}: the end of the cone, met {floor.sum()} times, is at y",
            float(y[floor].mean()),
            end,
            ZERO * now.h,
            form=form,
        )
        within = np.all((y[sides] - min(end, 0)) * (max(end, 0) - y[sides]) >= 0)
        yield stated(
            f"{label}: its sides are met between there and the mouth only",
            bool(within),
            f"y from {lowest:.4f}",
            "all of them",
            form=form,
        )
    off = np.abs(np.abs(x[sides]) - now.half_width(y[sides])).max()
    yield exact(
        "its sides are met where |x| = w + y tan theta",
        float(off),
        0,
        ZERO * now.w,
        form="corrected",
    )


def loop_plane(evidence: ClaimEvidence) -> Iterator[Check]:
    """M12: area of the loop a = b = 0.5 in the summary's plane and in that of sec. 3.5."""
    table = scenes.load("moving-cap-trivial")
    share, part = volume_loop(table, N_LOOP)
    summary = signed_area(share, [v.v_cha for v in _volumes(table, N_LOOP)])
    section = signed_area(share, part)
    result = evidence.predict("moving-cap-trivial")
    grows = abs(result.m1) > ZERO
    m1 = f"m1 = {mpmath.nstr(result.m1, 3)}, p_nc = {mpmath.nstr(result.p_nc, 6)}"
    yield from [
        stated(
            "plane (V_cha, flux): an area means growth",
            (abs(summary) > ZERO) == grows,
            f"area {summary:.4g}, yet {m1}",
            "area and growth, or neither",
            form="printed",
        ),
        stated(
            "plane (V_ell/V_cap, V_cap/V): no area, and no growth",
            abs(section) <= ZERO and not grows,
            f"area {section:.1g}, {m1}",
            "neither",
            form="corrected",
        ),
    ]
    for name in ("moving-cap", "fixed-cap-anticlockwise"):
        turn = loop_area(name)
        found = evidence.predict(name)
        yield stated(
            f"plane (V_ell/V_cap, V_cap/V): {name} has an area, and growth",
            abs(turn) > ZERO and found.m1 > 0,
            f"area {turn:.4f}, m1 = {mpmath.nstr(found.m1, 6)}",
            "both",
            form="corrected",
        )


def measures(evidence: ClaimEvidence) -> list[Check]:
    """M13: whose share p_cha is, and which volume the set H = E has."""
    table = Mushroom(
        r=1.0, h=scenes.Fourier(1.0, 1.0, (), (0.5,)), nu=scenes.Fourier(0.5, 1.0, (0.4,))
    )
    start = theory.volumes_at(fp, table, 0.0)  # nu = 0.9 at most: an island remains
    p_nc = float(evidence.predict(table).p_nc)
    free = start.v_cha / (start.v_cap + start.v_stem)
    energy = 2.0
    area = 1.0
    printed = 2 * fp.pi * fp.sqrt(2 * energy) * area
    # Of the volume below H = E: a disk times A.
    rate = 2 * fp.pi * ((energy + 1) - (energy - 1)) * area / 2
    return [
        exact(
            "n_cha/n_0 and n_cha/n_cha(t0) agree for any loop (nu from 0.1 to 0.9)",
            p_nc * free,
            p_nc,
            ZERO,
            form="printed",
        ),
        exact(
            "they agree when nu reaches 1, as in every loop of the paper",
            theory.volumes_at(fp, scenes.load("moving-cap"), 0.0).v_ell,
            0.0,
            ZERO,
            form="corrected",
        ),
        exact(
            "volume of H = E, E = 2, A = 1, as Liouville's measure: 2 pi sqrt(2E) A",
            printed,
            rate,
            ZERO,
            form="printed",
        ),
        exact(
            "2 pi A for every E: as V(D0) is defined, and all the paper's ratios need",
            2 * fp.pi * area,
            rate,
            ZERO,
            form="corrected",
        ),
    ]


def mean_exp_minus(evidence: ClaimEvidence) -> list[Check]:
    """I1: the mean of E0/E1 is 1."""
    return [
        *(
            exact(f"{name}: theory", evidence.predict(name).mean_exp_minus, 1, 10.0 ** (2 - DIGITS))
            for name in NAMES
        ),
        *(less_bias(INVERSE, evidence.sample(run), 1.0) for run in SIMULATED),
    ]


def equivalent_forms(evidence: ClaimEvidence) -> list[Check]:
    """N1: eq. (Erate) is the mean of eq. (lnE/E0) over eq. (ps)."""
    return [
        exact(
            f"{name}: mean of eq. (lnE/E0)",
            theory.mean_of(scenes.load(name), lambda s: s, 20),
            evidence.predict(name).m1,
            1e-18,
        )
        for name in NAMES
    ]


def formulas_in_w(evidence: ClaimEvidence) -> Iterator[Check]:
    """N2: sec. 4.1's integrals over w, by a quadrature of their own."""
    printed = {
        "fixed-cap-anticlockwise": ("0.044926", "0.161205"),
        "fixed-cap-clockwise": ("0.05252", "-0.161205"),
    }
    for name, (m1, log_e_nc) in printed.items():
        with mpmath.workdps(20):
            total, peak = _over_w(*fixed_cap(name))
        theirs = evidence.predict(name)
        yield from [
            exact(f"{name}: growth rate, integral over w", total, theirs.m1, 1e-10),
            rounds(f"{name}: printed growth rate", m1, total, "claim"),
            exact(f"{name}: eq. (Enoncapt)", peak, theirs.log_e_nc, 1e-15),
            rounds(f"{name}: printed log E_nc/E0", log_e_nc, peak, "claim"),
        ]


def _over_w(w0: Any, w1: Any, h_in: Any, h_out: Any, slope: Any) -> tuple[Any, Any]:
    """Return the integral of (g - 1 - log g) dp_cha(w), and that of eq. (Enoncapt).

    p_cha rises with w.
    """
    rate, rate_out = (partial(capture_rate, h=h, slope=slope) for h in (h_in, h_out))

    def growth(w: Any) -> Any:
        g = chaotic_volume(w, h_in, slope) / chaotic_volume(w, h_out, slope)
        p = mpmath.exp(mpmath.quad(rate, [w, w1]))
        return (mpmath.log(g) + 1 - g) * rate(w) * p

    total = mpmath.quad(growth, [w0, w1], maxdegree=5)
    return total, mpmath.quad(lambda w: rate(w) - rate_out(w), [w0, w1])


def positivity(evidence: ClaimEvidence) -> Iterator[Check]:
    """N3: m1 >= 0 for any cycle, several captures included."""
    random = np.random.default_rng(evidence.seed)
    least = np.inf
    n_nested = 0
    for k in range(N_DRAWN_LOOPS):
        a, b = random.uniform(-0.3, 0.3, 2)
        second = 0.12 * (k % 2)  # a second harmonic gives nu two wells
        table = Mushroom(
            r=scenes.Fourier(1.0, 1.0, (), (float(a),)),
            h=scenes.Fourier(1.0, 1.0, (float(random.uniform(-0.3, 0.3)),), (float(b),)),
            nu=scenes.Fourier(0.55, 1.0, (0.25,), (0.0, second))
            if not second
            else scenes.Fourier(0.5, 1.0, (0.1, 0.25), (0.0, 0.1)),
            slope=0.1,
        )
        scenes.from_data(scenes.to_data(table))
        n_nested += bool(theory.Cycle.of(table, 15).well.children)
        least = min(least, float(theory.predict(table, 12).m1))
    yield stated(
        f"m1 > 0 in {N_DRAWN_LOOPS} random loops, {n_nested} of them with several captures",
        least > 0,
        f"least m1 = {least:.3g}",
        "> 0",
    )


def reversal(evidence: ClaimEvidence) -> Iterator[Check]:
    """N4: reversed cycles weigh the forward ones by exp(-s)."""
    size = 1e-20
    for name in ("moving-cap", "fixed-cap-anticlockwise"):
        forward = evidence.predict(name)
        backward = evidence.predict(theory.reversed_cycle(scenes.load(name)))
        weighted = -theory.mean_of(scenes.load(name), lambda s: s * s.context.exp(-s), 22)
        yield from [
            exact(f"{name}: log E_nc flips", backward.log_e_nc, -forward.log_e_nc, size),
            exact(
                f"{name}: p_nc of the reverse is p_nc exp(-s_nc)",
                backward.p_nc,
                forward.p_nc * mpmath.exp(-forward.log_e_nc),
                1e-14,
            ),
            exact(f"{name}: m1 of the reverse is -mean of s exp(-s)", backward.m1, weighted, size),
        ]


def right_mode(_evidence: ClaimEvidence) -> list[Check]:
    """N5: the largest gain, where the density of s has its caustic."""
    gain = theory.largest_gain(scenes.load("moving-cap"))
    caustic = theory.caustics(scenes.load("moving-cap"))
    assert gain is not None
    return [
        exact("largest log E1/E0", gain[1], 0.846126, 5e-7),
        exact("its capture time", gain[0], 1.24757, 5e-6),
        stated(
            "one caustic, there",
            len(caustic) == 1 and abs(float(caustic[0].s) - gain[1]) < 1e-12,
            f"s = {float(caustic[0].s):.9f}" if caustic else "none",
            "s of the largest gain",
        ),
    ]


def orientations(_evidence: ClaimEvidence) -> Iterator[Check]:
    """N6: the sense of sec. 4.1's loops in the plane (w, h), as eq. (cycle) and its reverse say."""
    for name, sign in (("fixed-cap-anticlockwise", 1), ("fixed-cap-clockwise", -1)):
        moving = scenes.load(name).laws
        w, h = (at_knots(moving[of])[:-1] for of in ("w", "h"))
        area = signed_area(w, h)
        yield stated(
            f"{name} in the plane (w, h)", area * sign > 0, f"area {area:+.3f}", f"sign {sign:+d}"
        )
    yield stated(
        "moving-cap in the plane (V_ell/V_cap, V_cap/V): clockwise",
        loop_area("moving-cap") < 0,
        f"area {loop_area('moving-cap'):+.4f}",
        "area < 0",
    )


CHECKS = {
    "M1": half_angle,
    "M2": signs,
    "M3": radius_squared,
    "M4": exponent_sign,
    "M10": cone,
    "M12": loop_plane,
    "M13": measures,
    "I1": mean_exp_minus,
    "N1": equivalent_forms,
    "N2": formulas_in_w,
    "N3": positivity,
    "N4": reversal,
    "N5": right_mode,
    "N6": orientations,
}
