"""What the paper assumes of a cycle and its particles: C2 to C5 and C10.

C2, the key assumption of sec. 3.4: the chaotic zone is uniformly filled at all times, in area and
direction, whatever the energies. Particles are looked at through the cycle: those of the frozen
table's chaotic zone, below the mouth or in the cap with |sin phi| < nu, released ones among them.
C3, C4, C10: what a cycle is to its particles, its shapes in their order. C5: speeds grow at most
linearly in the number of collisions, and E ~ t^2 where nothing is exponential.
"""

import math
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from mpmath import fp

import theory
from mushrooms.audit.claim import DIGITS, Check, ClaimEvidence
from mushrooms.audit.claims.experiments import one_cycle
from mushrooms.audit.claims.finite_energy import ACW
from mushrooms.audit.runs import RUNS, Sample, at_knots, run_seed, scene_of
from mushrooms.audit.tolerances import (
    Cdf,
    FloatArray,
    Mean,
    close,
    exact,
    fits,
    mean,
    share,
    stated,
)
from scene import BangBang, Horizon, Mushroom, Scene, State, load
from scene.geometry import table_at

SCENES = ("moving-cap", "fixed-cap-clockwise")
ENERGY = 1e7
N_PARTICLES = {"quick": 2500, "full": 20_000}
PHASES = (3 / 8, 4 / 8, 6 / 8, 1.0)
OTHER_LEGS = "fixed-cap-other-legs@1e7"
IRREGULAR = "fixed-cap-irregular@1e7"
N_CLOCKS = 3
ROUNDING = 1e-12  # relative, of what a few thousand collisions keep exactly
SLIDING_HITS = 2000
SLIDING_SPEED = 30.0
SLOW = ("ergodic@1e4x120", "moving-cap-trivial@1e4x120")
BOUNDED = ("breathing-circle", "moving-cap", "fixed-cap-clockwise")
N_HITS = 3000
# Share of the speeds taken to gain as the next do: theory does not reach to the walls' own.
SLOWEST = 0.02
MOVING = 0.06  # half the moving cap's growth rate of log E in a cycle: that of its speeds
N_SPEEDS = 5
STARTS = ((0.3, 0.4, 0.3), (-0.5, 0.2, 1.1), (0.1, 0.6, 2.0), (0.0, 0.3, 2.9))  # x, y, direction


def filling(evidence: ClaimEvidence) -> Iterator[Check]:
    """C2: shares, places and directions in the chaotic zone at phases of the cycle."""
    for name in SCENES:
        table = load(name)
        places = []
        n = N_PARTICLES[evidence.size]
        seed = run_seed(evidence.seed, RUNS["moving-cap@1e7"], -2)
        states = starts(table, n, seed)
        for phase in PHASES:
            t = table.period * phase
            done = evidence.steppers.flow(table, states, t, threads=evidence.threads)
            ends = [end for end in done.outcomes if isinstance(end, Horizon)]
            states = [State(t, end.x, end.y, end.vx, end.vy) for end in ends]
            zone = in_the_zone(table, t, np.array([(end.x, end.y, end.vx, end.vy) for end in ends]))
            places.append(zone)
            volumes = theory.volumes_at(fp, table, t)
            even = volumes.v_stem / volumes.v_cha
            yield close(
                f"{name} at {phase:g} of its cycle: share below the mouth",
                zone.below,
                even,
                band=_unmixed(table, t),
                scale=0.2,
                against=("a tenth less", 0.9 * float(even)),
            )
        for what, k, rival, other in EVEN:
            yield fits(
                f"{name}, {len(PHASES)} phases: {what}",
                np.concatenate([zone[k] for zone in places]),
                lambda u: u,
                scale=0.2,
                against=(rival, other),
            )


def starts(table: Scene, n: int, seed: int) -> list[State]:
    """Draw n states of ENERGY, uniform in area and direction at time 0."""
    random = np.random.default_rng(seed)
    now = table_at(fp, table, 0.0)
    speed = math.sqrt(2 * ENERGY)
    found: list[State] = []
    while len(found) < n:
        x, y, turn = random.uniform((-now.r, -now.h, 0), (now.r, now.r, 2 * math.pi)).tolist()
        if now.gap("arc", x, y) > 0 if y > 0 else abs(x) < now.half_width(y):
            found.append(State(0.0, x, y, speed * math.cos(turn), speed * math.sin(turn)))
    return found


class Zone(NamedTuple):
    """Where the zone's particles are, as shares: uniform in (0, 1) if the zone is filled evenly.

    below: share of the particles that are below the mouth, with its error.
    chords: of those in the cap, by |sin phi|.
    depths, turns: of those below the mouth, by area and by direction.
    """

    below: Mean
    chords: FloatArray
    depths: FloatArray
    turns: FloatArray


