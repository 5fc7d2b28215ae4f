// A stepper in JavaScript that speaks protocol 1: an example of what `mushrooms check` grades.
//
//     mushrooms check -- node stepper.js
//
// It needs node and no packages. Each wall is a function f(s) of the flight time s, positive inside. From a time
// at which f > 0, the parabola with the largest curvature that the laws allow stays below f; its root is
// therefore a safe step, and such steps walk up to the first root and never past it. What rounding leaves open
// (two walls at once, a graze, the mouth's edge) is answered `undecided`. Scenes are refused where one of
// N_SAMPLES instants of the period breaks them: sampling, not proof.
"use strict";

const readline = require("node:readline");

const U = 2 ** -53;
const SLACK = 16; // rounding errors that one evaluation of f may add up, in units of U times its terms
const MAX_STEPS = 20000;
const N_SAMPLES = 512;
const LARGEST = 1e100; // beyond it squares might overflow
const LEAST = 1e-150; // below it they vanish, and with them hits of the arc
const WALLS = { cap: ["arc", "base"], stem: ["left", "right", "floor", "base"] };
WALLS.mushroom = ["arc", "base", "left", "right", "floor"];
const { abs, sqrt, sin, cos, max, min, hypot } = Math;
const sum = (numbers) => numbers.reduce((a, b) => a + b, 0);

class Refused extends Error {}
class Open extends Error {}

// Laws: at(t); rise(t, s) = [f(t + s) - f(t) without cancellation, f'(t + s)]; and bounds on |f|, |f'|, |f''|.

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

function number(value, name) {
  if (typeof value !== "number" || !Number.isFinite(value)) throw new Refused(`${name} must be a finite number`);
  return value;
}

function checkFields(data, needed, allowed, name) {
  const extra = Object.keys(data).filter((key) => !needed.includes(key) && !allowed.includes(key));
  const missing = needed.filter((key) => !(key in data));
  if (extra.length || missing.length) throw new Refused(`${name}: unknown or missing ${[...extra, ...missing]}`);
}

function readLaw(data, name) {
  if (typeof data !== "object" || data === null) return new Fourier(number(data, name));
  if (data.kind === "fourier") {
    const given = "period" in data ? "period" : "omega"; // exactly one of the two
    checkFields(data, ["kind", "mean", given], ["cos", "sin"], name);
    const size = number(data[given], `${name}.${given}`);
    if (!(size > 0)) throw new Refused(`${name}.${given} = ${size}, must be > 0`);
    const [c, d] = [data.cos ?? [], data.sin ?? []].map((part) => part.map((a) => number(a, name)));
    const mean = number(data.mean, `${name}.mean`);
    return given === "omega" ? new Fourier(mean, size, c, d) : new Fourier(mean, (2 * Math.PI) / size, c, d, size);
  }
  if (data.kind !== "bang-bang") throw new Refused(`${name}.kind = ${data.kind}, must be fourier or bang-bang`);
  checkFields(data, ["kind", "knots"], [], name);
  const knots = data.knots.map(([t, v]) => [number(t, `${name}.knots`), number(v, `${name}.knots`)]);
  if (knots.length < 2 || knots[0][1] !== knots.at(-1)[1]) throw new Refused(`${name}.knots must close: no jumps`);
  if (knots.some(([t], i) => i && t <= knots[i - 1][0])) throw new Refused(`${name}.knots: times must increase`);
  return knots.some(([, v]) => v !== knots[0][1]) ? new BangBang(knots) : new Fourier(knots[0][1]);
}

