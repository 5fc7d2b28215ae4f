"""Two benchmarks side by side: ratios of times with confidence, and whether something got slower.

Times are first divided by the core's speed in their own run (`clock_ns`), so that a slower machine is not
a slower stepper. The ratio of medians has a bootstrap interval over the laps of both runs, which knows
nothing of what differs between runs: hence the bound SLOWER, above which the whole interval must lie. Two
quick runs of one commit on a shared machine had ratios from 0.7 to 1.6 and no interval above the bound, but
for an example that its interpreter compiles as it runs (8.6): examples and baselines are shown, not
judged.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from conformance.bench.record import Drawn, Record
from scene.refusal import BadInput

SLOWER = 1.5
LEVEL = 0.99
N_RESAMPLES = 2000
NOT_JUDGED = ("example", "lean", "fixed-step")  # no stepper of ours


class Ratio(NamedTuple):
    """New over old time of a contender on a workload, with its interval."""

    workload: str
    contender: str
    ratio: float
    low: float
    high: float
    is_judged: bool

    @property
    def is_slower(self) -> bool:
        """Tell whether the whole interval is above the bound, for a stepper that is judged."""
        return self.is_judged and self.low > SLOWER


def check_alike(old: Record, size: str, seed: int, questions: int, drawn: Sequence[Drawn]) -> None:
    """Refuse an old record whose questions were others, of all workloads or of one that both have.

    Raises:
        BadInput: naming the setting that differs.
    """
    now: dict[str, object] = {"size": size, "seed": seed, "questions": questions}
    pairs = [(name, getattr(old, name), value) for name, value in now.items()]
    there = {workload.name: workload for workload in old.workloads}
    for new in drawn:
        if new.name in there:
            pairs += [
                (f"{field} of {new.name}", getattr(there[new.name], field), getattr(new, field))
                for field in new.__struct_fields__
                if field != "what"
            ]
    for name, before, value in pairs:
        if before != value:
            raise BadInput(f"--compare: {name} = {before} there and {value} here, must be the same")


def gone(old: Record, new: Record) -> list[str]:
    """List the points of the old record that the new one lacks."""
    now = {(p.workload, p.contender) for p in new.points}
    return [f"{p.contender} on {p.workload}" for p in old.points if (p.workload, p.contender) not in now]


def compare(old: Record, new: Record) -> list[Ratio]:
    """Compare all points that both records have."""
    before = {(p.workload, p.contender): p for p in old.points}
    clocks = statistics.median(new.clock_ns) / statistics.median(old.clock_ns)
    random = np.random.default_rng(0)
    found = []
    for point in new.points:
        key = point.workload, point.contender
        if key in before:
            a, b = np.array(point.ns) / clocks, np.array(before[key].ns)
            ratio = float(np.median(a) / np.median(b))
            drawn = np.median(random.choice(a, (N_RESAMPLES, len(a))), axis=1)
            drawn = drawn / np.median(random.choice(b, (N_RESAMPLES, len(b))), axis=1)
            low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
            found.append(Ratio(*key, ratio, float(low), float(high), point.family not in NOT_JUDGED))
    return found
