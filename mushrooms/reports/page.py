"""What the HTML reports share: one base template, one style, figures embedded, numbers written one way.

A page is one file: no scripts, and nothing is loaded from elsewhere.
"""

from __future__ import annotations

import base64
import json
from typing import Any

import jinja2

from mushrooms import __version__
from mushrooms.reports.typeset import typeset


def render(template: str, **fields: Any) -> str:
    """Return the page that a template of this folder makes of these fields; `version` is ours."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mushrooms", "reports"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    environment.filters["typeset"] = typeset
    environment.filters["as_json"] = as_json
    return environment.get_template(template).render(version=__version__, **fields)


def number(value: float | None, form: str) -> str:
    """Return a number in a format of Python's, such as ".2e" or ","; a dash when there is none."""
    return "–" if value is None else format(value, form)


def as_json(value: Any) -> str:
    """Return data as readers see it: jinja's own filter is for scripts and spells apostrophes by number."""
    return json.dumps(value, ensure_ascii=False)


def embed(svg: bytes) -> str:
    """Return a figure as the source of an image within the page."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")
