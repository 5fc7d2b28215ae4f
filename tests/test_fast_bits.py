"""Bits: the same for any threads, chunks and lane position; mirrored paths and flows; interrupts.

An interrupt ends what kernels do in the middle of one particle's path, and waits for nothing.
"""

import signal
import threading
from queue import SimpleQueue

import numpy as np
import pytest
from support.faulty_kernels import value_of

import fast
from fast import ensemble, paths
from fast.kernel.path import PATHS
from fast.kernel.worker import LONG, follow_path
from scene import Cap, State, load
from scene.transforms import mirrored, mirrored_wall

# Of `small_ensemble`. It changes when the arithmetic does, and then only on purpose.
PINNED = "a7daa8f47de1d65ba14c8bca65f4078b2b377581153238642a7a85f7c63cf91b"


def small_ensemble(threads: int | None = None) -> fast.Ensemble:
    return fast.simulate(
        load("moving-cap"),
        n_particles=70,
        energy=1e3,
        n_cycles=2,
        seed=5,
        phases=(0.25, 0.6),
        threads=threads,
    )


def test_the_pinned_ensemble():
    assert small_ensemble().sha256() == PINNED


@pytest.mark.parametrize("size", [1, 7, 64])
def test_chunks_do_not_change_a_bit(size, monkeypatch):
    """Chunks put particles side by side in other lanes, too."""
    monkeypatch.setattr(ensemble, "SHARE", size)
    assert small_ensemble(threads=1).sha256() == small_ensemble(threads=2).sha256() == PINNED


def answers():
    """Return the bits of a path, of two questions and of two runs, and how many steps the lanes left."""
    found = [fast.trajectory(load("moving-cap"), State(0.0, 0.1, 0.3, 20.0, 7.0), 40).steps.tobytes().hex()]
    for size in (1.0, 2.0**-500):
        start = State(0.0, 0.0, 0.5 * size, 2.0**520, 0.0)
        found.append(repr(fast.next_collision(Cap(r=size), start, 1e9)))
    for name in ("moving-cap", "breathing-circle"):
        run = fast.simulate(load(name), n_particles=2, energy=200.0, seed=1, threads=1)
        assert run.n_careful.sum() < 0.2 * run.n_collisions.sum()
        found.append(run.sha256())
    return found


@pytest.mark.deep
def test_same_bits_without_the_compiler(tmp_path):
    """Kernels are plain Python too: scalar, uncompiled, they give the bits of the packed machine code."""
    assert value_of(tmp_path, "test_fast_bits", "answers()") == answers()


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise", "breathing-circle"])
def test_paths_and_lanes_mirror_exactly_and_in_any_order(name):
    """Backwards each particle lands in another lane, beside others."""
    scene, random = load(name), np.random.default_rng(4)
    rows = random.uniform((-0.3, 0.01, -300, -300), (0.3, 0.4, 300, 300), size=(150, 4)).tolist()
    states = [State(0.0, *row) for row in rows]
    one, other = (fast.flow(scene, each, 1.5, threads=1) for each in (states, states[::-1]))
    image = fast.flow(scene, [mirrored(state) for state in states], 1.5)
    assert one.outcomes == other.outcomes[::-1]
    for a, b in zip(one.outcomes, image.outcomes, strict=True):
        assert (b.x, b.y, b.vx, b.vy) == (-a.x, a.y, -a.vx, a.vy)
    for t_in in (other.t_in[::-1], image.t_in):
        assert np.array_equal(t_in, one.t_in, equal_nan=True)
    assert one.n_careful.sum() < 0.1 * one.wall_counts.sum()
    for state in states[:20]:
        path, image = (fast.trajectory(scene, each, 30) for each in (state, mirrored(state)))
        assert image.walls == [mirrored_wall(wall) for wall in path.walls]
        assert np.array_equal(image.steps, path.steps * [1, 1, -1, 1, -1, 1])


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
        target = main if request.param == "to this thread" else threading.get_ident()
        signal.pthread_kill(target, signal.SIGINT)

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


def test_a_flow_along_the_arc_can_be_interrupted_though_few_flights_fit_into_its_time(monkeypatch):
    """It is followed in threads, which are waited for: not by what the caller's own thread calls."""
    monkeypatch.setattr(paths, "follow_particles", None)
    skipping = State(0.0, 0.0, 1.0, 1.0, -1e-4, "arc")
    assert fast.flow(Cap(r=1.0), [skipping], 0.5).wall_counts.sum() > 1000
