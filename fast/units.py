"""Units of length and time, powers of two chosen for a scene, in which the kernels work.

A scene is brought to about one size and one period before any arithmetic, and answers are brought back. Two
scenes that differ by powers of two of length and time are then one and the same to the kernels, so that their
answers are the same bits, scaled; and no square overflows or vanishes but that of a state 2^300 times faster
or slower than its table, which is refused. A static table has no time of its own: there the unit of time
makes each state's speed what it should be.

Every change of units is exact or refused: scaling by a power of two loses bits only where numbers become
subnormal or infinite. The kernel's sizes are well above 1 (2^96 for a length, 2^32 for a time) so that the
least of all floats, beside a table of common size, comes in exactly too. `compile_scene` lays out a scene as
the numbers that the kernels read.
"""

import math
import sys
from copy import copy
from typing import NamedTuple

import msgspec
import numpy as np

from fast.kernel import records
from fast.kernel.fates import Fate
from fast.kernel.laws import omega_of, row_of
from fast.kernel.single import LARGEST, LENGTH, TIME

from fast.kernel.records import (  # isort: skip
    FOURIER, KIND, N_HARMONICS, OMEGA, OMEGA_LOW, SHARED, BoolArray, Compiled,
    FloatArray, IntArray,
)  # fmt: skip
from scene import BadInput, InvalidScene, InvalidState, Law, Scene, State
from scene.laws import Constant, times_power

ABSENT = Constant(0.0)  # a law that a table does not have
TABLES = {"Cap": int(records.CAP), "Stem": int(records.STEM), "Mushroom": int(records.MUSHROOM)}


def compile_scene(scene: Scene) -> Compiled:
    """Lay out a valid scene for the kernel.

    Raises:
        BadInput: a length, speed or acceleration of a wall is 2^400 or more: squares would overflow.
    """
    try:
        compiled = _laid_out(scene)
    except OverflowError:
        raise BadInput("scene: a wall's acceleration overflows, must be below 2^400") from None
    for name, row in zip(("r", "w", "h", "slope"), compiled.bounds, strict=True):
        for what, size in zip(("least value", "greatest value", "speed", "acceleration"), row, strict=True):
            if not abs(size) < LARGEST:
                raise BadInput(f"scene.{name}: {what} {size:.3g}, must be below 2^400 in size")
    return compiled


def _laid_out(scene: Scene) -> Compiled:
    r, h, slope = (scene.laws.get(name, ABSENT) for name in ("r", "h", "slope"))
    width = scene.width
    rows = [row_of(law) for law in (r, width.factors[0], h, slope)]
    table = np.zeros((len(rows) + 1, max(OMEGA_LOW + 1, *(len(row) for row in rows))))
    for i, row in enumerate(rows):
        table[i, : len(row)] = row
    waves = [row for row in rows if row[KIND] == FOURIER]
    if waves:
        assert scene.cycle is not None
        table[SHARED, OMEGA], table[SHARED, OMEGA_LOW] = omega_of(scene.cycle)
        table[SHARED, N_HARMONICS] = max(row[N_HARMONICS] for row in waves)
    limits = np.array([r.size_bounds(), width.size_bounds(), h.size_bounds(), slope.bounds()])
    return Compiled(TABLES[type(scene).__name__], len(width.factors) == 2, table, limits)


class LateTime(InvalidState):
    """A time that is too large beside the table's period: good input, which this stepper cannot answer."""


