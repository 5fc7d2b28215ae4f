"""The loops over lanes and the careful step, each compiled by itself and called by its address.

numba compiles all that a function calls into it, again for every caller: a run needs one of four loops `fly`
(laws that are parabolas or longer series, a slope that stands still or moves), and whoever takes careful
steps would hold another copy of them. So these are compiled once, kept on disk, and called as C calls a
function pointer; that costs some nanoseconds for a pool of lanes.

numba converts arguments to the signature that the caller names; `address` sees that the callee has it, too.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from numba import config, types
from numba.core.typing import Signature
from numba.core.typing import signature as returns

from fast.kernel.aiming import aim
from fast.kernel.bounces import bounce, rebound
from fast.kernel.compiling import HOW, caller, kept
from fast.kernel.judged import judged_step
from fast.kernel.lanes import chord, fly
from fast.kernel.limits import LawLimits
from fast.kernel.pieces import DEGREES
from fast.kernel.records import Compiled, LawsInLanes, Particle
from scene.states import ON_WALL

_WHOLE, _REAL, _TRUTH = types.int64, types.float64, types.boolean
_TABLE = types.float64[:, ::1]
POOL = types.float64[::1]
LIMITS = types.NamedUniTuple(_REAL, len(LawLimits._fields), LawLimits)
SCENE = types.NamedTuple((_WHOLE, _TRUTH, _TABLE, _TABLE), Compiled)
PARTICLE = types.NamedTuple((_REAL,) * 6 + (_WHOLE,), Particle)

AIM = returns(types.none, POOL, _WHOLE, _TRUTH, _REAL, LIMITS)
FLY = returns(types.none, POOL, _WHOLE, _TRUTH, _TRUTH, _REAL, LIMITS)
CHORD = returns(types.none, POOL, _WHOLE, _TRUTH, _TRUTH, _TRUTH, LIMITS)
BOUNCE = returns(types.none, POOL, _WHOLE, _REAL, _TRUTH)
REBOUND = returns(types.none, POOL, _WHOLE)
CAREFUL = returns(types.Tuple((_WHOLE, _REAL, PARTICLE)), PARTICLE, _REAL, _WHOLE, SCENE, _TABLE)

run_aim, run_fly, run_chord = caller(AIM), caller(FLY), caller(CHORD)
run_bounce, run_rebound, run_careful = caller(BOUNCE), caller(REBOUND), caller(CAREFUL)


class Loops(NamedTuple):
    """Addresses of the compiled loops that serve a scene; without the compiler, the functions themselves.

    Attributes:
        careful: the careful step.
        aim, fly: choose each lane's next wall and time; correct and check them.
        chord: the same for captured particles.
        bounce, rebound: what the collision does.
    """

    careful: int
    aim: int
    fly: int
    chord: int
    bounce: int
    rebound: int


@kept(ON_WALL, **HOW)
def careful_step(particle, limit, origin, scene, anchors):
    """Judge a particle as its origin asks, and take a careful step: see fast.kernel.judged."""
    return judged_step(particle, limit, origin, scene, anchors)


def _aim(is_slope_moving):
    @kept(is_slope_moving, **HOW)
    def aim_lanes(a, n, is_stem, slope, limits):
        """See fast.kernel.aiming.aim."""
        aim(a, n, is_stem, None if is_slope_moving else slope, limits)

    return aim_lanes


def _fly(is_slope_moving, degree):
    terms = (0,) * degree

    @kept(is_slope_moving, degree, **HOW)
    def fly_lanes(a, n, is_stem, is_relative, slope, limits):
        """See fast.kernel.lanes.fly."""
        fly(a, n, is_stem, is_relative, None if is_slope_moving else slope, terms, limits)

    return fly_lanes


def _chord(degree):
    terms = (0,) * degree

    @kept(degree, **HOW)
    def chord_lanes(a, n, is_again, is_cap, is_relative, limits):
        """See fast.kernel.lanes.chord."""
        chord(a, n, is_again, is_cap, is_relative, terms, limits)

    return chord_lanes


def _bounce(is_slope_moving):
    @kept(is_slope_moving, **HOW)
    def bounce_lanes(a, n, slope, is_mushroom):
        """See fast.kernel.bounces.bounce."""
        bounce(a, n, None if is_slope_moving else slope, is_mushroom)

    return bounce_lanes


@kept(**HOW)
def rebound_lanes(a, n):
    """See fast.kernel.bounces.rebound."""
    rebound(a, n)


# By degree of the laws, and whether the slope moves.
AIMS = {moves: _aim(moves) for moves in (False, True)}
FLIES = {(moves, degree): _fly(moves, degree) for moves in (False, True) for degree in DEGREES}
CHORDS = {degree: _chord(degree) for degree in DEGREES}
BOUNCES = {moves: _bounce(moves) for moves in (False, True)}


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
def loops_for(is_slope_moving: bool, degree: int) -> Loops:
    """Compile the loops for scenes of such a slope and laws of such a degree, or load them."""
    return Loops(
        careful_at(),
        address(AIMS[is_slope_moving], AIM),
        address(FLIES[is_slope_moving, degree], FLY),
        address(CHORDS[degree], CHORD),
        address(BOUNCES[is_slope_moving], BOUNCE),
        address(rebound_lanes, REBOUND),
    )


def loops_of(in_lanes: LawsInLanes) -> Loops:
    """Return the compiled loops that serve a scene."""
    return loops_for(in_lanes.slope is None, in_lanes.degree)
