"""Statistical checks: what ensembles must show that an implementation carries through `flow`.

Their chance of a false alarm is below 1e-6 in a run, their size follows from the level alone, and what could
not have failed at that size is `declined`. The work identity is tested in a mushroom whose walls all move
inward: every hit gives energy, so that E1 >= E0 for each particle at any speed, and no weight is cut.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from typing import NamedTuple

import theory
from conformance import profiles, properties
from conformance.cases.draw import Draw
from conformance.profiles import Statistic
from conformance.suite.checks.form import Implementation, Question, SuiteCheck
from conformance.suite.process import CheckFailure
from conformance.suite.session import read_outcome
from scene import Fourier, Horizon, Mushroom, Outcome, Scene, State, load
from scene.geometry import area
from scene.protocol.wire import Captured, Flowing

BATCH = 100  # particles per flow request: a slow implementation stays within its time limit
KT = 1.0  # energy; that of the walls' own speed is up to 0.1
TIMES = (0.25, 0.5)  # all walls of SHRINKING move inward until half of the period
SCENE = "moving-cap"
SHRINKING = Mushroom(
    r=Fourier(mean=0.75, omega=1.0, cos=(0.25,)),
    h=Fourier(mean=0.75, omega=1.0, cos=(0.25,)),
    nu=Fourier(mean=0.5, omega=1.0, cos=(0.3,)),
)
REVERSED = 1000.0  # energy at which a trivial loop's directions differ most, and by how much in half shares
DIRECTED = 0.05
PROFILES = ("work-identity", "captured-share", "mean-growth", "reversal")
ALARM = profiles.ALARM / len(PROFILES)


class Size(NamedTuple):
    """How many particles a profile follows, at which energy, and the distance granted from theory.

    Theory is the limit of high energy. At 1000, speed 45 against walls of 0.4, its m1 is off by 0.035 and its
    p_nc by 0.023; both fall as 1/speed. `bias` is twice that.
    """

    n_particles: int
    energy: float
    bias: float


# By level: a slow stepper is done in a minute at core, where a mean growth of 0 is within the margin of m1.
SIZES = {
    "core": Size(400, 1000.0, 0.08),
    "extended": Size(4_000, 4000.0, 0.04),
    "stress": Size(4_000, 4000.0, 0.04),
}


def ensemble_checks(level: str) -> list[SuiteCheck]:
    """Return the statistical checks, of as many particles as a level has."""

    def asks(scene: Mushroom) -> Callable[[Draw, str], Iterator[Question]]:
        return lambda draw, _: iter([(scene, SIZES[level], draw.pick(range(2**30)))])

    scene, trivial = load(SCENE), load("moving-cap-trivial")
    assert isinstance(scene, Mushroom)
    assert isinstance(trivial, Mushroom)
    tests = (_work_identity, SHRINKING), (_captured_share, scene), (_mean_growth, scene), (_reversal, trivial)
    return [
        SuiteCheck(f"profile/{name}", asks(scene), partial(_hold, test), ("flow",))
        for name, (test, scene) in zip(PROFILES, tests, strict=True)
    ]


def _hold(
    test: Callable[..., list[Statistic]], side: Implementation, scene: Mushroom, size: Size, seed: int
) -> str:
    """Hold an ensemble to its statistics.

    Raises:
        CheckFailure: declined, where it could not have failed.
    """
    findings = test(partial(_flow, side), scene, size, seed)
    why = "; ".join(map(str, findings))
    assert all(finding.is_met for finding in findings), why
    assert not any(finding.is_depleted for finding in findings), (
        f"{why}: at most {profiles.MAX_LOST:.0%} may be lost"
    )
    if idle := [finding for finding in findings if not finding.has_power]:
        alternatives = ", ".join(f"{finding.alternative:g}" for finding in idle)
        raise CheckFailure(
            "declined", f"{why}: could not have failed at {alternatives}; a higher level follows more"
        )
    return why


def _work_identity(flow: Flowing, scene: Mushroom, size: Size, seed: int) -> list[Statistic]:
    return profiles.work_identity(
        flow, scene, n_particles=size.n_particles, kT=KT, times=TIMES, ratio=1.0, seed=seed, alarm=ALARM
    )


def _captured_share(flow: Flowing, scene: Mushroom, size: Size, seed: int) -> list[Statistic]:
    p_nc = float(_predicted().p_nc)
    return [profiles.captured_share(flow, scene, p_nc=p_nc, **size._asdict(), seed=seed, alarm=ALARM)]


def _mean_growth(flow: Flowing, scene: Mushroom, size: Size, seed: int) -> list[Statistic]:
    areas = [area(scene, scene.period * k / 64) for k in range(64)]
    largest = math.log(max(areas) / min(areas))  # free particles keep E times the area at most
    m1 = float(_predicted().m1)
    if abs(m1) < size.bias + profiles.margin(size.n_particles, 0.0, 2 * (largest + size.bias), ALARM):
        raise CheckFailure("declined", f"not asked: {size.n_particles} particles cannot tell m1 from 0")
    return [
        profiles.mean_growth(flow, scene, m1=m1, largest=largest, **size._asdict(), seed=seed, alarm=ALARM)
    ]


def _reversal(flow: Flowing, scene: Mushroom, size: Size, seed: int) -> list[Statistic]:
    n = size.n_particles
    if profiles.margin(n, 0.0, 1.0, ALARM) > DIRECTED:
        raise CheckFailure(
            "declined", f"not asked: {n} particles cannot tell a direction of time from the other"
        )
    return [profiles.reversal(flow, scene, n_particles=n, energy=REVERSED, seed=seed, alarm=ALARM)]


@cache
def _predicted() -> theory.Prediction:
    """Return the theory of SCENE, which both profiles of a cycle are held to."""
    return theory.predict(load(SCENE), 10)


def _flow(
    side: Implementation, scene: Scene, states: Sequence[State], t_end: float
) -> list[tuple[Outcome, Captured]]:
    found: list[tuple[Outcome, Captured]] = []
    for start in range(0, len(states), BATCH):
        for part in side.flown(scene, states[start : start + BATCH], t_end):
            outcome = read_outcome(part)
            if isinstance(outcome, Horizon) and not math.isclose(outcome.t, t_end, rel_tol=properties.BOUND):
                raise CheckFailure("fail", f"a flow to t_end = {t_end!r} is answered at t = {outcome.t!r}")
            found.append((outcome, part.get("captured")))
    return found
