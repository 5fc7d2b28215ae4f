"""A stand-in for the fast stepper: ensembles drawn from theory itself, finite energy included.

Where frozen rates are known, energies are drawn from `theory.at_energy`; where a particle is captured
several times in a cycle its windows are drawn one by one, and finite energy adds its means. Without rates the
uncaptured peak has a width ~ E0^(-1/4) and drifts by a quarter of its variance. nu at release exceeds
nu at capture by O(1/v). Cycles are independent.
"""

from functools import cache
from itertools import pairwise

import numpy as np
from mpmath import fp

import fast
import theory
from fast.kernel.follow import LANE_ROWS

DIGITS = 12  # of predictions, many more than thousands of particles can tell
TOGETHER = 4000  # particles drawn at a time
WIDTH = 11.0  # of the uncaptured peak, times E0^(1/4), where no frozen rates are known

predict = cache(theory.predict)


@cache
def curves(scene):
    prediction = predict(scene, DIGITS)
    zone = None
    if span := scene.period:
        grid = np.linspace(0, span, 2001)
        cap = np.log(theory.volumes_at(np, scene, grid).v_cap)
        zone = grid, theory.chaotic_zone(scene, grid).log_energy, cap
    return float(prediction.p_nc), float(prediction.log_e_nc), theory.capture_curve(scene, 2001), zone


@cache
def windows(scene):
    """Return the captures of each well that follows another in time: p_cha falling, t_in, t_out, gain."""
    _, s_nc, curve, _ = curves(scene)
    starts = [0, *(np.flatnonzero(np.diff(curve.p_cha) > 0) + 1), len(curve.p_cha)]
    parts = [slice(i, j) for i, j in pairwise(starts) if j > i]
    return [(curve.p_cha[k], curve.t_in[k], curve.t_out[k], curve.s[k] - s_nc) for k in parts]


def simulate(
    scene, *, n_particles, energy, n_cycles=1, seed=0, first=0, threads=None, phases=(), progress=None
):
    if progress:
        progress(n_particles)
    return joined(scene, n_particles, energy, n_cycles, seed, first, tuple(phases))


def go_on(scene, *, before=None, **options):
    """Stand for `fast.go_on`, for those who begin: none of these particles can go on."""
    assert before is None
    ensemble = simulate(scene, **options)
    return fast.Paused(ensemble, np.full((len(ensemble.energy), LANE_ROWS), np.nan))


