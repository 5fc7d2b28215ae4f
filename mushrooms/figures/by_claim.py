"""Which figure belongs to which claim of the report, and which simulations it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from matplotlib import rc_context
from matplotlib.figure import Figure

from conformance.audit.claims.finite_energy import ACW, CW, ERGODIC, LADDER
from conformance.audit.runs import Sample
from mushrooms.figures import cycles, scaling
from mushrooms.figures.style import STYLE

Samples = Mapping[str, Sample]
MAIN_RUN, MANY_CYCLES, MANY_SLOWER = "moving-cap@1e7", "moving-cap@1e7x30", "moving-cap@1e5x30"


class Picture(NamedTuple):
    """A figure of the report.

    Attributes:
        claim: the claims's id below which it stands.
        caption: what it shows.
        draw: makes it from the samples by run.
        needs: runs it cannot do without.
    """

    claim: str
    caption: str
    draw: Callable[[Samples], Figure]
    needs: tuple[str, ...] = ()


def _sums(samples: Samples) -> Figure:
    run = MANY_CYCLES if MANY_CYCLES in samples else MANY_SLOWER
    return cycles.sums([(samples[run], 10), (samples[run], 30)])


def _there(samples: Samples, *names: str) -> list[Sample]:
    return [samples[name] for name in names if name in samples]


ALL = (
    Picture(
        "M2",
        "The cycles, with the direction of time; colours mark the phase. Left: the plane of eq. "
        "(cycle). Middle and right: the plane of sec. 3.5, in which energy grows when the loop bounds"
        " an area (M12). The moving cap's runs clockwise, as its caption in the paper says.",
        lambda _: cycles.loops(),
    ),
    Picture(
        "N5",
        "Theory: what a particle captured at t_in has gained after the cycle.",
        lambda _: cycles.gain_of_capture(),
    ),
    Picture(
        "M7",
        "Width of the uncaptured peak against energy, with fitted powers, and the power as printed. "
        "Error bars are smaller than the marks.",
        lambda s: scaling.widths(_there(s, *LADDER[3:6]), _there(s, *ERGODIC[1:])),
        (*LADDER[3:6], *ERGODIC[1:]),
    ),
    Picture(
        "M9",
        "How the moving cap's means approach the theory as E0 grows. The mean of exp(-s/2), right, "
        "has no bias of order E0^(-1/2).",
        lambda s: scaling.convergence(_there(s, *LADDER)),
        LADDER[:6],
    ),
    Picture(
        "X1",
        "Energies after one cycle, fixed cap. In theory (orange) the never captured share one energy,"
        " dashed; black: the theory at this energy, with diffusion and lags from frozen tables and nothing "
        "fitted.",
        lambda s: cycles.energies(_there(s, ACW, CW)),
        (ACW, CW),
    ),
    Picture(
        "X2",
        "Energies after one cycle, moving cap; as above. The orange density is infinite at its right "
        "end, the caustic of N5.",
        lambda s: cycles.energies(_there(s, "moving-cap@1e6", MAIN_RUN)),
        ("moving-cap@1e6", MAIN_RUN),
    ),
    Picture(
        "X3",
        "When particles are captured. The area is the captured share.",
        lambda s: cycles.capture_times(_there(s, MAIN_RUN, ACW, CW)),
        (MAIN_RUN, ACW, CW),
    ),
    Picture(
        "X4",
        "Many cycles: the centre and, on a logarithmic axis, the tails, with sums drawn from the theory at "
        "this energy.",
        _sums,
        (MANY_SLOWER,),
    ),
    Picture("X5", "c = 0: one narrow peak.", lambda s: cycles.energies([s["ergodic@1e7"]]), ("ergodic@1e7",)),
    Picture(
        "X6",
        "Tilted and upright stem: energies of the never captured, each counted from its own theory's "
        "log E_nc. Parabolic orbits between the upright sides spread them far.",
        lambda s: cycles.stems(s["moving-cap@1e6"], s["untilted@1e6"]),
        ("moving-cap@1e6", "untilted@1e6"),
    ),
    Picture(
        "X7",
        "A loop without an interior that accelerates. Left: one parameter moves along the arc and back; "
        "captures (blue) and their releases (orange), at the same V_ell/V_cap, lie at different V_cap/V. "
        "Right: energies after one cycle, as in X1.",
        lambda s: cycles.retraced(s["retraced-arc@1e6"]),
        ("retraced-arc@1e6",),
    ),
    Picture(
        "D1",
        "How rare it is to end with less energy: the probability falls as exp(-n I).",
        lambda s: cycles.losses(s[MANY_SLOWER]),
        (MANY_SLOWER,),
    ),
    Picture(
        "L3",
        "The frozen mushroom: orbits in the island (blue) and in the chaotic zone (orange).",
        lambda _: scaling.frozen(),
    ),
    Picture(
        "L4",
        "Release: how far nu at release is from nu at capture, against 1/v (grey: single particles), "
        "and its distribution in units of 1/v.",
        lambda s: scaling.release(_there(s, *LADDER[1:6])),
        LADDER[1:6],
    ),
    Picture(
        "L5",
        "Through the cycle: mean log E of the particles not captured so far, and the share of "
        "particles in the chaotic zone (L6).",
        lambda s: scaling.zone(_there(s, MAIN_RUN, ACW)),
        (MAIN_RUN, ACW),
    ),
)


def drawn(claims: list[str], samples: Samples) -> list[tuple[Picture, Figure]]:
    """Draw the figures of these claims whose simulations are there."""
    found = []
    for picture in ALL:
        if picture.claim in claims and all(name in samples for name in picture.needs):
            with rc_context(STYLE):
                found.append((picture, picture.draw(samples)))
    return found
