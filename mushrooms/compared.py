"""Theory beside what a run has measured: m1 and p_nc, and how far off they are in standard errors."""

from __future__ import annotations

import math
from typing import Any

from mushrooms.store.asked import Asked
from mushrooms.store.tally import RunTally
from scene import Mushroom
from scene.refusal import BadInput

DIGITS = 10  # of the adiabatic theory: a run knows six at most


def measured(asked: Asked, tally: RunTally) -> dict[str, Any]:
    """Return m1 and p_nc as measured, as predicted, and the difference in standard errors (z).

    The prediction is that at the run's energy where rates of the scene's frozen tables are known. Elsewhere
    it is the limit of high energies, and without z: what that leaves out is not known. None is what nobody
    knows.
    """
    n, k = tally.gain.n, asked.n_cycles
    mean, error = (None if x is None else x / k for x in (tally.gain.mean, tally.gain.standard_error))
    has_island = isinstance(asked.scene, Mushroom)
    free = 1.0 - tally.captured / (n * k) if n and has_island else None
    found = _predicted(asked)
    m1, p_nc, is_at_energy = found or (None, None, False)
    spread = math.sqrt(p_nc * (1.0 - p_nc) / (n * k)) if p_nc and n else 0.0
    return {
        "m1": mean,
        "m1_se": error,
        "m1_theory": m1,
        "m1_z": _pull(mean, m1, error) if is_at_energy else None,
        "p_nc": free,
        "p_nc_theory": p_nc,
        "p_nc_z": _pull(free, p_nc, spread) if is_at_energy else None,
    }


def _pull(found: float | None, wanted: float | None, error: float | None) -> float | None:
    return round((found - wanted) / error, 3) if found is not None and wanted is not None and error else None


def _predicted(asked: Asked) -> tuple[float, float, bool] | None:
    """Return m1, p_nc and whether they are those at the run's energy; None where the theory covers nothing.

    What finite energy adds to a cycle goes as E^(-1/2) with the energy at which the cycle begins. Cycles are
    independent, so its mean falls by the mean of exp(-s / 2) each.
    """
    import theory

    if not isinstance(asked.scene, Mushroom):
        return None
    try:
        limit = theory.predict(asked.scene, DIGITS)
        m1, p_nc = float(limit.m1), float(limit.p_nc)
    except (BadInput, theory.NotCovered, theory.NotConverged):
        return None
    try:
        there = theory.at_energy(asked.scene, asked.energy)
        slower = there.mean_of_exp(-0.5)
    except (BadInput, theory.NotCovered, theory.NotConverged):
        return m1, p_nc, False
    share = math.fsum(slower**k for k in range(asked.n_cycles)) / asked.n_cycles
    return m1 + share * (there.mean_s - m1), p_nc + share * (there.p_nc - p_nc), True
