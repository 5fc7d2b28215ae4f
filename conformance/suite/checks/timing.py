"""Is an answer to `time` true: a trajectory's steps, and nanoseconds that the asking side's clock bears out?

What can be held to a clock on this side of the pipe: all repeats together last no longer than the answer took
to come; each further repeat makes the answer come later by what it is said to last; following another start
costs no more than following the same again (nothing is remembered); twice the collisions last longer. The
load of a machine delays answers: further tries are made after a pause, of longer paths that delays matter
less to, and a clock is taken for false only when every one of N_TRIES says so; except that no load makes the
sum of the repeats longer than the wait.
Not seen: a program that does part of its work outside its clock, once for each question.
"""

import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from conformance.cases.draw import Draw
from conformance.suite.checks.form import Implementation, Question
from conformance.suite.checks.path_judge import distance
from conformance.suite.process import CheckFailure
from conformance.suite.session import Session, read_outcome
from conformance.vectors import question
from scene import Cap, Collision, Fourier, Outcome, Scene, State, Stem, Undecided

N_STEPS = 60  # collisions of the trajectory that `time` and `trajectory` both follow
NEAR = 1e-6  # of sizes
LATE = 1e-3  # of time, after many collisions where motion is regular
READABLE = 0.02  # seconds that a question must take here, so that delays of milliseconds do not matter
MAX_COLLISIONS, MAX_REPEAT = 20_000, 1000
AMPLE = 3.0  # times as long as one repeat must the answer to many take
FACTOR = 4.0  # between nanoseconds that are said and those that are measured
GROWTH = 1.3  # twice the collisions last longer by this, at least
LONG = 0.2  # seconds, after which a path is made no longer
N_TRIES, PAUSE = 6, 0.25  # seconds: before the second try, twice as long before the third, and so on
DRIFT = 1.01  # of two clocks of one machine
# ns, two ticks of a clock that counts milliseconds: it says one for a short repeat during which it went on.
# So much may be said too much of an answer; `honest_clock` asks for long ones, where it is nothing.
TICK = 2e6
START = State(0.0, 0.1, 0.2, 3.0, 4.0)
_WAVE = Fourier(mean=1.0, cos=(0.1,), omega=1.0)
SCENES: tuple[Scene, ...] = (
    Cap(r=_WAVE),
    Stem(w=_WAVE, h=Fourier(mean=1.25, sin=(0.1,), omega=1.0), slope=0.1),
)


class Timing(NamedTuple):
    """One answer to `time`: what it says, in nanoseconds, the seconds that it took to come, and its end."""

    ns: list[int]
    seconds: float
    last: Outcome


def ask_time(session: Session, scene: Scene, state: State, n: int, repeat: int) -> Timing:
    """Ask for a timing, whatever its path ends in.

    Raises:
        CheckFailure: also fail, when it is no timing of so many repeats, or they cannot have taken place in
            the time that the answer took.
    """
    request = {**question("time", scene, state, 0.0, n), "repeat": repeat}
    begin = time.monotonic()
    answer = session.ask(request)
    seconds = time.monotonic() - begin
    if "error" in answer:
        raise CheckFailure("error", answer["error"])
    ns, steps = answer.get("ns"), answer.get("steps")
    if ns is None or steps is None or len(ns) != repeat or len(steps) != 1:
        raise CheckFailure("fail", f"{repeat} repeats are answered {answer}"[:300])
    if sum(ns) > DRIFT * 1e9 * seconds + TICK:
        waited = f"the answer came after {1e9 * seconds:.0f} ns"
        raise CheckFailure("fail", f"{repeat} repeats are said to last {sum(ns)} ns in all, and {waited}")
    return Timing(list(ns), seconds, read_outcome(steps[0], state.t))


def timed(session: Session, scene: Scene, state: State, n: int, repeat: int) -> Timing:
    """Ask for a timing of a path that goes on for ever.

    Raises:
        CheckFailure: as `ask_time` and `_collision`.
    """
    found = ask_time(session, scene, state, n, repeat)
    _collision(found.last)
    return found


