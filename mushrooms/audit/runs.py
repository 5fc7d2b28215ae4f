"""The simulations that the audit rests on: scene, energy, number of particles, what they did.

A run has a seed of its own, derived from the audit's seed and the run's name, and its particles are
those that this seed numbers. So a quick audit follows the first particles of a full one, and a run
comes to the same bits whether it is followed at once, in parts or on another machine.
"""

import hashlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from scene.laws import Law
from scene.named import scene_named
from scene.tables import Scene

if TYPE_CHECKING:
    from fast import Ensemble

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Simulate = Callable[..., "Ensemble"]
Progress = Callable[[str, int, int], None]  # run, particles in all, particles done

MAX_LOST = 1e-3  # a larger unfollowed share could hide a bias as large as the errors themselves
Size = Literal["quick", "full"]
EIGHTHS = tuple(k / 8 for k in range(1, 8))
SIXTEENTHS = tuple(k / 16 for k in range(1, 16))


class Simulation(NamedTuple):
    """One simulation.

    Attributes:
        scene: a name that `scene.named` knows.
        energy: initial energy of every particle.
        quick, full: number of particles by the audit's size, 0 for none.
        n_cycles: cycles followed.
        phases: fractions of each cycle at which energies are kept.
    """

    scene: str
    energy: float
    quick: int
    full: int
    n_cycles: int = 1
    phases: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """Return `scene@energy`, with the number of cycles where there are several."""
        many = f"x{self.n_cycles}" if self.n_cycles > 1 else ""
        return f"{self.scene}@{self.energy:.0e}{many}".replace("e+0", "e").replace("e+", "e")

    def n_particles(self, size: Size) -> int:
        """Return how many particles an audit of this size follows."""
        return self.quick if size == "quick" else self.full


_ALL = (
    # Sec. 4.1 at its size and energy.
    Simulation("fixed-cap-anticlockwise", 1e9, 10_000, 100_000, phases=EIGHTHS),
    Simulation("fixed-cap-clockwise", 1e9, 10_000, 100_000, phases=EIGHTHS),
    # A hundred times slower there, diffusion and lags are ten times larger.
    Simulation("fixed-cap-anticlockwise", 1e7, 10_000, 100_000, phases=EIGHTHS),
    Simulation("fixed-cap-clockwise", 1e7, 10_000, 100_000, phases=EIGHTHS),
    Simulation("fixed-cap-other-legs", 1e7, 10_000, 50_000),
    Simulation("fixed-cap-irregular", 1e7, 5_000, 25_000),
    # Sec. 4.2 at its energies; the ladder of energies carries the laws and the limits.
    Simulation("moving-cap", 1e3, 20_000, 100_000),
    Simulation("moving-cap", 1e4, 20_000, 100_000, phases=SIXTEENTHS),
    Simulation("moving-cap", 1e5, 20_000, 100_000, phases=SIXTEENTHS),
    Simulation("moving-cap", 1e6, 20_000, 100_000, phases=SIXTEENTHS),
    Simulation("moving-cap", 1e7, 10_000, 100_000, phases=SIXTEENTHS),
    Simulation("moving-cap", 1e8, 1_000, 5_000, phases=SIXTEENTHS),
    Simulation("moving-cap", 1e9, 0, 2_000),
    Simulation("moving-cap", 1e10, 0, 1_000),
    Simulation("moving-cap", 1e11, 0, 500),
    Simulation("moving-cap-reversed", 1e6, 10_000, 50_000),
    Simulation("moving-cap-trivial", 1e6, 10_000, 50_000),
    Simulation("only-mouth", 1e6, 5_000, 25_000),
    Simulation("retraced-arc", 1e6, 10_000, 50_000),
    Simulation("untilted", 1e6, 10_000, 25_000),
    Simulation("ergodic", 1e4, 10_000, 25_000, phases=EIGHTHS),
    Simulation("ergodic", 1e5, 10_000, 25_000, phases=EIGHTHS),
    Simulation("ergodic", 1e6, 10_000, 25_000, phases=EIGHTHS),
    Simulation("ergodic", 1e7, 10_000, 25_000, phases=EIGHTHS),
    Simulation("frozen-mushroom", 1e8, 2_000, 10_000),
    Simulation("frozen-untilted", 1e8, 2_000, 10_000),
    # Nothing grows: no flux, one parameter, tables that are integrable at all times (C11 to C13).
    Simulation("flux-free", 1e6, 2_000, 10_000),
    Simulation("only-radius", 1e7, 2_000, 10_000),
    Simulation("only-depth", 1e6, 2_000, 10_000),
    Simulation("only-slope", 1e6, 2_000, 10_000),
    Simulation("fermi-ulam", 1e3, 100, 500, n_cycles=400),
    Simulation("breathing-circle", 1e3, 100, 500, n_cycles=400),
    # Nothing exponential: many cycles at speeds that grow slowly (C5).
    Simulation("ergodic", 1e4, 800, 4_000, n_cycles=120),
    Simulation("moving-cap-trivial", 1e4, 800, 4_000, n_cycles=120),
    # Many cycles cost most: energies, and with them collisions, grow exponentially. Sec. 4.2 at its
    # size, for n = 10 and n = 30: some 1.8e11 collisions.
    Simulation("moving-cap", 1e5, 500, 500, n_cycles=30),
    Simulation("moving-cap", 1e7, 0, 25_000, n_cycles=30),
)
RUNS: dict[str, Simulation] = {run.name: run for run in _ALL}


