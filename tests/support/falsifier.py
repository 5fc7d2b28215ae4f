"""A falsifier of claims: it samples a claimed flight and looks for a sign that must not be there.

A claim is a line of the corpus. Walls are those of `scene.geometry`, which neither the reference nor the
verifier uses. They are evaluated in mpmath to 60 decimals, at many instants of the flight, more of them near
both ends. A golden section goes on around the lowest samples. What is found so is confirmed to 300 decimals.
A path is followed with the falsifier's own numbers: the claim only says where to look for a hit. This shares
no theorem with the reference or the verifier. A claim that it falsifies is false; one that it does not
falsify may be false. Not handled: flows, `rejected`, and whether a scene is valid.
"""

from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath

from scene import from_data
from scene.geometry import table_at

CORPUS = Path(__file__).parents[2] / "conformance" / "corpus"
DECIMALS, CONFIRMED = 60, 300
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
        self.residual = mp.zero
        if self.left:
            self.residual = self.walls(mp.zero)[self.left]

    def place(self, s: Number) -> tuple[Number, Number]:
        """Return where the particle is, as long as nothing is met."""
        return self.x + self.vx * s, self.y + self.vy * s

    def walls(self, s: Number) -> dict[str, Number]:
        """Return f of all walls of the table, positive inside, without the residual of the one being left."""
        table = table_at(numbers(), self.scene, self.t + s)
        found = {wall: table.gap(wall, *self.place(s)) for wall in self.scene.walls}
        return found | ({self.left: found[self.left] - self.residual} if self.left else {})

    def reach(self, s: Number) -> tuple[str, ...]:
        """Return the walls of the part of the table that the particle is in."""
        y = self.place(s)[1]
        if self.table == "cap" or (self.table == "mushroom" and (y > 0 or self.left == "base")):
            return ("base", "arc")
        if self.table == "stem":
            return ("base", "left", "right", "floor")
        return ("left", "right", "floor") if y else ("left", "right")

    def crossing(self) -> Number | None:
        """Return when a flight in a mushroom changes between cap and stem."""
        is_free = self.table == "mushroom" and self.left != "base" and self.y and self.vy
        return -self.y / self.vy if is_free and self.y * self.vy < 0 else None

    def is_mouth_open(self, s: Number) -> bool:
        """Tell whether |x| < w."""
        walls = self.walls(s)
        return bool(min(walls["left"], walls["right"]) > 0)

    def root(self, wall: str, low: Number, high: Number) -> Number:
        """Return where f of a wall, positive at low and negative at high, is zero."""
        for _ in range(numbers().prec):
            middle = (low + high) / 2
            low, high = (middle, high) if self.walls(middle)[wall] > 0 else (low, middle)
        return low

    def after(self, wall: str, s: Number) -> Line:
        """Return the state after the bounce v - 2 (v.n - u) n."""
        table, (x, y) = table_at(numbers(), self.scene, self.t + s), self.place(s)
        # f is of second degree at most, so that differences are derivatives.
        fx, fy = (
            (table.gap(wall, x + i, y + j) - table.gap(wall, x - i, y - j)) / 2 for i, j in ((1, 0), (0, 1))
        )
        push = 2 * table.gap_rate(wall, x, y, self.vx, self.vy) / (fx**2 + fy**2)
        return self.free(s) | {"vx": self.vx - push * fx, "vy": self.vy - push * fy, "wall": wall}

    def free(self, s: Number) -> Line:
        """Return the state where nothing is met."""
        x, y = self.place(s)
        return {"dt": s, "t": self.t + s, "x": x, "y": y, "vx": self.vx, "vy": self.vy, "wall": None}

    def instants(self, begin: Number, end: Number, n: int) -> list[Number]:
        """Return n instants or more, in order: a dozen for each wave or leg, more near both ends."""
        span = end - begin
        period = numbers().mpf(self.scene.period or numbers().inf)
        n = min(MAX_SAMPLES, max(n, int(12 * span / period * self.n_waves)))
        ends = [span / 2**k for k in range(1, N_ENDS)]
        inner = [span * k / n for k in range(1, n)]
        return [begin + s for s in sorted({*ends, *inner, *(span - s for s in ends)})]


def falsify(line: Line, n: int = 1000) -> str | None:
    """Return what a claim says that is not so, or None.

    Args:
        line: a step or a trajectory of the corpus that does not begin with a refusal.
        n: instants to sample in each flight.
    """
    if _wrong(line, n) is None:
        return None
    with numbers().workdps(CONFIRMED):
        return _wrong(line, n)


def _wrong(line: Line, n: int) -> str | None:
    claim, state, mp = line["expect"][0], line["state"], numbers()
    for step in claim.get("steps", ()):
        flight, wall = Flight(line["scene"], state), step.get("wall")
        rest = mp.mpf(line["t_end"]) - flight.t
        end = _hit(flight, step) if wall else rest
        if end is None or (wall and end >= rest):
            return f"f of {wall} does not change its sign at dt = {step['dt'][0]}, before t_end"
        state = flight.after(wall, end) if wall else flight.free(end)
        wrong = _misplaced(flight, end, wall) or negative(flight, end, n) or _different(flight, step, state)
        if wrong:
            return wrong
    return _untied(Flight(line["scene"], state), line, n) if claim["outcome"] == "undefined" else None


