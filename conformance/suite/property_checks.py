"""The suite's second half: exact properties and statistical profiles, held to a command through its session.

Properties are asked on steps of the corpus: what they demand needs no certified answer. Mirror and scaling
hold bit for bit in good binary64 code; within rounding is enough to pass, and which it was is said.
Profiles follow ensembles through `flow`, where it is offered; their chance of a false alarm is below 1e-6.
The work identity is tested in a mushroom whose walls all move inward: every hit gives energy, so that
E1 >= E0 for each particle at any speed, and no weight is cut.
Not handled: what makes a question delicate; `conformance.properties` leaves those out itself.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

import theory
from conformance import profiles, properties
from conformance.profiles import Captured, Statistic
from conformance.suite.process import Trouble
from conformance.suite.session import Session, missing
from conformance.vectors import Vector
from scene import Fourier, Horizon, Mushroom, Outcome, Scene, State, from_data, load, to_data
from scene.geometry import area
from scene.tables import cycle_length

NEEDS_FOURIER = ("static-limit",)  # asks for constants written as laws
N_QUESTIONS = 24  # per property, spread evenly over the steps of level core
BATCH = 100  # particles per flow request: a slow implementation stays within its time limit
BUDGET = 40.0  # seconds for all profiles
KT = 1.0  # energy; that of the walls' own speed is up to 0.1
TIMES = (0.25, 0.5)  # all walls of SHRINKING move inward until half of the period
SCENE = "moving-cap"
SHRINKING = Mushroom(
    r=Fourier(mean=0.75, omega=1.0, cos=(0.25,)),
    h=Fourier(mean=0.75, omega=1.0, cos=(0.25,)),
    nu=Fourier(mean=0.5, omega=1.0, cos=(0.3,)),
)
MAX_LOST = 0.01  # of the particles: more, and what was left has shown nothing
LIGHTER = 10  # times as many particles can be followed there: they are slow, and for a shorter time


class Size(NamedTuple):
    """How many particles go through the one cycle, at which energy, and the distance granted from theory.

    Theory is the limit of high energy. At 1000, speed 45 against walls of 0.4, its m1 is off by 0.035 and its
    p_nc by 0.023; both fall as 1/speed. `bias` is twice that.
    """

    n_particles: int
    energy: float
    bias: float


SIZES = (
    Size(10_000, 1000.0, 0.08),
    Size(2_000, 1000.0, 0.08),
    Size(200, 200.0, 0.18),
)  # first that BUDGET allows
# What calculating with numbers of a nonsense answer may raise, however a formula is written.
NOT_NUMBERS = (ArithmeticError, ValueError)
Verdict = tuple[str, str, str, float]  # name, verdict, why, seconds


def ask_properties(session: Session, chosen: Sequence[Vector]) -> Iterator[Verdict]:
    """Hold an implementation to every exact property.

    Args:
        session: open.
        chosen: vectors, whose steps at level core are the questions.

    Yields:
        Name, verdict, reason, seconds: `declined` where nothing could be compared, `unsupported` where
        the property needs more than is offered; nothing when there are no questions for it.
    """
    known = session.introduction
    assert known is not None
    steps = [
        v for v in chosen if v.kind == "step" and v.level == "core" and not missing(known, "step", v.scene)
    ]
    every = max(1, len(steps) // max(1, N_QUESTIONS))
    questions = [(from_data(v.scene), v.state, v.t_end) for v in steps[::every]][:N_QUESTIONS]
    if not questions:
        return
    for name, check in properties.PROPERTIES.items():
        begin = time.monotonic()
        if name in NEEDS_FOURIER and "fourier" not in known.laws:
            yield name, "unsupported", "law fourier", 0.0
            continue
        verdict, why = _hold(session, check, questions)
        yield name, verdict, why, time.monotonic() - begin


def _hold(
    session: Session, check: Callable[..., bool], questions: Sequence[tuple[Scene, State, float]]
) -> tuple[str, str]:
    n_compared, is_exact = 0, "is_exact" in inspect.signature(check).parameters
    n_rounded = 0
    for question in questions:
        try:
            try:
                n_compared += check(session.step, *question, **({"is_exact": True} if is_exact else {}))
            except AssertionError:
                if not is_exact:
                    raise
                n_compared += check(session.step, *question, is_exact=False)
                n_rounded += 1
        except AssertionError as broken:
            return "fail", str(broken)
        except Trouble as trouble:
            return trouble.verdict, trouble.why
        except NOT_NUMBERS as error:
            return "fail", f"its answers cannot be calculated with: {error}"
    how = f", {n_compared - n_rounded} bit for bit" if is_exact else ""
    return ("pass" if n_compared else "declined"), f"{n_compared} of {len(questions)} compared{how}"


def ask_profiles(session: Session) -> Iterator[Verdict]:
    """Follow two ensembles through `flow`; nothing when it, or what they need, is not offered."""
    scene = load(SCENE)
    assert session.introduction is not None
    assert isinstance(scene, Mushroom)
    if missing(session.introduction, "flow", to_data(scene)):
        return
    size = _affordable(session, scene)
    tests: dict[str, Callable[[], list[Statistic]]] = {
        "work-identity": lambda: profiles.work_identity(
            _flow(session),
            SHRINKING,
            n_particles=min(LIGHTER * size.n_particles, SIZES[0].n_particles),
            kT=KT,
            times=TIMES,
            ratio=1.0,
            alarm=profiles.ALARM / 2,
        ),
        "one-cycle": lambda: _one_cycle(session, scene, size),
    }
    for name, test in tests.items():
        begin = time.monotonic()
        try:
            findings = test()
        except Trouble as trouble:
            yield name, trouble.verdict, trouble.why, time.monotonic() - begin
            continue
        except NOT_NUMBERS as error:
            yield name, "fail", f"its answers cannot be calculated with: {error}", time.monotonic() - begin
            continue
        yield name, _judged(findings), "; ".join(map(str, findings)), time.monotonic() - begin


def _judged(findings: Sequence[Statistic]) -> str:
    if not all(finding.is_met for finding in findings):
        return "fail"
    return "declined" if any(finding.lost > MAX_LOST * finding.n for finding in findings) else "pass"


def _affordable(session: Session, scene: Mushroom) -> Size:
    states = profiles.microcanonical_states(scene, BATCH, SIZES[0].energy, np.random.default_rng(0))
    begin = 0.0
    try:
        for _ in range(2):  # the first may compile
            begin = time.monotonic()
            _flow(session)(scene, states, cycle_length(scene) / 16)
    except Trouble:
        return SIZES[-1]  # the profiles themselves will meet it again and say so
    # All profiles together follow every particle for some three cycles.
    seconds = (time.monotonic() - begin) / BATCH * 16 * 3
    return next((size for size in SIZES if size.n_particles * seconds < BUDGET), SIZES[-1])


def _one_cycle(session: Session, scene: Mushroom, size: Size) -> list[Statistic]:
    prediction = theory.predict(scene, 10)
    areas = [area(scene, cycle_length(scene) * k / 64) for k in range(64)]
    return profiles.one_cycle(
        _flow(session),
        scene,
        p_nc=float(prediction.p_nc),
        m1=float(prediction.m1),
        largest=math.log(max(areas) / min(areas)),  # free particles keep E times the area at most
        n_particles=size.n_particles,
        energy=size.energy,
        bias=size.bias,
        alarm=profiles.ALARM / 2,
    )


def _flow(session: Session) -> profiles.Flow:
    def flow(scene: Scene, states: Sequence[State], t_end: float) -> list[tuple[Outcome, Captured]]:
        found: list[tuple[Outcome, Captured]] = []
        for start in range(0, len(states), BATCH):
            batch = msgspec.to_builtins(list(states[start : start + BATCH]))
            request = {"cmd": "flow", "scene": to_data(scene), "states": batch, "t_end": t_end}
            answer = session.ask(request)
            arrived = answer.get("states")
            if arrived is None or len(arrived) != len(batch):
                raise Trouble("wrong-format", f"flow of {len(batch)} states was answered {answer}"[:200])
            found += [_arrival(data) for data in arrived]
        return found

    return flow


def _arrival(data: dict[str, object]) -> tuple[Outcome, Captured]:
    captured = data.pop("captured", None)
    outcome: Outcome = msgspec.convert(data, Outcome)
    return outcome, captured if isinstance(outcome, Horizon) else None  # type: ignore[return-value]
