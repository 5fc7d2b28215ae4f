"""What the HTML reports share: template, style, embedded figures, numbers, typeset formulas.

A page is one file: no scripts, and nothing is loaded from elsewhere. Claims are written as plain
text. What looks like a formula there becomes italic letters, sub- and superscripts and proper
signs.
"""

import json
import re
from typing import Any
from urllib.parse import quote

import jinja2
from markupsafe import Markup, escape

from mushrooms import __version__


def render(template: str, **fields: Any) -> str:
    """Return the page that a template of this folder makes of these fields; `version` is ours."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mushrooms", "reports"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "typeset": typeset, "as_json": as_json}
    return environment.get_template(template).render(version=__version__, **fields)


def number(value: float | None, form: str) -> str:
    """Return a number in a format of Python's, such as ".2e" or ","; a dash when there is none."""
    return "–" if value is None else format(value, form)


def as_json(value: Any) -> str:
    """Return data as readers see it.

    Jinja's own filter is for scripts and spells apostrophes by number.
    """
    return json.dumps(value, ensure_ascii=False)


def embed(svg: bytes) -> str:
    """Return a figure as the source of an image within the page."""
    return "data:image/svg+xml," + quote(b" ".join(svg.split()), safe=" /:;,=()!@+")


SIGNS = {"<=": "≤", ">=": "≥", "+-": "±", "!=": "≠", "->": "→"}
GREEK = {
    "alpha": "α", "beta": "β", "delta": "δ", "theta": "θ", "lambda": "λ", "mu": "μ", "nu": "ν",
    "omega": "ω", "phi": "φ", "sigma": "σ", "tau": "τ",
}  # fmt: skip
# A symbol with an index (V_cap, sigma_w, m1, E0), or a Greek letter alone; neither is part of a
# word or of a path, and capitals that name claims (M1, X2) are no symbols.
_LETTERS = "|".join(GREEK)
_SYMBOL = re.compile(
    rf"(?<![\w.-])(?:(?P<base>[a-zEVTRJ]|dV|{_LETTERS})"
    r"(?:_(?P<index>[A-Za-z0-9]{1,4})|(?P<digit>[01]))"
    rf"|(?P<greek>{_LETTERS}))(?!\w|[\w/]*\.\w)"
)
_POWER = re.compile(
    r"(?<=[\w)²])\^(?:\((?P<long>[^()]{1,12})\)|(?P<short>-?[\d.]+(?:/\d+)?|[a-z]))"
)


def typeset(text: str) -> Markup:
    """Return a text as HTML with its formulas typeset."""
    found = str(escape(text))
    for plain, sign in SIGNS.items():
        found = found.replace(str(escape(plain)), sign)
    found = _POWER.sub(
        lambda power: f"<sup>{(power['long'] or power['short']).replace('-', '−')}</sup>", found
    )
    return Markup(_SYMBOL.sub(_symbol, found))  # escaped above: only our own tags are added


def _symbol(match: re.Match[str]) -> str:
    if match["greek"]:
        return f"<i>{GREEK[match['greek']]}</i>"
    base = GREEK.get(match["base"], match["base"])
    index = match["index"] or match["digit"]
    return f"<i>{base}</i><sub>{index}</sub>"
