"""Faulty proved steppers: the second stepper with one mistake in it, as attacks meet a stepper.

Each makes the mistake that some families of attacks hunt. The mistake is there only while it answers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from math import fmod
from typing import Any

import msgspec
import pytest
from flint import arb, fmpq
from mpmath import fp

from conformance.arb.flight import BallFlight, Table, line_of
from conformance.arb.laws import BallBangBang, BallFourier
from conformance.arb.numbers import precision
from conformance.attacks import Attack, Claim
from conformance.attacks.search import as_certified, ball_ends, truths
from conformance.grading.agreement import Enclosed, exact, middle
from conformance.second_stepper import Answer, next_collision, roots, start
from conformance.second_stepper import step as stepper
from conformance.second_stepper.flight import SearchedFlight
from conformance.second_stepper.step import Met, Search
from scene import Collision, Outcome, Scene, State
from scene.states import ON_WALL
from scene.tables import period

Patch = Callable[[pytest.MonkeyPatch], None]


def claim(answers: Sequence[Answer]) -> Claim:
    """Return answers as a claim: collisions and horizons by the ends of their balls."""
    given = [
        Enclosed(answer.wall, [ball_ends(ball) for ball in answer.numbers])
        if answer.numbers
        else msgspec.convert({"outcome": answer.kind, "reason": answer.reason}, Outcome)
        for answer in answers
    ]
    return Claim(given)


def never_met(attack: Attack) -> Claim:
    """Claim that nothing is met before the horizon."""
    s = attack.state
    assert attack.t_end is not None
    dt, x, y, vx, vy = (Fraction(n) for n in (attack.t_end, s.x, s.y, s.vx, s.vy))
    dt -= Fraction(s.t)
    return Claim([exact(None, (dt, x + vx * dt, y + vy * dt, vx, vy))])


def replacing(owner: object, name: str) -> Callable[[Callable[..., Any]], Patch]:
    """Turn a function into the mistake of using it for an honest one."""
    return lambda function: lambda monkeypatch: monkeypatch.setattr(owner, name, function)


touched, jet = BallBangBang.touched, SearchedFlight.jet
first, first_root, judged = Search._first, roots.first_root, roots._judged


@contextmanager
def patched(patch: Patch) -> Iterator[None]:
    """Make the mistake, and mend it afterwards."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        patch(monkeypatch)
        yield


def faulty(patch: Patch) -> Callable[[Attack], Claim]:
    """Return the second stepper, with a mistake, as a proved stepper."""

    def prove(attack: Attack) -> Claim:
        with patched(patch):
            return claim(truths(attack))

    return prove


def one_piece(attack: Attack) -> Claim:
    """Let the first of all law pieces that an enclosed time touches decide alone, at the digits allowed."""
    assert attack.n_collisions is not None
    assert attack.working is not None
    bits = int(attack.working * 3.33) + 8

    def patch(monkeypatch: pytest.MonkeyPatch) -> None:
        knots_unseen(monkeypatch)
        monkeypatch.setattr(stepper, "bits_for", lambda scene, state: bits)

    with patched(patch):
        path = stepper.trajectory(attack.scene, attack.state, attack.n_collisions, attack.t_end, doublings=0)
        return claim(path)


@replacing(BallBangBang, "touched")
def knots_unseen(self: BallBangBang, local: Any) -> Any:
    """The piece that holds where an interval begins is taken to hold on all of it."""
    return touched(self, local)[:1]


def period_from_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """Knots are taken to begin at time 0."""
    _spoil(monkeypatch, BallBangBang, lambda law: setattr(law, "first", fmpq(0)))


def _spoil(monkeypatch: pytest.MonkeyPatch, kind: type, change: Callable[[Any], None]) -> None:
    """Change every law of a kind as soon as it is made."""
    made = kind.__init__  # type: ignore[misc]  # of the class, which no subclass replaces

    def init(self: Any, law: Any) -> None:
        made(self, law)
        change(self)

    monkeypatch.setattr(kind, "__init__", init)


@replacing(SearchedFlight, "jet")
def residual_forgotten(self: SearchedFlight, wall: Any, s: Any, within: Any = None) -> Any:
    """Ties are judged by f, not by f - f(0), and so is all that is far from the start."""
    found = jet(self, wall, s, within)
    is_late = wall in self.residuals and (isinstance(s, fmpq) or s > 2.0**-20)
    return (found[0] + self.residuals[wall], *found[1:]) if is_late else found


@replacing(start, "_is_near")
def size_of_all_time(at: SearchedFlight, wall: Any) -> bool:
    """A state is on the wall it names by the largest size of all time."""
    largest = max(arb(law.range()[1]).abs_upper() for law in at.table.laws.values())
    gap = at.jet(wall, arb(0))[0]
    return bool(abs(gap) < largest * (2 * largest if wall == "arc" else 1) * ON_WALL)


def corner_unseen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A state that names a wall is on no other."""
    sign = start._sign
    monkeypatch.setattr(start, "_sign", lambda at, wall: sign(at, wall) or int(at.state.wall is not None))
    near = start._near
    monkeypatch.setattr(
        start,
        "_near",
        lambda table, state, in_cap: tuple(
            w for w in near(table, state, in_cap=in_cap) if w != "base" or state.wall in (None, "base")
        ),
    )


@replacing(Search, "_at_limit")
def hit_at_end_counts(self: Search, walls: Any, limit: Any) -> Met:
    """A wall that is met exactly at the horizon is met before it."""
    return Met(walls[0], arb(limit))


def tie_guessed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two walls met together the first is answered; at the mouth's edge the mouth is shut."""
    monkeypatch.setattr(Search, "_tied", lambda self, found: Met(found[0].wall, found[0].time()))
    monkeypatch.setattr(Search, "_is_edge", lambda self, limit: False)
    monkeypatch.setattr(
        Search, "_is_mouth_open", lambda self, limit: not self.flight.jet("left", arb(limit))[0] < 0
    )
    hit_at_end_counts(monkeypatch)


