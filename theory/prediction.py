"""What the adiabatic theory predicts for one cycle: the figures of secs. 3.5 and 4.

Everything is computed at two or more resolutions. The second has twice the points of the first, the third
smaller parts, and the fourth twice the points of the third. An answer is given when two in a row agree to
two digits more than asked, and is then the finer of the two. A cycle in which one particle is captured
several times is covered too.

Solved cycles are kept for the next request, those of the last KEPT solutions to few digits. Their numbers
belong to no number system, and each caller's figures to that of its own cycle: it may change that, or compute
in another thread, and nobody else is touched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from math import factorial
from typing import Any, NamedTuple

import msgspec

from scene.laws import Law
from scene.notebook import rows
from scene.precision import reduce_record
from scene.refusal import BadInput, check_count, check_number, shown
from scene.tables import Mushroom, Scene
from scene.transforms import backwards
from theory.adiabatic import Captures, NotConverged, captures, refined, silent
from theory.chebyshev import logarithm
from theory.cycle import GUARD, Cycle, cycle_of
from theory.precision import MAX_DIGITS, MAX_ORDER, guarded, one_of
from theory.prepared import PreparedMushroom, as_mushroom, prepare

MOST_RESOLUTIONS = 4
# Decimals beyond those asked to which parts are halved anew, by resolution. Figures may be small beside 1:
# the first target then leaves parts so wide that twice their points do not do.
TARGETS = {0: 4, 2: 28}
KEPT = 32
FEW_DIGITS = 60  # a solution takes about a megabyte then, and grows with the square of the digits


class Prediction(NamedTuple):
    """Theory of one cycle; s = log E1 / E0. The numbers are mpf with digits to spare.

    p_nc: probability of never being captured (Eq:ps).
    m1: mean of s (Eq:Erate).
    log_e_nc: s of the particles never captured (Eq:lnEnc/E0).
    sd: standard deviation of s.
    mean_exp_minus: mean of exp(-s), which is 1 for every cycle in this theory.
    mean_exp_plus: mean of exp(s), the growth factor of the mean energy.
    """

    p_nc: Any
    m1: Any
    log_e_nc: Any
    sd: Any
    mean_exp_minus: Any
    mean_exp_plus: Any

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to keep every bit."""
        return reduce_record(self)

    @guarded
    def strings(self, digits: int) -> dict[str, str]:
        """Return each number in decimals, rounded to `digits` significant digits; zero is "0.0"."""
        digits = check_count("digits", digits, 1, MAX_DIGITS)
        return {
            name: x.context.nstr(x, digits, strip_zeros=False).removesuffix(".")
            for name, x in zip(self._fields, self, strict=True)
        }

    def _repr_html_(self) -> str:
        return rows("theory of one cycle, s = log E1 / E0", self.strings(15))

    @guarded
    def sd_of_mean(self, n_cycles: int) -> Any:
        """Return the standard deviation of (1/n) log E_n / E0, whose mean is m1, for independent cycles."""
        n_cycles = check_count("n_cycles", n_cycles, 1, 2**53)
        return self.sd / self.sd.context.sqrt(n_cycles)


@guarded
def predict(
    scene: Scene, digits: int = 15, *, progress: Callable[[int, float], None] | None = None
) -> Prediction:
    """Predict one cycle.

    Args:
        scene: a valid mushroom.
        digits: correct significant digits wanted, 1 to 1000.
        progress: called with the number of the resolution, from 1, and the part of it that is done, 0 to 1.
            Two or more resolutions are compared.

    Returns:
        The prediction. Numbers below 10^-(digits + 30) are returned as zero.

    Raises:
        BadInput: no scene, or digits out of bounds.
        NotCovered: not a mushroom.
        NotConverged: the digits were not reached.

    Source: Eq:ps, Eq:Erate, Eq:lnE/E0, Eq:lnEnc/E0.
    """
    if not (progress is None or callable(progress)):
        raise BadInput(f"progress = {shown(progress)}, must be a function")
    return Prediction(*converged(scene, digits, _figures, progress))


@guarded
def mean_of(scene: Scene, f: Callable[[Any], Any], digits: int = 15) -> Any:
    """Return the mean of f(s), s = log E1 / E0, over one cycle.

    Args:
        scene: as for `predict`.
        f: a smooth function. It takes an mpf and returns a finite real number.
        digits: correct significant digits wanted.

    Raises:
        As `predict`.
    """
    if not callable(f):
        raise BadInput(f"f = {shown(f)}, must be a function")

    def figures(found: Captures) -> tuple[Any, ...]:
        ctx, binary = found.cycle.ctx, found.binary
        values = [(w, one_of(ctx, "f(s)", f(binary.given(s)))) for w, s in found.point_masses()]
        return (binary.fsum([w * binary.taken(value) for w, value in values]),)

    return converged(scene, digits, figures)[0]


