// A stepper in JavaScript that speaks protocol 1: an example of what `mushrooms check` grades.
//
//     mushrooms check -- node stepper.js
//
// It needs node and no packages. Here requests are answered; laws.js has the laws of motion, table.js reads scenes
// and states, flight.js finds the collisions.
"use strict";

const readline = require("node:readline");
const { Open, step } = require("./flight.js");
const { Refused, Table, readState } = require("./table.js");

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
