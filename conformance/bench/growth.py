"""Error growth: how far along a trajectory each stepper can be trusted.

Two trajectories of a chaotic table part exponentially; a stepper's rounding errors grow at the same rate,
decimals lost per collision, whatever its precision. The chained Jacobians of the proved steps give that rate
(the Lyapunov slope) and what one backward ulp at each step can grow to (the predicted bound).
"""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from conformance.bench.record import Growth, short
from conformance.bench.workloads import RULES, Prover, draw_workload
from conformance.grading.agreement import U
from scene import Scene, State
from scene.geometry import rounded

FloatArray = npt.NDArray[np.float64]
WORKLOAD, ENERGY = "moving-cap-1e4", 1e4
FAR = 1e9  # horizon of a step that a trajectory takes


class PathPoint(NamedTuple):
    """Where a trajectory stands after a collision; `width`: relative, of what encloses it."""

    wall: str
    x: Fraction | float
    y: Fraction | float
    vx: Fraction | float
    vy: Fraction | float
    width: float = 0.0


class Sensitivity(NamedTuple):
    """What the chained Jacobians of a path say after a collision.

    Attributes:
        allowance: for dt, x, y, vx, vy what rounding the states so far may do, as in `vectors.Certified`.
        jacobian: (5, 5), of t, x, y, vx, vy by those of the start.
    """

    allowance: Sequence[float]
    jacobian: FloatArray


PathFollower = Callable[[Scene, State, int], list[PathPoint]]
PathProver = Callable[[Scene, State, int], tuple[list[PathPoint], list[Sensitivity]]]


def grow(
    followers: dict[str, PathFollower],
    prove: Prover,
    prove_path: PathProver,
    seed: int,
    n_paths: int,
    n_collisions: int,
    tick: Callable[[str], None],
) -> Growth:
    """Follow trajectories with every follower and with proof.

    Args:
        followers: by name; a path may end early, which counts as having no digit left.
        prove: one step, for the draws.
        prove_path: a trajectory, right to many digits at its end, and how it depends on its states.
        seed: of the draws.
        n_paths: how many trajectories.
        n_collisions: of each.
        tick: called after each path.
    """
    rule = next(rule for rule in RULES if rule.name == WORKLOAD)
    workload = draw_workload(rule, seed, n_paths, prove)
    errors: dict[str, list[FloatArray]] = {name: [] for name in followers}
    bounds, growths = [], []
    for question in workload.questions:
        truth, chain = prove_path(workload.scene, question.state, n_collisions)
        size = rounded(workload.scene, question.state.t).r
        speed = math.hypot(question.state.vx, question.state.vy)
        for name, follow in followers.items():
            errors[name].append(_errors(follow(workload.scene, question.state, n_collisions), truth, size))
        bound, growth = _chained(truth, chain, size, speed)
        bounds.append(bound)
        growths.append(growth)
        tick("")
    count = np.arange(1, n_collisions + 1)
    return Growth(
        scene=rule.scene,
        energy=ENERGY,
        paths=n_paths,
        collisions=n_collisions,
        followers={name: _rounded(np.median(found, axis=0)) for name, found in errors.items()},
        lasts={name: float(np.median([_last(path) for path in found])) for name, found in errors.items()},
        bound=_rounded(np.median(bounds, axis=0)),
        rate=round(float(np.polyfit(count, np.median(np.log10(growths), axis=0), 1)[0]), 4),
    )


def _errors(path: Sequence[PathPoint], truth: Sequence[PathPoint], size: float) -> FloatArray:
    """Return errors relative to table and speed, at most 1: no digit left."""
    found = np.ones(len(truth))
    for i, (place, exact) in enumerate(zip(path, truth, strict=False)):
        if place.wall != exact.wall:
            break
        speed = math.hypot(float(exact.vx), float(exact.vy))
        off = [abs(Fraction(a) - Fraction(b)) for a, b in zip(place[1:5], exact[1:5], strict=True)]
        error = max(float(max(off[:2])) / size, float(max(off[2:])) / speed, place.width)
        found[i] = min(error, 1.0)
    return found


def _last(errors: FloatArray) -> int:
    """Return how many collisions there are before the first whose error exceeds a tenth."""
    beyond = np.flatnonzero(errors > 0.1)
    return int(beyond[0]) if len(beyond) else len(errors)


def _chained(
    truth: Sequence[PathPoint], chain: Sequence[Sensitivity], size: float, speed: float
) -> tuple[FloatArray, FloatArray]:
    """Return the predicted bound and the norm of the chained Jacobians after each collision."""
    scales = np.array([size / speed, size, size, speed, speed])
    bounds, growths = [], []
    for place, (allowance, jacobian) in zip(truth, chain, strict=True):
        outputs = np.abs(np.array(place[1:5], dtype=float))
        bounds.append(float(U) * float(np.max((allowance[1:] + outputs) / scales[1:])))
        growths.append(float(np.linalg.norm(jacobian * scales[None, :] / scales[:, None], 2)))
    return np.minimum(bounds, 1.0), np.array(growths)


def _rounded(numbers: FloatArray) -> tuple[float, ...]:
    return tuple(short(float(number), 3) for number in numbers)
