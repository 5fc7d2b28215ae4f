"""The example harnesses in `conformance/harness`: how to run each here, or why it cannot run."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent


class Example(NamedTuple):
    """An example harness.

    Attributes:
        command: that speaks protocol 1; empty when it cannot run here.
        why_not: the reason.
        built: the line that compiled it, paths left out; empty when nothing was compiled.
    """

    command: tuple[str, ...]
    why_not: str = ""
    built: str = ""


def find_examples(folder: Path, flags: Sequence[str] = ("-O3",)) -> dict[str, Example]:
    """Return the examples by language, compiled where need be.

    Args:
        folder: where compiled programs go.
        flags: for the C compiler.
    """
    node = shutil.which("node")
    script = (node, str(FOLDER / "javascript" / "stepper.js")) if node else ()
    return {
        "C": _build_c(folder, flags),
        "JavaScript": Example(script, "" if node else "node is not installed"),
        "Python": Example((sys.executable, str(FOLDER / "python" / "stepper.py"))),
    }


def _build_c(folder: Path, flags: Sequence[str]) -> Example:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if not compiler:
        return Example((), "no C compiler is installed")
    source, program = FOLDER / "c" / "stepper.c", folder / "stepper"
    line = [*flags, "-std=gnu11", "-o", str(program), str(source), "-ljansson", "-lm"]
    done = subprocess.run([compiler, *line], capture_output=True, text=True, check=False)
    if done.returncode:
        if "jansson.h" in done.stderr:
            return Example((), "jansson.h is not installed (Debian: libjansson-dev)")
        return Example((), f"it does not compile: {' '.join(done.stderr.split())[:200]}")
    return Example((str(program),), built=" ".join([Path(compiler).name, *flags, "stepper.c -ljansson -lm"]))
