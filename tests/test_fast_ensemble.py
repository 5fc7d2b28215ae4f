"""Ensembles: the same bits for any number of threads, uniform starts, capture intervals."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import fp
from scipy import stats

import fast
from fast.ensemble import initial_states
from scene import BadInput, State, load
from scene.geometry import table_at


def test_blocks_are_parts_of_the_whole():
    """Also in what they would go on from."""
    scene, asked = load("moving-cap"), {"energy": 300.0, "n_cycles": 2, "seed": 4}
    whole = fast.go_on(scene, n_particles=90, **asked)
    for first, n in ((0, 1), (1, 88), (37, 53)):
        part = fast.go_on(scene, n_particles=n, first=first, **asked)
        ones, others = ((*run.ensemble[1:-2], run.lanes) for run in (part, whole))
        for got, wanted in zip(ones, others, strict=True):
            assert np.array_equal(got, wanted[first : first + n], equal_nan=True)
    other = fast.go_on(scene, n_particles=90, **asked | {"seed": 5})
    assert not np.array_equal(other.ensemble.energy, whole.ensemble.energy)
    with pytest.raises(BadInput, match="first = -1, must be 0 to"):
        fast.simulate(scene, n_particles=1, energy=1e3, first=-1)


def test_each_cycle_has_its_means_and_their_errors():
    run = fast.simulate(load("moving-cap"), n_particles=400, energy=1e4, n_cycles=3, seed=2)
    there, s = run.takes_part(), run.s()
    assert np.allclose(s.sum(axis=1), np.log(run.energy / run.energy0), equal_nan=True, rtol=1e-12)
    assert run.m1() == pytest.approx(s[there].mean(axis=0))
    assert run.m1_se() == pytest.approx(s[there].std(axis=0, ddof=1) / there.sum() ** 0.5)
    share = run.p_nc()
    assert run.p_nc_se() == pytest.approx(np.sqrt(share * (1 - share) / there.sum()))
    cap = fast.simulate(load("breathing-circle"), n_particles=1, energy=1e4, seed=2)
    assert (cap.p_nc(), cap.p_nc_se()) == ([1.0], [0.0])
    assert np.isnan(cap.m1_se()).all()
    nobody = run._replace(outcome=run.outcome + 1)
    for each in (nobody.m1(), nobody.m1_se(), nobody.p_nc(), nobody.p_nc_se()):
        assert np.isnan(each).all()


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-anticlockwise", "breathing-circle", "fermi-ulam"])
def test_starts_are_uniform_in_the_table(name):
    scene = load(name)
    states = initial_states(scene, 40_000, 0.5, 7)
    x, y, vx, vy = states[:, 2:].T
    assert np.allclose(vx**2 + vy**2, 1.0)
    assert stats.kstest(np.arctan2(vy, vx), stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > 1e-4
    # Independent: uniform points of the bounding box, kept where the table is.
    now = table_at(fp, scene, states[0, 0])
    wide = max(now.r, now.half_width(-now.h), now.w)
    across, up = np.random.default_rng(3).uniform((-wide, -now.h), (wide, now.r), size=(200_000, 2)).T
    in_cap = (up >= 0) & (np.hypot(across, up) <= now.r)
    in_stem = (up < 0) & (np.abs(across) <= now.half_width(up))
    kept = in_cap | in_stem
    assert stats.ks_2samp(x, across[kept]).pvalue > 1e-4
    assert stats.ks_2samp(y, up[kept]).pvalue > 1e-4


def test_frozen_table_keeps_energy_and_island():
    """Frozen: energy constant, and the captured share is the island's share of the volume."""
    run = fast.simulate(load("frozen-mushroom"), n_particles=4000, energy=1e4, seed=2, phases=(0.5,))
    assert np.allclose(run.energy, 1e4, rtol=1e-12)
    delta = 2 / np.pi * (np.arccos(0.5) - 0.5 * np.sqrt(0.75))
    v_cap, v_stem = np.pi**2, 2 * np.pi * (2 * 0.5 - 0.1111)
    share = delta * v_cap / (v_cap + v_stem)
    captured = np.mean(run.phase_captured[:, 0, 0])
    assert captured == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 4000))


def test_progress_reaches_the_end():
    seen: list[int] = []
    fast.simulate(load("fermi-ulam"), n_particles=100, energy=10.0, progress=seen.append)
    assert seen[-1] == 100
    assert seen == sorted(seen)


def test_energies_at_phases_are_the_flow_s():
    """At a phase of the cycle an ensemble's particle has the energy that the same start has in a flow."""
    scene, phases = load("moving-cap"), (0.2, 0.5, 0.9)
    run = fast.simulate(scene, n_particles=40, energy=50.0, seed=3, phases=phases)
    starts = [State(t, *place) for t, _, *place in initial_states(scene, 40, 50.0, 3).tolist()]
    assert run.phase_energies.shape == (40, 1, 3)
    for k, phase in enumerate(phases):
        there = fast.flow(scene, starts, 2 * np.pi * phase)
        energies = [(o.vx**2 + o.vy**2) / 2 for o in there.outcomes]
        assert run.phase_energies[:, 0, k].tolist() == energies
    assert np.array_equal(run.wall_counts.sum(axis=1), run.n_collisions)
    # Between its capture and its release a particle is captured at each phase looked at.
    t_in, t_out = run.t_in[:, 0, 0], run.t_out[:, 0, 0]
    inside = (t_in < np.pi) & (np.pi < t_out)
    assert inside.any()
    assert run.phase_captured[inside, 0, 1].all()
    assert not run.phase_captured[~inside, 0, 1].any()


def test_an_interrupt_drops_the_chunks_not_begun():
    """What `progress` raises, as an interrupt would, ends the run."""
    seen: list[int] = []

    def stop(n_done: int) -> None:
        seen.append(n_done)
        if n_done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fast.simulate(load("fermi-ulam"), n_particles=200_000, energy=100.0, threads=1, progress=stop)
    assert seen == [0, 256]
