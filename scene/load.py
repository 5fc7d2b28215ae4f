"""Scenes from the catalogue, from TOML or JSON files, and from decoded data."""

from __future__ import annotations

import errno
import json
import os
import re
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from scene.laws import MAX_HARMONICS, MAX_KNOTS, WRITTEN
from scene.refusal import InvalidScene, shown
from scene.tables import HIDDEN, PARAMETERS, Cap, Mushroom, Scene, Stem, check_scene

# What a text may hold, as a pattern that a schema in ASCII can hold.
SHOWN = "".join(c if " " <= c <= "~" else f"\\u{ord(c):04x}" for c in f"^[^{HIDDEN.pattern[1:]}*$")


def catalogue() -> list[str]:
    """Return the names of the scenes that ship with the package, also of the refused one."""
    folder = resources.files("scene") / "catalogue"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def load(source: str | Path) -> Scene:
    """Load and prove valid a scene.

    Args:
        source: a catalogue name, or the path of a .toml or .json file in the wire's form.

    Raises:
        InvalidScene: one line naming the file, the field, the value and the bound.
    """
    return from_data(read_data(source), origin=str(source))


def read_data(source: str | Path) -> Any:
    """Read a scene file into plain data, without judging it.

    Raises:
        InvalidScene: when there is no such scene, or its text is neither TOML nor JSON.
    """
    if not isinstance(source, str | os.PathLike):
        raise InvalidScene(f"scene = {shown(source)}, must be a name of the catalogue or a path")
    name = str(source)
    if name in catalogue():
        return tomllib.loads(catalogue_text(name))
    path = Path(source)
    if path.suffix not in (".toml", ".json"):
        raise InvalidScene(
            f"scene {name!r} is neither a .toml or .json file nor one of: {', '.join(catalogue())}"
        )
    try:
        if path.is_fifo() or path.is_char_device():  # which may have no end, or never begin
            raise OSError(errno.EINVAL, "it is a pipe or a device, must be a file")
        text = path.read_text("utf-8-sig")  # without the mark that some editors put before it
        return (
            tomllib.loads(text)
            if path.suffix == ".toml"
            else json.loads(text, object_pairs_hook=_once)
        )
    except OSError as error:
        raise InvalidScene(f"scene {name!r} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        kind = path.suffix.removeprefix(".").upper()
        raise InvalidScene(f"scene {name!r} is not valid {kind}: {error}") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object. Refuse a key that stands twice, as TOML does.

    One value would be lost.
    """
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"{shown(key)} is given twice")
        found[key] = value
    return found


def from_data(data: Any, origin: str = "") -> Scene:
    """Decode plain data (dicts, lists, numbers) strictly and prove the scene valid.

    A field `$schema` is ignored: editors find the published schema by it.

    Raises:
        InvalidScene: one line naming the field, the value and the bound.
    """
    prefix = f"scene {origin!r}: " if origin else "scene: "
    if isinstance(data, dict):
        data = {name: field for name, field in data.items() if name != "$schema"}
    try:
        scene: Scene = msgspec.convert(data, Scene)
    except (msgspec.ValidationError, UnicodeEncodeError, RecursionError, OverflowError) as error:
        raise InvalidScene(prefix + _in_words(error, data)) from None
    return scene


def _in_words(error: Exception, data: Any) -> str:
    """Return one line that names the field first, then its value, then what is wrong with it."""
    # A key may hold a line break, and the message repeats it; JSON may spell a lone surrogate.
    text, _, path = " ".join(str(error).split()).partition(" - at `$")
    names = re.findall(r"[^.\[\]]+", path.rstrip("`"))
    place = path.rstrip("`").removeprefix(".")
    cause = error.__cause__
    if isinstance(cause, InvalidScene):
        # A law does not know its parameter, so its message names its kind.
        kinds = "|".join(_kinds(place))
        return re.sub(rf"^({kinds})(?=[. ])", place, str(cause)) if place else str(cause)
    tags = ", ".join(_kinds(place.removeprefix("table")))
    if place in ("table", *(f"{name}.kind" for name in PARAMETERS)):
        return f"{place} = {shown(_at(data, names))}, must be one of {tags}"
    if "required field `table`" in text or "required field `kind`" in text:
        return f"{place or 'scene'} has no `{'kind' if place else 'table'}`, must be one of {tags}"
    told = re.match(r"Object (contains unknown|missing required) field `(.*?)`$", text)
    if told:
        return _fields_in_words(place, _at(data, names), told[1] == "contains unknown", told[2])
    if "`float | object" in text:
        text = "must be a number or a law"
    return f"{place} = {shown(_at(data, names))}: {text}" if place else text


def _kinds(place: str) -> dict[str, Any]:
    """Return the laws by their kinds, or at the top the tables by theirs."""
    valid = WRITTEN if place else (Cap, Stem, Mushroom)
    return {str(kind.__struct_config__.tag): kind for kind in valid}


def _fields_in_words(place: str, given: Any, is_unknown: bool, field: str) -> str:
    """Say which field of a table or a law is unknown or missing, and which there are."""
    tag = given["kind" if place else "table"]
    valid = ", ".join(("kind" if place else "table", *_kinds(place)[tag].__struct_fields__))
    if is_unknown:
        field = field if len(field) <= 60 else f"{field[:57]}..."
        return f"{place or 'scene'} has an unknown field `{field}`, must be one of {valid}"
    return f"{place or 'scene'}: missing required field `{field}`; a {tag} has {valid}"


def _at(data: Any, names: list[str]) -> Any:
    for name in names:
        data = data[int(name) if isinstance(data, list | tuple) else name]
    return data


def to_data(scene: Scene) -> dict[str, Any]:
    """Return a scene as plain data, in the form of the protocol.

    A law keeps its `omega` or its `period`.
    """
    check_scene(scene)
    data: dict[str, Any] = msgspec.to_builtins(scene)
    return {name: _without_none(field) for name, field in data.items()}


def catalogue_text(name: str) -> str:
    """Return the TOML of a scene of the catalogue as it was written, its comments too.

    Raises:
        InvalidScene: there is no such scene.
    """
    if name not in catalogue():
        raise InvalidScene(f"scene {shown(name)} is none of: {', '.join(catalogue())}")
    return (resources.files("scene") / "catalogue" / f"{name}.toml").read_text("utf-8")


def _without_none(field: Any) -> Any:
    if not isinstance(field, dict):
        return field
    return {name: value for name, value in field.items() if value is not None}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a scene file, published as docs/scene.schema.json."""
    schema = msgspec.json.schema(Scene)
    limit_definitions(schema["$defs"])
    for table in ("Cap", "Stem", "Mushroom"):
        schema["$defs"][table]["properties"]["$schema"] = {"type": "string"}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Scene", **schema}


def limit_definitions(definitions: dict[str, Any]) -> None:
    """Put what a schema can say of `scene.protocol.rules` into its definitions."""
    fourier = definitions["Fourier"]
    for field in ("omega", "period"):
        fourier["properties"][field] = {"type": "number", "exclusiveMinimum": 0}
    fourier["oneOf"] = [{"required": ["omega"]}, {"required": ["period"]}]
    for field in ("cos", "sin"):
        fourier["properties"][field]["maxItems"] = MAX_HARMONICS
    for kind in WRITTEN:
        properties = definitions[kind.__name__]["properties"]
        if "knots" in properties:
            properties["knots"] |= {"minItems": 2, "maxItems": MAX_KNOTS}
    mushroom = definitions["Mushroom"]
    for field in ("w", "nu"):
        forms = mushroom["properties"][field]["anyOf"]
        mushroom["properties"][field] = {
            "anyOf": [form for form in forms if form != {"type": "null"}]
        }
    mushroom["oneOf"] = [{"required": ["w"]}, {"required": ["nu"]}]
    for table in ("Cap", "Stem", "Mushroom"):
        for field in ("name", "notes"):
            definitions[table]["properties"][field]["pattern"] = SHOWN
