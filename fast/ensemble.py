"""Ensembles: many particles of one initial energy, followed through cycles of the walls.

The results of a particle depend on that particle alone. They have the same bits for any number
of particles, threads or chunks.
An ensemble can be continued: some cycles now and more later, with the bits of a single run.

Particle i draws its start from block i of a counter-based random stream (Philox) keyed by the seed: it is the
same particle whatever the number of particles, threads or chunks.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from fast.kernel import records
from fast.kernel.arithmetic import directions
from fast.kernel.fates import FATES, MOST_TO_A_TIME, Fate
from fast.kernel.follow import LANE_ROWS, follow_particles
from fast.kernel.records import (
    BoolArray,
    Compiled,
    FloatArray,
    Followed,
    IntArray,
    LawsInLanes,
    Stops,
    unfilled_ends,
)
from fast.kernel.single import LARGEST
from fast.kernel.worker import awaited, interruptible, is_known_throughout, new_worker
from fast.prepared import Prepared, prepare
from fast.units import Units, inward, outward

from fast.validation import (  # isort: skip
    MAX_CYCLES, MAX_FIRST, MAX_PARTICLES, MOST_IN_CYCLES, check_energy, check_kept,
    check_phases, check_progress, check_threads,
)  # fmt: skip
from scene import Horizon, Rejected, Scene, Undecided, Undefined, check_scene
from scene.geometry import table_at
from scene.mouth import start_time
from scene.notebook import rows
from scene.refusal import BadInput, check_count, shown

FOLLOWED, UNDECIDED, UNDEFINED, REJECTED = 0, 1, 2, 3
KINDS: dict[type[Any], int] = {
    Horizon: FOLLOWED,
    Undecided: UNDECIDED,
    Undefined: UNDEFINED,
    Rejected: REJECTED,
}
OUTCOMES = np.full(1 + max(FATES), REJECTED, np.int8)  # by the code of a fate
for fate in Fate:
    OUTCOMES[fate.code] = KINDS[fate.outcome]
SHARE = 256  # particles a worker takes at a time, for each cycle: several times what it holds at once


class Ensemble(NamedTuple):
    """Results of N particles over K cycles, with P phases and M local minima of nu in each cycle.

    A *capture interval* begins with an arc hit at which |sin phi| > nu. It ends with the first arc hit after
    its last such hit, or with a hit of a stem wall, whichever comes first. M counts the local minima of nu
    after the start of a cycle and up to its end (`scene.mouth`). A plateau is one minimum; a constant nu has
    none. The dimension is called `narrowing`.

    Attributes:
        energy0: initial energy E = v^2 / 2 of every particle.
        energy: (N,) energy after the last cycle; nan for a particle not followed to the end.
        cycle_energies: (N, K) energy at the end of each cycle.
        t, x, y, vx, vy: (N,) last states.
        n_collisions: (N,) number of collisions.
        outcome: (N,) 0 followed to the end, 1 undecided or stopped after 10^9 collisions, 2 undefined,
            3 rejected.
        t_in, t_out: (N, K, M) begin and end [time] of the capture interval that spans minimum m of cycle k,
            t_in <= its instant <= t_out; nan if the particle is not captured at that instant. If an interval
            spans several minima of nu, the entry of each has the same t_in and, within one cycle, the same
            t_out. t_in may lie in an earlier cycle. If a particle starts captured, t_in is its first arc hit.
            t_out is what is known at the end of the cycle. If the interval is still open then, t_out is that
            end. If the interval seemed to have ended, but continues in a later cycle, t_out is the arc hit at
            which it seemed to end. Intervals that span no minimum are not stored.
        wall_counts: (N, 5) number of collisions with arc, base, left, right, floor.
        phase_energies: (N, K, P) energy at each of `phases`.
        phase_captured: (N, K, P) whether the last arc hit before that phase had |sin phi| > nu, and no wall
            of the stem has been met since.
        n_careful: (N,) number of collisions computed by the scalar step, not by the SIMD lanes.
        seconds: wall time of the kernel.
        threads: number of threads used.
    """

    energy0: float
    energy: FloatArray
    cycle_energies: FloatArray
    t: FloatArray
    x: FloatArray
    y: FloatArray
    vx: FloatArray
    vy: FloatArray
    n_collisions: IntArray
    outcome: npt.NDArray[np.int8]
    t_in: FloatArray
    t_out: FloatArray
    wall_counts: IntArray
    phase_energies: FloatArray
    phase_captured: BoolArray
    n_careful: IntArray
    seconds: float
    threads: int

    def is_captured(self) -> BoolArray:
        """Return (N, K): whether a particle has a capture interval in a cycle."""
        return np.asarray(np.isfinite(self.t_in).any(axis=2))

    def takes_part(self) -> BoolArray:
        """Return (N,): whether a particle was followed to the end and was free at some time.

        If nu is always below 1, some particles are never free. Every entry of their t_in is a number, their
        last interval is open at the end, and they hit no stem wall. The theory leaves them out. A slow
        particle may be released and not reach the stem before the end: it takes part. If it is captured
        again before the end, it looks as if it had never been free.
        """
        was_followed: BoolArray = self.outcome == FOLLOWED
        if self.t_in.shape[2] == 0:
            return was_followed
        is_always_in = np.isfinite(self.t_in).all(axis=(1, 2)) & ~self.wall_counts[:, 2:].any(axis=1)
        is_on_at_the_end: BoolArray = self.t_out[:, -1, -1] == self.t
        return was_followed & ~(is_always_in & is_on_at_the_end)

    def p_nc(self) -> FloatArray:
        """Return (K,): share, in each cycle, of particles without capture; nan if none takes part.

        Source: Eq:ps. A particle that starts captured counts as captured in the first cycle.
        """
        return 1.0 - _mean(self.is_captured()[self.takes_part()])

    def p_nc_se(self) -> FloatArray:
        """Return (K,): standard error of `p_nc`, at 0 and 1 that of 1 / (n + 1); 0 if nu has no minimum."""
        n = max(int(self.takes_part().sum()), 1)
        share = np.clip(self.p_nc(), 1.0 / (n + 1), n / (n + 1))
        return np.sqrt(share * (1.0 - share) / n) * bool(self.t_in.shape[2])

    def s(self) -> FloatArray:
        """Return (N, K): s = log of the energy after a cycle over that before it; log is natural."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.diff(np.log(self.cycle_energies / self.energy0), axis=1, prepend=0.0)

    def m1(self) -> FloatArray:
        """Return (K,): mean of s over particles that take part (Eq:Erate); nan if none does."""
        return _mean(self.s()[self.takes_part()])

    def m1_se(self) -> FloatArray:
        """Return (K,): standard error of `m1`; nan for fewer than two particles."""
        s = self.s()[self.takes_part()]
        return s.std(axis=0, ddof=1) / math.sqrt(len(s)) if len(s) > 1 else np.full(s.shape[1], np.nan)

    def ns_per_collision(self) -> float:
        """Return kernel wall time x threads / collisions, in nanoseconds."""
        return self.seconds * self.threads / max(int(self.n_collisions.sum()), 1) * 1e9

    def __repr__(self) -> str:
        n, n_cycles = self.cycle_energies.shape
        n_followed = int((self.outcome == FOLLOWED).sum())
        what = f"{n} particles, {n_cycles} cycles, {n_followed} followed to the end"
        return f"Ensemble(E0 = {self.energy0:.6g}, {what})"

    def _repr_html_(self) -> str:
        shown: dict[str, object] = {
            "particles": f"{len(self.energy):,}",
            "followed to the end": f"{int((self.outcome == FOLLOWED).sum()):,}",
            "cycles": self.cycle_energies.shape[1],
            "initial energy": f"{self.energy0:.6g}",
            "collisions": f"{int(self.n_collisions.sum()):,}",
            "m1, a cycle": ", ".join(f"{a:.4g} ± {b:.1g}" for a, b in np.c_[self.m1(), self.m1_se()][:6]),
            "sha256": self.sha256(),
        }
        if self.t_in.shape[2]:
            shown["never captured, a cycle"] = ", ".join(f"{share:.4g}" for share in self.p_nc()[:6])
        return rows("an ensemble", shown)

    def sha256(self) -> str:
        """Return the SHA-256 of the result's bits (times and thread count left out)."""
        digest = hashlib.sha256()
        for array in self[1:-2]:
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()