EVEN: tuple[tuple[str, int, str, Cdf], ...] = (
    (
        "|sin phi| in the cap",
        1,
        "the outer tenth empty, where some were just released",
        lambda u: np.minimum(u / 0.9, 1),
    ),
    (
        "depth in the stem",
        2,
        "twice as dense at the mouth as at the floor",
        lambda u: (4 * u - u * u) / 3,
    ),
    (
        "directions in the stem",
        3,
        "those of hits on a side",
        lambda u: u + np.sin(4 * np.pi * u) / (4 * np.pi),
    ),
)


def in_the_zone(table: Scene, t: float, rows: FloatArray) -> Zone:
    """Pick the zone's particles at time t from rows of x, y, vx, vy."""
    now = table_at(fp, table, t)
    nu = float(theory.volumes_at(fp, table, t).nu)
    x, y, vx, vy = rows.T
    offset = np.abs(x * vy - y * vx) / np.hypot(vx, vy) / now.r
    below = y < 0
    zone = below | (offset < nu)
    depth = -y[below]
    return Zone(
        share(below[zone]),
        _chords(offset[zone & ~below]) / _chords(nu),
        (2 * now.w * depth - now.slope * depth**2) / now.stem_area(),
        np.arctan2(vy, vx)[below] / (2 * np.pi) % 1.0,
    )


def _chords(s: FloatArray | float) -> FloatArray:
    """Return, but for a factor, the area in phase of the chords nearer to the centre than s r."""
    return np.asarray(
        s * np.sqrt(1 - np.minimum(np.square(s), 1.0)) + np.arcsin(np.minimum(s, 1.0))
    )


def _unmixed(table: Scene, t: float) -> float:
    """Return how far the share below the mouth lags behind the volumes.

    Through a mouth of width 2w an area A is left at the rate 2 w v / (pi A). So a share that the
    walls move at a rate is short of it by that rate times pi A B / (2 w v (A + B)), A and B the
    zone's areas on both sides.
    """
    step = 1e-4 * table.period
    now, before = (theory.volumes_at(fp, table, s) for s in (t, t - step))
    place = table_at(fp, table, t)
    rate = abs(now.v_stem / now.v_cha - before.v_stem / before.v_cha) / step
    both = now.v_stem * (now.v_cha - now.v_stem) / now.v_cha / (2 * fp.pi)
    return float(rate * fp.pi * both / (2 * place.w * math.sqrt(2 * ENERGY)))


def other_clocks(evidence: ClaimEvidence) -> Iterator[Check]:
    """C3: the same loop at other paces, by theory with drawn legs, and simulated."""
    known = evidence.predict("fixed-cap-anticlockwise")
    random = np.random.default_rng([evidence.seed, 3])
    for _ in range(N_CLOCKS):
        legs = random.dirichlet(np.full(4, 2.0))
        found = evidence.predict(at_another_pace(legs))
        what = f"legs {', '.join(f'{leg:.2f}' for leg in legs)}"
        for name in ("m1", "p_nc"):
            value = getattr(known, name)
            yield exact(f"{what}: {name}", getattr(found, name), value, 10.0 ** (5 - DIGITS))
    yield from one_cycle(evidence, (OTHER_LEGS,))


def at_another_pace(legs: np.ndarray) -> Mushroom:
    """Return the fixed cap's anticlockwise cycle with its four legs in other proportions."""
    table = load("fixed-cap-anticlockwise")
    assert isinstance(table, Mushroom)
    times = [0.0, *np.cumsum(legs)[:-1].tolist(), 1.0]
    h, w = (
        BangBang(tuple(zip(times, at_knots(table.laws[name]), strict=True))) for name in ("h", "w")
    )
    return Mushroom(r=table.r, h=h, w=w, slope=table.slope, name="another-pace")


def sliding(evidence: ClaimEvidence) -> list[Check]:
    """C4: walls that slide along themselves.

    A mouth's edge over a cap at rest, the sides of a rectangle.
    """
    sample = evidence.sample(ACW)
    # Captured at phases 4/8 and 5/8, between which the base gives way to the mouth; the arc is at
    # rest.
    inside = sample.phase_captured[:, 0, 3] & sample.phase_captured[:, 0, 4]
    largest = float(np.max(np.abs(sample.change(inside, 3, 4)), initial=0.0))
    moved = np.abs(sample.change(~sample.captured, 3, 4)).mean()
    rectangle = load("fermi-ulam")
    velocity = SLIDING_SPEED * math.cos(0.7), SLIDING_SPEED * math.sin(0.7)
    start = State(0.0, 0.1, -0.4, *velocity)
    done = evidence.steppers.trajectory(rectangle, start, SLIDING_HITS, math.inf)
    across, along = (np.abs(done.steps[:, k]) for k in (4, 5))
    drift = float(np.max(np.abs(across / across[0] - 1)))
    what = "and the speed along, which the floor changes"
    varied = float(np.max(np.abs(along / along[0] - 1)))
    return [
        stated(
            "fixed cap: log E of the captured while the mouth opens, largest change",
            bool(inside.any()) and largest < ROUNDING,
            f"{largest:.1e} of {inside.sum():,} particles",
            "0 but for rounding",
        ),
        stated(
            "fixed cap: log E of the free particles, which meet the stem's moving sides, changes",
            bool(moved > 1e-3),
            f"{moved:.3f} on average",
            "> 0.001",
        ),
        stated(
            f"rectangle whose floor moves, {SLIDING_HITS} collisions:"
            " speed across, which only its sides could change",
            drift < ROUNDING,
            f"largest relative change {drift:.1e}",
            "0 but for rounding",
        ),
        stated(what, varied > 1e-3, f"largest relative change {varied:.2f}", "> 0.001"),
    ]