class Table {
  constructor(data) {
    this.kind = data.table;
    const needed = { cap: ["r"], stem: ["w", "h"], mushroom: ["r", "h"] }[this.kind];
    if (!needed) throw new Refused(`table = ${this.kind}, must be cap, stem or mushroom`);
    if (this.kind === "mushroom") needed.push("nu" in data ? "nu" : "w");
    checkFields(data, ["table", ...needed], ["name", "notes", ...(this.kind === "cap" ? [] : ["slope"])], "scene");
    const laws = Object.fromEntries(needed.map((name) => [name, readLaw(data[name], name)]));
    if ("slope" in data) laws.slope = readLaw(data.slope, "slope");
    const moving = Object.values(laws).filter((law) => law.period);
    if (new Set(moving.map((law) => law.period)).size > 1) throw new Refused("the laws have different periods");
    Object.assign(this, { slope: new Fourier(0), ...laws });
    if (laws.nu) this.w = new Mouth(laws.nu, laws.r);
    const [start, period] = moving.length ? [moving[0].start ?? 0, moving[0].period] : [0, 0];
    for (let i = 0; i < (period ? N_SAMPLES : 1); i++) this.check(start + (i / N_SAMPLES) * period, laws);
  }

  check(t, laws) {
    for (const [name, law] of Object.entries(laws))
      if (name !== "slope" && !(law.at(t) > 0)) throw new Refused(`${name} = ${law.at(t)} at t = ${t}, must be > 0`);
    if (laws.nu && laws.nu.at(t) > 1) throw new Refused(`nu = ${laws.nu.at(t)} at t = ${t}, must be <= 1`);
    if (laws.r && laws.w && laws.w.at(t) > laws.r.at(t)) throw new Refused(`w > r at t = ${t}`);
    if (this.w && this.w.at(t) <= this.h.at(t) * this.slope.at(t)) throw new Refused(`w <= h slope at t = ${t}`);
  }
}

class Flight {
  constructor(table, state) {
    Object.assign(this, state, { table, left: state.wall ?? null });
    this.now = {};
    for (const name of ["r", "w", "h", "slope"]) if (table[name]) this.now[name] = table[name].at(this.t);
  }

  // [f(s), f'(s), the rounding error that f may carry]. f is written as f(0) plus its change: f(0) is taken out
  // for the wall that the particle leaves. Where a law's argument is rounded, late in time, f moves by that of it:
  // `late`, the part of f' that the laws make, times t.
  gap(wall, s) {
    const { x, y, vx, vy, t, table, now } = this;
    let first, size, change, moved, slope;
    let late = 0;
    // The wall that is left may have gone and come back: no net change is its rounding.
    const swing = (law, rate) => s * min(law.slope, abs(rate) + s * law.curvature);
    const sizeOf = (law, rise, rate) => (wall === this.left ? swing(law, rate) : abs(rise));
    if (wall === "arc") {
      const [rise, rate] = table.r.rise(t, s);
      const [square, along] = [vx * vx + vy * vy, x * vx + y * vy];
      [first, size] = [now.r * now.r - (x * x + y * y), table.r.high ** 2 + x * x + y * y];
      change = rise * (2 * now.r + rise) - s * (2 * along + s * square);
      moved = sizeOf(table.r, rise, rate) * 2 * table.r.high + s * (2 * abs(x * vx) + 2 * abs(y * vy) + s * square);
      late = 2 * (now.r + rise) * rate;
      slope = late - 2 * (along + s * square);
    } else if (wall === "left" || wall === "right") {
      const side = wall === "left" ? 1 : -1;
      const [[rise, rate], [tilt, tiltRate]] = [table.w.rise(t, s), table.slope.rise(t, s)];
      [first, size] = [now.w + now.slope * y + side * x, table.w.high + table.slope.high * abs(y) + abs(x)];
      change = rise + tilt * (y + s * vy) + s * (now.slope * vy + side * vx);
      moved = sizeOf(table.w, rise, rate) + sizeOf(table.slope, tilt, tiltRate) * (abs(y) + s * abs(vy));
      moved += s * (abs(now.slope * vy) + abs(vx));
      late = rate + tiltRate * (y + s * vy);
      slope = late + (now.slope + tilt) * vy + side * vx;
    } else if (wall === "floor") {
      const [rise, rate] = table.h.rise(t, s);
      [first, size, change] = [y + now.h, abs(y) + table.h.high, s * vy + rise];
      [moved, late, slope] = [s * abs(vy) + sizeOf(table.h, rise, rate), rate, vy + rate];
    } else {
      const up = table.kind === "stem" ? -1 : 1;
      [first, size, change, moved, slope] = [up * y, abs(y), up * s * vy, s * abs(vy), up * vy];
    }
    if (wall === this.left) first = size = late = 0;
    return [first + change, slope, SLACK * U * (size + moved + abs(late * t))];
  }

