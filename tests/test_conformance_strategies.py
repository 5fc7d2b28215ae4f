"""The strategies draw only what is valid, and reach the variety that they promise.

The checks here are written afresh, in plain arithmetic at 60 digits.
"""

import json
import math
import re
from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from mpmath import MPContext
from support.depth import deep_but

from conformance.cases.scenes import Clock
from conformance.cases.table import FAMILIES
from conformance.plain import next_collision
from conformance.strategies import adversarial, clocks, laws, scenes_and_states, states
from scene import BangBang, Cap, Collision, Fourier, Mushroom, State, Stem, check_scene, from_data, load
from scene.laws import bounds, is_constant, value, values
from scene.sizes import size_bounds
from scene.states import ON_WALL, check_numbers
from scene.tables import laws as laws_of
from scene.tables import period

CTX = MPContext()  # making one takes longer than what is computed in it
CTX.dps = 60


class Table:
    """Positions and rates of all walls at one instant, by the definitions of sec. 2."""

    def __init__(self, scene, t):
        at = {name: value(CTX, law, t) for name, law in laws_of(scene).items()}
        rate = {name: value(CTX, law, t, 1) for name, law in laws_of(scene).items()}
        if "nu" in at:
            at["w"] = at["nu"] * at["r"]
            rate["w"] = rate["nu"] * at["r"] + at["nu"] * rate["r"]
        self.at, self.rate, self.is_stem = at, rate, isinstance(scene, Stem)

    def walls(self, state):
        """Each wall's (f, f') at the particle: f > 0 inside, f' along its flight."""
        x, y, vx, vy = map(CTX.mpf, (state.x, state.y, state.vx, state.vy))
        at, rate = self.at, self.rate
        found = {"base": (-y, -vy) if self.is_stem else (y, vy)}
        if "r" in at:
            r, r_rate = at["r"], rate["r"]
            found["arc"] = (r * r - x * x - y * y, 2 * r * r_rate - 2 * (x * vx + y * vy))
        if "h" in at:
            edge = at["w"] + at["slope"] * y
            edge_rate = rate["w"] + rate["slope"] * y + at["slope"] * vy
            found["right"] = (edge - x, edge_rate - vx)
            found["left"] = (edge + x, edge_rate + vx)
            found["floor"] = (y + at["h"], vy + rate["h"])
        return found


def walls_around(scene, table, state):
    """Name the walls that bound the part of the table in which the particle is."""
    if not isinstance(scene, Mushroom):
        return scene.walls
    if state.y > 0 or state.wall == "arc":
        return ("arc", "base")
    if state.y == 0 and state.wall == "base":  # or where it was, in the open mouth
        return ("arc", "base")
    if state.y == 0:
        assert abs(CTX.mpf(state.x)) < table.at["w"]
        return ("arc",)
    return ("left", "right", "floor")


def assert_sound(scene, state, t_end):
    check_scene(scene)
    check_numbers(scene, state, t_end)
    table = Table(scene, state.t)
    walls = table.walls(state)
    around = walls_around(scene, table, state)
    for wall in around:
        if wall != state.wall:
            assert walls[wall][0] > 0
    if state.wall is not None:
        assert state.wall in around
        f, f_rate = walls[state.wall]
        assert f_rate > 0
        size = table.at["r"] ** 2 if state.wall == "arc" else sum(map(abs, table.at.values()))
        assert abs(f) <= ON_WALL * size


@given(scenes_and_states())
def test_every_drawn_step_is_sound(drawn):
    assert_sound(*drawn)


@pytest.mark.parametrize(
    "name", ["moving-cap", "ergodic", "fixed-cap-anticlockwise", "fermi-ulam", "breathing-circle"]
)
def test_states_of_a_given_scene_are_sound(name):
    scene = load(name)

    @settings(max_examples=50)
    @given(states(scene))
    def draw(drawn):
        assert_sound(scene, *drawn)

    draw()


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


@given(clocks())
def test_clocks_have_periods_of_order_one(clock):
    assert 0.5 <= clock.rate <= 8.0


