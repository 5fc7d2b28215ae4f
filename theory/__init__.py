"""The paper's closed forms and quadratures, at any precision."""

from theory.adiabatic import NotConverged
from theory.curves import (
    CaptureCurve,
    ChaoticZone,
    capture_curve,
    capture_time_mass,
    chaotic_zone,
    energy_density,
    largest_gain,
)
from theory.cycle import Cycle
from theory.invariants import (
    cap_invariant,
    energy,
    log_energy_rate_chaotic,
    log_energy_rate_island,
    sin_phi_hat,
)
from theory.prediction import Prediction, mean_of, predict
from theory.volumes import NotCovered, Volumes, delta, v_cap, v_cha, v_ell, v_stem, volumes_at

__all__ = [
    "CaptureCurve",
    "ChaoticZone",
    "Cycle",
    "NotConverged",
    "NotCovered",
    "Prediction",
    "Volumes",
    "cap_invariant",
    "capture_curve",
    "capture_time_mass",
    "chaotic_zone",
    "delta",
    "energy",
    "energy_density",
    "largest_gain",
    "log_energy_rate_chaotic",
    "log_energy_rate_island",
    "mean_of",
    "predict",
    "sin_phi_hat",
    "v_cap",
    "v_cha",
    "v_ell",
    "v_stem",
    "volumes_at",
]
