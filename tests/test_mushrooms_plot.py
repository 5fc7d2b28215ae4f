"""`simulate --plot`: a histogram with the theory over it where there is one; a wrong theory would show."""

from __future__ import annotations

import numpy as np
import pytest
from support.refusals import assert_refused, one_line

import fast
import theory
from mushrooms.figures import energies, style
from scene import BangBang, Mushroom, load

RUN = ["simulate", "moving-cap", "--particles", 60, "--energy", 1e4, "--seed", 7, "--threads", 1]


def test_the_same_run_writes_the_same_picture(command_line, tmp_path):
    paths = [tmp_path / name for name in ("a.svg", "b.svg")]
    for path in paths:
        assert command_line(*RUN, "--plot", path)[0] == 0
    first, second = (path.read_bytes() for path in paths)
    assert first == second
    assert first.startswith(b"<?xml")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--plot", "a.pdf"], ".svg, .png"),
        (["--plot", "a.svg", "--particles", "1"], "--particles = 1, must be >= 2"),
    ],
)
def test_bad_options_are_one_line(command_line, monkeypatch, tmp_path, arguments, word):
    monkeypatch.chdir(tmp_path)
    assert_refused(command_line(*RUN, *arguments), word)
    assert list(tmp_path.iterdir()) == []


def test_residuals_tell_another_theory():
    """Energies drawn from the theory lie within it; those of the reversed cycle do not."""
    drawn = theory.at_energy(load("moving-cap"), 1e7).draw(1, 20_000, 3)[:, 0]
    pulls = {}
    for name in ("moving-cap", "moving-cap-reversed"):
        figure = energies.histogram(load(name), 1e7, drawn)
        line = figure.axes[1].lines[-1].get_ydata()
        pulls[name] = float(np.sqrt(np.nanmean(np.square(line))))
    assert pulls["moving-cap"] < 1.3
    assert pulls["moving-cap-reversed"] > 5


def labels(axes) -> list[str]:
    return axes.get_legend_handles_labels()[1]


def test_a_scene_without_theory_is_drawn_alone():
    assert energies.known(load("breathing-circle"), 1e4) is None
    figure = energies.histogram(load("breathing-circle"), 1e4, np.linspace(-1e-3, 1e-3, 50), 60)
    [axes] = figure.axes
    assert labels(axes) == ["simulation"]
    assert (axes.patches[0].get_data().values > 0).sum() > 20  # bars as wide as the energies ask for
    assert axes.get_title().endswith("60 particles\n(10 of them never free, or lost: left out)")


OWN = Mushroom(
    r=1.0,
    slope=0.08,
    w=BangBang(((0.0, 0.9), (1.0, 0.9), (2.0, 0.4), (3.0, 0.4), (4.0, 0.9))),
    h=BangBang(((0.0, 0.6), (1.0, 1.5), (2.0, 1.5), (3.0, 0.6), (4.0, 0.6))),
)


def test_the_captured_of_an_own_scene_are_drawn():
    """Their density is that of theory: its area is the captured share."""
    drawn = theory.energies(OWN)
    run = fast.simulate(OWN, n_particles=300, energy=1e6, seed=1)
    [axes] = energies.histogram(OWN, 1e6, np.log(run.energy / 1e6)[run.takes_part()], 300).axes
    captured, free = axes.lines[-2:]
    assert labels(axes) == ["simulation", "theory, captured, at high energies", "theory, never captured"]
    assert np.trapezoid(captured.get_ydata(), captured.get_xdata()) == pytest.approx(1 - drawn.p_nc, rel=0.02)
    assert free.get_xdata()[0] == pytest.approx(drawn.s_nc)


@pytest.mark.parametrize("n_blocks", [1, 3])
def test_growth_shows_means_and_theory_of_each_cycle(n_blocks):
    run = fast.simulate(load("moving-cap"), n_particles=200, energy=1e4, n_cycles=3, seed=2)
    gains = np.log(run.cycle_energies / run.energy0)
    figure = energies.growth(load("moving-cap"), 1e4, iter(np.array_split(gains, n_blocks)))
    left, right = figure.axes
    [mean] = [one for one in left.containers if one.get_label() == "mean"]
    assert mean.lines[0].get_ydata() == pytest.approx([0.0, *gains.mean(axis=0)])
    told = dict(zip(labels(left), left.get_legend_handles_labels()[0], strict=True))
    [line] = [one for name, one in told.items() if name.startswith("theory, m1")]
    assert np.abs(line.get_ydata()[1:] - gains.mean(axis=0)).max() < 4 * gains.std() / 200**0.5
    assert line.get_ydata()[1] == pytest.approx(theory.at_energy(load("moving-cap"), 1e4).mean_s)
    assert any("theory at this energy" in name for name in labels(right))


@pytest.mark.parametrize("picture", [energies.histogram, energies.growth])
def test_a_figure_takes_a_scene_and_not_its_name(picture):
    assert "scene.load('moving-cap')" in one_line(picture, "moving-cap", 1e4, np.zeros(9))
    for gains, words in (
        (np.zeros(1), "gains: 1 particles"),
        ([0.0, np.nan, np.inf], "gains: 1 particles"),
        ("moving-cap", "gains = 'moving-cap'"),
        (1.0, "gains = 1.0"),
        (None, "gains = None"),
    ):
        assert one_line(picture, load("moving-cap"), 1e4, gains).startswith(words)
    assert one_line(picture, load("moving-cap"), -1.0, np.zeros(9)).startswith("energy = -1.0")


@pytest.mark.parametrize(
    ("number", "text"), [(50.0, "50"), (2500.0, "2500"), (1e5, "$10^{5}$"), (2.5e-7, r"$2.5\cdot10^{-7}$")]
)
def test_energies_are_written_as_powers(number, text):
    assert style.power(number) == text
