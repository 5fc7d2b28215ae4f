"""What the audit checks beyond the paper's numbers: identities, formulas against each other.

I claims hold for every cycle by theory and are held against simulations; N claims are checks of
single formulas of the paper.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mpmath
import numpy as np

import scene as scenes
import theory
from conformance.audit.claim import DIGITS, Check, ClaimEvidence
from conformance.audit.claims.broadened import Figure, less_bias
from conformance.audit.claims.finite_energy import ACW, CW
from conformance.audit.claims.misprints import (
    chaotic_volume,
    fixed_cap,
    island_slope,
    loop_area,
    rounds,
    signed_area,
)
from conformance.audit.tolerances import exact, mean, stated
from scene.tables import Mushroom, laws

NAMES = ("fixed-cap-anticlockwise", "fixed-cap-clockwise", "moving-cap", "moving-cap-reversed")
N_LOOPS = 6
INVERSE = Figure("simulation", lambda s: mean(np.exp(-s.gain)), lambda f: f.mean_of_exp(-1), "mean_s")
SIMULATED = (ACW, CW, "moving-cap@1e6", "moving-cap@1e7", "moving-cap-reversed@1e6", "untilted@1e6")


def mean_exp_minus(evidence: ClaimEvidence) -> list[Check]:
    """I1: the mean of E0/E1 is 1."""
    return [
        *(
            exact(f"{name}: theory", evidence.predict(name).mean_exp_minus, 1, 10.0 ** (2 - DIGITS))
            for name in NAMES
        ),
        *(less_bias(INVERSE, evidence.sample(run), 1.0) for run in SIMULATED[:-1]),
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
        table = scenes.load(name)
        w0, w1, h_in, h_out = fixed_cap(table)
        with mpmath.workdps(20):
            total, peak = _over_w(w0, w1, h_in, h_out, mpmath.mpf(laws(table)["slope"]))
        theirs = evidence.predict(name)
        yield from [
            exact(f"{name}: growth rate, integral over w", total, theirs.m1, 1e-10),
            rounds(f"{name}: printed growth rate", m1, total, "claim"),
            exact(f"{name}: eq. (Enoncapt)", peak, theirs.log_e_nc, 1e-15),
            rounds(f"{name}: printed log E_nc/E0", log_e_nc, peak, "claim"),
        ]


def _over_w(w0: Any, w1: Any, h_in: Any, h_out: Any, slope: Any) -> tuple[Any, Any]:
    """Return the integral of (g - 1 - log g) dp_cha(w), p_cha rising with w, and that of eq. (Enoncapt)."""

    def rate(w: Any, h: Any = h_in) -> Any:
        return island_slope(w) / chaotic_volume(w, h, slope)

    def growth(w: Any) -> Any:
        g = chaotic_volume(w, h_in, slope) / chaotic_volume(w, h_out, slope)
        p = mpmath.exp(mpmath.quad(rate, [w, w1]))
        return (mpmath.log(g) + 1 - g) * rate(w) * p

    total = mpmath.quad(growth, [w0, w1], maxdegree=5)
    return total, mpmath.quad(lambda w: rate(w) - rate(w, h_out), [w0, w1])


def positivity(evidence: ClaimEvidence) -> Iterator[Check]:
    """N3: m1 >= 0 for any cycle, several captures included."""
    random = np.random.default_rng(evidence.seed)
    least, n_nested = np.inf, 0
    for k in range(N_LOOPS):
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
        f"m1 > 0 in {N_LOOPS} random loops, {n_nested} of them with several captures",
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
        moving = laws(scenes.load(name))
        w, h = ([v for _, v in moving[of].knots[:-1]] for of in ("w", "h"))  # type: ignore[union-attr]
        area = signed_area(w, h)
        yield stated(f"{name} in the plane (w, h)", area * sign > 0, f"area {area:+.3f}", f"sign {sign:+d}")
    yield stated(
        "moving-cap in the plane (V_ell/V_cap, V_cap/V): clockwise",
        loop_area("moving-cap") < 0,
        f"area {loop_area('moving-cap'):+.4f}",
        "area < 0",
    )


CHECKS = {
    "I1": mean_exp_minus,
    "N1": equivalent_forms,
    "N2": formulas_in_w,
    "N3": positivity,
    "N4": reversal,
    "N5": right_mode,
    "N6": orientations,
}
