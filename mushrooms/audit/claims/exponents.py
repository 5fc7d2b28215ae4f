"""Laws confirmed by measured exponents and through the cycle: L1 to L7.

Exponents are fitted with the next order beside them, so that no band is needed for it. What is
random carries its standard error, that of orbits drawn (L1, C6) too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from mpmath import fp

import theory
from mushrooms.audit.claim import Check, ClaimEvidence
from mushrooms.audit.claims.experiments import chord_time
from mushrooms.audit.claims.finite_energy import (
    ACW,
    ERGODIC,
    FIXED,
    LADDER,
    captured_change,
    fitted,
    phase_times,
    predicted,
    share_in_the_zone,
    zone_energy,
)
from mushrooms.audit.runs import RUNS, Sample, run_seed, scene_of
from mushrooms.audit.tolerances import (
    BoolArray,
    FloatArray,
    Mean,
    close,
    mean,
    share,
    spread,
    stated,
)
from scene import Scene, State, load
from scene.geometry import area, table_at

if TYPE_CHECKING:
    from fast import Collisions

SPEEDS = tuple(10.0 ** (k / 2) for k in range(4, 9))  # 100 to 10,000
N_ORBITS = 12
DURATION = 1.0  # of the 2 pi of a cycle: O(v) hits
KT = 50.0
HOTTER = 2.0
N_POINTS = {"quick": 400_000, "full": 4_000_000}
N_ENERGIES = {"quick": 400, "full": 2000}
PER_ENERGY = 20


def circle(evidence: ClaimEvidence) -> list[Check]:
    """L1: the breathing circle, hit by hit."""
    orbits = _orbits(evidence.steppers.trajectory, evidence.seed)
    momentum = float(orbits["momentum"].max())
    return [
        stated(
            f"angular momentum at arc hits, {N_ORBITS} orbits: largest relative change",
            momentum < 1e-12,
            f"{momentum:.1e}",
            "rounding of up to 10,000 hits, < 1e-12",
        ),
        _orbits_exponent(
            "outgoing less incoming angle, less 2 (u/v) sin phi (eq. barph)",
            orbits["turned"],
            -2,
        ),
        _orbits_exponent(
            "relative change of speed at a hit, less -2 (u/v) cos phi",
            orbits["slowed"],
            -2,
        ),
        _orbits_exponent("phi' - phi per hit", orbits["step"], -2),
        _orbits_exponent("drift of v r over a fixed time", orbits["product"], -1),
    ]


def impact_angle(evidence: ClaimEvidence) -> list[Check]:
    """C6: phi_hat through the breathing cap, at impacts and between them."""
    orbits = _orbits(evidence.steppers.trajectory, evidence.seed)
    return [
        _orbits_exponent(
            f"largest change of phi_hat {what} over a fixed time",
            orbits[name],
            -1,
        )
        for what, name in (("at impacts", "angle"), ("half-way between impacts", "between"))
    ]


@lru_cache(maxsize=1)  # L1 and C6 look at the same
def _orbits(follow: Callable[..., Collisions], seed: int) -> dict[str, FloatArray]:
    """Return what changes along drawn orbits, by the names of `_orbit`: (N_ORBITS, len(SPEEDS))."""
    scene = load("breathing-circle")
    random = np.random.default_rng(run_seed(seed, RUNS["frozen-mushroom@1e8"], -3))
    starts = random.uniform((-0.6, 0.1, 0.0), (0.6, 0.7, 2 * np.pi), size=(N_ORBITS, 3)).tolist()
    rows = [[_orbit(follow, scene, speed, *start) for speed in SPEEDS] for start in starts]
    return {name: np.array([[orbit[name] for orbit in row] for row in rows]) for name in rows[0][0]}


def _orbit(
    follow: Callable[..., Collisions], scene: Scene, speed: float, x: float, y: float, turn: float
) -> dict[str, float]:
    """Return what changes along one orbit of the breathing circle.

    momentum: largest relative change of L.
    step: root mean square of phi' - phi per hit.
    product, angle: largest relative change of v r, and largest change of phi, at hits.
    between: largest change of phi_hat half-way to the next hit.
    turned: root mean square, over hits, of the change of angle at a hit less that of eq. (barph).
    slowed: the same of the relative change of speed.
    """
    state = State(0.0, x, y, speed * math.cos(turn), speed * math.sin(turn))
    done = follow(scene, state, int(4 * speed), DURATION)
    at_arc = np.array([wall == "arc" for wall in done.walls])
    _, t, x_, y_, vx, vy = done.steps[at_arc].T
    momentum = np.abs(x_ * vy - y_ * vx)
    times = np.concatenate([t, (t[1:] + t[:-1]) / 2])
    r, middle = np.split(scene.laws["r"].values(times), [len(t)])
    after = np.hypot(vx, vy)
    before = np.concatenate([[speed], after[:-1]])  # the base stands still
    phi = np.arcsin(momentum / (r * before))
    flown = np.arcsin(momentum[:-1] / (middle * after[:-1]))
    product = before * r
    u_over_v = scene.laws["r"].values(t, 1) / before
    turned = np.arcsin(momentum / (r * after)) - phi - 2 * u_over_v * np.sin(phi)
    slowed = after / before - 1 + 2 * u_over_v * np.cos(phi)
    return {
        "momentum": float(np.max(np.abs(momentum / momentum[0] - 1))),
        "step": float(np.sqrt(np.mean(np.diff(phi) ** 2))),
        "product": float(np.max(np.abs(product / product[0] - 1))),
        "angle": float(np.max(np.abs(phi - phi[0]))),
        "between": float(np.max(np.abs(flown - phi[0]))),
        "turned": float(np.sqrt(np.mean(turned**2))),
        "slowed": float(np.sqrt(np.mean(slowed**2))),
    }


def _orbits_exponent(what: str, rows: FloatArray, exponent: int) -> Check:
    """Compare the exponent of v with an expected one; its error is of the mean over orbits."""
    fits = [
        theory.fit_power(SPEEDS, row, np.full(len(row), 0.1), (-1.0, -2.0)).exponent for row in rows
    ]
    return close(
        f"{what}: exponent of v, {len(rows)} orbits",
        mean(fits),
        exponent,
        scale=0.5,
        against=(f"{exponent + 1}", exponent + 1),
    )


def invariants(evidence: ClaimEvidence) -> Iterator[Check]:
    """L2: E V_cap in the cap, E V in the ergodic table."""
    captured = evidence.samples(*LADDER[1:6])
    widths = [spread(cap_change(sample)) for sample in captured]
    yield _exponent(
        "log(E V_cap) of captured particles, phase 7/16 to 9/16: spread against E0",
        captured,
        widths,
        -0.5,
    )
    high = captured[-2]
    # E is seen since the last hit, half a chord before on average, in which log V_cap changes by 2
    # u/v.
    arc = scene_of(high.run).laws["r"].bounds().slope
    yield close(
        f"{high.run.name}: its mean", mean(cap_change(high)), 0.0, band=2 * arc / high.speed
    )
    free = evidence.samples(*ERGODIC)
    changes = [sample.phase_s[:, 0, 3] + log_volume(sample, 0.5) for sample in free]
    yield _exponent(
        "c = 0, log(E V) at half a cycle: spread against E0",
        free,
        [spread(c) for c in changes],
        -0.25,
    )
    found = predicted(free[-1])
    yield close(
        f"{free[-1].run.name}: its mean, less the predicted drift",
        mean(changes[-1]).less(float(found.zone([math.pi])[1][0]) / 4),
        0.0,
        band=found.theory_error.mean_s,
    )


def cap_change(sample: Sample) -> FloatArray:
    """Return the change of log(E V_cap) from phase 7/16 to 9/16 of those in the island at both."""
    volumes = [
        theory.volumes_at(fp, scene_of(sample.run), 2 * fp.pi * k / 16).v_cap for k in (7, 9)
    ]
    return captured_change(sample, 6, 8) + math.log(volumes[1] / volumes[0])


def log_volume(sample: Sample, phase: float) -> float:
    """Return log V(t)/V(0) of the whole table."""
    scene = scene_of(sample.run)
    now, start = (theory.volumes_at(fp, scene, scene.period * p) for p in (phase, 0.0))
    return math.log((now.v_cap + now.v_stem) / (start.v_cap + start.v_stem))


def _exponent(what: str, samples: list[Sample], values: list[Mean], exponent: float) -> Check:
    """Compare the exponent of E0 with an expected one.

    The next order, ~ 1/v, is fitted beside it.
    """
    fit = fitted(samples, values, -0.5)
    energies = [sample.run.energy for sample in samples]
    return close(
        what,
        (fit.exponent, fit.exponent_error),
        exponent,
        scale=0.25,
        against=("half of it", exponent / 2),
        note=f"E0 from {energies[0]:.0e} to {energies[-1]:.0e}",
    )


def volumes(evidence: ClaimEvidence) -> Iterator[Check]:
    """L3: volumes as shares of random phase points, and of particles that stay in a frozen cap."""
    n = N_POINTS[evidence.size]
    random = np.random.default_rng(run_seed(evidence.seed, RUNS["frozen-mushroom@1e8"], -1))
    scene = load("moving-cap")
    for phase in (1 / 8, 3 / 8, 1 / 2):
        now = theory.volumes_at(fp, scene, 2 * fp.pi * phase)
        inside, in_cap, in_island = _points(scene, 2 * math.pi * phase, n, random)
        total = now.v_cap + now.v_stem
        label = f"moving cap at {phase:g} of its cycle"
        yield from [
            close(f"{label}: V_cap / V", share(in_cap[inside]), now.v_cap / total),
            close(
                f"{label}: V_ell / V_cap", share(in_island[inside & in_cap]), now.v_ell / now.v_cap
            ),
        ]
    for sample in evidence.samples("frozen-mushroom@1e8", "frozen-untilted@1e8"):
        still = theory.volumes_at(fp, scene_of(sample.run), 0.0)
        yield close(
            f"{sample.run.scene}: particles that never meet the stem's walls",
            share(sample.stem_hits == 0),
            still.v_ell / (still.v_cap + still.v_stem),
            band=1e-3,
            note="band: sticky chaotic orbits that had not yet left the cap",
        )


def _points(
    scene: Scene, t: float, n: int, random: np.random.Generator
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Draw points in a box around the table; tell which lie in it, in the cap, in the island."""
    table = table_at(fp, scene, t)
    r = table.r
    h = table.h
    w = table.w
    x = random.uniform(-r, r, n)
    y = random.uniform(-h, r, n)
    turn = random.uniform(0, 2 * np.pi, n)
    in_cap = (y >= 0) & (table.gap("arc", x, y) >= 0)
    in_stem = (y < 0) & (np.abs(x) <= table.half_width(y))
    momentum = np.abs(x * np.sin(turn) - y * np.cos(turn))
    return in_cap | in_stem, in_cap, in_cap & (momentum >= w)


