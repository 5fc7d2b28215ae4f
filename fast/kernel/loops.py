"""The loops over lanes and the careful step, each compiled by itself and called by its address.

numba compiles all that a function calls into it, again for every caller: a run needs one of eight loops `fly`
(by the form of the laws, and whether the slope stands still), and whoever takes careful steps would hold
another copy of them. So these are compiled once, kept on disk, and called as C calls a
function pointer; that costs some nanoseconds for a pool of lanes.

numba converts arguments to the signature that the caller names; `address` sees that the callee has it, too.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from numba import config, types
from numba.core.typing import Signature
from numba.core.typing import signature as returns

from fast.kernel.compiling import HOW, caller, kept
from fast.kernel.judged import judged_step
from fast.kernel.lane_laws import NO_WAVES, ONE_WAVE, TWO_WAVES
from fast.kernel.lanes import chord, fly
from fast.kernel.limits import LawLimits
from fast.kernel.pieces import DEGREES
from fast.kernel.records import Compiled, LaneWaves, LawsInLanes, Particle, TableOfLanes
from scene.states import ON_WALL

_WHOLE, _REAL, _TRUTH = types.int64, types.float64, types.boolean
_TABLE = types.float64[:, ::1]
POOL = types.float64[::1]
LIMITS = types.NamedUniTuple(_REAL, len(LawLimits._fields), LawLimits)
SCENE = types.NamedTuple((_WHOLE, _TRUTH, _TABLE, _TABLE), Compiled)
PARTICLE = types.NamedTuple((_REAL,) * 6 + (_WHOLE,), Particle)
TABLE = types.NamedUniTuple(_TRUTH, len(TableOfLanes._fields), TableOfLanes)
WAVES = types.NamedTuple(
    (_REAL, _REAL, *(types.UniTuple(_REAL, len(law)) for law in NO_WAVES[2:])), LaneWaves
)

# Of both loops: the pool, how many lanes, and what the scene is.
STEP = returns(types.none, POOL, _WHOLE, TABLE, WAVES, _REAL, LIMITS)
CAREFUL = returns(types.Tuple((_WHOLE, _REAL, PARTICLE)), PARTICLE, _REAL, _WHOLE, SCENE, _TABLE)

run_step, run_careful = caller(STEP), caller(CAREFUL)


class Loops(NamedTuple):
    """Addresses of the compiled loops that serve a scene; without the compiler, the functions themselves.

    Attributes:
        careful: the careful step.
        fly: a step of each lane.
        chord: the same for captured particles.
    """

    careful: int
    fly: int
    chord: int


@kept(ON_WALL, **HOW)
def careful_step(particle, limit, origin, scene, anchors):
    """Judge a particle as its origin asks, and take a careful step: see fast.kernel.judged."""
    return judged_step(particle, limit, origin, scene, anchors)


def _fly(is_slope_moving, form):
    terms, is_waves = (0,) * form, form in (ONE_WAVE, TWO_WAVES)

    @kept(is_slope_moving, form, **HOW)
    def fly_lanes(a, n, table, waves, slope, limits):
        """See fast.kernel.lanes.fly."""
        fly(a, n, table, waves if is_waves else None, None if is_slope_moving else slope, terms, limits)

    return fly_lanes


def _chord(form):
    terms, is_waves = (0,) * form, form in (ONE_WAVE, TWO_WAVES)

    @kept(form, **HOW)
    def chord_lanes(a, n, table, waves, slope, limits):
        """See fast.kernel.lanes.chord."""
        chord(a, n, table, waves if is_waves else None, slope, terms, limits)

    return chord_lanes


# By the form of the laws, and whether the slope moves.
FORMS = (ONE_WAVE, TWO_WAVES, *DEGREES)
FLIES = {(moves, form): _fly(moves, form) for moves in (False, True) for form in FORMS}
CHORDS = {form: _chord(form) for form in FORMS}


def address(entry: Any, signature: Signature) -> Any:
    """Compile an entry, or load it from the disk cache, and return its address.

    Raises:
        TypeError: what it returns is not what the signature says.
    """
    if config.DISABLE_JIT:
        return entry
    entry.compile(signature.args)
    found = entry.overloads[signature.args]
    if found.signature.return_type != signature.return_type:
        raise TypeError(f"{entry.py_func.__name__} returns {found.signature.return_type}")
    return found.library.get_pointer_to_function(found.fndesc.llvm_func_name)


@cache
def careful_at() -> Any:
    """Compile the careful step, or load it, and return its address."""
    return address(careful_step, CAREFUL)


@cache
def loops_for(is_slope_moving: bool, form: int) -> Loops:
    """Compile the loops for scenes of such a slope and laws of such a form, or load them."""
    return Loops(careful_at(), address(FLIES[is_slope_moving, form], STEP), address(CHORDS[form], STEP))


def loops_of(in_lanes: LawsInLanes) -> Loops:
    """Return the compiled loops that serve a scene."""
    return loops_for(in_lanes.slope is None, in_lanes.degree)
