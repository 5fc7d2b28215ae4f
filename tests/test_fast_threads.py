"""An interrupt ends what kernels do in the middle of one particle's path, and waits for nothing."""

from __future__ import annotations

import signal
import threading
from queue import SimpleQueue

import numpy as np
import pytest

import fast
from fast import ensemble, paths
from fast.kernel.follow import PATHS
from fast.kernel.worker import LONG, follow_path
from scene import State, load

SCENE, START = load("moving-cap"), State(0.0, 0.1, 0.2, 3.0, 4.0)
LENGTH = 300_000  # collisions: seconds


@pytest.fixture(params=["to this thread", "to another"])
def begun(request):
    """Interrupt as soon as a kernel has begun: an event, set then.

    A signal that is delivered to another thread does not end what this one waits for, as one that comes just
    before the wait does not.
    """
    event, main = threading.Event(), threading.get_ident()

    def interrupt() -> None:
        event.wait()
        whom = main if request.param == "to this thread" else threading.get_ident()
        signal.pthread_kill(whom, signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    thread = threading.Thread(target=interrupt)
    thread.start()
    yield event
    event.set()
    thread.join()
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="no signal can be sent to a thread")
@pytest.mark.parametrize("call", ["simulate", "go_on", "flow", "trajectory", "fine_trajectory"])
def test_an_interrupt_is_heeded_in_the_middle_of_a_path(begun, monkeypatch, call):
    followed = SimpleQueue()

    def watched(kernel, how_many):
        def watching(*given):
            if how_many(given):
                begun.set()
            found = kernel(*given)
            if how_many(given):
                followed.put((found, given))
            return found

        return watching

    for module, name, place in ((ensemble, "follow_particles", 1), (paths, "fine_path", 2)):
        watching = watched(getattr(module, name), lambda given, place=place: len(given[place]))
        monkeypatch.setattr(module, name, watching)
    for key, kernel in PATHS.items():
        monkeypatch.setitem(PATHS, key, watched(kernel, lambda _: True))
    quick = State(0.0, 0.1, 0.2, 3e7, 4e7)  # a second or more, where nobody interrupts
    with pytest.raises(KeyboardInterrupt):
        {
            "simulate": lambda: fast.simulate(SCENE, n_particles=1, energy=1e16),
            "go_on": lambda: fast.go_on(SCENE, n_particles=1, energy=1e16),
            "flow": lambda: fast.flow(SCENE, [quick], 1.0),
            "trajectory": lambda: fast.trajectory(SCENE, START, 10 * LENGTH),
            "fine_trajectory": lambda: fast.fine_trajectory(SCENE, START, LENGTH),
        }[call]()
    found, given = followed.get()  # the kernel has ended, and not because it was done
    if "trajectory" in call:
        assert found[0] < (LENGTH if call == "fine_trajectory" else 10 * LENGTH)
    else:
        assert given[0].followed.counts.sum() == 0


@pytest.mark.parametrize(("length", "is_here"), [(LONG - 1, True), (LONG, False)])
def test_a_long_path_is_followed_elsewhere_but_compiled_here(length, is_here):
    """A compilation heeds an interrupt only in the thread that hears of it."""

    class Kernel:
        compiled_by = followed_by = None

        def compile(self, _types):
            self.compiled_by = threading.get_ident()

        def __call__(self, _number):
            self.followed_by = threading.get_ident()

    kernel, here = Kernel(), threading.get_ident()
    follow_path(kernel, (1.0,), length, np.zeros(1, np.int64))
    assert (kernel.followed_by == here) == is_here
    assert kernel.compiled_by == (None if is_here else here)
