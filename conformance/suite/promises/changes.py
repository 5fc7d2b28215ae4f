"""The promise that a question with one part changed is another question, whatever was asked before.

What an implementation keeps of a scene or of an answer it finds again by a key, and a key that leaves a part
of the question out finds what belongs to another: the answer without the wall, the table with the second
harmonic of the last one, with its period, its knots or its times, with `nu` for `w`. So scenes are asked
about one after the other that differ in one such part and in nothing else, each from the same state, and the
base again at last. No answer is known beforehand. But each hit must lie where its flight leads, on its wall,
as the law of its own scene has it, and bounce off that: a hit found with the law of another scene lies beside
by a hundredth or so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import hypot, sqrt

from mpmath import fp
from msgspec.structs import replace

from conformance.suite.process import Trouble
from conformance.suite.promises.questions import FOREVER, NEAR, follow_on, off_wall, offered
from conformance.suite.session import Session
from scene import (
    BangBang,
    Cap,
    Collision,
    Fourier,
    Law,
    Mushroom,
    Outcome,
    Rejected,
    Scene,
    State,
    Stem,
    Undecided,
    Wall,
)
from scene.geometry import table_at

COARSE = 2.0**-28  # of a time of size 1; see conformance.suite.promises.sameness
ASIDE = 2.0**-22  # how far off its wall a state is: a quarter of what is allowed there
WAVES = Fourier(mean=1.0, omega=1.0, cos=(0.05, 0.04), sin=(0.02, 0.0, 0.03))
OTHER_WAVES = (
    replace(WAVES, cos=(0.05, -0.04)),
    replace(WAVES, cos=(0.05, 0.04, 0.05)),
    replace(WAVES, sin=(0.02, 0.05, 0.03)),
    replace(WAVES, sin=(0.02, 0.0, -0.03)),
    replace(WAVES, cos=WAVES.sin, sin=WAVES.cos),
    replace(WAVES, omega=2.0),
    replace(WAVES, omega=None, period=4.0),
    replace(WAVES, omega=None, period=5.0),
)
LEGS = BangBang(knots=((0.0, 1.0), (0.5, 1.25), (1.5, 0.875), (3.0, 1.0)))
OTHER_LEGS = (
    BangBang(knots=((0.0, 1.0), (0.5, 1.125), (1.5, 0.875), (3.0, 1.0))),
    BangBang(knots=((0.0, 1.0), (0.5, 1.25), (2.0, 0.875), (3.0, 1.0))),
    BangBang(knots=((0.0, 1.0), (0.75, 1.25), (1.5, 0.875), (3.0, 1.0))),
    BangBang(knots=((0.0, 1.0), (1.0, 1.25), (3.0, 0.875), (6.0, 1.0))),
    BangBang(knots=((-0.5, 1.0), (0.0, 1.25), (1.0, 0.875), (2.5, 1.0))),
)
UP, DOWN = State(0.0, 0.1, 0.3, 0.4, 0.9), State(0.0, 0.1, -0.3, 0.1, -0.8)
WIDE, ACROSS = State(0.0, 0.1, -0.6, 0.8, -0.1), State(0.0, 0.1, -0.6, 0.4, -0.1)


def _slope(law: Law) -> Law:
    """Return a law that moves likewise about 0."""
    if isinstance(law, Fourier):
        return replace(law, mean=0.0)
    assert isinstance(law, BangBang)
    return BangBang(knots=tuple((t, value - 1.0) for t, value in law.knots))


def _half(law: Law) -> Law:
    """Return half of a law."""
    if isinstance(law, Fourier):
        parts = (tuple(part / 2 for part in parts) for parts in (law.cos, law.sin))
        return replace(law, mean=law.mean / 2, **dict(zip(("cos", "sin"), parts, strict=True)))
    assert isinstance(law, BangBang)
    return BangBang(knots=tuple((t, value / 2) for t, value in law.knots))


# How a law moves a table, and a start whose first hit is of a wall that this law moves.
MOVED: tuple[tuple[Callable[[Law], Scene], State], ...] = (
    (lambda law: Cap(r=law), UP),
    (lambda law: Stem(w=law, h=1.25), WIDE),
    (lambda law: Stem(w=1.0, h=law), DOWN),
    (lambda law: Stem(w=1.0, h=1.25, slope=_slope(law)), WIDE),
    (lambda law: Mushroom(r=law, w=0.5, h=1.0), UP),
    (lambda law: Mushroom(r=1.0, w=_half(law), h=1.0), ACROSS),
    (lambda law: Mushroom(r=1.0, nu=_half(law), h=1.0), ACROSS),
    (lambda law: Mushroom(r=1.0, w=0.5, h=law), DOWN),
    (lambda law: Mushroom(r=1.0, w=0.5, h=1.0, slope=_slope(law)), ACROSS),
)


def families() -> Iterator[tuple[State, list[Scene]]]:
    """Return starts, and scenes to ask about from each: the first is the base, the others differ from it."""
    for table, state in MOVED:
        yield state, [table(law) for law in (WAVES, *OTHER_WAVES)]
        yield state, [table(law) for law in (LEGS, *OTHER_LEGS)]
    yield ACROSS, [Mushroom(r=2.0, nu=0.25, h=1.0), Mushroom(r=2.0, w=0.25, h=1.0)]
    yield DOWN, [Stem(w=1.0, h=1.25), Stem(w=1.25, h=1.0)]


def changed_questions(session: Session) -> str:
    """A question that differs from one before in a single part is answered as itself.

    Raises:
        Trouble: fail for an answer that belongs to another question; declined where one is undecided;
            unsupported where nothing can be asked.
    """
    found = [*_named_or_not(session), *_changed_scenes(session)]
    if not found:
        raise Trouble("unsupported", "no table is offered, or no laws of any kind")
    if n_open := sum(isinstance(outcome, Undecided) for outcome in found):
        raise Trouble("declined", f"{n_open} of {len(found)} questions are undecided")
    return f"{len(found)} questions"


def _changed_scenes(session: Session) -> Iterator[Outcome]:
    for state, (base, *others) in families():
        for scene in (base, *others, base):
            for profile in ("step", "trajectory"):
                try:
                    offered(session, (scene,), profile)
                except Trouble:
                    continue
                if profile == "step":
                    outcome = session.step(scene, state, FOREVER)
                else:
                    (outcome,) = follow_on(session, scene, state, 1)
                yield outcome
                if not isinstance(outcome, Undecided) and (flaw := flaw_of(scene, state, outcome)):
                    raise Trouble("fail", f"{profile}: {outcome} {flaw}, from {state} in {scene}")


def flaw_of(scene: Scene, state: State, hit: Outcome) -> str:
    """Say why an outcome is no hit of this scene; empty when it may be one."""
    if not isinstance(hit, Collision):
        return "comes where a wall must be met"
    table, speed = table_at(fp, scene, hit.t), hypot(state.vx, state.vy)
    if not off_wall(scene, hit) <= NEAR:
        return "is off its wall"
    dt = hit.t - state.t
    off = hypot(hit.x - state.x - state.vx * dt, hit.y - state.y - state.vy * dt)
    if not off <= NEAR * float(table.size):
        return "is off its flight"
    nx, ny = table.normal(hit.wall, hit.x, hit.y)
    along = state.vx * nx + state.vy * ny + table.receding(hit.wall, hit.y)
    wrong = hypot(hit.vx - state.vx + 2 * along * nx, hit.vy - state.vy + 2 * along * ny)
    return "" if wrong <= NEAR * (speed + 2 * abs(along)) else "does not bounce off its wall"


def _named_or_not(session: Session) -> Iterator[Outcome]:
    """Ask about states nearly on a wall, which they name, and do not, and name again."""
    for scene in (Cap(r=1.0), Mushroom(r=1.0, w=0.5, h=1.0), Stem(w=1.0, h=1.25)):
        try:
            offered(session, (scene,), "step")
        except Trouble:
            continue
        is_stem = isinstance(scene, Stem)
        own: Wall = "left" if is_stem else "arc"
        y, edge = (-0.6, 1.0) if is_stem else (0.6, 0.8)
        for aside in (ASIDE, -ASIDE):
            x = aside - edge
            # From the arc, where f begins at 0, a chord is twice as long as to its middle.
            named, bare = (edge - x, edge - x) if is_stem else (-2.0 * x, sqrt(1.0 - y * y) - x)
            asked: tuple[tuple[Wall | None, float], ...] = ((own, named), (None, bare), (own, named))
            for wall, due in asked:
                state = State(0.0, x, y, 1.0, 0.0, wall)
                outcome = session.step(scene, state, 10.0)
                yield outcome
                if isinstance(outcome, Undecided):
                    continue
                if wall is None and aside < 0:
                    if not isinstance(outcome, Rejected):
                        raise Trouble("fail", f"{state} is beyond its wall, is answered {outcome}")
                elif not (isinstance(outcome, Collision) and abs(outcome.t - due) <= COARSE):
                    raise Trouble("fail", f"{state}: {outcome}, must be a collision at t = {due!r}")
