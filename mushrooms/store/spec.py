"""The specification of a run: all that decides its bits, and how two specifications differ."""

from __future__ import annotations

import json
import platform
import shlex
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np

import mushrooms
import scene as scenes
from scene import Scene

SCHEMA = 4  # of a stored run: raised when its files change, so that older ones are refused


class RunSpec(NamedTuple):
    """All that decides the bits of a particle, except its number.

    Attributes:
        scene: table and laws.
        energy: E = v^2 / 2 of every start [length^2 / time^2].
        n_cycles: cycles followed.
        seed: of the starts.
        phases: fractions of each cycle at which energies are kept too, rising, in (0, 1).
    """

    scene: Scene
    energy: float
    n_cycles: int
    seed: int
    phases: tuple[float, ...] = ()

    def to_data(self) -> dict[str, Any]:
        """Return the specification as a store keeps it, in types of JSON."""
        return {
            "schema": SCHEMA,
            "version": mushrooms.__version__,
            "scene": json.loads(json.dumps(scenes.to_data(self.scene))),  # lists, as they are read back
            "energy": self.energy,
            "cycles": self.n_cycles,
            "seed": self.seed,
            **({"phases": list(self.phases)} if self.phases else {}),  # as older runs say it that have none
        }

    def command(self, scene: str, n_particles: int, folder: Path) -> str:
        """Return the command that makes this run, or goes on with it."""
        options: dict[str, object] = {"particles": n_particles, "energy": self.energy}
        options |= {"cycles": self.n_cycles, "seed": self.seed}
        options |= {"phases": ",".join(map(repr, self.phases))} if self.phases else {}
        options["out"] = folder
        words = [str(word) for name, value in options.items() for word in (f"--{name}", value)]
        return shlex.join(["mushrooms", "simulate", scene, *words, "--resume"])


def spec_of(data: dict[str, Any]) -> RunSpec:
    """Return the specification that a store holds."""
    phases = tuple(data.get("phases", ()))
    return RunSpec(scenes.from_data(data["scene"]), data["energy"], data["cycles"], data["seed"], phases)


def difference(stored: dict[str, Any], wanted: dict[str, Any]) -> str | None:
    """Return the first field in which a stored run differs from the one wanted, with both values; or None."""
    stored, wanted = ({**data, "phases": data.get("phases", [])} for data in (stored, wanted))
    for name, value in wanted.items():
        found = stored.get(name)
        if found == value:
            continue
        if isinstance(found, dict) and isinstance(value, dict):  # the scene: its first part that differs
            part = next(key for key in {**found, **value} if found.get(key) != value.get(key))
            return f"{name}: {part} = {found.get(part)!r} there, {value.get(part)!r} asked for"
        return f"{name} = {found!r} there, {value!r} asked for"
    return None


def made_by() -> dict[str, Any]:
    """Return the versions of packages and the revision of the source tree, on which bits may depend."""
    return {
        "versions": {
            "oscillating-mushrooms": mushrooms.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
            "machine": platform.machine(),
        },
        "revision": _revision(),
    }


def _revision() -> str | None:
    """Return the commit of the source tree, with `+` if files differ from it; None without a tree."""
    here = Path(__file__).parent
    try:
        command = ["git", "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"]
        done = subprocess.run(command, cwd=here, capture_output=True, text=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() or None
