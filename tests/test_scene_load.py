"""Making and loading scenes: round trips, the published schema, one clear line for whatever is wrong.

Nobody can hold an invalid scene, and every entry of `scene` refuses bad input in one line.
"""

import copy
import functools
import inspect
import json
import math
import os
import pickle
import sys

import msgspec
import numpy as np
import pytest
from hypothesis import given
from support import fuzz
from support.refusals import NO_NUMBERS, NOT_FINITE, one_line
from support.schemas import validator
from support.tables import CIRCLE

from conformance.strategies import scenes
from scene import (
    BadInput,
    BangBang,
    Cap,
    Collision,
    Constant,
    Fourier,
    Horizon,
    InvalidScene,
    Law,
    Mushroom,
    Rejected,
    Scene,
    State,
    Stem,
    Undecided,
    Undefined,
    catalogue,
    check_count,
    check_number,
    check_scene,
    from_data,
    load,
    tables,
    to_data,
)
from scene.load import read_data
from scene.states import check_numbers

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


SCENES_AND_LAWS = [
    CIRCLE,
    Stem(w=1.0, h=1.0),
    Mushroom(r=1.0, h=1.0, nu=0.5),
    Fourier(1.0, 1.0, (0.5,)),
    BangBang(((0.0, 1.0), (1.0, 2.0), (2.0, 1.0))),
]
OUTCOMES = [
    Collision("arc", 1.0, 1.0, 0.0, 1.0, 0.0, -1.0),
    Horizon(1.0, 0.0, 0.5, 0.0, 1.0),
    Undefined("corner"),
    Undecided("too near"),
    Rejected("no cap"),
]


@pytest.mark.parametrize("made", SCENES_AND_LAWS, ids=lambda made: type(made).__name__)
def test_nothing_is_made_past_the_constructor(made):
    with pytest.raises(TypeError):
        type(made).__new__(type(made))
    with pytest.raises(TypeError):
        object.__new__(type(made))


@pytest.mark.parametrize("made", [*SCENES_AND_LAWS, START, *OUTCOMES], ids=lambda made: type(made).__name__)
def test_nothing_that_is_made_is_changed(made):
    before = repr(made)
    for field in (*made.__struct_fields__, "a_new_field"):
        with pytest.raises(AttributeError):
            setattr(made, field, -1.0)
        with pytest.raises(AttributeError):
            delattr(made, field)
    assert repr(made) == before
    found = set(getattr(made, "__dict__", {}))
    assert {name for name in found if not is_found_once(type(made), name)} == set()


def is_found_once(kind, name):
    return isinstance(inspect.getattr_static(kind, name, None), functools.cached_property)


def test_what_is_found_once_is_no_part_of_a_scene():
    """Laws and half-width are kept beside the fields: nothing copies, compares or writes them."""
    found = Mushroom(r=Fourier(1.0, 1.0, (0.25,)), nu=0.5, h=1.0)
    fresh = Mushroom(r=Fourier(1.0, 1.0, (0.25,)), nu=0.5, h=1.0)
    before = hash(found), repr(found), to_data(found)
    assert (found.laws["nu"], found.width.is_constant) == (Constant(0.5), False)
    assert (hash(found), repr(found), to_data(found)) == before
    assert found == fresh
    assert vars(fresh) == {}
    with pytest.raises(TypeError):
        found.laws["nu"] = Constant(0.25)
    for other in (copy.copy(found), copy.deepcopy(found), pickle.loads(pickle.dumps(found))):
        assert vars(other) == {}
        assert other == found
    changed = msgspec.structs.replace(found, nu=0.25)
    assert changed.laws["nu"] == Constant(0.25)
    with pytest.raises(InvalidScene, match="unknown field `laws`"):
        from_data({**to_data(found), "laws": {}})


def test_a_constant_law_is_a_bare_number_in_a_table():
    assert Cap(r=Constant(2)) == Cap(r=2.0)
    assert repr(Cap(r=Constant(2))) == repr(Cap(r=2.0))
    assert "r = nan, must be finite" in one_line(Cap, r=Constant(math.nan))
    assert "r = an object of type Law, must be a number" in one_line(Cap, r=Law())


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


