"""Scenes from the catalogue, from TOML or JSON files, and from decoded data."""

from __future__ import annotations

import json
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from scene.tables import Scene
from scene.validity import InvalidScene, check


def catalogue() -> list[str]:
    """Return the names of the scenes that ship with the package, `moving-cap-as-printed` included."""
    folder = resources.files("scene") / "catalogue"
    return sorted(
        entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")
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
    name = str(source)
    if name in catalogue():
        return tomllib.loads((resources.files("scene") / "catalogue" / f"{name}.toml").read_text("utf-8"))
    path = Path(source)
    if path.suffix not in (".toml", ".json"):
        raise InvalidScene(
            f"scene {name!r} is neither a .toml or .json file nor one of: {', '.join(catalogue())}"
        )
    try:
        text = path.read_text("utf-8")
        return tomllib.loads(text) if path.suffix == ".toml" else json.loads(text)
    except OSError as error:
        raise InvalidScene(f"scene {name!r} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        kind = path.suffix.removeprefix(".").upper()
        raise InvalidScene(f"scene {name!r} is not valid {kind}: {error}") from None


def from_data(data: Any, origin: str = "") -> Scene:
    """Decode plain data (dicts, lists, numbers) strictly and prove the scene valid.

    Raises:
        InvalidScene: one line naming the field, the value and the bound.
    """
    prefix = f"scene {origin!r}: " if origin else "scene: "
    try:
        scene: Scene = msgspec.convert(data, Scene)
        check(scene)
    except InvalidScene as error:
        raise InvalidScene(prefix + str(error)) from None
    except (msgspec.ValidationError, UnicodeEncodeError, RecursionError, OverflowError) as error:
        # A key may hold a line break, and the message repeats it; JSON may spell a lone surrogate.
        reason = " ".join(str(error).split())
        raise InvalidScene(prefix + reason.replace("$.", "").replace("$", "scene")) from None
    return scene


def to_data(scene: Scene) -> dict[str, Any]:
    """Return the wire's form of a scene as plain data; of `omega` and `period`, the one that a law gives."""
    data: dict[str, Any] = msgspec.to_builtins(scene)
    return {name: _without_none(field) for name, field in data.items()}


def _without_none(field: Any) -> Any:
    if not isinstance(field, dict):
        return field
    return {name: value for name, value in field.items() if value is not None}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a scene file, published as docs/scene.schema.json."""
    schema = msgspec.json.schema(Scene)
    state_omega_or_period(schema["$defs"])
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Scene", **schema}


def state_omega_or_period(definitions: dict[str, Any]) -> None:
    """Say in a schema's definitions that a Fourier law gives exactly one of `omega` and `period`."""
    fourier = definitions["Fourier"]
    for field in ("omega", "period"):
        fourier["properties"][field] = {"type": "number"}
    fourier["oneOf"] = [{"required": ["omega"]}, {"required": ["period"]}]
