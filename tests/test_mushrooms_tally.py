"""What blocks come to: exact sums in any order, seals of files, and how progress is told."""

from __future__ import annotations

import time
import weakref
from fractions import Fraction

import numpy as np
import pytest

from conformance.files import sealed, unsealed
from mushrooms.store import blocks, conduct, tally, watch
from mushrooms.store.asked import Asked
from scene import load


def test_sums_are_exact_and_merge_in_any_order():
    random = np.random.default_rng(2)
    values = np.concatenate(
        [random.normal(size=3000) * 10.0 ** random.integers(-300, 30, 3000), [0.0, -0.0, 5e-324, -3e-310]]
    )
    wanted = sum((Fraction(x) for x in values.tolist()), Fraction(0))
    assert Fraction(tally.exact_sum(values), 2**1074) == wanted
    gains = random.normal(0.1, 0.4, 5000) * 10.0 ** random.integers(-5, 2, 5000)
    moments = tally.moments_of(gains)
    assert moments.mean == pytest.approx(gains.mean(), rel=1e-12)
    assert moments.variance == pytest.approx(gains.var(ddof=1), rel=1e-12)
    floats = set()
    for _ in range(5):
        parts = np.split(random.permutation(gains), np.sort(random.integers(0, 5001, 7)))
        merged, plain = tally.Moments(), 0.0
        for part in parts:
            merged = merged.merged(tally.moments_of(part))
            plain = float(np.cumsum([plain, *part])[-1])
        floats.add(plain)
        assert merged == moments
    assert len(floats) > 1  # a faulty tally, of plain floats, would be found out
    assert tally.moments_of(np.array([1.0, -np.inf])).mean is None


def test_a_seal_tells_every_flipped_bit(tmp_path):
    path = tmp_path / "a"
    content = sealed(b"numbers")
    path.write_bytes(content)
    assert unsealed(path) == b"numbers"
    for i in range(8 * len(content)):
        path.write_bytes(content[: i // 8] + bytes([content[i // 8] ^ 1 << i % 8]) + content[i // 8 + 1 :])
        assert unsealed(path) is None


def test_a_block_is_told_at_once_and_two_are_in_memory():
    """Not when it has been written: progress would fall back by a block."""
    begun, told, kept = [], [], []

    def followed():
        for number in range(6):
            begun.append(weakref.ref(energies := np.zeros(3)))
            assert told == list(range(number))
            assert sum(ref() is not None for ref in begun) <= 2
            yield blocks.Piece(number, 0, 3), blocks.Block({"energy": energies}, tally.RunTally(), 0.0)
            del energies

    class Slow(blocks.RunInMemory):
        def keep(self, piece, block):
            time.sleep(0.01)
            kept.append(piece.number)

    run = Slow(conduct.shape_of(Asked(load("fermi-ulam"), 1e3, 1, 0), 18, 3))
    conduct.keep_all(run, followed(), lambda piece, _block: told.append(piece.number))
    assert told == kept == list(range(6))


def test_progress_tells_rate_and_losses(capsys, monkeypatch):
    now = iter(range(0, 10**6, 50))
    monkeypatch.setattr(conduct, "CLOCK", lambda: float(next(now)))
    counts = tally.RunTally(particles=500, followed=498, undecided=1, collisions=10**6)
    with watch.Watch("run", 2000, tally.RunTally(particles=500)) as seen:
        seen.followed(blocks.Block({}, counts, 1.0))
        seen.tick(3)
    lines = capsys.readouterr().err.splitlines()
    assert lines
    assert "run: 1,000 of 2,000 particles," in lines[-1]
    assert all(
        word in lines[-1] for word in (" particles/s, ", "left", "collisions/s", "502 lost", "1 undecided")
    )