def test_what_is_checked_becomes_a_number_of_python():
    assert (check_count("n", np.int64(9), 1, 9), type(check_count("n", np.int64(9), 1, 9))) == (9, int)
    assert one_line(check_count, "n", 10**5000, 1, 9) == "n = an integer of 16610 bits, must be 1 to 9"
    for number in (1, 1.0, np.float32(1), np.float64(1), np.int8(1)):
        assert (check_number("x", number), type(check_number("x", number))) == (1.0, float)


def test_a_schema_beside_the_parameters_is_ignored(tmp_path):
    data = {"$schema": "https://example.org/scene.schema.json", "table": "cap", "r": 1.0}
    assert from_data(data) == CIRCLE
    (tmp_path / "a.json").write_text(json.dumps(data), "utf-8")
    (tmp_path / "a.toml").write_text('"$schema" = "x"\ntable = "cap"\nr = 1.0\n', "utf-8")
    assert load(tmp_path / "a.json") == load(tmp_path / "a.toml") == CIRCLE
    assert "$schema" in one_line(from_data, {**data, "r": {"kind": "fourier", "$schema": "x", "mean": 1.0}})


N_FILES = int(os.environ.get("MUSHROOMS_LINES", "300"))  # of each kind
CAP = {"table": "cap", "r": 1.0}
STEM = {"table": "stem", "w": 1.0, "h": 1.0}
MUSHROOM = {"table": "mushroom", "r": 1.0, "h": 1.0, "nu": 0.5}
FOURIER = {"kind": "fourier", "mean": 1.0, "omega": 1.0}
LEGS = {"kind": "bang-bang", "knots": [[0.0, 1.0], [1.0, 1.0]]}


def as_toml(line):
    """Write a line of JSON as TOML; what is garbled stays as it is."""
    try:
        data = json.loads(line)
        lines = [f"{json.dumps(key)} = {inline(value)}" for key, value in data.items()]
    except (ValueError, AttributeError, RecursionError):
        return line
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def inline(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {inline(part)}" for key, part in value.items()) + "}"
    return "[" + ", ".join(map(inline, value)) + "]" if isinstance(value, list) else json.dumps(value)


@given(scenes())
def test_data_and_files_round_trip_to_the_bit(tmp_path_factory, scene):
    folder = tmp_path_factory.mktemp("scenes")
    line = json.dumps(to_data(scene)).encode()
    (folder / "a.json").write_bytes(line)
    (folder / "a.toml").write_bytes(as_toml(line))
    for again in (from_data(to_data(scene)), load(folder / "a.json"), load(str(folder / "a.toml"))):
        assert again == scene
        assert json.dumps(to_data(again)).encode() == line
    validator("scene").validate(json.loads(line))


def test_whole_numbers_are_numbers():
    assert from_data({"table": "cap", "r": 1}) == from_data(CAP)