class Units(NamedTuple):
    """A kernel's length times 2^length is the scene's, and a kernel's time times 2^time.

    Attributes:
        length, time: the exponents, for one scene and state.
    """

    length: int
    time: int

    def numbers(self, state: State) -> list[float]:
        """Return t, x, y, vx, vy of a state in the kernel's units.

        Raises:
            InvalidState: it is too fast or too slow for its table, or loses bits beside the table's size.
        """
        exponents = zip(("t", "x", "y", "vx", "vy"), self.of_step()[1:].tolist(), strict=True)
        inner = {name: inward(f"state.{name}", getattr(state, name), e) for name, e in exponents}
        for name in ("x", "y", "vx", "vy"):
            if not abs(inner[name]) <= LARGEST:
                raise InvalidState(
                    f"state.{name} = {getattr(state, name)!r}, must be below 2^400 in size beside the table's"
                    " size and period"
                )
        fastest = max(abs(inner["vx"]), abs(inner["vy"]))
        if 0.0 < fastest < 1.0 / LARGEST:
            raise InvalidState(
                f"speed = {max(abs(state.vx), abs(state.vy))!r}, must be 0 or at least 2^-400 beside the"
                " table's size and period"
            )
        return list(inner.values())

    def horizon(self, t_end: float) -> float:
        """Return a horizon, which may be infinite, in the kernel's units.

        One beyond all floats becomes the largest of them: whatever moves meets a wall long before.
        """
        if math.isfinite(t_end) and math.isinf(times_power(t_end, -self.time)):
            return math.copysign(sys.float_info.max, t_end)
        return inward("t_end", t_end, self.time)

    def of_step(self) -> IntArray:
        """Return the exponents of dt, t, x, y, vx, vy, each times a power of two in the kernel."""
        speed = self.length - self.time
        return np.array([self.time, self.time, self.length, self.length, speed, speed])

    def of_energy(self) -> int:
        """Return the exponent of an energy, the square of a speed."""
        return 2 * (self.length - self.time)


def units_of(scene: Scene) -> tuple[int, int | None]:
    """Return the exponents of a scene's units of length and time; None for the time of a static table."""
    sizes = [law.level for name, law in scene.laws.items() if name in ("r", "w", "h")]
    length = exponent(max(sizes)) - LENGTH
    cycle = scene.cycle
    if cycle is None:
        return length, None
    if cycle.omega is not None:
        return length, -exponent(cycle.omega) - TIME
    assert cycle.length is not None  # a float, as the scene has found
    return length, exponent(float(cycle.length)) - TIME


def in_units(scene: Scene, length: int, time: int) -> Scene:
    """Return a scene with its lengths divided by 2^length and its times by 2^time, exactly.

    Raises:
        BadInput: a number of the scene loses bits beside the table's size and period.
    """
    found = copy(scene)  # which is valid, and so is the same table in other units: one proof serves both
    for name, law in scene.laws.items():
        changed = _in_units(f"scene.{name}", law, 0 if name in ("nu", "slope") else length, time)
        msgspec.structs.force_setattr(found, name, changed.as_field())
    return found


def exponent(size: float) -> int:
    """Return e with 2^e <= size < 2^(e + 1), for size > 0."""
    return math.frexp(size)[1] - 1


def inward(field: str, number: float, exponent: int) -> float:
    """Return a number divided by 2^exponent, exactly.

    Raises:
        InvalidState: it would lose bits, or be too large.
    """
    scaled = times_power(number, -exponent)
    if scaled == number or (abs(scaled) < math.inf and math.ldexp(scaled, exponent) == number):
        return scaled
    bound = "at least 2^-900" if abs(scaled) < 1.0 else "below 2^900 in size"
    refusal = LateTime if field == "state.t" and abs(scaled) > 1.0 else InvalidState
    raise refusal(f"{field} = {number!r}, must be {bound} beside the table's size and period")


def scaled(numbers: FloatArray, exponents: IntArray | int) -> tuple[FloatArray, BoolArray]:
    """Return kernel numbers times 2^exponents, and which of them lost no bit; infinity and nan lose none."""
    with np.errstate(over="ignore", under="ignore"):
        found = np.ldexp(numbers, exponents)
        return found, (np.ldexp(found, -exponents) == numbers) | ~np.isfinite(numbers)


def outward(numbers: FloatArray, exponents: IntArray | int) -> FloatArray:
    """Return kernel numbers times 2^exponents, exactly; infinities and nans as they are.

    Raises:
        BadInput: one of them would lose bits, or overflow.
    """
    found, is_kept = scaled(numbers, exponents)
    if not is_kept.all():
        raise BadInput(Fate.ANSWER_LOST.value)
    return found


def _in_units(field: str, law: Law, length: int, time: int) -> Law:
    """Return a law with its values divided by 2^length and its times by 2^time, exactly.

    Raises:
        BadInput: a number would lose bits, or be too large.
    """
    try:
        found = law.scaled(-length, -time)
        is_kept = found.scaled(length, time) == law
    except InvalidScene:  # of a law none of whose numbers may be infinite, or a frequency 0
        is_kept = False
    if not is_kept:
        given = msgspec.json.encode(law.as_field()).decode()
        bound = "must have numbers of 2^-900 to 2^900 in size, or 0, beside the table's size and period"
        raise BadInput(f"{field} = {given}, {bound}")
    return found
