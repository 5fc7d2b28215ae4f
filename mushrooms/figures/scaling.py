"""Figures of laws: through the cycle, against energy, and of the frozen table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import theory
from conformance.audit.claims.broadened import zone_energy
from conformance.audit.claims.exponents import nu_gap, zone_share
from conformance.audit.claims.finite_energy import fitted_width, width
from conformance.audit.runs import scene_of
from conformance.audit.samples import Sample
from conformance.audit.tolerances import Mean, mean, share
from mushrooms.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, FloatArray, new_figure
from scene import Mushroom, State, load

N_ORBITS = 40
N_HITS = 400


def zone(samples: list[Sample]) -> Figure:
    """Draw mean log E of the uncaptured and the share in the chaotic zone through the cycle."""
    figure, axes = new_figure(9.6, 3.0 * len(samples), len(samples), 2)
    for (left, right), sample in zip(np.reshape(axes, (-1, 2)), samples, strict=True):
        times, means, _ = zone_energy(sample)
        span = times[0] / sample.run.phases[0]
        fine = np.linspace(0, span, 400)
        curve = theory.chaotic_zone(scene_of(sample.run), fine)
        left.plot(fine / span, curve.log_energy - curve.log_energy[0], color=ORANGE, label="theory, eq. (dE)")
        _points(left, sample.run.phases, means)
        left.set(xlabel="t / T", ylabel="mean log E/E0, not captured so far", title=sample.run.name)
        right.plot(fine / span, curve.p_cha, color=ORANGE, label="theory, eq. (ps)")
        shares = zone_share(sample, np.array(times))
        errors = [Mean(float(p), math.sqrt(max(p * (1 - p), 1e-6) / sample.n)) for p in shares]
        _points(right, sample.run.phases, errors)
        right.set(xlabel="t / T", ylabel="share in the chaotic zone", title=sample.run.name, ylim=(0, 1.05))
        left.legend(loc="lower center")
        right.legend(loc="lower left")
    return figure


def _points(axes: Axes, x: tuple[float, ...] | list[float], values: list[Mean], **style: Any) -> None:
    found, errors = zip(*values, strict=True)
    usual: dict[str, Any] = {"fmt": "o", "markersize": 4, "label": "simulation, ± 1 standard error"}
    axes.errorbar(x, found, errors, capsize=2, **usual | {"color": BLUE} | style)


def widths(moving: list[Sample], ergodic: list[Sample]) -> Figure:
    """Draw the width of the uncaptured peak against E0, with fitted powers."""
    figure, axes = new_figure(5.4, 3.8)
    for samples, colour, marker, label in ((moving, BLUE, "o", "moving cap"), (ergodic, GREEN, "s", "c = 0")):
        fit, energies = fitted_width(samples)
        text = f"{label}: exponent {fit.exponent:.4f} ± {fit.exponent_error:.4f}"
        values = [width(sample) for sample in samples]
        _points(axes, energies, values, fmt=marker, color=colour, markersize=5, label=text)
        axes.plot(energies, fit.coefficient * np.array(energies) ** fit.exponent, color=colour, linewidth=1)
    x = np.array([moving[0].run.energy, moving[-1].run.energy])
    printed = width(moving[0]).value * (x / x[0]) ** 0.25
    axes.plot(x, printed, color=ORANGE, linestyle="--", label="as printed, E0^(1/4)")
    axes.set(xscale="log", yscale="log", xlabel="E0", ylabel="width of the uncaptured peak of log E1/E0")
    axes.legend(fontsize=8)
    return figure


def convergence(samples: list[Sample]) -> Figure:
    """Draw the mean of s, p_nc and the unbiased mean against E0."""
    figure, axes = new_figure(9.6, 3.2, 1, 3)
    energies = [sample.run.energy for sample in samples]
    scene = load("moving-cap")
    prediction, unbiased = theory.predict(scene, 15), theory.unbiased_mean(scene)
    rows: tuple[tuple[str, list[Mean], float], ...] = (
        ("mean of log E1/E0", [mean(s.gain) for s in samples], float(prediction.m1)),
        ("share never captured", [share(s.never_captured) for s in samples], float(prediction.p_nc)),
        ("mean of exp(-s/2)", [mean(np.exp(-s.gain / 2)) for s in samples], float(unbiased)),
    )
    for panel, (label, values, truth) in zip(axes, rows, strict=True):
        _points(panel, energies, values)
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
    """Draw the frozen mushroom: hits on the arc, and the boundary map over the whole boundary."""
    import fast

    scene = load("frozen-mushroom")
    assert isinstance(scene, Mushroom)
    nu = float(scene.nu)  # type: ignore[arg-type]
    figure, axes = new_figure(9.6, 3.8, 1, 2)
    random = np.random.default_rng(7)
    for _ in range(N_ORBITS):
        psi, turn = random.uniform(0, math.pi), random.uniform(0, 2 * math.pi)
        rho = math.sqrt(random.uniform(0, 1)) * 0.98
        state = State(0.0, rho * math.cos(psi), rho * math.sin(psi), math.cos(turn), math.sin(turn))
        island = abs(state.x * state.vy - state.y * state.vx) >= nu
        done = fast.trajectory(scene, state, N_HITS)
        walls, steps = np.array(done.walls), done.steps
        place, angle = _boundary(scene, walls, steps)
        colour = BLUE if island else ORANGE
        arc = walls == "arc"
        style = {"linestyle": "none", "marker": ".", "markersize": 1.2, "color": colour, "rasterized": True}
        axes[0].plot(np.arctan2(steps[arc, 3], steps[arc, 2]), angle[arc], **style)
        axes[1].plot(place, angle, **style)
    for side in (-1, 1):
        axes[0].axhline(side * nu, color=BLACK, linewidth=1)
    axes[0].set(xlabel="place on the arc, psi", ylabel="sin phi", title="arc hits; lines: |sin phi| = nu")
    axes[1].set(
        xlabel="arclength along the boundary: arc, base, left, floor, right",
        ylabel="sin of the angle",
        title="boundary map: island blue, chaotic zone orange",
    )
    return figure


def _boundary(
    scene: Mushroom, walls: npt.NDArray[np.str_], steps: npt.NDArray[np.floating[Any]]
) -> tuple[FloatArray, FloatArray]:
    """Return arclength and sine of the angle with the inward normal, after each hit."""
    _, _, x, y, vx, vy = steps.T
    r, h, slope = float(scene.r), float(scene.h), float(scene.slope)  # type: ignore[arg-type]
    w = r * float(scene.nu)  # type: ignore[arg-type]
    foot, side = w - h * slope, math.hypot(h, h * slope)
    starts = {"arc": 0.0, "base": math.pi * r, "left": math.pi * r + 2 * (r - w)}
    starts["floor"] = starts["left"] + side
    starts["right"] = starts["floor"] + 2 * foot
    tilt = math.hypot(1, slope)
    rows = {
        "arc": (r * np.arctan2(y, x), (vy * x - vx * y) / r),
        "base": (np.where(x < 0, x + r, x + r - 2 * w), vx),
        "left": (-y * tilt, (-vy + slope * vx) / tilt),
        "floor": (x + foot, vx),
        "right": ((y + h) * tilt, (vy + slope * vx) / tilt),
    }
    place, angle = np.zeros(len(x)), np.zeros(len(x))
    for wall, (along, sine) in rows.items():
        here = walls == wall
        place[here], angle[here] = starts[wall] + along[here], sine[here]
    return place, angle / np.hypot(vx, vy)
