"""How paths end, and flows: long ones whose arrivals are known, many particles in one, and ensembles.

A path has as many steps as asked for, or fewer and last what came instead, with its reason. Where walls at
rest are met head on, the place after any number of hits is known. In a flow of thousands, of twins, bad
states and late ones, each particle is answered as it is alone.

Statistical checks say what ensembles must show that an implementation carries through `flow`. Their chance of
a false alarm is below 1e-6 in a run, their size follows from the level alone, and what could not have failed
at that size is `declined`. The work identity is tested in a mushroom whose walls all move inward: every hit
gives energy, so that E1 >= E0 for each particle at any speed, and no weight is cut.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from typing import NamedTuple

from mpmath import fp
from msgspec.structs import replace

import theory
from conformance import plain, profiles, properties
from conformance.cases.draw import Draw
from conformance.profiles import Statistic
from conformance.suite.checks.bad_input import INSIDE, RESTING, move_inwards
from conformance.suite.checks.form import (
    FOREVER,
    PROMPT,
    Implementation,
    Question,
    SuiteCheck,
    octaves,
    rising,
)
from conformance.suite.checks.path_judge import CARRIED, answered_distance, crossing, distance
from conformance.suite.checks.paths import MAX_HITS, draw_start, nearly_captured
from conformance.suite.process import CheckFailure
from conformance.suite.session import read_outcome
from conformance.vectors import question
from scene import (
    Cap,
    Collision,
    Fourier,
    Horizon,
    Mushroom,
    Outcome,
    Scene,
    State,
    Stem,
    Undecided,
    load,
)
from scene.geometry import area, table_at
from scene.protocol.wire import Captured, Flowing

# At t = 0.5 and its like two walls are met at once, in numbers that are exact.
CORNERS: tuple[tuple[Scene, State, str], ...] = (
    (Mushroom(r=1.0, w=0.5, h=1.0), State(0.0, 0.25, -0.5, 0.5, -1.0), "corner"),
    (Mushroom(r=1.0, w=0.5, h=1.0), State(0.0, 0.25, 0.5, 0.5, -1.0), "mouth-edge"),
    (Cap(r=1.0), State(0.0, 0.5, 0.25, 1.0, -0.5), "corner"),
    (Cap(r=1.0), State(0.0, 0.75, 0.0, 0.1, 0.0, "base"), "sliding"),
    (Stem(w=1.0, h=1.5), State(0.0, 0.0, -0.75, 2.0, -1.5), "corner"),
    (Stem(w=1.0, h=1.5), State(0.0, 0.5, 0.0, 0.1, 0.0, "base"), "sliding"),
)
# Likewise after a hit: of the base at t = 0.25, before the corner at t = 1.
LATER = Stem(w=1.0, h=1.5), State(0.0, 0.0, -0.5, 1.0, 2.0)


def endings(draw: Draw, profile: str) -> Iterator[Question]:
    """Ask for no hits, for some, and for some that another end precedes."""
    for scene in RESTING:
        state = INSIDE[type(scene)]
        for n in (0, 1, 2 + draw.pick(range(8))):
            if profile == "trajectory":
                yield scene, state, n, FOREVER, ("collision",) * n
            if profile == "trajectory" or n == 1:
                yield scene, state, n, draw.part() * 2.0**-3, ("horizon",)[:n]
    for scene, state, reason in CORNERS:
        yield scene, state, 3, 10.0, (reason,)
    if profile == "trajectory":
        yield *LATER, 5, FOREVER, ("collision", "corner")
        yield *LATER, 5, 0.5, ("collision", "horizon")


def end_as_due(
    side: Implementation, scene: Scene, state: State, n: int, t_end: float, due: Sequence[str]
) -> bool:
    """Hold the outcomes, or the reasons of those that are undefined, to those that are due."""
    request = question(side.profile, scene, state, t_end, n)
    parts = side.parts(request)
    found = [part["reason"] if part["outcome"] == "undefined" else part["outcome"] for part in parts]
    if found[-1:] == ["undecided"] and len(found) <= len(due):
        if due[-1] not in ("collision", "horizon"):
            side.answers.excuse(request)
        return False
    where = f"{n} hits from {state} to {t_end} in {scene}"
    assert found == list(due), f"{where} are answered {found}, must be {list(due)}"
    return True


MAX_STATES = 2**12  # of a flow
ALONE = 2.0**-34  # of sizes: what a few bounces make of the rounding of a state among others


def returning(draw: Draw, profile: str) -> Iterator[Question]:
    """Fly head on between two walls at rest, as many hits as are drawn."""
    for n in rising(draw, 1, MAX_HITS):
        scene = draw.pick(RESTING)
        yield scene, draw.part(), math.floor(n) + draw.between(0.1, 0.9)


def arrive(side: Implementation, scene: Scene, begin: float, end: float) -> bool:
    """Hold a flow to where a particle is that flies to and fro: it is known after any number of hits.

    Args:
        side: the implementation, asked for a flow.
        scene: at rest.
        begin: distance from the lower wall, or the left one, as a part of that between both.
        end: the way flown, counted from that wall, likewise; one part takes a unit of time.
    """
    low, high = {Cap: (0.0, 1.0), Stem: (-1.25, 0.0), Mushroom: (-0.5, 0.5)}[type(scene)]
    length, fold = high - low, end % 2.0
    t_end, end_speed = end - begin, -length if fold > 1.0 else length
    at, to = low + length * begin, low + length * min(fold, 2.0 - fold)
    if isinstance(scene, Mushroom):
        start, due = State(0.0, at, -0.5, length, 0.0), Horizon(t_end, to, -0.5, end_speed, 0.0)
    else:
        start, due = State(0.0, 0.0, at, 0.0, length), Horizon(t_end, 0.0, to, 0.0, end_speed)
    n_hits = math.floor(end)
    side.require_time("hits of a flow", n_hits)
    (found,) = side.flown(scene, [start], t_end)
    side.keep_pace("hits of a flow", n_hits)
    arrival = read_outcome(found)
    if isinstance(arrival, Undecided):
        return False
    assert distance(scene, arrival, due) <= CARRIED, f"{start}: {arrival}, must be {due}, in {scene}"
    return True


def crowds(draw: Draw, profile: str) -> Iterator[Question]:
    """Ask flows of many states in any order: twins that differ in one field alone, bad ones, late ones."""
    for n in rising(draw, 1, MAX_STATES):
        scene, state = draw.pick((draw_start(draw), *[nearly_captured(draw, draw.between(0.1, 0.3))[:2]] * 2))
        size, span = float(table_at(fp, scene, state.t).size), crossing(scene, state)
        pool = [
            state,
            replace(state, x=state.x + 64 * size, wall=None),
            replace(state, t=state.t + 64 * span),
        ]
        scales = {"t": span, "x": size, "y": size, "vx": size / span, "vy": size / span}
        for near in octaves(draw, 2.0**-40, 2.0**-2):
            name = draw.pick(tuple(scales))
            pool.append(replace(state, **{name: getattr(state, name) + near * scales[name]}))
        hit = plain.next_collision(scene, state, FOREVER)
        assert isinstance(hit, Collision)
        # Off its wall by less than is allowed: with its name a state is on it, and without it is not.
        x, y = move_inwards(table_at(fp, scene, hit.t), hit.wall, hit.x, hit.y, 2.0**-22)
        on_wall = replace(hit.state(), x=float(x), y=float(y))
        pool += [hit.state(), on_wall, replace(on_wall, wall=None)]
        yield scene, pool, [draw.pick(range(len(pool))) for _ in range(math.ceil(n))], state.t + 1.5 * span


def together(
    side: Implementation, scene: Scene, pool: Sequence[State], order: Sequence[int], t_end: float
) -> bool:
    """Hold each state of a flow to be answered as alone, in its place, whatever the others are."""
    alone = {i: side.flown(scene, [pool[i]], t_end)[0] for i in sorted(set(order))}
    side.require_time("states of a flow", len(order))
    found = side.flown(scene, [pool[i] for i in order], t_end)
    side.keep_pace("states of a flow", len(order))
    n_compared = 0
    for place, (i, part) in enumerate(zip(order, found, strict=True)):
        own, t, where = alone[i], pool[i].t, f"states[{place}] of {len(order)}, {pool[i]}"
        kinds = {part["outcome"], own["outcome"]}
        assert len(kinds) == 1 or "undecided" in kinds, f"{where}: {part} among others, {own} alone"
        if kinds != {"horizon"}:
            continue
        n_compared += 1
        assert part == own or answered_distance(scene, part, own, t, t_end - t) <= ALONE, (
            f"{where}: {part} among others, {own} alone"
        )
    return bool(n_compared)


BATCH = 100  # particles per flow request, at most
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

    def asks(scene: Scene) -> Callable[[Draw, str], Iterator[Question]]:
        return lambda draw, _: iter([(scene, SIZES[level], draw.pick(range(2**30)))])

    tests: tuple[tuple[Callable[..., list[Statistic]], Scene], ...] = (
        (_work_identity, SHRINKING),
        (_captured_share, load(SCENE)),
        (_mean_growth, load(SCENE)),
        (_reversal, load("moving-cap-trivial")),
    )
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
    profiles.require(findings)
    why = "; ".join(map(str, findings))
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


def batch_size(seconds: float, timeout: float) -> int:
    """Return how many particles a flow request has, by the seconds that each took in the last one."""
    return max(1, min(BATCH, int(PROMPT * timeout / max(seconds, 1e-9))))


def _flow(
    side: Implementation, scene: Scene, states: Sequence[State], t_end: float
) -> list[tuple[Outcome, Captured]]:
    """Carry an ensemble, first a particle alone: that tells how many are answered in time together."""
    found: list[tuple[Outcome, Captured]] = []
    n_together = 1
    while len(found) < len(states):
        asked = states[len(found) : len(found) + n_together]
        parts = side.flown(scene, asked, t_end)
        n_together = batch_size(side.session.seconds / len(asked), side.session.limits.timeout)
        for part in parts:
            outcome = read_outcome(part)
            if isinstance(outcome, Horizon) and not math.isclose(outcome.t, t_end, rel_tol=properties.BOUND):
                raise CheckFailure("fail", f"a flow to t_end = {t_end!r} is answered at t = {outcome.t!r}")
            found.append((outcome, part.get("captured")))
    return found
