"""The table of frozen rates can be measured anew, entry by entry, and a wrong one is found out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mpmath import fp

from conformance.audit import frozen
from conformance.audit.frozen import (
    MEASURED,
    SEED,
    measured,
    passages,
    swayed,
    swaying,
    turned,
)
from conformance.audit.runs import SCENES
from scene import BangBang, Mushroom, load
from scene.geometry import table_at
from theory.finite_energy.rates import MEMORIES, PHASES, SPEEDS, Rates, frozen_rates

N = 0.5  # of the table's particles
FEW = [8, 40]  # of PHASES: the mouth narrows at one and widens at the other
MOVING = load("fixed-cap-anticlockwise")
PULL = 6.0  # errors of sums are those of eight groups, so that such pulls are rare but not unheard of


def pulls(ours: Rates, table: Rates) -> np.ndarray:
    """Return differences over their standard errors; the table's were estimated with their numbers."""
    whole, found = (
        [rates._replace(diffusion=rates.diffusion.sum(axis=1, keepdims=True)) for rates in (ours, table)],
        [],
    )
    for value, error in ((0, 4), (1, 5), (2, 6), (3, 7)):
        mine, its = whole[0][error], whole[1][error][FEW]
        if not value:  # of the sum of all memories
            mine, its = (column.sum(axis=1, keepdims=True) for column in (mine, its))
        found.append((whole[0][value] - whole[1][value][FEW]) / np.hypot(mine, its))
    return np.concatenate([f.ravel() for f in found])


@pytest.fixture(scope="module")
def anew() -> Rates:
    return measured(MOVING, phases=PHASES[FEW], n=N, seed=SEED + 1)


def test_entries_measured_anew_agree_with_the_table(anew: Rates) -> None:
    table, _ = frozen_rates(MOVING)
    assert np.abs(pulls(anew, table)).max() < PULL


def test_the_tables_seed_gives_its_diffusion_again() -> None:
    table, _ = frozen_rates(MOVING)
    again = measured(MOVING, phases=PHASES[[20]])  # the mouth rests there
    rounding = 0.5 * 10 ** (1 - frozen.DIGITS)  # of the table's numbers, relative to one that begins with 1
    assert np.allclose(again.diffusion, table.diffusion[[20]], rtol=rounding)
    assert np.allclose(again.diffusion_error, table.diffusion_error[[20]], rtol=rounding)
    assert not again.lag.any()


@pytest.mark.parametrize(
    ("field", "factor"), [("diffusion", 1.5), ("lag", 1.3), ("lag", -1.0), ("square", 8.0)]
)
def test_a_wrong_table_is_found_out(anew: Rates, field: str, factor: float) -> None:
    table, _ = frozen_rates(MOVING)
    wrong = table._replace(**{field: getattr(table, field) * factor})
    assert np.abs(pulls(anew, wrong)).max() > PULL


def test_the_table_holds_what_the_command_measures() -> None:
    for name in MEASURED:
        assert not frozen_rates(SCENES.get(name) or load(name))[1]


def test_chords_wait_for_the_mouth_as_a_slow_walk_over_angles_does() -> None:
    """A wide mouth is met at once; a slow one lets them wait for a path ~ speed^(1/3)."""
    t, n = 0.07, 4000
    now = table_at(fp, MOVING, t)
    found = [passages(MOVING, now, t, float(speed), n, np.random.default_rng(2)) for speed in SPEEDS]
    paths = [one.path.mean() for one in found]
    x, vx, vy = np.array([[state.x, state.vx, state.vy] for one in found for state in one.states]).T
    assert (np.abs(x) < now.w).all()
    assert (vy < 0).all()
    assert np.allclose(vx**2 + vy**2, 1)
    # Their distance from the centre is the island's edge, or just inside it.
    nearest = np.abs(x * vy) / now.w
    assert ((nearest > 0.5) & (nearest <= 1)).all()
    exponent = np.polyfit(np.log(SPEEDS), np.log(paths), 1)[0]
    assert 0.2 < exponent < 0.45
    assert np.diff(paths).min() > 0


