"""Baselines: what most people would write, as solvers.

In C: event-driven, with Newton's method for each wall and no checks; and by fixed time steps: move by dt, and
where the new place is outside put it back on the wall and reflect. Both answer many questions in one call
and are timed as the lanes are, on flights that go on from a workload's questions. In Python: the plain
stepper, and scipy's `solve_ivp` with events.

`python -m conformance.bench.baselines NAME` puts one behind protocol 1, to be graded like any other.
Baselines refuse nothing but what the protocol's decoder refuses: what their own code makes of a state is what
the suite shall see. Flow is their steps, one after the other.

Every law is a row of LAW_LENGTH numbers: kind, n, mean, omega, then pairs: amplitudes (cos, sin) of
k = 1, 2, ... n, or n knots (time, value). A state is t, x, y, vx, vy, the wall being left.
"""

import ctypes
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp
from scipy.integrate import solve_ivp

from conformance import plain
from conformance.bench.solvers import Family, Solver, SolverAnswer, SolverRun, by_call
from conformance.bench.workloads import FLIGHTS, SINGLE_STEPS, Workload
from conformance.harness import examples
from conformance.suite.process import CheckFailure
from scene import (
    BadInput,
    BangBang,
    Cap,
    Collision,
    Constant,
    Fourier,
    Horizon,
    Law,
    Mushroom,
    Outcome,
    Scene,
    State,
    Stem,
    Undecided,
    Wall,
)
from scene.geometry import rounded, table_at
from scene.protocol.wire import serve
from scene.states import Stepper

FloatArray = npt.NDArray[np.float64]
SOURCE = Path(__file__).parent / "baselines.c"
TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)  # of solve_ivp
PARTS = (10, 100, 1000)  # time steps in a flight
WALLS = Mushroom.walls
LAW_LENGTH, PAIRS = 516, 4
# By the numbers that `baselines.c` knows them by: no wall, the tables, and the kinds of laws.
NONE = 5
CAP, STEM, MUSHROOM = range(3)
CONSTANT, FOURIER, BANG_BANG = range(3)
FLAGS = ("-O3", "-march=native")  # for the C compiler
MOST = 10 * int(FLIGHTS)  # collisions of a particle: one that meets the arc again and again would never end


class Questions(NamedTuple):
    """States of a scene as arrays: `laws` (5, LAW_LENGTH), `states` (N, 6); `length` of a flight."""

    table: int
    laws: FloatArray
    length: float
    states: FloatArray


class _Method(ctypes.Structure):
    """How the C file is to step; fields as there."""

    _fields_ = (
        ("laws", ctypes.c_void_p),
        ("table", ctypes.c_int),
        ("parts", ctypes.c_int),
        ("length", ctypes.c_double),
    )


class Engine:
    """The compiled C file, event-driven (0 parts) or by so many time steps to a flight."""

    def __init__(self, library: Path, parts: int = 0) -> None:
        self._compiled, self._parts = ctypes.CDLL(str(library)), parts
        count, place = ctypes.c_long, ctypes.c_void_p
        self._compiled.next_hits.argtypes = (place, count, place, place)
        self._compiled.follow.argtypes = (place, count, place, ctypes.c_double, count, count, place)
        self._compiled.follow.restype = ctypes.c_double

    def hits(self, asked: Questions) -> FloatArray:
        """Return dt, t, x, y, vx, vy, wall of each state's next collision, (N, 7)."""
        found = np.empty((len(asked.states), 7))
        self._compiled.next_hits(*self._asked(asked), found.ctypes.data)
        return found

    def follow(self, asked: Questions, t_end: float, most: int, n_times: int) -> tuple[int, float]:
        """Follow each state, so many times, to t_end or for `most` collisions.

        Returns:
            Collisions, and seconds by the C code's own clock.
        """
        n_hits = ctypes.c_long()
        seconds = self._compiled.follow(*self._asked(asked), t_end, most, n_times, ctypes.byref(n_hits))
        return n_hits.value, seconds

    def _asked(self, q: Questions) -> tuple[Any, int, int]:
        method = _Method(q.laws.ctypes.data, q.table, self._parts, q.length)
        return ctypes.byref(method), len(q.states), q.states.ctypes.data


