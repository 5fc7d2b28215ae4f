"""A stepper in plain Python that speaks protocol 1: an example of what `mushrooms check` grades.

    mushrooms check -- python stepper.py

It uses nothing but the standard library. Each wall is a function f(s) of the flight time s, positive inside.
From a time at which f > 0, the parabola with the largest curvature that the laws allow stays below f; its
root is therefore a safe step, and such steps walk up to the first root and never past it. What rounding
leaves open (two walls at once, a graze, the mouth's edge) is answered `undecided`. Scenes are refused where
one of N_SAMPLES instants of the period breaks them: sampling, not proof.
"""

# mypy: ignore-errors
# ruff: noqa: D101, D102, D103, N818

import json
import math
import sys
import time

from laws import BangBang, Fourier, Mouth, Refused, number, read_law

U = 2.0**-53
SLACK = 16.0  # rounding errors that one evaluation of f may add up, in units of U times its terms
MAX_STEPS = 20_000
N_SAMPLES = 512
LARGEST = 1e100  # beyond it squares might overflow
PARAMETERS = {"cap": ["r"], "stem": ["w", "h"], "mushroom": ["r", "h"]}


class Open(Exception):
    """Rounding leaves it open: `undecided`."""


class Table:
    def __init__(self, data):
        self.kind = data.get("table") if isinstance(data, dict) else None
        if self.kind not in PARAMETERS:
            raise Refused(f"table = {self.kind!r}, must be cap, stem or mushroom")
        needed = set(PARAMETERS[self.kind]) | ({"w", "nu"} & set(data) if self.kind == "mushroom" else set())
        if self.kind == "mushroom" and len(needed) != 3:
            raise Refused("a mushroom needs exactly one of w and nu")
        extra = set(data) - needed - {"table", "name", "notes"} - ({"slope"} if self.kind != "cap" else set())
        if extra or needed - set(data):
            raise Refused(f"scene: unknown or missing field {', '.join(sorted(extra | needed - set(data)))}")
        laws = {p: read_law(data[p], p) for p in sorted(needed | {"slope"} & set(data))}
        moving = sorted({law.period for law in laws.values() if law.period})
        if len(moving) > 1:
            raise Refused(f"the laws have different periods: {moving}")
        self.r, self.h = laws.get("r"), laws.get("h")
        self.w = Mouth(laws["nu"], laws["r"]) if "nu" in laws else laws.get("w")
        self.slope = laws.get("slope", Fourier(0.0))
        start = min((law.start for law in laws.values() if isinstance(law, BangBang)), default=0.0)
        for i in range(N_SAMPLES if moving else 1):
            self.check(start + i / N_SAMPLES * (moving[0] if moving else 0.0), laws)

    def check(self, t, laws):
        for name, law in laws.items():
            if name != "slope" and law.at(t) <= 0:
                raise Refused(f"{name} = {law.at(t)} at t = {t}, must be > 0")
        if "nu" in laws and laws["nu"].at(t) > 1:
            raise Refused(f"nu = {laws['nu'].at(t)} at t = {t}, must be <= 1")
        if self.kind == "mushroom" and "w" in laws and self.w.at(t) > self.r.at(t):
            raise Refused(f"w = {self.w.at(t)} > r = {self.r.at(t)} at t = {t}")
        if self.kind != "cap" and self.w.at(t) <= self.h.at(t) * self.slope.at(t):
            raise Refused(f"w = {self.w.at(t)} <= h slope at t = {t}: the stem closes")