@guarded
def moments(scene: Scene, order: int, digits: int = 15) -> tuple[Any, ...]:
    """Return the means of s^k, s = log E1 / E0, for k = 0 ... order.

    Args:
        scene: as for `predict`.
        order: highest power, 0 to 64.
        digits: correct significant digits wanted.

    Raises:
        BadInput: order out of bounds.
        Otherwise as `predict`.
    """
    order = check_count("order", order, 0, MAX_ORDER)

    def figures(found: Captures) -> tuple[Any, ...]:
        return tuple(c * factorial(k) for k, c in enumerate(found.taylor(0, order)))

    return converged(scene, digits, figures)


@guarded
def cumulants(scene: Scene, order: int, digits: int = 15, q: float = 0.0) -> tuple[Any, ...]:
    """Return K(q) = log mean exp(q s) and its derivatives up to `order`.

    At q = 0 they are the cumulants of s: 0, m1, sd^2, ... Over n independent cycles they add up. The
    digits are those of mean exp(q s) and its derivatives: K(0) and K(-1) are 0 within 10^-digits.

    Args:
        scene: as for `predict`.
        order: highest derivative, 0 to 64.
        digits: correct significant digits wanted.
        q: a binary64 number.

    Raises:
        BadInput: order out of bounds.
        Otherwise as `predict`.
    """
    order, tilt = check_count("order", order, 0, MAX_ORDER), check_number("q", q)
    p = list(converged(scene, digits, lambda found: tuple(found.taylor(tilt, order))))
    return tuple(c * factorial(k) for k, c in enumerate(logarithm(p[0].context, p)))


def reversed_cycle(scene: Scene) -> Mushroom:
    """Return the mushroom that runs the same loop backwards in time.

    Raises:
        NotCovered: not a mushroom.
    """
    mushroom = as_mushroom(scene)
    return msgspec.structs.replace(backwards(mushroom), name=mushroom.name, notes=mushroom.notes)


def _figures(found: Captures) -> tuple[Any, ...]:
    # Wells multiply in `taylor`; as weighted points, which `mean` takes, they would be convolved. As mean
    # exp(-s) is 1, the mean of s is of the order of its variance, and no more than rounding cancels.
    _, first, second = found.taylor(0, 2)
    return (
        found.p_not_captured,
        found.growth(),
        found.root.s_nc,
        found.binary.sqrt(max(2 * second - first**2, found.binary.zero)),
        found.taylor(-1, 0)[0],
        found.taylor(1, 0)[0],
    )


def converged(
    scene: Scene,
    digits: int,
    figures: Callable[[Captures], tuple[Any, ...]],
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Any, ...]:
    """Return figures of a cycle once two resolutions in a row agree on them to the digits asked.

    Raises:
        NotConverged: they do not, as far as the resolution may rise.
    """
    mushroom = prepare(scene)
    digits = check_count("digits", digits, 1, MAX_DIGITS)
    cycle = cycle_of(mushroom, digits)
    ctx, binary = cycle.ctx, cycle.binary
    noise, agreement = ctx.mpf(10) ** -(digits + GUARD - 10), ctx.mpf(10) ** -(digits + 2)
    previous: tuple[Any, ...] | None = None
    for found in resolutions(mushroom, cycle, progress):
        with binary.working():
            current = tuple(binary.given(x) for x in figures(found))
        current = tuple(ctx.zero if abs(x) < noise else x for x in current)
        if (
            previous is not None
            and len(current) == len(previous)
            and all(abs(x - y) <= agreement * abs(x) for x, y in zip(current, previous, strict=True))
        ):
            return current
        previous = current
    raise NotConverged(f"two resolutions in a row do not agree to {digits} digits")


def resolutions(
    mushroom: PreparedMushroom, cycle: Cycle, progress: Callable[[int, float], None] | None = None
) -> Iterator[Captures]:
    """Yield a cycle's captures, resolved more and more finely.

    Args:
        mushroom: what the cycle is of.
        cycle: `cycle_of` it.
        progress: called with the number of the resolution and the share of it that is done; what is kept is
            reported as done.

    Raises:
        NotConverged: as `captures`.
    """
    kept: list[Captures] = []
    if cycle.digits <= FEW_DIGITS:
        kept = _place(tuple(mushroom.laws.items()), cycle.digits)
    for number in range(MOST_RESOLUTIONS):
        on_progress = silent if progress is None else partial(progress, number + 1)
        if number < len(kept):
            on_progress(1.0)
        elif number in TARGETS:
            kept.append(captures(cycle, cycle.digits + TARGETS[number], on_progress))
        else:
            kept.append(refined(kept[-1], on_progress))
        yield replace(kept[number], cycle=cycle)


@lru_cache(maxsize=KEPT)
def _place(given: tuple[tuple[str, Law], ...], digits: int) -> list[Captures]:
    """Return the place of the solutions of a cycle: a list, empty at first."""
    return []
