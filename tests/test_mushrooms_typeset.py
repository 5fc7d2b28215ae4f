"""Formulas in plain text become HTML; all else is escaped and left alone."""

import pytest

from mushrooms.reports.page import as_json
from mushrooms.reports.typeset import typeset


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("p_nc", "<i>p</i><sub>nc</sub>"),
        ("E0^(-1/4)", "<i>E</i><sub>0</sub><sup>−1/4</sup>"),
        ("dV_ell / V_cha", "<i>dV</i><sub>ell</sub> / <i>V</i><sub>cha</sub>"),
        ("log E1/E0", "log <i>E</i><sub>1</sub>/<i>E</i><sub>0</sub>"),
        ("sigma_w <= 10^-25", "<i>σ</i><sub>w</sub> ≤ 10<sup>−25</sup>"),
        ("x^2 + y^2", "x<sup>2</sup> + y<sup>2</sup>"),
        ("nu(t)", "<i>ν</i>(t)"),
    ],
)
def test_formulas(text, html):
    assert typeset(text) == html


@pytest.mark.parametrize(
    "text",
    [
        "M1 and X2, see L7",
        "theory/equations.md",
        "sec. 4.1",
        "minus 3 sd at n = 30",
        "numbers",
        "moving-cap@1e7",
    ],
)
def test_prose_is_left_alone(text):
    assert typeset(text) == text


def test_what_could_be_markup_is_escaped():
    assert typeset("<script>a_b</script>") == "&lt;script&gt;<i>a</i><sub>b</sub>&lt;/script&gt;"


def test_scenes_are_written_as_a_reader_sees_them():
    assert as_json({"notes": "the captions' nu, größer"}) == '{"notes": "the captions\' nu, größer"}'
