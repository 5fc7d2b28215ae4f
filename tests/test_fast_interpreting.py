"""The first steps of a process are run by Python: the same bits as compiled code, and nothing is compiled."""

import json
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from numba import config
from support import fuzz

from conformance import vectors
from fast.__main__ import answers_to
from fast.kernel import arithmetic, interpreting, path, single

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="without the compiler Python runs every step")
ROOT = Path(__file__).parent.parent

VECTORS = [*vectors.load("core")[::30], *vectors.load("extended")[::30], *vectors.load("stress")[::6]]
CORPUS = [json.dumps(vectors.request(vector, seq)).encode() for seq, vector in enumerate(VECTORS)]
NASTY = list(fuzz.lines(3, 200, fuzz.requests))


def answered(lines: list[bytes], monkeypatch: pytest.MonkeyPatch, n_by_python: int) -> list[Any]:
    """Answer questions, so many steps of each kind run by Python, although compiled code is at hand."""
    with monkeypatch.context() as patch:
        patch.setattr(interpreting, "is_at_hand", lambda _: False)
        for allowance in (single.allowance, *path.ALLOWANCES.values()):
            patch.setattr(allowance, "left", n_by_python)
        return [answers_to([line]) for line in lines]


@pytest.mark.parametrize("lines", [CORPUS, NASTY], ids=["corpus", "nasty"])
def test_python_gives_the_bits_of_compiled_code(lines, monkeypatch):
    assert answered(lines, monkeypatch, 10**6) == answered(lines, monkeypatch, 0)


def test_a_product_that_is_rounded_twice_is_seen(monkeypatch):
    """Python has no fused operation of its own before 3.13."""
    right = answered(CORPUS, monkeypatch, 10**6)
    names = interpreting._NAMES
    for each in names.values():
        if "fma" in each:
            monkeypatch.setitem(each, "fma", lambda a, b, c: a * b + c)
    assert answered(CORPUS, monkeypatch, 10**6) != right


FIRST = """
import fast
from fast.kernel import interpreting
from fast.kernel.numba_internals import is_loaded
from scene import State, load
interpreting.MOST_STEPS
scene, state = load("moving-cap"), State(0.0, 0.1, 0.5, 1.0, 3.0)
print(fast.next_collision(scene, state, 9.0).wall, *fast.trajectory(scene, state, 20).walls[:3])
from numba.core import event
"""
