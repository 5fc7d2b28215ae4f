"""Tables: cap, stem and mushroom, and the walls that each of them has.

A scene is a table with its laws of motion. It is proved valid when it is made: by a constructor, by
decoding, by replacing a field, by unpickling. (`msgspec.structs.force_setattr` and a subclass that
replaces `__post_init__` bypass the proof.) The tables are:
    Cap:      x^2 + y^2 <= r(t)^2, y >= 0, the base closed;
    Stem:     |x| <= w(t) + slope(t) y, -h(t) <= y <= 0, the top closed;
    Mushroom: both, joined through the mouth y = 0, |x| < w(t).
The mouth is given by `w` (half-width, a length) or by `nu` (w = nu r).

A scene is valid if r, h, w > 0, w <= r and w > h slope at all times, and if all its moving laws
have exactly the same period. The proof covers one period, and the theory is about cycles. The
period of a bang-bang law is rational. That of a Fourier law with `omega` is 2 pi / omega, which is
irrational, so the two never agree. A Fourier law with `period` can agree with a bang-bang law. A
law that moves several times faster is written with higher harmonics (the k-th number of `cos` and
`sin` belongs to k omega) or with repeated knots.
"""

import re
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from numbers import Real
from types import MappingProxyType
from typing import Any, ClassVar, Literal

import msgspec
from mpmath import fp

from scene.laws import WRITTEN, Constant, GivenLaw, Law, Product, law_of, shared_cycle
from scene.pieces import Period
from scene.refusal import BadInput, InvalidScene, check_number, listed, shown
from scene.validity import Condition, prove

Wall = Literal["arc", "base", "left", "right", "floor"]
KINDS = " or ".join(f"a {kind.__name__}" for kind in WRITTEN)
PARAMETERS = ("r", "w", "nu", "h", "slope")
# Controls but tab and line ends, lone surrogates, and what XML has no place for.
HIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


