// One flight to the first wall that it meets.
//
// Each wall is a function f(s) of the flight time s, positive inside. From a time at which f > 0, the parabola with
// the largest curvature that the laws allow stays below f; its root is therefore a safe step, and such steps walk
// up to the first root and never past it. What rounding leaves open (two walls at once, a graze, the mouth's edge)
// is thrown as Open.
"use strict";

const { Refused, WALLS } = require("./table.js");

const U = 2 ** -53;
const SLACK = 16; // rounding errors that one evaluation of f may add up, in units of U times its terms
const MAX_STEPS = 20000;
const LARGEST = 1e100; // beyond it squares might overflow
const LEAST = 1e-150; // below it they vanish, and with them hits of the arc
const { abs, sqrt, max, min } = Math;

class Open extends Error {}

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

  isInCap(horizon) {
    if (this.table.kind !== "mushroom") return this.table.kind === "cap";
    if (this.left !== null) return this.left === "arc" || this.left === "base";
    if (this.y === 0 && this.vy === 0 && horizon > 0) throw new Open("it flies along the mouth");
    return this.y > 0 || (this.y === 0 && this.vy >= 0);
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
    let [inside, begin] = [this.isInCap(horizon), 0];
    for (;;) {
      const here = WALLS[inside ? "cap" : "stem"].filter((wall) => !(isMushroom && wall === "base"));
      const leaves = isMushroom && this.left !== "base" && (inside ? this.vy < 0 : this.vy > 0);
      const level = leaves ? max(0, -this.y / this.vy) : Infinity; // when it reaches the level of the mouth
      if (begin === 0) {
        this.checkInside(here); // first: a corner is one whichever way the particle moves
        this.checkWall(horizon);
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

  checkWall(horizon) {
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
    if (left === "base" && slope === 0 && horizon === 0) return; // it slides, and has arrived
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

module.exports = { Open, step };
