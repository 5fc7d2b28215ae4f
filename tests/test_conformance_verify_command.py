"""`python verify.py` as a plain file: corpus lines, answers in floating point, unreadable input."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from conformance import verify

CAP: dict[str, Any] = {"table": "cap", "r": 1.0}
DOWN = {"t": 0, "x": 0, "y": 0.5, "vx": 0, "vy": -1.0}
UP = {"t": 0.5, "x": 0, "y": 0, "vx": 0, "vy": 1.0, "wall": "base"}
ASIDE = {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 0.75, "vy": 1.0}
ARC = {
    "t": 0.4431513611335565, "x": 0.3323635208501674, "y": 0.9431513611335565,
    "vx": -0.042636479149832596, "vy": -1.2492726406376256, "wall": "arc",
}  # fmt: skip
LATE = {**DOWN, "t": 0.25, "y": 0.25}
FALLING = {**DOWN, "t": -0.5}
TINY = {"table": "cap", "r": 2.0**-130}
ANSWERS: list[tuple[dict[str, Any], int, str]] = [
    ({"scene": CAP, "state": DOWN, "steps": [UP]}, 0, "base, within 0 backward ulps"),
    ({"scene": CAP, "state": ASIDE, "steps": [ARC]}, 0, "arc, within 0."),
    ({"scene": CAP, "state": DOWN, "t_end": 0.25, "steps": [LATE]}, 0, "the horizon, within 0"),
    ({"scene": CAP, "state": ASIDE, "steps": [{**ARC, "t": 0.4431515}]}, 1, "step 1: false: arc, within"),
    (
        {"scene": CAP, "state": ASIDE, "steps": [{**ARC, "wall": "base"}]},
        1,
        "step 1: false: arc is met first",
    ),
    (
        {"scene": CAP, "state": ASIDE, "steps": [ARC, {**ARC, "t": 2.4}]},
        1,
        "step 2: false: base is met first",
    ),
    (
        {
            "scene": TINY,
            "state": {**DOWN, "y": 2.0**-131, "vy": -(2.0**-130)},
            "steps": [{**UP, "x": 2.0**-131, "vy": 2.0**-130}],
        },
        1,
        "step 1: false",
    ),
    ({"scene": CAP, "state": FALLING, "steps": [{**UP, "t": 0.0, "x": 1e-16}]}, 0, "base, within"),
    ({"scene": CAP, "state": LATE, "t_end": 0.25, "steps": [LATE]}, 0, "the horizon, within 0"),
    ({"scene": CAP, "state": DOWN, "steps": [{**UP, "t": float("inf")}]}, 1, "t is no finite number"),
    ({"scene": CAP, "state": DOWN, "steps": [5]}, 2, "a step must be given, as a dict"),
    ({"scene": {"table": "cap", "r": -1.0}, "state": DOWN, "steps": []}, 2, "r breaks its bound"),
    ({"scene": CAP, "state": DOWN}, 2, "steps must be given, as a list"),
]
LINE = {
    "id": "a/1", "kind": "step", "scene": CAP, "state": DOWN, "t_end": 9.0,
    "expect": [{"outcome": "collision", "steps": [{
        "wall": "base", "dt": ["0.5", "0.5"], "x": ["0", "0"], "y": ["0", "0"], "vx": ["0", "0"],
        "vy": ["1", "1"],
    }]}],
}  # fmt: skip
# It is on the left side at an irrational phase, as far as any precision shows, and far below the floor.
SWELLING = {"kind": "fourier", "mean": 1.0, "period": 2.0, "sin": [0.25]}
REFUSED = {
    **LINE, "scene": {"table": "stem", "w": SWELLING, "h": 1.0}, "expect": [{"outcome": "rejected"}],
    "state": {**DOWN, "t": 0.5, "x": -1.25, "y": -2.0},
}  # fmt: skip
FILES: list[tuple[str, int, str]] = [
    (json.dumps(LINE), 0, "1 of 1 proved"),
    (json.dumps({**LINE, "t_end": 0.25}), 1, "a/1: false: the answer is horizon"),
    (json.dumps({**LINE, "kind": "flow"}), 1, "a/1: false: the path has 1 steps, or goes on"),
    ("[" * 100_000, 2, "unreadable after 0 claims"),
    (json.dumps(LINE) + "\n{}", 2, "unreadable after 1 claims"),
    ("{", 2, "unreadable after 0 claims"),
    (json.dumps({**LINE, "rule": "a\u2028b"}, ensure_ascii=False), 0, "1 of 1 proved"),
    (json.dumps(LINE)[:-1] + ', "id": "a/2"}', 2, "a key comes twice"),
    (json.dumps({**LINE, "scene": {"table": 0}}).replace("0}", f"{'9' * 5000}}}"), 2, "unreadable after 0"),
    (json.dumps({**LINE, "collisions": 999_999, "expect": [{"outcome": "collision"}]}), 2, "kind or"),
    (json.dumps(REFUSED), 0, "1 of 1 proved"),
    (json.dumps({**LINE, "kind": "jump"}), 2, "kind or collisions are none"),
    (json.dumps({**LINE, "expect": [{"outcome": "collision", "steps": [5]}]}), 2, "dt must be given"),
]


def call(*arguments: str) -> tuple[int, str]:
    """Run the file as its users do, and return the exit code and all it prints."""
    command = [sys.executable, "-I", verify.__file__, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout + done.stderr


ROWS = [
    *[(["--answers"], json.dumps(data), code, word) for data, code, word in ANSWERS],
    *[([], text, code, word) for text, code, word in FILES],
]


@pytest.mark.parametrize(("options", "text", "code", "word"), ROWS, ids=range(len(ROWS)))
def test_a_file_is_judged(options: list[str], text: str, code: int, word: str, tmp_path: Any) -> None:
    path = tmp_path / "lines.jsonl"
    path.write_text(text, "utf-8")
    found, printed = call(*options, str(path))
    assert found == code
    assert word in printed


def test_no_file_is_no_proof() -> None:
    assert call()[0] == call("nowhere.jsonl")[0] == 2
