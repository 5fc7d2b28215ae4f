"""What commands print: results as lines, tables or JSON, and the three files of a report."""

import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from scene.files.writer import write_files


def new_console(*, soft_wrap: bool = False) -> Console:
    """Return a console for stdout whose tables fit its width, or COLUMNS.

    A pipe has room enough for them.
    """
    size = shutil.get_terminal_size((140, 25))
    return Console(width=size.columns, height=size.lines, soft_wrap=soft_wrap, highlight=False)


def print_table(console: Console, table: Table) -> None:
    """Print a table in which no word and no number is cut.

    A terminal that is too narrow breaks the lines.
    """
    at_ease = console.options.update(max_width=10_000)
    console.width = max(console.width, console.measure(table, options=at_ease).minimum)
    console.print(table)


def print_pairs(
    pairs: dict[str, Any], as_json: bool, meanings: Mapping[str, str] | None = None
) -> None:
    """Print names, values and what they mean, a line each; or all as JSON with every digit.

    A value `x` with a standard error `x_se` is rounded to the error's second digit, and so is
    `x_theory`.
    """
    if as_json:
        print(json.dumps(pairs, indent=2))
        return
    width = max(map(len, pairs))
    texts = {name: _rounded(name, pairs) for name in pairs}
    longest = max(map(len, texts.values()))
    for name, text in texts.items():
        meaning = (meanings or {}).get(name)
        print(
            f"{name:<{width}}  {text:<{longest}}  {meaning}"
            if meaning
            else f"{name:<{width}}  {text}"
        )


def _rounded(name: str, pairs: dict[str, Any]) -> str:
    value = pairs[name]
    error = pairs.get(f"{name.removesuffix('_se').removesuffix('_theory')}_se")
    if value is None:
        return "–"
    if not (isinstance(value, float) and isinstance(error, float) and 0 < error < math.inf):
        return str(value)
    places = 1 - math.floor(math.log10(error))
    return f"{value:.{max(places, 0)}f}"


def write_report(folder: Path, data: str, text: str, page: str, as_json: bool) -> None:
    """Write report.json, report.txt and report.html together, and print one of the first two."""
    write_files(folder, {"report.json": data, "report.txt": text, "report.html": page})
    print(data if as_json else text, end="")
    if not as_json:
        print(f"Report: {folder / 'report.html'}")