def speeds(evidence: ClaimEvidence) -> list[Check]:
    """C5: the bound by collisions; then cycles that do not accelerate exponentially."""
    return [
        *(_at_most_linear(evidence, name) for name in BOUNDED),
        *(check for sample in evidence.samples(*SLOW) for check in _quadratic(sample)),
    ]


def _at_most_linear(evidence: ClaimEvidence, name: str) -> Check:
    """Check v_n - v_0 <= 2 u n, u the fastest wall.

    In the wall's frame a hit only turns the velocity.
    """
    table = load(name)
    fastest = walls_speed(table)
    share = -math.inf
    for x, y, turn in STARTS:
        start = State(0.0, x, y, 2 * fastest * math.cos(turn), 2 * fastest * math.sin(turn))
        done = evidence.steppers.trajectory(table, start, N_HITS, math.inf)
        after = np.hypot(done.steps[:, 4], done.steps[:, 5])
        gained = (after - 2 * fastest) / (2 * fastest * np.arange(1, len(after) + 1))
        share = max(share, float(gained.max()))
    return stated(
        f"{name}, slow starts: largest gain of speed over n collisions, in 2 u n, u the fastest"
        " wall",
        share <= 1 + ROUNDING,
        f"{share:.3f}",
        "at most 1",
    )


def walls_speed(scene: Scene) -> float:
    """Return a bound on the speed of arc, floor and sides across themselves [length / time].

    The sides' is that at the mouth.
    """
    speeds = [law.bounds().slope for name, law in scene.laws.items() if name in ("r", "h")]
    if isinstance(scene, Mushroom):
        factors = [law.bounds() for law in scene.width.factors]
        speeds.append(
            sum(f.slope * math.prod(g.highest for g in factors if g is not f) for f in factors)
        )
    return max(speeds)


def _quadratic(sample: Sample) -> list[Check]:
    """Compare the mean speed's growth with a straight line, and its slope with theory."""
    name = sample.run.name
    k = sample.run.n_cycles
    v = sample.speed * np.exp(np.column_stack([np.zeros(sample.n), sample.s]) / 2)
    half = v[:, k // 2] - v[:, 0]
    whole = v[:, -1] - v[:, 0]
    accelerating = math.log2((math.exp(MOVING * k) - 1) / (math.exp(MOVING * k / 2) - 1))
    gain, left = _gain_of_a_cycle(sample, v[:, :-1])
    return [
        close(
            f"{name}: mean speed gained ~ t^p over {k} cycles, p from twice the time",
            _doubling(half, whole),
            1.0,
            band=left / gain,
            scale=0.5,
            against=("exponential growth at the moving cap's rate", accelerating),
            note="so E ~ t^2",
        ),
        close(
            f"{name}: mean speed gained in a cycle",
            mean(whole / k),
            gain,
            band=left,
            scale=gain,
            against=("none", 0.0),
        ),
    ]


def _gain_of_a_cycle(sample: Sample, v: FloatArray) -> tuple[float, float]:
    """Return what theory has particles of these speeds gain in a cycle on average, and its error.

    s = log E1/E0 has mean and variance ~ 1/v, but for lags that fall a little more slowly. So v
    gains v (mean s / 2 + mean s^2 / 8), much the same at every speed: the mean of v is linear in
    time, E quadratic. Of speeds below the first one, at which rates may not be measured, that of
    the first is taken.
    """
    scene = scene_of(sample.run)
    rows = []
    grid = np.geomspace(max(np.quantile(v, SLOWEST), sample.speed), v.max(), N_SPEEDS)
    for speed in grid.tolist():
        found = theory.at_energy(scene, speed**2 / 2)
        left = found.theory_error
        gain = speed * (found.mean_s / 2 + (found.variance_s + found.mean_s**2) / 8)
        rows.append((gain, speed * left.mean_s / 2 + gain * left.variance))
    gains, lefts = (float(np.interp(v, grid, column).mean()) for column in np.array(rows).T)
    return gains, lefts


def _doubling(half: FloatArray, whole: FloatArray) -> Mean:
    """Return log2 of the means' ratio, with the ratio's error to first order.

    The two means are paired.
    """
    ratio = whole.mean() / half.mean()
    error = mean((whole - ratio * half) / half.mean()).error
    return Mean(math.log2(ratio), error / ratio / math.log(2))


CHECKS = {
    "C2": filling,
    "C3": other_clocks,
    "C4": sliding,
    "C5": speeds,
    "C10": partial(
        one_cycle, runs=(IRREGULAR,)
    ),  # two turns in one period, not alike in shapes or times
}
