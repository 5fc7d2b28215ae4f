"""Baselines: what most people would write, as solvers.

Event-driven, with Newton's method for each wall and no checks: in C and in scalar numba. By fixed time steps,
in C: move by dt, and where the new place is outside put it back on the wall and reflect. All answer many
questions in one call and are timed as the lanes are, on flights that go on from a workload's questions.

`python -m conformance.bench.baselines NAME` puts one behind protocol 1, to be graded like any other.
Baselines refuse nothing but what the protocol's decoder refuses: what their own code makes of a state is what
the suite shall see. Flow is their steps, one after the other.

Every law is a row of LAW_LENGTH numbers: kind, n, mean, omega, then pairs: amplitudes (cos, sin) of
k = 1, 2, ... n, or n knots (time, value). A state is t, x, y, vx, vy, the wall being left.
"""

from __future__ import annotations

import ctypes
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from conformance import plain
from conformance.bench import numba_stepper as numba
from conformance.bench.solvers import Family, Given, Solver, SolverRun
from conformance.bench.time_stepping import TOLERANCES, next_collision_by
from conformance.bench.workloads import SINGLE_STEPS, WINDOW, Workload
from conformance.harness import examples
from conformance.suite.process import Trouble
from scene import (
    BadInput,
    BangBang,
    Cap,
    Collision,
    Fourier,
    Horizon,
    Law,
    Mushroom,
    Outcome,
    Scene,
    State,
    Stem,
)
from scene.geometry import rounded
from scene.laws import frequency
from scene.protocol.wire import serve
from scene.states import Stepper
from scene.tables import laws, width_factors

FloatArray = npt.NDArray[np.float64]
SOURCE = Path(__file__).parent / "baselines.c"
PARTS = (10, 100, 1000)  # time steps in a flight
WALLS = Mushroom.walls
LAW_LENGTH, PAIRS = 516, 4
FLAGS = ("-O3", "-march=native")  # for the C compiler
MOST = 10 * int(WINDOW)  # collisions of a particle: one that hops along the arc would never end


class Questions(NamedTuple):
    """States of a scene as arrays: `laws` (5, LAW_LENGTH), `states` (N, 6); `length` of a flight."""

    table: int
    laws: FloatArray
    length: float
    states: FloatArray


class Engine(NamedTuple):
    """A compiled baseline.

    Attributes:
        hits: returns dt, t, x, y, vx, vy, wall of each state's next collision, (N, 7).
        follow: (questions, t_end, most, n_times) -> collisions and seconds of following each state, so many
            times, to t_end or for `most` collisions.
    """

    hits: Callable[[Questions], FloatArray]
    follow: Callable[[Questions, float, int, int], tuple[int, float]]


class _Method(ctypes.Structure):
    """How the C file is to step; fields as there."""

    _fields_ = (
        ("laws", ctypes.c_void_p),
        ("table", ctypes.c_int),
        ("parts", ctypes.c_int),
        ("length", ctypes.c_double),
    )


def c_engine(library: Path, parts: int = 0) -> Engine:
    """Return the compiled C file, event-driven (0 parts) or by so many time steps to a flight.

    The seconds are those of the C code's own clock.
    """
    compiled = ctypes.CDLL(str(library))
    count, place = ctypes.c_long, ctypes.c_void_p
    compiled.next_hits.argtypes = (place, count, place, place)
    compiled.follow.argtypes = (place, count, place, ctypes.c_double, count, count, place)
    compiled.follow.restype = ctypes.c_double

    def asked(q: Questions) -> tuple[Any, int, int]:
        method = _Method(q.laws.ctypes.data, q.table, parts, q.length)
        return ctypes.byref(method), len(q.states), q.states.ctypes.data

    def hits(q: Questions) -> FloatArray:
        found = np.empty((len(q.states), 7))
        compiled.next_hits(*asked(q), found.ctypes.data)
        return found

    def follow(q: Questions, t_end: float, most: int, n_times: int) -> tuple[int, float]:
        n_hits = ctypes.c_long()
        seconds = compiled.follow(*asked(q), t_end, most, n_times, ctypes.byref(n_hits))
        return n_hits.value, seconds

    return Engine(hits, follow)


def numba_engine() -> Engine:
    """Return the event-driven stepper in numba; the seconds contain the call, not the compilation."""

    def hits(q: Questions) -> FloatArray:
        found = np.empty((len(q.states), 7))
        numba.next_hits(q.laws, q.table, q.states, found)
        return found

    def follow(q: Questions, t_end: float, most: int, n_times: int) -> tuple[int, float]:
        numba.follow(q.laws, q.table, q.states[:0], t_end, most, n_times)
        begin = time.perf_counter()
        n_hits = numba.follow(q.laws, q.table, q.states, t_end, most, n_times)
        return n_hits, time.perf_counter() - begin

    return Engine(hits, follow)


def build(folder: Path, flags: Sequence[str]) -> tuple[Path, str]:
    """Compile the C file.

    Args:
        folder: where the library goes.
        flags: for the C compiler.

    Returns:
        The library, and the line that compiled it, paths left out.

    Raises:
        Trouble: there is no compiler, or it fails.
    """
    library = folder / "baselines.so"
    built = examples.compiled("C", [*flags, "-std=gnu11", "-shared", "-fPIC"], SOURCE, library, ["-lm"])
    if built.why_not:
        raise Trouble("unsupported" if built.is_absent else "error", built.why_not)
    return library, built.built


