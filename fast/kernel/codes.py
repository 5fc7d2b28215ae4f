"""Numbers that stand for walls, outcomes and tables in compiled code; fast.step names them.

They are numpy integers because numba compiles a function anew for each Python integer passed to it.
"""

import numpy as np

NO_WALL, ARC, BASE, LEFT, RIGHT, FLOOR = np.arange(-1, 5)
N_WALLS = 5
HORIZON, SLIDING, MOUTH_EDGE, ON_CORNER = np.array([10, 20, 21, 22])
FAR_TIME, TOO_MANY, TANGENT, CORNER, EDGE, START, AT_END, TOO_FAR = np.arange(31, 39)
# A refused state moves into the wall that it leaves, or lies beyond a wall: BEYOND plus that wall's code; or
# it is off the wall that it names. ANEW is no end: a particle that cannot go on from where it was kept, and
# is to be followed from its start.
APPROACHING, BEYOND, ANEW, OFF_WALL = np.array([40, 41, 50, 52])
CAP, STEM, MUSHROOM = np.arange(3)
