"""Threads in which kernels run, and which an interrupt ends.

Python hears of an interrupt when a kernel returns, which may take minutes. So the main thread, where signals
are handled, only waits for those that run kernels, and calls off what they do.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, TypeVar

from numba import typeof

from fast.kernel.records import IntArray

LONG = 10_000  # collisions of a path, a millisecond at least: beside them a thread takes no time
LISTENING = 0.1  # seconds from one look for signals to the next
Found = TypeVar("Found")


@contextmanager
def interruptible(n_threads: int, called_off: IntArray) -> Iterator[ThreadPoolExecutor]:
    """Provide threads for kernels that look at `called_off`: who raises waits until they have, no longer."""
    with ThreadPoolExecutor(n_threads) as pool:
        try:
            yield pool
        except BaseException:
            called_off[0] = 1
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def awaited(future: Future[Found]) -> Found:
    """Return what a kernel in a thread has found.

    It is waited for a little at a time. A signal ends no wait that it comes just before, nor one of this
    thread if it is delivered to another; but between two waits every signal is heard.
    """
    while not future.done():
        wait((future,), LISTENING)
    return future.result()


def follow_path(kernel: Any, given: tuple[Any, ...], n_collisions: int, called_off: IntArray) -> Any:
    """Return what a kernel returns that follows a path: a long one can be interrupted.

    Args:
        kernel: a compiled function, to be called.
        given: its arguments.
        n_collisions: to be followed at most.
        called_off: (1,) what the kernel looks at; set to 1 by an interrupt.
    """
    if n_collisions < LONG:
        return kernel(*given)
    if hasattr(kernel, "compile"):  # without the compiler it has none
        kernel.compile(tuple(map(typeof, given)))  # here, where an interrupt ends that, too
    with interruptible(1, called_off) as pool:
        return awaited(pool.submit(kernel, *given))
