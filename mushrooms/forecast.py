"""What `mushrooms simulate` says of time: before a long run how long it may take, after it what slowed it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from mpmath import fp

from fast.batch import flights
from fast.ensemble import SHARE
from fast.starts import initial_states, one_cycle
from scene import Cap, Mushroom, Scene, State, Stem
from scene.geometry import table_at
from scene.mouth import start_time
from scene.refusal import BadInput

LONG = 20.0  # seconds from which a run is worth a forecast
SLOWEST = 1e-5  # seconds that a collision may take: a run that is short at this pace needs no pilot
PILOTS = (10**4, 10**5, 10**6)  # collisions; each is flown if the one before was too short to be timed
PILOT_SHARE = 0.02  # of a run's collisions that a second or third pilot may take
TIMED = 0.1  # seconds that a pilot must last to be believed: short ones are mostly beginnings and ends
STEEPEST = 1.25  # growth of the mean speed in a cycle that is not expected: the catalogue's greatest is 1.16
MOST_CYCLES = 300  # after which particles that grow faster stay fast enough for any run never to end
CAREFUL_COST = 50  # collisions in lanes that take as long as one careful step, measured at 40 to 80
UNITS = ((1.0, "seconds"), (60.0, "minutes"), (3600.0, "hours"), (86400.0, "days"))


class Forecast(NamedTuple):
    """How many collisions an ensemble is likely to make, and how many seconds they are likely to take."""

    collisions: float
    seconds: float

    def text(self, threads: int) -> str:
        """Return the forecast as a line."""
        on = f"on {threads} thread{'' if threads == 1 else 's'}"
        return f"about {self.collisions:.2g} collisions ahead: some {in_words(self.seconds)} {on}"


def in_words(seconds: float) -> str:
    """Return a duration in the unit that suits it."""
    size, unit = next(u for u in reversed(UNITS) if seconds >= 1.5 * u[0] or u is UNITS[0])
    n = seconds / size
    return f"{n:.2g} {unit}" if n < 10 or n > 1e6 else f"{n:.0f} {unit}"


def forecast(
    scene: Scene,
    *,
    n_particles: int,
    energy: float,
    n_cycles: int,
    seed: int,
    threads: int,
    n_before: int = 0,
) -> Forecast | None:
    """Return what to expect of `fast.simulate`; None where that is short, or beyond what floats can tell.

    Of `n_cycles` some, `n_before`, have been followed. A pilot, some of the particles for a short time, says
    what a collision takes.
    """
    workers, n_together = min(threads, n_particles), min(SHARE, math.ceil(n_particles / threads))
    steepest = STEEPEST ** min(n_cycles, MOST_CYCLES) if isinstance(scene, Mushroom) and n_cycles > 1 else 1.0
    try:
        first = n_particles * _collisions_of_a_cycle(scene, energy)
        most = first * n_cycles * steepest
        if not LONG < most * SLOWEST / workers < math.inf:
            return None
        pace = _pace(scene, n_together, energy, seed, PILOT_SHARE * first * n_cycles) / workers
        if not most * pace > LONG:  # nor need theory be asked
            return None
        collisions = first * (_as_first_cycles(scene, n_cycles) - _as_first_cycles(scene, n_before))
    except (BadInput, ArithmeticError):  # a table at the edge of binary64 runs without a forecast
        return None
    return Forecast(collisions, collisions * pace) if LONG < collisions * pace < math.inf else None


def expected_collisions(scene: Scene, energy: float, n_cycles: int) -> float:
    """Return how many collisions to expect of a particle; nan at the edge of binary64."""
    try:
        return _collisions_of_a_cycle(scene, energy) * _as_first_cycles(scene, n_cycles)
    except (BadInput, ArithmeticError):
        return math.nan


def _collisions_of_a_cycle(scene: Scene, energy: float) -> float:
    """Return how many collisions to expect of a particle that is fast beside the walls.

    Particles uniform in place and direction meet the walls, of length P around an area A, at the rate
    v P / (pi A), however they move; in a cycle v^2 goes as 1 / A.
    """
    begin, span, n_times = start_time(scene), one_cycle(scene), 64
    area, _ = _size(scene, begin)
    sizes = [_size(scene, begin + span * ((k + 0.5) / n_times)) for k in range(n_times)]
    rates = [math.sqrt(2.0 * energy * area / a) * walls / (math.pi * a) for a, walls in sizes]
    return math.fsum(rates) * span / n_times


def _as_first_cycles(scene: Scene, n_cycles: int) -> float:
    """Return how many first cycles make as many collisions; theory says how v grows in a mushroom."""
    if n_cycles <= 1 or not isinstance(scene, Mushroom):
        return n_cycles
    import theory

    growth = float(theory.mean_of(scene, lambda s: s.context.exp(s / 2), 5))
    n = min(n_cycles, MOST_CYCLES)
    return max(float(n_cycles), math.fsum(growth**k for k in range(n)))


def _size(scene: Scene, t: float) -> tuple[float, float]:
    """Return a table's area [length^2] and the length of its walls [length] at a time."""
    now: Any = table_at(fp, scene, t)
    top = 2 * now.w if isinstance(scene, Stem) else math.pi * now.r + 2 * (now.r - now.w)
    stem = 2 * (now.h * math.hypot(1.0, now.slope) + now.half_width(-now.h))
    return float(now.cap_area() + now.stem_area()), float(top + (0 if isinstance(scene, Cap) else stem))


def _pace(scene: Scene, n_particles: int, energy: float, seed: int, most: float) -> float:
    """Return the seconds that a collision takes in one thread, by pilots of at most some `most` of them."""
    begin = start_time(scene)
    starts = [State(t, *place) for t, _, *place in initial_states(scene, n_particles, energy, seed).tolist()]
    area, walls = _size(scene, begin)
    rate = n_particles * math.sqrt(2.0 * energy) * walls / (math.pi * area)
    n_done, seconds = flights(scene, starts, begin + PILOTS[0] / rate)
    for n in PILOTS[1:]:
        if seconds < TIMED and n <= most:
            n_done, seconds = flights(scene, starts, begin + n / rate)
    return seconds / max(n_done, 1)


def careful_note(n_careful: int, n_collisions: int, seconds: float) -> str | None:
    """Return a line on careful steps, if a run took a second and they took over a tenth of its time."""
    share = n_careful / max(n_collisions, 1)
    part = CAREFUL_COST * share / (1.0 + (CAREFUL_COST - 1.0) * share)
    if seconds < 1.0 or part <= 0.1:
        return None
    return (
        f"careful steps: {share:.2g} of the collisions, some {part:.0%} of the time. They are as right as the"
        " others. Walls that move far between two collisions need them: at higher energy they are fewer"
    )
