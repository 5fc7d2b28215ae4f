"""One cycle of a mushroom: its start, its period, when particles are captured and released (secs. 3.2, 3.5).

The cycle starts at a highest maximum of nu, where every particle that can leave the island has left
it. Several intervals of capture nest as `theory.valleys` tells. What stays in the island at all
times, delta(nu_max) of the cap, takes no part.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from mpmath import MPContext

from scene.refusal import BadInput, check_count
from scene.tables import Scene, period
from theory.constants import guarded, settle
from theory.given import MAX_DIGITS, one_of
from theory.parameters import MovingMushroom
from theory.valleys import CapturePiece, Valley, stretches, tolerance, valley
from theory.volumes import as_mushroom

# Digits beyond those asked. A loop that binary64 cannot tell from a trivial one has g - 1 ~ 1e-16 and
# m1 ~ 1e-32; with 40 more digits such an m1 still differs from zero.
GUARD = 40


@dataclass(frozen=True)
class Cycle:
    """One period of a mushroom, from the time at which nu starts to fall.

    Attributes:
        ctx: private number system, GUARD digits wider than asked.
        digits: the digits asked.
        start: time at which capture starts, the end of nu's maximum [time].
        period: the cycle's length [time]; None for a static table.
        nu_max: largest mouth.
        nu_min: smallest mouth.
        valley: its captures, nested; no pieces when nu is constant.
    """

    ctx: Any
    digits: int
    start: Any
    period: Any
    nu_max: Any
    nu_min: Any
    valley: Valley

    @classmethod
    @guarded
    def of(cls, scene: Scene, digits: int) -> Cycle:
        """Analyse a scene's motion.

        Args:
            scene: a valid mushroom, static ones included.
            digits: correct digits wanted, 1 to MAX_DIGITS.

        Raises:
            BadInput: no scene, or digits out of bounds.
            NotCovered: not a mushroom.

        Source: sec. 3.5, Eq:nu.
        """
        mushroom = as_mushroom(scene)
        digits = check_count("digits", digits, 1, MAX_DIGITS)
        ctx = MPContext()
        ctx.dps = digits + GUARD
        settle(ctx)
        shared = period(mushroom)
        length = shared.value(ctx) if shared else None
        run = stretches(ctx, mushroom)
        if not run:
            nu, _ = MovingMushroom(ctx, mushroom, Fraction(0)).nu(ctx.zero)
            return cls(ctx, digits, ctx.zero, length, nu, nu, Valley((), ()))
        found = valley(ctx, run, tolerance(ctx, run))
        levels = [nu for piece in found.all_pieces() for nu in (piece.nu_upper, piece.nu_lower)]
        return cls(ctx, digits, run[0].upper, length, max(levels), min(levels), found)

    @property
    def pieces(self) -> tuple[CapturePiece, ...]:
        """All pieces of the tree of valleys."""
        return tuple(self.valley.all_pieces())

    @guarded
    def t_in(self, nu: Any) -> Any:
        """Return the first time in [start, start + period) at which nu falls through the given value.

        Raises:
            BadInput: no particle is captured at that nu.
        """
        nu = one_of(self.ctx, "nu", nu)
        return self._piece(nu).capture.time(nu)

    @guarded
    def t_out(self, nu: Any) -> Any:
        """Return the time at which nu next rises to the given value after `t_in`.

        Raises:
            BadInput: no particle is captured at that nu.
        """
        nu = one_of(self.ctx, "nu", nu)
        return self._piece(nu).release.time(nu)

    @guarded
    def release_time(self, t: Any) -> Any:
        """Return t_r(t), when a particle captured at time t is released; t itself if none is.

        Source: trelease.
        """
        t = one_of(self.ctx, "t", t)
        if self.period is None:
            return t
        shift = self.ctx.floor((t - self.start) / self.period) * self.period
        for piece in self.pieces:
            if piece.capture.upper <= t - shift < piece.capture.lower:
                nu, _ = piece.capture.motion.nu(t - shift)
                return piece.release.time(nu) + shift
        return t

    def _piece(self, nu: Any) -> CapturePiece:
        for piece in self.pieces:  # a valley's own pieces come first: the first that fits is the earliest
            if piece.nu_lower <= nu <= piece.nu_upper:
                return piece
        given = self.ctx.nstr(nu, 15)
        if not self.pieces:
            raise BadInput(f"nu = {given}: nothing is captured, nu is constant")
        raise BadInput(f"nu = {given}, must be in [{float(self.nu_min):.6g}, {float(self.nu_max):.6g}]")
