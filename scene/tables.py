"""Tables: cap, stem and mushroom, and the walls that each of them has.

A scene is a table with its laws of motion. Only what a table needs is part of it:
    Cap:      x^2 + y^2 <= r(t)^2, y >= 0, the base closed;
    Stem:     |x| <= w(t) + slope(t) y, -h(t) <= y <= 0, the top closed;
    Mushroom: both, joined through the mouth y = 0, |x| < w(t).
The mouth is given by `w` (half-width, a length) or by `nu` (w = nu r).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any, ClassVar, Literal, NamedTuple

import msgspec

from scene.laws import BangBang, Fourier, Law, is_constant

Wall = Literal["arc", "base", "left", "right", "floor"]


class _Table(msgspec.Struct, frozen=True, tag_field="table", forbid_unknown_fields=True, omit_defaults=True):
    pass


class Cap(_Table, frozen=True, tag="cap", kw_only=True):
    """The half disk x^2 + y^2 <= r^2, y >= 0 (the breathing circle of sec. 3.1, folded)."""

    walls: ClassVar[tuple[Wall, ...]] = ("arc", "base")
    r: Law
    name: str = ""
    notes: str = ""


class Stem(_Table, frozen=True, tag="stem", kw_only=True):
    """The trapezoid |x| <= w + slope y, -h <= y <= 0; with slope 0 the Fermi-Ulam rectangle."""

    walls: ClassVar[tuple[Wall, ...]] = ("base", "left", "right", "floor")
    w: Law
    h: Law
    slope: Law = 0.0
    name: str = ""
    notes: str = ""


class Mushroom(_Table, frozen=True, tag="mushroom", kw_only=True):
    """Cap and stem joined through the mouth y = 0, |x| < w (sec. 2)."""

    walls: ClassVar[tuple[Wall, ...]] = ("arc", "base", "left", "right", "floor")
    r: Law
    h: Law
    w: Law | None = None
    nu: Law | None = None
    slope: Law = 0.0
    name: str = ""
    notes: str = ""


Scene = Cap | Stem | Mushroom
PARAMETERS = ("r", "w", "nu", "h", "slope")


class Period(NamedTuple):
    """A common period: 2 pi / omega, kept symbolic, or an exact rational length [time]."""

    omega: float | None
    length: Fraction | None

    def value(self, ctx: Any) -> Any:
        """Return the period [time] in an mpmath number system."""
        if self.length is not None:
            return ctx.mpf(self.length.numerator) / ctx.mpf(self.length.denominator)
        return 2 * ctx.pi / ctx.mpf(self.omega)


def laws(scene: Scene) -> dict[str, Law]:
    """Return the laws the scene gives, by parameter name."""
    found = ((name, getattr(scene, name, None)) for name in PARAMETERS)
    return {name: law for name, law in found if law is not None}


def width_factors(scene: Stem | Mushroom) -> tuple[Law, ...]:
    """Return the laws whose product is the half-width w(t) of the mouth: (w,) or (nu, r)."""
    if isinstance(scene, Mushroom) and scene.nu is not None:
        return (scene.nu, scene.r)
    assert scene.w is not None
    return (scene.w,)


def periods(scene: Scene) -> dict[str, Period]:
    """Return the period of each law that moves."""
    found: dict[str, Period] = {}
    for name, law in laws(scene).items():
        if is_constant(law):
            continue
        if isinstance(law, Fourier):
            length = None if law.period is None else Fraction(law.period)
            found[name] = Period(law.omega, length)
        elif isinstance(law, BangBang):
            found[name] = Period(None, Fraction(law.knots[-1][0]) - Fraction(law.knots[0][0]))
    return found


def period(scene: Scene) -> Period | None:
    """Return the period that all moving laws of a valid scene share; None for a static table."""
    return next(iter(periods(scene).values()), None)
