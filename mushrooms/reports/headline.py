"""The first screen of the audit: the paper's main numbers as printed, as predicted and as simulated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from conformance.audit.claims.broadened import adiabatic_limit, predicted
from conformance.audit.runs import Sample
from conformance.audit.tolerances import Mean, mean, share

M1, P_NC = "mean of log E1/E0", "share never captured"
# Run, what is measured of it, and what the paper prints: its simulation, and its theory.
MAIN = (
    ("fixed-cap-anticlockwise@1e9", M1, "0.0463 ± 0.0027", "0.044926"),
    ("fixed-cap-anticlockwise@1e9", P_NC, "", "0.843472"),
    ("fixed-cap-clockwise@1e9", M1, "0.0537 ± 0.0034", "0.05252"),
    ("fixed-cap-clockwise@1e9", P_NC, "", "0.717894"),
    ("moving-cap@1e7", M1, "0.1213 ± 0.0033", "0.122768"),
    ("moving-cap@1e7", P_NC, "0.3878", "0.38474"),
)


class Headline(NamedTuple):
    """A row of the first screen.

    Attributes:
        run: whose number it is.
        quantity: in words.
        simulated_there: by the paper, as printed; empty where it prints none.
        theory_there: the limit of infinite energy, as printed.
        limit: the same by our theory.
        predicted: by our theory at the run's energy, with nothing fitted.
        found: by our simulation, with its standard error.
        pull: found less predicted, in standard errors.
    """

    run: str
    quantity: str
    simulated_there: str
    theory_there: str
    limit: float
    predicted: float
    found: Mean
    pull: float


def headline(samples: Mapping[str, Sample]) -> list[Headline]:
    """Return the rows of the runs that there are."""
    return [_row(samples[run], *printed) for run, *printed in MAIN if run in samples]


def _row(sample: Sample, quantity: str, simulated_there: str, theory_there: str) -> Headline:
    limit, here = adiabatic_limit(sample.run), predicted(sample)
    if quantity == M1:
        value, expected, found = float(limit.m1), here.mean_s, mean(sample.gain)
    else:
        value, expected, found = float(limit.p_nc), here.p_nc, share(sample.never_captured)
    pull = (found.value - expected) / found.error
    return Headline(sample.run.name, quantity, simulated_there, theory_there, value, expected, found, pull)
