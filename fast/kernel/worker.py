"""What a thread holds while it follows particles: the scene, its pools, and the loops over lanes.

The loops and the scalar step are compiled each by itself and called by address. numba compiles all that a
function calls into it, again for every caller: a run needs one of eight loops `fly` (by the form of the laws,
and whether the slope stands still), and each caller of the scalar step would hold another copy of it. So
these are compiled once, kept on disk, and called as C calls a function pointer; that costs some nanoseconds
for a pool of lanes. numba converts arguments to the signature that the caller names; `address` checks that
the callee has it, too.

Kernels run in threads, which an interrupt ends. Python hears of an interrupt when a kernel returns, which may
take minutes. So the main thread, where signals are handled, only waits for those that run kernels, and calls
off what they do.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numba import config, typeof, types

from fast.kernel import rows
from fast.kernel.compiling import HOW, caller, kept, widest_registers
from fast.kernel.lane_laws import DEGREES, NO_WAVES, ONE_WAVE, TWO_WAVES
from fast.kernel.lanes import chord, fly
from fast.kernel.numba_internals import address_of, returned_type

from fast.kernel.records import (  # isort: skip
    ANCHORS_SHAPE, Compiled, FloatArray, Followed, IntArray, LaneWaves, LawLimits, LawsInLanes,
    Particle, Stops,
)  # fmt: skip

from fast.kernel.scalar_step import scalar_step

# What the loops and the scalar step take and return, by samples.
_PARTICLE, _TABLE = Particle(*(0.0,) * 6, 0), np.zeros((1, 1))
_SCENE = Compiled(0, False, _TABLE, _TABLE)
_LOOP_TAKES = (np.zeros(1), 0, _SCENE, NO_WAVES, 0.0, LawLimits(*(0.0,) * 8))
STEP = types.none(*map(typeof, _LOOP_TAKES))
_STEP_TAKES = (_PARTICLE, 0.0, 0, _SCENE, _TABLE)
CAREFUL = typeof((0, 0.0, _PARTICLE))(*map(typeof, _STEP_TAKES))

run_step, run_careful = caller(STEP), caller(CAREFUL)


class Loops(NamedTuple):
    """Addresses of the compiled loops that serve a scene; without the compiler, the functions themselves.

    Attributes:
        careful: the scalar step.
        fly: a step of each lane.
        chord: the same for captured particles.
    """

    careful: int
    fly: int
    chord: int


def _loop(step: Callable[..., None], is_slope_moving: bool, form: int) -> Any:
    terms = (0,) * form
    is_waves = form in (ONE_WAVE, TWO_WAVES)

    @kept(step.__name__, is_slope_moving, form, **HOW)
    def loop(
        a: FloatArray, n: int, scene: Compiled, waves: LaneWaves, slope: float, limits: LawLimits
    ) -> None:
        """Take a step of each lane: see fast.kernel.lanes."""
        widest_registers()
        step(a, n, scene, waves if is_waves else None, None if is_slope_moving else slope, terms, limits)

    return loop


# By the form of the laws, and whether the slope moves: a chord does not meet the sides.
FORMS = (ONE_WAVE, TWO_WAVES, *DEGREES)
FLIES = {(moves, form): _loop(fly, moves, form) for moves in (False, True) for form in FORMS}
CHORDS = {form: _loop(chord, False, form) for form in FORMS}


def address(entry: Any, signature: Any) -> Any:
    """Compile an entry, or load it from the disk cache, and return its address.

    Raises:
        TypeError: what it returns is not what the signature says.
    """
    if config.DISABLE_JIT:
        return entry
    entry.compile(signature.args)
    found = returned_type(entry, signature.args)
    if found != signature.return_type:
        raise TypeError(f"{entry.py_func.__name__} returns {found}")
    return address_of(entry, signature.args)


@cache
def careful_at() -> Any:
    """Compile the scalar step, or load it, and return its address."""
    return address(scalar_step, CAREFUL)


@cache
def loops_for(is_slope_moving: bool, form: int) -> Loops:
    """Compile the loops for scenes of such a slope and laws of such a form, or load them."""
    return Loops(careful_at(), address(FLIES[is_slope_moving, form], STEP), address(CHORDS[form], STEP))


CACHE_LINE = 64  # bytes
GENERAL, DISK = np.arange(2)  # pools
# Rows of a roster: each lane's particle, and the number of its next stop.
PARTICLE, NEXT_STOP = np.arange(2)


class Worker(NamedTuple):
    """What one thread needs to follow some particles.

    Attributes:
        laws: the scene, as the lanes know it.
        loops: the compiled loops for laws of this form and such a slope.
        anchors: room for its laws at one time.
        is_laned: the lanes may be used.
        pools: (2, POOL_SIZE) general and disk pool.
        rosters: (2, 2, LANES) their rosters.
        n_held: (2,) number of lanes in use in each.
        stops: when particles are looked at.
        followed: what is filled in.
        n_passed: stops passed before; if any, particles go on from `followed.lanes`.
    """

    laws: LawsInLanes
    loops: Loops
    anchors: FloatArray
    is_laned: bool
    pools: FloatArray
    rosters: IntArray
    n_held: IntArray
    stops: Stops
    followed: Followed
    n_passed: int


def is_known_throughout(in_lanes: LawsInLanes, last: float) -> bool:
    """Tell whether lanes know the laws up to a time; with no end, `set_reference` looks each time."""
    until = in_lanes.pieces.until
    return until > 0.0 and (abs(last) < until or last == np.inf)


def new_pools() -> FloatArray:
    """Return (2, POOL_SIZE) empty pools that begin with a cache line, as then do all their rows.

    numpy begins at any multiple of 16 bytes, and a register that is loaded across two lines takes longer: how
    quick the same loops were hung on where a process happened to put them.
    """
    room = np.zeros(2 * rows.POOL_SIZE + CACHE_LINE // 8)
    first = -room.ctypes.data % CACHE_LINE // 8
    return room[first : first + 2 * rows.POOL_SIZE].reshape(2, rows.POOL_SIZE)


def new_worker(
    in_lanes: LawsInLanes, stops: Stops, followed: Followed, n_passed: int = 0, loops: Loops | None = None
) -> Worker:
    """Return a worker that holds no particle yet; with its scene's loops, or the given ones."""
    return Worker(
        in_lanes,
        loops or loops_for(in_lanes.is_slope_moving, in_lanes.form),
        np.zeros(ANCHORS_SHAPE),
        is_known_throughout(in_lanes, float(stops.times[-1])),
        new_pools(),
        np.zeros((2, 2, rows.LANES), np.int64),
        np.zeros(2, np.int64),
        stops,
        followed,
        n_passed,
    )


