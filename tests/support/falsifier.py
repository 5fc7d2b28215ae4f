"""A falsifier of claims: it samples a claimed flight and looks for a wall that must not be met there.

A claim is a line of the corpus. Walls are those of `scene.geometry`, which neither the reference nor the
verifier uses. They are evaluated in mpmath to 60 decimals, at many instants of the flight, more of them near
both ends. A golden section goes on around the lowest samples. This shares no theorem with the reference or
the verifier. A claim that it falsifies is false; one that it does not falsify may be false. Not handled:
flows, `rejected`, `undefined`, and whether the numbers of a claim are right.
"""

from functools import cache
from typing import Any

import mpmath

from scene import from_data
from scene.geometry import table_at

DECIMALS = 60
N_ENDS = 60  # instants at 2^-1, 2^-2 ... of the flight's length from either end
N_LOWEST = 200  # samples of a wall around which to look closer
MAX_SAMPLES = 20_000
NUMBERS = ("dt", "x", "y", "vx", "vy")
Number = Any  # an mpf
Line = dict[str, Any]


@cache
def numbers() -> Any:
    """Return the context of mpmath that everything here is computed in."""
    context = mpmath.MPContext()
    context.dps = DECIMALS
    return context


class Flight:
    """A straight flight from a state, and the walls along it; s is the time since departure.

    Args:
        scene: the wire's form.
        state: t, x, y, vx, vy and wall.
    """

    def __init__(self, scene: Line, state: Line) -> None:
        mp = numbers()
        self.scene, self.table = from_data(scene), scene["table"]
        lists = [part for law in scene.values() if isinstance(law, dict) for part in law.values()]
        self.n_waves = max(len(part) for part in [*lists, [0]] if isinstance(part, list))
        self.left: Any = state.get("wall")
        self.t, self.x, self.y, self.vx, self.vy = (mp.mpf(state[name]) for name in ("t", *NUMBERS[1:]))
        self.residual = self.gaps(mp.zero)[self.left] if self.left else mp.zero

    def height(self, s: Number) -> Number:
        """Return y as long as nothing is met."""
        return self.y + self.vy * s

    def gaps(self, s: Number) -> dict[str, Number]:
        """Return f of all walls of the table, positive inside."""
        table, x, y = table_at(numbers(), self.scene, self.t + s), self.x + self.vx * s, self.height(s)
        return {wall: table.gap(wall, x, y) for wall in self.scene.walls}

    def in_reach(self, s: Number) -> dict[str, Number]:
        """Return f of the walls of the particle's part of the table, less the residual of the one left."""
        y = self.height(s)
        walls: tuple[str, ...] = ("left", "right", "floor") if y else ("left", "right")
        if self.table == "cap" or (self.table == "mushroom" and (y > 0 or self.left == "base")):
            walls = ("base", "arc")
        elif self.table == "stem":
            walls = ("base", "left", "right", "floor")
        found = self.gaps(s)
        return {wall: found[wall] - (self.residual if wall == self.left else 0) for wall in walls}

    def instants(self, end: Number, n: int) -> list[Number]:
        """Return n instants or more, in order: a dozen for each wave or leg, more near both ends."""
        period = numbers().mpf(self.scene.period or numbers().inf)
        n = min(MAX_SAMPLES, max(n, int(12 * end / period * self.n_waves)))
        ends = [end / 2**k for k in range(1, N_ENDS)]
        inner = [end * k / n for k in range(1, n)]
        return sorted({*ends, *inner, *(end - s for s in ends)})


def falsify(line: Line, n: int = 1000) -> str | None:
    """Return a wall that a claimed path goes through, and when; or None.

    Args:
        line: a step or a trajectory of the corpus.
        n: instants to sample in each flight.
    """
    mp, state = numbers(), line["state"]
    for step in line["expect"][0].get("steps", ()):
        flight = Flight(line["scene"], state)
        if wrong := negative(flight, mp.mpf(step["dt"][0]), n):
            return wrong
        after = {name: (mp.mpf(step[name][0]) + mp.mpf(step[name][1])) / 2 for name in NUMBERS}
        state = {**after, "t": flight.t + after["dt"], "wall": step.get("wall")}
    return None


def negative(flight: Flight, end: Number, n: int) -> str | None:
    """Look for a wall in reach whose f is negative between departure and an end."""
    samples = [(s, flight.in_reach(s)) for s in flight.instants(end, n)]
    for s, gaps in samples:
        for wall, gap in gaps.items():
            if gap < 0:
                return f"{wall} is met before s = {mpmath.nstr(s, 17)}"
    for wall in flight.scene.walls:
        dips = []
        for (a, before), (_, at), (b, behind) in zip(samples, samples[1:], samples[2:], strict=False):
            if wall in before and wall in at and wall in behind and before[wall] > at[wall] <= behind[wall]:
                dips.append((at[wall], a, b))
        for _, a, b in sorted(dips)[:N_LOWEST]:
            s = _lowest(flight, wall, a, b)
            if flight.in_reach(s).get(wall, 0) < 0:
                return f"{wall} is met between two samples, before s = {mpmath.nstr(s, 17)}"
    return None


def _lowest(flight: Flight, wall: str, a: Number, b: Number) -> Number:
    """Return where f of a wall is least between two instants, by golden section."""
    golden = (numbers().sqrt(5) - 1) / 2
    for _ in range(25):
        left, right = b - golden * (b - a), a + golden * (b - a)
        is_left = flight.gaps(left)[wall] < flight.gaps(right)[wall]
        a, b = (a, right) if is_left else (left, b)
    return (a + b) / 2
