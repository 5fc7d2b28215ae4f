"""The next collision of all lanes of a pool, and corrections of those that are not yet right."""

from __future__ import annotations

import numpy as np

from fast.kernel.codes import CAP, STEM
from fast.kernel.compiling import kernel, part
from fast.kernel.lanes import aim, chord, fly

from fast.kernel.pools import (  # isort: skip
    COARSE, END, FAR, LAWS, NEVER, NEXT_VX, N_COEFFICIENTS, OK, S, STRIDE, T, T_LOW, copy_rows,
    set_reference, whole_registers,
)  # fmt: skip
from fast.kernel.worker import DISK, SPARE, SPARE_PLACES

MAX_CORRECTIONS = 3
ON, OFF = np.bool_(True), np.bool_(False)


@kernel
def advance(pool, a, n, is_again, scene, slope, degree, limits):
    """Find the next collision of the first n lanes of a pool.

    Args:
        pool: GENERAL, or DISK for lanes that move unfolded from arc to arc.
        a: the pool's rows.
        n: how many lanes, whole registers of them.
        is_again: correct the times found before once more, in place of a new guess.
        scene: the scene's numbers.
        slope: of the sides, None where it moves; numba then compiles the loops with its rows.
        degree: see fast.kernel.pieces.law_at.
        limits: what holds of the scene's laws for all time.
    """
    table, is_relative = scene.table, scene.is_relative
    if pool == DISK:
        chord(a, n, is_again, table == CAP, is_relative, degree, limits)
        return
    if not is_again:
        aim(a, n, table == STEM, slope, limits)
    fly(a, n, table == STEM, is_relative, slope, degree, limits)


@part
def gather(a, n, spare, places, worker, slope):
    """Copy the lanes that want another correction to a spare pool; returns how many, and notes their places.

    One that flies beyond what its piece of the laws holds for is given the piece at its flight's end.
    """
    n_open = np.int64(0)
    for i in range(n):
        if not (a[OK + i] == COARSE or a[OK + i] == FAR) or a[END + i] == -NEVER:
            continue
        if a[OK + i] == FAR:
            set_reference(a, i, a[T + i] + a[S + i], a[T_LOW + i], worker.scene, worker.pieces, worker.degree)
        copy_rows(a, i, spare, n_open, T, OK)
        copy_rows(a, i, spare, n_open, LAWS, LAWS + (4 if slope is None else 3) * N_COEFFICIENTS * STRIDE)
        places[n_open] = i
        n_open += 1
    return n_open


@part
def correct(pool, a, n, worker, slope):
    """Correct times of flight that are not yet right a few times more, all such lanes side by side."""
    spare, places = worker.pools[SPARE], worker.rosters[pool, SPARE_PLACES]
    for _ in range(MAX_CORRECTIONS):
        n_open = gather(a, n, spare, places, worker, slope)
        if n_open == 0:
            break
        m = whole_registers(n_open)
        advance(pool, spare, m, ON, worker.scene, slope, worker.degree, worker.limits)
        for k in range(n_open):
            copy_rows(spare, k, a, places[k], S, NEXT_VX)