  curvature(wall) {
    const { vx, vy, table: { r, w, h, slope } } = this;
    if (wall === "arc") return 2 * (vx * vx + vy * vy + r.high * r.curvature + r.slope ** 2);
    if (wall === "base") return 0;
    return wall === "floor" ? h.curvature : w.curvature + slope.curvature * h.high + 2 * slope.slope * abs(vy);
  }

  // One safe step from s towards the first root of f: the new s, and at the root the error of its time and f'.
  advance(wall, s) {
    const [f, slope, error] = this.gap(wall, s);
    const bend = this.curvature(wall);
    if (f > error) {
      const root = sqrt(slope * slope + 2 * bend * f);
      return [s + (slope < 0 ? (2 * f) / (root - slope) : bend ? (slope + root) / bend : Infinity), null];
    }
    if (slope >= 0 || slope * slope <= 4 * bend * error) throw new Open(`${wall} is grazed within rounding`);
    s -= f / slope;
    s -= this.gap(wall, s)[0] / slope;
    return [s, { error: (2 * error) / -slope + 4 * U * s, slope: this.gap(wall, s)[1] }];
  }

  // Where to search from: f > f'(0) s - bend s^2 / 2 > 0 before, on the wall being left.
  beginning(wall, begin) {
    if (wall !== this.left) return begin;
    const bend = this.curvature(wall);
    return bend ? max(begin, (2 * this.gap(wall, 0)[1]) / bend) : Infinity;
  }

  // The first roots up to the first of them: the wall farthest behind moves.
  roots(walls, begin, end) {
    const found = [];
    const times = new Map(walls.map((wall) => [wall, this.beginning(wall, begin)]));
    for (let i = 0; i < MAX_STEPS; i++) {
      const [wall, time] = [...times].reduce((a, b) => (b[1] < a[1] ? b : a), ["", Infinity]);
      if (!(time <= end)) return found;
      const [s, hit] = this.advance(wall, time);
      times.set(wall, hit ? Infinity : s);
      if (!hit) continue;
      end = min(end, (s + hit.error) * (1 + 8 * U));
      found.push({ kind: wall, s, ...hit });
    }
    throw new Open(`no decision within ${MAX_STEPS} steps`);
  }

  isInCap() {
    if (this.table.kind !== "mushroom") return this.table.kind === "cap";
    if (this.left !== null) return this.left === "arc" || this.left === "base";
    if (this.y === 0 && this.vy === 0) throw new Open("it flies along the mouth");
    return this.y > 0 || (this.y === 0 && this.vy > 0);
  }

  checkInside(walls) {
    // On y = 0 the mouth ends at the sides, and the base at the arc.
    const isLevel = this.table.kind === "mushroom" && this.left === null && this.y === 0;
    for (const wall of isLevel ? ["arc", "left", "right", "floor"] : walls) {
      const [f, slope, error] = this.gap(wall, 0);
      const isLeftUnsaid = this.left === null && wall === "base" && f === 0 && slope > 0;
      if (wall === this.left || isLeftUnsaid) continue;
      if (abs(f) <= error) throw new Open(`the state is on wall ${wall} within rounding`);
      if (f < 0 && walls.includes(wall)) throw new Refused(`the state is beyond wall ${wall}`);
    }
  }