class Flight:
    """One straight flight: every wall's f as a function of the time s since its start."""

    def __init__(self, table, state):
        self.table, self.t, self.left = table, state["t"], state["wall"]
        self.x, self.y, self.vx, self.vy = (state[name] for name in ("x", "y", "vx", "vy"))

    def gap(self, wall, s):
        """Return f(s), f'(s) and the rounding error that f may carry.

        f is written as f(0) plus its change: f(0) is taken out for the wall that the particle leaves.
        """
        x, y, vx, vy, table = self.x, self.y, self.vx, self.vy, self.table
        if wall == "arc":
            r, (rise, rate) = table.r.at(self.t), table.r.rise(self.t, s)
            square, along = vx * vx + vy * vy, x * vx + y * vy
            first, size = r * r - (x * x + y * y), table.r.high**2 + x * x + y * y
            change = rise * (2 * r + rise) - s * (2 * along + s * square)
            moved = abs(rise) * (2 * table.r.high) + s * (2 * abs(x * vx) + 2 * abs(y * vy) + s * square)
            slope = 2 * (r + rise) * rate - 2 * (along + s * square)
        elif wall in ("left", "right"):
            side = 1.0 if wall == "left" else -1.0
            w, lean = table.w.at(self.t), table.slope.at(self.t)
            (rise, rate), (tilt, tilt_rate) = table.w.rise(self.t, s), table.slope.rise(self.t, s)
            first, size = w + lean * y + side * x, table.w.high + table.slope.high * abs(y) + abs(x)
            change = rise + tilt * (y + s * vy) + s * (lean * vy + side * vx)
            moved = abs(rise) + abs(tilt * (y + s * vy)) + s * (abs(lean * vy) + abs(vx))
            slope = rate + tilt_rate * (y + s * vy) + (lean + tilt) * vy + side * vx
        elif wall == "floor":
            rise, rate = table.h.rise(self.t, s)
            first, size = y + table.h.at(self.t), abs(y) + table.h.high
            change, moved, slope = s * vy + rise, s * abs(vy) + abs(rise), vy + rate
        else:
            up = -1.0 if table.kind == "stem" else 1.0
            first, size, change, moved, slope = up * y, abs(y), up * s * vy, s * abs(vy), up * vy
        if wall == self.left:
            first = size = 0.0
        return first + change, slope, SLACK * U * (size + moved)

    def curvature(self, wall):
        """Return a bound on |f''| over the whole flight."""
        table = self.table
        if wall == "arc":
            return 2 * (self.vx**2 + self.vy**2 + table.r.high * table.r.curvature + table.r.slope**2)
        if wall == "floor":
            return table.h.curvature
        if wall == "base":
            return 0.0
        return table.w.curvature + table.slope.curvature * table.h.high + 2 * table.slope.slope * abs(self.vy)

    def advance(self, wall, s):
        """Take one safe step from s: return the new s, and at the root the error of its time and f'."""
        f, slope, error = self.gap(wall, s)
        bend = self.curvature(wall)
        if f > error:
            root = math.sqrt(slope * slope + 2 * bend * f)
            step = 2 * f / (root - slope) if slope < 0 else (slope + root) / bend if bend else math.inf
            return s + step, None
        if slope >= 0 or slope * slope <= 4 * bend * error:
            raise Open(f"{wall} is grazed or touched within rounding")
        s -= f / slope
        s -= self.gap(wall, s)[0] / slope
        return s, (2 * error / -slope + 4 * U * s, self.gap(wall, s)[1])

    def beginning(self, wall, begin):
        """Return where to search from: f > f'(0) s - bend s^2 / 2 > 0 before, on the wall being left."""
        if wall != self.left:
            return begin
        bend = self.curvature(wall)
        return max(begin, 2 * self.gap(wall, 0.0)[1] / bend) if bend else math.inf

    def roots(self, walls, begin, end):
        """Return (s, error, f', wall) of the first roots; the wall farthest behind always moves next."""
        found, times = [], {wall: self.beginning(wall, begin) for wall in walls}
        for _ in range(MAX_STEPS):
            wall = min(times, key=times.get, default=None)
            if wall is None or not times[wall] <= end:
                return found
            times[wall], hit = self.advance(wall, times[wall])
            if hit:
                s = times.pop(wall)
                end = min(end, (s + hit[0]) * (1 + 8 * U))
                found.append((s, *hit, wall))
        raise Open(f"no decision within {MAX_STEPS} steps")

    def is_in_cap(self):
        if self.table.kind != "mushroom":
            return self.table.kind == "cap"
        if self.left is None and self.y == 0 and self.vy == 0:
            raise Open("it flies along the mouth")
        is_above = self.y > 0 or (self.y == 0 and self.vy > 0)
        return self.left in ("arc", "base") or (self.left is None and is_above)

    def check_inside(self, walls):
        for wall in walls:
            f, slope, error = self.gap(wall, 0.0)
            if wall == self.left or (wall == "base" and f == 0 and slope > 0):
                continue
            if f < -error:
                raise Refused(f"the state is beyond {wall}")
            if f <= error:
                raise Open(f"the state is on {wall}")

    def first_hit(self, horizon):
        """Return (wall, s, f') of the first collision, or None when there is none before the horizon."""
        inside, begin = self.is_in_cap(), 0.0
        while True:
            walls = ("arc", "base") if inside else ("left", "right", "floor", "base")
            level = math.inf  # when it reaches the level of the mouth
            if self.table.kind == "mushroom":
                walls = walls[:-1]
                if self.left != "base" and (self.vy < 0 if inside else self.vy > 0):
                    level = max(0.0, -self.y / self.vy)
            if begin == 0:
                self.check_inside(walls)
            found = self.roots(walls, begin, min(horizon, level, sys.float_info.max / 2) * (1 + 8 * U))
            others = [(level, 4 * U * level, 0.0, "mouth"), (horizon, 2 * U * horizon, 0.0, "horizon")]
            events = sorted([*found, *others])
            (s, error, slope, wall), (later, its_error, _, other) = events[:2]
            near = other if later - s <= error + its_error else ""
            on_base = wall == "mouth" and inside and self.is_on_base(s)
            if near and (on_base or {wall, near} != {"mouth", "horizon"}):
                raise Open(f"{wall} and {near} come within rounding")
            if wall != "mouth" or on_base:
                return ("base", s, self.vy) if on_base else (wall, s, slope) if wall != "horizon" else None
            inside, begin = not inside, s

    def is_on_base(self, s):
        w = self.table.w.at(self.t) + self.table.w.rise(self.t, s)[0]
        beside = abs(self.x + s * self.vx) - w
        size = abs(self.x) + 2 * s * abs(self.vx) + 2 * self.table.w.high + s * self.table.w.slope
        if abs(beside) <= SLACK * U * size:
            raise Open("the mouth's edge is hit within rounding")
        return beside > 0

    def normal(self, wall, s):
        """Return the gradient of f by x and y."""
        if wall == "arc":
            return -2 * (self.x + s * self.vx), -2 * (self.y + s * self.vy)
        if wall in ("left", "right"):
            lean = self.table.slope.at(self.t) + self.table.slope.rise(self.t, s)[0]
            return 1.0 if wall == "left" else -1.0, lean
        return 0.0, -1.0 if wall == "base" and self.table.kind == "stem" else 1.0