def _mean(rows: npt.NDArray[Any]) -> FloatArray:
    """Return the mean of each column; nan if there are no rows."""
    return np.asarray(rows.mean(axis=0)) if len(rows) else np.full(rows.shape[1], np.nan)


def simulate(
    scene: Scene,
    *,
    n_particles: int,
    energy: float,
    n_cycles: int = 1,
    seed: int = 0,
    first: int = 0,
    threads: int | None = None,
    phases: Sequence[float] = (),
    progress: Callable[[int], None] | None = None,
) -> Ensemble:
    """Simulate an ensemble through whole cycles. Starts are uniform in area and direction.

    Args:
        scene: table and laws; for a static scene a cycle is one unit of time.
        n_particles: 1 to 10^8; n_particles n_cycles (P + 1 + 2 M), the size of the result, is at most 10^9.
        energy: initial energy E = v^2 / 2 of every particle [length^2 / time^2], > 0.
        n_cycles: cycles to follow, 1 to 10^6.
        seed: 0 <= seed < 2^64.
        first: number of the first particle, 0 to 2^62. Particle i has the same start in every run with this
            seed. Blocks that begin at 0, n, 2 n contain the particles of one large run, to the bit.
        threads: number of threads; default: one per core.
        phases: (P,) increasing fractions of a cycle in (0, 1), at which energies are stored.
        progress: called repeatedly with the number of finished particles, first with 0 when everything is
            checked and compiled. An exception that it raises aborts the run.

    Raises:
        BadInput: naming field, value and bound.

    Source: secs. 4.1, 4.2 (initial conditions); capture as in sec. 3.2.
    """
    plan = planned(scene, n_particles, energy, n_cycles, seed, first, threads, phases, progress)
    done, seconds = plan.followed(plan.starts())
    return plan.ensemble(done, seconds)


