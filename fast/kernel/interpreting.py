"""Kernels as Python runs them, until compiling them is worth the wait.

A kernel is a function of Python: run by Python it gives the same bits. A step takes some 2 ms then, and to
compile the kernels of a first question takes over ten seconds. So Python runs a process's first steps, unless
what was compiled before is kept on disk.
"""

from typing import Any

from numba import config

from fast.kernel.compiling import is_at_hand

MOST_STEPS = 1000  # about two seconds


def as_python(entry: Any) -> Any:
    """Return a kept function as Python runs it."""
    return entry if config.DISABLE_JIT else entry.py_func


class Allowance:
    """The steps that Python may still run before kernels of one kind are compiled.

    Attributes:
        left: the number of these steps; 0 as soon as compiled code has been chosen.
    """

    def __init__(self) -> None:
        """Allow `MOST_STEPS`."""
        self.left = MOST_STEPS

    def take(self, n_steps: int, *entries: Any) -> bool:
        """Tell whether Python is to run some steps, and take them off the allowance.

        Args:
            n_steps: to be run at most.
            entries: the kept functions that would run them: if all are kept on disk, or in this process,
                Python does not.
        """
        if n_steps > self.left or all(is_at_hand(entry) for entry in entries):
            self.left = 0
            return False
        self.left -= n_steps
        return True
