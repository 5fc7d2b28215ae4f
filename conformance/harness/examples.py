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


def find_kit_examples(folder: Path, flags: Sequence[str] = ("-O3",)) -> dict[str, Example]:
    """Return the examples of the adapter kits, by what the engine gives; as `find_examples`."""
    python = FOLDER / "python"
    return {
        "C++, next hit": _build_cpp(folder, flags),
        "Python, implicit domain": Example((sys.executable, str(python / "implicit.py"))),
        "Python, intersection and reflection": Example((sys.executable, str(python / "parts.py"))),
    }


def _build_c(folder: Path, flags: Sequence[str]) -> Example:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if not compiler:
        return Example((), "no C compiler is installed")
    built = _build(compiler, [*flags, "-std=gnu11"], FOLDER / "c" / "stepper.c", folder, ["-ljansson", "-lm"])
    if "jansson.h" in built.why_not:
        return Example((), "jansson.h is not installed (Debian: libjansson-dev)")
    return built


def _build_cpp(folder: Path, flags: Sequence[str]) -> Example:
    compiler = shutil.which("g++") or shutil.which("c++")
    if not compiler:
        return Example((), "no C++ compiler is installed")
    return _build(compiler, [*flags, "-std=c++17"], FOLDER / "cpp" / "engine.cpp", folder, [])


def _build(compiler: str, flags: list[str], source: Path, folder: Path, libraries: list[str]) -> Example:
    program = folder / source.stem
    line = [compiler, *flags, "-o", str(program), str(source), *libraries]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode:
        return Example((), f"it does not compile: {' '.join(done.stderr.split())[:400]}")
    return Example((str(program),), built=" ".join([Path(compiler).name, *flags, source.name, *libraries]))
