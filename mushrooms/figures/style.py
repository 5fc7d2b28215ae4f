"""The style of every plot: one palette, new figures, the same bytes for the same picture.

The palette is Okabe and Ito's, told apart by colour-blind readers, and viridis for phases.
Simulation is blue and filled, theory orange or black lines.
"""

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any, BinaryIO

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

BLUE = "#0072B2"
SKY = "#A6CEE9"
ORANGE = "#D55E00"
BLACK = "#1A1A1A"
GREY = "#8C8C8C"
GREEN = "#009E73"
NOTEBOOK_DPI = 100
LONGEST = 40  # letters of a line of a name in a title
MOST_LINES = 3  # lines of such a name
STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana"],  # an SVG names them all with each text
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": BLACK,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "svg.hashsalt": "oscillating-mushrooms",  # the same picture is the same bytes
}


def phase_colours(n: int) -> list[str]:
    """Return n colours in the order of the phases; the palest end of viridis is left out."""
    return [to_hex(shade) for shade in colormaps["viridis"](np.linspace(0, 0.88, n))]


def plain(text: str) -> str:
    """Return a text that a figure shows as it is: a dollar begins no formula, and lines end.

    A picture is made as wide as its title: the names of scenes may have any length.
    """
    lines = (
        line if len(line) <= LONGEST else line[: LONGEST - 1] + "…" for line in text.splitlines()
    )
    return "\n".join(islice(lines, MOST_LINES)).replace("$", r"\$")


def power(number: float) -> str:
    """Return a positive number as a figure shows it: 50, 2500, or a power of ten."""
    if 1e-2 <= number < 1e4:
        return f"{number:.4g}"
    mantissa, _, exponent = f"{number:.3e}".partition("e")
    digits = mantissa.rstrip("0").rstrip(".")
    factor = "" if digits == "1" else rf"{digits}\cdot"
    return rf"${factor}10^{{{int(exponent)}}}$"


class NotebookFigure(Figure):
    """A figure that a notebook shows: pyplot, which it asks for others, never hears of ours."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        save(self, file, ".png", dpi=NOTEBOOK_DPI)
        return file.getvalue()


def new_figure(
    width: float, height: float, n_rows: int = 1, n_columns: int = 1, **options: Any
) -> tuple[Figure, Any]:
    """Return a figure [inches] and its axes, as `Figure.subplots` does."""
    figure = NotebookFigure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(n_rows, n_columns, **options)


@contextmanager
def any_letters() -> Iterator[None]:
    """Draw a letter that the font lacks as a box, without a word: that tells enough."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+")
        yield


def save(figure: Figure, file: BinaryIO, suffix: str, dpi: int = 160) -> None:
    """Write a figure as ".svg", ".png" or ".pdf"; the bytes depend on the picture alone."""
    kind = suffix.removeprefix(".")
    with rc_context(STYLE), any_letters():
        metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        figure.savefig(file, format=kind, dpi=dpi, bbox_inches="tight", metadata=metadata)


def svg(figure: Figure) -> bytes:
    """Return a figure as a small SVG for a page.

    Letters are text. Coordinates have a hundredth of a point.
    """
    file = io.BytesIO()
    with rc_context({"svg.fonttype": "none"}):
        save(figure, file, ".svg", dpi=110)
    text = re.sub(
        rb'<!--.*?-->|(?<=<g) id="[^"]*"| transform="rotate\(-0 [^"]*"', b"", file.getvalue()
    )
    # Within tags: numbers that are read stay.
    return re.sub(rb"(\.\d\d)\d+(?=[^<>]*>)", rb"\1", text)
