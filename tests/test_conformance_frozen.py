"""The table of frozen rates can be measured anew, entry by entry, and a wrong one is found out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mpmath import fp

from conformance.audit.frozen import MEASURED, SEED, lag, measured, passages
from conformance.audit.runs import SCENES
from scene import BangBang, Mushroom, load
from scene.geometry import table_at
from theory.finite_energy.rates import PHASES, SPEEDS, Rates, frozen_rates

N = 0.3  # of the table's particles
FEW = [8, 40]  # of PHASES: the mouth narrows at one and widens at the other
PULL = 5.0  # 24 comparisons of this size are passed but once in 100,000


def pulls(ours: Rates, table: Rates) -> np.ndarray:
    """Return differences over their standard errors; the table's were estimated with their numbers."""
    found = []
    for value, error in ((0, 3), (1, 4), (2, 5)):
        found.append((ours[value] - table[value][FEW]) / np.hypot(ours[error], table[error][FEW]))
    return np.concatenate([f.ravel() for f in found])


@pytest.fixture(scope="module")
def anew() -> Rates:
    scene = load("fixed-cap-anticlockwise")
    assert isinstance(scene, Mushroom)
    return measured(scene, phases=PHASES[FEW], n=N, seed=SEED + 1)


def test_entries_measured_anew_agree_with_the_table(anew: Rates) -> None:
    table, _ = frozen_rates(load("fixed-cap-anticlockwise"))
    assert np.abs(pulls(anew, table)).max() < PULL


def test_the_tables_seed_gives_its_diffusion_again() -> None:
    scene = load("fixed-cap-anticlockwise")
    assert isinstance(scene, Mushroom)
    table, _ = frozen_rates(scene)
    again = measured(scene, phases=PHASES[[20]])  # the mouth rests there
    assert np.allclose(again.diffusion, table.diffusion[[20]], rtol=2e-5)
    assert np.allclose(again.diffusion_error, table.diffusion_error[[20]], rtol=2e-5)
    assert not again.lag.any()


@pytest.mark.parametrize(
    ("field", "factor"), [("diffusion", 1.5), ("lag", 1.3), ("lag", -1.0), ("square", 8.0)]
)
def test_a_wrong_table_is_found_out(anew: Rates, field: str, factor: float) -> None:
    table, _ = frozen_rates(load("fixed-cap-anticlockwise"))
    wrong = table._replace(**{field: getattr(table, field) * factor})
    assert np.abs(pulls(anew, wrong)).max() > PULL


def test_the_table_holds_what_the_command_measures() -> None:
    for name in MEASURED:
        assert not frozen_rates(SCENES.get(name) or load(name))[1]


def test_chords_wait_for_the_mouth_as_a_slow_walk_over_angles_does() -> None:
    """A wide mouth is met at once; a slow one lets them wait for a path ~ speed^(1/3)."""
    scene, t, n = load("fixed-cap-anticlockwise"), 0.07, 4000
    assert isinstance(scene, Mushroom)
    now = table_at(fp, scene, t)
    paths = []
    for speed in SPEEDS:
        found = passages(scene, now, t, float(speed), n, np.random.default_rng(2))
        paths.append(found.path.mean())
        x = np.array([state.x for state in found.states])
        direction = np.array([[state.vx, state.vy] for state in found.states])
        assert (np.abs(x) < now.w).all()
        assert (direction[:, 1] < 0).all()
        assert np.allclose((direction**2).sum(axis=1), 1)
        # Their distance from the centre is the island's edge, or just inside it.
        nearest = np.abs(x * direction[:, 1]) / now.w
        assert ((nearest > 0.5) & (nearest <= 1)).all()
    exponent = np.polyfit(np.log(SPEEDS), np.log(paths), 1)[0]
    assert 0.2 < exponent < 0.45
    assert np.diff(paths).min() > 0


def test_a_faster_particle_lags_less_in_time() -> None:
    scene = load("fixed-cap-anticlockwise")
    assert isinstance(scene, Mushroom)
    lags = [
        lag(scene, 0.13, speed, 0.0, 1500, np.random.default_rng(4))[0].value / speed
        for speed in (500.0, 5e4)
    ]
    assert lags[0] < lags[1] < 0  # the stem's sides close in: the captured have missed kicks
    assert math.isfinite(sum(lags))


def test_a_mouth_that_comes_to_rest_wide_open_has_fewer_passages_and_they_end() -> None:
    """A phase's cell that reaches over the knot where nu = 1 begins to rest: its rim would turn for ever."""
    opening = BangBang(((0.0, 0.5), (0.4964, 1.0), (0.7, 1.0), (1.0, 0.5)))
    scene = Mushroom(r=1.0, h=1.0, w=opening, slope=0.1)
    t = float(PHASES[31])
    found = passages(scene, table_at(fp, scene, t), t, 2500.0, 40, np.random.default_rng(1))
    assert 0 < len(found.states) < 40
    assert np.isfinite(found.path).all()
