"""Figures of laws: through the cycle, against energy, and of the frozen table."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

import theory
from conformance.audit.claims.broadened import width, zone_energy
from conformance.audit.claims.exponents import nu_gap, zone_share
from conformance.audit.claims.finite_energy import fitted
from conformance.audit.runs import Sample, scene_of
from conformance.audit.tolerances import Mean, mean, share
from mushrooms.figures.cycles import points
from mushrooms.figures.orbits import draw_map, draw_section
from mushrooms.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, new_figure
from mushrooms.orbits import follow
from scene import load

N_ORBITS = 40
N_HITS = 250
SEED = 7


def zone(samples: list[Sample]) -> Figure:
    """Draw mean log E of the uncaptured and the share in the chaotic zone through the cycle."""
    figure, axes = new_figure(9.6, 3.0 * len(samples), len(samples), 2)
    for (left, right), sample in zip(np.reshape(axes, (-1, 2)), samples, strict=True):
        times, means, _ = zone_energy(sample)
        span = times[0] / sample.run.phases[0]
        fine = np.linspace(0, span, 400)
        curve = theory.chaotic_zone(scene_of(sample.run), fine)
        left.plot(fine / span, curve.log_energy - curve.log_energy[0], color=ORANGE, label="theory, eq. (dE)")
        points(left, sample.run.phases, means)
        left.set(xlabel="t / T", ylabel="mean ln(E/E0), not captured so far", title=sample.run.name)
        right.plot(fine / span, curve.p_cha, color=ORANGE, label="theory, eq. (ps)")
        shares = zone_share(sample, np.array(times))
        errors = [Mean(float(p), math.sqrt(max(p * (1 - p), 1e-6) / sample.n)) for p in shares]
        points(right, sample.run.phases, errors)
        right.set(xlabel="t / T", ylabel="share in the chaotic zone", title=sample.run.name, ylim=(0, 1.05))
        left.legend(loc="lower center")
        right.legend(loc="lower left")
    return figure


def widths(moving: list[Sample], ergodic: list[Sample]) -> Figure:
    """Draw the width of the uncaptured peak against E0, with fitted powers."""
    figure, axes = new_figure(5.4, 3.8)
    for samples, colour, marker, label in ((moving, BLUE, "o", "moving cap"), (ergodic, GREEN, "s", "c = 0")):
        energies, values = [sample.run.energy for sample in samples], [width(sample) for sample in samples]
        fit = fitted(samples, values)
        text = f"{label}: exponent {fit.exponent:.4f} ± {fit.exponent_error:.4f}"
        points(axes, energies, values, fmt=marker, color=colour, markersize=5, label=text)
        axes.plot(energies, fit.coefficient * np.array(energies) ** fit.exponent, color=colour, linewidth=1)
    x = np.array([moving[0].run.energy, moving[-1].run.energy])
    printed = width(moving[0]).value * (x / x[0]) ** 0.25
    axes.plot(x, printed, color=ORANGE, linestyle="--", label="as printed, E0^(1/4)")
    axes.set(xscale="log", yscale="log", xlabel="E0", ylabel="width of the uncaptured peak of ln(E1/E0)")
    axes.legend(fontsize=8)
    return figure


def convergence(samples: list[Sample]) -> Figure:
    """Draw the mean of s, p_nc and the unbiased mean against E0."""
    figure, axes = new_figure(9.6, 3.2, 1, 3)
    energies = [sample.run.energy for sample in samples]
    scene = load("moving-cap")
    prediction, unbiased = theory.predict(scene, 15), theory.unbiased_mean(scene)
    rows: tuple[tuple[str, list[Mean], float], ...] = (
        ("mean of ln(E1/E0)", [mean(s.gain) for s in samples], float(prediction.m1)),
        ("share never captured", [share(s.never_captured) for s in samples], float(prediction.p_nc)),
        ("mean of exp(-s/2)", [mean(np.exp(-s.gain / 2)) for s in samples], float(unbiased)),
    )
    for panel, (label, values, truth) in zip(axes, rows, strict=True):
        points(panel, energies, values)
        panel.axhline(truth, color=ORANGE, label="theory, infinite E0")
        panel.set(xscale="log", xlabel="E0", title=label)
    fit = theory.extrapolate(energies, [v.value for v in rows[0][1]], [v.error for v in rows[0][1]])
    x = np.geomspace(energies[0], energies[-1], 200)
    label = f"{fit.limit:.4f} + {fit.slope:.2f} E0^(-1/2)"
    axes[0].plot(x, fit.limit + fit.slope * x**-0.5, color=BLACK, linewidth=1, label=label)
    axes[0].legend(fontsize=8)
    return figure


def release(samples: list[Sample]) -> Figure:
    """Draw nu(t_out) - nu(t_in) against 1/v."""
    figure, axes = new_figure(9.6, 3.4, 1, 2)
    for sample in samples:
        gap = nu_gap(sample)
        shown = np.abs(gap[:400])
        place = np.full(len(shown), 1 / sample.speed)
        axes[0].plot(place, shown, ".", color=GREY, markersize=1.5, rasterized=True)
    x = np.array([1 / sample.speed for sample in samples])
    rms = np.array([math.sqrt(np.mean(nu_gap(sample) ** 2)) for sample in samples])
    axes[0].plot(x, rms, "o", color=BLUE, label="root mean square")
    axes[0].plot(x, rms[0] * x / x[0], color=ORANGE, label="slope 1")
    axes[0].set(xscale="log", yscale="log", ylim=(rms.min() / 100, rms.max() * 100))
    axes[0].set(xlabel="1/v", ylabel="|nu(t_out) - nu(t_in)|")
    axes[0].legend()
    sample = samples[-1]
    gap = nu_gap(sample) * sample.speed
    axes[1].hist(gap, np.linspace(-1, 1.5, 101), density=True, color=BLUE, alpha=0.5)
    axes[1].set(xlabel="v (nu(t_out) - nu(t_in))", ylabel="density", title=sample.run.name)
    return figure


def frozen() -> Figure:
    """Draw the frozen mushroom: hits of the arc, and the boundary map."""
    figure, axes = new_figure(9.6, 4.2, 1, 2)
    found = follow(load("frozen-mushroom"), N_HITS, seed=SEED, n_orbits=N_ORBITS)
    draw_section(axes[0], found)
    draw_map(axes[1], found)
    for panel in axes:
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15))
    return figure