def _hit(flight: Flight, step: Line) -> Number | None:
    """Return the claimed hit to all digits: None without a change of sign about its enclosure."""
    mp = numbers()
    low, high = (mp.mpf(end) for end in step["dt"])
    spare = high * mp.mpf(10) ** -40
    ends = low - spare, high + spare
    before, behind = (flight.walls(s)[step["wall"]] for s in ends)
    return flight.root(step["wall"], *ends) if before > 0 > behind else None


def _misplaced(flight: Flight, end: Number, wall: str | None) -> str | None:
    """Compare |x| with w where y = 0 is crossed."""
    if flight.table != "mushroom":
        return None
    if wall == "base":
        return "the mouth is open where the base is met" if flight.is_mouth_open(end) else None
    crossing = flight.crossing()
    is_shut = crossing is not None and crossing < end and not flight.is_mouth_open(crossing)
    return "the mouth is shut where it is passed" if is_shut else None


def negative(flight: Flight, end: Number, n: int) -> str | None:
    """Look for a wall in reach whose f is negative between departure and an end."""
    samples = [(s, flight.walls(s), flight.reach(s)) for s in flight.instants(numbers().zero, end, n)]
    for s, walls, reach in samples:
        for wall in reach:
            if walls[wall] < 0:
                return f"{wall} is met before s = {mpmath.nstr(s, 17)}"
    for wall in samples[0][1]:
        dips = []
        for before, at, behind in zip(samples, samples[1:], samples[2:], strict=False):
            if wall in at[2] and before[1][wall] > at[1][wall] <= behind[1][wall]:
                dips.append((at[1][wall], before[0], behind[0]))
        for _, a, b in sorted(dips)[:N_LOWEST]:
            s = _lowest(flight, wall, a, b)
            if flight.walls(s)[wall] < 0 and wall in flight.reach(s):
                return f"{wall} is met between two samples, before s = {mpmath.nstr(s, 17)}"
    return None


def _lowest(flight: Flight, wall: str, a: Number, b: Number) -> Number:
    """Return where f of a wall is least between two instants, by golden section."""
    golden = (numbers().sqrt(5) - 1) / 2
    for _ in range(25):
        left, right = b - golden * (b - a), a + golden * (b - a)
        is_left = flight.walls(left)[wall] < flight.walls(right)[wall]
        a, b = (a, right) if is_left else (left, b)
    return (a + b) / 2


def _different(flight: Flight, step: Line, state: Line) -> str | None:
    """Compare the claimed numbers with those of the flight."""
    mp, start = numbers(), flight.free(numbers().zero)
    for name in NUMBERS:
        low, high = (mp.mpf(end) for end in step[name])
        spare = (abs(state[name]) + abs(start[name])) * mp.mpf(10) ** -40
        if not low - spare <= state[name] <= high + spare:
            return f"{name} = {step[name][0]} must be {mpmath.nstr(state[name], 24)}"
    return None


def _untied(flight: Flight, line: Line, n: int) -> str | None:
    """Look for an ordinary end of a flight that is claimed to have none."""
    mp = numbers()
    tiny = mp.mpf(10) ** -30
    at, start = table_at(mp, flight.scene, flight.t), flight.place(mp.zero)
    on = [wall for wall, f in flight.walls(mp.zero).items() if abs(f) < tiny]
    if len(on) > 1 or any(at.gap_rate(wall, *start, flight.vx, flight.vy) < tiny for wall in on):
        return None
    first = next(next_hits(flight, mp.zero, mp.mpf(line["t_end"]) - flight.t, n), None)
    if first and sum(abs(f) < tiny for f in flight.walls(first[1]).values()) > 1:
        return None
    return f"nothing is undefined where {first[0] if first else 'nothing'} is met"


def next_hits(
    flight: Flight, begin: Number, end: Number, n: int, only: tuple[str, ...] = ()
) -> Iterator[tuple[str, Number]]:
    """Yield walls whose f turns negative between two instants, and when, in order as far as samples see.

    Args:
        flight: the flight.
        begin: where to begin, since departure.
        end: where to end.
        n: how many instants to sample.
        only: which walls to look at; by default those in reach at each instant.
    """
    samples = ((s, flight.walls(s)) for s in flight.instants(begin, end, n))
    for (a, before), (b, behind) in pairwise(samples):
        met = [wall for wall in only or flight.reach(a) if before[wall] > 0 >= behind[wall]]
        for root, wall in sorted((flight.root(wall, a, b), wall) for wall in met):
            if only or wall != "base" or flight.table != "mushroom" or not flight.is_mouth_open(root):
                yield wall, root
