"""What frozen tables tell of finite energy: diffusion by the walls' kicks, and capture lags.

At each phase of a cycle the table is stopped and its walls made to sway so little that only the sum
of their kicks is seen, each wall in proportion to its speed there. At speed 1 that gives

- diffusion: what kicks of each of theory's MEMORIES add to the variance per path length of the sum,
  over hits of the chaotic zone, of -4 c u, with c the cosine of incidence and u the wall's speed.
  Walls sway once in PATH; products of kicks, over those of the walls' speeds, are the correlations
  at lags of up to LAGS steps, to which positive sums of exponentials are fitted;
- lag and square, at each of SPEEDS: a chord at the island's edge is turned until it first passes
  the mouth, which widens meanwhile as fast as it does there, and is followed for TAIL further. The
  sum of kicks, less the chaotic zone's mean of it, has the mean `lag`; its mean square, less
  diffusion's, is `square`;
- depletion, at each of SPEEDS: what diffusion loses because a mouth that moves lets particles wait
  in the cap for less long than one at rest.

All are of tables at rest: nothing is taken from a moving one, or fitted to it.
`theory.finite_energy` reads them, `theory/equations.md` says what follows. `python -m
mushrooms.audit.frozen` measures them anew.
"""

import json
import math
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from mpmath import fp
from scipy.optimize import nnls

import fast
import scene as scenes
from fast.paths import carry
from mushrooms.audit.tolerances import FloatArray, Mean, mean
from scene import Fourier, Horizon, Mushroom, State
from scene.files.writer import write_file
from scene.geometry import TableAt, table_at
from scene.named import scene_named
from theory.finite_energy.rates import (
    FILE,
    MEMORIES,
    N_PHASES,
    PHASES,
    SPEEDS,
    Rates,
    kick_rates,
    pace,
)
from theory.volumes import volumes_at

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
PATH = 4000.0
STEP = 8.0
LAGS = 80
FIRM = 30.0
SWAY = 1e-5  # of the parameter that moves fastest [length, or none]: a relative error of this order
TAIL = 250.0  # some five times the longest memory of a table
SWAY_PERIOD = 200.0  # in units of TAIL, for the lag: the walls' speed is then constant to 5e-4
N_DIFFUSING = 2000
N_LAGGING = 2000
N_WAITING = 3000
# Times as many particles: with fewer, diffusion was by chance 1.5 % too small.
FINER = {"moving-cap": 4.0}
N_GROUPS = 8  # of particles, by which errors are found
AT_ONCE = 20_000  # turns of chords
CROWDED = 4  # power by which places within the mouth are crowded at its rim, where waits are long
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
    """Return the table of time t with walls that sway in proportion to their speeds.

    The proportion is returned too.
    """
    now = {name: [float(law.value(fp, t, k)) for k in (0, 1)] for name, law in scene.laws.items()}
    size = SWAY / max(abs(rate) for _, rate in now.values())
    moved: dict[str, Any] = {
        name: Fourier(mean=at, period=period, sin=(size * rate,)) if rate else at
        for name, (at, rate) in now.items()
    }
    return Mushroom(**moved), 2 * math.pi / period * size


def diffusion(scene: Mushroom, t: float, n: int, seed: int) -> list[Mean]:
    """Return what kicks of each memory add to the zone's variance per path length at time t.

    Args:
        scene: a mushroom some of whose walls move at t.
        t: when.
        n: number of particles.
        seed: of their starts.

    Returns:
        A number for each of MEMORIES [length / time^2], with the standard error of their sum's
        share.
    """
    table, share = swaying(scene, t, PATH)
    n_steps = round(PATH / STEP)
    phases = np.arange(1, n_steps) / n_steps
    done = fast.simulate(
        table, n_particles=n, energy=0.5, seed=seed, threads=1, phases=phases.tolist()
    )
    is_free = (done.outcome == 0) & (done.wall_counts[:, 2:].sum(axis=1) > 0)
    energies = np.column_stack([done.phase_energies[is_free, 0], done.energy[is_free]])
    kicks = np.diff(np.log(2 * energies), axis=1, prepend=0.0) / share
    turn = 2 * math.pi * np.arange(n_steps + 1) / n_steps
    speed = np.diff(np.sin(turn)) / (turn[1] - turn[0])
    kicks -= kick_rates(scene, t) * STEP * speed
    groups = [_spectrum(part, speed) for part in np.array_split(kicks, N_GROUPS)]
    whole = _spectrum(kicks, speed)
    error = float(np.std([group.sum() for group in groups], ddof=1)) / N_GROUPS**0.5
    return [Mean(float(x), error * float(x / whole.sum())) for x in whole]


