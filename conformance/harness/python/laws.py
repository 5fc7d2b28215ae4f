"""Laws of motion in plain Python, as the example stepper uses them: their values and bounds.

`rise` is the point of it: f(t + s) - f(t) without cancellation, however short s is.
"""

# mypy: ignore-errors
# ruff: noqa: D102, D103, B905, N818, RUF007

import json
import math


class Refused(Exception):
    """Bad input: `rejected`."""


class Fourier:
    """mean + sum of c cos(k omega t) + s sin(k omega t); a constant has no waves."""

    def __init__(self, mean, omega=1.0, cos=(), sin=(), period=None):
        n = max(len(cos), len(sin))
        cos, sin = [*cos, *[0.0] * (n - len(cos))], [*sin, *[0.0] * (n - len(sin))]
        self.waves = [(k * omega, c, s) for k, (c, s) in enumerate(zip(cos, sin), 1) if c or s]
        sizes = [(k, math.hypot(c, s)) for k, c, s in self.waves]
        self.mean, self.period = mean, (period or 2 * math.pi / omega) if self.waves else 0.0
        self.high = abs(mean) + sum(a for _, a in sizes)
        self.slope, self.curvature = sum(k * a for k, a in sizes), sum(k * k * a for k, a in sizes)

    def at(self, t):
        return self.mean + sum(c * math.cos(k * t) + s * math.sin(k * t) for k, c, s in self.waves)

    def rise(self, t, s):
        """Return f(t + s) - f(t) without cancellation, and f'(t + s)."""
        change = rate = 0.0
        for k, c, d in self.waves:
            half = k * s / 2
            middle, end = k * t + half, k * t + k * s
            change += 2 * math.sin(half) * (d * math.cos(middle) - c * math.sin(middle))
            rate += k * (d * math.cos(end) - c * math.sin(end))
        return change, rate


class BangBang:
    """At rest at each knot; constant acceleration to mid-leg, the opposite after."""

    def __init__(self, knots):
        self.start, self.period = knots[0][0], knots[-1][0] - knots[0][0]
        self.pieces = []  # (start, length, value, rate, acceleration)
        for (t0, v0), (t1, v1) in zip(knots, knots[1:]):
            half, a = (t1 - t0) / 2, 4 * (v1 - v0) / (t1 - t0) ** 2
            self.pieces += [(t0, half, v0, 0.0, a), (t0 + half, t1 - t0 - half, (v0 + v1) / 2, a * half, -a)]
        self.high = max(abs(v) for _, v in knots)
        self.slope = max(abs(p[3]) for p in self.pieces)
        self.curvature = max(abs(p[4]) for p in self.pieces)

    def phase(self, t):
        """Return the piece that holds just after t, and the time since it began."""
        tau = math.fmod(t - self.start, self.period)
        tau = self.start + (tau + self.period if tau < 0 else tau)
        i = max((i for i, piece in enumerate(self.pieces) if piece[0] <= tau), default=0)
        return i, min(tau - self.pieces[i][0], self.pieces[i][1])

    def at(self, t):
        i, q = self.phase(t)
        _, _, v, rate, a = self.pieces[i]
        return v + q * (rate + a * q / 2)

    def rise(self, t, s):
        i, q = self.phase(t)
        s = math.fmod(s, self.period)
        change = 0.0
        while True:
            _, length, _, rate, a = self.pieces[i]
            part = min(s, length - q)
            change += part * (rate + a * q + a * part / 2)
            if s < length - q:
                return change, rate + a * (q + s)
            s, q, i = s - part, 0.0, (i + 1) % len(self.pieces)


class Mouth:
    """w = nu r, as a law."""

    def __init__(self, nu, r):
        self.nu, self.r, self.period = nu, r, nu.period or r.period
        self.high = nu.high * r.high
        self.slope = nu.slope * r.high + nu.high * r.slope
        self.curvature = nu.curvature * r.high + 2 * nu.slope * r.slope + nu.high * r.curvature

    def at(self, t):
        return self.nu.at(t) * self.r.at(t)

    def rise(self, t, s):
        nu, r = self.nu.at(t), self.r.at(t)
        (n, n_rate), (q, q_rate) = self.nu.rise(t, s), self.r.rise(t, s)
        return nu * q + n * (r + q), n_rate * (r + q) + (nu + n) * q_rate


def number(data, name):
    if isinstance(data, bool) or not isinstance(data, (int, float)) or not math.isfinite(data):
        raise Refused(f"{name} = {data!r}, must be a finite number")
    return float(data)


def read_law(data, name):
    if not isinstance(data, dict):
        return Fourier(number(data, name))
    if data.get("kind") == "fourier" and set(data) <= {"kind", "mean", "omega", "period", "cos", "sin"}:
        if ("omega" in data) == ("period" in data):
            raise Refused(f"{name} needs exactly one of omega and period")
        given = "period" if "period" in data else "omega"
        size = number(data[given], f"{name}.{given}")
        if size <= 0:
            raise Refused(f"{name}.{given} = {size}, must be > 0")
        omega, period = (size, None) if given == "omega" else (2 * math.pi / size, size)
        cos, sin = ([number(a, f"{name}.{part}") for a in data.get(part, [])] for part in ("cos", "sin"))
        return Fourier(number(data.get("mean"), name + ".mean"), omega, cos, sin, period)
    if data.get("kind") == "bang-bang" and set(data) == {"kind", "knots"}:
        knots = [(number(t, name + ".knots"), number(v, name + ".knots")) for t, v in data["knots"]]
        if len(knots) < 2 or knots[0][1] != knots[-1][1]:
            raise Refused(f"{name}.knots must be at least two and end at the value they began with: no jumps")
        if any(a[0] >= b[0] for a, b in zip(knots, knots[1:])):
            raise Refused(f"{name}.knots: the times must increase")
        return BangBang(knots) if any(v != knots[0][1] for _, v in knots) else Fourier(knots[0][1])
    raise Refused(f"{name} is no law: {json.dumps(data)[:80]}")