def build(folder: Path, flags: Sequence[str]) -> tuple[Path, str]:
    """Compile the C file.

    Args:
        folder: where the library goes.
        flags: for the C compiler.

    Returns:
        The library, and the line that compiled it, paths left out.

    Raises:
        CheckFailure: there is no compiler, or it fails.
    """
    library = folder / "baselines.so"
    built = examples.compiled("C", [*flags, "-std=gnu11", "-shared", "-fPIC"], SOURCE, library, ["-lm"])
    if built.why_not:
        raise CheckFailure("unsupported" if built.is_absent else "error", built.why_not)
    return library, built.built


def in_c(library: Path) -> list[Solver]:
    """Return the solvers that the compiled C file holds."""
    return [
        _solver("lean C", "lean", Engine(library)),
        *(_solver(f"steps, flight/{n}", "fixed-step", Engine(library, n), 10 * FLIGHTS / n) for n in PARTS),
    ]


def _solver(name: str, family: Family, engine: Engine, flights: float = FLIGHTS) -> Solver:
    def steps(scene: Scene, states: Sequence[State]) -> list[SolverAnswer]:
        return [_outcome(row) for row in engine.hits(questions(scene, states)).tolist()]

    def run(workload: Workload, n_times: int) -> SolverRun:
        states = [q.state for q in workload.questions]
        followed, t_end, most = states, workload.end(flights), MOST
        if workload.rule.length:
            followed, t_end, most = states[:1], np.inf, workload.rule.length
        n_hits, seconds = engine.follow(questions(workload.scene, followed), t_end, most, n_times)
        if not n_hits:
            raise CheckFailure("fail", "it meets no wall")
        return SolverRun(seconds / n_hits * 1e9, steps(workload.scene, states), seconds * 1e9)

    serves = SINGLE_STEPS if family == "fixed-step" else (*SINGLE_STEPS, "one-path")
    return Solver(name, family, run, serves, steps)


def _outcome(row: list[float]) -> SolverAnswer:
    *numbers, wall = row
    return Horizon(*numbers[1:]) if wall == NONE else Collision(WALLS[int(wall)], *numbers)


def questions(scene: Scene, states: Sequence[State]) -> Questions:
    """Return a scene and states as the engines take them."""
    width = (*scene.width.factors, Constant(1.0))[:2]
    r, h, slope = (scene.laws.get(name, Constant(0.0)) for name in ("r", "h", "slope"))
    table = CAP if isinstance(scene, Cap) else STEM if isinstance(scene, Stem) else MUSHROOM
    starts = [(s.t, s.x, s.y, s.vx, s.vy, WALLS.index(s.wall) if s.wall else NONE) for s in states]
    length = float(rounded(scene, states[0].t).size)
    return Questions(
        table, np.array([_row(law) for law in (r, *width, h, slope)]), length, np.array(starts, dtype=float)
    )


def _row(law: Law) -> FloatArray:
    """Lay out a law for the engines in C. Nothing else here asks for its kind."""
    row, pairs = np.zeros(LAW_LENGTH), list[tuple[float, float]]()
    if isinstance(law, BangBang):
        row[0], pairs = BANG_BANG, list(law.knots)
    elif isinstance(law, Fourier):
        row[0], row[2], row[3] = FOURIER, law.mean, float(law.frequency(fp))
        pairs = list(zip_longest(law.cos, law.sin, fillvalue=0.0))
    elif law.is_constant:
        row[0], row[2] = CONSTANT, law.level
    else:
        raise TypeError(f"{type(law).__name__}: the engines in C do not know this kind of law")
    row[1] = len(pairs)
    row[PAIRS : PAIRS + 2 * len(pairs)] = np.ravel(pairs)
    return row


