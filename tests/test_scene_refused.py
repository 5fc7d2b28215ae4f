"""Nobody can hold an invalid scene, and every entry of `scene` refuses bad input in one line."""

import copy
import json
import math
import pickle

import msgspec
import numpy as np
import pytest
from hypothesis import given
from support.refusals import NO_NUMBERS, NOT_FINITE, one_line
from support.tables import CIRCLE

from conformance.strategies import scenes
from scene import (
    BadInput,
    BangBang,
    Cap,
    Fourier,
    InvalidScene,
    Mushroom,
    Scene,
    State,
    Stem,
    catalogue,
    check_count,
    check_number,
    check_scene,
    from_data,
    load,
    tables,
    to_data,
)
from scene.states import check_numbers
from scene.tables import PARAMETERS

VALID = sorted(set(catalogue()) - {"moving-cap-as-printed"})
NO_VALUES = [None, *NO_NUMBERS, *NOT_FINITE]
NO_LENGTHS = [*NO_VALUES, 0.0, -0.0, -1.0, -1]
NO_SCENES = [None, 1.0, "moving-cap", Cap, *(bad for bad in NO_NUMBERS if not isinstance(bad, Cap))]
NO_COUNTS = [*NO_VALUES, 2.5, np.timedelta64(2, "ns"), 10]
NO_FILES = [None, 3, 1.5, b"moving-cap", ["moving-cap"], CIRCLE, "", "a\nb", "nul\0.toml"]
NO_TEXTS = [None, 3, b"x", ["x"], "a\x00", "\x1b[2J", "\x9b", "\ud800", "\uffff"]
START = State(0.0, 0.1, 0.2, 1.0, 0.0)


def started(**changes):
    """Check a step of which the start is changed."""
    check_numbers(CIRCLE, msgspec.structs.replace(START, **changes), 9.0)


# What is refused, how the line begins, and a call with it.
REFUSED = [
    (NO_LENGTHS, "r ", lambda bad: Cap(r=bad)),
    (NO_LENGTHS, "w ", lambda bad: Stem(w=bad, h=1.0)),
    (NO_LENGTHS, "h ", lambda bad: Stem(w=1.0, h=bad)),
    (NO_LENGTHS, "nu ", lambda bad: Mushroom(r=1.0, h=1.0, nu=2.0 if bad is None else bad)),
    (NO_VALUES, "slope ", lambda bad: Stem(w=1.0, h=1.0, slope=bad)),
    (NO_TEXTS, "name ", lambda bad: Cap(r=1.0, name=bad)),
    (NO_TEXTS, "notes ", lambda bad: Cap(r=1.0, notes=bad)),
    (NO_SCENES, "scene = ", check_scene),
    (NO_SCENES, "scene = ", to_data),
    (NO_FILES, "scene ", load),
    (NO_COUNTS, "n = ", lambda bad: check_count("n", bad, 1, 9)),
    (NO_SCENES, "scene = ", lambda bad: check_numbers(bad, START, 9.0)),
    ([None, *NO_FILES], "state = ", lambda bad: check_numbers(CIRCLE, bad, 9.0)),
    (NO_VALUES, "t_end = ", lambda bad: check_numbers(CIRCLE, START, bad)),
    (NO_VALUES, "state.t = ", lambda bad: started(t=bad)),
    (NO_VALUES, "state.x = ", lambda bad: started(x=bad)),
    (NO_VALUES, "state.y = ", lambda bad: started(y=bad)),
    (NO_VALUES, "state.vx = ", lambda bad: started(vx=bad)),
    (NO_VALUES, "state.vy = ", lambda bad: started(vy=bad)),
    ([3, *NO_NUMBERS], "state.wall = ", lambda bad: started(wall=bad)),
]


@pytest.mark.parametrize(("bads", "begin", "call"), REFUSED)
def test_bad_input_is_refused_by_name(bads, begin, call):
    for bad in bads:
        line = one_line(call, bad)
        assert line.startswith(begin), bad
        assert ("scene.load(" in line) == (begin == "scene = " and isinstance(bad, str)), bad
        assert ("1 to 9" in line) == (begin == "n = "), bad


WAYS = {
    "constructor": lambda field, bad: Cap(**{"r": 1.0, field: bad}),
    "structs.replace": lambda field, bad: msgspec.structs.replace(CIRCLE, **{field: bad}),
    "copy.replace": lambda field, bad: CIRCLE.__replace__(**{field: bad}),
    "pickle": lambda field, bad: pickle.loads(pickle.dumps(_forced(field, bad))),
    "deepcopy": lambda field, bad: copy.deepcopy(_forced(field, bad)),
    "reduce": lambda field, bad: (lambda make, given: make(*given))(*_forced(field, bad).__reduce__()[:2]),
}