@cache  # whoever plants a fault changes copies
def joined(scene, n_particles, energy, n_cycles, seed, first, phases):
    """Return particles that are the same in every run of the seed, as those of `fast.simulate` are."""
    size = TOGETHER if n_cycles == 1 else TOGETHER // 5
    numbers = range(first // size, -(-(first + n_particles) // size))
    parts = [drawn(scene, size, energy, n_cycles, (seed, number), phases) for number in numbers]
    cut = slice(first % size, first % size + n_particles)
    names = fast.Ensemble._fields[1:-2]
    fields = {name: np.concatenate([getattr(part, name) for part in parts])[cut] for name in names}
    return parts[0]._replace(**fields)


def drawn(scene, n_particles, energy, n_cycles, seed, phases):
    rng = np.random.default_rng(seed)
    p_nc, _, _, _ = curves(scene)
    n_windows = max(1, len(windows(scene)))
    s = np.zeros((n_particles, n_cycles))
    t_in, t_out = np.zeros((2, n_particles, n_cycles, n_windows))
    phase_s = np.zeros((n_particles, n_cycles, len(phases)))
    inside = np.zeros(phase_s.shape, bool)
    total = np.zeros(n_particles)
    for k in range(n_cycles):
        gain, t_in[:, k], t_out[:, k], phase_s[:, k], inside[:, k] = one_cycle(
            scene, energy, total, phases, rng
        )
        total = total + gain
        s[:, k] = total
    volumes = theory.volumes_at(fp, scene, 0.0)
    stays = (rng.random(n_particles) < volumes.v_ell / (volumes.v_cap + volumes.v_stem)) & (p_nc == 1)
    counts = np.where(stays[:, None], [20, 20, 0, 0, 0], [20, 20, 20, 20, 20])
    fields = {
        "energy0": energy, "energy": energy * np.exp(total), "cycle_energies": energy * np.exp(s),
        **dict.fromkeys(("t", "x", "y", "vx", "vy"), np.zeros(n_particles)),
        "n_collisions": counts.sum(axis=1), "outcome": np.zeros(n_particles, np.int8),
        "t_in": t_in, "t_out": t_out,
        "wall_counts": counts, "n_careful": np.zeros(n_particles, np.int64),
        "phase_energies": energy * np.exp(phase_s), "phase_captured": inside, "seconds": 1.0, "threads": 1,
    }  # fmt: skip
    return fast.Ensemble(**{name: fields[name] for name in fast.Ensemble._fields})


def blurred(variance, noise, rng):
    """Return 4 log of the distance from 0, in four dimensions, of a unit vector that diffused."""
    step = np.sqrt(np.maximum(variance, 0) / 16)
    return 2 * np.log((1 + step * noise) ** 2 + step**2 * rng.chisquare(3, len(noise)))


def stays_in(scene, n, rng):
    """Return gain over the uncaptured, and begin and end of the stay in each window, nan for none."""
    rows = windows(scene)
    gain, t_in, t_out = np.zeros(n), *np.full((2, n, max(1, len(rows))), np.nan)
    for k, (p_cha, begins, ends, gains) in enumerate(rows):
        u = rng.random(n)
        those = u > p_cha[-1]
        place = np.arange(len(p_cha))
        at = np.interp(u[those], p_cha[::-1], place[::-1])
        t_in[those, k], t_out[those, k] = np.interp(at, place, begins), np.interp(at, place, ends)
        gain[those] += np.interp(at, place, gains)
    return gain, t_in, t_out


@cache
def at_phases(scene, energy, phases):
    """Return mean and variance of the uncaptured's log E / E0 at each phase."""
    return theory.at_energy(scene, energy).zone([phase * scene.period for phase in phases])


@cache
def at_capture(scene, energy):
    """Return mean and variance of log E / E0 of each atom of captures when it is captured."""
    found = theory.at_energy(scene, energy)
    times, places = np.unique(found.point_masses.t_in[~found.point_masses.is_free], return_inverse=True)
    entered = np.full((2, len(found.point_masses.t_in)), np.nan)
    entered[:, ~found.point_masses.is_free] = np.array(found.at_capture(times))[:, places]
    return entered


def captured_ever(t_in):
    return np.isfinite(t_in).any(axis=1)


def one_cycle(scene, energy, total, phases, rng):
    n, speed = len(total), np.sqrt(2 * energy)
    _, s_nc, curve, zone = curves(scene)
    # Nothing is said of particles as slow as the walls, which hardly lose more.
    noise, slower = rng.standard_normal(n), np.exp(-np.maximum(total, -4.0) / 2)
    try:
        found = theory.at_energy(scene, energy)
    except theory.NotCovered:
        found = None
    if found and len(windows(scene)) == 1:
        a = found.point_masses
        i = np.minimum(np.searchsorted(np.cumsum(a.weight), rng.random(n)), len(a.weight) - 1)
        t_in = a.t_in[i][:, None]
        t_out = np.interp(t_in, curve.t_in, curve.t_out)
        gain, shift, variance = a.gain[i], a.shift[i], a.variance[i]
    else:
        gain, t_in, t_out = stays_in(scene, n, rng)
        variance = np.full(n, WIDTH**2 * energy**-0.5)
        shift = np.zeros(n)
        if found:
            a = found.point_masses
            for atoms, those in ((a.is_free, ~captured_ever(t_in)), (~a.is_free, captured_ever(t_in))):
                weight = a.weight[atoms] / max(a.weight[atoms].sum(), 1e-300)
                variance[those], shift[those] = weight @ a.variance[atoms], weight @ a.shift[atoms]
    s = s_nc + gain + shift * slower + blurred(variance * slower, noise, rng)
    captured = np.isfinite(t_in[:, 0])
    if captured.any() and not scene.name.startswith("fixed") and t_in.shape[1] == 1:
        late = np.cos(t_in[captured]) + rng.random((captured.sum(), 1)) / speed
        t_out[captured] = 2 * np.pi - np.arccos(np.clip(late, -1, 1))
    inside = np.zeros((n, len(phases)), bool)
    phase_s = np.zeros((n, len(phases)))
    if phases:
        grid, _, cap = zone
        for k, phase in enumerate(phases):
            t = phase * grid[-1]
            centre, spread = (x[k] for x in at_phases(scene, energy, phases))
            now = centre - spread / 4 + blurred(np.full(n, spread), noise, rng)
            with np.errstate(invalid="ignore"):
                inside[:, k] = ((t_in < t) & (t < t_out)).any(axis=1)
            if inside[:, k].any():  # nobody where captures are no atoms
                begun, own = t_in[inside[:, k], 0], noise[inside[:, k]]
                entered, wide = at_capture(scene, energy)[:, i[inside[:, k]]]
                change = np.interp(t, grid, cap) - np.interp(begun, grid, cap)
                now[inside[:, k]] = entered + np.sqrt(np.maximum(wide, 0)) * own - change * (1 + own / speed)
            phase_s[:, k] = now
    return s, t_in, t_out, phase_s, inside
