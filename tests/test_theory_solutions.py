"""A solution that is kept is the one that would be found again, and belongs to nobody."""

from itertools import islice
from typing import Any

import pytest

from scene import Fourier, Mushroom, load
from theory import Cycle, moments, predict, prediction
from theory.adiabatic import Captures, captures, refined
from theory.prediction import resolutions

# A particle may be captured twice in a cycle: wells within a well.
TWICE = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25), sin=(0.0625,)))


@pytest.fixture(autouse=True)
def _nothing_kept() -> None:
    prediction._place.cache_clear()


def bits(found: Captures) -> Any:
    def of(numbers: Any) -> Any:
        return numbers.as_mantissa_exp() if hasattr(numbers, "is_nan") else tuple(map(of, numbers))

    with found.binary.working():
        panels = [placed.panel[2:] for placed in found.placed]
        return of(panels), of(found.point_masses()), of([found.growth(), found.p_not_captured])


def two(scene: Mushroom, digits: int) -> list[Any]:
    """Return the bits of the first two resolutions."""
    return [bits(found) for found in islice(resolutions(scene, Cycle.of(scene, digits)), 2)]


@pytest.mark.parametrize("scene", [load("moving-cap"), TWICE], ids=["moving-cap", "twice"])
def test_what_is_kept_is_what_would_be_found(scene: Mushroom) -> None:
    first = captures(Cycle.of(scene, 3), 7)
    right = [bits(first), bits(refined(first))]
    assert two(scene, 3) == right
    assert two(scene, 3) == right
    assert prediction._place.cache_info().hits == 1


def test_nothing_is_solved_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    first = predict(TWICE, 3), moments(TWICE, 2, 3)
    for name in ("captures", "refined"):
        monkeypatch.setattr(prediction, name, None)
    assert (predict(TWICE, 3), moments(TWICE, 2, 3)) == first


def test_another_scene_or_other_digits_are_another_solution() -> None:
    """Each changes some bit; a name alone does not, and names no other solution."""
    other = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25), sin=(0.125,)))
    found = [two(scene, digits) for scene, digits in [(TWICE, 3), (other, 3), (TWICE, 4)]]
    assert len({repr(solution) for solutions in found for solution in solutions}) == 6
    named = Mushroom(r=TWICE.r, h=TWICE.h, nu=TWICE.nu, name="named")
    assert two(named, 3) == found[0]
    assert prediction._place.cache_info().currsize == 3


def test_nobody_is_touched_by_what_another_does_with_its_numbers() -> None:
    right = predict(TWICE, 3).strings(3)
    spoilt = predict(TWICE, 3)
    spoilt.m1.context.dps = 1
    again = predict(TWICE, 3)
    assert again.strings(3) == right
    assert again.m1.context is not spoilt.m1.context


def test_the_whole_of_it_is_told_as_done() -> None:
    told: list[tuple[int, float]] = []
    for _ in range(2):
        told.clear()
        predict(TWICE, 3, progress=lambda *done: told.append(done))
        assert told == sorted(told)
        assert {number for number, _ in told} == {1, 2}
        assert told[-1] == (2, 1.0)
    assert told == [(1, 1.0), (2, 1.0)]


def test_many_digits_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prediction, "FEW_DIGITS", 2)
    predict(TWICE, 3)
    assert prediction._place.cache_info().currsize == 0
