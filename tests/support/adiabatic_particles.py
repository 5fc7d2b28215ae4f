"""A stand-in for the fast stepper: ensembles drawn from theory itself, with the finite-energy terms it names.

The uncaptured peak has a width ~ E0^(-1/4) and drifts by a quarter of its variance, gathered evenly
through the cycle; the captured gather theirs outside the cap. nu at release exceeds nu at capture by O(1/v).
Cycles are independent.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from mpmath import fp

import fast
import theory
from conformance.audit.evidence import DIGITS
from scene.tables import cycle_length

WIDTHS = {"fixed-cap-anticlockwise": 15.4, "fixed-cap-clockwise": 15.4, "ergodic": 1.9, "untilted": 11.0}

predict = cache(theory.predict)


@cache
def curves(scene):
    prediction = predict(scene, DIGITS)  # the audit asks for the same
    zone = None
    if span := cycle_length(scene):
        grid = np.linspace(0, span, 2001)
        cap = np.log([theory.volumes_at(fp, scene, float(t)).v_cap for t in grid])
        zone = grid, theory.chaotic_zone(scene, grid).log_energy, cap
    return float(prediction.p_nc), float(prediction.log_e_nc), theory.capture_curve(scene, 2001), zone


def simulate(scene, *, n_particles, energy, n_cycles=1, seed=0, threads=None, phases=(), progress=None):
    rng = np.random.default_rng(seed)
    p_nc, _, _, _ = curves(scene)
    s, t_in, t_out = (np.zeros((n_particles, n_cycles)) for _ in range(3))
    phase_s = np.zeros((n_particles, n_cycles, len(phases)))
    inside = np.zeros(phase_s.shape, bool)
    total = np.zeros(n_particles)
    for k in range(n_cycles):
        sigma = WIDTHS.get(scene.name, 3.3) * (energy * np.exp(total)) ** -0.25
        gain, t_in[:, k], t_out[:, k], phase_s[:, k], inside[:, k] = one_cycle(
            scene, energy, sigma, phases, rng
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
        "t_in": t_in[..., None], "t_out": t_out[..., None],
        "wall_counts": counts, "n_careful": np.zeros(n_particles, np.int64),
        "phase_energies": energy * np.exp(phase_s), "phase_captured": inside, "seconds": 1.0, "threads": 1,
    }  # fmt: skip
    if progress:
        progress(n_particles)
    return fast.Ensemble(**{name: fields[name] for name in fast.Ensemble._fields})


def one_cycle(scene, energy, sigma, phases, rng):
    n, speed = len(sigma), np.sqrt(2 * energy)
    p_nc, s_nc, curve, zone = curves(scene)
    u, noise = rng.random(n), rng.standard_normal(n)
    captured = u > p_nc
    s = s_nc + sigma**2 / 4 + sigma * noise
    t_in, t_out = np.full((2, n), np.nan)
    if captured.any():
        places = np.interp(u[captured], curve.p_cha[::-1], np.arange(len(curve.s))[::-1])
        t_in[captured], t_out[captured], gain = (
            np.interp(places, np.arange(len(curve.s)), column)
            for column in (curve.t_in, curve.t_out, curve.s)
        )
        span = cycle_length(scene)
        after = (1 - t_out[captured] / span) * np.exp(-(gain - s_nc) / 2)
        blur = sigma[captured] * np.sqrt(t_in[captured] / span + after)
        s[captured] = gain + blur**2 / 4 + blur * noise[captured]
        if not scene.name.startswith("fixed"):
            late = np.cos(t_in[captured]) + rng.random(captured.sum()) / speed
            t_out[captured] = 2 * np.pi - np.arccos(np.clip(late, -1, 1))
    inside = np.zeros((n, len(phases)), bool)
    phase_s = np.zeros((n, len(phases)))
    if phases:
        grid, gained, cap = zone
        gained = gained - gained[0]
        for k, phase in enumerate(phases):
            t = phase * grid[-1]
            wobble = sigma * np.sqrt(phase)
            now = np.interp(t, grid, gained) + wobble**2 / 4 + wobble * noise
            with np.errstate(invalid="ignore"):
                inside[:, k] = (t_in < t) & (t < t_out)
            entered = np.interp(t_in[inside[:, k]], grid, gained)
            change = np.interp(t, grid, cap) - np.interp(t_in[inside[:, k]], grid, cap)
            now[inside[:, k]] = entered - change * (1 + noise[inside[:, k]] / speed)
            phase_s[:, k] = now
    return s, t_in, t_out, phase_s, inside
