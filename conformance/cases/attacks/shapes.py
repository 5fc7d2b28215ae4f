"""Attacks by size and shape: extreme scales, late and negative times, long waits, odd laws, rest."""

from __future__ import annotations

import math

from conformance.cases.attacks.case import NEVER, Attack, Family, built
from conformance.cases.draws import Draw, SharedPeriod, clock, scene, state
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, State, Stem
from scene.transforms import scaled, scaled_state


def extreme_scale(draw: Draw) -> Attack:
    """A plain question with lengths and times scaled by powers of two up to 2^+-390, together."""
    plain = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw))
    start, t_end = state(draw, plain, {})
    length, time = draw.pick(range(-390, 391)), draw.pick(range(-390, 391))
    if draw.pick((True, False, False)):
        length, time = draw.pick((-390, 0, 390)), draw.pick((-390, 0, 390))
    # Speeds beyond 2^400 are refused by every stepper: keep within.
    time = min(max(time, length - 380), length + 380)
    return Attack(scaled(plain, length, time), scaled_state(start, length, time), 2.0**time * t_end)


def late_phase(draw: Draw) -> Attack:
    """A start up to 2^31 periods from time 0, before or after it."""
    plain = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw, ("fourier", "bang-bang")))
    turns = draw.pick((1.0, -1.0)) * draw.power(4, 31)
    late = turns * (6.3 if draw.pick((True, False)) else 4.0) + draw.part()
    start, t_end = state(draw, plain, {"t": late})
    return Attack(plain, start, max(t_end, start.t))


def long_wait(draw: Draw) -> Attack:
    """A hit after 20 or 100 periods in which a slow particle is far from every wall."""
    wait = draw.pick((20.0, 40.0, 100.0))
    law: Law
    if draw.pick((True, False)):
        period, law = 2 * math.pi, Fourier(mean=1.0, omega=1.0, cos=(0.2,), sin=(0.05, 0.02))
    else:
        period, law = 1.0, BangBang(knots=((0.0, 0.8), (draw.part(), 1.2), (1.0, 0.8)))
    speed = draw.between(0.5, 1.0) / (wait * period)
    vx, vy = draw.direction()
    t = period * draw.between(-2.0, 2.0)
    t_end = t + 2.5 * wait * period
    if draw.pick((True, False)):
        return Attack(Cap(r=law), State(t, 0.0, 0.25 * draw.part(), speed * vx, speed * abs(vy)), t_end)
    stem = Stem(w=law, h=law, slope=draw.pick((0.0, -0.1)))
    return Attack(stem, State(t, 0.0, -0.4, speed * vx, speed * vy), t_end)


def rest_and_sweep(draw: Draw) -> Attack:
    """A particle at rest, or nearly: swept up by a wall, or left alone up to the horizon."""
    shared = SharedPeriod("fourier", 1.0) if draw.pick((True, False)) else SharedPeriod("bang-bang", 1.5)
    plain = scene(draw, draw.pick(("cap", "stem", "mushroom")), shared)
    start, _ = state(draw, plain, {})
    size = draw.pick((0.0, 0.0, draw.power(-300, -10), draw.power(-40, -2)))
    vx, vy = (size * number for number in draw.direction())
    resting = State(start.t, start.x, start.y, vx, vy)
    if isinstance(plain, Mushroom) and start.y == 0:
        resting = State(start.t, start.x, 0.0, vx, abs(vy) + draw.power(-9, 0))
    return Attack(plain, resting, start.t + draw.pick((1.0, 7.0, 30.0)))


def narrow_base(draw: Draw) -> Attack:
    """A mouth nearly as wide as the cap: nu within 1e-9 of 1, or 1; the base is a sliver."""
    close = 1.0 - draw.pick((0.0, 10.0 ** -draw.between(3.0, 16.0)))
    nu: Law = close
    radii: tuple[Law, ...] = (1.0, Fourier(mean=1.0, omega=2.0, cos=(0.3,), sin=(0.1,)))
    r = draw.pick(radii)
    if draw.pick((True, False, False)):
        nu = Fourier(mean=0.75, omega=2.0, cos=(close - 0.75,))
    h, slope = draw.pick((0.5, 2.0)), draw.pick((0.0, -0.25))
    made = built(lambda: Mushroom(r=r, h=h, nu=nu, slope=slope))
    if made is None:
        return narrow_base(draw)
    if draw.pick((True, False)):
        return Attack(made, *state(draw, made, {"t": draw.between(-3.0, 3.0)}))
    # Towards the edge, from the cap.
    t, dt = draw.between(-3.0, 3.0), 0.5
    arrival = t + dt
    radius = r if isinstance(r, float) else 1.0 + 0.3 * math.cos(2 * arrival) + 0.1 * math.sin(2 * arrival)
    share = nu if isinstance(nu, float) else 0.75 + (close - 0.75) * math.cos(2 * arrival)
    target = radius * (share + (1 - share) * draw.between(-1.0, 1.0)) * draw.pick((1.0, -1.0))
    return Attack(made, State(t, 0.0, 0.25, target / dt, -0.25 / dt), t + 2.0)


