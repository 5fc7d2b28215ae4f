"""The strategies draw only what is valid, and reach the variety that they promise."""

import json
import math
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from support.depth import deep_but

import reference
from conformance.cases.scenes import Clock
from conformance.cases.table import FAMILIES
from conformance.plain import Flight, next_collision
from conformance.strategies import adversarial, laws, scenes_and_states, states
from scene import BangBang, Cap, Collision, Fourier, Mushroom, State, Stem, check_scene, from_data, load
from scene.laws import bounds, is_constant, size_bounds, values
from scene.states import check_numbers
from scene.tables import laws as laws_of


def assert_sound(scene, state, t_end):
    """The reference, which is exact, takes the scene and the state."""
    check_scene(scene)
    check_numbers(scene, state, t_end)
    assert isinstance(reference.next_collision(scene, state, state.t, digits=15), reference.Horizon)


@given(scenes_and_states())
def test_every_drawn_step_is_sound(drawn):
    assert_sound(*drawn)


@pytest.mark.parametrize(
    "name", ["moving-cap", "ergodic", "fixed-cap-anticlockwise", "fermi-ulam", "breathing-circle"]
)
@settings(max_examples=50)
@given(data=st.data())
def test_states_of_a_given_scene_are_sound(name, data):
    assert_sound(load(name), *data.draw(states(load(name))))


@given(st.floats(-4.0, 4.0), st.floats(0.0, 4.0), st.data())
def test_laws_stay_in_their_range(low, width, data):
    law = data.draw(laws(low, low + width))
    slack = 2.0**-45 * (abs(low) + width)
    told = bounds(law)
    if low > 0.0 and not told.lowest >= low - slack:  # waves that add up to more than the mean
        reached = values(law, 2 * math.pi / law.omega * np.arange(512) / 512)
        told = told._replace(lowest=reached.min(), highest=reached.max())
    assert told.lowest >= low - slack
    assert told.highest <= low + width + slack


def test_some_waves_add_up_to_more_than_the_mean(tally):
    @settings(max_examples=300)
    @given(laws(0.1, 2.0, Clock("fourier", 1.0)))
    def draw(law):
        tally["deep"] += bounds(law).lowest < 0.0 < size_bounds(law).lowest

    draw()
    assert tally["deep"] > 5


N_SESSIONS, N_EACH = 30, 30
N_DRAWN = N_SESSIONS * N_EACH


def features(scene, state, t_end):
    """Name what tables and laws there are, what a state is near to, how it flies, and when."""
    found, flight = laws_of(scene), Flight(scene, state, t_end)
    moving = [law for law in found.values() if not is_constant(law)]
    waves = [law for law in moving if isinstance(law, Fourier)]
    legs = [len(law.knots) - 1 for law in moving if isinstance(law, BangBang)]
    knots = [t for law in moving if isinstance(law, BangBang) for t, _ in law.knots]
    slope, cycle, is_mushroom = found.get("slope"), scene.period, isinstance(scene, Mushroom)
    lengths = [bounds(law) for name, law in found.items() if name in ("r", "w", "h")]
    longest = max(max(abs(b.lowest), abs(b.highest)) for b in lengths)
    size = max(flight.laws[name].value for name in ("r", "h") if name in flight.laws)
    around = [w for w in flight.walls_near(in_cap=flight.is_in_cap) if w != state.wall]
    n_close = sum(flight.f(w, 0.0)[0] < size * 2.0**-10 * (size if w == "arc" else 1) for w in around)
    speed, distance = math.hypot(state.vx, state.vy), math.hypot(state.x, state.y)
    fastest = max(b.slope for b in lengths) or longest
    grazing = 2.0**-10 * (2 * distance if state.wall == "arc" else 1.0) * speed
    is_free = is_mushroom and state.wall is None
    return {
        type(scene).__name__: True,
        f"laws: {type(moving[0]).__name__ if moving else 'static'}": True,
        "mouth: w": is_mushroom and scene.nu is None,
        "mouth: nu": is_mushroom and scene.nu is not None,
        "slope: negative": isinstance(slope, float) and slope < 0,
        "slope: zero": slope == 0,
        "slope: positive": isinstance(slope, float) and slope > 0,
        "slope: moving": slope in moving,
        **{f"harmonics: {max(k for k, _, _ in law.harmonics())}": True for law in waves},
        **{f"legs: {n if n < 5 else 'many'}": True for n in legs},
        "size: small": longest < 2.0**-10,
        "size: large": longest > 2.0**10,
        f"on: {type(scene).__name__} {state.wall}": True,
        "near: wall": n_close >= 1,
        "near: corner": n_close >= (2 if state.wall is None else 1),
        "near: mouth": is_free and abs(state.y) < size * 2.0**-10,
        "near: in the mouth": is_free and state.y == 0,
        "near: centre": distance < size * 2.0**-6,
        f"decade: {math.floor(math.log10(speed / fastest))}": True,
        "waits": t_end > state.t,
        "waits not": t_end == state.t,
        "time: zero": state.t == 0,
        "time: negative": state.t < 0,
        "time: on a knot": any(math.remainder(state.t - t, cycle) == 0 for t in knots),
        "time: late": bool(cycle) and abs(state.t) > 100 * cycle,
        "flies: along an axis": 0.0 in (state.vx, state.vy),
        "flies: grazing": state.wall is not None and flight.f(state.wall, 0.0)[1] < grazing,
    }


