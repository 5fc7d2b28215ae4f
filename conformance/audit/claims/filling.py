"""C2: the chaotic zone is uniformly filled at all times, the key assumption of sec. 3.4.

Particles are looked at through the cycle: those of the frozen table's chaotic zone, below the mouth or in the
cap with |sin phi| < nu, released ones among them. Uniform means in area and direction, whatever the energies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from mpmath import fp

import theory
from conformance.audit.evidence import ClaimEvidence
from conformance.audit.finding import Check
from conformance.audit.runs import RUNS, run_seed
from conformance.audit.tolerances import Cdf, FloatArray, Mean, close, fits, share
from scene import Horizon, Mushroom, Scene, State, load
from scene.geometry import table_at
from scene.tables import cycle_length

SCENES = ("moving-cap", "fixed-cap-clockwise")
ENERGY = 1e7
N_PARTICLES = {"quick": 2500, "full": 20_000}
PHASES = (3 / 8, 4 / 8, 6 / 8, 1.0)


def filling(evidence: ClaimEvidence) -> Iterator[Check]:
    """C2: shares, places and directions in the chaotic zone at phases of the cycle."""
    for name in SCENES:
        table, places = load(name), []
        assert isinstance(table, Mushroom)
        n, seed = N_PARTICLES[evidence.size], run_seed(evidence.seed, RUNS["moving-cap@1e7"], -2)
        states = starts(table, n, seed)
        for phase in PHASES:
            t = cycle_length(table) * phase
            done = evidence.steppers.flow(table, states, t, threads=evidence.threads)
            ends = [end for end in done.outcomes if isinstance(end, Horizon)]
            states = [State(t, end.x, end.y, end.vx, end.vy) for end in ends]
            zone = in_the_zone(table, t, np.array([(end.x, end.y, end.vx, end.vy) for end in ends]))
            places.append(zone)
            yield _share_below(f"{name} at {phase:g} of its cycle", table, t, zone)
        for what, k, rival, other in EVEN:
            values = np.concatenate([zone[k] for zone in places])
            yield fits(
                f"{name}, {len(PHASES)} phases: {what}",
                values,
                lambda u: u,
                scale=0.2,
                against=(rival, other),
            )


def starts(table: Mushroom, n: int, seed: int) -> list[State]:
    """Draw n states of ENERGY, uniform in area and direction at time 0."""
    random, now = np.random.default_rng(seed), table_at(fp, table, 0.0)
    speed = math.sqrt(2 * ENERGY)
    found: list[State] = []
    while len(found) < n:
        x, y, turn = random.uniform((-now.r, -now.h, 0), (now.r, now.r, 2 * math.pi)).tolist()
        if now.gap("arc", x, y) > 0 if y > 0 else abs(x) < now.half_width(y):
            found.append(State(0.0, x, y, speed * math.cos(turn), speed * math.sin(turn)))
    return found


class Zone(NamedTuple):
    """Where the zone's particles are, as shares of what is even: uniform in (0, 1) if it is filled so.

    below: share of the particles that are below the mouth, with its error.
    chords: of those in the cap, by |sin phi|.
    depths, turns: of those below the mouth, by area and by direction.
    """

    below: Mean
    chords: FloatArray
    depths: FloatArray
    turns: FloatArray


EVEN: tuple[tuple[str, int, str, Cdf], ...] = (
    (
        "|sin phi| in the cap",
        1,
        "the outer tenth empty, where some were just released",
        lambda u: np.minimum(u / 0.9, 1),
    ),
    ("depth in the stem", 2, "twice as dense at the mouth as at the floor", lambda u: (4 * u - u * u) / 3),
    (
        "directions in the stem",
        3,
        "those of hits on a side",
        lambda u: u + np.sin(4 * np.pi * u) / (4 * np.pi),
    ),
)


def in_the_zone(table: Scene, t: float, rows: FloatArray) -> Zone:
    """Pick the zone's particles at time t from rows of x, y, vx, vy."""
    now, nu = table_at(fp, table, t), float(theory.volumes_at(fp, table, t).nu)
    x, y, vx, vy = rows.T
    offset = np.abs(x * vy - y * vx) / np.hypot(vx, vy) / now.r
    below = y < 0
    zone = below | (offset < nu)
    depth = -y[below]
    return Zone(
        share(below[zone]),
        _chords(offset[zone & ~below]) / _chords(nu),
        (2 * now.w * depth - now.slope * depth**2) / now.stem_area(),
        np.arctan2(vy, vx)[below] / (2 * np.pi) % 1.0,
    )


def _share_below(label: str, table: Scene, t: float, zone: Zone) -> Check:
    volumes = theory.volumes_at(fp, table, t)
    return close(
        f"{label}: share below the mouth",
        zone.below,
        volumes.v_stem / volumes.v_cha,
        band=_unmixed(table, t),
        scale=0.2,
        against=("a tenth less", 0.9 * float(volumes.v_stem / volumes.v_cha)),
    )


def _chords(s: FloatArray | float) -> FloatArray:
    """Return, but for a factor, the area in phase of the chords nearer to the centre than s r."""
    return np.asarray(s * np.sqrt(1 - np.minimum(np.square(s), 1.0)) + np.arcsin(np.minimum(s, 1.0)))


def _unmixed(table: Scene, t: float) -> float:
    """Return how far the share below the mouth lags behind the volumes.

    Through a mouth of width 2w an area A is left at the rate 2 w v / (pi A). So a share that the walls move
    at a rate is short of it by that rate times pi A B / (2 w v (A + B)), A and B the zone's areas on both
    sides.
    """
    step = 1e-4 * cycle_length(table)
    (now, before), place = (theory.volumes_at(fp, table, s) for s in (t, t - step)), table_at(fp, table, t)
    rate = abs(now.v_stem / now.v_cha - before.v_stem / before.v_cha) / step
    both = now.v_stem * (now.v_cha - now.v_stem) / now.v_cha / (2 * fp.pi)
    return float(rate * fp.pi * both / (2 * place.w * math.sqrt(2 * ENERGY)))


CHECKS = {"C2": filling}
