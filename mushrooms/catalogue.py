"""`mushrooms scenes`: the catalogue, or one scene of it as a file to begin from."""

from __future__ import annotations

import json
from typing import Any

from rich.table import Table

import scene as scenes
from conformance.audit.runs import SCENES
from mushrooms.terminal import new_console
from scene.load import catalogue_text, read_data
from scene.refusal import BadInput


def print_scenes(name: str, as_toml: bool, as_json: bool) -> None:
    """Print the catalogue, or one scene of it or of the audit."""
    if as_toml and as_json:
        raise BadInput("--toml and --json: must be one of them")
    if as_toml and not name:
        raise BadInput(f"--toml needs NAME, one of {', '.join(scenes.catalogue())}")
    if name:
        data = scenes.to_data(SCENES[name]) if name in SCENES else None
        if as_json:
            print(json.dumps(data or read_data(name), indent=2, ensure_ascii=False))
        else:
            print((_toml(data) if data else catalogue_text(name)).rstrip("\n"))
        return
    rows = [_catalogue_row(name) for name in scenes.catalogue()]
    if as_json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    table = Table("name", "table", "period", "notes", title="Catalogue")
    for row in rows:
        length = (
            "refused" if row["refused"] else "static" if row["period"] is None else f"{row['period']:.6g}"
        )
        notes = f"Refused: {row['refused']}" if row["refused"] else row["notes"]
        table.add_row(row["name"], row["table"], length, notes)
    new_console().print(table)


def _toml(data: dict[str, Any]) -> str:
    """Return a scene as TOML: a line for each field, a law in one of them."""

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{name} = {text(part)}" for name, part in value.items()) + " }"
        return json.dumps(value)  # of numbers, lists and plain strings TOML says the same

    return "\n".join(f"{name} = {text(value)}" for name, value in data.items())


def _catalogue_row(name: str) -> dict[str, Any]:
    data = read_data(name)
    row = {"name": name, "table": data["table"], "period": None, "notes": data.get("notes", "")}
    try:
        return row | {"period": scenes.load(name).period or None, "refused": None}
    except scenes.InvalidScene as error:
        return row | {"refused": str(error).partition(": ")[2]}
