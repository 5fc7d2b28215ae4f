"""Questions that rational arithmetic answers exactly: ties, corners and paths along a wall.

Intervals never prove an equality, so `undefined` outcomes rest on this module: wherever a law
has a rational value (constants, bang-bang laws, Fourier laws at t = 0), wall functions of a
binary64 state are rational numbers, and their signs are exact.
"""

from __future__ import annotations

from fractions import Fraction

from scene import Cap, Fourier, Law, Mushroom, Scene, State, Stem, Wall
from scene.laws import Quadratic, is_constant, piece_at
from scene.tables import laws, width_factors

Jet = tuple[Fraction, Fraction, Fraction]


def law_jet(law: Law, time: Fraction) -> Jet | None:
    """Return value, first and second derivative just after `time`, or None when not rational."""
    piece = piece_at(law, time)
    if isinstance(piece, Quadratic):
        u = time - piece.origin
        return piece.c0 + u * (piece.c1 + u * piece.c2), piece.c1 + 2 * u * piece.c2, 2 * piece.c2
    if isinstance(piece, Fourier):
        if time != 0 or piece.omega is None:
            return None
        omega = Fraction(piece.omega)
        terms = [(k * omega, Fraction(a), Fraction(b)) for k, a, b in piece.harmonics()]
        return (
            Fraction(piece.mean) + sum((a for _, a, _ in terms), Fraction(0)),
            sum((f * b for f, _, b in terms), Fraction(0)),
            -sum((f * f * a for f, a, _ in terms), Fraction(0)),
        )
    return Fraction(piece), Fraction(0), Fraction(0)


def _product(p: Jet, q: Jet) -> Jet:
    return p[0] * q[0], p[1] * q[0] + p[0] * q[1], p[2] * q[0] + 2 * p[1] * q[1] + p[0] * q[2]


def _combined(*terms: tuple[int, Jet]) -> Jet:
    f, d1, d2 = (sum((sign * jet[k] for sign, jet in terms), Fraction(0)) for k in range(3))
    return f, d1, d2


def wall_jet(scene: Scene, state: State, wall: Wall, s: Fraction) -> Jet | None:
    """Return f, f', f'' of a wall at flight time s, exactly, or None when not rational."""
    x, y = Fraction(state.x), Fraction(state.y)
    vx, vy = Fraction(state.vx), Fraction(state.vy)
    time = Fraction(state.t) + s
    height: Jet = (y + vy * s, vy, Fraction(0))
    across: Jet = (x + vx * s, vx, Fraction(0))
    if wall == "base":
        return (-height[0], -vy, Fraction(0)) if isinstance(scene, Stem) else height
    found = {name: law_jet(law, time) for name, law in laws(scene).items()}
    if wall == "arc":
        r = found["r"]
        if r is None:
            return None
        return _combined((1, _product(r, r)), (-1, _product(across, across)), (-1, _product(height, height)))
    if wall == "floor":
        h = found["h"]
        return None if h is None else (height[0] + h[0], height[1] + h[1], h[2])
    width, slope = width_jet(scene, time), found["slope"]
    if width is None or slope is None:
        return None
    sign = -1 if wall == "right" else 1
    return _combined((1, width), (1, _product(slope, height)), (sign, across))


def width_jet(scene: Scene, time: Fraction) -> Jet | None:
    """Return the half-width of the mouth and its derivatives, or None when not rational."""
    assert isinstance(scene, (Stem, Mushroom))
    total: Jet = (Fraction(1), Fraction(0), Fraction(0))
    for law in width_factors(scene):
        jet = law_jet(law, time)
        if jet is None:
            return None
        total = _product(total, jet)
    return total


def crossing_time(state: State) -> Fraction | None:
    """Return the exact flight time at which y = 0, when it lies ahead."""
    if state.vy == 0 or (state.y > 0) == (state.vy > 0) or state.y == 0:
        return None
    return -Fraction(state.y) / Fraction(state.vy)


def straight_time(scene: Scene, state: State, wall: Wall) -> Fraction | None:
    """Return the exact flight time to a straight wall of the stem at rest, when it lies ahead.

    A wall being left that stands still is straight ahead of nothing: None.
    """
    if isinstance(scene, Cap) or wall == state.wall:
        return None
    moving = (scene.h,) if wall == "floor" else (*width_factors(scene), scene.slope)
    if not all(map(is_constant, moving)):
        return None
    jet = wall_jet(scene, state, wall, Fraction(0))
    if jet is None or jet[0] <= 0 or jet[1] >= 0:
        return None
    return -jet[0] / jet[1]


def is_zero(scene: Scene, state: State, wall: Wall, s: Fraction) -> bool:
    """Tell whether f, less its residual f(0) on the wall being left, is known to vanish exactly at s."""
    jet = wall_jet(scene, state, wall, s)
    if jet is None or wall != state.wall:
        return jet is not None and jet[0] == 0
    start = wall_jet(scene, state, wall, Fraction(0))
    return start is not None and jet[0] == start[0]
