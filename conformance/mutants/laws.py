"""Mutants that follow a law of motion wrongly: its phase, harmonics, legs, periods, digits."""

import struct
from math import cos, floor, fmod, sin

from mpmath import fp
from msgspec.structs import replace

from conformance.mutants.mutant import COMMON, Plain, mutant
from conformance.plain.step import (
    BangBangMotion,
    ConstantMotion,
    Flight,
    FourierMotion,
    Half,
    LawMotion,
    LawValue,
)
from scene import BangBang, Constant, Fourier, Law, Outcome, Rejected, Scene, State


def single(x: float) -> float:
    """Round to binary32, as a variable declared as float does."""
    return float(struct.unpack("f", struct.pack("f", max(-3e38, min(x, 3e38))))[0])


class Stopped(ConstantMotion):
    """A law that stands still from some time of flight on."""

    def __init__(self, law: LawMotion, span: float) -> None:
        super().__init__(Constant(law.value), 0.0)
        self.law, self.span = law, span

    def at(self, s: float) -> LawValue:
        """Return the motion at the time s since departure."""
        found = self.law.at(min(s, self.span))
        return found if s < self.span else found._replace(rate=0.0)


@mutant(BangBangMotion, "halves")
def half_leg_acceleration_sign(
    motion: BangBangMotion, plain: Plain[tuple[Half, Half]], *leg: float
) -> tuple[Half, Half]:
    """Accelerates through the second half of a leg instead of braking."""
    one, two = plain(*leg)
    return one, two._replace(pull=one.pull)


@mutant(Flight, "law")
def period_wrap_lost(flight: Flight, plain: Plain[LawMotion], law: Law) -> LawMotion:
    """Lets a bang-bang law stand still outside its first period."""
    times = law.breakpoints()
    if not times:
        return plain(law)
    t, first, last = flight.state.t, float(times[0]), float(times[-1])
    if first <= t < last:
        return Stopped(plain(law), last - t)
    return ConstantMotion(Constant(law.value(fp, last)), t)


@mutant(BangBangMotion, "__init__")
def periods_in_int32(
    motion: BangBangMotion, plain: Plain[None], law: BangBang, t: float, *, size: float = 2.0**31
) -> None:
    """Counts whole periods in 32 bits, which overflow."""
    first, last = law.knots[0][0], law.knots[-1][0]
    plain(law, t if -size <= floor((t - first) / (last - first)) < size else last)


@mutant(BangBangMotion, "__init__")
def periods_towards_zero(motion: BangBangMotion, plain: Plain[None], law: BangBang, t: float) -> None:
    """Cuts off whole periods towards 0: before the first knot the first leg is taken to have been on."""
    plain(law, t)
    if (since := fmod(t - law.knots[0][0], motion.period)) < 0:
        half = motion.halves(*law.knots[0], *law.knots[1])[0]
        motion.value, motion.rate = half.value + half.pull * since * since / 2, half.pull * since
        others = BangBangMotion(law, half.end).pieces
        motion.pieces = [(-since + half.end - half.begin, half.pull), *others]


@mutant(BangBangMotion, "__init__")
def knots_from_zero(motion: BangBangMotion, plain: Plain[None], law: BangBang, t: float) -> None:
    """Takes the first knot to be at time 0."""
    plain(law, t + law.knots[0][0])


@mutant(BangBangMotion, "__init__")
def knots_without_their_origin(motion: BangBangMotion, plain: Plain[None], law: BangBang, t: float) -> None:
    """Reduces the time by whole periods from 0, though the knots begin elsewhere."""
    plain(law, t)
    first, within = law.knots[0][0], t - floor(t / motion.period) * motion.period
    if not first <= within < first + motion.period:
        motion.value, motion.rate, motion.pieces = law.knots[0][1], 0.0, [(motion.period, 0.0)]


@mutant(BangBangMotion, "__init__")
def last_leg_forgotten(motion: BangBangMotion, plain: Plain[None], law: BangBang, t: float) -> None:
    """Stands still between the last two knots."""
    *kept, (time, _), last = law.knots
    plain(BangBang(knots=(*kept, (time, last[1]), last)) if len(kept) > 1 else law, t)