@replacing(stepper, "first_root")
def blind_start(at: SearchedFlight, wall: Any, a: Any, b: Any) -> Any:
    """No wall is met in the first 1e-3 of a flight."""
    begin = b / 1024 if a == 0 else a
    return first_root(at, wall, begin, b) if at.jet(wall, arb(begin))[0] > 0 else None


@replacing(stepper, "first_root")
def ends_alone(at: SearchedFlight, wall: Any, a: Any, b: Any) -> Any:
    """A wall is met only if f is below 0 at the end of the search."""
    return None if at.jet(wall, arb(b))[0] > 0 else first_root(at, wall, a, b)


@replacing(roots, "is_never_swept")
def swept_begins_alone(at: SearchedFlight, wall: Any, a: Any, b: Any) -> bool:
    """A wall is not met over many periods if it never comes to where the flight is at their begin."""
    turn = at.table.turn
    return turn is not None and b - a > turn and roots._is_never_met(at.resting(wall, a), wall, turn)


def rounded_rates(scene: Scene, state: State, t_end: float) -> Outcome:
    """Answer a step in binary64, the wall's speed taken at the time of day as it rounds to binary64."""
    answer = next_collision(scene, state, t_end)
    (outcome,) = middle(as_certified([answer], state), state)
    if not isinstance(outcome, Collision):
        return outcome
    with precision(answer.bits):
        at = BallFlight(Table(scene), line_of(state))
        vx, vy = at.reflected(outcome.wall, arb(state.t + outcome.dt) - arb(state.t))
    place = outcome.dt, outcome.t, outcome.x, outcome.y
    return Collision(outcome.wall, *place, float(vx.mid()), float(vy.mid()))


def reduced_time(attack: Attack) -> Claim:
    """Take whole periods, rounded to binary64, off the start."""
    shared = period(attack.scene)
    assert shared is not None
    t = fmod(attack.state.t, float(shared.value(fp)))
    t_end = None if attack.t_end is None else attack.t_end - (attack.state.t - t)
    return claim(truths(attack._replace(state=msgspec.structs.replace(attack.state, t=t), t_end=t_end)))


def rough_terms(monkeypatch: pytest.MonkeyPatch) -> None:
    """A law is known to 2^-62 of its mean only, however small it is."""
    _spoil(monkeypatch, BallFourier, lambda law: setattr(law, "mean", law.mean * (1 + fmpq(1, 2**62))))


def few_harmonics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Harmonics beyond the third are dropped."""
    _spoil(monkeypatch, BallFourier, lambda law: setattr(law, "terms", law.terms[:3]))


def rounded_omega(monkeypatch: pytest.MonkeyPatch) -> None:
    """A period is turned into an omega in binary64."""

    def round_omega(law: BallFourier) -> None:
        omega = arb(float(arb(law.omega).mid()))
        law.terms = [(k * omega, arb(a), arb(b)) for k, a, b in law.harmonics]

    _spoil(monkeypatch, BallFourier, round_omega)


@replacing(Search, "_is_mouth_open")
def narrow_mouth(self: Search, limit: Any) -> bool:
    """The mouth is taken to be narrower by 1e-3 of itself."""
    rim = self.flight.width(arb(limit))[0] / 1000
    return all(self.flight.jet(wall, arb(limit))[0] > rim for wall in ("left", "right"))


def overflowing(attack: Attack) -> Claim:
    """Take a horizon for proved where (x . v)^2 is no binary64 number."""
    product = attack.state.x * attack.state.vx + attack.state.y * attack.state.vy
    is_in_range = 2.0**-1022 <= product * product <= 2.0**1023
    return claim(truths(attack)) if is_in_range else never_met(attack)


def impatient(attack: Attack) -> Claim:
    """Give a particle up, as never met, after 10 periods."""
    found = truths(attack)
    is_late = found[0].kind == "collision" and found[0].numbers[0] > 10
    return never_met(attack) if is_late else claim(found)


def resting(attack: Attack) -> Claim:
    """Take a particle at rest, or nearly, for never met."""
    is_at_rest = abs(attack.state.vx) + abs(attack.state.vy) < 2.0**-20
    return never_met(attack) if is_at_rest else claim(truths(attack))


@replacing(SearchedFlight, "reflected")
def still_wall(at: BallFlight, wall: Any, s: Any) -> Any:
    """A bounce forgets that the wall moves."""
    nx, ny = at.gradient(wall, s)
    vx, vy = at.balls[3:]
    push = 2 * (nx * vx + ny * vy) / (nx * nx + ny * ny)
    return vx - push * nx, vy - push * ny


@replacing(Search, "_first")
def last_wall(self: Search, walls: Any, begin: Any, limit: Any) -> Any:
    """Of several walls the one looked at last is answered."""
    hits = (first(self, (wall,), begin, limit) for wall in reversed(walls))
    return next(filter(None, hits), None)


@replacing(roots, "_judged")
def lazy_taylor(at: SearchedFlight, wall: Any, a: Any, b: Any) -> str:
    """An interval is passed when f > 0 at its middle."""
    return "positive" if at.jet(wall, arb((a + b) / 2))[0] > 0 else judged(at, wall, a, b)
