"""Formulas that the audit holds against themselves in many loops: what is said of the loops drawn."""

from types import SimpleNamespace

import mpmath
import pytest

import scene as scenes
import theory
from mushrooms.audit.claims import misprints


@pytest.mark.parametrize(
    ("growths", "holds", "least"),
    [
        ([0.3, 0.02, 0.5, 0.25], True, "0.02"), ([0.25, 0.5, 0.3, 0.0625], True, "0.0625"),
        ([0.3, -0.125, 0.5, 0.25], False, "-0.125"), ([0.0, 0.125, 0.5, 0.25], False, "0"),
    ],
)  # fmt: skip
def test_growth_is_held_to_be_positive_in_each_loop_that_is_drawn(monkeypatch, growths, holds, least):
    """Every second loop has a mouth of two wells; captures may then stand within one another."""
    drawn, looked = [], []

    def predict(table, digits):
        drawn.append(table)
        assert digits == 12
        return SimpleNamespace(m1=mpmath.mpf(growths[len(drawn) - 1]))

    def cycle(table, digits):
        looked.append(table)
        return SimpleNamespace(well=SimpleNamespace(children=[1] if len(looked) in (2, 3, 4) else []))

    monkeypatch.setattr(misprints, "N_DRAWN_LOOPS", 4)
    monkeypatch.setattr(
        misprints, "theory", SimpleNamespace(predict=predict, Cycle=SimpleNamespace(of=cycle))
    )
    [check] = misprints.positivity(SimpleNamespace(seed=5))
    assert check.what == "m1 > 0 in 4 random loops, 3 of them with several captures"
    assert (check.holds, check.note, check.expected) == (holds, f"least m1 = {least}", "> 0")
    assert drawn == looked
    waves = [(one.r.sin, one.h.cos, one.h.sin) for one in drawn]
    assert len(set(waves)) == 4
    assert all(abs(part) <= 0.3 for wave in waves for (part,) in wave)
    assert {part > 0 for wave in waves for (part,) in wave} == {True, False}
    assert [len(one.nu.cos) for one in drawn] == [1, 2, 1, 2]
    again = len(drawn)
    drawn.clear()
    looked.clear()
    list(misprints.positivity(SimpleNamespace(seed=5)))
    assert [(one.r.sin, one.h.cos, one.h.sin) for one in drawn] == waves
    assert len(drawn) == again


def test_a_drawn_loop_of_two_wells_captures_within_a_capture(monkeypatch):
    """So that the claim speaks of several captures in a cycle."""
    drawn = []
    monkeypatch.setattr(misprints, "N_DRAWN_LOOPS", 2)
    real = theory.Cycle.of
    stand_in = SimpleNamespace(
        predict=lambda *_: SimpleNamespace(m1=1.0),
        Cycle=SimpleNamespace(of=lambda table, digits: drawn.append(table) or real(table, digits)),
    )
    monkeypatch.setattr(misprints, "theory", stand_in)
    [check] = misprints.positivity(SimpleNamespace(seed=5))
    n_nested = [bool(real(table, 15).well.children) for table in drawn]
    assert n_nested == [False, True]
    assert "1 of them with several captures" in check.what
    assert all(isinstance(table, scenes.Mushroom) for table in drawn)
