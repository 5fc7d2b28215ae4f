"""Validity of a scene over its whole period, by exact algebra rather than sampling.

Each condition is the sign of a sum of products of laws. For trigonometric laws the
substitution x = tan(omega t / 2) makes it a rational polynomial over the real line, for
bang-bang laws it is one on each leg; `scene.exact` decides its sign. Touching is decided
too: nu = 1 at one instant is valid, nu > 1 by one unit in the last place is not.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from math import comb, prod
from typing import Any, NamedTuple

from mpmath import MPContext

from scene import exact
from scene.laws import BangBang, Fourier, Law, Quadratic, breakpoints, defect, is_constant, piece_at, value
from scene.refusal import BadInput
from scene.tables import Cap, Mushroom, Scene, laws, period, periods


class InvalidScene(BadInput):
    """A scene that means nothing: one line naming parameter, time, value and bound."""


class Condition(NamedTuple):
    """sum of sign * product(laws) must be > 0 (strict) or >= 0."""

    text: str
    terms: tuple[tuple[int, tuple[Law, ...]], ...]
    is_strict: bool = True


def check(scene: Scene) -> None:
    """Prove that a scene is valid at all times.

    Args:
        scene: table and laws.

    Raises:
        InvalidScene: naming the parameter, the time and the values that break it.

    Source: sec. 2 of the paper (w <= r, w >= h tan(theta)), here with a strict apex.
    """
    if isinstance(scene, Mushroom) and (scene.w is None) == (scene.nu is None):
        raise InvalidScene("a mushroom needs exactly one of `w` and `nu`")
    for name, law in laws(scene).items():
        if problem := defect(law):
            raise InvalidScene(name + problem)
    _check_common_period(scene)
    for condition in conditions(scene):
        if not _holds(scene, condition):
            raise InvalidScene(_message(scene, condition))


def conditions(scene: Scene) -> list[Condition]:
    """List what must hold at all times for this table."""
    found = [Condition(f"{n} > 0", ((1, (law,)),)) for n, law in laws(scene).items() if n != "slope"]
    if isinstance(scene, Cap):
        return found
    width: tuple[Law, ...]
    if isinstance(scene, Mushroom) and scene.nu is not None:
        found.append(Condition("nu <= 1", ((1, (1.0,)), (-1, (scene.nu,))), is_strict=False))
        width = (scene.nu, scene.r)
    else:
        assert scene.w is not None
        width = (scene.w,)
        if isinstance(scene, Mushroom):
            found.append(Condition("w <= r", ((1, (scene.r,)), (-1, width)), is_strict=False))
    return [*found, Condition("w > h slope", ((1, width), (-1, (scene.h, scene.slope))))]


def _check_common_period(scene: Scene) -> None:
    named = periods(scene)
    if len(set(named.values())) > 1:
        (first, a), (second, b) = next(
            ((m, p), (n, q)) for m, p in named.items() for n, q in named.items() if p != q
        )
        ctx = MPContext()
        raise InvalidScene(
            f"{first} has period {ctx.nstr(a.value(ctx), 17)} and {second} has {ctx.nstr(b.value(ctx), 17)}:"
            " all moving laws must share one period exactly (use harmonics for multiples)"
        )


def _holds(scene: Scene, condition: Condition) -> bool:
    for p, a, b in _polynomials(condition):
        if exact.negative_point(p, a, b) is not None:
            return False
        if condition.is_strict and exact.vanishes(p, a, b):
            return False
    return True


def _polynomials(condition: Condition) -> Iterator[tuple[exact.Polynomial, Fraction, Fraction]]:
    used = [law for _, factors in condition.terms for law in factors if not is_constant(law)]
    legs = [law for law in used if isinstance(law, BangBang)]
    if legs:
        yield from _on_legs(condition, legs)
    else:
        yield from _on_circle(condition)


def _on_legs(
    condition: Condition, legs: list[BangBang]
) -> Iterator[tuple[exact.Polynomial, Fraction, Fraction]]:
    start, span = Fraction(legs[0].knots[0][0]), Fraction(0)
    cuts = {start}
    for law in legs:
        times = breakpoints(law)
        span = times[-1] - times[0]
        cuts |= {start + (t - start) % span for t in times}
    ordered = [*sorted(cuts), start + span]
    for a, b in itertools.pairwise(ordered):
        total: exact.Polynomial = []
        for sign, factors in condition.terms:
            term = [Fraction(sign)]
            for factor in factors:
                term = exact.multiply(term, _leg_polynomial(factor, a))
            total = exact.add(total, term)
        yield total, Fraction(0), b - a


def _leg_polynomial(law: Law, a: Fraction) -> exact.Polynomial:
    # In the variable t - a.
    piece = piece_at(law, a)
    if isinstance(piece, Quadratic):
        d = a - piece.origin
        c0, c1, c2 = piece.c0, piece.c1, piece.c2
        return exact.trimmed([c0 + d * (c1 + d * c2), c1 + 2 * c2 * d, c2])
    assert isinstance(piece, float)
    return exact.trimmed([Fraction(piece)])


def _on_circle(condition: Condition) -> Iterator[tuple[exact.Polynomial, Fraction, Fraction]]:
    # Each law is N(x) / (1 + x^2)^n with n its highest harmonic.
    terms = [(sign, [_half_angle(law) for law in factors]) for sign, factors in condition.terms]
    n = max(sum(degree for _, degree in factors) for _, factors in terms)
    total: exact.Polynomial = []
    for sign, factors in terms:
        term = exact.scale(_one_plus_square(n - sum(d for _, d in factors)), Fraction(sign))
        for numerator, _ in factors:
            term = exact.multiply(term, numerator)
        total = exact.add(total, term)
    # x = infinity is the instant omega t = pi: the value there is the coefficient of x^(2n).
    at_infinity = total[2 * n] if len(total) > 2 * n else Fraction(0)
    yield ([at_infinity] if at_infinity else []), Fraction(0), Fraction(1)
    if total:
        bound = exact.root_bound(total)
        yield total, -bound, bound


def _one_plus_square(n: int) -> exact.Polynomial:
    return [Fraction(comb(n, k // 2)) if k % 2 == 0 else Fraction(0) for k in range(2 * n + 1)]


def _half_angle(law: Law) -> tuple[exact.Polynomial, int]:
    if not isinstance(law, Fourier):
        mean = law if isinstance(law, float) else law.knots[0][1]
        return exact.trimmed([Fraction(mean)]), 0
    harmonics = law.harmonics()
    n = max((k for k, _, _ in harmonics), default=0)
    total = exact.scale(_one_plus_square(n), Fraction(law.mean))
    for k, c, s in harmonics:
        # cos(k a) + i sin(k a) = (1 + i x)^(2k) / (1 + x^2)^k with x = tan(a / 2).
        real = [Fraction(comb(2 * k, j) * (1, 0, -1, 0)[j % 4]) for j in range(2 * k + 1)]
        imaginary = [Fraction(comb(2 * k, j) * (0, 1, 0, -1)[j % 4]) for j in range(2 * k + 1)]
        wave = exact.add(exact.scale(real, Fraction(c)), exact.scale(imaginary, Fraction(s)))
        total = exact.add(total, exact.multiply(wave, _one_plus_square(n - k)))
    return total, n


def _message(scene: Scene, condition: Condition) -> str:
    # The proof is exact; this only looks for a telling instant to show. In mp no scene overflows.
    ctx = MPContext()
    shared = period(scene)
    span = shared.value(ctx) if shared else ctx.mpf(0)
    start = next((law.knots[0][0] for law in laws(scene).values() if isinstance(law, BangBang)), 0.0)
    times = [ctx.mpf(start) + span * i / 512 for i in range(512 if span else 1)]

    def excess(t: Any) -> Any:
        return sum(sign * prod(value(ctx, f, t) for f in factors) for sign, factors in condition.terms)

    def shown(number: Any) -> str:
        return str(ctx.nstr(number, 6))

    worst = min(times, key=excess)
    values = ", ".join(f"{name} = {shown(value(ctx, law, worst))}" for name, law in laws(scene).items())
    return f"{condition.text} fails by {shown(excess(worst))} near t = {shown(worst)}, where {values}"