def _forced(field, bad):
    # What no one does by accident: it goes around every check of msgspec.
    scene = Cap(r=1.0)
    msgspec.structs.force_setattr(scene, field, bad)
    return scene


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("bad", [-1.0, math.nan, "1", None, True])
def test_there_is_no_other_way_to_an_invalid_scene(way, bad):
    assert one_line(WAYS[way], "r", bad).startswith("r ")


@pytest.mark.parametrize("bad", [-1.0, 0, "1", None, True, [1.0]])
def test_decoding_validates_too(bad):
    data = {"table": "cap", "r": bad}
    for decode in (
        lambda: msgspec.convert(data, Scene),
        lambda: msgspec.json.decode(json.dumps(data), type=Scene),
        lambda: msgspec.msgpack.decode(msgspec.msgpack.encode(data), type=Scene),
    ):
        with pytest.raises(msgspec.ValidationError):  # msgspec's own, with our line as its text
            decode()
    assert one_line(from_data, data).startswith("scene: r ")


@pytest.mark.parametrize("table", [Cap, Stem, Mushroom, Fourier, BangBang])
def test_nothing_is_made_or_changed_past_the_constructor(table):
    with pytest.raises(TypeError):
        table.__new__(table)
    with pytest.raises(TypeError):
        object.__new__(table)
    with pytest.raises(AttributeError):
        CIRCLE.r = -1.0
    with pytest.raises(TypeError):
        object.__setattr__(CIRCLE, "r", -1.0)
    assert not hasattr(CIRCLE, "__dict__")


def test_a_subclass_that_leaves_the_proof_out_is_no_scene():
    class Unproved(Cap, frozen=True, tag="unproved", kw_only=True):
        def __post_init__(self):
            pass

    assert "must be a Cap, a Stem or a Mushroom" in one_line(check_scene, Unproved(r=-1.0))


def test_lists_given_cannot_change_a_law_afterwards():
    knots, cos = [[0.0, 1.0], [1.0, 2.0], [2.0, 1.0]], [0.5]
    legs, wave = BangBang(knots), Fourier(1.0, 1.0, cos)
    knots[1][1], cos[0] = -1.0, 9.0
    assert legs == BangBang(((0.0, 1.0), (1.0, 2.0), (2.0, 1.0)))
    assert wave.cos == (0.5,)
    assert hash(legs) == hash(BangBang(((0.0, 1.0), (1.0, 2.0), (2.0, 1.0))))


@given(scenes())
def test_a_scene_survives_every_way_of_copying(scene):
    ways = (copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s)), msgspec.structs.replace)
    for way in ways:
        assert way(scene) == scene
    check_scene(scene)


@pytest.mark.parametrize("name", VALID)
def test_an_equal_scene_is_proved_once(name):
    """A second construction looks the proof up."""
    scene = load(name)
    given = {field: getattr(scene, field) for field in scene.__struct_fields__}
    n_proofs = tables._prove.cache_info().misses
    assert type(scene)(**given) == scene
    assert tables._prove.cache_info().misses == n_proofs


def test_a_zero_keeps_its_sign():
    for slope in (0.0, -0.0):
        assert math.copysign(1.0, Stem(w=1.0, h=1.0, slope=slope).slope) == math.copysign(1.0, slope)


def test_check_count():
    assert check_count("n", np.int64(9), 1, 9) == 9
    assert type(check_count("n", np.int64(9), 1, 9)) is int
    assert one_line(check_count, "n", 10**5000, 1, 9) == "n = an integer of 16610 bits, must be 1 to 9"


def test_check_number():
    for number in (1, 1.0, np.float32(1), np.float64(1), np.int8(1)):
        assert check_number("x", number) == 1.0
        assert type(check_number("x", number)) is float


def test_a_schema_beside_the_parameters_is_ignored(tmp_path):
    data = {"$schema": "https://example.org/scene.schema.json", "table": "cap", "r": 1.0}
    assert from_data(data) == CIRCLE
    (tmp_path / "a.json").write_text(json.dumps(data), "utf-8")
    (tmp_path / "a.toml").write_text('"$schema" = "x"\ntable = "cap"\nr = 1.0\n', "utf-8")
    assert load(tmp_path / "a.json") == load(tmp_path / "a.toml") == CIRCLE
    assert "$schema" in one_line(from_data, {**data, "r": {"kind": "fourier", "$schema": "x", "mean": 1.0}})


def test_parameters_are_those_of_the_tables():
    given = {field for table in (Cap, Stem, Mushroom) for field in table.__struct_fields__}
    assert given == {*PARAMETERS, "name", "notes"}
    assert issubclass(InvalidScene, BadInput)