def questions(draw: Draw, profile: str) -> Iterator[Question]:
    """Time a path in each table that moves: in a cap rounding hardly grows."""
    turned = replace(START, vx=START.vx * draw.between(0.9, 1.1))
    for scene in SCENES:
        yield scene, replace(turned, y=-turned.y) if isinstance(scene, Stem) else turned


def same_steps(
    side: Implementation, scene: Scene, state: State, counts: Sequence[int] = (1, 2, N_STEPS)
) -> bool:
    """Hold `time` to end where the trajectory does.

    Raises:
        CheckFailure: fail; what following it runs into.
    """
    for n in counts:
        last = timed(side.session, scene, state, n, 2).last
        truth = _last_collision(side.session, scene, state, n)
        if distance(scene, last, truth) > NEAR:
            raise CheckFailure("fail", f"the last of {n} collisions is {last} by time, {truth} by trajectory")
    return True


def honest_clock(side: Implementation, scene: Scene, state: State) -> bool:
    """Hold the nanoseconds that `time` says to those that pass."""
    session = side.session
    n, one = 10, timed(session, scene, state, 10, 1)  # it may compile
    while one.seconds < READABLE and n < MAX_COLLISIONS:
        n *= 2
        one = timed(session, scene, _other(state, n.bit_length()), n, 1)
    last = _collision(timed(session, scene, state, n, 1).last)
    truth = _last_collision(session, scene, state, n)
    if isinstance(scene, Cap) and abs(last.t - truth.t) > LATE * abs(truth.t - state.t):
        raise CheckFailure(
            "fail", f"{n} collisions last to {last.t:.6g} by time, to {truth.t:.6g} by trajectory"
        )
    objection = ""
    for i in range(N_TRIES):
        time.sleep(i * PAUSE)
        ones = [timed(session, scene, _other(state, 3 * i + k), n, 1) for k in range(3)]
        if not (objection := _objection(session, scene, state, n, ones)):
            return True
        if ones[0].seconds < LONG:
            n = min(4 * n, MAX_COLLISIONS)
    raise CheckFailure("fail", objection)


def _objection(session: Session, scene: Scene, state: State, n: int, ones: list[Timing]) -> str:
    """Say what the nanoseconds of one try do not bear out; empty when they do."""
    soonest, repeat = min(one.seconds for one in ones), 8
    many = timed(session, scene, state, n, repeat)
    while many.seconds < AMPLE * soonest and repeat < MAX_REPEAT:
        repeat = min(4 * repeat, MAX_REPEAT)
        many = timed(session, scene, state, n, repeat)
    twice = timed(session, scene, state, 2 * n, 3)
    said = sum(many.ns) / repeat  # a load delays some repeats, here as there
    each = 1e9 * (many.seconds - soonest) / (repeat - 1)
    if not FACTOR * said > each:
        later = f"makes the answer {each:.0f} ns later"
        return f"a repeat of {n} collisions is said to last {said:.0f} ns, and {later}"
    if said > FACTOR * each:
        return f"{repeat} repeats are said to last {said:.0f} ns each, but are answered as if made once"
    anew, again = min(one.ns[0] for one in ones), min(many.ns)
    if anew > FACTOR * again:
        return f"a new start is said to last {anew} ns, the same again {again} ns: it is not followed anew"
    if not min(twice.ns) > GROWTH * again:
        return f"{n} collisions are said to last {again} ns, {2 * n} of them {min(twice.ns)} ns"
    return ""


def _other(state: State, i: int) -> State:
    """Return another start like it."""
    return replace(state, x=state.x + (i + 1) * 2.0**-12)


def _last_collision(session: Session, scene: Scene, state: State, n: int) -> Collision:
    """Follow n collisions, and return the last."""
    side = Implementation(session, "time").by("trajectory", "step", scene=scene)
    return _collision(side.path(scene, state, n)[-1])


def _collision(last: Outcome) -> Collision:
    """Return the end of a path that goes on for ever.

    Raises:
        CheckFailure: declined where it is undecided, fail where it is no collision.
    """
    if isinstance(last, Undecided):
        raise CheckFailure("declined", f"undecided: {last.reason}")
    if not isinstance(last, Collision):
        raise CheckFailure("fail", f"a path that goes on for ever ends with {last}")
    return last
