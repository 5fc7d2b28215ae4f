"""The published schemas: docs/NAME.schema.json, by name."""

import json
from functools import cache
from pathlib import Path

import jsonschema

DOCS = Path(__file__).parent.parent.parent / "docs"
# `json_schema` of each makes it; `python -m` with the name, or with `scene`, prints it. That of the audit's
# report, docs/report.schema.json, is written by hand.
MODULES = {
    "scene": "scene.load",
    "protocol": "scene.protocol.messages",
    "vector": "conformance.vectors",
    "check": "conformance.suite.reports",
    "bench": "conformance.bench.record",
}


@cache
def validator(name: str, part: str = "") -> jsonschema.Draft202012Validator:
    """Return what validates data by a published schema, or by one of its definitions."""
    schema = json.loads((DOCS / f"{name}.schema.json").read_text("utf-8"))
    if part:
        schema = {"$ref": f"#/$defs/{part}", "$defs": schema["$defs"]}
    return jsonschema.Draft202012Validator(schema)
