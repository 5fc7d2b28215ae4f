"""What the adiabatic theory predicts for one cycle: the figures of secs. 3.5 and 4.

Everything is computed at two or more resolutions; an answer is given when two in a row
agree to two digits more than asked, and is then the finer of the two. Cycles with several
intervals of capture are refused by `Cycle`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from scene.tables import Scene
from theory.adiabatic import Captures, NotConverged, captures
from theory.cycle import GUARD, Cycle


class Prediction(NamedTuple):
    """Theory of one cycle; s = log E1 / E0. The numbers are mpf with digits to spare.

    p_nc: probability of never being captured (Eq:ps).
    m1: mean of s (Eq:Erate).
    log_e_nc: s of the uncaptured (Eq:lnEnc/E0).
    sd: standard deviation of s.
    mean_exp_minus: mean of exp(-s), which is 1 for every cycle.
    mean_exp_plus: mean of exp(s), the growth factor of the mean energy.
    """

    p_nc: Any
    m1: Any
    log_e_nc: Any
    sd: Any
    mean_exp_minus: Any
    mean_exp_plus: Any

    def strings(self, digits: int) -> dict[str, str]:
        """Return each number in decimals, rounded to `digits` significant digits; zero is "0.0"."""
        return {
            name: x.context.nstr(x, digits, strip_zeros=False).removesuffix(".")
            for name, x in zip(self._fields, self, strict=True)
        }

    def sd_of_mean(self, n_cycles: int) -> Any:
        """Return the standard deviation of (1/n) log E_n / E0, whose mean is m1, for independent cycles."""
        return self.sd / self.sd.context.sqrt(n_cycles)


def predict(scene: Scene, digits: int = 15) -> Prediction:
    """Predict one cycle.

    Args:
        scene: a valid mushroom with at most one interval of capture per period.
        digits: correct significant digits wanted, >= 1.

    Returns:
        The prediction. What is smaller than 10^-(digits + 30) is given as zero.

    Raises:
        BadInput: digits < 1.
        NotCovered: not a mushroom, or several intervals of capture.
        NotConverged: the digits were not reached.

    Source: Eq:ps, Eq:Erate, Eq:lnE/E0, Eq:lnEnc/E0.
    """
    return Prediction(*_converged(scene, digits, _figures))


def mean_of(scene: Scene, f: Callable[[Any], Any], digits: int = 15) -> Any:
    """Return the mean of f(s), s = log E1 / E0, over one cycle.

    Args:
        scene: as for `predict`.
        f: takes and returns an mpf; smooth.
        digits: correct significant digits wanted.

    Raises:
        As `predict`.
    """
    return _converged(scene, digits, lambda found: (found.mean(f),))[0]


def _figures(found: Captures) -> tuple[Any, ...]:
    ctx, m1 = found.cycle.ctx, found.growth()
    variance = found.mean(lambda s: (s - m1) ** 2)
    return (
        found.p_not_captured,
        m1,
        found.s_not_captured,
        ctx.sqrt(variance),
        found.mean(lambda s: ctx.exp(-s)),
        found.mean(ctx.exp),
    )


def _converged(scene: Scene, digits: int, figures: Callable[[Captures], tuple[Any, ...]]) -> tuple[Any, ...]:
    cycle = Cycle.of(scene, digits)
    ctx = cycle.ctx
    noise, agreement = ctx.mpf(10) ** -(digits + GUARD - 10), ctx.mpf(10) ** -(digits + 2)
    previous: tuple[Any, ...] = ()
    for target in range(digits + 4, digits + GUARD - 8, 12):
        current = tuple(ctx.zero if abs(x) < noise else x for x in figures(captures(cycle, target)))
        if previous and all(abs(x - y) <= agreement * abs(x) for x, y in zip(current, previous, strict=True)):
            return current
        previous = current
    raise NotConverged(f"two resolutions in a row do not agree to {digits} digits")
