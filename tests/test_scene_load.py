"""Loading scenes: round trips, the published schema, and one clear line for whatever is wrong."""

import json
import math
import os
import sys

import pytest
from hypothesis import given
from support import fuzz
from support.schemas import validator

from conformance.strategies import scenes
from scene import BadInput, InvalidScene, catalogue, from_data, load, to_data
from scene.load import read_data

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


# What the published schema refuses, too.
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
    ({**CAP, "r": [1.0]}, "r = an object of type list: must be a number or a law"),
    ({**CAP, "name": 3}, "name = 3: Expected `str`"),
    ({**CAP, "r": {}}, "r has no `kind`, must be one of fourier, bang-bang"),
    ({**CAP, "r": {"kind": "sawtooth"}}, "r.kind = 'sawtooth', must be one of fourier, bang-bang"),
    ({**CAP, "r": {**FOURIER, "phase": 0.0}}, "unknown field `phase`"),
    ({**CAP, "r": {**FOURIER, "cos": 0.5}}, "r.cos = 0.5: Expected `array`"),
    ({**CAP, "r": {**FOURIER, "cos": [0.1, "x"]}}, "r.cos[1] = 'x': Expected `float`"),
    ({**CAP, "r": {**LEGS, "knots": [[0.0, 1.0], [1.0]]}}, "r.knots[1] = an object of type list: Exp"),
    ({**CAP, "r": {**LEGS, "knots": [[0.0, 1.0, 2.0]]}}, "r.knots[0] = an object of type list: Exp"),
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


@pytest.mark.parametrize(("data", "_"), ILL_FORMED)
def test_the_schema_refuses_what_the_loader_refuses(data, _):
    assert not validator("scene").is_valid(data)
