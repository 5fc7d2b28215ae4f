"""Results gathered from blocks: means in any order, seals of files, and progress."""

from __future__ import annotations

import time
import weakref
from fractions import Fraction

import numpy as np
import pytest

from conformance.files import sealed, unsealed
from mushrooms.store import conduct, watch
from mushrooms.store.layout import shape_of
from mushrooms.store.run import Block, StoredRun
from mushrooms.store.spec import RunSpec
from mushrooms.store.tally import RunTally, gain_of
from scene import load


def test_a_mean_has_the_same_bits_in_blocks_of_any_size_and_order():
    random = np.random.default_rng(2)
    gains = random.normal(0.1, 0.4, 5000) * 10.0 ** random.integers(-5, 2, 5000)
    found, plain = set(), set()
    for _ in range(5):
        parts = np.split(random.permutation(gains)[:, None], np.sort(random.integers(0, 5001, 7)))
        found.add(gain_of(lambda parts=parts: parts))
        plain.add(float(np.cumsum(np.concatenate(parts))[-1]))
    assert len(plain) > 1  # a faulty mean, of plain sums, would be found out
    [gain] = found
    assert gain.mean == float(sum(map(Fraction, gains.tolist())) / 5000)
    assert gain.standard_error == pytest.approx(gains.std(ddof=1) / 5000**0.5, rel=1e-12)


@pytest.mark.parametrize(
    ("gains", "wanted"),
    [([], (0, None, None)), ([0.5], (1, 0.5, None)), ([1.0, -np.inf], (2, None, None))],
)
def test_a_mean_that_nobody_knows_is_none(gains, wanted):
    assert gain_of(lambda: [np.array(gains).reshape(-1, 1)]) == wanted


def test_a_seal_tells_every_flipped_bit(tmp_path):
    path = tmp_path / "a"
    content = sealed(b"numbers")
    path.write_bytes(content)
    assert unsealed(path) == b"numbers"
    for i in range(8 * len(content)):
        path.write_bytes(content[: i // 8] + bytes([content[i // 8] ^ 1 << i % 8]) + content[i // 8 + 1 :])
        assert unsealed(path) is None


def test_a_block_is_reported_at_once_and_two_are_in_memory(tmp_path, monkeypatch):
    """Not when it has been written: progress would fall back by a block."""
    begun, told, kept = [], [], []
    spec = RunSpec(load("fermi-ulam"), 1e3, 1, 0)
    arrays = {"wall_counts": np.zeros((3, 5)), "outcome": np.zeros(3), "n_careful": np.zeros(3)}

    def engine(_spec, pieces, _tick):
        for number, piece in enumerate(pieces):
            begun.append(weakref.ref(takes_part := np.ones(3)))
            assert told == list(range(3, 3 * number + 1, 3))
            assert sum(ref() is not None for ref in begun) <= 2
            yield piece, Block({**arrays, "takes_part": takes_part}, 0.0)
            del takes_part

    def keep(_run, piece, _block):
        time.sleep(0.01)
        kept.append(piece.number)

    monkeypatch.setattr(StoredRun, "keep", keep)
    run = StoredRun(tmp_path, spec, shape_of(spec, 18, 3), "")
    conduct.complete(run, engine, told.append)
    assert kept == list(range(6))
    assert told == [3, 6, 9, 12, 15, 18]


def test_progress_tells_rate_and_losses(capsys, monkeypatch):
    now = iter(range(0, 10**6, 50))
    monkeypatch.setattr(watch, "CLOCK", lambda: float(next(now)))
    with watch.Watch("run", 2000, RunTally(particles=500, followed=500)) as seen:
        seen.update(500)
        seen.add(RunTally(particles=500, followed=498, undecided=1, collisions=10**6))
        seen.update(1000)
    lines = capsys.readouterr().err.splitlines()
    assert "run: 1,000 of 2,000 particles," in lines[-1]
    assert all(word in lines[-1] for word in (" left, ", " particles/s, ", "2 lost", "1 undecided"))
