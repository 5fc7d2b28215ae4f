"""Transformations of scenes and states that leave the physics the same.

A transformed scene has neither name nor notes, and is proved valid like any other. Mirror
images and powers of two are exact as long as no number overflows or becomes subnormal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from mpmath import fp

from scene.laws import Constant, Fourier, Law, law_of, times_power as times_power
from scene.precision import decimals
from scene.states import State
from scene.tables import Scene, Wall

Table = TypeVar("Table", bound=Scene)
_ACROSS: dict[Wall, Wall] = {"left": "right", "right": "left"}


def mirrored_wall(wall: Wall | None) -> Wall | None:
    """Return the wall's mirror image under x -> -x."""
    return None if wall is None else _ACROSS.get(wall, wall)


def mirrored(state: State) -> State:
    """Return the state's mirror image under x -> -x. Every table is its own mirror image."""
    return State(state.t, -state.x, state.y, -state.vx, state.vy, mirrored_wall(state.wall))


def scaled_state(state: State, length: int, time: int) -> State:
    """Return the state with lengths times 2^length and times times 2^time."""
    x, y = (times_power(number, length) for number in (state.x, state.y))
    vx, vy = (times_power(number, length - time) for number in (state.vx, state.vy))
    return State(times_power(state.t, time), x, y, vx, vy, state.wall)


def scaled(scene: Table, length: int, time: int) -> Table:
    """Return the scene with lengths times 2^length and times times 2^time.

    `nu` and `slope` do not change.
    """
    return _with_laws(
        scene, lambda name, law: law.scaled(0 if name in ("nu", "slope") else length, time)
    )


def scaled_law(law: float | Law, size: int, time: int) -> Any:
    """Return the law with its values times 2^size and its times times 2^time."""
    return law_of(law).scaled(size, time).as_field()


def backwards(scene: Table) -> Table:
    """Return the scene whose laws run backwards: f(-t) for f(t)."""
    return _with_laws(scene, lambda _, law: law.reversed())


def frozen(scene: Table, t: float) -> Table:
    """Return the static scene with the parameters that it has at time t, rounded.

    They are computed to 50 digits and rounded once, so that parameters which touch (w = r, nu = 1)
    still do.
    """
    return _with_laws(scene, lambda _, law: Constant(float(law.value(decimals(50), t))))


def idle(scene: Table) -> Table:
    """Return a static scene with every number written as a Fourier law of amplitude zero."""
    return _with_laws(
        scene,
        lambda _, law: Fourier(mean=float(law.value(fp, 0.0)), omega=1.0, cos=(0.0,), sin=(0.0,)),
    )


def _with_laws(scene: Table, change: Callable[[str, Law], Law]) -> Table:
    changed: dict[str, Any] = {name: change(name, law) for name, law in scene.laws.items()}
    return type(scene)(**changed)
