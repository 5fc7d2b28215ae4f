// Scenes and states as they are read. A scene is refused where one of N_SAMPLES instants of its period breaks it:
// sampling, not proof.
"use strict";

const { Fourier, BangBang, Mouth } = require("./laws.js");

const N_SAMPLES = 512;
const MAX_WAVES = 16;
const MAX_KNOTS = 256;
const WALLS = { cap: ["arc", "base"], stem: ["left", "right", "floor", "base"] };
WALLS.mushroom = ["arc", "base", "left", "right", "floor"];

class Refused extends Error {}

function number(value, name) {
  if (typeof value !== "number" || !Number.isFinite(value)) throw new Refused(`${name} must be a finite number`);
  return value;
}

function checkFields(data, needed, allowed, name) {
  const extra = Object.keys(data).filter((key) => !needed.includes(key) && !allowed.includes(key));
  const missing = needed.filter((key) => !(key in data));
  if (extra.length || missing.length) throw new Refused(`${name}: unknown or missing ${[...extra, ...missing]}`);
}

// Whether a - b is a binary64 number, exactly.
function isExact(a, b) {
  const difference = a - b;
  const back = difference - a;
  return a - (difference - back) - (b + back) === 0;
}

function readLaw(data, name) {
  if (typeof data !== "object" || data === null) return new Fourier(number(data, name));
  if (data.kind === "fourier") {
    const given = "period" in data ? "period" : "omega"; // exactly one of the two
    checkFields(data, ["kind", "mean", given], ["cos", "sin"], name);
    const size = number(data[given], `${name}.${given}`);
    if (!(size > 0)) throw new Refused(`${name}.${given} = ${size}, must be > 0`);
    const [c, d] = [data.cos ?? [], data.sin ?? []].map((part) => part.map((a) => number(a, name)));
    if (c.length > MAX_WAVES || d.length > MAX_WAVES) throw new Refused(`${name} has over ${MAX_WAVES} harmonics`);
    const mean = number(data.mean, `${name}.mean`);
    return given === "omega" ? new Fourier(mean, size, c, d) : new Fourier(mean, (2 * Math.PI) / size, c, d, size);
  }
  if (data.kind !== "bang-bang") throw new Refused(`${name}.kind = ${data.kind}, must be fourier or bang-bang`);
  checkFields(data, ["kind", "knots"], [], name);
  const knots = data.knots.map(([t, v]) => [number(t, `${name}.knots`), number(v, `${name}.knots`)]);
  if (knots.length < 2 || knots[0][1] !== knots.at(-1)[1]) throw new Refused(`${name}.knots must close: no jumps`);
  if (knots.length > MAX_KNOTS) throw new Refused(`${name} has over ${MAX_KNOTS} knots`);
  if (!isExact(knots.at(-1)[0], knots[0][0])) throw new Refused(`${name}.knots: the period must be a binary64 number`);
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

function readState(data, tEnd) {
  const fields = ["t", "x", "y", "vx", "vy"];
  checkFields(data, fields, ["wall"], "state");
  for (const name of fields) number(data[name], `state.${name}`);
  if (data.wall != null && !WALLS.mushroom.includes(data.wall)) throw new Refused(`state.wall = ${data.wall}`);
  if (number(tEnd, "t_end") < data.t) throw new Refused(`t_end = ${tEnd}, must be >= state.t = ${data.t}`);
  return data;
}

module.exports = { Refused, Table, WALLS, readState };
