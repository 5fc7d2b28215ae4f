"""The paper's closed forms and quadratures, at any precision.

`volumes` has the formulas for volumes of phase space, and refuses scenes that theory does not cover.
`cycle` computes when particles are captured and released, `adiabatic` how their energy changes, and
`prediction` the figures of one cycle. `branches` has its curves, `density` and `distribution` the energies
after one cycle, `distribution` those after many cycles too. `finite_energy` goes beyond the paper.
"""

from theory.adiabatic import NotConverged
from theory.branches import (
    CaptureCurve,
    ChaoticZone,
    capture_curve,
    capture_time_mass,
    chaotic_zone,
    largest_gain,
)
from theory.cycle import Cycle
from theory.density import Caustic, capture_rate_at, caustics, cdf_at, density_at
from theory.distribution import (
    Energies,
    Rarity,
    Sum,
    energies,
    energy_cdf,
    energy_density,
    loss_probability,
    rarity,
    sum_of_cycles,
)
from theory.finite_energy.fits import (
    Limit,
    PowerFit,
    extrapolate,
    fit_power,
    unbiased_mean,
)
from theory.finite_energy.one_cycle import FiniteEnergy, at_energy
from theory.finite_energy.rates import Rates, frozen_rates
from theory.finite_energy.upright import is_upright, kept_by_the_cap, upright_rate, upright_spread
from theory.prediction import Prediction, cumulants, mean_of, moments, predict, reversed_cycle
from theory.prepared import NotCovered
from theory.volumes import (
    Volumes,
    cap_invariant,
    delta,
    energy,
    log_energy_rate_chaotic,
    log_energy_rate_island,
    sin_phi_hat,
    v_cap,
    v_cha,
    v_ell,
    v_stem,
    volumes_at,
)

__all__ = [
    "CaptureCurve",
    "Caustic",
    "ChaoticZone",
    "Cycle",
    "Energies",
    "FiniteEnergy",
    "Limit",
    "NotConverged",
    "NotCovered",
    "PowerFit",
    "Prediction",
    "Rarity",
    "Rates",
    "Sum",
    "Volumes",
    "at_energy",
    "cap_invariant",
    "capture_curve",
    "capture_rate_at",
    "capture_time_mass",
    "caustics",
    "cdf_at",
    "chaotic_zone",
    "cumulants",
    "delta",
    "density_at",
    "energies",
    "energy",
    "energy_cdf",
    "energy_density",
    "extrapolate",
    "fit_power",
    "frozen_rates",
    "is_upright",
    "kept_by_the_cap",
    "largest_gain",
    "log_energy_rate_chaotic",
    "log_energy_rate_island",
    "loss_probability",
    "mean_of",
    "moments",
    "predict",
    "rarity",
    "reversed_cycle",
    "sin_phi_hat",
    "sum_of_cycles",
    "unbiased_mean",
    "upright_rate",
    "upright_spread",
    "v_cap",
    "v_cha",
    "v_ell",
    "v_stem",
    "volumes_at",
]


def __dir__() -> list[str]:
    """List the public names, without the modules that they come from."""
    return __all__
