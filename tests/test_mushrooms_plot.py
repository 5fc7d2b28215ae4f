"""`simulate --plot`: a histogram with the theory over it where there is one; a wrong theory would show."""

from __future__ import annotations

import numpy as np
import pytest
from support.refusals import assert_refused

import theory
from mushrooms.figures import energies
from scene import load

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
        (["--plot", "a.svg", "--cycles", "2"], "--cycles = 2, must be 1"),
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
        figure = energies.histogram(load(name), 1e7, drawn, name)
        line = figure.axes[1].lines[-1].get_ydata()
        pulls[name] = float(np.sqrt(np.nanmean(np.square(line))))
    assert pulls["moving-cap"] < 1.3
    assert pulls["moving-cap-reversed"] > 5


def test_a_scene_without_theory_is_drawn_alone():
    assert energies.known(load("breathing-circle"), 1e4) is None
    figure = energies.histogram(load("breathing-circle"), 1e4, np.linspace(-1, 1, 50), "a cap")
    assert len(figure.axes) == 1
