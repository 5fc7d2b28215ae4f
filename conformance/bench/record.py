"""What a benchmark keeps: bench.json, from which every plotted point can be read and re-made.

`python -m conformance.bench.record > docs/bench.schema.json` prints its schema.
"""

import json
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from scene.refusal import BadInput

FORMAT = 3
Time = Annotated[float, msgspec.Meta(ge=1e-50, le=1e50)]
Count = Annotated[int, msgspec.Meta(ge=0)]
Error = Annotated[float, msgspec.Meta(ge=0)]
Times = Annotated[tuple[Time, ...], msgspec.Meta(min_length=1)]
Size = Literal["quick", "full"]
PACKAGES = ("oscillating-mushrooms", "numpy", "scipy", "numba", "llvmlite", "mpmath", "gmpy2")


class Machine(msgspec.Struct, frozen=True):
    """Where it ran; `compiled` holds the command that built each compiled example."""

    processor: str
    cores: int
    system: str
    python: str
    versions: dict[str, str]
    compiled: dict[str, str] = {}


class Drawn(msgspec.Struct, frozen=True):
    """A workload: its scene, numbers of questions and of further steps; `seed` and sizes re-make it."""

    name: str
    what: str
    scene: str
    questions: Count
    further: Count


class Point(msgspec.Struct, frozen=True):
    """A solver on a workload.

    Attributes:
        workload, solver, family: names.
        n_times: how often a timed run took all steps.
        ns: nanoseconds per step of each run.
        right, wrong, undecided, left: numbers of answers: the right wall; another wall or outcome; left
            open; left to another stepper.
        further, astray: how many of the workload's further steps it answered, and how many of them with
            another wall than the trusted stepper; 0, 0 where it was not asked.
        ulps: backward ulps of each right answer; null where only an exact number is right, and it is not.
        relative: its largest relative error.
    """

    workload: str
    solver: str
    family: str
    n_times: Count
    ns: Times
    right: Count
    wrong: Count
    undecided: Count
    left: Count
    further: Count
    astray: Count
    ulps: tuple[Error | None, ...]
    relative: tuple[Error, ...]


class Growth(msgspec.Struct, frozen=True):
    """Errors along trajectories, relative to table and speed, after 1, 2, ... collisions.

    Attributes:
        scene, energy, paths, collisions: what was followed.
        followers: by name the median error over the paths.
        lasts: by name the median number of collisions until no digit is left.
        bound: median of what one backward ulp at each step can grow to, by the chained Jacobians.
        rate: decimals lost per collision, the Lyapunov slope of the chained Jacobians.
    """

    scene: str
    energy: float
    paths: int
    collisions: int
    followers: dict[str, tuple[float, ...]]
    lasts: dict[str, float]
    bound: tuple[float, ...]
    rate: float


class Record(msgspec.Struct, frozen=True):
    """A whole benchmark.

    Attributes:
        format: of this file.
        size, seed, questions, repeats: the settings.
        digits: of the proved answers.
        machine: where it ran.
        workloads, points: what was asked and found.
        not_run: solvers left out, with the reason.
        growth: of errors along trajectories.
        seconds: wall time of all.
    """

    format: int
    size: Size
    seed: int
    questions: int
    repeats: int
    digits: int
    machine: Machine
    workloads: tuple[Drawn, ...]
    points: tuple[Point, ...]
    not_run: dict[str, str]
    growth: Growth
    seconds: float


def quartiles(ns: Sequence[float]) -> tuple[float, float, float]:
    """Return the first quartile, the median and the third quartile of a point's runs."""
    first, middle, third = np.quantile(ns, (0.25, 0.5, 0.75)).tolist()
    return first, middle, third


def short(number: float, digits: int = 4) -> float:
    """Return a number as it is kept: to a few decimals."""
    return float(f"{number:.{digits}g}")


def this_machine(compiled: dict[str, str]) -> Machine:
    """Describe the machine and the packages."""
    return Machine(
        processor=_processor(),
        cores=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        versions={name: version(name) for name in PACKAGES},
        compiled=compiled,
    )


def _processor() -> str:
    # Neither Python nor psutil knows the name of the processor on Linux.
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def encode(record: Record) -> bytes:
    """Return bench.json's bytes."""
    return msgspec.json.format(msgspec.json.encode(record), indent=1) + b"\n"


def read(path: Path) -> Record:
    """Read a bench.json.

    Raises:
        BadInput: naming the file and what is wrong with it.
    """
    try:
        record = msgspec.json.decode(path.read_bytes(), type=Record)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInput(f"{path} is no bench.json: {error}") from None
    if record.format != FORMAT:
        raise BadInput(f"{path}: format = {record.format}, must be {FORMAT}")
    _check_points(record, path)
    return record


def _check_points(record: Record, path: Path) -> None:
    """Refuse a point of an unknown workload, and a second one: which of two holds is unknown."""
    names = [drawn.name for drawn in record.workloads]
    seen: set[tuple[str, str]] = set()
    for point in record.points:
        which = f"{path} is no bench.json: a point of {point.solver!r} on {point.workload!r}"
        if point.workload not in names:
            raise BadInput(f"{which} is of a workload that it does not name")
        if (point.workload, point.solver) in seen:
            raise BadInput(f"{which} stands twice")
        seen.add((point.workload, point.solver))
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise BadInput(f"{path} is no bench.json: workload {twice!r} stands twice")


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of bench.json, published as docs/bench.schema.json."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(Record)}


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2))