def test_a_mouth_that_comes_to_rest_wide_open_has_fewer_passages_and_they_end() -> None:
    """A phase's cell that reaches over the knot where nu = 1 begins to rest: its rim would turn for ever."""
    opening = BangBang(((0.0, 0.5), (0.4964, 1.0), (0.7, 1.0), (1.0, 0.5)))
    scene = Mushroom(r=1.0, h=1.0, w=opening, slope=0.1)
    t = float(PHASES[31])
    found = passages(scene, table_at(fp, scene, t), t, 2500.0, 40, np.random.default_rng(1))
    assert 0 < len(found.states) < 40
    assert np.isfinite(found.path).all()


def kicks_of(memories: tuple[float, ...], n: int, seed: int) -> np.ndarray:
    """Return sums of kicks over steps of STEP, of variance 1 per length for each memory; (n, steps)."""
    random, fine = np.random.default_rng(seed), frozen.STEP / 4
    n_steps = round(frozen.PATH / fine)
    total = np.zeros((n, n_steps))
    for m in memories:
        decay = math.exp(-fine / m)
        x = random.standard_normal(n)
        for k in range(n_steps):
            total[:, k] += x * fine * (2 * m) ** -0.5
            x = decay * x + math.sqrt(1 - decay**2) * random.standard_normal(n)
    return total.reshape(n, -1, 4).sum(axis=2)


@pytest.mark.parametrize("memories", [(12.0,), (36.0, 108.0), (20.0,)])
def test_kicks_are_found_with_their_memories(memories: tuple[float, ...]) -> None:
    """A sum over a finite path would miss what its ends remember; the correlations do not."""
    kicks = kicks_of(memories, 2000, 1)
    n_steps = kicks.shape[1]
    turn = 2 * math.pi * np.arange(n_steps + 1) / n_steps
    speed = np.diff(np.sin(turn)) / (turn[1] - turn[0])
    found = frozen._spectrum(kicks * speed, speed)
    assert found.sum() == pytest.approx(len(memories), rel=0.05)
    mean = found @ np.array(MEMORIES) / found.sum()
    assert mean == pytest.approx(np.mean(memories), rel=0.2)
    assert abs(frozen._spectrum(kicks * speed, np.ones_like(speed)).sum() / len(memories) - 1) > 0.3


def test_a_sway_is_in_proportion_to_the_walls_speeds() -> None:
    scene = load("moving-cap")
    assert isinstance(scene, Mushroom)
    now = table_at(fp, scene, 1.0)
    table, share = swaying(scene, 1.0, 1000.0)
    for t, wave in ((0.0, 1.0), (250.0, 0.0), (500.0, -1.0)):
        then = table_at(fp, table, t)
        for name in ("w_rate", "r_rate", "h_rate"):
            assert getattr(then, name) / share == pytest.approx(getattr(now, name) * wave, abs=1e-4)


def test_waits_count_as_far_as_a_sway_shows_them() -> None:
    path = 1000.0
    wait = np.array([0.0, 1.0, 30.0, path, 5 * path])
    assert swayed(wait, path) == pytest.approx([0, 1, 30, 0, 0], rel=0.02, abs=1e-9)
    share = (np.arange(2000) + 0.5) / 2000
    weight = (1 - share) * np.cos(2 * math.pi * share) + np.sin(2 * math.pi * share) / 2 / math.pi
    for w in (100.0, 400.0, 700.0):
        whole = weight[share * path < w].sum() * path / 2000
        assert float(swayed(np.array([w]), path)[0]) == pytest.approx(whole, rel=2e-3)


def test_chords_that_turn_many_at_once_turn_as_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    now, sigma, found = table_at(fp, load("moving-cap"), 1.0), np.linspace(0.5, 0.83, 200), []
    for at_once in (1, 10_000):
        monkeypatch.setattr(frozen, "AT_ONCE", at_once)
        found.append(turned(now, sigma, np.full(200, 0.84), 1e-4, np.random.default_rng(3), 5000.0))
    assert np.allclose(found[0].path, found[1].path, rtol=1e-9)
    assert np.allclose(found[0].arcs, found[1].arcs, rtol=1e-9)
