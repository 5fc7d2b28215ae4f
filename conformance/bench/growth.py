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
from conformance.cases.prover import Matrix, inputs_of
from conformance.grading.agreement import U
from scene import Collision, Scene, State
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


PathFollower = Callable[[Scene, State, int], list[PathPoint]]
Linearised = Callable[[Scene, State, float], tuple[Collision, Matrix]]  # a proved step and its Jacobian


def grow(
    followers: dict[str, PathFollower],
    prove: Prover,
    linearise: Linearised,
    prove_path: PathFollower,
    seed: int,
    n_paths: int,
    n_collisions: int,
    tick: Callable[[str], None],
) -> Growth:
    """Follow trajectories with every follower and with proof.

    Args:
        followers: by name; a path may end early, which counts as having no digit left.
        prove: one step, for the draws.
        linearise: one step, with its Jacobian.
        prove_path: a trajectory, right to many digits at its end.
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
        truth = prove_path(workload.scene, question.state, n_collisions)
        size = rounded(workload.scene, question.state.t).r
        speed = math.hypot(question.state.vx, question.state.vy)
        for name, follow in followers.items():
            errors[name].append(_errors(follow(workload.scene, question.state, n_collisions), truth, size))
        bound, growth = _chained(workload.scene, question.state, n_collisions, linearise, size, speed)
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
    scene: Scene, state: State, n_collisions: int, linearise: Linearised, size: float, speed: float
) -> tuple[FloatArray, FloatArray]:
    """Return the predicted bound and the norm of the chained Jacobians after each collision.

    The steps' Jacobians are taken along a path of proved steps, each from the rounded end of the one before.
    """
    scales = np.array([size / speed, size, size, speed, speed])
    product = np.eye(5)
    shares: list[FloatArray] = []  # what each earlier step's rounding has become
    bounds, growths = [], []
    for _ in range(n_collisions):
        met, jacobian = linearise(scene, state, state.t + FAR)
        step, inputs, state = np.array(jacobian), np.array(inputs_of(state)), met.state()
        outputs = np.array([met.dt, *inputs_of(state)[1:]])
        rounding = float(U) * (np.abs(step) @ np.abs(inputs) + np.abs(outputs))
        step[0, 0] += 1.0  # from the flight time to the time
        shares = [step @ share for share in shares]
        shares.append(np.diag(rounding))
        product = step @ product
        total = sum((np.abs(share).sum(axis=1) for share in shares), np.zeros(5))
        bounds.append(float(np.max((total / scales)[1:])))
        growths.append(float(np.linalg.norm(product * scales[None, :] / scales[:, None], 2)))
    return np.minimum(bounds, 1.0), np.array(growths)


def _rounded(numbers: FloatArray) -> tuple[float, ...]:
    return tuple(short(float(number), 3) for number in numbers)