# What the published schema refuses, too, as the test below holds.
ILL_FORMED = [
    (None, "Expected `object`"),
    ([], "Expected `object`"),
    (1.0, "Expected `object`"),
    ({}, "scene has no `table`, must be one of cap, stem, mushroom"),
    ({"r": 1.0}, "scene has no `table`, must be one of cap, stem, mushroom"),
    ({"table": "cone", "r": 1.0}, "table = 'cone', must be one of cap, stem, mushroom"),
    ({"table": 3, "r": 1.0}, "table = 3, must be one of cap, stem, mushroom"),
    ({"table": "cap"}, "missing required field `r`"),
    ({"table": "stem", "w": 1.0}, "missing required field `h`"),
    ({**CAP, "radius": 1.0}, "unknown field `radius`"),
    ({**CAP, "w": 1.0}, "unknown field `w`"),
    ({**CAP, "k" * 100_000: 1.0}, "kkk...`, must be one of"),
    ({**CAP, "line\nbreak": 1.0}, "unknown field `line break`"),
    ({**STEM, "nu": 0.5}, "unknown field `nu`"),
    ({**CAP, "r": "1.0"}, "r = '1.0': must be a number or a law"),
    ({**CAP, "r": None}, "r = None: must be a number or a law"),
    ({**CAP, "r": True}, "r = True: must be a number or a law"),
    ({**CAP, "r": [1.0]}, "r = [1.0]: must be a number or a law"),
    ({**CAP, "name": 3}, "name = 3: Expected `str`"),
    ({**CAP, "r": {}}, "r has no `kind`, must be one of fourier, bang-bang"),
    ({**CAP, "r": {"kind": "sawtooth"}}, "r.kind = 'sawtooth', must be one of fourier, bang-bang"),
    ({**CAP, "r": {**FOURIER, "phase": 0.0}}, "unknown field `phase`"),
    ({**CAP, "r": {**FOURIER, "cos": 0.5}}, "r.cos = 0.5: Expected `array`"),
    ({**CAP, "r": {**FOURIER, "cos": [0.1, "x"]}}, "r.cos[1] = 'x': Expected `float`"),
    ({**CAP, "r": {**LEGS, "knots": [[0.0, 1.0], [1.0]]}}, "r.knots[1] = [1.0]: Exp"),
    ({**CAP, "r": {**LEGS, "knots": [[0.0, 1.0, 2.0]]}}, "r.knots[0] = [0.0, 1.0, 2.0]: Exp"),
]
# What no schema says.
IMPOSSIBLE = [
    ({"table": "mushroom", "r": 1.0, "h": 1.0}, "exactly one of `w` and `nu`"),
    ({**MUSHROOM, "w": 0.5}, "exactly one of `w` and `nu`"),
    (
        {**MUSHROOM, "nu": 1.0 + 2.0**-52},
        "nu <= 1 fails by -2.22045e-16 near t = 0.0, where r = 1.0, nu = 1.0",
    ),
    (
        {"table": "mushroom", "r": 1.0, "h": 1.0, "w": {**LEGS, "knots": [[0, 0.5], [1, 1.5], [2, 0.5]]}},
        "w <= r fails by -0.5",
    ),
    ({**CAP, "r": math.nan}, "r = nan, must be finite"),
    ({**CAP, "r": -math.inf}, "r = -inf, must be finite"),
    ({**CAP, "r": 10**400}, "r = an integer of 1329 bits"),
    ({**CAP, "r": {**FOURIER, "cos": [0.1, math.nan]}}, "r.cos[1] = nan, must be finite"),
    # Extreme numbers must be refused in words as well, not by an overflow on the way.
    (
        {**CAP, "r": {"kind": "fourier", "mean": -1.0, "omega": 1e308, "cos": [0.0] * 15 + [0.1]}},
        "r > 0 fails",
    ),
    ({**CAP, "r": {"kind": "fourier", "mean": -1.0, "omega": 5e-324, "cos": [0.1]}}, "r > 0 fails"),
    ({**CAP, "r": {**LEGS, "knots": [[0.0, 1.0], [5e-324, -1.0], [1e-323, 1.0]]}}, "r > 0 fails"),
    ({**CAP, "r": {**LEGS, "knots": [[0.0, 1.0], [1e300, -1.0], [1.5e308, 1.0]]}}, "r > 0 fails"),
]


def refusal(call, *arguments):
    with pytest.raises(InvalidScene) as caught:
        call(*arguments)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert caught.value.__cause__ is None
    return message


@pytest.mark.parametrize(("data", "message"), ILL_FORMED + IMPOSSIBLE)
def test_bad_data_is_refused_in_one_line_that_names_the_field(data, message):
    found = refusal(from_data, data)
    assert message in found
    assert len(found) < 300
    assert (data, message) in IMPOSSIBLE or not validator("scene").is_valid(data)