def scene_of(run: Simulation) -> Scene:
    """Return the run's scene."""
    return scene_named(run.scene)


def run_seed(seed: int, run: Simulation, *numbers: int) -> int:
    """Return the seed of a run's particles, 64 bits; with numbers, of what else is drawn for it."""
    return int.from_bytes(
        hashlib.sha256(" ".join(map(str, (seed, run.name, *numbers))).encode()).digest()[:8], "big"
    )


class Sample(NamedTuple):
    """The n particles of a run that were followed to the end, over K cycles, at P phases.

    Attributes:
        run: what was asked for.
        s: (n, K) log E / E0 at the end of each cycle.
        t_in, t_out: (n, K, M) capture interval around each minimum of nu; nan for none.
        takes_part: (n,) which are not in the island all the time.
        phase_s: (n, K, P) log E / E0 at the phases.
        phase_captured: (n, K, P) whether in the island there.
        stem_hits: (n,) collisions with left, right and floor.
        n_particles: particles started.
        n_undecided, n_undefined: of those not followed.
        n_collisions, n_careful: in all.
        seconds: kernel time x threads [s].
        sha256: of the ensemble, as `fast.Ensemble` has it.
    """

    run: Simulation
    s: FloatArray
    t_in: FloatArray
    t_out: FloatArray
    takes_part: BoolArray
    phase_s: FloatArray
    phase_captured: BoolArray
    stem_hits: npt.NDArray[np.int64]
    n_particles: int
    n_undecided: int
    n_undefined: int
    n_collisions: int
    n_careful: int
    seconds: float
    sha256: str

    @property
    def n(self) -> int:
        """Return how many were followed to the end."""
        return len(self.s)

    @property
    def is_whole(self) -> bool:
        """Tell whether the unfollowed share is too small to matter."""
        return self.n > (1 - MAX_LOST) * self.n_particles

    @property
    def gain(self) -> FloatArray:
        """Return log E1 / E0 of the first cycle."""
        return self.s[:, 0]

    @property
    def captured(self) -> BoolArray:
        """Return which were captured in the first cycle."""
        return np.asarray(np.isfinite(self.t_in[:, 0]).any(axis=1))

    @property
    def never_captured(self) -> BoolArray:
        """Return, for each that takes part, whether the first cycle passes uncaptured.

        P_nc is the share.
        """
        return np.asarray(~self.captured[self.takes_part])

    @property
    def first_capture(self) -> tuple[FloatArray, FloatArray]:
        """Return begin and end (n,) of each one's first capture interval in the first cycle.

        Nan for none.
        """
        begin, end = (
            np.fmin.reduce(t[:, 0], axis=1, initial=np.nan) for t in (self.t_in, self.t_out)
        )
        return begin, end

    def change(self, which: BoolArray, first: int, last: int) -> FloatArray:
        """Return the change of log E of some particles from one of the run's phases to another."""
        return np.asarray(self.phase_s[which, 0, last] - self.phase_s[which, 0, first])

    @property
    def speed(self) -> float:
        """Return the initial speed."""
        return float(np.sqrt(2 * self.run.energy))


def draw(
    simulate: Simulate,
    run: Simulation,
    *,
    size: Size,
    seed: int,
    threads: int | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> Sample:
    """Follow a run's particles, and keep what the audit looks at of those followed to the end.

    Args:
        simulate: `fast.simulate`, or another with its signature; it may know the particles from
            before.
        run: what to simulate.
        size: quick or full.
        seed: the audit's.
        threads: for the stepper; all by default.
        progress: told of the particles done, again and again.
    """
    ensemble = simulate(
        scene_of(run),
        n_particles=run.n_particles(size),
        energy=run.energy,
        n_cycles=run.n_cycles,
        seed=run_seed(seed, run),
        threads=threads,
        phases=run.phases,
        progress=progress,
    )
    energies = ensemble.cycle_energies
    followed = (ensemble.outcome == 0) & np.all(np.isfinite(energies) & (energies > 0), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.log(energies / ensemble.energy0)
        phase_s = np.log(ensemble.phase_energies / ensemble.energy0)
    return Sample(
        run=run,
        s=s[followed],
        t_in=ensemble.t_in[followed],
        t_out=ensemble.t_out[followed],
        takes_part=ensemble.takes_part()[followed],
        phase_s=phase_s[followed],
        phase_captured=ensemble.phase_captured[followed],
        stem_hits=ensemble.wall_counts[followed, 2:].sum(axis=1),
        n_particles=len(followed),
        n_undecided=int(np.sum(ensemble.outcome == 1)),
        n_undefined=int(np.sum(ensemble.outcome == 2)),
        n_collisions=int(np.sum(ensemble.n_collisions)),
        n_careful=int(np.sum(ensemble.n_careful)),
        seconds=ensemble.seconds * ensemble.threads,
        sha256=ensemble.sha256(),
    )


def at_knots(law: Law) -> list[float]:
    """Return the values of a bang-bang law at its knots, every other breakpoint."""
    return [float(law.value(fp, float(time))) for time in law.breakpoints()[::2]]
