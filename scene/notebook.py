"""What a notebook shows of a scene, a prediction, an ensemble.

Plain HTML, with no plotting library.
"""

from collections.abc import Mapping
from html import escape

import msgspec
from mpmath import fp

from scene.geometry import table_at
from scene.tables import Scene

SIZE = 240  # of the picture [pixels]
SHADES = ("#440154", "#31688e", "#35b779", "#b8b800")  # the walls at each quarter of the cycle


def rows(title: str, values: Mapping[str, object]) -> str:
    """Return a table with a line for each name and its value."""
    lines = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(str(value))}</td></tr>"
        for name, value in values.items()
    )
    return f"<table><caption>{escape(title)}</caption>{lines}</table>"


def of_scene(scene: Scene) -> str:
    """Return the laws of a scene and its walls at each quarter of the cycle."""
    span = scene.period
    shown: dict[str, object] = {}
    for name, law in scene.laws.items():
        data = msgspec.to_builtins(law.as_field())
        fields = data.items() if isinstance(data, dict) else ()
        told = [f"{key} = {field}" for key, field in fields if field not in (None, (), [])]
        shown[name] = ", ".join(told) or data
    shown["period"] = f"{span:.6g}" if span else "none: nothing moves"
    title = f"{scene.name or 'a scene'}: {scene.__struct_config__.tag}"
    style = "display:flex;gap:1em;align-items:flex-start"
    return f"<div style='{style}'>{rows(title, shown)}{_picture(scene, span)}</div>"


def _picture(scene: Scene, span: float) -> str:
    times = [span * k / len(SHADES) for k in range(len(SHADES))] if span else [0.0]
    outlines = [table_at(fp, scene, t).outline(n_arc=48) for t in times]
    points = [point for outline in outlines for line in outline for point in line]
    (left, right), (bottom, top) = ((min(c), max(c)) for c in zip(*points, strict=True))
    unit = 0.02 * max(right - left, top - bottom)
    lines = [
        f"<polyline fill='none' stroke='{shade}' stroke-width='2' "
        "vector-effect='non-scaling-stroke' points='"
        + " ".join(f"{x:.6g},{-y:.6g}" for x, y in line)
        + "'/>"
        for outline, shade in zip(outlines, SHADES, strict=False)
        for line in outline
    ]
    corner = f"{left - unit:.6g} {-top - unit:.6g}"
    box = f"{corner} {right - left + 2 * unit:.6g} {top - bottom + 2 * unit:.6g}"
    size = f"width='{SIZE}' height='{SIZE}' viewBox='{box}'"
    return f"<svg {size} role='img' aria-label='walls'>{''.join(lines)}</svg>"