class _Table(
    msgspec.Struct,
    frozen=True,
    cache_hash=True,  # steppers look up what they made of a scene at every step
    dict=True,  # for `laws` and `width`, which no copy, comparison or file sees
    tag_field="table",
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    optional: ClassVar[tuple[str, ...]] = ()  # parameters that may be None
    _repr_html_: ClassVar[Callable[[Any], str]]  # what a notebook shows: assigned by `scene`

    def __post_init__(self) -> None:
        """Refuse an invalid scene; numbers of any kind become floats.

        Raises:
            InvalidScene: one line naming the parameter, the value or the time, and the bound.
        """
        for field in (name for name in PARAMETERS if name in self.__struct_fields__):
            given = listed(getattr(self, field))
            if given is None and field in self.optional:
                continue
            if isinstance(given, Law):
                given = given.as_field()
            if isinstance(given, WRITTEN):
                continue
            if isinstance(given, bool) or not isinstance(given, Real):
                raise InvalidScene(f"{field} = {shown(given)}, must be a number, {KINDS} law")
            msgspec.structs.force_setattr(self, field, check_number(field, given, InvalidScene))
        for field in ("name", "notes"):
            _check_text(field, getattr(self, field))
        _prove(type(self), tuple(getattr(self, name, None) for name in PARAMETERS))

    @cached_property
    def laws(self) -> Mapping[str, Law]:
        """Return the laws that the table gives, by the names of its parameters."""
        given = {name: getattr(self, name, None) for name in PARAMETERS}
        return MappingProxyType(
            {name: law_of(law) for name, law in given.items() if law is not None}
        )

    @cached_property
    def width(self) -> Law | Product:
        """Return the half-width w of the mouth, as a law or as nu r; 0 in a cap [length]."""
        if "nu" in self.laws:
            return Product(self.laws["nu"], self.laws["r"])
        return self.laws.get("w", Constant(0.0))

    @cached_property
    def cycle(self) -> Period | None:
        """Return the period that all moving laws share; None for a static table."""
        return shared_cycle(self.laws.values())

    @property
    def period(self) -> float:
        """Return the period of the moving laws [time], 0 if nothing moves."""
        return float(self.cycle.value(fp)) if self.cycle else 0.0

    def at(self, t: Any) -> dict[str, Any]:
        """Return the value of each law, by name, at a time or at an array of times (`Fourier`)."""
        return {name: law(t) for name, law in self.laws.items()}


def _check_text(field: str, text: object) -> None:
    """Refuse what is not text, and characters that no terminal, page or picture shows."""
    if not isinstance(text, str):
        raise InvalidScene(f"{field} = {shown(text)}, must be text")
    found = HIDDEN.search(text)
    if found is not None:
        raise InvalidScene(f"{field} holds {found[0]!a}, must be text without control characters")


class Cap(_Table, frozen=True, tag="cap", kw_only=True):
    """The half disk x^2 + y^2 <= r^2, y >= 0 (the breathing circle of sec. 3.1, folded)."""

    walls: ClassVar[tuple[Wall, ...]] = ("arc", "base")
    r: GivenLaw
    name: str = ""
    notes: str = ""


class Stem(_Table, frozen=True, tag="stem", kw_only=True):
    """The trapezoid |x| <= w + slope y, -h <= y <= 0; with slope 0 the Fermi-Ulam rectangle."""

    walls: ClassVar[tuple[Wall, ...]] = ("base", "left", "right", "floor")
    w: GivenLaw
    h: GivenLaw
    slope: GivenLaw = 0.0
    name: str = ""
    notes: str = ""


class Mushroom(_Table, frozen=True, tag="mushroom", kw_only=True):
    """Cap and stem joined through the mouth y = 0, |x| < w (sec. 2)."""

    walls: ClassVar[tuple[Wall, ...]] = ("arc", "base", "left", "right", "floor")
    optional: ClassVar[tuple[str, ...]] = ("w", "nu")
    r: GivenLaw
    h: GivenLaw
    w: GivenLaw | None = None
    nu: GivenLaw | None = None
    slope: GivenLaw = 0.0
    name: str = ""
    notes: str = ""


Scene = Cap | Stem | Mushroom


def check_scene(scene: object) -> None:
    """Refuse a value that is not a scene.

    Args:
        scene: whatever a caller gave for a Cap, a Stem or a Mushroom.

    Raises:
        BadInput: naming the value; for the name of a scene it says how to load it.
    """
    # A scene is proved valid when it is made; a subclass could omit the proof.
    if type(scene) in (Cap, Stem, Mushroom):
        return
    hint = (
        f"; a name or a file is loaded by scene.load({shown(scene)})"
        if isinstance(scene, str)
        else ""
    )
    raise BadInput(f"scene = {shown(scene)}, must be a Cap, a Stem or a Mushroom{hint}")


@lru_cache(maxsize=4096)
def _prove(table: type[_Table], given: tuple[GivenLaw | None, ...]) -> None:
    # Cached by value: -0.0 and 0.0 count as equal, and validity is a matter of real numbers. A
    # refusal is not kept, so its message shows the numbers at hand.
    found = {
        name: law_of(law) for name, law in zip(PARAMETERS, given, strict=True) if law is not None
    }
    if table is Mushroom and (("w" in found) == ("nu" in found)):
        raise InvalidScene("a mushroom needs exactly one of `w` and `nu`")
    prove(found, _conditions(found))


def _conditions(found: dict[str, Law]) -> list[Condition]:
    """List what must hold at all times with these laws (sec. 2, with a strict apex)."""
    listed = [
        Condition(f"{name} > 0", ((1, (law,)),)) for name, law in found.items() if name != "slope"
    ]
    if "h" not in found:
        return listed
    width: tuple[Law, ...] = (found["nu"], found["r"]) if "nu" in found else (found["w"],)
    if "nu" in found:
        listed.append(
            Condition("nu <= 1", ((1, (Constant(1.0),)), (-1, (found["nu"],))), is_strict=False)
        )
    elif "r" in found:
        listed.append(Condition("w <= r", ((1, (found["r"],)), (-1, width)), is_strict=False))
    return [*listed, Condition("w > h slope", ((1, width), (-1, (found["h"], found["slope"]))))]