  // The first collision {kind, s, slope}, or {kind: "horizon"}.
  firstHit(horizon) {
    const isMushroom = this.table.kind === "mushroom";
    let [inside, begin] = [this.isInCap(), 0];
    for (;;) {
      const here = WALLS[inside ? "cap" : "stem"].filter((wall) => !(isMushroom && wall === "base"));
      const leaves = isMushroom && this.left !== "base" && (inside ? this.vy < 0 : this.vy > 0);
      const level = leaves ? max(0, -this.y / this.vy) : Infinity; // when it reaches the level of the mouth
      if (begin === 0) {
        this.checkInside(here); // first: a corner is one whichever way the particle moves
        this.checkWall();
      }
      const found = this.roots(here, begin, min(horizon, level, Number.MAX_VALUE / 2) * (1 + 8 * U));
      found.push({ kind: "mouth", s: level, error: 4 * U * level, slope: this.vy });
      found.push({ kind: "horizon", s: horizon, error: 2 * U * horizon });
      const [first, other, third] = found.sort((a, b) => a.s - b.s || 0);
      const onBase = first.kind === "mouth" && inside && this.isOnBase(first.s);
      const kinds = [first.kind, other.kind];
      const isThree = third && third.s - first.s <= first.error + third.error;
      const isPair = kinds.includes("mouth") && kinds.includes("horizon") && !isThree;
      if (other.s - first.s <= first.error + other.error && (onBase || !isPair))
        throw new Open(`${kinds.join(" and ")} come within rounding`);
      if (onBase) return { ...first, kind: "base" };
      if (first.kind !== "mouth") return first;
      [inside, begin] = [!inside, first.s];
    }
  }

  isOnBase(s) {
    const { w } = this.table;
    const beside = abs(this.x + s * this.vx) - (this.now.w + w.rise(this.t, s)[0]);
    const size = abs(this.x) + 2 * s * abs(this.vx) + 2 * w.high + s * w.slope;
    if (abs(beside) <= SLACK * U * size) throw new Open("the mouth's edge is hit within rounding");
    return beside > 0;
  }

  checkWall() {
    const { left, y, table } = this;
    if (left === null) return;
    const isElsewhere = left === "arc" ? y < 0 : y > 0 && table.kind === "mushroom" && left !== "base";
    if (!WALLS[table.kind].includes(left) || isElsewhere) throw new Refused(`state.wall = ${left} at y = ${y}`);
    if (table.kind === "mushroom" && left !== "base" && y === 0) throw new Open("the state is in a corner");
    this.left = null;
    const [f, slope, error] = this.gap(left, 0);
    this.left = left;
    const { h, r, w } = this.now; // of which a small part is what rounding may have moved a state
    const size = left === "floor" ? h : left === "left" || left === "right" ? max(w, abs(this.x)) : (r ?? w);
    const off = abs(f) - 2 ** -20 * size * (left === "arc" ? 2 * size : 1);
    if (off > error) throw new Refused(`state is not on wall ${left}`);
    if (off > 0) throw new Open(`the state may be on wall ${left} within rounding of its phase`);
    if (slope < -SLACK * U * abs(this.t) * this.curvature(left))
      throw new Refused(`state.wall = ${left}: starts on it and moves into it`);
    if (slope <= 0) throw new Open("it rests on its wall, or does within rounding of its phase");
  }

  // The gradient of f by x and y.
  normal(wall, s) {
    if (wall === "arc") return [-2 * (this.x + s * this.vx), -2 * (this.y + s * this.vy)];
    if (wall === "left" || wall === "right")
      return [wall === "left" ? 1 : -1, this.now.slope + this.table.slope.rise(this.t, s)[0]];
    return [0, wall === "base" && this.table.kind === "stem" ? -1 : 1];
  }
}

function readState(data, tEnd) {
  const fields = ["t", "x", "y", "vx", "vy"];
  checkFields(data, fields, ["wall"], "state");
  for (const name of fields) number(data[name], `state.${name}`);
  if (data.wall != null && !WALLS.mushroom.includes(data.wall)) throw new Refused(`state.wall = ${data.wall}`);
  if (number(tEnd, "t_end") < data.t) throw new Refused(`t_end = ${tEnd}, must be >= state.t = ${data.t}`);
  return data;
}

