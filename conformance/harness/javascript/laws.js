// Laws of motion: at(t); rise(t, s) = [f(t + s) - f(t) without cancellation, f'(t + s)]; and bounds on |f|, |f'|, |f''|.
"use strict";

const { abs, sin, cos, max, min, hypot } = Math;
const sum = (numbers) => numbers.reduce((a, b) => a + b, 0);

class Fourier {
  constructor(mean, omega = 1, cosines = [], sines = [], period = (2 * Math.PI) / omega) {
    const n = max(cosines.length, sines.length);
    const all = Array.from({ length: n }, (_, i) => [(i + 1) * omega, cosines[i] ?? 0, sines[i] ?? 0]);
    this.mean = mean;
    this.waves = all.filter(([, c, d]) => c !== 0 || d !== 0);
    this.period = this.waves.length ? period : 0;
    this.high = abs(mean) + sum(this.waves.map(([, c, d]) => hypot(c, d)));
    this.slope = sum(this.waves.map(([k, c, d]) => k * hypot(c, d)));
    this.curvature = sum(this.waves.map(([k, c, d]) => k * k * hypot(c, d)));
  }

  at(t) {
    return this.waves.reduce((f, [k, c, d]) => f + c * cos(k * t) + d * sin(k * t), this.mean);
  }

  rise(t, s) {
    let [change, rate] = [0, 0];
    for (const [k, c, d] of this.waves) {
      const half = (k * s) / 2;
      const [middle, end] = [k * t + half, k * t + k * s];
      change += 2 * sin(half) * (d * cos(middle) - c * sin(middle));
      rate += k * (d * cos(end) - c * sin(end));
    }
    return [change, rate];
  }
}

class BangBang {
  constructor(knots) {
    this.start = knots[0][0];
    this.period = knots.at(-1)[0] - this.start;
    this.pieces = [];
    for (let i = 1; i < knots.length; i++) {
      const [[t0, v0], [t1, v1]] = [knots[i - 1], knots[i]];
      const [half, a] = [(t1 - t0) / 2, (4 * (v1 - v0)) / (t1 - t0) ** 2];
      this.pieces.push({ start: t0, length: half, value: v0, rate: 0, a });
      this.pieces.push({ start: t0 + half, length: t1 - t0 - half, value: (v0 + v1) / 2, rate: a * half, a: -a });
    }
    this.high = max(...knots.map(([, v]) => abs(v)));
    this.slope = max(...this.pieces.map((p) => abs(p.rate)));
    this.curvature = max(...this.pieces.map((p) => abs(p.a)));
  }

  phase(t) {
    let tau = (t - this.start) % this.period;
    tau = this.start + (tau < 0 ? tau + this.period : tau);
    const i = max(0, this.pieces.findLastIndex((p) => p.start <= tau));
    return [i, min(tau - this.pieces[i].start, this.pieces[i].length)];
  }

  at(t) {
    const [i, q] = this.phase(t);
    const p = this.pieces[i];
    return p.value + q * (p.rate + (p.a * q) / 2);
  }

  rise(t, s) {
    let [i, q] = this.phase(t);
    let change = 0;
    for (s %= this.period; ; i = (i + 1) % this.pieces.length, q = 0) {
      const p = this.pieces[i];
      const part = min(s, p.length - q);
      change += part * (p.rate + p.a * q + (p.a * part) / 2);
      if (s < p.length - q) return [change, p.rate + p.a * (q + s)];
      s -= part;
    }
  }
}

class Mouth {
  // w = nu r
  constructor(nu, r) {
    Object.assign(this, { nu, r, high: nu.high * r.high, slope: nu.slope * r.high + nu.high * r.slope });
    this.curvature = nu.curvature * r.high + 2 * nu.slope * r.slope + nu.high * r.curvature;
  }

  at(t) {
    return this.nu.at(t) * this.r.at(t);
  }

  rise(t, s) {
    const [nu, r] = [this.nu.at(t), this.r.at(t)];
    const [[n, nRate], [q, qRate]] = [this.nu.rise(t, s), this.r.rise(t, s)];
    return [nu * q + n * (r + q), nRate * (r + q) + (nu + n) * qRate];
  }
}

module.exports = { Fourier, BangBang, Mouth };
