"""What frozen tables tell of finite energy: how walls' kicks diffuse, how far particles near capture lag.

At each phase of a cycle the table is stopped and its walls made to sway so little that only the sum of their
kicks is seen, each wall in proportion to its speed there. At speed 1 that gives

- diffusion: the variance per path length of the sum, over hits of the chaotic zone, of -4 c u, with c the
  cosine of incidence and u the wall's speed. The walls sway once in each of theory's PATHS;
- lag and square, at each of SPEEDS: a chord at the island's edge is turned until it first passes the mouth,
  which widens meanwhile as fast as it does there, and is followed for TAIL further. The sum of kicks,
  less the chaotic zone's mean of it, has the mean `lag`; its mean square, less diffusion's, is `square`.

All are of tables at rest: nothing is taken from a moving one, or fitted to it. `theory.finite_energy` reads
them, `theory/equations.md` says what follows. `python -m conformance.audit.frozen` measures them anew.
"""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

import numpy as np
from mpmath import fp

import fast
import scene as scenes
from conformance.audit.runs import scene_named
from conformance.audit.tolerances import FloatArray, Mean, mean
from fast.flow import carry_judged
from scene import Fourier, Horizon, Mushroom, State
from scene.files import write_file
from scene.geometry import TableAt, table_at
from scene.laws import value
from scene.tables import cycle_length, laws
from theory.finite_energy.rates import FILE, N_PHASES, PATHS, PHASES, SPEEDS, Rates, kick_rate, pace

MEASURED = (
    "fixed-cap-anticlockwise",
    "moving-cap",
    "moving-cap-trivial",
    "ergodic",
    "only-mouth",
    "retraced-arc",
    "fixed-cap-other-legs",
    "fixed-cap-irregular",
)
SWAY = 1e-5  # of the parameter that moves fastest [length, or none]: a relative error of this order
TAIL = 250.0  # some five times the longest memory of a table
SWAY_PERIOD = 200.0  # in units of TAIL, for the lag: the walls' speed is then constant to 5e-4
N_DIFFUSING, N_LAGGING = 3000, 4000
SEED = 20140317
DIGITS = 5  # kept of each number


class Passages(NamedTuple):
    """Chords of the island's edge, turned until they pass the mouth: (n,) each.

    path: from capture, or release, to the mouth [length].
    arcs: sum of -4 c over the arc hits on it.
    states: in the frozen table's mouth, going down at speed 1.
    """

    path: FloatArray
    arcs: FloatArray
    states: list[State]


def swaying(scene: Mushroom, t: float, period: float) -> tuple[Mushroom, float]:
    """Return time t's table with walls that sway in proportion to their speeds, and that proportion."""
    now = {name: [float(value(fp, law, t, k)) for k in (0, 1)] for name, law in laws(scene).items()}
    size = SWAY / max(abs(rate) for _, rate in now.values())
    moved: dict[str, Any] = {
        name: Fourier(mean=at, period=period, sin=(size * rate,)) if rate else at
        for name, (at, rate) in now.items()
    }
    return Mushroom(**moved), 2 * math.pi / period * size


def diffusion(scene: Mushroom, t: float, path: float, n: int, seed: int) -> Mean:
    """Return the variance per path length of the chaotic zone's kicks at time t [length / time^2].

    Args:
        scene: a mushroom some of whose walls move at t.
        t: when.
        path: length over which the walls sway once; what is remembered longer is missed.
        n: number of particles.
        seed: of their starts.
    """
    table, share = swaying(scene, t, path)
    done = fast.simulate(table, n_particles=n, energy=0.5, seed=seed, threads=1)
    is_free = (done.outcome == 0) & (done.wall_counts[:, 2:].sum(axis=1) > 0)
    kicks = np.log(2 * done.energy[is_free]) / share
    return mean(2 * kicks**2 / path)  # the mean of cos² over the sway is a half


def lag(
    scene: Mushroom, t: float, speed: float, rate: float, n: int, random: np.random.Generator
) -> tuple[Mean, Mean]:
    """Return lag [length / time] and square [length^2 / time^2] near time t.

    Args:
        scene: a mushroom whose mouth moves at t.
        t: when.
        speed: of the particles [length / time].
        rate: diffusion there.
        n: number of particles.
        random: generator.
    """
    now = table_at(fp, scene, t)
    found = passages(scene, now, t, speed, n, random)
    table, share = swaying(scene, t, SWAY_PERIOD * TAIL)
    done = carry_judged(table, found.states, [None] * len(found.states), TAIL, 1)
    ends = [o.vx**2 + o.vy**2 if isinstance(o, Horizon) else math.nan for o in done.outcomes]
    length = found.path + TAIL
    excess = np.log(ends) / share + found.arcs * now.r_rate - kick_rate(scene, t) * length
    is_known = np.isfinite(excess)
    return mean(excess[is_known]), mean((excess**2 - rate * length)[is_known])


