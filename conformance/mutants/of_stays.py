"""Mutants that carry a particle rightly and tell its captured stay wrongly, or its end.

Part of `conformance.mutants`, which lists them; a docstring is the fault. Only flows kill them.
"""

# ruff: noqa: D102 (a class says what its one method does wrong)

from __future__ import annotations

from math import hypot

from msgspec.structs import replace

from conformance.plain.flow import PlainPath, Stay, misses_mouth, width
from conformance.plain.step import SIDES, Flight
from scene import Collision, Horizon, Mushroom, Outcome, State
from scene.protocol.wire import Captured
from scene.tables import laws


class CapturedByVelocityAfter(PlainPath):
    """Asks whether an arc hit is captured with the speed after the bounce."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        return misses_mouth(width(scene, hit.t), hit, hit.vx, hit.vy)


class CapturedByMouthAtDeparture(PlainPath):
    """Asks whether an arc hit is captured with the mouth that was there at departure."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        return misses_mouth(width(scene, self.state.t), hit, self.state.vx, self.state.vy)


class CapturedByMouthAtStart(PlainPath):
    """Asks whether an arc hit is captured with the mouth as it was before the first flight."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        return misses_mouth(width(scene, 0.0), hit, self.state.vx, self.state.vy)


class CapturedByRatioForWidth(PlainPath):
    """Compares the distance from the centre with w / r in place of w."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        radius = Flight.kinds[type(scene.r)](scene.r, hit.t).value
        return misses_mouth(width(scene, hit.t) / radius, hit, self.state.vx, self.state.vy)


class CapturedBySpinAlone(PlainPath):
    """Compares the angular momentum with w, and forgets the speed."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        spin = abs(hit.x * self.state.vy - hit.y * self.state.vx)
        return spin > width(scene, hit.t)


class CapturedByCosine(PlainPath):
    """Takes the part of the velocity along the radius for that across."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        vx, vy = self.state.vx, self.state.vy
        return abs(hit.x * vx + hit.y * vy) > width(scene, hit.t) * hypot(vx, vy)


class CapturedInOneSenseOnly(PlainPath):
    """Compares x vy - y vx without its size: a particle that turns clockwise is never captured."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        vx, vy = self.state.vx, self.state.vy
        return hit.x * vy - hit.y * vx > width(scene, hit.t) * hypot(vx, vy)


class CapturedByFullWidth(PlainPath):
    """Takes the half-width of the mouth for its whole width."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        return misses_mouth(width(scene, hit.t) / 2, hit, self.state.vx, self.state.vy)


class CapturedToleratingLittle(PlainPath):
    """Takes a hit for captured though it misses that by five parts in a hundred."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        return misses_mouth(0.95 * width(scene, hit.t), hit, self.state.vx, self.state.vy)


class EveryArcHitCaptured(PlainPath):
    """Takes every arc hit for captured."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        return True


class NothingCaptured(PlainPath):
    """Tells no stay at all."""

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        return False


class StayCutAtBase(PlainPath):
    """Ends a stay where the base is met."""

    def watch(self, hit: Collision) -> None:
        super().watch(hit)
        if hit.wall == "base":
            self.close(hit.t)


class StayCutAtFreeHit(PlainPath):
    """Ends a stay for good at the first arc hit that is not captured."""

    def watch(self, hit: Collision) -> None:
        super().watch(hit)
        if self.stay.end is not None:
            self.close(hit.t)


class StayEndsBelowOnly(PlainPath):
    """Lets a stay go on through arc hits that are not captured, until a wall of the stem is met."""

    def watch(self, hit: Collision) -> None:
        super().watch(hit)
        self.stay = Stay(self.stay.begin)


class StaysJoined(PlainPath):
    """Does not end a stay below the mouth: a later captured hit goes on with it."""

    def watch(self, hit: Collision) -> None:
        if hit.wall not in SIDES:
            super().watch(hit)


class StayEndsWithLastCapturedHit(PlainPath):
    """Ends a stay with its last captured hit, not with the first that is not."""

    last = 0.0

    def watch(self, hit: Collision) -> None:
        super().watch(hit)
        if self.stay.begin is not None and self.stay.end is None and hit.wall == "arc":
            self.last = hit.t

    def close(self, t: float) -> None:
        self.stay = Stay(self.stay.begin, self.last)
        super().close(t)


class StayBeginsWithTheHitBefore(PlainPath):
    """Begins a stay with the arc hit before its first captured one."""

    before: float | None = None

    def watch(self, hit: Collision) -> None:
        fresh = self.stay.begin is None
        super().watch(hit)
        if fresh and self.stay.begin is not None and self.before is not None:
            self.stay = Stay(self.before)
        if hit.wall == "arc":
            self.before = hit.t