def next_collision_by(rtol: float) -> Callable[[Scene, State, float], Outcome]:
    """Return a stepper that integrates the free flight by solve_ivp to a tolerance, relative and absolute.

    An event is a change of sign between the ends of an integrator's step, refined by Brent's method. The free
    flight has no error that the step control could see, so steps grow until they skip what happens within
    them; and at the start on a wall the sign is that of a rounding error. Both are what such codes do.
    """

    def step(scene: Scene, state: State, t_end: float) -> Outcome:
        part = "cap" if plain.Flight(scene, state, t_end).is_in_cap else "stem"
        t, q = state.t, np.array([state.x, state.y, state.vx, state.vy])
        while True:
            walls: tuple[Wall, ...] = ("arc", "base") if part == "cap" else ("left", "right", "floor", "base")
            events = [_event(scene, part, wall) for wall in walls]
            found = solve_ivp(
                lambda _, q: [q[2], q[3], 0.0, 0.0], (t, t_end), q, rtol=rtol, atol=rtol, events=events
            )
            if found.status == 0:
                return Horizon(t_end, *map(float, found.y[:, -1]))
            if found.status != 1:
                return Undecided(str(found.message))
            wall = next(name for name, times in zip(walls, found.t_events, strict=True) if len(times))
            t, q = float(found.t[-1]), found.y[:, -1]
            is_open = part == "stem" or abs(q[0]) < float(table_at(fp, scene, t).w)
            if wall == "base" and isinstance(scene, Mushroom) and is_open:
                part = "stem" if part == "cap" else "cap"
                q[1] = 0.0
                continue
            velocity = plain.Flight(scene, State(t, *q.tolist()), t).bounce(wall, 0.0)
            return Collision(wall, t - state.t, t, float(q[0]), float(q[1]), *velocity)

    return step


def _event(scene: Scene, part: str, wall: Wall) -> Any:
    """Return when a wall's f, or y = 0 where a part of the table ends, is passed from inside."""

    def event(t: float, q: FloatArray) -> float:
        if wall == "base":
            return float(q[1]) if part == "cap" else -float(q[1])
        return float(table_at(fp, scene, t).gap(wall, *q[:2].tolist()))

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event


def in_python() -> list[Solver]:
    """Return the plain stepper, and solve_ivp at several tolerances."""
    integrators = {f"solve_ivp, rtol {rtol:.0e}": next_collision_by(rtol) for rtol in TOLERANCES}
    return [
        by_call("plain Python", "interpreted", plain.next_collision),
        *(by_call(name, "time-stepping", step) for name, step in integrators.items()),
    ]


def _built(parts: int) -> Stepper:
    """Build the C file; return it as a stepper of one state, taken as it is. t_end alone ends a flight."""
    with tempfile.TemporaryDirectory() as folder:
        engine = Engine(build(Path(folder), FLAGS)[0], parts)  # the library stays loaded

    def step(scene: Scene, state: State, t_end: float) -> Outcome:
        met = _outcome(engine.hits(questions(scene, [state]))[0].tolist())
        if isinstance(met, Collision) and met.t < t_end:
            return met
        left = t_end - state.t
        return Horizon(t_end, state.x + left * state.vx, state.y + left * state.vy, state.vx, state.vy)

    return step


NAMES: dict[str, Callable[[], Stepper]] = {
    "lean-c": partial(_built, 0),
    **{f"steps-{parts}": partial(_built, parts) for parts in PARTS},
    **{f"solve-ivp-{rtol:.0e}": partial(next_collision_by, rtol) for rtol in TOLERANCES},
}


def main(arguments: Sequence[str]) -> None:
    """Speak protocol 1 as the baseline of that name.

    Raises:
        BadInput: there is no such baseline.
        CheckFailure: it cannot be built here.
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
