"""Which cases every run of the tests asks, and which only `pytest -m deep` does.

A case is marked `deep` where it asks of another input what a neighbour asks already, or where one question
takes longest of all. `.ci/run` asks both kinds, one after the other; `pytest` alone asks the first.
"""

from collections.abc import Iterable
from typing import Any

import pytest


def deep_but(cases: Iterable[Any], *kept: Any) -> list[Any]:
    """Return the cases of one argument for `parametrize`, all but the kept ones marked deep."""
    cases = list(cases)
    return deep_among(cases, *(case for case in cases if case not in kept), *_absent(cases, kept))


def deep_among(cases: Iterable[Any], *those: Any) -> list[Any]:
    """Return the cases of one argument for `parametrize`, those ones marked deep.

    Raises:
        ValueError: one of them is no case.
    """
    cases = list(cases)
    if absent := _absent(cases, those):
        raise ValueError(f"no cases: {absent}")
    return [pytest.param(case, marks=pytest.mark.deep) if case in those else case for case in cases]


def _absent(cases: list[Any], named: Iterable[Any]) -> list[Any]:
    return [case for case in named if case not in cases]
