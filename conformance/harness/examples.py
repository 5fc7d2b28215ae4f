"""The example harnesses in `conformance/harness`: how to run each here, or why it cannot run."""

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent
COMPILERS = {"C": ("gcc", "cc"), "C++": ("g++", "c++"), "Fortran": ("gfortran",)}


class Example(NamedTuple):
    """An example harness.

    Attributes:
        command: that speaks protocol 1; empty when it cannot run here.
        why_not: the reason.
        is_absent: what it needs is not installed; else it is at fault.
        built: the line that compiled it, paths left out; empty when nothing was compiled.
    """

    command: tuple[str, ...] = ()
    why_not: str = ""
    built: str = ""
    is_absent: bool = False


def find_examples(folder: Path, flags: Sequence[str] = ("-O3",)) -> dict[str, Example]:
    """Return the examples by language, compiled where need be.

    Args:
        folder: where compiled programs go.
        flags: for the C compiler.
    """
    node = shutil.which("node")
    return {
        "C": _build_c(folder, flags),
        "JavaScript": Example((node, str(FOLDER / "javascript" / "stepper.js")))
        if node
        else Example(why_not="node is not installed", is_absent=True),
        "Python": Example((sys.executable, str(FOLDER / "python" / "stepper.py"))),
    }


def find_kit_examples(folder: Path, flags: Sequence[str] = ("-O3",)) -> dict[str, Example]:
    """Return the examples of the adapter kits, by what the engine gives; as `find_examples`."""
    python = FOLDER / "python"
    return {
        "C++, next hit": compiled(
            "C++", [*flags, "-std=c++17"], FOLDER / "cpp" / "engine.cpp", folder / "engine"
        ),
        "Python, implicit domain": Example((sys.executable, str(python / "implicit.py"))),
        "Python, intersection and reflection": Example((sys.executable, str(python / "parts.py"))),
    }


def find_compiler(language: str) -> str | None:
    """Return the path of the first compiler of a language that is installed."""
    return next(filter(None, map(shutil.which, COMPILERS[language])), None)


def compiled(
    language: str, flags: Sequence[str], source: Path, program: Path, libraries: Sequence[str] = ()
) -> Example:
    """Compile one file; the example's command is what was built, whether or not it is a program.

    Args:
        language: one of COMPILERS.
        flags: for the compiler.
        source: the file.
        program: what to write.
        libraries: flags that come after the file.
    """
    compiler = find_compiler(language)
    if not compiler:
        return Example(why_not=f"no {language} compiler is installed", is_absent=True)
    line = [compiler, *flags, "-o", str(program), str(source), *libraries]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode:
        return Example(why_not=f"it does not compile: {' '.join(done.stderr.split())[:400]}")
    return Example((str(program),), built=" ".join([Path(compiler).name, *flags, source.name, *libraries]))


def _build_c(folder: Path, flags: Sequence[str]) -> Example:
    source, libraries = FOLDER / "c" / "stepper.c", ["-ljansson", "-lm"]
    built = compiled("C", [*flags, "-std=gnu11"], source, folder / source.stem, libraries)
    if built.command or built.is_absent:
        return built
    # Errors in the example may name jansson's header too. A program that has nothing else tells them apart.
    probe = folder / "probe.c"
    probe.write_text("#include <jansson.h>\nint main(void) { return json_null() == 0; }\n", "utf-8")
    if compiled("C", [], probe, folder / probe.stem, libraries).command:
        return built
    return Example(why_not="jansson is not installed (Debian: libjansson-dev)", is_absent=True)