def read_state(data, t_end):
    fields = ("t", "x", "y", "vx", "vy")
    if not isinstance(data, dict) or not set(fields) <= set(data) <= {*fields, "wall"}:
        raise Refused("state must have the fields t, x, y, vx, vy and may have wall, no other")
    state = {name: number(data[name], "state." + name) for name in fields} | {"wall": data.get("wall")}
    if state["wall"] not in (None, "arc", "base", "left", "right", "floor"):
        raise Refused(f"state.wall = {state['wall']!r} is no wall")
    if number(t_end, "t_end") < state["t"]:
        raise Refused(f"t_end = {t_end}, must be >= state.t = {state['t']}")
    return state


def check_wall(flight):
    wall, table = flight.left, flight.table
    if wall is None:
        return
    near_cap, near_stem = ("arc", "base"), ("left", "right", "floor")
    walls = {"cap": near_cap, "stem": (*near_stem, "base"), "mushroom": near_cap + near_stem}[table.kind]
    is_elsewhere = flight.y < 0 if wall == "arc" else flight.y > 0 and wall in near_stem
    if wall not in walls or is_elsewhere:
        raise Refused(f"state.wall = {wall!r}: there is no such wall, or not at y = {flight.y}")
    flight.left = None
    f, slope, _ = flight.gap(wall, 0.0)
    flight.left = wall
    size = table.h.high if wall == "floor" else (table.r or table.w).high
    if abs(f) > 2.0**-20 * size * (2 * size if wall == "arc" else 1.0):
        raise Refused(f"state.wall = {wall!r}, but the state is not on it")
    if slope <= 0:
        raise Refused(f"state.wall = {wall!r}: starts on it and moves into it") if slope < 0 else Open("rest")