LONG = 10_000  # collisions of a path, a millisecond at least: beside them a thread takes no time
LISTENING = 0.1  # seconds from one look for signals to the next
Found = TypeVar("Found")


@contextmanager
def interruptible(n_threads: int, called_off: IntArray) -> Iterator[ThreadPoolExecutor]:
    """Provide threads for kernels that look at `called_off`. An exception sets it, and waits for a look."""
    with ThreadPoolExecutor(n_threads) as pool:
        try:
            yield pool
        except BaseException:
            called_off[0] = 1
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def awaited(future: Future[Found]) -> Found:
    """Return what a kernel in a thread has found.

    It is waited for a little at a time. A signal ends no wait that it comes just before, nor one of this
    thread if it is delivered to another; but between two waits every signal is heard.
    """
    while not future.done():
        wait((future,), LISTENING)
    return future.result()


def follow_path(kernel: Any, given: tuple[Any, ...], n_collisions: int, called_off: IntArray) -> Any:
    """Return what a kernel returns that follows a path: a long one can be interrupted.

    Args:
        kernel: a compiled function, to be called.
        given: its arguments.
        n_collisions: to be followed at most.
        called_off: (1,) what the kernel looks at; set to 1 by an interrupt.
    """
    if n_collisions < LONG:
        return kernel(*given)
    if hasattr(kernel, "compile"):  # without the compiler it has none
        kernel.compile(tuple(map(typeof, given)))  # here, where an interrupt ends that, too
    with interruptible(1, called_off) as pool:
        return awaited(pool.submit(kernel, *given))
