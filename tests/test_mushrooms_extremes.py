"""Valid scenes and numbers at the ends of what floats hold: an answer, or one line and exit code 2."""

from __future__ import annotations

import math

import pytest
from support.refusals import assert_refused, one_line

import theory
from mushrooms.forecast import expected_collisions
from scene import BangBang, Mushroom, load

SCENES = {
    "short": 'r = 1.0\nh = 1.0\nnu = {kind = "fourier", mean = 0.5, period = 1e-308, cos = [0.1]}',
    "huge": "r = 1.7e308\nh = 1e300\nnu = 0.5",
    "slow": 'h = 1e300\nnu = 0.5\nr = {kind = "fourier", mean = 1e308, period = 1e308, cos = [1e307]}',
    "brief": 'r = 1.0\nnu = 0.5\nh = {kind = "bang-bang", knots = [[0, 1], [5e-324, 2], [1, 1]]}',
}


@pytest.fixture
def file_of(tmp_path):
    """Return what writes a scene's file."""

    def write(text, name="scene"):
        path = tmp_path / "scene.toml"
        path.write_text(f'table = "mushroom"\nname = "{name}"\n{text}\n', "utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("short", "period = 1e-308, must be"),
        ("huge", "scene.r = 1.7e+308, must be"),
        ("slow", "scene.r = 1.1e+308"),
    ],
)
@pytest.mark.parametrize("kind", [(), ("--trajectory",)])
def test_what_no_figure_holds_is_not_drawn(command_line, file_of, tmp_path, name, words, kind):
    asked = ["draw", file_of(SCENES[name]), *kind, "--out", tmp_path / "picture.svg"]
    assert_refused(command_line(*asked), words, "1e-100 to 1e+100 in a picture")
    assert not list(tmp_path.glob("*.svg"))


def test_nor_is_it_beside_an_export(command_line, file_of, tmp_path):
    asked = [
        "draw",
        file_of(SCENES["huge"]),
        "--export",
        tmp_path / "path.csv",
        "--out",
        tmp_path / "picture.svg",
    ]
    assert_refused(command_line(*asked), "in a picture")
    assert not list(tmp_path.glob("p*"))


def test_a_leg_shorter_than_any_float_tells_is_drawn(command_line, file_of, tmp_path):
    assert command_line("draw", file_of(SCENES["brief"]), "--out", tmp_path / "picture.svg").code == 0


@pytest.mark.parametrize("kind", [(), ("--trajectory",), ("--section",), ("--growth",)])
def test_a_name_begins_no_formula(command_line, file_of, tmp_path, kind):
    scene = file_of("r = 1.0\nh = 1.0\nnu = 0.5", r"$\\frac{$ a_b^")
    assert command_line("draw", scene, *kind, "--out", tmp_path / "picture.svg").code == 0


@pytest.mark.parametrize("number", ["1e1000000", "1e999999999", "-1e1000000"])
def test_a_whole_number_beyond_all_bounds_is_refused(command_line, number):
    assert_refused(
        command_line("theory", "moving-cap", "--digits", number), "--digits", "is not a whole number"
    )


def test_a_run_at_the_last_floats_goes_without_a_forecast(command_line, file_of):
    scene = file_of(SCENES["slow"])
    assert math.isnan(expected_collisions(load(scene), 100.0, 1))
    assert command_line("simulate", scene, "--particles", 2, "--energy", 100.0).code == 0


@pytest.mark.parametrize("before", [(), ((-1.0, 0.2),)])
def test_a_leg_that_theory_cannot_tell_from_an_instant_is_refused(before):
    at_start = 0.3 if before else 0.2
    mouth = BangBang((*before, (0.0, at_start), (1e-60, 0.5), (1.0, 0.2)))
    assert "so short a time" in one_line(theory.predict, Mushroom(r=1.0, h=1.0, nu=mouth))
