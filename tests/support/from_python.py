"""Kernels are compiled for compiled callers; this is one that Python can call."""

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import njit


@cache
def from_python(kernel: Any) -> Callable[..., Any]:
    """Return a function that Python can call, and that does nothing but call a kernel."""

    @njit(error_model="numpy")
    def call(*arguments):
        return kernel(*arguments)

    return call
