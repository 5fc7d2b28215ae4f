"""A solution that is kept is the one that would be found again, and belongs to nobody."""

from __future__ import annotations

from typing import Any

import pytest

from scene import Fourier, Mushroom, load
from theory import Cycle, moments, predict, prediction
from theory.adiabatic import Captures, captures
from theory.prediction import solved

# A particle may be captured twice in a cycle: wells within a well.
TWICE = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25), sin=(0.0625,)))


@pytest.fixture(autouse=True)
def _nothing_kept() -> None:
    prediction._place.cache_clear()


def bits(found: Captures) -> Any:
    def of(numbers: Any) -> Any:
        return numbers.as_mantissa_exp() if hasattr(numbers, "is_nan") else tuple(map(of, numbers))

    with found.binary.working():
        return of(found.root), of(found.point_masses), of([found.growth(), found.p_not_captured])


@pytest.mark.parametrize("scene", [load("moving-cap"), TWICE], ids=["moving-cap", "twice"])
def test_what_is_kept_is_what_would_be_found(scene: Mushroom) -> None:
    right = bits(captures(Cycle.of(scene, 3), 7))
    assert bits(solved(scene, Cycle.of(scene, 3), 7)) == right
    assert bits(solved(scene, Cycle.of(scene, 3), 7)) == right
    assert prediction._place.cache_info().hits == 1


def test_nothing_is_solved_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []

    def counted(*args: Any) -> Captures:
        found.append(args)
        return captures(*args)

    monkeypatch.setattr(prediction, "captures", counted)
    first = predict(TWICE, 3), moments(TWICE, 2, 3)
    n = len(found)
    assert n >= 2
    assert (predict(TWICE, 3), moments(TWICE, 2, 3)) == first
    assert len(found) == n


def test_another_scene_other_digits_or_another_target_is_another_solution() -> None:
    """Each changes some bit; a name alone does not, and names no other solution."""
    other = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25), sin=(0.125,)))
    asked = [(TWICE, 3, 7), (other, 3, 7), (TWICE, 4, 7), (TWICE, 3, 12)]
    found = [bits(solved(scene, Cycle.of(scene, digits), target)) for scene, digits, target in asked]
    assert len(set(map(repr, found))) == len(asked)
    named = Mushroom(r=TWICE.r, h=TWICE.h, nu=TWICE.nu, name="named")
    assert bits(solved(named, Cycle.of(named, 3), 7)) == found[0]
    assert prediction._place.cache_info().currsize == len(asked)


def test_nobody_is_touched_by_what_another_does_with_its_numbers() -> None:
    right = predict(TWICE, 3).strings(3)
    spoilt = predict(TWICE, 3)
    spoilt.m1.context.dps = 1
    again = predict(TWICE, 3)
    assert again.strings(3) == right
    assert again.m1.context is not spoilt.m1.context


def test_the_whole_of_it_is_told_as_done() -> None:
    told: list[float] = []
    for _ in range(2):
        told.clear()
        solved(TWICE, Cycle.of(TWICE, 3), 7, told.append)
        assert told[-1] == 1.0
    assert told == [1.0]


def test_many_digits_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prediction, "FEW_DIGITS", 2)
    solved(TWICE, Cycle.of(TWICE, 3), 7)
    assert prediction._place.cache_info().currsize == 0
