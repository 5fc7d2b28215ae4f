"""A scene as the numbers that the compiled kernel reads."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

import numpy as np

from fast.kernel import codes, single
from fast.kernel.double_double import half_pi

from fast.kernel.records import (  # isort: skip
    BANG_BANG, CONSTANT, FOURIER, KIND, N_HARMONICS, OMEGA, OMEGA_LOW, SHARED, Compiled,
)  # fmt: skip
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene
from scene.laws import Bounds, bounds, is_constant
from scene.refusal import BadInput
from scene.sizes import size_bounds
from scene.tables import width_factors

HALF_PI = half_pi()
TABLES = {"Cap": int(codes.CAP), "Stem": int(codes.STEM), "Mushroom": int(codes.MUSHROOM)}
LARGEST = single.LARGEST


@lru_cache(maxsize=256)
def compile_scene(scene: Scene) -> Compiled:
    """Lay out a valid scene for the kernel.

    Raises:
        BadInput: a length, speed or acceleration of a wall is 2^400 or more: squares would overflow.
    """
    try:
        compiled = _laid_out(scene)
    except OverflowError:
        raise BadInput("scene: a wall's acceleration overflows, must be below 2^400") from None
    for name, row in zip(("r", "w", "h", "slope"), compiled.bounds, strict=True):
        for what, size in zip(("least value", "greatest value", "speed", "acceleration"), row, strict=True):
            if not abs(size) < LARGEST:
                raise BadInput(f"scene.{name}: {what} {size:.3g}, must be below 2^400 in size")
    return compiled


def _laid_out(scene: Scene) -> Compiled:
    r: Law = 0.0 if not isinstance(scene, (Cap, Mushroom)) else scene.r
    h: Law = 0.0
    slope: Law = 0.0
    factors: tuple[Law, ...] = (0.0,)
    if not isinstance(scene, Cap):
        h, slope, factors = scene.h, scene.slope, width_factors(scene)
    rows = [_row(law) for law in (r, factors[0], h, slope)]
    waves = [row for row in rows if row[KIND] == FOURIER]
    moving = [law for law in (r, *factors, h, slope) if isinstance(law, Fourier) and not is_constant(law)]
    omega_low = _omega(moving[0])[1] if moving else 0.0
    laws = np.zeros((len(rows) + 1, max(OMEGA_LOW + 1, *(len(row) for row in rows))))
    for i, row in enumerate(rows):
        laws[i, : len(row)] = row
    for row in waves:
        laws[SHARED, OMEGA], laws[SHARED, OMEGA_LOW] = row[OMEGA], omega_low
        laws[SHARED, N_HARMONICS] = max(laws[SHARED, N_HARMONICS], row[N_HARMONICS])
    limits = np.array([size_bounds(r), _product_bounds(factors), size_bounds(h), bounds(slope)])
    return Compiled(TABLES[type(scene).__name__], len(factors) == 2, laws, limits)


def _omega(law: Fourier) -> tuple[float, float]:
    """Return a law's frequency as a sum of two floats: exact if given, else 2 pi / period to 2^-106."""
    if law.omega is not None:
        return law.omega, 0.0
    assert law.period is not None
    frequency = 4 * HALF_PI / Fraction(law.period)
    high = float(frequency)
    return high, float(frequency - Fraction(high))


def _row(law: Law) -> list[float]:
    if isinstance(law, Fourier) and not is_constant(law):
        n = max(len(law.cos), len(law.sin))
        cos = list(law.cos) + [0.0] * (n - len(law.cos))
        sin = list(law.sin) + [0.0] * (n - len(law.sin))
        return [FOURIER, law.mean, _omega(law)[0], float(n), *cos, *sin]
    if isinstance(law, BangBang) and not is_constant(law):
        times = [knot[0] for knot in law.knots]
        values = [knot[1] for knot in law.knots]
        legs = zip(law.knots, law.knots[1:], strict=False)
        accelerations = [
            4 * (Fraction(v1) - Fraction(v0)) / (Fraction(t1) - Fraction(t0)) ** 2
            for (t0, v0), (t1, v1) in legs
        ]
        accelerations.append(Fraction(0))  # one for every knot keeps the columns simple
        highs = [float(a) for a in accelerations]
        period = Fraction(times[-1]) - Fraction(times[0])
        return [
            BANG_BANG,
            0.0,
            float(period),
            float(len(times)),
            float(period - Fraction(float(period))),
            *times,
            *values,
            *highs,
            *(float(a - Fraction(high)) for a, high in zip(accelerations, highs, strict=True)),
        ]
    constant = law if isinstance(law, float) else law.mean if isinstance(law, Fourier) else law.knots[0][1]
    return [CONSTANT, constant, 0.0, 0.0]


def _product_bounds(factors: tuple[Law, ...]) -> Bounds:
    if len(factors) == 1:
        return size_bounds(factors[0])
    nu, r = size_bounds(factors[0]), size_bounds(factors[1])
    # Leibniz, rounded outward by a few units in the last place; nu and r are positive.
    grow = 1.0 + 2.0**-50
    return Bounds(
        nu.lowest * r.lowest / grow,
        nu.highest * r.highest * grow,
        (nu.slope * r.highest + nu.highest * r.slope) * grow,
        (nu.curvature * r.highest + 2 * nu.slope * r.slope + nu.highest * r.curvature) * grow,
    )