class StayBeginsWithTheHitAfter(PlainPath):
    """Begins a stay with the second of its captured hits."""

    n_captured = 0

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        is_captured = super().is_captured(scene, hit)
        self.n_captured = self.n_captured + 1 if is_captured else 0
        return self.n_captured > 1


class StayBeginsAtTheStart(PlainPath):
    """Begins the stay of a particle that starts captured with the start, not with its first hit."""

    def watch(self, hit: Collision) -> None:
        begin = self.state.t if self.n_hits == 1 else hit.t
        fresh = self.stay.begin is None
        super().watch(hit)
        if fresh and self.stay.begin is not None:
            self.stay = Stay(begin)


class StayOnAtTheEndForgotten(PlainPath):
    """Tells no stay that is on at t_end."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, stay = super().arrival()
        return outcome, None if stay and stay[1] == self.t_end else stay


class StayOnAtTheEndCutAtLastHit(PlainPath):
    """Ends a stay that is on at t_end with the last hit before."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, stay = super().arrival()
        return outcome, (stay[0], self.state.t) if stay and stay[1] == self.t_end else stay


class LastStayTold(PlainPath):
    """Tells the last captured stay in place of the first."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, _ = super().arrival()
        return outcome, self.stays[-1] if self.stays else None


class LongestStayTold(PlainPath):
    """Tells the longest captured stay in place of the first."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, _ = super().arrival()
        return outcome, max(self.stays, key=lambda stay: stay[1] - stay[0], default=None)


class AllStaysAsOne(PlainPath):
    """Tells from the begin of the first captured stay to the end of the last."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, _ = super().arrival()
        return outcome, (self.stays[0][0], self.stays[-1][1]) if self.stays else None


class StayBackToFront(PlainPath):
    """Tells the end of a stay before its begin."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, stay = super().arrival()
        return outcome, stay and (stay[1], stay[0])


class StayCountedFromTheStart(PlainPath):
    """Counts the times of a stay from the start of the flow."""

    def arrival(self) -> tuple[Outcome, Captured]:
        begin = self.state.t
        outcome, stay = super().arrival()
        return outcome, stay and (stay[0] - begin, stay[1] - begin)


class StayAsBeginAndLength(PlainPath):
    """Tells the length of a stay for its end."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, stay = super().arrival()
        return outcome, stay and (stay[0], stay[1] - stay[0])


class FlowEndsAtLastCollision(PlainPath):
    """Gives the place of the last collision for that at t_end."""

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, stay = super().arrival()
        at = self.state
        return Horizon(self.t_end, at.x, at.y, at.vx, at.vy) if isinstance(
            outcome, Horizon
        ) else outcome, stay


class FlowGoesOnToTheNextCollision(PlainPath):
    """Gives the place of the first collision after t_end for that at t_end."""

    def arrival(self) -> tuple[Outcome, Captured]:
        end, self.t_end = self.t_end, 1e9
        outcome: Outcome = Horizon(end, self.state.x, self.state.y, self.state.vx, self.state.vy)
        while self.state.t < end:
            outcome = self.advance()
            if not isinstance(outcome, Collision):
                return outcome, None
            outcome = Horizon(end, outcome.x, outcome.y, outcome.vx, outcome.vy)
        self.close(end)
        return outcome, self.stays[0] if self.stays else None


class SlopeIgnoredInFlow(PlainPath):
    """Carries particles as if the sides were upright; its steps are right."""

    def arrival(self) -> tuple[Outcome, Captured]:
        if "slope" in laws(self.scene):
            self.scene = replace(self.scene, slope=0.0)
        return super().arrival()


class LawsHeldInFlow(PlainPath):
    """Carries particles through the table as it stands at the start; its steps are right."""

    def arrival(self) -> tuple[Outcome, Captured]:
        held = {
            name: Flight.kinds[type(law)](law, self.state.t).value for name, law in laws(self.scene).items()
        }
        self.scene = type(self.scene)(**held)
        return super().arrival()


class VelocityBeforeLastBounceTold(PlainPath):
    """Forgets the last bounce in the velocity at t_end."""

    last: State | None = None

    def departure(self, hit: Collision) -> State:
        self.last = self.state
        return super().departure(hit)

    def arrival(self) -> tuple[Outcome, Captured]:
        outcome, stay = super().arrival()
        if isinstance(outcome, Horizon) and self.last is not None:
            outcome = replace(outcome, vx=self.last.vx, vy=self.last.vy)
        return outcome, stay