def initial_states(scene: Scene, n_particles: int, energy: float, seed: int, first: int = 0) -> FloatArray:
    """Draw states uniform in area and direction when the cycle begins, all of one energy.

    Returns:
        (N, 6) array: t, its low part 0, x, y, vx, vy of particles `first` to `first` + N - 1.
    """
    # One Philox block gives four numbers, and four is what a particle needs.
    raw = np.random.Philox(key=seed, counter=first).random_raw(4 * n_particles).reshape(n_particles, 4)
    u = (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53
    start = start_time(scene)
    x, y = _uniform_in_area(scene, start, u[:, 0], u[:, 1], u[:, 2])
    speed, along = math.sqrt(2.0 * energy), directions(np.ascontiguousarray(u[:, 3]))
    out: FloatArray = np.column_stack(
        [np.full(n_particles, start), np.zeros(n_particles), x, y, speed * along[:, 0], speed * along[:, 1]]
    )
    return out


def _uniform_in_area(
    scene: Scene, t: float, pick: FloatArray, a: FloatArray, b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    now = table_at(fp, scene, t)
    cap_area, stem_area = now.cap_area(), now.stem_area()
    rho, along = now.r * np.sqrt(a), directions(0.5 * b)
    side, depth = now.uniform_in_stem(a, b)
    in_cap = pick * (cap_area + stem_area) < cap_area
    return np.where(in_cap, rho * along[:, 0], side), np.where(in_cap, rho * along[:, 1], -depth)


def cycle_stops(prepared: Prepared, n_cycles: int, phases: Sequence[float]) -> Stops:
    """Return the stops of whole cycles: at each of `phases` (fractions of a cycle, rising) and the end.

    The minima of nu are stops too; one at the end of a cycle comes before that end.
    """
    count = np.arange(n_cycles)
    narrow = np.array(prepared.minima)
    parts = np.array([*narrow, *phases, 1.0])
    columns = np.full((n_cycles, len(parts)), -1)
    columns[:, len(narrow) :] = np.arange(n_cycles * (len(phases) + 1)).reshape(n_cycles, -1)
    cycles = np.full(columns.shape, -1)
    cycles[:, -1] = count
    order = np.argsort(parts, kind="stable")
    times = prepared.start + prepared.cycle * (count[:, None] + parts[None, :])
    return Stops(
        times[:, order].ravel(),
        columns[:, order].ravel(),
        cycles[:, order].ravel(),
        np.ascontiguousarray(times[:, : len(narrow)]),  # a slice would have `follow` compiled once more
        is_first_kept=False,
        most=MOST_IN_CYCLES,
        called_off=np.zeros(1, np.int64),
    )


def only_stop(t_end: float) -> Stops:
    """Return one stop, that keeps the first capture interval of any length."""
    return Stops(
        np.array([t_end]),
        np.array([0]),
        np.array([0]),
        np.full((1, 1), math.nan),
        is_first_kept=True,
        most=MOST_TO_A_TIME,
        called_off=np.zeros(1, np.int64),
    )


def least_collisions(compiled: Compiled, speed: float, span: float) -> float:
    """Return how many flights of the table's full length fit into a path at this speed [collisions]."""
    r, w, h = (
        float(compiled.bounds[row, records.HIGHEST]) for row in (records.RADIUS, records.WIDTH, records.DEPTH)
    )
    return speed * span / (2.0 * max(r, w) + r + h)


class Plan(NamedTuple):
    """What an ensemble is asked for, checked, as the kernel takes it.

    Attributes:
        prepared: the scene.
        units: those of its particles.
        energy0: of every particle, as given.
        size: particles, cycles, looks at a particle in a cycle.
        seed, first, threads, progress: see `simulate`.
        stops: when particles are looked at.
    """

    prepared: Prepared
    units: Units
    energy0: float
    size: tuple[int, int, int]
    seed: int
    first: int
    threads: int
    progress: Callable[[int], None] | None
    stops: Stops

    def starts(self) -> FloatArray:
        """Return the states that particles start from."""
        energy = inward("energy", self.energy0, self.units.of_energy())
        return initial_states(self.prepared.scene, self.size[0], energy, self.seed, self.first)

    def followed(
        self, states: FloatArray, n_lane_rows: int = 0, lanes: FloatArray | None = None, n_passed: int = 0
    ) -> tuple[Followed, float]:
        """Follow particles to the last stop.

        Args:
            states: (N, 6) where they start; overwritten by their ends.
            n_lane_rows: of what is kept of a lane; 0 to keep none.
            lanes: (N, n_lane_rows) what has been kept of them, if they go on.
            n_passed: stops that these have passed.

        Returns:
            What became of them, and the seconds that took.
        """
        n_columns = int(self.stops.columns.max()) + 1
        done = unfilled_ends(states, n_columns, self.stops.mouth_minima.shape, n_lane_rows)
        if lanes is not None:
            done.lanes[:] = lanes
        free = np.full(len(states), records.NO_WALL)
        in_lanes = self.prepared.in_lanes
        return done, follow_many(in_lanes, done, free, self.stops, self.threads, self.progress, n_passed)

    def ensemble(self, done: Followed, seconds: float) -> Ensemble:
        """Name what the kernel filled in for some particles."""
        units, every = self.units, (-1, *self.size[1:])
        energies, captured = (
            outward(done.energies, units.of_energy()).reshape(every),
            done.is_captured.reshape(every),
        )
        columns = outward(np.delete(done.states, 1, axis=1), units.of_step()[1:]).T
        t, x, y, vx, vy = (np.ascontiguousarray(column) for column in columns)
        return Ensemble(
            energy0=self.energy0,
            energy=np.ascontiguousarray(energies[:, -1, -1]),
            cycle_energies=np.ascontiguousarray(energies[:, :, -1]),
            t=t,
            x=x,
            y=y,
            vx=vx,
            vy=vy,
            n_collisions=done.counts.sum(axis=1),
            outcome=outcomes(done.codes),
            t_in=outward(done.t_in, units.time),
            t_out=outward(done.t_out, units.time),
            wall_counts=done.counts,
            phase_energies=energies[:, :, :-1],
            phase_captured=captured[:, :, :-1],
            n_careful=done.careful,
            seconds=seconds,
            threads=self.threads,
        )


def planned(
    scene: Scene,
    n_particles: int,
    energy: float,
    n_cycles: int,
    seed: int,
    first: int,
    threads: int | None,
    phases: Sequence[float],
    progress: Callable[[int], None] | None,
) -> Plan:
    """Check what an ensemble is asked for: see `simulate`.

    Raises:
        BadInput: naming field, value and bound.
    """
    check_scene(scene)
    n_particles = check_count("n_particles", n_particles, 1, MAX_PARTICLES)
    n_cycles = check_count("n_cycles", n_cycles, 1, MAX_CYCLES)
    seed = check_count("seed", seed, 0, 2**64 - 1)
    first = check_count("first", first, 0, MAX_FIRST)
    energy, phases = check_energy(energy), check_phases(phases)
    threads, progress = check_threads(threads), check_progress(progress)
    prepared = prepare(scene)
    # A static table is followed for units of the caller's time.
    units = Units(prepared.length, prepared.time or 0)
    speed2 = 2.0 * inward("energy", energy, units.of_energy())
    check_kept(n_particles, n_cycles, len(phases), len(prepared.minima))
    ahead = least_collisions(prepared.compiled, math.sqrt(speed2), n_cycles * prepared.cycle)
    if ahead > MOST_IN_CYCLES:
        raise BadInput(
            f"energy = {energy}: over {ahead:.0e} collisions of each particle, must be at most 1e9"
        )
    if speed2 < LARGEST**-2:
        raise BadInput(
            f"energy = {energy}: the speed must be at least 2^-400 beside the table's size and period"
        )
    size = (n_particles, n_cycles, len(phases) + 1)
    stops = cycle_stops(prepared, n_cycles, phases)
    return Plan(prepared, units, energy, size, seed, first, threads, progress, stops)


def _share(n: int, threads: int, n_cycles: int) -> int:
    """Return how many particles a worker takes at a time.

    At the end of a share the lanes wait for its slowest particle. Collisions spread with the cycles: after
    thirty, one particle of 256 makes a tenth of them. So shares grow, and all threads take equally many.
    """
    n_shares = math.ceil(max(n, 1) / (SHARE * n_cycles))
    return math.ceil(max(n, 1) / (threads * math.ceil(n_shares / threads)))


def outcomes(ends: IntArray) -> npt.NDArray[np.int8]:
    """Return 0, 1, 2, 3 for particles followed to the end, undecided, undefined, rejected."""
    found: npt.NDArray[np.int8] = OUTCOMES[ends]
    return found


def follow_many(
    in_lanes: LawsInLanes,
    followed: Followed,
    walls: IntArray,
    stops: Stops,
    threads: int,
    progress: Callable[[int], None] | None = None,
    n_passed: int = 0,
) -> float:
    """Follow particles to the last stop.

    Args:
        in_lanes: the scene as the lanes know it.
        followed: what is filled in; its states are their starts as kernels take them.
        walls: (N,) codes of the walls that they leave.
        stops: when particles are looked at.
        threads: how many to use.
        progress: called with the number of particles done so far, again and again.
        n_passed: how many stops they have passed; if any, they go on from `followed.lanes`.

    Returns:
        The seconds that took.
    """
    n = len(followed.states)
    size = _share(n, threads, len(stops.mouth_minima))

    def work(first: int) -> None:
        part = slice(first, first + size)
        worker = new_worker(in_lanes, stops, followed.part(part), n_passed)
        follow_particles(worker, walls[part])

    work(n)  # none at all: compiles, or loads from the disk cache, so that `seconds` holds work alone
    if progress:
        progress(0)
    begin = time.perf_counter()
    with interruptible(threads, stops.called_off) as pool:
        parts = {first: pool.submit(work, first) for first in range(0, n, size)}
        for first, part in parts.items():
            awaited(part)
            if progress:
                progress(min(first + size, n))
    return time.perf_counter() - begin


BY_CYCLE = ("cycle_energies", "t_in", "t_out", "phase_energies", "phase_captured")


class Paused(NamedTuple):
    """An ensemble, and the data needed to continue it.

    A last state is not enough. It lies in the middle of a flight, and a flight restarted there rounds
    differently.

    Attributes:
        ensemble: results up to the end of its last cycle.
        lanes: (N, LANE_ROWS) each particle at its last collision, and its next one, in the stepper's own
            units (`fast.kernel.follow`); nan for one that was not followed to the end.
        asked: table, laws, n_particles, energy, seed, first and phases of the run, by name; None if a caller
            has rebuilt the object and guarantees them.
    """

    ensemble: Ensemble
    lanes: FloatArray
    asked: dict[str, Any] | None = None


def go_on(
    scene: Scene,
    *,
    n_particles: int,
    energy: float,
    n_cycles: int = 1,
    seed: int = 0,
    first: int = 0,
    threads: int | None = None,
    phases: Sequence[float] = (),
    progress: Callable[[int], None] | None = None,
    before: Paused | None = None,
) -> Paused:
    """Simulate an ensemble that can be continued. The arguments are those of `fast.simulate`.

    `before` is the result of the same call with fewer cycles, or None to begin. `n_cycles` counts all
    cycles, including those of `before`.

    Returns:
        The ensemble that `fast.simulate` returns, to the bit, and the data needed to continue it. A particle
        that was lost before, or had a collision within rounding of the end, is followed from its start.

    Raises:
        BadInput: naming field, value and bound; `before` has another scene, energy, seed, first, phases or
            size; or the cycles reach a time at which the lanes no longer resolve the phases of the laws.
    """
    plan = planned(scene, n_particles, energy, n_cycles, seed, first, threads, phases, progress)
    asked: dict[str, Any] = {
        "table": type(scene).__name__,
        **{name: law.as_field() for name, law in scene.laws.items()},
        "n_particles": plan.size[0],
        "energy": plan.energy0,
        "seed": plan.seed,
        "first": plan.first,
        "phases": check_phases(phases),
    }
    if before is None:
        done, seconds = plan.followed(plan.starts(), LANE_ROWS)
        return Paused(plan.ensemble(done, seconds), done.lanes, asked)
    _check_paused(before)
    _check_same(asked if before.asked is None else before.asked, asked)
    _check_shape(plan, before)
    n_before, n_passed = _passed(plan, before)
    unknown = np.full((plan.size[0], 6), np.nan)
    done, seconds = plan.followed(unknown, LANE_ROWS, before.lanes, n_passed)
    after, anew = plan.ensemble(done, seconds), np.flatnonzero(done.codes == records.FOLLOW_ANEW)
    for name in BY_CYCLE:
        getattr(after, name)[:, :n_before] = getattr(before.ensemble, name)
    if len(anew):
        starts = plan.starts()[anew]
        again, more = plan._replace(progress=None).followed(starts, LANE_ROWS)
        fresh, seconds = plan.ensemble(again, more), seconds + more
        for name in Ensemble._fields[1:-2]:
            getattr(after, name)[anew] = getattr(fresh, name)
        done.lanes[anew] = again.lanes
    seconds += before.ensemble.seconds * before.ensemble.threads / plan.threads
    return Paused(after._replace(seconds=seconds), done.lanes, asked)


def _check_paused(before: object) -> None:
    is_paused = (
        isinstance(before, Paused)
        and isinstance(before.ensemble, Ensemble)
        and isinstance(before.lanes, np.ndarray)
        and isinstance(before.asked, dict | None)
    )
    if not is_paused:
        raise BadInput(f"before = {shown(before)}, must be None or what go_on has returned")


def _check_shape(plan: Plan, before: Paused) -> None:
    """Refuse arrays that are not those of the plan: numpy would repeat a single particle for all."""
    there, lanes = before.ensemble, before.lanes
    if there.energy0 != plan.energy0:
        raise BadInput(f"before: energy = {there.energy0}, must be {plan.energy0}")
    n, _, looks = plan.size
    minima, phases = plan.stops.mouth_minima.shape[1], looks - 1
    n_before = there.cycle_energies.shape[1] if np.ndim(there.cycle_energies) == 2 else 0
    shapes = {
        "lanes": (lanes, (n, LANE_ROWS)),
        "ensemble.cycle_energies": (there.cycle_energies, (n, n_before)),
        "ensemble.t_in": (there.t_in, (n, n_before, minima)),
        "ensemble.t_out": (there.t_out, (n, n_before, minima)),
        "ensemble.phase_energies": (there.phase_energies, (n, n_before, phases)),
        "ensemble.phase_captured": (there.phase_captured, (n, n_before, phases)),
    }
    for name, (array, shape) in shapes.items():
        if np.shape(array) != shape:
            raise BadInput(f"before: {name} has the shape {np.shape(array)}, must have {shape}")


def _check_same(there: dict[str, Any], asked: dict[str, Any]) -> None:
    # Two runs of one shape would be joined without a seam: some particles of one, some of the other.
    for name in dict.fromkeys((*asked, *there)):
        if repr(there.get(name)) != repr(asked.get(name)):  # a caller's own may not compare
            raise BadInput(f"before: {name} = {there.get(name)}, must be {asked.get(name)}")


def _passed(plan: Plan, before: Paused) -> tuple[int, int]:
    """Return how many cycles and stops an ensemble has passed, after a look at whether it can go on so."""
    n_cycles, n_before = plan.size[1], before.ensemble.cycle_energies.shape[1]
    if not 1 <= n_before <= n_cycles:
        raise BadInput(f"n_cycles = {n_cycles}, must be at least the {n_before} of before")
    n_passed = n_before * (len(plan.stops.times) // n_cycles)
    in_lanes = plan.prepared.in_lanes
    times = plan.stops.times
    if is_known_throughout(in_lanes, times[n_passed - 1]) != is_known_throughout(in_lanes, times[-1]):
        raise BadInput(
            f"n_cycles = {n_cycles}: beyond the time up to which lanes know the laws' phases. Lanes followed"
            f" the first {n_before} cycles: they cannot be gone on from"
        )
    return n_before, n_passed
