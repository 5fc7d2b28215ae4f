"""The next collision of all lanes of a pool, corrections of those not yet right, and the bounce."""

from __future__ import annotations

import numpy as np

from fast.kernel.codes import CAP, MUSHROOM, STEM
from fast.kernel.compiling import kernel, part
from fast.kernel.loops import run_aim, run_bounce, run_chord, run_fly, run_rebound

from fast.kernel.pools import (  # isort: skip
    COARSE, END, FAR, LAWS, NEVER, NEXT_VX, N_COEFFICIENTS, OK, S, STRIDE, T, T_LOW, copy_rows,
    set_reference, whole_registers,
)  # fmt: skip
from fast.kernel.worker import DISK, SPARE, SPARE_PLACES

MAX_CORRECTIONS = 3
ON, OFF = np.bool_(True), np.bool_(False)


@kernel
def advance(pool, a, n, is_again, worker):
    """Find the next collision of the first n lanes of a pool.

    Args:
        pool: GENERAL, or DISK for lanes that move unfolded from arc to arc.
        a: the pool's rows.
        n: how many lanes, whole registers of them.
        is_again: correct the times found before once more, in place of a new guess.
        worker: whose lanes they are.
    """
    loops, limits = worker.loops, worker.limits
    table, is_relative = worker.scene.table, worker.scene.is_relative
    if pool == DISK:
        run_chord(loops.chord, (a, n, is_again, table == CAP, is_relative, limits))
        return
    if not is_again:
        run_aim(loops.aim, (a, n, table == STEM, worker.slope, limits))
    run_fly(loops.fly, (a, n, table == STEM, is_relative, worker.slope, limits))


@part
def collide(pool, a, n, worker):
    """Bounce the first n lanes of a pool off the walls that they have met."""
    if pool == DISK:
        run_rebound(worker.loops.rebound, (a, n))
    else:
        run_bounce(worker.loops.bounce, (a, n, worker.slope, worker.scene.table == MUSHROOM))


@part
def gather(a, n, spare, places, worker):
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
        copy_rows(
            a, i, spare, n_open, LAWS, LAWS + (4 if worker.is_slope_moving else 3) * N_COEFFICIENTS * STRIDE
        )
        places[n_open] = i
        n_open += 1
    return n_open


@kernel
def correct(pool, a, n, worker):
    """Correct times of flight that are not yet right a few times more, all such lanes side by side."""
    spare, places = worker.pools[SPARE], worker.rosters[pool, SPARE_PLACES]
    for _ in range(MAX_CORRECTIONS):
        n_open = gather(a, n, spare, places, worker)
        if n_open == 0:
            break
        m = whole_registers(n_open)
        advance(pool, spare, m, ON, worker)
        for k in range(n_open):
            copy_rows(spare, k, a, places[k], S, NEXT_VX)
