"""What a matplotlib figure shows, as numbers: lines, measured points with their errors, bars, words."""

import re
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import StepPatch
from matplotlib.text import Text


class Measured(NamedTuple):
    """Points that `errorbar` drew: places, values, and half the length of each bar."""

    x: np.ndarray
    y: np.ndarray
    errors: np.ndarray


class Bars(NamedTuple):
    """A histogram that `stairs` drew."""

    heights: np.ndarray
    edges: np.ndarray

    @property
    def area(self) -> float:
        return float(self.heights @ np.diff(self.edges))


def line(axes: Axes, label: str) -> Line2D:
    """Return the one line whose label begins so."""
    found = [one for one in axes.lines if str(one.get_label()).startswith(label)]
    assert len(found) == 1, [one.get_label() for one in axes.lines]
    return found[0]


def xy(one: Line2D) -> tuple[np.ndarray, np.ndarray]:
    """Return a line's coordinates."""
    return np.asarray(one.get_xdata(), float), np.asarray(one.get_ydata(), float)


def measured(axes: Axes, label: str = "simulation") -> Measured:
    """Return the one set of points with errors whose label begins so."""
    [found] = [
        one
        for one in axes.containers
        if isinstance(one, ErrorbarContainer) and str(one.get_label()).startswith(label)
    ]
    return with_errors(found)


def with_errors(found: Any) -> Measured:
    """Return what an ErrorbarContainer shows."""
    data, _, bars = found.lines
    segments = np.array(bars[0].get_segments())
    x, y = xy(data) if data is not None else (segments[:, 0, 0], segments[:, :, 1].mean(axis=1))
    assert np.allclose(segments[:, :, 1].mean(axis=1), y, equal_nan=True)  # a bar is as long on both sides
    return Measured(x, y, np.ptp(segments[:, :, 1], axis=1) / 2)


def bars(axes: Axes, label: str = "simulation") -> Bars:
    """Return the one histogram with this label."""
    found = [one for one in axes.patches if isinstance(one, StepPatch) and one.get_label() == label]
    assert len(found) == 1, [one.get_label() for one in axes.patches]
    values, edges, _ = found[0].get_data()
    return Bars(np.asarray(values), np.asarray(edges))


def labels(axes: Axes) -> list[str]:
    """Return what a legend of these axes says."""
    return list(axes.get_legend_handles_labels()[1])


def words(figure: Figure) -> str:
    """Return every text of a figure."""
    return "\n".join(text.get_text() for text in figure.findobj(Text))


def said(figure: Figure) -> list[str]:
    """Return what each panel says: title, names of its axes, legend; and what the figure's legend says.

    A number of two digits or more, and one with decimals, is written #.
    """
    found = [
        [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), *_entries([axes.get_legend()])]
        for axes in figure.axes
    ]
    found += [_entries([legend]) for legend in figure.legends]
    return [re.sub(r"\d+(,\d{3})+|\d*\.\d+|\d{2,}", "#", " | ".join(part)) for part in found]


def _entries(legends: list[Any]) -> list[str]:
    return [text.get_text() for legend in legends if legend is not None for text in legend.get_texts()]