# How often what is named is to be drawn.
LEAST = {
    **dict.fromkeys(["Cap", "Stem", "Mushroom"], N_DRAWN // 10),
    **dict.fromkeys(["laws: static", "laws: Fourier", "laws: BangBang"], N_DRAWN // 20),
    **{f"on: {t.__name__} {wall}": 5 for t in (Cap, Stem, Mushroom) for wall in (None, *t.walls)},
    **dict.fromkeys(["mouth: w", "mouth: nu"], 25),
    **{f"slope: {how}": 10 for how in ("negative", "zero", "positive", "moving")},
    **{f"harmonics: {n}": 5 for n in (1, 2, 3)},
    **{f"legs: {n}": 5 for n in (2, 3, 4, "many")},
    **dict.fromkeys(["size: small", "size: large"], 1),
    **dict.fromkeys(["near: wall", "near: corner", "near: mouth", "near: in the mouth", "near: centre"], 5),
    **{f"decade: {n}": 5 for n in range(-3, 6)},
    **dict.fromkeys(["waits", "waits not", "flies: along an axis", "flies: grazing"], 10),
    **dict.fromkeys(["time: zero", "time: negative", "time: on a knot", "time: late"], 5),
}


def test_every_kind_of_scene_and_start_is_reached():
    """Within one session Hypothesis varies what it drew before; separate seeds are independent."""
    counts: Counter[str] = Counter()

    def collect(step):
        counts.update(name for name, is_so in features(*step).items() if is_so)

    for number in range(N_SESSIONS):
        session = settings(max_examples=N_EACH, database=None, derandomize=False)
        seed(number)(session(given(scenes_and_states())(collect)))()
    assert {name: counts[name] for name, least in LEAST.items() if counts[name] < least} == {}


def printed(failure, hold, n):
    """Return the wire's line that is printed when a property fails, and the failure."""
    trial = settings(max_examples=n, database=None, derandomize=True, deadline=None)(
        given(scenes_and_states())(hold)
    )
    with pytest.raises(failure) as caught:
        trial()
    return next(text for text in caught.value.__notes__ if '"cmd"' in text), caught.value


def test_a_failing_step_is_printed_as_the_wire_line():
    def fail(step):
        raise ZeroDivisionError(repr(step))

    text, failure = printed(ZeroDivisionError, fail, 10)
    request = json.loads(next(part for part in text.splitlines() if '"cmd"' in part))
    step = (from_data(request["scene"]), State(**request["state"]), request["t_end"])
    assert repr(step) == str(failure)


@pytest.mark.parametrize("name", deep_but(FAMILIES, "corner-arrival", "anywhere-stem-left", "nearly-shut"))
def test_every_family_is_reached(name):
    """By Hypothesis's bits as by a seed's."""

    @settings(max_examples=3, suppress_health_check=list(HealthCheck))
    @given(adversarial(name))
    def draw(asked):
        assert asked.group == name
        assert asked.t_end >= asked.state.t

    draw()


BLIND = {
    "to a floor that moves": lambda of, hit: hit.wall == "floor" and not is_constant(of.h),
    "to a mushroom's base": lambda of, hit: hit.wall == "base" and isinstance(of, Mushroom),
}


def failing_line(name):
    """Return the line that is printed for a stepper that never hits what `name` says."""

    def hold(drawn):
        hit = next_collision(*drawn)
        assert not (isinstance(hit, Collision) and BLIND[name](drawn[0], hit))

    return printed(AssertionError, hold, 1000)[0]


@pytest.mark.parametrize("name", deep_but(BLIND, "to a floor that moves"))
def test_a_faulty_stepper_is_reported_in_few_and_short_numbers(name):
    """At most twelve numbers that are not 0 or 1, all but three of at most six digits."""
    # In a process of its own: Hypothesis also draws constants of all modules that are loaded.
    code = f"import sys; sys.path += ['tests']; import {__name__} as t; print(t.failing_line({name!r}))"
    command = [sys.executable, "-c", code]
    line = subprocess.run(
        command, cwd=Path(__file__).parents[1], capture_output=True, check=True, text=True
    ).stdout
    numbers = [text for text in re.findall(r"-?[0-9][0-9.e+-]*", line) if float(text) not in (0.0, 1.0)]
    lengths = sorted(len(text.strip("-").replace(".", "")) for text in numbers)
    assert len(numbers) <= 12
    assert lengths[-4] <= 6