N_SESSIONS, N_EACH = 30, 30
N_DRAWN = N_SESSIONS * N_EACH


@pytest.fixture(scope="module")
def drawn():
    # Within one session Hypothesis varies what it drew before; separate seeds are independent.
    found = []
    for number in range(N_SESSIONS):

        @seed(number)
        @settings(max_examples=N_EACH, database=None, derandomize=False)
        @given(scenes_and_states())
        def collect(step):
            found.append(step)

        collect()
    return found


def kind(scene):
    moving = [law for law in laws_of(scene).values() if not is_constant(law)]
    return type(moving[0]).__name__ if moving else "static"


def assert_reached(counted, wanted, least):
    assert {key: counted[key] for key in wanted if counted[key] < least} == {}


def test_every_table_wall_and_kind_of_law_is_reached(drawn):
    tables = Counter(type(scene) for scene, _, _ in drawn)
    assert_reached(tables, [Cap, Stem, Mushroom], N_DRAWN // 10)
    assert_reached(
        Counter(kind(scene) for scene, _, _ in drawn), ["static", "Fourier", "BangBang"], N_DRAWN // 20
    )
    starts = Counter((type(scene), state.wall) for scene, state, _ in drawn)
    wanted = [(table, wall) for table in (Cap, Stem, Mushroom) for wall in (None, *table.walls)]
    assert_reached(starts, wanted, 5)


def test_both_forms_of_the_mouth_and_every_slope_are_reached(drawn):
    mushrooms = [scene for scene, _, _ in drawn if isinstance(scene, Mushroom)]
    forms = Counter("w" if scene.nu is None else "nu" for scene in mushrooms)
    assert_reached(forms, ["w", "nu"], 25)
    slopes = [scene.slope for scene, _, _ in drawn if not isinstance(scene, Cap)]
    signs = Counter(math.copysign(1, slope) if slope else 0 for slope in slopes if isinstance(slope, float))
    assert_reached(signs, [-1, 0, 1], 10)
    assert sum(not is_constant(slope) for slope in slopes) >= 10


def test_harmonics_and_legs_of_every_number_are_reached(drawn):
    every = [law for scene, _, _ in drawn for law in laws_of(scene).values() if not is_constant(law)]
    harmonics = Counter(max(k for k, _, _ in law.harmonics()) for law in every if isinstance(law, Fourier))
    assert_reached(harmonics, [1, 2, 3], 5)
    legs = Counter(len(law.knots) - 1 for law in every if isinstance(law, BangBang))
    assert_reached(legs, [2, 3, 4], 5)
    assert sum(n > 4 for n in legs.elements()) >= 5


def test_speeds_sizes_and_horizons_span_their_range(drawn):
    speeds, sizes, waits = [], [], Counter()
    for scene, state, t_end in drawn:
        longest = max(max(abs(b.lowest), abs(b.highest)) for b in map(bounds, lengths(scene)))
        walls = max(b.slope for b in map(bounds, lengths(scene)))
        sizes.append(longest)
        speeds.append(math.hypot(state.vx, state.vy) / (walls or longest))
        waits["none" if t_end == state.t else "some"] += 1
    assert min(speeds) < 1e-2
    assert max(speeds) > 1e5
    decades = Counter(math.floor(math.log10(speed)) for speed in speeds)
    assert_reached(decades, range(-3, 6), 5)
    assert min(sizes) < 2.0**-10
    assert max(sizes) > 2.0**10
    assert_reached(waits, ["none", "some"], 10)


def lengths(scene):
    return [law for name, law in laws_of(scene).items() if name in ("r", "w", "h")]


def test_places_reach_walls_corners_mouth_and_centre(drawn):
    near = Counter()
    for scene, state, _ in drawn:
        table = Table(scene, state.t)
        walls = table.walls(state)
        around = [w for w in walls_around(scene, table, state) if w != state.wall]
        size = max(table.at.get("r", 0), table.at.get("h", 0))
        close = [w for w in around if walls[w][0] < size * 2.0**-10 * (size if w == "arc" else 1)]
        near["wall"] += len(close) >= 1
        near["corner"] += len(close) >= (2 if state.wall is None else 1)
        if isinstance(scene, Mushroom):
            near["mouth"] += state.wall is None and abs(state.y) < size * 2.0**-10
            near["in the mouth"] += state.y == 0 and state.wall is None
        near["centre"] += math.hypot(state.x, state.y) < size * 2.0**-6
    assert_reached(near, ["wall", "corner", "mouth", "in the mouth", "centre"], 5)


def test_times_reach_zero_knots_and_negative_times(drawn):
    when = Counter()
    for scene, state, _ in drawn:
        shared = period(scene)
        when["zero"] += state.t == 0
        when["negative"] += state.t < 0
        legs = [law for law in laws_of(scene).values() if isinstance(law, BangBang)]
        after = [state.t - t for law in legs for t, _ in law.knots]
        when["knot"] += any(math.remainder(s, float(shared.value(CTX))) == 0 for s in after if shared)
        if shared is not None:
            when["late"] += abs(state.t) > 100 * shared.value(CTX)
    assert_reached(when, ["zero", "negative", "knot", "late"], 5)


def test_directions_reach_axes_and_grazing(drawn):
    ways = Counter()
    for scene, state, _ in drawn:
        ways["axis"] += 0.0 in (state.vx, state.vy)
        if state.wall is not None:
            f_rate = Table(scene, state.t).walls(state)[state.wall][1]
            scale = 2 * math.hypot(state.x, state.y) if state.wall == "arc" else 1.0
            ways["grazing"] += f_rate < 2.0**-10 * scale * math.hypot(state.vx, state.vy)
    assert_reached(ways, ["axis", "grazing"], 10)


def test_a_failing_step_is_printed_as_the_wire_line():
    @settings(max_examples=10, database=None, phases=[Phase.generate])
    @given(scenes_and_states())
    def fail(step):
        raise ZeroDivisionError(repr(step))

    with pytest.raises(ZeroDivisionError) as caught:
        fail()
    line = next(text for text in caught.value.__notes__ if '"cmd"' in text)
    request = json.loads(next(part for part in line.splitlines() if '"cmd"' in part))
    step = (from_data(request["scene"]), State(**request["state"]), request["t_end"])
    assert repr(step) == str(caught.value)


@pytest.mark.parametrize("name", deep_but(FAMILIES, "near-corner", "anywhere-stem-left", "nearly-shut"))
def test_every_family_is_reached(name):
    """By Hypothesis's bits as by a seed's."""

    @settings(max_examples=3, suppress_health_check=list(HealthCheck))
    @given(adversarial(name))
    def draw(asked):
        assert asked.group == name
        assert asked.t_end >= asked.state.t

    draw()


def blind_to_depth(scene, hit):
    """The floor is met where its mean is, whatever it does."""
    return hit.wall == "floor" and not is_constant(scene.h)


def blind_to_a_narrow_mouth(scene, hit):
    """No base is met in a mushroom."""
    return hit.wall == "base" and isinstance(scene, Mushroom)


@pytest.mark.parametrize("is_wrong", [blind_to_depth, blind_to_a_narrow_mouth])
def test_a_faulty_stepper_is_reported_in_few_and_short_numbers(is_wrong):
    """At most ten numbers that are not 0, of at most six digits all but one."""

    @settings(max_examples=1000, database=None, derandomize=True)
    @given(scenes_and_states())
    def hold(drawn):
        hit = next_collision(*drawn)
        assert not (isinstance(hit, Collision) and is_wrong(drawn[0], hit))

    with pytest.raises(AssertionError) as caught:
        hold()
    line = next(text for text in caught.value.__notes__ if '"cmd"' in text)
    numbers = [text for text in re.findall(r"-?[0-9][0-9.e+-]*", line) if float(text) not in (0.0, 1.0)]
    lengths = sorted(len(text.strip("-").replace(".", "")) for text in numbers)
    assert len(numbers) <= 12
    assert lengths[-4] <= 6
