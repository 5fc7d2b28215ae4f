"""Bang-bang and static scenes: f is a rational polynomial, so Sturm's theorem counts its roots.

The polynomials are built afresh from the definitions of sec. 2 and the pieces of the laws; the
reference must have found the first downward root, and nothing before it.
"""

from __future__ import annotations

from fractions import Fraction

from hypothesis import assume, given, settings

import reference
from conformance.strategies import scenes_and_states
from reference.arithmetic import rational
from scene import Fourier, Mushroom, Stem
from scene.exact import Sturm, add, at, multiply, scale
from scene.laws import Quadratic, is_constant, piece_at
from scene.tables import laws


def law_polynomial(law, time, t0):
    """Return the piece that holds at `time` as a polynomial in s = t - t0."""
    piece = piece_at(law, time)
    if isinstance(piece, Quadratic):
        shift = [t0 - piece.origin, Fraction(1)]
        square = multiply(shift, shift)
        return add(add([piece.c0] if piece.c0 else [], scale(shift, piece.c1)), scale(square, piece.c2))
    return [Fraction(piece)] if piece else []


def wall_polynomial(scene, state, wall, time):
    t0 = Fraction(state.t)
    x = [Fraction(state.x), Fraction(state.vx)]
    y = [Fraction(state.y), Fraction(state.vy)]
    law = {name: law_polynomial(given_law, time, t0) for name, given_law in laws(scene).items()}
    if wall == "arc":
        squares = add(multiply(x, x), multiply(y, y))
        return add(multiply(law["r"], law["r"]), scale(squares, Fraction(-1)))
    if wall == "floor":
        return add(y, law["h"])
    width = multiply(law["nu"], law["r"]) if "nu" in law else law["w"]
    side = scale(x, Fraction(-1 if wall == "right" else 1))
    return add(add(width, multiply(law["slope"], y)), side)


def stretches(scene, state, start, stop):
    """Cut [start, stop] of flight time at the knots; yields (from, to, an instant within)."""
    t0 = Fraction(state.t)
    s = start
    while s < stop:
        pieces = [piece_at(law, t0 + s) for law in laws(scene).values()]
        end = min([p.end - t0 for p in pieces if isinstance(p, Quadratic)], default=stop)
        end = min(end, stop)
        yield s, end, t0 + s
        s = end


def excluded_windows(scene, state, in_cap, stop):
    """Say which walls must not be met before `stop`, and from when on."""
    vy, y = Fraction(state.vy), Fraction(state.y)
    crossing = -y / vy if vy and y and (y > 0) != (vy > 0) and state.wall != "base" else None
    cap, stem = ("arc",), ("left", "right", "floor")
    near, far = (cap, stem) if in_cap else (stem, cap)
    yield near, Fraction(0), stop if crossing is None else min(stop, crossing)
    if isinstance(scene, Mushroom) and crossing is not None and crossing < stop:
        yield far, crossing, stop


def roots_before(scene, state, wall, start, stop):
    """Count the roots of f in the open stretch, f(0) and its root removed on the wall being left."""
    total = 0
    for a, b, instant in stretches(scene, state, start, stop):
        p = wall_polynomial(scene, state, wall, instant)
        if state.wall == wall:
            own = wall_polynomial(scene, state, wall, Fraction(state.t))
            p = add(p, [-at(own, Fraction(0))])
            if a == 0:
                p = p[1:]
        total += bool(p) and Sturm(p).n_roots(a, b)
    return total


@settings(max_examples=250)
@given(scenes_and_states())
def test_sturm_counts_no_root_before_the_collision(drawn):
    scene, state, t_end = drawn
    moving = [law for law in laws(scene).values() if not is_constant(law)]
    assume(not any(isinstance(law, Fourier) for law in moving))
    outcome = reference.next_collision(scene, state, t_end, digits=30)
    if isinstance(outcome, reference.Collision):
        stop = rational(outcome.dt.lo._mpf_)
    elif isinstance(outcome, reference.Horizon):
        stop = Fraction(t_end) - Fraction(state.t)
    else:
        return
    in_cap = not isinstance(scene, Stem) and (state.y > 0 or state.wall in ("arc", "base") or state.vy > 0)
    if state.wall in ("left", "right", "floor"):
        in_cap = False
    if isinstance(scene, Mushroom) and state.y < 0 and state.wall is None:
        in_cap = False
    for walls, start, end in excluded_windows(scene, state, in_cap, stop):
        for wall in walls:
            if wall in scene.walls:
                assert roots_before(scene, state, wall, start, end) == 0, wall
    if isinstance(outcome, reference.Collision) and outcome.wall != "base":
        lo, hi = stop, rational(outcome.dt.hi._mpf_)
        *_, (_, _, instant) = stretches(scene, state, Fraction(0), hi)
        p = wall_polynomial(scene, state, outcome.wall, instant)
        own = wall_polynomial(scene, state, outcome.wall, Fraction(state.t))
        residual = at(own, Fraction(0)) if state.wall == outcome.wall else 0
        assert at(p, lo) > residual > at(p, hi)
