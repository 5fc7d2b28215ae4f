"""Measures what it costs to store a run: python -m tests.support.store_overhead [PARTICLES].

The stored run and the one in memory follow the same particles, in turns, three times each.
"""

import json
import subprocess
import sys
import tempfile
import time

COMMAND = [sys.executable, "-m", "mushrooms", "simulate", "moving-cap", "--energy", "1e4", "--json"]


def timed(*options: str) -> tuple[float, str]:
    """Return the seconds that a run takes, and its SHA-256."""
    begin = time.perf_counter()
    done = subprocess.run([*COMMAND, *options], capture_output=True, text=True, check=True)
    return time.perf_counter() - begin, json.loads(done.stdout)["sha256"]


if __name__ == "__main__":
    options = ["--particles", sys.argv[1] if len(sys.argv) > 1 else "200000"]
    timed(*options)  # compiled
    bare, stored = [], []
    for _ in range(3):
        bare.append(timed(*options))
        with tempfile.TemporaryDirectory() as folder:
            stored.append(timed(*options, "--out", folder))
    assert len({sha256 for _, sha256 in bare + stored}) == 1
    fastest, slower = min(bare)[0], min(stored)[0]
    print(f"in memory {fastest:.2f} s, stored {slower:.2f} s: {slower / fastest - 1:+.1%}")
