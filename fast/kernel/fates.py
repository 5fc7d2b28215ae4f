"""What a particle's step or path ends in, in place of a collision: one enum for kernels and for users.

A kernel hands back the `code` of a wall, or of a `Fate`. A fate's value is the message that a user reads, and
`outcome` is the class of the answer that carries it. Walls have codes below every fate's.
"""

from __future__ import annotations

from enum import Enum
from typing import Any

from scene.states import Horizon, Rejected, Undecided, Undefined

MAX_PARABOLAS = 1_000_000  # sub-intervals in which the scalar step looks for a hit
MOST_TO_A_TIME = 10**7  # collisions of one particle on the way to a given time: some seconds of work


class Fate(Enum):
    """Why a particle met no wall.

    Attributes:
        code: what kernels hand back; from HORIZON's on, in any order.
        outcome: the class of the answer.
    """

    code: int
    outcome: type[Any]

    def __new__(cls, code: int, outcome: type[Any], message: str) -> Fate:
        """Return a member whose value is its message."""
        member = object.__new__(cls)
        member._value_ = message
        member.code = code
        member.outcome = outcome
        return member

    HORIZON = 10, Horizon, "no wall is met before t_end"

    SLIDING = 20, Undefined, "sliding"
    MOUTH_EDGE = 21, Undefined, "mouth-edge"
    CORNER = 22, Undefined, "corner"

    TOO_LATE = (
        31,
        Undecided,
        "too late: at the highest harmonic a phase exceeds 2^27 quarter turns, which binary64 cannot resolve",
    )
    TOO_MANY_PARABOLAS = 32, Undecided, f"no hit within {MAX_PARABOLAS} sub-intervals"
    NEAR_TANGENCY = 33, Undecided, "f and f' vanish together within rounding"
    NEAR_CORNER = 34, Undecided, "two walls are hit together within rounding"
    NEAR_MOUTH_EDGE = 35, Undecided, "the mouth's edge is hit within rounding"
    NEAR_START = 36, Undecided, "the state is on another wall within rounding"
    NEAR_HORIZON = 37, Undecided, "a wall is hit at the horizon within rounding"
    TOO_FAR = 38, Undecided, f"t_end is over {MOST_TO_A_TIME:.0e} collisions away"
    ANSWER_LOST = (
        39,
        Undecided,
        "the answer holds a number beyond binary64: every one must be 0 or 2^-1022 to 2^1023",
    )

    APPROACHING = 40, Rejected, "state.wall: the particle starts on a wall and moves into it"
    # BEYOND_ARC plus the code of another wall names that wall.
    BEYOND_ARC = 41, Rejected, "the state is beyond the arc"
    BEYOND_BASE = 42, Rejected, "the state is beyond the base"
    BEYOND_LEFT = 43, Rejected, "the state is beyond the left side"
    BEYOND_RIGHT = 44, Rejected, "the state is beyond the right side"
    BEYOND_FLOOR = 45, Rejected, "the state is beyond the floor"
    OFF_WALL = 52, Rejected, "the state is away from the wall that it names"
    BAD_QUESTION = 53, Rejected, "a number of the state or t_end is out of range"
    # No end: a particle cannot go on from where it was kept, and is followed from its start.
    FOLLOW_ANEW = 54, Undecided, "the particle is followed again from its start"


FATES = {fate.code: fate for fate in Fate}
