"""Transformations of scenes and states that leave the physics the same.

A transformed scene has neither name nor notes, and is proved valid like any other. Mirror
images and powers of two are exact as long as no number overflows or becomes subnormal.
"""

import math
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec
from mpmath import fp

from scene.laws import BangBang, Fourier, Law, value
from scene.precision import decimals
from scene.states import State
from scene.tables import Scene, Wall, laws

Table = TypeVar("Table", bound=Scene)
_ACROSS: dict[Wall, Wall] = {"left": "right", "right": "left"}


def mirrored_wall(wall: Wall | None) -> Wall | None:
    """Return the wall's mirror image under x -> -x."""
    return None if wall is None else _ACROSS.get(wall, wall)


def mirrored(state: State) -> State:
    """Return the state's mirror image under x -> -x. Every table is its own mirror image."""
    return State(state.t, -state.x, state.y, -state.vx, state.vy, mirrored_wall(state.wall))


def times_power(number: float, exponent: int) -> float:
    """Return a number times 2^exponent, infinite where that overflows.

    The power itself need not be a float: 2^1000 times 2^-1080 is 2^-80, though 2^-1080 is rounded to 0.
    """
    try:
        return math.ldexp(number, exponent)
    except OverflowError:
        return math.copysign(math.inf, number)


def scaled_state(state: State, length: int, time: int) -> State:
    """Return the state with lengths times 2^length and times times 2^time, velocities accordingly."""
    x, y = (times_power(number, length) for number in (state.x, state.y))
    vx, vy = (times_power(number, length - time) for number in (state.vx, state.vy))
    return State(times_power(state.t, time), x, y, vx, vy, state.wall)


def scaled(scene: Table, length: int, time: int) -> Table:
    """Return the scene with lengths times 2^length and times times 2^time; `nu` and `slope` do not change."""
    return _with_laws(
        scene, lambda name, law: scaled_law(law, 0 if name in ("nu", "slope") else length, time)
    )


def scaled_law(law: Law, size: int, time: int) -> Law:
    """Return the law with its values times 2^size and its times times 2^time."""
    if isinstance(law, BangBang):
        return BangBang(knots=tuple((times_power(t, time), times_power(v, size)) for t, v in law.knots))
    if isinstance(law, Fourier):
        cos, sin = (tuple(times_power(a, size) for a in amplitudes) for amplitudes in (law.cos, law.sin))
        omega = None if law.omega is None else times_power(law.omega, -time)
        period = None if law.period is None else times_power(law.period, time)
        return Fourier(mean=times_power(law.mean, size), omega=omega, cos=cos, sin=sin, period=period)
    return times_power(law, size)


def backwards(scene: Table) -> Table:
    """Return the scene whose laws run backwards: f(-t) for f(t)."""

    def turned(_: str, law: Law) -> Law:
        if isinstance(law, BangBang):
            return BangBang(knots=tuple((-t, v) for t, v in reversed(law.knots)))
        if isinstance(law, Fourier):
            return msgspec.structs.replace(law, sin=tuple(-b for b in law.sin))
        return law

    return _with_laws(scene, turned)


def frozen(scene: Table, t: float) -> Table:
    """Return the static scene with the parameters that it has at time t, rounded.

    They are computed to 50 digits and rounded once, so that parameters which touch (w = r, nu = 1) still do.
    """
    return _with_laws(scene, lambda _, law: float(value(decimals(50), law, t)))


def idle(scene: Table) -> Table:
    """Return a static scene with every number written as a Fourier law of amplitude zero."""
    return _with_laws(
        scene, lambda _, law: Fourier(mean=float(value(fp, law, 0.0)), omega=1.0, cos=(0.0,), sin=(0.0,))
    )


def _with_laws(scene: Table, change: Callable[[str, Law], Law]) -> Table:
    changed: dict[str, Any] = {name: change(name, law) for name, law in laws(scene).items()}
    return type(scene)(**changed)
