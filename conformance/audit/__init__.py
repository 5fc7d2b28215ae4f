"""The audit: claims checked against theory and simulation, one finding with a verdict each.

Ensembles come from a `simulate` callable (that of `fast`, or any other stepper's), predictions
from `theory`. A measured value is accepted within four standard errors plus the finite-energy
band that its claim states; the printed value must be what theory rounds to. Misprints evaluate
the printed form, which must fail, and the corrected one, which must hold.

Not handled here: how results scale with energy, many cycles, and whole distributions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import mpmath
import numpy as np
import numpy.typing as npt

import scene as scenes
import theory
from conformance.audit_forms import FORMS, Forms, Predict, rounds_to
from conformance.claims import CLAIMS, ENERGIES, Claim, Verdict
from scene.laws import bounds
from scene.refusal import BadInput
from scene.tables import laws, width_factors

if TYPE_CHECKING:
    from fast import Ensemble

Simulate = Callable[..., "Ensemble"]
FloatArray = npt.NDArray[np.float64]

N_SIGMA = 4.0  # a true claim fails by chance once in 16,000
MAX_LOST = 1e-3  # a larger unfollowed share could hide a bias as large as the errors themselves
MIN_PARTICLES = 2000  # below, 4 standard errors no longer tell m1 of the fixed cap from 0
DIGITS = 30


class Measured(NamedTuple):
    """A value with its standard error and the finite-energy band it is accepted within."""

    value: float
    error: float
    band: float

    def accepts(self, truth: float) -> bool:
        """Tell whether `truth` lies within four standard errors plus the band (nan never does)."""
        return bool(abs(self.value - truth) <= self.reach)

    @property
    def reach(self) -> float:
        """Return four standard errors plus the band."""
        return N_SIGMA * self.error + self.band


class Sample(NamedTuple):
    """What one ensemble says about s = log E1/E0.

    `s` and `captured` hold the n particles followed to the end; `sigma_w` is the adiabatic width,
    1.4826 times the median absolute deviation of s over the particles never captured.
    """

    n_particles: int
    n_undecided: int
    n_undefined: int
    n_collisions: int
    s: FloatArray
    captured: npt.NDArray[np.bool_]
    sigma_w: float
    quantities: dict[str, Measured]

    @property
    def is_whole(self) -> bool:
        """Tell whether the unfollowed share is too small to matter."""
        return len(self.s) > (1 - MAX_LOST) * self.n_particles


class Finding(NamedTuple):
    """The verdict on one claim; `error` is one standard error, numbers are None where none apply."""

    id: str
    claim: str
    paper: str
    theory: str
    simulation: float | None
    error: float | None
    band: float | None
    verdict: Verdict
    expected: Verdict
    note: str

    @property
    def is_as_expected(self) -> bool:
        """Tell whether the verdict is the one the ledger expects."""
        return self.verdict == self.expected


def measure(scene: scenes.Scene, ensemble: Ensemble) -> Sample:
    """Reduce a one-cycle ensemble to the quantities that claims are about.

    Args:
        scene: the table the ensemble ran in.
        ensemble: N particles of one initial energy; those not followed to the end are left out.

    Source: eqs. (Erate), (ps), (lnEnc/E0) of the paper.
    """
    followed = (ensemble.outcome == 0) & np.isfinite(ensemble.energy) & (ensemble.energy > 0)
    s = np.log(ensemble.energy[followed] / ensemble.energy0)
    captured = ~np.isnan(ensemble.t_in[followed]).reshape(len(s), -1)[:, -1]
    kept = np.sort(s[~captured])
    centre = _median(kept)
    sigma_w = 1.4826 * _median(np.sort(np.abs(kept - centre)))
    drift = sigma_w**2 / 4
    n = len(s)
    share = (len(kept) + 2) / (n + 4)  # never 0 or 1, so that the standard error is never 0
    quantities = {
        "m1": Measured(*_mean(s), drift),
        "p_nc": Measured(
            len(kept) / n if n else np.nan,
            float(np.sqrt(share * (1 - share) / (n + 4))),
            2 * _mouth_speed(scene) / np.sqrt(2 * ensemble.energy0),
        ),
        "log_e_nc": Measured(centre, _median_error(kept), sigma_w**2 * float(0.5 - np.log(share))),
        "mean_exp_minus": Measured(*_mean(np.exp(-s)), drift),
    }
    return Sample(
        len(ensemble.energy),
        int(np.sum(ensemble.outcome == 1)),
        int(np.sum(ensemble.outcome == 2)),
        int(np.sum(ensemble.n_collisions)),
        s,
        captured,
        sigma_w,
        quantities,
    )


def _mean(values: FloatArray) -> tuple[float, float]:
    if len(values) < 2:
        return np.nan, np.nan
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))


def _median(ordered: FloatArray) -> float:
    return float(np.median(ordered)) if len(ordered) else np.nan


def _median_error(ordered: FloatArray) -> float:
    # Half the spread of the order statistics one binomial deviation to either side: no shape assumed.
    n = len(ordered)
    if n < 4:
        return np.nan
    low, high = int((n - np.sqrt(n)) / 2), min(int(np.ceil((n + np.sqrt(n)) / 2)), n - 1)
    return float(ordered[high] - ordered[low]) / 2


def _mouth_speed(scene: scenes.Scene) -> float:
    # Capture is decided by w/r alone, so the floor's speed does not count.
    if not isinstance(scene, scenes.Mushroom):
        return 0.0
    factors = [bounds(law) for law in width_factors(scene)]
    mouth = sum(
        factor.slope * np.prod([other.highest for other in factors if other is not factor])
        for factor in factors
    )
    return float(max(bounds(laws(scene)["r"]).slope, mouth))


def run_ensembles(
    simulate: Simulate,
    *,
    n_particles: int,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[str, int], None] | None = None,
) -> dict[str, Ensemble]:
    """Simulate one cycle of every scene the ledger measures; scene number k uses seed + k.

    Raises:
        BadInput: naming the number that is out of bounds.
    """
    if n_particles < MIN_PARTICLES:
        raise BadInput(f"particles = {n_particles}, must be >= {MIN_PARTICLES} for an audit")
    ensembles = {}
    for k, (name, energy) in enumerate(ENERGIES.items()):
        report = None if progress is None else (lambda done, name=name: progress(name, done))
        ensembles[name] = simulate(
            scenes.load(name),
            n_particles=n_particles,
            energy=energy,
            seed=(seed + k) % 2**64,
            threads=threads,
            progress=report,
        )
    return ensembles


def examine(
    samples: Mapping[str, Sample], *, claims: tuple[Claim, ...] = CLAIMS, predict: Predict = theory.predict
) -> list[Finding]:
    """Check every claim.

    Args:
        samples: `measure` of each scene in ENERGIES, by name.
        claims: the ledger, or part of it.
        predict: theory, or a wrong one that must be found out.

    Returns:
        One finding per claim, in the ledger's order.
    """
    predict = cache(predict)  # claims share scenes; a prediction to 30 digits takes about a second
    findings = []
    for claim in claims:
        if claim.quantity:
            prediction = getattr(predict(scenes.load(claim.scene), DIGITS), claim.quantity)
            findings.append(compare(claim, samples[claim.scene], prediction))
        elif claim.relation:
            findings.append(_relate(claim, samples, predict))
        else:
            findings.append(_judge(claim, FORMS[claim.forms](predict)))
    return findings


def compare(claim: Claim, sample: Sample, prediction: Any) -> Finding:
    """Compare one measured quantity with its prediction (an mpf), and that with the printed digits."""
    assert claim.quantity is not None
    measured = sample.quantities[claim.quantity]
    is_met = measured.accepts(float(prediction))
    is_printed = not claim.paper or rounds_to(claim.paper, prediction)
    note = "simulation agrees with theory" if is_met else "simulation contradicts theory"
    if claim.paper:
        note += (
            "; theory rounds to the printed value" if is_printed else "; theory contradicts the printed value"
        )
    verdict: Verdict = "confirmed" if is_met and is_printed else "refuted"
    if measured.band >= abs(prediction) / 2:
        verdict, note = "indeterminate", "the band is half the value or more: energy too low to tell"
    return _finding(claim, mpmath.nstr(prediction, 12), measured, verdict, note, [sample])


def _relate(claim: Claim, samples: Mapping[str, Sample], predict: Predict) -> Finding:
    names = ("fixed-cap-anticlockwise", "fixed-cap-clockwise")
    used = [samples[name] for name in names]
    predictions = [predict(scenes.load(name), DIGITS) for name in names]
    verdict: Verdict
    if claim.relation == "flip":
        a, b = (sample.quantities["log_e_nc"] for sample in used)
        measured = Measured(a.value + b.value, float(np.hypot(a.error, b.error)), a.band + b.band)
        total = predictions[0].log_e_nc + predictions[1].log_e_nc
        verdict = "confirmed" if measured.accepts(0.0) and a.value * b.value < 0 and total == 0 else "refuted"
        if measured.band >= abs(predictions[0].log_e_nc):  # half of the sum of two peaks on one side
            verdict = "indeterminate"
        expectation = mpmath.nstr(total, 3)
        note = f"peaks at {a.value:+.6f} and {b.value:+.6f}"
    else:
        measured = min((sample.quantities["m1"] for sample in used), key=lambda m1: m1.value - m1.reach)
        least = min(prediction.m1 for prediction in predictions)
        verdict = "confirmed" if measured.value > measured.reach else "indeterminate"
        if measured.value < -measured.reach or least <= 0:
            verdict = "refuted"
        expectation = mpmath.nstr(least, 12)
        note = "growth " + " and ".join(f"{sample.quantities['m1'].value:+.6f}" for sample in used)
    return _finding(claim, expectation, measured, verdict, note, used)


def _judge(claim: Claim, forms: Forms) -> Finding:
    verdict: Verdict = "refuted"
    if forms.printed_holds:
        verdict = "confirmed"
    elif forms.corrected_holds:
        verdict = "misprint"
    note = f"as printed: {forms.printed}; corrected: {forms.corrected}"
    return _finding(claim, forms.value, None, verdict, note, [])


def _finding(
    claim: Claim, expectation: str, measured: Measured | None, verdict: Verdict, note: str, used: list[Sample]
) -> Finding:
    n_lost = sum(sample.n_particles - len(sample.s) for sample in used)
    if n_lost:
        note += f"; {n_lost} particles not followed to the end are left out"
    if not all(sample.is_whole for sample in used):
        verdict = "indeterminate"
    value, error, band = measured or (None, None, None)
    return Finding(
        claim.id, claim.statement, claim.paper, expectation, value, error, band, verdict, claim.expected, note
    )