def release(evidence: ClaimEvidence) -> list[Check]:
    """L4: captured at t_in, released when nu returns."""
    samples = evidence.samples(*LADDER[1:6])
    gaps = [nu_gap(sample) for sample in samples]
    sizes = [mean(gap**2).root() for gap in gaps]
    largest = max(
        float(np.max(np.abs(gap))) * sample.speed for gap, sample in zip(gaps, samples, strict=True)
    )
    bound = _largest_gap(samples[0])
    return [
        _exponent("nu(t_out) - nu(t_in): root mean square against E0", samples, sizes, -0.5),
        stated(
            "largest |nu(t_out) - nu(t_in)| v at any energy",
            largest < bound,
            f"{largest:.2f}",
            f"< {bound:.2f}, twice a chord's and the angle's drift",
        ),
    ]


def _largest_gap(sample: Sample) -> float:
    """Return a bound on |nu(t_out) - nu(t_in)| v for the moving cap, to the first order in 1/v.

    Capture and release are each seen up to a chord late, 2 r/v, in which nu changes by its rate
    times that. Meanwhile v r changes relatively by up to (1/v) (2 u + the integral of u^2/r): at
    each hit the radius has moved by r'' dt^2 / 2 beyond what the speed lost, dt = 2 r cos(phi)/v;
    and sin(phi) = L/(v r) as much.
    """
    scene = scene_of(sample.run)
    arc = scene.laws["r"].bounds()
    mouth = scene.laws["nu"].bounds()
    return float(
        2 * 2 * arc.highest * mouth.slope
        + (2 * arc.slope + scene.period * arc.slope**2 / arc.lowest)
    )


