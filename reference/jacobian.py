"""The Jacobian of a step, by implicit differentiation of the wall equation.

With event point q = (x + vx s, y + vy s, t + s) and D = f'(s), the root's condition gives
ds = -(f_q . dq at fixed s) / D, and the bounce v' = v - 2 D N / |N|^2 with N = (f_x, f_y) is
differentiated through the second partials of f. Where the wall being left is met again, the
equation is f(s) = f(0), and f(0) moves with the state too. Along a path that stays so: the residual
of a wall met again and again is that of the first start, but each flight begins where f is just
this, so that f at its own begin moves as much, whatever start moves it. After another wall it is 0,
and moves not at all.

The second derivatives jump at a knot. Rounding may put a hit on either side of one that is as near
as binary64 resolves the time of the hit, so both sides' derivatives are enclosed there.
"""

from fractions import Fraction

from reference.arithmetic import Arithmetic, Enclosure, Interval, exact_ends
from reference.course import Course, Hit

Matrix = list[list[Interval]]
NEAR = Fraction(4, 2**53)  # of the numbers that the time of a hit follows from: four backward ulps


def step_jacobian(course: Course, hit: Hit) -> Matrix:
    """Enclose the derivatives of (dt, x, y, vx, vy) after the bounce by (t, x, y, vx, vy) before.

    Args:
        course: the flight from the state before.
        hit: the first collision.

    Returns:
        5 rows (outputs) of 5 columns (inputs), intervals.
    """
    arithmetic = course.arithmetic
    flight = course.flight
    motion = course.motion
    s = hit.time - flight.begin
    d = hit.slope
    f_x, f_y, f_t = motion.gradient(hit.wall, hit.time)
    is_met_again = hit.wall in course.leaving
    origin = motion.gradient(hit.wall, flight.begin) if is_met_again else (arithmetic.zero,) * 3
    moves = [
        (
            origin[0] * e_x
            + origin[1] * e_y
            + origin[2] * e_t
            - f_x * (e_x + s * e_vx)
            - f_y * (e_y + s * e_vy)
            - f_t * e_t
        )
        / d
        for e_t, e_x, e_y, e_vx, e_vy in identity(arithmetic)
    ]
    f_xx, f_yy, f_yt, f_tt = motion.hessian(hit.wall, _with_near_knot(course, hit, moves))
    n2 = arithmetic.square(f_x) + arithmetic.square(f_y)
    columns = []
    for ds, (e_t, e_x, e_y, e_vx, e_vy) in zip(moves, identity(arithmetic), strict=True):
        x, y, t = e_x + s * e_vx + flight.vx * ds, e_y + s * e_vy + flight.vy * ds, e_t + ds
        d_x, d_y, d_t = f_xx * x, f_yy * y + f_yt * t, f_yt * y + f_tt * t
        dd = d_x * flight.vx + d_y * flight.vy + d_t + f_x * e_vx + f_y * e_vy
        dn2 = 2 * (f_x * d_x + f_y * d_y)
        push = 2 * d / n2
        dpush = 2 * dd / n2 - push * dn2 / n2
        columns.append([ds, x, y, e_vx - dpush * f_x - push * d_x, e_vy - dpush * f_y - push * d_y])
    if hit.wall == "base":
        for column in columns:
            column[2] = arithmetic.zero
    return [[columns[i][k] for i in range(5)] for k in range(5)]


def _with_near_knot(course: Course, hit: Hit, moves: list[Interval]) -> Interval:
    """Return the time of a hit, widened over a knot that rounding may take it across.

    Args:
        course: the flight from the state before.
        hit: the collision.
        moves: derivatives of the flight time by t, x, y, vx, vy.
    """
    flight = course.flight
    low, high = exact_ends(hit.time)
    begin = course.arithmetic.number(flight.instant)
    sizes = [begin + hit.time, begin]
    sizes += [
        d * at
        for d, at in zip(moves, (begin, flight.x, flight.y, flight.vx, flight.vy), strict=True)
    ]
    reach = NEAR * sum(max(map(abs, exact_ends(size))) for size in sizes)
    is_near = course.motion.timeline.knot_between(low - reach, high + reach) is not None
    return course.arithmetic.between(low - reach, high + reach) if is_near else hit.time


def chained(later: Matrix, earlier: Matrix) -> Matrix:
    """Return d(state after) / d(state before all): the product, with t' = t + dt in row t.

    Args:
        later: Jacobian of the last step.
        earlier: d(t, x, y, vx, vy) at its start / d(initial state).
    """
    rows = [
        [sum(a * b[j] for a, b in zip(row, earlier, strict=True)) for j in range(5)]
        for row in later
    ]
    rows[0] = [a + b for a, b in zip(rows[0], earlier[0], strict=True)]
    return rows


def identity(arithmetic: Arithmetic) -> Matrix:
    """Return the unit matrix."""
    return [[arithmetic.number(int(i == j)) for j in range(5)] for i in range(5)]


def enclosures(arithmetic: Arithmetic, matrix: Matrix) -> tuple[tuple[Enclosure, ...], ...]:
    """Return a matrix free of its working precision."""
    return tuple(tuple(arithmetic.enclosure(entry) for entry in row) for row in matrix)
