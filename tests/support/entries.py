"""The compiled functions that are kept in numba's disk cache."""

from numba.core.dispatcher import Dispatcher

from fast.kernel import (
    arithmetic,
    batch,
    fine_step,
    follow,
    lane_laws,
    path,
    scalar_step,
    single,
    worker,
)
from fast.kernel.numba_internals import cache_folder

MODULES = (arithmetic, fine_step, follow, lane_laws, path, scalar_step, single, batch, worker)


def kept_entries() -> list[Dispatcher]:
    """Return all that modules of ours name, by themselves or in a table, each once."""
    named = [found for module in MODULES for found in vars(module).values()]
    found = named + [entry for table in named if isinstance(table, dict) for entry in table.values()]
    entries = [entry for entry in found if isinstance(entry, Dispatcher) and cache_folder(entry)]
    return list(dict.fromkeys(entries))