def nu_gap(sample: Sample) -> FloatArray:
    """Return nu(t_out) - nu(t_in) of the captured of a moving-cap run."""
    t_in, t_out = (t[sample.captured] for t in sample.first_capture)
    return np.asarray(0.4 * (np.cos(t_out) - np.cos(t_in)))  # nu = 0.6 + 0.4 cos t


def energy_through_the_cycle(evidence: ClaimEvidence) -> Iterator[Check]:
    """L5: mean log E in the chaotic zone against eq. (dE), with its drift and the others' lags."""
    for run, every in (("moving-cap@1e7", 2), (ACW, 1), ("fixed-cap-anticlockwise@1e7", 1)):
        sample = evidence.sample(run)
        times, means = zone_energy(sample)
        found = predicted(sample)
        expected = found.zone(times)[0]
        wait = found.zone(np.array(times) - chord_time(sample))[0]
        for k in range(every - 1, len(times), every):
            yield close(
                f"{run}: mean log E/E0 at phase {sample.run.phases[k]:g}",
                means[k],
                float(expected[k]),
                band=found.theory_error.peak_mean + abs(float(expected[k] - wait[k])),
                against=("E V is kept, no flux", -log_volume(sample, sample.run.phases[k])),
            )
    for run in FIXED:
        yield _lag_at_capture(evidence.sample(run))


