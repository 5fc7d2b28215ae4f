"""Install each distribution of a folder into a new environment, and do there what a new user does first.

Usage: python .ci/smoke.py dist        (after `python -m build`)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

SCENE = """table = "mushroom"
h = 1.0
nu = 0.5
[r]
kind = "fourier"
mean = 1.0
omega = 1.0
sin = [0.2]
"""
COMMANDS = (
    "--version",
    "scenes",
    "theory moving-cap --digits 20",
    "simulate mine.toml --particles 200 --energy 1000 --seed 1 --out run",
    "draw mine.toml --out mine.svg",
    "draw mine.toml --trajectory --seed 1 --out path.gif --export path.csv",
    "ask near-corner/3 -- {python} -m conformance.plain",
    "audit --only N5 --out report",
    "check --questions asked.jsonl --seed 1",
)
GRADED = "check --questions asked.jsonl --answers answers.jsonl"
TYPED = (
    "import importlib.resources as r, sys\n"
    "for name in ('scene', 'reference', 'fast', 'theory', 'conformance', 'mushrooms'):\n"
    "    found = r.files(name) / 'py.typed'\n"
    "    assert found.is_file() and not str(found).startswith(sys.argv[1]), found\n"
)


def main(folder: Path) -> None:
    """Try every wheel and sdist of a folder; a command that fails ends it."""
    checkout = Path(__file__).resolve().parent.parent
    files = sorted([*folder.glob("*.whl"), *folder.glob("*.tar.gz")])
    if len(files) < 2:
        sys.exit(f"{folder}: no wheel and sdist; run `python -m build`")
    for file in files:
        print(f"== {file.name}", flush=True)
        with tempfile.TemporaryDirectory() as scratch:
            venv.create(Path(scratch) / "venv", with_pip=True)
            programs = Path(scratch) / "venv" / ("Scripts" if os.name == "nt" else "bin")
            python = str(programs / "python")
            environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"MPLBACKEND": "Agg"}

            def run(*command: str, there: str = scratch, given: dict[str, str] = environment) -> None:
                print("$", *command[1:], flush=True)
                subprocess.run(command, cwd=there, env=given, check=True)

            run(python, "-m", "pip", "install", "--quiet", str(file.resolve()))
            run(python, "-c", TYPED, str(checkout))
            (Path(scratch) / "mine.toml").write_text(SCENE, "utf-8")
            for command in COMMANDS:
                if os.name == "nt" and command.startswith("ask"):
                    continue  # it signals groups of processes
                run(str(programs / "mushrooms"), *command.format(python=python).split())
            # A program that speaks the protocol answers a file of questions, which is then graded.
            asked, answers = Path(scratch) / "asked.jsonl", Path(scratch) / "answers.jsonl"
            with asked.open("rb") as source, answers.open("wb") as target:
                stepper = [python, "-m", "fast"]
                subprocess.run(stepper, cwd=scratch, env=environment, stdin=source, stdout=target, check=True)
            run(str(programs / "mushrooms"), *GRADED.split())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