def in_c(library: Path) -> list[Solver]:
    """Return the solvers that the compiled C file holds."""
    return [
        _solver("lean C", "lean", c_engine(library)),
        *(_solver(f"steps, flight/{n}", "fixed-step", c_engine(library, n), 10 * WINDOW / n) for n in PARTS),
    ]


def in_numba() -> Solver:
    """Return the scalar stepper in numba."""
    return _solver("lean numba", "lean", numba_engine())


def stepper(solver: Solver) -> Stepper:
    """Return a baseline as a stepper of one state, taken as it is; t_end alone ends a flight."""
    assert solver.steps is not None
    steps = solver.steps

    def step(scene: Scene, state: State, t_end: float) -> Outcome:
        (met,) = steps(scene, [state])
        if isinstance(met, Collision) and met.t < t_end:
            return met
        left = t_end - state.t
        return Horizon(t_end, state.x + left * state.vx, state.y + left * state.vy, state.vx, state.vy)

    return step


def _solver(name: str, family: Family, engine: Engine, flights: float = WINDOW) -> Solver:
    def steps(scene: Scene, states: Sequence[State]) -> list[Given]:
        return [_outcome(row) for row in engine.hits(questions(scene, states)).tolist()]

    def run(workload: Workload, n_times: int) -> SolverRun:
        states = [q.state for q in workload.questions]
        followed, t_end, most = states, workload.end(flights), MOST
        if workload.length:
            followed, t_end, most = states[:1], np.inf, workload.length
        n_hits, seconds = engine.follow(questions(workload.scene, followed), t_end, most, n_times)
        if not n_hits:
            raise Trouble("fail", "it meets no wall")
        return SolverRun(seconds / n_hits * 1e9, steps(workload.scene, states), seconds * 1e9)

    serves = SINGLE_STEPS if family == "fixed-step" else (*SINGLE_STEPS, "one-path")
    return Solver(name, family, run, serves, steps)


def _outcome(row: list[float]) -> Given:
    *numbers, wall = row
    return Horizon(*numbers[1:]) if wall == numba.NONE else Collision(WALLS[int(wall)], *numbers)


def questions(scene: Scene, states: Sequence[State]) -> Questions:
    """Return a scene and states as the engines take them."""
    given = laws(scene)
    width = (0.0,) if isinstance(scene, Cap) else width_factors(scene)
    rows = [given.get("r", 0.0), width[0], width[1] if len(width) > 1 else 1.0]
    rows += [given.get("h", 0.0), given.get("slope", 0.0)]
    table = numba.CAP if isinstance(scene, Cap) else numba.STEM if isinstance(scene, Stem) else numba.MUSHROOM
    starts = [(s.t, s.x, s.y, s.vx, s.vy, WALLS.index(s.wall) if s.wall else numba.NONE) for s in states]
    length = float(rounded(scene, states[0].t).size)
    return Questions(table, np.array([_row(law) for law in rows]), length, np.array(starts, dtype=float))


def _row(law: Law) -> FloatArray:
    row, pairs = np.zeros(LAW_LENGTH), list[tuple[float, float]]()
    if isinstance(law, BangBang):
        row[0], pairs = numba.BANG_BANG, list(law.knots)
    elif isinstance(law, Fourier):
        row[0], row[2], row[3] = numba.FOURIER, law.mean, float(frequency(fp, law))
        pairs = list(zip_longest(law.cos, law.sin, fillvalue=0.0))
    else:
        row[0], row[2] = numba.CONSTANT, law
    row[1] = len(pairs)
    row[PAIRS : PAIRS + 2 * len(pairs)] = np.ravel(pairs)
    return row


def _built(name: str) -> Stepper:
    with tempfile.TemporaryDirectory() as folder:  # the library stays loaded
        library, _ = build(Path(folder), FLAGS)
        return stepper(next(one for one in in_c(library) if one.name == name))


NAMES: dict[str, Callable[[], Stepper]] = {
    "lean-c": partial(_built, "lean C"),
    "lean-numba": lambda: stepper(in_numba()),
    **{f"steps-{parts}": partial(_built, f"steps, flight/{parts}") for parts in PARTS},
    **{f"solve-ivp-{rtol:.0e}": partial(next_collision_by, rtol) for rtol in TOLERANCES},
}


def main(arguments: Sequence[str]) -> None:
    """Speak protocol 1 as the baseline of that name.

    Raises:
        BadInput: there is no such baseline.
        Trouble: it cannot be built here.
    """
    name = arguments[0] if len(arguments) == 1 else ""
    if name not in NAMES:
        raise BadInput(f"NAME = {name!r}, must be one of {', '.join(NAMES)}")
    step = NAMES[name]()
    follow, carry = partial(plain.trajectory, step=step), partial(plain.flow, step=step)
    serve(name, step, follow, sys.stdin.buffer, sys.stdout.buffer, flow=carry)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except BadInput as error:
        sys.exit(f"conformance.bench.baselines: {error}")
