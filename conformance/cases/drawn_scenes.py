"""Scenes that no file holds: laws of all kinds side by side, of any shape and length, that begin anywhere.

Valid by construction where that can be had: to prove that a slope of many harmonics closes a stem takes up to
some ten seconds.
"""

from __future__ import annotations

from collections.abc import Container

import msgspec

from conformance.cases.draws import Draw, SharedPeriod, clock, law, scene
from conformance.cases.seldom import deeper
from scene import BangBang, Fourier, Law, Scene
from scene.laws import bounds, is_constant
from scene.tables import laws
from scene.transforms import scaled_law

KINDS = ("fourier", "bang-bang", "mixed", "mixed", "mixed", "harmonics")  # mixed: each law of its own
LEGS = 7, 7, 7, 12, 12, 23, 40, 120  # of a law with many: the corpus has at most four
SHAPES = {"h": (-5, -3, 3, 5), "nu": (-8, -4), "w": (-8, -4)}  # powers of two that a law is multiplied with
SIZES = {"r", "nu", "w", "h"}  # what is positive
FAINT = 8, 20, 30  # powers of a half that what a law moves by is multiplied with
NAMES = "", "", "scene", "scene", "1"


def drawn_scene(draw: Draw, table: str) -> Scene:
    """Draw a scene of a table: laws of all kinds, of any shape, also long ones, that begin anywhere."""
    shared = clock(draw, KINDS)
    of = scene(draw, table, shared)
    # A cap that sank below a mouth of its own width would be none.
    may_sink = SIZES - {"r"} if "w" in laws(of) else SIZES
    found = {name: _shaped(draw, name, known, may_sink) for name, known in laws(of).items()}
    if table != "cap":
        steepest = _steepest(found)
        if draw.part() < 0.5 or bounds(found.get("slope", 0.0)).highest > steepest:
            found["slope"] = law(draw, -0.4, steepest, shared)
    changed = {name: _begun_elsewhere(draw, known, shared) for name, known in found.items()}
    return msgspec.structs.replace(of, **changed, name=draw.pick(NAMES))


def _shaped(draw: Draw, name: str, of: Law, may_sink: Container[str]) -> Law:
    """Return a law as it is, or of a shape seldom drawn.

    That is: a stem far deeper or shallower, a mouth far narrower than the cap is wide; a wave that sinks
    nearly to 0; a law that hardly moves, and one that does not, but is written as one that might, with a
    period that no other has.
    """
    if draw.part() < 0.25 and name in SHAPES:
        of = scaled_law(of, draw.pick(SHAPES[name]), 0)
    if draw.part() > (0.5 if isinstance(of, float) else 0.25):
        return of
    if isinstance(of, Fourier) and name in may_sink and draw.part() < 0.5:
        return deeper(draw, of)
    if isinstance(of, Fourier):
        part = 2.0 ** -draw.pick(FAINT)
        cos, sin = (tuple(part * a for a in amplitudes) for amplitudes in (of.cos, of.sin))
        return msgspec.structs.replace(of, cos=cos, sin=sin)
    if isinstance(of, BangBang):
        first, part = of.knots[0][1], 2.0 ** -draw.pick(FAINT)
        return BangBang(knots=tuple((t, first + part * (v - first)) for t, v in of.knots))
    if draw.part() < 0.5:
        return Fourier(mean=of, omega=draw.short(0.5, 6.0))
    return BangBang(knots=tuple((draw.short(0.1, 1.0) + k, of) for k in range(0, 9, 4)))


def _steepest(known: dict[str, Law]) -> float:
    """Return a slope that no stem with these laws closes under; 0 where one is a deep wave."""
    found = {name: bounds(one) for name, one in known.items()}
    lows = [found[name].lowest for name in found.keys() & {"w", "nu", "r"}]
    narrowest = found["w"].lowest if "w" in found else found["nu"].lowest * found["r"].lowest
    return 0.9 * narrowest / found["h"].highest if min(lows) > 0 else 0.0


def _begun_elsewhere(draw: Draw, of: Law, shared: SharedPeriod) -> Law:
    """Return a bang-bang law with its knots moved by a part of the period, now and then one of many legs."""
    if not isinstance(of, BangBang) or is_constant(of):
        return of
    knots = of.knots
    if draw.pick(range(3)) == 0:
        n, low, high = draw.pick(LEGS), min(v for _, v in knots), max(v for _, v in knots)
        values = [draw.between(low, high) for _ in range(n)]
        places = sorted({0, *(draw.pick(range(1, 1024)) for _ in range(n - 1))})
        times = [*(shared.rate * place / 1024 for place in places), shared.rate]
        knots = tuple(zip(times, [*values[: len(places)], values[0]], strict=True))
    by = shared.rate * draw.pick(range(-256, 256)) / 64  # all sums are exact
    return BangBang(knots=tuple((t + by, v) for t, v in knots))
