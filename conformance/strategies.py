"""Hypothesis strategies: valid scenes of every kind, valid states in them, and whole questions.

They use the same generators as the corpus, `mushrooms check` and `mushrooms attack` (`conformance.cases`),
with random bits from Hypothesis. Shrinking leads to questions with few and short numbers. If a test fails,
the failing step is printed as a line of the protocol.
"""

from __future__ import annotations

import json
from functools import cache

import msgspec
from hypothesis import assume, currently_in_test_context, note, strategies as st

from conformance import plain
from conformance.cases import scenes as scene_draws
from conformance.cases.draw import Draw, Question, Unfit
from conformance.cases.scenes import Clock, any_law, any_scene, start, when
from conformance.cases.table import FAMILIES
from conformance.vectors import question
from scene import BadInput, GivenLaw, Horizon, Scene, State, from_data
from scene.transforms import scaled

KINDS = ("constant", "fourier", "bang-bang", "mixed")
POWERS = (0, *range(-20, 21))
WAITS = (1.0, 1.0, 1.0, 2.0**-3, 2.0**-20, 0.0)  # parts of the time that a state may fly
FINE = 20  # bits of a part


class HypothesisDraw(Draw):
    """A stream of numbers whose bits Hypothesis draws, and shrinks."""

    def __init__(self, draw: st.DrawFn) -> None:
        self._draw = draw

    def bits(self, n: int) -> int:
        """Draw an integer of n bits."""
        return self._draw(_integers(n))

    def part(self) -> float:
        """Draw uniformly from (0, 1): 1/2, 1/4, 3/4, 1/8, ..., so that small integers give short numbers."""
        n = self.bits(FINE) + 1
        return int(f"{n:b}"[::-1], 2) / 2.0 ** n.bit_length()


@cache  # Hypothesis examines every strategy that is made during a draw
def _integers(n: int) -> st.SearchStrategy[int]:
    return st.integers(0, 2**n - 1)


@st.composite
def laws(draw: st.DrawFn, low: float = 0.5, high: float = 2.0, clock: Clock | None = None) -> GivenLaw:
    """Draw a law that stays within [low, high] at all times.

    Args:
        draw: given by Hypothesis.
        low: lower bound, any unit.
        high: upper bound, low <= high.
        clock: kind and period; None draws them: static, Fourier, bang-bang or mixed, of order 1 to 10.
    """
    stream = HypothesisDraw(draw)
    return any_law(stream, low, high, clock or scene_draws.clock(stream, KINDS))


@st.composite
def scenes(draw: st.DrawFn, table: str | None = None) -> Scene:
    """Draw a valid scene.

    Args:
        draw: given by Hypothesis.
        table: "cap", "stem" or "mushroom"; None draws one.

    Returns:
        A table whose laws have one period. The mouth is `w` or `nu`. The slope is positive, zero, negative or
        moving.
        Sizes [length] and periods [time] are of order 1. One scene in three is scaled by powers of two from
        2^-20 to 2^20.
    """
    stream = HypothesisDraw(draw)
    try:
        scene = any_scene(stream, table, KINDS)
    except (BadInput, Unfit):
        assume(False)
    if stream.pick(range(3)) == 2:
        grown = scaled(scene, stream.pick(POWERS), stream.pick(POWERS))
        scene = msgspec.structs.replace(grown, name=scene.name, notes=scene.notes)
    return scene


@st.composite
def states(draw: st.DrawFn, scene: Scene) -> tuple[State, float]:
    """Draw a state inside the table, or leaving one of its walls, and a horizon.

    Args:
        draw: given by Hypothesis.
        scene: a valid scene.

    Returns:
        (state, t_end): see `conformance.cases.scenes.start`. t_end is mostly late enough for a collision;
        sometimes early, or t itself.
    """
    stream = HypothesisDraw(draw)
    state, t_end = start(stream, scene, when(stream, scene))
    assume(isinstance(plain.next_collision(scene, state, state.t), Horizon))  # inside, beyond rounding
    assume(plain.Flight(scene, state, state.t).refusal() is None)  # and not along its wall
    t_end = state.t + (t_end - state.t) * stream.pick(WAITS)
    _tell(scene, state, t_end)
    return state, t_end


def _tell(scene: Scene, state: State, t_end: float) -> None:
    """Print a failing example as a line of the protocol."""
    if currently_in_test_context():
        note(json.dumps({"cmd": "step", "seq": 1, **question("step", scene, state, t_end)}))


@st.composite
def scenes_and_states(draw: st.DrawFn, table: str | None = None) -> tuple[Scene, State, float]:
    """Draw (scene, state, t_end): see `scenes` and `states`."""
    scene = draw(scenes(table))
    state, t_end = draw(states(scene))
    return scene, state, t_end


@st.composite
def adversarial(draw: st.DrawFn, family: str | None = None) -> Question:
    """Draw a question of a family by its name (`conformance.cases.table.FAMILIES`), or of any.

    The result has `scene`, `state`, `t_end`, and `collisions` for a path.
    """
    asked = FAMILIES[family or draw(st.sampled_from(list(FAMILIES)))].attempt(HypothesisDraw(draw))
    assume(asked is not None)
    assert asked is not None
    _tell(from_data(asked.wire_scene()), asked.state, asked.t_end)
    return asked
