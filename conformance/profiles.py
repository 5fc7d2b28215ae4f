"""Statistical profiles: checks of ensembles that an implementation follows; seeded, rare false alarms.

Every test compares the mean of independent numbers in [0, B] with its exact or predicted value. For any
distribution the mean of n is off to either side, except with probability d, by at most
    B sqrt(log(2 / d) / (2 n)),                                                  Hoeffding 1963, theorem 2
    sqrt(2 V log(4 / d) / n) + 7 B log(4 / d) / (3 (n - 1)),  V the sample variance:
                                                      empirical Bernstein, Maurer and Pontil 2009, theorem 4
and so by the smaller of both at d / 2. The first is better for few particles, the second for many.

`alarm`, 1e-6 for a whole run, is split over its tests. Particles that are undecided or lost may have any
value in [0, B], so their share of B is added to the margin. A particle is lost if its outcome is neither
`horizon` nor `undecided`. Each test names an `alternative`, the mean that a likely fault would give. If the
margin reaches it, the test cannot detect the fault, and `has_power` is false.

Work identity. A flow keeps phase-space volume, so for every motion of the walls
    mean exp(-W / kT) = A(t) / A(0)     for canonical starts at kT, W = E1 - E0, A the area of the table.
exp(-W / kT) has a heavy tail if energies fall by half or more. Therefore starts are drawn at the higher
temperature kT / ratio and weighted. X = exp((ratio E0 - E1) / kT) / ratio has the same mean, and 0 <= X <=
1 / ratio if every particle keeps `ratio` of its energy. By default `ratio` is the product of (shortest /
longest)^2 over the lengths of the table. It bounds adiabatic losses for kT far above the energy of the
walls' speed. X is cut at 1 / ratio, so that a greater loss can only lower the mean.

Captured share and mean growth. For uniform starts of one energy far above the walls', theory predicts the
share p_nc never captured and the mean m1 of log E1 / E0 in the adiabatic limit. `bias` is the permitted
distance from this limit. The share is measured when nu is least, the mean after one cycle. A particle
counts as captured if it is in the cap on a chord that does not reach the mouth. log E1 / E0 is cut to its
range in theory, widened by `bias`.

Reversal. Time may be reversed, so a cycle takes E0 to E1 as often as its reverse takes E1 to E0, for every
motion of the walls. Starts are uniform in phase space between energies E and 4 E. Those that end there too,
with more energy, are as many as those of the reverse that end there with less. A cycle and its reverse,
particle by particle, give one number in [0, 1] of mean 1/2. The alternative is a stepper for which both
directions are alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan, log, nan, pi, prod, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from scene import BadInput, Horizon, Mushroom, Outcome, Scene, State, Undecided
from scene.geometry import area, table_at
from scene.protocol.wire import Captured, Flowing
from scene.transforms import backwards

Floats = npt.NDArray[np.float64]
ALARM = 1e-6
MAX_LOST = 0.01  # of the particles: if more are lost, the rest shows nothing


class Statistic(NamedTuple):
    """One test: measured mean, expected mean, margin, and the alternative to be detected.

    Attributes:
        n: particles in all, of which `lost` were lost and `undecided` left undecided.
    """

    name: str
    measured: float
    expected: float
    margin: float
    n: int
    lost: int
    alternative: float
    undecided: int = 0

    @property
    def is_met(self) -> bool:
        """Tell whether the mean is within its margin; nan is, if nothing arrived that was decided."""
        if isnan(self.measured) and self.undecided:
            return True
        return bool(abs(self.measured - self.expected) <= self.margin)

    @property
    def has_power(self) -> bool:
        """Tell whether the alternative would have been refused."""
        return bool(abs(self.alternative - self.expected) > self.margin)

    @property
    def is_depleted(self) -> bool:
        """Tell whether too many particles were lost."""
        return self.lost > MAX_LOST * self.n

    def __str__(self) -> str:
        """Return one line of text."""
        undecided = f", {self.undecided} undecided" if self.undecided else ""
        return (
            f"{self.name}: {self.measured:.5f}, must be {self.expected:.5f} within {self.margin:.5f}"
            f" ({self.n} particles, {self.lost} lost{undecided})"
        )


def work_identity(
    flow: Flowing,
    scene: Scene,
    *,
    n_particles: int,
    kT: float,
    times: Sequence[float] = (0.25, 0.5, 0.75),
    ratio: float | None = None,
    seed: int = 0,
    alarm: float = ALARM,
) -> list[Statistic]:
    """Test mean exp(-W / kT) = A(t) / A(0) at several times.

    Args:
        flow: (scene, states, t_end) -> outcome and capture interval of each state.
        scene: a valid scene that moves.
        n_particles: drawn anew for every time, >= 2.
        kT: temperature as an energy [length^2 / time^2], far above that of the walls' speed.
        times: of observation, as fractions of the period.
        ratio: smallest E1 / E0 that occurs, 0 < ratio <= 1; None derives it from the laws of the scene.
        seed: of the Philox streams.
        alarm: probability of a false alarm in all tests together.

    Returns:
        A statistic for each time.

    Raises:
        BadInput: the scene stands still, or an argument is outside its bounds.
    """
    span, ratio = _span(scene, alarm), least_ratio(scene) if ratio is None else ratio
    _check_range("ratio", ratio, 0.0, 1.0)
    _check_range("kT", kT, 0.0, 2.0**800)
    found = []
    for i, part in enumerate(times):
        states = canonical_states(scene, n_particles, kT / ratio, _generator(seed, i))
        arrived = flow(scene, states, part * span)
        pairs = [
            (_energy(s), _energy(o))
            for s, (o, _) in zip(states, arrived, strict=True)
            if isinstance(o, Horizon)
        ]
        e0, e1 = np.array(pairs).reshape(-1, 2).T
        x = np.minimum(np.exp((ratio * e0 - e1) / kT), 1.0) / ratio
        expected = area(scene, part * span) / area(scene, 0.0)
        found.append(
            _statistic(
                f"mean exp(-W/kT) at {part:g} T",
                x,
                expected,
                bound=1 / ratio,
                n=n_particles,
                undecided=_n_undecided(arrived),
                alarm=alarm / len(times),
                alternative=1.0,  # walls that do no work
            )
        )
    return found


def captured_share(
    flow: Flowing,
    scene: Mushroom,
    *,
    p_nc: float,
    n_particles: int,
    energy: float,
    bias: float,
    seed: int = 0,
    alarm: float = ALARM,
) -> Statistic:
    """Compare the share of free particles when nu is least with theory.

    Args:
        flow: as for `work_identity`.
        scene: a mushroom, nu greatest at t = 0.
        p_nc: share never captured, from `theory.predict`.
        n_particles: >= 2.
        energy: of every start [length^2 / time^2], far above that of the walls' speed.
        bias: permitted distance of the mean from the adiabatic limit.
        seed: of the Philox stream.
        alarm: probability of a false alarm.

    Raises:
        BadInput: the scene stands still, or an argument is outside its bounds.
    """
    narrowest = _span(scene, alarm) * least_nu(scene, scene.period)
    states = microcanonical_states(scene, n_particles, energy, _generator(seed, 0))
    ends = flow(scene, states, narrowest)
    arrived = [o for o, _ in ends if isinstance(o, Horizon)]
    free = np.array([not _is_captured(scene, o) for o in arrived], dtype=float)
    nobody = 1.0 if p_nc > 0.5 else 0.0  # is captured, or everybody
    found = _statistic(
        "p_nc",
        free,
        p_nc,
        bound=1.0,
        n=n_particles,
        undecided=_n_undecided(ends),
        alarm=alarm,
        alternative=nobody,
    )
    return found._replace(margin=found.margin + bias)


def mean_growth(
    flow: Flowing,
    scene: Mushroom,
    *,
    m1: float,
    largest: float,
    n_particles: int,
    energy: float,
    bias: float,
    seed: int = 0,
    alarm: float = ALARM,
) -> Statistic:
    """Compare the mean of log E1 / E0 over one cycle with theory.

    Args:
        flow: as for `work_identity`.
        scene: a mushroom, nu greatest at t = 0.
        m1: the mean, from `theory.predict`.
        largest: bound on |log E1 / E0| in theory.
        n_particles: as for `captured_share`.
        energy: as for `captured_share`.
        bias: as for `captured_share`.
        seed: as for `captured_share`.
        alarm: as for `captured_share`.

    Raises:
        BadInput: as for `captured_share`.
    """
    states = microcanonical_states(scene, n_particles, energy, _generator(seed, 1))
    ends = flow(scene, states, _span(scene, alarm))
    ended = [o for o, _ in ends if isinstance(o, Horizon)]
    widest = largest + bias
    with np.errstate(divide="ignore"):  # a particle that lost all its energy is cut, as all are
        change = np.log([_energy(o) / energy for o in ended])
    s = np.clip(change, -widest, widest) + widest
    found = _statistic(
        "m1",
        s,
        m1 + widest,
        bound=2 * widest,
        n=n_particles,
        undecided=_n_undecided(ends),
        alarm=alarm,
        alternative=widest,  # energy that does not grow
    )
    return found._replace(
        measured=found.measured - widest, expected=m1, margin=found.margin + bias, alternative=0.0
    )


def reversal(
    flow: Flowing, scene: Mushroom, *, n_particles: int, energy: float, seed: int = 0, alarm: float = ALARM
) -> Statistic:
    """Test that a cycle raises energies as often as its reverse lowers them.

    Args:
        flow: as for `work_identity`.
        scene: a mushroom that moves.
        n_particles: of each direction, >= 2.
        energy: least of the starts, the greatest is four times that [length^2 / time^2].
        seed: of the Philox streams.
        alarm: chance of a false alarm.

    Raises:
        BadInput: as for `captured_share`.
    """
    span = _span(scene, alarm)
    is_open = np.zeros(n_particles, bool)
    energies = np.empty((2, n_particles, 2))  # of the cycle and of its reverse; at the start and at the end
    for i, cycle in enumerate((scene, backwards(scene))):
        random = _generator(seed, 2 + i)
        energies[i, :, 0] = energy * (1 + 3 * random.random(n_particles))
        states = microcanonical_states(cycle, n_particles, energies[i, :, 0], random)
        ends = flow(cycle, states, span)
        energies[i, :, 1] = [_energy(o) if isinstance(o, Horizon) else np.nan for o, _ in ends]
        is_open |= [isinstance(o, Undecided) for o, _ in ends]
    energies = energies[:, np.isfinite(energies).all(axis=(0, 2))]
    gain, end = energies[..., 1] - energies[..., 0], energies[..., 1]
    stays = (energy < end) & (end < 4 * energy)
    raised, lowered = (stays & (gain > 0)).astype(float), (stays & (gain < 0)).astype(float)
    alike = float(1 + raised[0].mean() - lowered[0].mean()) / 2 if energies.size else 0.5
    x = (1 + raised[0] - lowered[1]) / 2
    return _statistic(
        "reversal",
        x,
        0.5,
        bound=1.0,
        n=n_particles,
        undecided=int(is_open.sum()),
        alarm=alarm,
        alternative=alike,
    )


def _span(scene: Scene, alarm: float) -> float:
    span = scene.period
    if not span:
        raise BadInput("scene: nothing moves, must have a law that does")
    _check_range("alarm", alarm, 0.0, 1.0)
    return span


def check_work_identity(flow: Flowing, scene: Scene, *, n_particles: int, kT: float, seed: int = 0) -> None:
    """Raise AssertionError, with one line, if `work_identity` fails or shows nothing.

    It shows nothing if too many particles are lost, or so many are undecided that anything would do.
    """
    findings = work_identity(flow, scene, n_particles=n_particles, kT=kT, seed=seed)
    require(findings)
    for finding in findings:
        if finding.undecided and not finding.has_power:
            raise AssertionError(f"{finding}: so many are undecided that anything would do")


def require(findings: Sequence[Statistic]) -> None:
    """Raise AssertionError, with one line, if a mean is not met or too many particles are lost."""
    why = "; ".join(map(str, findings))
    if not all(finding.is_met for finding in findings):
        raise AssertionError(why)
    if any(finding.is_depleted for finding in findings):
        raise AssertionError(f"{why}: at most {MAX_LOST:.0%} may be lost")


def margin(n: int, variance: float, bound: float, alarm: float) -> float:
    """Return how far the mean of n numbers in [0, bound] may be off, except with probability `alarm`.

    Args:
        n: number of independent numbers, at least 2.
        variance: of the sample; 0 for the smallest margin possible with n numbers.
        bound: upper bound of the numbers.
        alarm: the probability.
    """
    hoeffding, bernstein = log(4 / alarm), log(8 / alarm)  # each at half of the alarm
    return min(
        bound * sqrt(hoeffding / (2 * n)),
        sqrt(2 * variance * bernstein / n) + 7 * bound * bernstein / (3 * (n - 1)),
    )


def least_ratio(scene: Scene) -> float:
    """Return the product of (least / greatest)^2 over the lengths of the table."""
    found = [law.size_bounds() for name, law in scene.laws.items() if name in ("r", "w", "h")]
    return prod((law.lowest / law.highest) ** 2 for law in found)


def least_nu(scene: Mushroom, span: float) -> float:
    """Return the instant of least nu as a fraction of the period; of a plateau the middle."""
    parts = np.arange(4096) / 4096
    times = span * parts
    nu = scene.width.values(times) / scene.laws["r"].values(times)
    low = parts[nu <= nu.min() * (1 + 2.0**-40)]
    return float(low[0] + low[-1]) / 2


def canonical_states(scene: Scene, n: int, kT: float, random: np.random.Generator) -> list[State]:
    """Draw starts at t = 0 uniform in area, velocities Gaussian of variance kT each way."""
    v = sqrt(kT) * random.standard_normal((n, 2))
    return _states(scene, v, random)


def microcanonical_states(
    scene: Scene, n: int, energy: float | Floats, random: np.random.Generator
) -> list[State]:
    """Draw starts at t = 0 uniform in area and direction, all of one energy or each of its own (n,)."""
    angle = 2 * pi * random.random(n)
    return _states(scene, (np.sqrt(2 * energy) * np.stack([np.cos(angle), np.sin(angle)])).T, random)


def _states(scene: Scene, v: Floats, random: np.random.Generator) -> list[State]:
    now = table_at(fp, scene, 0.0)
    cap, stem = now.cap_area(), now.stem_area()
    pick, a, b = random.random((3, len(v)))
    across, depth = now.uniform_in_stem(a, b)
    is_in_cap = pick * (cap + stem) < cap
    x = np.where(is_in_cap, now.r * np.sqrt(a) * np.cos(pi * b), across)
    y = np.where(is_in_cap, now.r * np.sqrt(a) * np.sin(pi * b), -depth)
    return [State(0.0, *row) for row in np.column_stack([x, y, v]).tolist()]


def _is_captured(scene: Mushroom, at: Horizon) -> bool:
    spin = abs(at.x * at.vy - at.y * at.vx)
    return at.y > 0 and spin > scene.width.value(fp, at.t) * sqrt(2 * _energy(at))


def _energy(at: State | Horizon) -> float:
    # For a nonsensical answer it may be infinite; `**` would raise instead.
    return (at.vx * at.vx + at.vy * at.vy) / 2


def _generator(seed: int, stream: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, 0, stream]))


def _n_undecided(ends: Sequence[tuple[Outcome, Captured]]) -> int:
    return sum(isinstance(outcome, Undecided) for outcome, _ in ends)


def _statistic(
    name: str,
    x: Floats,
    expected: float,
    *,
    bound: float,
    n: int,
    undecided: int,
    alarm: float,
    alternative: float,
) -> Statistic:
    lost = n - len(x) - undecided
    if len(x) < 2:
        return Statistic(name, nan, expected, bound if undecided else 0.0, n, lost, alternative, undecided)
    allowed = margin(len(x), float(np.var(x, ddof=1)), bound, alarm) + bound * (n - len(x)) / n
    return Statistic(name, float(x.mean()), expected, allowed, n, lost, alternative, undecided)


def _check_range(field: str, number: float, low: float, high: float) -> None:
    if not low < number <= high:
        raise BadInput(f"{field} = {number!r}, must be above {low:g} and at most {high:g}")
