"""Mathematics in plain text, typeset as HTML: p_nc, E0^(-1/4), V_ell / V_cap, <=, 10^-25.

Claims are written to be read as text. What looks like a formula there becomes italic letters, sub- and
superscripts and proper signs; all else is escaped and left alone.
"""

from __future__ import annotations

import re

from markupsafe import Markup, escape

SIGNS = {"<=": "≤", ">=": "≥", "+-": "±", "!=": "≠", "->": "→"}
GREEK = {
    "alpha": "α", "beta": "β", "delta": "δ", "theta": "θ", "lambda": "λ", "mu": "μ", "nu": "ν", "omega": "ω",
    "phi": "φ", "sigma": "σ", "tau": "τ",
}  # fmt: skip
# A symbol with an index (V_cap, sigma_w, m1, E0), or a Greek letter alone; neither is part of a word or of a
# path, and capitals that name claims (M1, X2) are no symbols.
_LETTERS = "|".join(GREEK)
_SYMBOL = re.compile(
    rf"(?<![\w.-])(?:(?P<base>[a-zEVTRJ]|dV|{_LETTERS})(?:_(?P<index>[A-Za-z0-9]{{1,4}})|(?P<digit>[01]))"
    rf"|(?P<greek>{_LETTERS}))(?!\w|[\w/]*\.\w)"
)
_POWER = re.compile(r"(?<=[\w)²])\^(?:\((?P<long>[^()]{1,12})\)|(?P<short>-?[\d.]+(?:/\d+)?|[a-z]))")


def typeset(text: str) -> Markup:
    """Return a text as HTML with its formulas typeset."""
    found = str(escape(text))
    for plain, sign in SIGNS.items():
        found = found.replace(str(escape(plain)), sign)
    found = _POWER.sub(lambda power: f"<sup>{_minus(power['long'] or power['short'])}</sup>", found)
    return Markup(_SYMBOL.sub(_symbol, found))  # escaped above: only our own tags are added


def _symbol(match: re.Match[str]) -> str:
    if match["greek"]:
        return f"<i>{GREEK[match['greek']]}</i>"
    base, index = GREEK.get(match["base"], match["base"]), match["index"] or match["digit"]
    return f"<i>{base}</i><sub>{index}</sub>"


def _minus(exponent: str) -> str:
    return exponent.replace("-", "−")
