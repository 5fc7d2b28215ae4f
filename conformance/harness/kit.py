"""An adapter kit: an engine that was not written for protocol 1 speaks it with one call.

Copy this file, or import it. An engine gives one of two things:

    serve_engine(name, next_hit)            (scene, state) -> (t, x, y, vx, vy) just after its next hit
    serve_parts(name, intersect, reflect)   the first crossing of one wall, and the bounce off it

The kit reads the questions, keeps the horizon, names the wall (least |f| / |grad f| at the place of the hit),
chains trajectories and flows, and times them. The plain stepper judges the states, and decides from an
engine's crossings which wall is first; where rounding leaves two answers open it says `undecided`. So may an
engine, by raising `UndecidedError`: a next hit does not tell how near it came to another wall, or to the
horizon. What it returns that is no hit (nan, a time that has passed) is answered as a failure of its own.
"""

import math
import sys
from collections.abc import Callable
from functools import partial
from time import perf_counter_ns
from typing import Any

from mpmath import fp
from msgspec.structs import replace

from conformance import plain
from conformance.plain import Flight, UndecidedError
from scene import Collision, Horizon, Outcome, Scene, State, Wall
from scene.geometry import table_at
from scene.protocol.messages import Answered, AnsweredCollision
from scene.protocol.wire import AnsweringStepper, OwnFailure, serve

__all__ = ["Hit", "UndecidedError", "serve_engine", "serve_parts"]
Hit = tuple[float, float, float, float, float]  # t, x, y, vx, vy, after the bounce
NextHit = Callable[[Scene, State], Hit | None]
# (scene, wall, state, after, until) -> the first s, after < s <= until, at which the wall's f falls through
# 0, at the time state.t + s, on the line of the flight, wherever the wall ends; None for none. On state.wall
# f(0) is 0.
Intersect = Callable[[Scene, Wall, State, float, float], float | None]
# (scene, wall, t, x, y, vx, vy) -> the velocity after the bounce.
Reflect = Callable[[Scene, Wall, float, float, float, float, float], tuple[float, float]]


def serve_engine(name: str, next_hit: NextHit) -> None:
    """Answer protocol 1 for an engine that finds the next hit; None for a particle that meets nothing.

    Args:
        name: of the engine.
        next_hit: (scene, state) -> t, x, y, vx, vy just after the next hit, however late. state.wall is the
            wall that the particle leaves; an engine that has no use for it takes the other five.
    """

    class Question(Flight):
        def outcome(self) -> Any:  # an answer as the protocol has it, without dt
            if refusal := self.refusal():
                return refusal
            if self.t_end == self.state.t:
                return self.horizon()
            if self.wall is None and self.y == self.vy == 0:
                raise UndecidedError("it flies along the mouth")
            answer = _answer_of(next_hit, self.scene, _leaving(self), self.t_end)
            if isinstance(answer, AnsweredCollision):
                at, s = answer, answer.t - self.state.t
                other = table_at(fp, self.scene, at.t).nearest_wall(at.x, at.y, but=at.wall)
                if abs(self.f(other, s)[0]) <= self.noise(other, s):
                    raise UndecidedError(f"{at.wall} and {other} are met at once, within rounding")
            return answer

    _serve(name, partial(plain.next_collision, flight=Question))


def serve_parts(name: str, intersect: Intersect, reflect: Reflect) -> None:
    """Answer protocol 1 for functions that intersect and reflect; the kit finds out which wall is first.

    Args:
        name: of the engine.
        intersect: see `Intersect`.
        reflect: see `Reflect`.
    """

    class Question(Flight):
        def first_root(self, wall: Wall, start: float, end: float) -> float | None:
            return intersect(self.scene, wall, _leaving(self), start, end)

        def bounce(self, wall: Wall, s: float) -> tuple[float, float]:
            return reflect(self.scene, wall, self.state.t + s, *self.place(s), self.vx, self.vy)

    _serve(name, partial(plain.next_collision, flight=Question))


def _leaving(flight: Flight) -> State:
    """Return a state that names its wall: on y = 0 of a cap or a stem that is the base, said or not."""
    return replace(flight.state, wall=flight.wall)


def _answer_of(next_hit: NextHit, scene: Scene, state: State, t_end: float) -> Answered:
    try:
        hit = next_hit(scene, state)
    except (ArithmeticError, ValueError) as error:  # of its arithmetic: it has no answer
        raise OwnFailure(f"the engine raised {type(error).__name__}: {error}") from None
    if hit is not None and not (all(map(math.isfinite, hit)) and hit[0] >= state.t):
        raise OwnFailure(f"the engine returned {hit}")
    if hit is None or hit[0] >= t_end:
        s = t_end - state.t
        return Horizon(t_end, state.x + s * state.vx, state.y + s * state.vy, state.vx, state.vy)
    t, x, y, vx, vy = hit
    wall = table_at(fp, scene, t).nearest_wall(x, y)
    return AnsweredCollision(wall=wall, t=t, x=x, y=0.0 if wall == "base" else y, vx=vx, vy=vy)


def _serve(name: str, step: AnsweringStepper) -> None:
    def follow(scene: Scene, state: State, n_collisions: int, t_end: float) -> list[Answered | Outcome]:
        steps: list[Answered | Outcome] = []
        while len(steps) < n_collisions:
            steps.append(hit := step(scene, state, t_end))
            if not isinstance(hit, AnsweredCollision | Collision):
                break
            state = State(hit.t, hit.x, hit.y, hit.vx, hit.vy, hit.wall)
        return steps

    def collide(scene: Scene, state: State, t_end: float) -> Outcome:
        hit = step(scene, state, t_end)
        if not isinstance(hit, AnsweredCollision):
            return hit
        assert hit.wall is not None
        return Collision(hit.wall, hit.t - state.t, hit.t, hit.x, hit.y, hit.vx, hit.vy)

    def timed(
        scene: Scene, state: State, n_collisions: int, repeat: int
    ) -> tuple[list[int], Answered | Outcome]:
        ns = []
        for _ in range(repeat):
            begin = perf_counter_ns()
            steps = follow(scene, state, n_collisions, sys.float_info.max)
            ns.append(perf_counter_ns() - begin)
        return ns, steps[-1]

    serve(
        name,
        step,
        follow,
        sys.stdin.buffer,
        sys.stdout.buffer,
        flow=partial(plain.flow, step=collide),
        timer=timed,
    )
