"""Transformations of scenes and states under which the physics is known to stay the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
from mpmath import fp

from scene import BangBang, Fourier, Law, Scene, State, Wall
from scene.laws import value
from scene.precision import decimals
from scene.tables import laws

_ACROSS: dict[Wall, Wall] = {"left": "right", "right": "left"}


def mirrored_wall(wall: Wall | None) -> Wall | None:
    """Return the wall's mirror image under x -> -x."""
    return None if wall is None else _ACROSS.get(wall, wall)


def mirrored(state: State) -> State:
    """Return the state's mirror image under x -> -x; every table is its own."""
    return State(state.t, -state.x, state.y, -state.vx, state.vy, mirrored_wall(state.wall))


def scaled_state(state: State, length: int, time: int) -> State:
    """Return the state with lengths times 2^length and times times 2^time."""
    size, speed = 2.0**length, 2.0 ** (length - time)
    return State(
        2.0**time * state.t, size * state.x, size * state.y, speed * state.vx, speed * state.vy, state.wall
    )


def scaled(scene: Scene, length: int, time: int) -> Scene:
    """Return the scene with lengths times 2^length and times times 2^time; `nu` and `slope` stay."""
    unit = 2.0**time
    return _with_laws(
        scene, lambda name, law: scaled_law(law, 1.0 if name in ("nu", "slope") else 2.0**length, unit)
    )


def scaled_law(law: Law, size: float, time: float) -> Law:
    """Return the law with its values times `size` and its times times `time`; exact for powers of two."""
    if isinstance(law, BangBang):
        return BangBang(knots=tuple((time * t, size * v) for t, v in law.knots))
    if isinstance(law, Fourier):
        cos, sin = (tuple(size * a for a in amplitudes) for amplitudes in (law.cos, law.sin))
        omega = None if law.omega is None else law.omega / time
        period = None if law.period is None else law.period * time
        return Fourier(mean=size * law.mean, omega=omega, cos=cos, sin=sin, period=period)
    return size * law


def backwards(scene: Scene) -> Scene:
    """Return the scene whose laws run backwards: f(-t) for f(t)."""

    def turned(_: str, law: Law) -> Law:
        if isinstance(law, BangBang):
            return BangBang(knots=tuple((-t, v) for t, v in reversed(law.knots)))
        if isinstance(law, Fourier):
            return msgspec.structs.replace(law, sin=tuple(-b for b in law.sin))
        return law

    return _with_laws(scene, turned)


def frozen(scene: Scene, t: float) -> Scene:
    """Return the static scene with the parameters that it has at time t, rounded.

    They are computed to 50 digits and rounded once, so that parameters which touch (w = r, nu = 1) still do.
    """
    return _with_laws(scene, lambda _, law: float(value(decimals(50), law, t)))


def idle(scene: Scene) -> Scene:
    """Return a static scene with every number written as a Fourier law of amplitude zero."""
    return _with_laws(
        scene, lambda _, law: Fourier(mean=float(value(fp, law, 0.0)), omega=1.0, cos=(0.0,), sin=(0.0,))
    )


def _with_laws(scene: Scene, change: Callable[[str, Law], Law]) -> Scene:
    changed: dict[str, Any] = {name: change(name, law) for name, law in laws(scene).items()}
    return type(scene)(**changed)