def _spectrum(kicks: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the diffusion by kicks of each of MEMORIES for the correlations seen, none negative.

    What all lags add up to counts FIRM times as much as a lag: correlations need not be sums of
    exponentials, but fast walls see nothing else of them.
    """
    n_steps = kicks.shape[1]
    m = np.array(MEMORIES)
    seen = [
        float((kicks[:, : n_steps - k] * kicks[:, k:]).mean(axis=0).sum())
        / float((speed[: n_steps - k] * speed[k:]).sum())
        for k in range(LAGS)
    ]
    total = np.full(LAGS, 2 * FIRM)
    total[0] = FIRM
    rows = np.vstack([np.eye(LAGS), total])
    found: FloatArray = nnls(rows @ step_correlations(m), rows @ np.array(seen))[0]
    return found


def step_correlations(m: FloatArray) -> FloatArray:
    """Return the correlations of kicks over STEP that a unit of each has.

    Lags are 0 to LAGS - 1 steps.
    """
    lags = np.arange(LAGS)[:, None] * STEP
    found = m * (np.cosh(STEP / m) - 1) * np.exp(-lags / m)
    found[0] = STEP - m * (1 - np.exp(-STEP / m))
    return np.asarray(found, dtype=np.float64)


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
    done, _ = carry(table, found.states, [None] * len(found.states), TAIL, 1)
    ends = [o.vx**2 + o.vy**2 if isinstance(o, Horizon) else math.nan for o in done.outcomes]
    length = found.path + TAIL
    excess = np.log(ends) / share + found.arcs * now.r_rate - kick_rates(scene, t) * length
    is_known = np.isfinite(excess)
    return mean(excess[is_known]), mean((excess**2 - rate * length)[is_known])


def passages(
    scene: Mushroom, now: TableAt, t: float, speed: float, n: int, random: np.random.Generator
) -> Passages:
    """Turn chords of the island's edge until each passes the mouth, as fast as the mouth widens.

    sigma is spread over the phase's cell: where a turn is resonant the lag at a single sigma
    diverges.
    """
    cell = np.linspace(-0.5, 0.5, 9)
    tables = [table_at(fp, scene, t + x * scene.period / N_PHASES) for x in cell]
    sigma = np.interp(random.uniform(-0.5, 0.5, n), cell, [float(one.w / one.r) for one in tables])
    # A mouth that rests wide open leaves no island, and its rim does not turn.
    sigma = sigma[sigma < 1.0]
    return turned(now, sigma, sigma, widening(now) / speed, random, math.inf)


def widening(now: TableAt) -> float:
    """Return the speed of the mouth nu, either way [1 / time]."""
    return float(abs(now.w_rate * now.r - now.w * now.r_rate) / now.r**2)


def turned(
    now: TableAt,
    sigma: FloatArray,
    mouth: FloatArray,
    rate: float,
    random: np.random.Generator,
    longest: float,
) -> Passages:
    """Turn chords at distances sigma r from the centre until each passes the mouth, if it does.

    A chord has its foot at an angle alpha from the base. Unfolded over the base, it turns by 2
    acos(sigma) from one arc hit to the next, and meets it at sigma r / cos alpha: in the mouth once
    |cos alpha| > sigma / nu, where nu exceeds `mouth` by `rate` times the path so far. Its start is
    uniform along the chord and in alpha. Distances from the centre are in units of the mouth: all
    pass the mouth of one frozen table.
    """
    n = len(sigma)
    half = np.sqrt(1 - sigma**2)
    turn = 2 * np.arccos(sigma)
    alpha = random.uniform(0, 2 * math.pi, n)
    begin = -2 * now.r * half * random.random(n)  # path at which the chord begins
    path = np.full(n, longest)
    arcs = np.zeros(n)
    columns = np.zeros((n, 3))
    turning = np.arange(n)
    n_turns = 0
    while len(turning):
        # The few that are left turn many times at once.
        k = n_turns + np.arange(max(1, AT_ONCE // len(turning)))
        s, c = (column[turning, None] for column in (sigma, half))
        angle = alpha[turning, None] + k * turn[turning, None]
        cos, sin = np.cos(angle), np.sin(angle)
        with np.errstate(divide="ignore"):
            place = begin[turning, None] + now.r * (c * (1 + 2 * k) - s * sin / cos)
        ratio = s / (mouth[turning, None] + rate * np.maximum(place, 0.0))
        passes = (place > 0) & (np.abs(cos) > ratio)
        is_done = passes.any(axis=1)
        first = passes.argmax(axis=1)
        those = turning[is_done]
        at = (np.flatnonzero(is_done), first[is_done])
        path[those] = np.minimum(place[at], longest)
        arcs[those] = -4 * half[those] * k[at[1]]
        columns[those] = np.column_stack([now.w * ratio[at] / cos[at], -sin[at], -np.abs(cos[at])])
        n_turns = int(k[-1]) + 1
        turning = turning[
            ~is_done & (begin[turning] + 2 * now.r * half[turning] * n_turns < longest)
        ]
    states = [State(0.0, x, 0.0, vx, vy) for x, vx, vy in columns.tolist()]
    return Passages(path, arcs, states)


def swayed(wait: FloatArray, path: float) -> FloatArray:
    """Return what a wait counts for where the rate of kicks sways once in a path.

    A short wait counts for all.
    """
    omega = 2 * math.pi / path
    angle = omega * np.minimum(wait, path)
    found: FloatArray = (1 - angle / (2 * math.pi)) * np.sin(angle) / omega
    return found + (1 - np.cos(angle)) / (math.pi * omega)


def depletion(scene: Mushroom, t: float, speed: float, n: int, seed: int) -> Mean:
    """Return by how much diffusion is less than a table at rest has, near time t [length / time^2].

    In the cap a particle misses the zone's kicks, at the rate f: what it gathers by that is 2 f^2
    times the mean path it has been there, over the zone. Seen backwards from capture the mouth
    widens, and that path is shorter than it would be with the mouth at rest; on release the same
    holds forwards. Correlations of kicks are seen over LAGS steps only, and so are waits at rest; a
    cycle's walls sway once in it. The same chords meet both mouths.

    Args:
        scene: a mushroom whose mouth moves at t.
        t: when.
        speed: of the particles [length / time].
        n: number of particles.
        seed: of their chords.
    """
    now = table_at(fp, scene, t)
    chaotic = float(volumes_at(fp, scene, t).v_cha)
    nu = float(now.w / now.r)
    x = np.random.default_rng([seed, 1]).random(n)
    sigma = nu * (1 - x**CROWDED)
    weight = 4 * math.pi * now.r**2 * np.sqrt(1 - sigma**2) * nu * CROWDED * x ** (CROWDED - 1)
    path = speed * scene.period
    mouth = np.full(n, nu)
    moving, resting = (
        turned(now, sigma, mouth, rate, np.random.default_rng([seed, 2]), longest).path
        for rate, longest in ((widening(now) / speed, path), (0.0, LAGS * STEP))
    )
    missed = kick_rates(scene, t) + 2 * now.r_rate / now.r
    return mean(2 * missed**2 / chaotic * weight * (swayed(moving, path) - resting))


def measured(
    scene: Mushroom, *, phases: FloatArray = PHASES, n: float = 1.0, seed: int = SEED
) -> Rates:
    """Measure a cycle's rates.

    Args:
        scene: a mushroom that moves.
        phases: fractions of its period, a subset of PHASES in this order.
        n: number of particles, in units of those used for the table.
        seed: of all random numbers.
    """
    rows = [
        _row(
            scene,
            float(phase) * scene.period,
            n,
            np.random.default_rng([seed, round(phase * 1000)]),
        )
        for phase in phases
    ]
    values, errors = np.moveaxis(np.array(rows), 2, 0)
    cut = len(MEMORIES) + len(SPEEDS) * np.arange(3)
    return Rates(*np.split(values, cut, axis=1), *np.split(errors, cut, axis=1))


def _row(scene: Mushroom, t: float, n: float, random: np.random.Generator) -> list[Mean]:
    unit = float(pace(scene, t))
    now = table_at(fp, scene, t)
    first, second = random.integers(2**63, size=2).tolist()
    n_diffusing, n_lagging, n_waiting = (
        int(n * size) for size in (N_DIFFUSING, N_LAGGING, N_WAITING)
    )
    spread = diffusion(scene, t, n_diffusing, first)
    rate = sum(one.value for one in spread)
    lags = [(Mean(0.0, 0.0), Mean(0.0, 0.0))] * len(SPEEDS)
    depletions = [Mean(0.0, 0.0)] * len(SPEEDS)
    if widening(now) > SWAY * unit:
        lags = [lag(scene, t, speed, rate, n_lagging, random) for speed in SPEEDS.tolist()]
        depletions = [depletion(scene, t, speed, n_waiting, second) for speed in SPEEDS.tolist()]
    scaled = [(found, unit**2) for found in spread]
    scaled += [(one, unit) for one, _ in lags] + [(square, unit**2) for _, square in lags]
    scaled += [(found, unit**2) for found in depletions]
    return [Mean(found.value / by, found.error / by) for found, by in scaled]


def main(names: Sequence[str] = ()) -> None:
    """Measure the rates of some of the audit's cycles and put them in theory's table.

    All are measured by default.
    """
    short = np.vectorize(lambda number: float(f"{number:.{DIGITS}g}"))
    for name in names or MEASURED:
        scene = scene_named(name)
        assert isinstance(scene, Mushroom)
        n = FINER.get(name, 1.0)
        kept = {
            key: short(column).tolist() for key, column in measured(scene, n=n)._asdict().items()
        }
        text = {
            "command": "python -m mushrooms.audit.frozen",
            "seed": SEED,
            "scenes": {
                **json.loads(FILE.read_text("utf-8"))["scenes"],
                name: {
                    "scene": scenes.to_data(scene),
                    "particles": [int(n * size) for size in (N_DIFFUSING, N_LAGGING, N_WAITING)],
                    **kept,
                },
            },
        }
        write_file(FILE, json.dumps(text, indent=1))
        print(f"{name}: measured at {len(PHASES)} phases", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
