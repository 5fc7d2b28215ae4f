"""Bad inputs, derived from the JSON Schema of the protocol: what it forbids, one fault at a time.

Each field that is required is left out, each value is replaced by one of every type that it may not have, a
number by one out of its range, a word by one that is none; and of two fields of which one is due, both are
given.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from scene.protocol.messages import json_schema

OTHERS: dict[str, Any] = {
    "null": None,
    "boolean": True,
    "string": "1.0",
    "array": [1.0],
    "object": {},
    "number": 5.5,
}
MEANINGLESS = ("name", "notes")
OWN = ("cmd", "seq", "table", "kind")  # by which the rest is found: left out or unknown, not of another type


@cache
def _schema() -> dict[str, Any]:
    return json_schema()["$defs"]  # type: ignore[no-any-return]


def broken(request: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Break a request in every way that the schema forbids.

    Args:
        request: valid, with its seq left out.

    Yields:
        The request with one fault, and what that is.
    """
    name = str(request["cmd"]).capitalize()
    yield from _broken({"$ref": f"#/$defs/{name}"}, request, "")


def _broken(schema: Mapping[str, Any], value: Any, where: str) -> Iterator[tuple[Any, str]]:
    forms = list(_forms(schema))
    own = next((form for form in forms if _fits(form, value)), {})
    if not where.endswith(OWN):
        kinds = {kind for form in forms for kind in _kinds(form)}
        yield from (
            (other, f"{where} is {other!r}") for kind, other in OTHERS.items() if where and kind not in kinds
        )
    if "integer" in _kinds(own):
        yield 2.5, f"{where} = 2.5"
        yield -1, f"{where} = -1"
    if "number" in _kinds(own):
        yield math.inf, f"{where} is beyond binary64"
    if "enum" in own:
        yield "nowhere", f"{where} is 'nowhere'"
    if isinstance(value, Mapping):
        for name, part in own.get("properties", {}).items():
            if name in value and name not in MEANINGLESS:
                is_due = name in own.get("required", ())
                for changed, why in _broken(part, value[name], f"{where}.{name}".lstrip(".")):
                    if is_due or changed is not None:  # null may stand for what is optional
                        yield {**value, name: changed}, why
                if name in own.get("required", ()) or {"required": [name]} in own.get("oneOf", ()):
                    yield (
                        {key: one for key, one in value.items() if key != name},
                        f"{where}.{name} is missing".lstrip("."),
                    )
            elif name not in value and {"required": [name]} in own.get("oneOf", ()):
                yield {**value, name: 1.0}, f"{where} has {name} too".lstrip(".")
    if isinstance(value, list | tuple) and value:
        items = own.get("prefixItems", [own.get("items")] * len(value))
        for i, (part, one) in enumerate(zip(items, value, strict=False)):
            for changed, why in _broken(part, one, f"{where}[{i}]") if i < 2 else ():
                yield [*value[:i], changed, *value[i + 1 :]], why
        if "minItems" in own:
            yield value[:-1], f"{where} is too short"


def _forms(schema: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Return the alternatives of a schema, references resolved."""
    if "$ref" in schema:
        yield from _forms(_schema()[schema["$ref"].rpartition("/")[2]])
    elif "anyOf" in schema:
        for form in schema["anyOf"]:
            yield from _forms(form)
    else:
        yield schema


def _kinds(form: Mapping[str, Any]) -> set[str]:
    """Return the JSON types that a form admits."""
    if "enum" in form:
        return {"string"}
    kinds = form.get("type", ())
    return {"number", "integer"} & {kinds} | {kinds} if isinstance(kinds, str) else set(kinds)


def _fits(form: Mapping[str, Any], value: Any) -> bool:
    """Tell whether a value is meant by a form: its type, and of objects the tag."""
    kind = {type(None): "null", bool: "boolean", int: "integer", float: "number", str: "string"}.get(
        type(value)
    )
    kind = kind or ("object" if isinstance(value, Mapping) else "array")
    tags = [(name, part["enum"]) for name, part in form.get("properties", {}).items() if "enum" in part]
    is_meant = kind != "object" or all(value.get(name, words[0]) in words for name, words in tags)
    return (kind in _kinds(form) or (kind == "integer" and "number" in _kinds(form))) and is_meant
