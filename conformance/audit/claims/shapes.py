"""What a cycle is to its particles, its shapes in their order: C3, C4 and C10."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from conformance.audit.claims.experiments import one_cycle
from conformance.audit.claims.finite_energy import ACW
from conformance.audit.evidence import DIGITS, ClaimEvidence
from conformance.audit.finding import Check
from conformance.audit.tolerances import exact, stated
from scene import BangBang, Mushroom, State, load

OTHER_LEGS, IRREGULAR = "fixed-cap-other-legs@1e7", "fixed-cap-irregular@1e7"
N_CLOCKS = 3
ROUNDING = 1e-12  # relative, of what a few thousand collisions keep exactly
N_HITS, SPEED = 2000, 30.0


def other_clocks(evidence: ClaimEvidence) -> Iterator[Check]:
    """C3: the same loop at other paces, by theory with drawn legs, and simulated."""
    known = evidence.predict("fixed-cap-anticlockwise")
    random = np.random.default_rng([evidence.seed, 3])
    for _ in range(N_CLOCKS):
        legs = random.dirichlet(np.full(4, 2.0))
        found = evidence.predict(at_another_pace(legs))
        what = f"legs {', '.join(f'{leg:.2f}' for leg in legs)}"
        for name in ("m1", "p_nc"):
            value = getattr(known, name)
            yield exact(f"{what}: {name}", getattr(found, name), value, 10.0 ** (5 - DIGITS))
    yield from one_cycle(evidence, (OTHER_LEGS,))


def at_another_pace(legs: np.ndarray) -> Mushroom:
    """Return the fixed cap's anticlockwise cycle with its four legs in other proportions."""
    table = load("fixed-cap-anticlockwise")
    assert isinstance(table, Mushroom)
    times = [0.0, *np.cumsum(legs)[:-1].tolist(), 1.0]
    h, w = (
        BangBang(tuple((t, knot[1]) for t, knot in zip(times, law.knots, strict=True)))
        for law in (table.h, table.w)
        if isinstance(law, BangBang)
    )
    return Mushroom(r=table.r, h=h, w=w, slope=table.slope, name="another-pace")


def irregular(evidence: ClaimEvidence) -> Iterator[Check]:
    """C10: two turns in one period, not alike in shapes or times."""
    yield from one_cycle(evidence, (IRREGULAR,))


def sliding(evidence: ClaimEvidence) -> Iterator[Check]:
    """C4: walls that slide along themselves; a mouth's edge over a cap at rest, the sides of a rectangle."""
    sample = evidence.sample(ACW)
    # Captured at phases 4/8 and 5/8, between which the base gives way to the mouth; the arc is at rest.
    inside = sample.phase_captured[:, 0, 3] & sample.phase_captured[:, 0, 4]
    change = np.abs(sample.phase_s[inside, 0, 4] - sample.phase_s[inside, 0, 3])
    largest = float(np.max(change, initial=0.0))
    yield stated(
        "fixed cap: log E of the captured while the mouth opens, largest change",
        bool(inside.any()) and largest < ROUNDING,
        f"{largest:.1e} of {inside.sum():,} particles",
        "0 but for rounding",
    )
    free = ~sample.captured
    moved = np.abs(sample.phase_s[free, 0, 4] - sample.phase_s[free, 0, 3]).mean()
    yield stated(
        "fixed cap: the free, whom the stem's sides meet, change theirs",
        bool(moved > 1e-3),
        f"{moved:.3f} on average",
        "> 0.001",
    )
    rectangle = load("fermi-ulam")
    done = evidence.steppers.trajectory(
        rectangle, State(0.0, 0.1, -0.4, SPEED * math.cos(0.7), SPEED * math.sin(0.7)), N_HITS, math.inf
    )
    across, along = (np.abs(done.steps[:, k]) for k in (4, 5))
    drift = float(np.max(np.abs(across / across[0] - 1)))
    yield stated(
        f"rectangle whose floor moves, {N_HITS} collisions: speed across, which only its sides could change",
        drift < ROUNDING,
        f"largest relative change {drift:.1e}",
        "0 but for rounding",
    )
    what = "and the speed along, which the floor changes"
    varied = float(np.max(np.abs(along / along[0] - 1)))
    yield stated(what, varied > 1e-3, f"largest relative change {varied:.2f}", "> 0.001")


CHECKS = {"C3": other_clocks, "C4": sliding, "C10": irregular}