def passages(
    scene: Mushroom, now: TableAt, t: float, speed: float, n: int, random: np.random.Generator
) -> Passages:
    """Turn chords of the island's edge until each passes the mouth.

    A chord at distance sigma r from the centre has its foot at an angle alpha from the base. Unfolded over
    the base, it turns by 2 acos(sigma) from one arc hit to the next, and meets it at sigma r / cos alpha:
    in the mouth once |cos alpha| > sigma / nu, where nu exceeds sigma by its speed times the path so far. Its
    start is uniform along the chord and in alpha. Distances from the centre are in units of the
    mouth, so that all pass the mouth of one frozen table. sigma is spread over the phase's cell: where a
    turn is resonant the lag at a single sigma diverges.
    """
    cell = np.linspace(-0.5, 0.5, 9)
    tables = [table_at(fp, scene, t + x * cycle_length(scene) / N_PHASES) for x in cell]
    sigma = np.interp(random.uniform(-0.5, 0.5, n), cell, [float(one.w / one.r) for one in tables])
    sigma = sigma[sigma < 1.0]  # a mouth that rests wide open leaves no island, and its rim does not turn
    n = len(sigma)
    widening = abs(now.w_rate * now.r - now.w * now.r_rate) / now.r**2 / speed
    half, turn = np.sqrt(1 - sigma**2), 2 * np.arccos(sigma)
    alpha = random.uniform(0, 2 * math.pi, n)
    begin = -2 * now.r * half * random.random(n)  # path at which the chord begins
    path, arcs, columns = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    turning = np.arange(n)
    while len(turning):
        cos, sin = np.cos(alpha[turning]), np.sin(alpha[turning])
        with np.errstate(divide="ignore"):
            place = begin[turning] + now.r * (half[turning] - sigma[turning] * sin / cos)
        ratio = sigma[turning] / (sigma[turning] + widening * np.maximum(place, 0.0))
        passes = (place > 0) & (np.abs(cos) > ratio)
        those = turning[passes]
        path[those] = place[passes]
        columns[those] = np.column_stack([now.w * ratio / cos, -sin, -np.abs(cos)])[passes]
        turning = turning[~passes]
        begin[turning] += 2 * now.r * half[turning]
        arcs[turning] -= 4 * half[turning]
        alpha[turning] += turn[turning]
    states = [State(0.0, x, 0.0, vx, vy) for x, vx, vy in columns.tolist()]
    return Passages(path, arcs, states)


def measured(scene: Mushroom, *, phases: FloatArray = PHASES, n: float = 1.0, seed: int = SEED) -> Rates:
    """Measure a cycle's rates.

    Args:
        scene: a mushroom that moves.
        phases: fractions of its period, a subset of PHASES in this order.
        n: number of particles, in units of those used for the table.
        seed: of all random numbers.
    """
    rows = [
        _row(scene, float(phase) * cycle_length(scene), n, np.random.default_rng([seed, round(phase * 1000)]))
        for phase in phases
    ]
    values, errors = np.moveaxis(np.array(rows), 2, 0)
    cut = [len(PATHS), len(PATHS) + len(SPEEDS)]
    return Rates(*np.split(values, cut, axis=1), *np.split(errors, cut, axis=1))


def _row(scene: Mushroom, t: float, n: float, random: np.random.Generator) -> list[Mean]:
    unit, now = float(pace(scene, np.array([t]))[0]), table_at(fp, scene, t)
    seeds = random.integers(2**63, size=len(PATHS)).tolist()
    n_diffusing, n_lagging = int(n * N_DIFFUSING), int(n * N_LAGGING)
    spread = [diffusion(scene, t, path, n_diffusing, seed) for path, seed in zip(PATHS, seeds, strict=True)]
    lags = [(Mean(0.0, 0.0), Mean(0.0, 0.0))] * len(SPEEDS)
    if abs(now.w_rate * now.r - now.w * now.r_rate) > SWAY * unit * now.r**2:
        lags = [lag(scene, t, speed, spread[-1].value, n_lagging, random) for speed in SPEEDS.tolist()]
    scaled = [(found, unit**2) for found in spread]
    scaled += [(first, unit) for first, _ in lags] + [(second, unit**2) for _, second in lags]
    return [Mean(found.value / by, found.error / by) for found, by in scaled]


def main() -> None:
    """Measure the rates of the audit's cycles and write theory's table."""
    table: dict[str, Any] = {}
    short = np.vectorize(lambda number: float(f"{number:.{DIGITS}g}"))
    for name in MEASURED:
        scene = scene_named(name)
        assert isinstance(scene, Mushroom)
        rates = measured(scene)
        kept = {key: short(column).tolist() for key, column in rates._asdict().items()}
        table[name] = {"scene": scenes.to_data(scene), **kept}
        print(f"{name}: measured at {len(PHASES)} phases", flush=True)
    text = {
        "command": "python -m conformance.audit.frozen",
        "seed": SEED,
        "particles": [N_DIFFUSING, N_LAGGING],
        "scenes": table,
    }
    write_file(FILE, json.dumps(text, indent=1))


if __name__ == "__main__":
    main()