@mutant(BangBangMotion, "__init__")
def time_within_period_in_float32(
    motion: BangBangMotion, plain: Plain[None], law: BangBang, t: float
) -> None:
    """Keeps the time since the first knot, within a period, in binary32."""
    first, last = law.knots[0][0], law.knots[-1][0]
    turns = floor((t - first) / (last - first))
    plain(law, first + single(t - first - turns * (last - first)))


@mutant(FourierMotion, "at")
def rate_without_harmonic_number(motion: FourierMotion, plain: Plain[LawValue], s: float) -> LawValue:
    """Differentiates cos(k omega t) to -omega sin(k omega t)."""
    rate = sum(motion.omega * (b * cos(f * s) - a * sin(f * s)) for f, a, b in motion.waves)
    return plain(s)._replace(rate=rate)


@mutant(FourierMotion, "__init__")
def three_harmonics_at_most(
    motion: FourierMotion, plain: Plain[None], law: Fourier, t: float, *, size: float = 3
) -> None:
    """Keeps three harmonics of a Fourier law."""
    plain(replace(law, cos=law.cos[: int(size)], sin=law.sin[: int(size)]), t)


@mutant(FourierMotion, "__init__")
def frequency_in_float32(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Keeps the angular frequency in binary32."""
    plain(replace(law, omega=single(law.frequency(fp)), period=None), t)


@mutant(FourierMotion, "__init__")
def period_for_frequency(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Takes a period for an angular frequency."""
    plain(law if law.period is None else replace(law, omega=law.period, period=None), t)


@mutant(Flight, "law")
def first_period_only(flight: Flight, plain: Plain[LawMotion], law: Law) -> LawMotion:
    """Lets every law stand still after one period of flight."""
    motion = plain(law)
    return motion if law.cycle is None else Stopped(motion, float(law.cycle.value(fp)))


@mutant(Flight, "__init__")
def gives_up_after_ten_periods(
    flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float, *, size: float = 10
) -> None:
    """Looks for a hit within ten periods of the laws only."""
    plain(scene, state, t_end)
    if length := scene.period:
        flight.end, flight.is_horizon = min(flight.end, size * length), True


@mutant(Flight, "__init__")
def place_in_float32(flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float) -> None:
    """Keeps x and y in binary32."""
    plain(scene, replace(state, x=single(state.x), y=single(state.y)), t_end)


@mutant(Flight, "refusal")
def sizes_judged_by_their_amplitudes(flight: Flight, plain: Plain[Outcome | None]) -> Outcome | None:
    """Refuses a scene in which a size's amplitudes add up to its mean or more, though it stays positive."""
    for name, law in flight.scene.laws.items():
        if name != "slope" and not law.bounds().lowest > 0:
            return Rejected(f"scene.{name} is negative at times")
    return plain()


@mutant(Flight, "__init__")
def steep_slopes_clamped(
    flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float, *, size: float = 0.5
) -> None:
    """Clamps a constant slope of the sides to -1/2 ... 1/2."""
    plain(scene, state, t_end)
    slope = flight.laws.get("slope")
    if isinstance(slope, ConstantMotion):
        slope.value = max(-size, min(slope.value, size))


@mutant(Flight, "__init__")
def escape_time_from_sizes_at_departure(
    flight: Flight, plain: Plain[None], scene: Scene, state: State, t_end: float
) -> None:
    """Bounds the time of a flight by the sizes that the table has at departure, though it grows."""
    plain(scene, state, t_end)
    sizes, flight.sizes = flight.sizes, {name: abs(law.value) for name, law in flight.laws.items()}
    flight.end, flight.sizes, flight.is_horizon = min(flight.end, flight.escape() / 2), sizes, True


@mutant(FourierMotion, "__init__", COMMON)
def phase_restarts_at_each_step(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Follows a Fourier law from t = 0 whatever the time of departure."""
    plain(law, 0.0)


@mutant(FourierMotion, "__init__", COMMON)
def sine_and_cosine_swapped(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Takes the cosine amplitudes for the sine's."""
    plain(replace(law, cos=law.sin, sin=law.cos), t)


@mutant(FourierMotion, "__init__", COMMON)
def pi_too_short(motion: FourierMotion, plain: Plain[None], law: Fourier, t: float) -> None:
    """Reduces the phase of a Fourier law by 2 x 3.14159."""
    plain(law, t % (2 * 3.14159 / law.frequency(fp)))
