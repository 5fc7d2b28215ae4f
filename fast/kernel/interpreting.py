"""Kernels as Python runs them, until compiling them is worth the wait.

A kernel is a function of Python: run by Python it gives the same bits. A step takes some 2 ms then, and to
compile the kernels of a first question takes over ten seconds. So Python runs a process's first steps, unless
what was compiled before is kept on disk.
"""

import sys
from types import FunctionType
from typing import Any

from numba import config
from numba.extending import is_jitted

from fast.kernel.compiling import is_at_hand

MOST_STEPS = 1000  # about two seconds
# The names of each module of kernels, as Python runs them.
_NAMES: dict[str, dict[str, Any]] = {}


def _is_kernel(found: Any) -> bool:
    return is_jitted(found) or (
        isinstance(found, FunctionType) and found.__module__.startswith("fast.kernel.")
    )


def _names_of(module: str) -> dict[str, Any]:
    if module not in _NAMES:
        _NAMES[module] = dict(vars(sys.modules[module]))
        for name, found in list(_NAMES[module].items()):
            if _is_kernel(found):
                _NAMES[module][name] = as_python(found)
    return _NAMES[module]


def as_python(kernel: Any) -> Any:
    """Return a kernel as Python runs it, and with it all that it calls.

    A function finds what it calls by name in its module: here it is given other names.
    """
    if config.DISABLE_JIT:
        return kernel
    function = kernel.py_func if is_jitted(kernel) else kernel
    return FunctionType(
        function.__code__,
        _names_of(function.__module__),
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )


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
            entries: the kept functions that would run them. If all are kept, on disk or in this process,
                Python does not. That is looked up before the first step only: it reads a folder.
        """
        is_first = self.left == MOST_STEPS
        if n_steps > self.left or (is_first and all(is_at_hand(entry) for entry in entries)):
            self.left = 0
            return False
        self.left -= n_steps
        return True