function step(table, state, tEnd) {
  const flight = new Flight(table, state);
  const { t, x, y, vx, vy } = state;
  if (max(abs(x), abs(y), abs(vx), abs(vy)) > LARGEST) throw new Open(`numbers beyond ${LARGEST} may overflow`);
  const speed = max(abs(vx), abs(vy));
  const isTiny = table.r?.at(t) < LEAST || (speed > 0 && speed < LEAST);
  if (table.r && isTiny) throw new Open(`squares of numbers below ${LEAST} may vanish`);
  const { kind, s, slope } = flight.firstHit(tEnd - t);
  const [X, Y] = [x + s * vx, y + s * vy];
  if (kind === "horizon") return { outcome: "horizon", t: tEnd, x: X, y: Y, vx, vy };
  const [nx, ny] = flight.normal(kind, s);
  const factor = (2 * slope) / (nx * nx + ny * ny); // v - 2 (v.n - u) n, as f' = (v.n - u) |grad f|
  const place = { dt: s, t: t + s, x: X, y: kind === "base" ? 0 : Y };
  return { outcome: "collision", wall: kind, ...place, vx: vx - factor * nx, vy: vy - factor * ny };
}

function follow(table, state, nCollisions, tEnd) {
  const steps = [];
  while (steps.length < nCollisions && (steps.length === 0 || state.outcome === "collision")) {
    try {
      state = step(table, state, tEnd);
    } catch (error) {
      if (!(error instanceof Open)) throw error;
      state = { outcome: "undecided", reason: error.message };
    }
    steps.push(state);
  }
  return steps;
}

function count(value, least, name) {
  if (!Number.isSafeInteger(value) || value < least) throw new Refused(`${name} must be a whole number, at least ${least}`);
}

function answer({ cmd, scene, state, collisions, repeat, t_end }) {
  try {
    const tEnd = cmd === "time" ? Number.MAX_VALUE : t_end;
    const [table, start] = [new Table(scene), readState(state, tEnd)];
    if (cmd !== "step") count(collisions, cmd === "time" ? 1 : 0, "collisions");
    if (cmd === "time") count(repeat, 1, "repeat");
    if (cmd === "step") return step(table, start, tEnd);
    if (cmd === "trajectory") return { steps: follow(table, start, collisions, tEnd) };
    const [ns, steps] = [[], []];
    for (let i = 0; i < repeat; i++) {
      const begin = process.hrtime.bigint();
      steps.splice(0, steps.length, ...follow(table, start, collisions, tEnd).slice(-1));
      ns.push(Number(process.hrtime.bigint() - begin));
    }
    return { ns, steps };
  } catch (error) {
    if (error instanceof Open) return { outcome: "undecided", reason: error.message };
    return { outcome: "rejected", reason: String(error.message) };
  }
}

// JSON.stringify writes -0 as 0: mark it, and put the sign back into the text.
function encode(data) {
  const text = JSON.stringify(data, (_, value) => (Object.is(value, -0) ? "\u0000-0" : value));
  return text.replaceAll('"\\u0000-0"', "-0.0");
}

const INTRODUCTION = {
  protocol: 1,
  name: "example-javascript",
  version: "1.0",
  language: "JavaScript",
  profiles: ["step", "trajectory", "time"],
  tables: ["cap", "stem", "mushroom"],
  laws: ["constant", "fourier", "bang-bang"],
};

function reply(line) {
  let request;
  try {
    request = JSON.parse(line);
  } catch (error) {
    return { seq: null, outcome: "rejected", reason: error.message };
  }
  const { cmd, seq = null } = request ?? {};
  if (cmd === "stop") process.exit(0);
  if (cmd === "start") return INTRODUCTION;
  const isSeq = Number.isInteger(seq) && seq >= 0 && seq <= 2 ** 53;
  const refuse = (reason) => ({ seq: isSeq ? seq : null, outcome: "rejected", reason });
  if (cmd === "echo") {
    const isGood = Array.isArray(request.values) && request.values.every(Number.isFinite);
    return isGood ? { values: request.values } : refuse("values must be numbers");
  }
  if (!["step", "trajectory", "time"].includes(cmd)) return refuse(`no cmd ${cmd}`);
  return isSeq ? { seq, ...answer(request) } : refuse("seq must be a whole number");
}

readline.createInterface({ input: process.stdin }).on("line", (line) => process.stdout.write(`${encode(reply(line))}\n`));
