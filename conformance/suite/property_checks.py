"""The suite's second half: exact properties and statistical profiles, held to a command through its session.

Properties are asked on drawn questions (`disguise.drawn_states`): what they demand needs no certified answer.
Mirror and scaling hold bit for bit in good binary64 code; within rounding is enough to pass, and which it was
is said. Profiles follow ensembles through `flow`, where it is offered; their chance of a false alarm is below
1e-6, their size follows from the level alone, and what could not have failed at that size is `declined`.
The work identity is tested in a mushroom whose walls all move inward: every hit gives energy, so that
E1 >= E0 for each particle at any speed, and no weight is cut.
Not handled: what makes a question delicate; `conformance.properties` leaves those out itself.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import NamedTuple

import msgspec

import theory
from conformance import profiles, properties
from conformance.profiles import Statistic
from conformance.suite.process import NOT_NUMBERS, Trouble
from conformance.suite.promises.questions import flown
from conformance.suite.result import NamedVerdict
from conformance.suite.session import Session, missing
from scene import Fourier, Horizon, Mushroom, Outcome, Scene, State, Undecided, load, to_data
from scene.geometry import area
from scene.protocol.wire import Captured, Flowing
from scene.tables import cycle_length

NEEDS_FOURIER = ("static-limit",)  # asks for constants written as laws
BATCH = 100  # particles per flow request: a slow implementation stays within its time limit
KT = 1.0  # energy; that of the walls' own speed is up to 0.1
TIMES = (0.25, 0.5)  # all walls of SHRINKING move inward until half of the period
SCENE = "moving-cap"
SHRINKING = Mushroom(
    r=Fourier(mean=0.75, omega=1.0, cos=(0.25,)),
    h=Fourier(mean=0.75, omega=1.0, cos=(0.25,)),
    nu=Fourier(mean=0.5, omega=1.0, cos=(0.3,)),
)
MAX_UNDECIDED = 0.05  # of the steps of a property
PROFILES = ("work-identity", "captured-share", "mean-growth")


class Size(NamedTuple):
    """How many particles a profile follows, at which energy, and the distance granted from theory.

    Theory is the limit of high energy. At 1000, speed 45 against walls of 0.4, its m1 is off by 0.035 and its
    p_nc by 0.023; both fall as 1/speed. `bias` is twice that.
    """

    n_particles: int
    energy: float
    bias: float


# By level: a slow stepper is done in a minute at core, where a mean growth of 0 could not be told from m1.
SIZES = {
    "core": Size(400, 1000.0, 0.08),
    "extended": Size(4_000, 4000.0, 0.04),
    "stress": Size(4_000, 4000.0, 0.04),
}


def ask_properties(
    session: Session, questions: Sequence[tuple[Scene, State, float]]
) -> Iterator[NamedVerdict]:
    """Hold an implementation to every exact property.

    Args:
        session: open.
        questions: scene, state and t_end, of kinds that it offers.

    Yields:
        Name, verdict, reason, seconds: `declined` where too much was undecided, `unsupported` where the
        property needs more than is offered or has nothing to say; nothing when there are no questions.
    """
    assert session.introduction is not None
    for name, check in properties.PROPERTIES.items() if questions else ():
        begin = time.monotonic()
        if name in NEEDS_FOURIER and "fourier" not in session.introduction.laws:
            yield name, "unsupported", "law fourier", 0.0
            continue
        verdict, why = _hold(_Asking(session), check, questions)
        yield name, verdict, why, time.monotonic() - begin


class _Asking:
    """A session as a stepper, that counts what it leaves undecided."""

    def __init__(self, session: Session) -> None:
        self.session, self.n_asked, self.n_undecided = session, 0, 0

    def step(self, scene: Scene, state: State, t_end: float) -> Outcome:
        """Ask for one step."""
        outcome = self.session.step(scene, state, t_end)
        self.n_asked += 1
        self.n_undecided += isinstance(outcome, Undecided)
        return outcome


def _hold(
    asking: _Asking, check: Callable[..., bool], questions: Sequence[tuple[Scene, State, float]]
) -> tuple[str, str]:
    n_compared, is_exact = 0, "is_exact" in inspect.signature(check).parameters
    n_rounded = 0
    for question in questions:
        try:
            try:
                n_compared += check(asking.step, *question, **({"is_exact": True} if is_exact else {}))
            except AssertionError:
                if not is_exact:
                    raise
                n_compared += check(asking.step, *question, is_exact=False)
                n_rounded += 1
        except AssertionError as broken:
            return "fail", str(broken)
        except Trouble as trouble:
            return trouble.verdict, trouble.why
        except NOT_NUMBERS as error:
            return "fail", f"its answers cannot be calculated with: {error}"
    how = f", {n_compared - n_rounded} bit for bit" if is_exact else ""
    why = f"{n_compared} of {len(questions)} compared{how}"
    if asking.n_undecided > MAX_UNDECIDED * asking.n_asked:
        return "declined", f"{why}; {asking.n_undecided} of {asking.n_asked} steps were left undecided"
    return ("pass", why) if n_compared else ("unsupported", f"{why}: it is not about these scenes")


def ask_profiles(session: Session, level: str, seed: int) -> Iterator[NamedVerdict]:
    """Follow ensembles through `flow`; nothing when it, or what they need, is not offered.

    Args:
        session: open.
        level: core, extended or stress: how many particles.
        seed: of the starts.
    """
    scene = load(SCENE)
    assert session.introduction is not None
    assert isinstance(scene, Mushroom)
    if missing(session.introduction, "flow", to_data(scene)):
        return
    for name, test in zip(PROFILES, (_work_identity, _captured_share, _mean_growth), strict=True):
        begin = time.monotonic()
        try:
            findings = test(session, scene, SIZES[level], seed)
        except Trouble as trouble:
            yield name, trouble.verdict, trouble.why, time.monotonic() - begin
            continue
        except NOT_NUMBERS as error:
            yield name, "fail", f"its answers cannot be calculated with: {error}", time.monotonic() - begin
            continue
        yield name, *_judged(findings), time.monotonic() - begin


def _judged(findings: Sequence[Statistic]) -> tuple[str, str]:
    why = "; ".join(map(str, findings))
    if not all(finding.is_met for finding in findings):
        return "fail", why
    if any(finding.is_depleted for finding in findings):
        return "fail", f"{why}: at most {profiles.MAX_LOST:.0%} may be lost"
    if idle := [finding for finding in findings if not finding.has_power]:
        alternatives = ", ".join(f"{finding.alternative:g}" for finding in idle)
        return "declined", f"{why}: could not have failed at {alternatives}; a higher level follows more"
    return "pass", why


def _work_identity(session: Session, _: Mushroom, size: Size, seed: int) -> list[Statistic]:
    return profiles.work_identity(
        _flow(session),
        SHRINKING,
        n_particles=size.n_particles,
        kT=KT,
        times=TIMES,
        ratio=1.0,
        seed=seed,
        alarm=profiles.ALARM / len(PROFILES),
    )


def _captured_share(session: Session, scene: Mushroom, size: Size, seed: int) -> list[Statistic]:
    share = profiles.captured_share(
        _flow(session),
        scene,
        p_nc=float(_predicted().p_nc),
        **size._asdict(),
        seed=seed,
        alarm=profiles.ALARM / len(PROFILES),
    )
    return [share]


def _mean_growth(session: Session, scene: Mushroom, size: Size, seed: int) -> list[Statistic]:
    areas = [area(scene, cycle_length(scene) * k / 64) for k in range(64)]
    largest = math.log(max(areas) / min(areas))  # free particles keep E times the area at most
    m1, alarm = float(_predicted().m1), profiles.ALARM / len(PROFILES)
    if abs(m1) < size.bias + profiles.least_margin(size.n_particles, 2 * (largest + size.bias), alarm):
        raise Trouble("declined", f"not asked: {size.n_particles} particles cannot tell m1 from 0")
    return [
        profiles.mean_growth(
            _flow(session), scene, m1=m1, largest=largest, **size._asdict(), seed=seed, alarm=alarm
        )
    ]


@cache
def _predicted() -> theory.Prediction:
    """Return the theory of SCENE, which both profiles of a cycle are held to."""
    return theory.predict(load(SCENE), 10)


def _flow(session: Session) -> Flowing:
    def flow(scene: Scene, states: Sequence[State], t_end: float) -> list[tuple[Outcome, Captured]]:
        found: list[tuple[Outcome, Captured]] = []
        for start in range(0, len(states), BATCH):
            batch = flown(session, scene, states[start : start + BATCH], t_end)
            found += [_arrival(data, t_end) for data in batch]
        return found

    return flow


def _arrival(data: dict[str, object], t_end: float) -> tuple[Outcome, Captured]:
    captured = data.pop("captured", None)
    outcome: Outcome = msgspec.convert(data, Outcome)
    if isinstance(outcome, Horizon) and not math.isclose(outcome.t, t_end, rel_tol=properties.BOUND):
        raise Trouble("fail", f"a flow to t_end = {t_end!r} is answered at t = {outcome.t!r}")
    return outcome, captured if isinstance(outcome, Horizon) else None  # type: ignore[return-value]
