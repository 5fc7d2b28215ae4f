"""The table of an orbit: each column against a second computation from the path."""

import math

import fast
from mushrooms.orbits import FollowedOrbit
from scene import Cap, Fourier, State, Stem, load


def test_columns_at_the_arc_are_those_of_the_hits():
    """Place is the angle over the half circle, from the right end, sin phi as the bounce has it."""
    scene, start = load("moving-cap"), State(0.0, 0.1, 0.3, 5.0, 3.0)
    path = fast.trajectory(scene, start, 60)
    found = FollowedOrbit(scene, start, path.walls, path.steps, path.outcome).columns()
    assert found["wall"] == [None, *path.walls]
    assert found["sin_phi"][0] is found["nu"][0] is found["captured"][0] is None
    n_hits = 0
    for k, (wall, row) in enumerate(zip(path.walls, path.steps.tolist(), strict=True), 1):
        cells = [found[name][k] for name in ("place", "sin_phi", "nu", "captured")]
        if wall != "arc":
            assert cells == [None] * 4
            continue
        n_hits += 1
        _, t, x, y, _, _ = row
        _, _, _, _, vx, vy = path.steps[k - 2].tolist() if k > 1 else (0, 0, 0, 0, 5.0, 3.0)
        radius, nu = scene.r(t), scene.nu(t)
        sine = (y * vx - x * vy) / (math.hypot(vx, vy) * radius)
        assert math.isclose(cells[1], sine, rel_tol=1e-9, abs_tol=1e-12)
        assert math.isclose(cells[2], nu, rel_tol=1e-12)
        assert cells[3] == (abs(sine) > nu)
        assert found["energy"][k] == (row[4] ** 2 + row[5] ** 2) / 2
    assert n_hits > 10


def test_a_table_without_a_mouth_has_columns_too():
    for scene in (Stem(w=1.0, h=1.0), Cap(r=Fourier(1.0, 1.0, (0.1,)))):
        start = State(0.0, 0.0, -0.5 if isinstance(scene, Stem) else 0.5, 1.0, 0.3)
        path = fast.trajectory(scene, start, 5)
        found = FollowedOrbit(scene, start, path.walls, path.steps, path.outcome).columns()
        assert set(map(len, found.values())) == {len(path.walls) + 1}