def _lag_at_capture(sample: Sample) -> Check:
    """Compare log E of captured particles with what they had when captured.

    A cap at rest keeps it.
    """
    found = predicted(sample)
    times = sample.first_capture[0]
    k = int(np.argmax(sample.phase_captured[:, 0].sum(axis=0)))
    inside = sample.phase_captured[:, 0, k] & sample.captured
    expected = found.at_capture(times[inside])[0]
    seen_late = expected - found.at_capture(times[inside] - chord_time(sample))[0]
    lag = float(np.mean(expected - found.zone(times[inside])[0]))
    return close(
        f"{sample.run.name}: log E of the captured when captured, less its prediction",
        mean(sample.phase_s[inside, 0, k] - expected),
        0.0,
        band=found.theory_error.captured_mean + abs(float(seen_late.mean())),
        note=f"a lag of {lag:.4f} behind the uncaptured is part of it",
        against=("no lag", -lag),
    )


def zone_share(sample: Sample, times: FloatArray) -> FloatArray:
    """Return the share of particles in the chaotic zone at each time."""
    t_in, t_out = (np.sort(t[sample.captured]) for t in sample.first_capture)
    caught, freed = (np.searchsorted(t, times, side="right") for t in (t_in, t_out))
    return np.asarray(1 - (caught - freed) / sample.n)


def population_through_the_cycle(evidence: ClaimEvidence) -> Iterator[Check]:
    """L6: p_cha(t) against eq. (ps), with what lags do to it."""
    for run, every in (("moving-cap@1e7", 2), (ACW, 1), ("fixed-cap-anticlockwise@1e7", 1)):
        sample = evidence.sample(run)
        times = np.array(phase_times(sample))
        wait = chord_time(sample)
        expected = share_in_the_zone(sample, times)
        earlier = share_in_the_zone(sample, times - wait)
        measured = zone_share(sample, times)
        left = predicted(sample).theory_error
        for k in range(every - 1, len(times), every):
            p = float(expected[k])
            error = math.sqrt(max(p * (1 - p), 1 / sample.n) / sample.n)
            yield close(
                f"{run}: share in the chaotic zone at phase {sample.run.phases[k]:g}",
                (float(measured[k]), error),
                p,
                band=abs(p - float(earlier[k])) + left.p_nc,
                against=("nobody is captured", 1.0)
                if p < 0.99
                else ("nobody is released", expected.min()),
            )


def work(evidence: ClaimEvidence) -> Iterator[Check]:
    """L7: mean exp(-W/kT) = A(t)/A(0), exact at any speed of the walls."""
    phases = (0.25, 0.5, 0.75)
    scene = load("moving-cap")
    random = np.random.default_rng(run_seed(evidence.seed, RUNS["moving-cap@1e3"], -1))
    rows = []
    n_lost = 0
    for k, energy in enumerate(random.exponential(HOTTER * KT, N_ENERGIES[evidence.size])):
        seed = run_seed(evidence.seed, RUNS["moving-cap@1e3"], -2 - k)
        done = evidence.steppers.simulate(
            scene,
            n_particles=PER_ENERGY,
            energy=float(energy),
            seed=seed,
            threads=evidence.threads,
            phases=phases,
        )
        ends = np.column_stack([done.phase_energies[:, 0], done.energy])[done.outcome == 0]
        n_lost += PER_ENERGY - len(ends)
        # Energies are drawn at HOTTER times kT and weighted back: a few fast particles would carry
        # the mean.
        rows.append(np.mean(HOTTER * np.exp(energy / (HOTTER * KT) - ends / KT), axis=0))
    alike = math.exp(-evidence.predict("moving-cap").m1)
    for k, phase in enumerate((*phases, 1.0)):
        values = np.array(rows)[:, k]
        ratio = area(scene, 2 * math.pi * phase) / area(scene, 0.0)
        yield close(
            f"kT = {KT:g}, phase {phase:g}: mean exp(-W/kT)",
            mean(values),
            ratio,
            # Over a cycle no work is right on average: it is told from equal gains of all.
            against=("all gain alike", alike) if phase == 1 else ("no work", 1.0),
            note=f"{len(rows)} energies of {PER_ENERGY} particles, {n_lost} not followed",
        )


CHECKS = {
    "L1": circle,
    "L2": invariants,
    "L3": volumes,
    "L4": release,
    "L5": energy_through_the_cycle,
    "L6": population_through_the_cycle,
    "L7": work,
    "C6": impact_angle,
}