BAD_FILES = [
    ("a.json", b"{", "is not valid JSON"),
    ("a.json", b"", "is not valid JSON"),
    ("a.json", b'{"table": "cap", "r": NaN}', "r = nan, must be finite"),
    ("a.json", b'{"table": "cap", "r": 1e400}', "r = inf, must be finite"),
    ("a.json", b'{"table": "cap", "r": ' + b"9" * 5000 + b"}", "is not valid JSON"),
    ("a.json", b"\xff\xfe", "is not valid JSON"),
    ("a.json", b'{"table": "cap", "r": 1, "r": 2}', "is not valid JSON: 'r' is given twice"),
    ("a.json", b'{"table": "cap", "r": {"kind": "fourier", "mean": 1, "mean": 2}}', "'mean' is given twice"),
    ("a.json", b'{"table": "cap", "r": "\\ud800"}', "surrogates not allowed"),
    ("a.json", b'{"table": "cap", "r": ' + b"[" * 100_000, "is not valid JSON"),
    ("a.json", b'{"table": "cap", "radius": 1}', "unknown field `radius`"),
    ("a.toml", b'table = "cap', "is not valid TOML"),
    ("a.toml", b'table = "cap"\nr = 1\nr = 2', "is not valid TOML"),
    ("a.toml", b"", "scene has no `table`"),
    ("a.toml", b'table = "cap"\nr = nan', "r = nan, must be finite"),
    ("a.toml", b'table = "cap"\nr = 1e400', "r = inf, must be finite"),
    ("a.toml", b'table = "cap"\nr = 1979-05-27', "r = an object of type date: must be a number or a law"),
    ("a.toml", b'table = "cap"\nr = ' + b"9" * 5000, "is not valid TOML"),
    ("a.toml", b"\xff\xfe", "is not valid TOML"),
    ("a.toml", b"r = " + b"[" * 100_000, "is not valid TOML"),
    ("a.toml", b'table = "cap"\nr = 1\n"line\\nbreak" = 1', "unknown field `line break`"),
    ("a.yaml", b"table: cap", "is neither a .toml or .json file nor one of: breathing-circle"),
]


@pytest.mark.parametrize(("name", "text", "message"), BAD_FILES)
def test_bad_files_are_refused_in_one_line_that_names_them(tmp_path, name, text, message):
    (tmp_path / name).write_bytes(text)
    found = refusal(load, tmp_path / name)
    assert message in found
    assert name in found


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path):
    for name, text in (("a.toml", 'table = "cap"\nr = 1.0\n'), ("a.json", '{"table": "cap", "r": 1.0}')):
        (tmp_path / name).write_text(text, "utf-8-sig")
        assert load(tmp_path / name) == from_data(CAP)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no such files on this system")
def test_what_may_have_no_end_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "zero.json").symlink_to("/dev/zero")
    for name in ("pipe.toml", "zero.json"):
        assert f"{name}' cannot be read: it is a pipe or a device" in refusal(load, tmp_path / name)


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    assert "cannot be read" in refusal(load, tmp_path / "folder.toml")
    assert "No such file" in refusal(load, tmp_path / "absent.json")
    assert "nor one of" in refusal(load, "moving-cup")
    assert "nor one of" in refusal(load, "")
    assert "a.toml" in refusal(load, "nul\0a.toml")


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_a_scene_file_is_read_or_refused_in_one_line(suffix, tmp_path, tally):
    """Files with values, keys or bytes spoilt at random."""
    path = tmp_path / f"scene{suffix}"
    for line in fuzz.lines(3, N_FILES, lambda draw: draw.choice(fuzz.SCENES)):
        path.write_bytes(line if suffix == ".json" else as_toml(line))
        refusal = ""
        try:
            load(str(path))
        except BadInput as error:
            refusal = str(error)
        assert "\n" not in refusal, line
        tally["refused" if refusal else "read"] += 1
    assert min(tally["refused"], tally["read"]) > N_FILES / 20


def test_a_law_nested_too_deep_is_refused():
    nested = 1.0
    for _ in range(2 * sys.getrecursionlimit()):
        nested = [nested]
    assert "r" in refusal(from_data, {"table": "cap", "r": {**LEGS, "knots": nested}})


@pytest.mark.parametrize("name", catalogue())
def test_the_schema_accepts_the_catalogue(name):
    validator("scene").validate(read_data(name))
