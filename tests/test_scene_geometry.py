"""The geometry of a table at one instant, against shoelace areas, finite differences and its own walls."""

import math

import numpy as np
import pytest
from mpmath import MPContext, fp

from scene import Cap, Fourier, Mushroom, Stem, load
from scene.geometry import area, half_width, rounded, table_at
from scene.laws import value

WAVE = Fourier(0.2, 1.5, (0.05,), (0.02,))
SCENES = [
    Cap(r=Fourier(1.0, 1.5, (0.25,))),
    Stem(w=Fourier(1.0, 1.5, (0.125,)), h=Fourier(2.0, 1.5, (), (0.5,)), slope=WAVE),
    Mushroom(r=Fourier(1.0, 1.5, (), (0.25,)), nu=Fourier(0.6, 1.5, (0.1,)), h=2.0, slope=WAVE),
    load("moving-cap"),
    load("fixed-cap-anticlockwise"),
]
TIMES = (0.0, 0.3, 2.7)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("t", TIMES)
def test_the_area_is_that_of_the_outline(scene, t):
    """By the shoelace formula over an arc of 20,000 chords, and of the trapezoid."""
    total = 0.0
    for line in table_at(fp, scene, t).outline(20_000):
        x, y = np.transpose(line)
        total += abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
    assert area(scene, t) == pytest.approx(total, rel=1e-8)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("t", TIMES)
def test_rates_and_normals_are_derivatives_of_the_gap(scene, t):
    """Central differences in 50 digits, at a point of every wall."""
    ctx = MPContext()
    ctx.dps = 50
    now, e = table_at(ctx, scene, t), ctx.mpf(10) ** -15
    before, after = (table_at(ctx, scene, ctx.mpf(t) + s * e) for s in (-1, 1))
    r = float(now.r)
    for wall in scene.walls:
        place = {"arc": (r * 0.6, r * 0.8)}.get(wall) or now.stem_point(wall, 0.3, 0.4)
        x, y = map(ctx.mpf, place)
        assert abs(now.gap(wall, x, y)) < 1e-15 * float(now.size)
        slopes = [
            (now.gap(wall, x + e, y) - now.gap(wall, x - e, y)) / (2 * e),
            (now.gap(wall, x, y + e) - now.gap(wall, x, y - e)) / (2 * e),
            (after.gap(wall, x, y) - before.gap(wall, x, y)) / (2 * e),
        ]
        f_x, f_y, f_t = map(float, slopes)
        size = math.hypot(f_x, f_y)
        assert now.rounded().normal(wall, float(x), float(y)) == pytest.approx((f_x / size, f_y / size))
        assert now.receding(wall, float(y)) == pytest.approx(f_t / size)
        assert float(now.gap_rate(wall, x, y, 3, -2)) == pytest.approx(3 * f_x - 2 * f_y + f_t)


@pytest.mark.parametrize("scene", SCENES)
def test_corners_lie_on_two_walls_or_on_the_mouth_s_edge(scene):
    now = rounded(scene, 0.3)
    for region, walls in (("cap", ("arc", "base")), ("stem", ("left", "right", "floor", "base"))):
        present = [wall for wall in walls if wall in scene.walls]
        if len(present) > 1:
            for x, y in now.corners(region):
                near = sum(abs(now.gap(wall, x, y)) <= 1e-15 * now.size for wall in present)
                assert near >= 1 + (abs(x) != now.w or isinstance(scene, Stem))


@pytest.mark.parametrize("scene", SCENES[1:3])
def test_points_of_the_stem_are_uniform_in_its_area(scene):
    """The share of the area above each point is its first number, by the trapezoid's formula."""
    now = rounded(scene, 0.3)
    a, b = np.random.default_rng(1).random((2, 100))
    x, depth = now.uniform_in_stem(a, b)
    assert depth * (2 * now.w - now.slope * depth) == pytest.approx(a * now.stem_area())
    assert x / now.half_width(-depth) == pytest.approx(2 * b - 1)


def test_a_relative_mouth_moves_by_the_product_rule():
    scene, t = SCENES[2], 0.7
    (r, r_rate), (nu, nu_rate) = ([value(fp, law, t, k) for k in (0, 1)] for law in (scene.r, scene.nu))
    assert half_width(fp, scene, t) == r * nu
    assert half_width(fp, scene, t, 1) == pytest.approx(nu_rate * r + nu * r_rate)