def _harmonics(draw: Draw, n: int, size: float) -> tuple[float, ...]:
    return tuple(draw.between(-size, size) for _ in range(n))


def many_harmonics(draw: Draw) -> Attack:
    """Laws of 4 to 16 harmonics, and a side that leans and turns, at times of either sign.

    Many harmonics only where one law decides alone: scenes are proved valid by polynomials of their degrees.
    """
    omega = draw.pick((0.5, 1.0, 3.0))

    def law(mean: float, swing: float, harmonics: tuple[int, ...] = (4, 5)) -> Law:
        n = draw.pick(harmonics)
        return Fourier(
            mean=mean,
            omega=omega,
            cos=_harmonics(draw, n, swing / 2 / n),
            sin=_harmonics(draw, n, swing / 2 / n),
        )

    table = draw.pick(("cap", "stem", "mushroom"))
    made: Scene
    if table == "cap":
        made = Cap(r=law(1.0, 0.5, (4, 8, 12, 16)))
    elif table == "stem":
        made = Stem(w=law(0.6, 0.25), h=law(1.0, 0.4), slope=law(0.0, 0.2, (1, 2)))
    else:
        made = Mushroom(r=law(1.2, 0.4), w=law(0.5, 0.2), h=law(1.0, 0.4), slope=law(-0.05, 0.2, (1, 2)))
    at = {"speed": draw.power(-4, 6) * draw.between(1.0, 2.0), "t": draw.between(-40.0, 40.0)}
    return Attack(made, *state(draw, made, at))


def mixed_laws(draw: Draw) -> Attack:
    """Fourier laws with a rational period and bang-bang ones in one scene; hits at quarter periods too."""
    period = draw.pick((1.0, 2.0, 4.0))
    kinds = [draw.pick(("fourier", "bang-bang", "constant")) for _ in range(4)]

    def law(low: float, high: float) -> Law:
        kind = kinds.pop()
        if kind == "constant":
            return draw.short(low, high)
        if kind == "fourier":
            n, mean = draw.pick((1, 2, 4)), (low + high) / 2
            size = 0.49 * (high - low) / (2 * n)
            return Fourier(
                mean=mean, period=period, cos=_harmonics(draw, n, size), sin=_harmonics(draw, n, size)
            )
        knots = [(0.0, draw.short(low, high)), (period * draw.part(), draw.short(low, high))]
        return BangBang(knots=(*knots, (period, knots[0][1])))

    made = Mushroom(r=law(0.7, 1.5), w=law(0.1, 0.6), h=law(0.4, 2.0), slope=law(-0.3, 0.04))
    quarter = period * draw.pick(range(-40, 41)) / 4
    at = {"speed": draw.power(-3, 5), "t": draw.pick((quarter, 100 * draw.between(-1.0, 1.0)))}
    start, t_end = state(draw, made, at)
    if draw.pick((True, False, False)):
        return Attack(made, start, NEVER, 3)
    return Attack(made, start, t_end)


def slow_towards_waves(draw: Draw) -> Attack:
    """Come within thousands of periods to a wall of several harmonics, never all at their least together."""
    sin, cos = _harmonics(draw, 3, 0.05), _harmonics(draw, 2, 0.05)
    law = Fourier(mean=1.0, period=draw.pick((1.0, 0.375)), sin=(0.1, *sin), cos=cos)
    v, across = 10.0 ** -draw.between(2.0, 5.0), draw.pick((0.0, 0.125, -0.5))
    t, inside = draw.between(-9.0, 9.0), draw.between(0.25, 0.6)
    options: tuple[tuple[Scene, State], ...] = (
        (Stem(w=1.0, h=law), State(t, 0.0, -inside, across * v / 4, -v)),
        (Stem(w=law, h=1.0), State(t, draw.pick((1.0, -1.0)) * inside, -0.5, v, across * v / 4)),
        (Cap(r=law), State(t, 0.0, inside, across * v, v)),
        (Mushroom(r=2.0, h=1.5, w=law), State(t, -inside, -0.75, -v, across * v / 4)),
    )
    return Attack(*draw.pick(options), t + 4.0 / v)


FAMILIES = (
    Family(slow_towards_waves, "walls go as far as all their waves together, so that the first hit is lost"),
    Family(extreme_scale, "squares overflow or vanish, though every number is in range"),
    Family(late_phase, "the phase of a late or negative start loses digits"),
    Family(long_wait, "a hit after many periods of waiting is given up or skipped"),
    Family(rest_and_sweep, "a particle at rest is never hit, or divided by its speed"),
    Family(narrow_base, "a base of 1e-9 of the cap is lost in rounding"),
    Family(many_harmonics, "bounds hold for a few harmonics, straight sides, t > 0"),
    Family(mixed_laws, "a scene of both kinds of law is taken for one kind"),
)