def step(table, state, t_end):
    flight = Flight(table, state)
    if max(map(abs, (flight.x, flight.y, flight.vx, flight.vy))) > LARGEST:
        raise Open(f"numbers beyond {LARGEST} may overflow")
    check_wall(flight)
    horizon = t_end - state["t"]
    hit = flight.first_hit(horizon)
    s = hit[1] if hit else horizon
    x, y, vx, vy = flight.x + s * flight.vx, flight.y + s * flight.vy, flight.vx, flight.vy
    if hit is None:
        return {"outcome": "horizon", "t": t_end, "x": x, "y": y, "vx": vx, "vy": vy}
    wall, _, slope = hit
    # v - 2 (v.n - u) n, as f' = (v.n - u) |grad f|
    nx, ny = flight.normal(wall, s)
    factor = 2 * slope / (nx * nx + ny * ny)
    place = {"outcome": "collision", "wall": wall, "dt": s, "t": state["t"] + s, "x": x}
    return place | {"y": 0.0 if wall == "base" else y, "vx": vx - factor * nx, "vy": vy - factor * ny}


def follow(table, state, n_collisions, t_end):
    steps = []
    while len(steps) < n_collisions:
        try:
            steps.append(step(table, state, t_end))
        except Open as question:
            steps.append({"outcome": "undecided", "reason": str(question)})
        if steps[-1]["outcome"] != "collision":
            break
        state = {name: steps[-1][name] for name in ("t", "x", "y", "vx", "vy", "wall")}
    return steps


def answer(request):
    """Return what a request deserves, without its seq."""
    command, t_end = request["cmd"], request.get("t_end", sys.float_info.max)
    try:
        table, state = Table(request["scene"]), read_state(request["state"], t_end)
        if command == "step":
            return step(table, state, t_end)
        if command == "trajectory":
            return {"steps": follow(table, state, request["collisions"], t_end)}
        ns = []
        for _ in range(request["repeat"]):
            begin = time.perf_counter_ns()
            steps = follow(table, state, request["collisions"], t_end)
            ns.append(time.perf_counter_ns() - begin)
        return {"ns": ns, "steps": steps[-1:]}
    except Refused as refusal:
        return {"outcome": "rejected", "reason": str(refusal)}
    except Open as question:
        return {"outcome": "undecided", "reason": str(question)}
    except (KeyError, TypeError, ValueError, OverflowError, ZeroDivisionError) as error:
        return {"outcome": "rejected", "reason": f"{type(error).__name__}: {error}"}


INTRODUCTION = {"protocol": 1, "name": "example-python", "version": "1.0", "language": "Python"}
INTRODUCTION["profiles"] = ["step", "trajectory", "time"]
INTRODUCTION["tables"] = ["cap", "stem", "mushroom"]
INTRODUCTION["laws"] = ["constant", "fourier", "bang-bang"]


def main():
    for line in sys.stdin:
        try:
            request = json.loads(line)
            command = request["cmd"]
        except (ValueError, TypeError, KeyError) as error:
            print(json.dumps({"seq": None, "outcome": "rejected", "reason": repr(error)}), flush=True)
            continue
        if command == "stop":
            return
        if command == "start":
            reply = INTRODUCTION
        elif command == "echo":
            reply = {"values": request["values"]}
        else:
            reply = {"seq": request.get("seq"), **answer(request)}
        print(json.dumps(reply), flush=True)


if __name__ == "__main__":
    main()
