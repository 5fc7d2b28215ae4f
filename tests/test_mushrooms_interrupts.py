"""Signals: whenever one comes, and wherever its exception is thrown away, a command ends in a line, code 130.

Every command runs in a process of its own, as a shell starts it, and is seen to run when the signal is sent.
"""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.depth import deep_but

from mushrooms.interrupts import INTERRUPTED, SAME

ROOT = Path(__file__).parent.parent
# Where a signal is ignored from the start, as of a job in the background, it stays so.
BEGIN = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from mushrooms import interrupts
ready, begin = int(sys.argv.pop(1)), interrupts.Listener.begin

def begin_and_tell(self):
    begin(self)
    os.write(ready, b".")

interrupts.Listener.begin = begin_and_tell
"""
END = """
from mushrooms.main import run
run()
"""


@contextmanager
def listening(
    folder: Path, words: list[str], middle: str = "", is_at_work: bool = False
) -> Iterator[subprocess.Popen[str]]:
    """Provide a process that runs a command, from when it listens for signals, or says it is at work."""
    own, its = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", BEGIN + middle + END, str(its), *words],
        cwd=folder,
        pass_fds=[its],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    os.close(its)
    try:
        assert os.read(own, 1) == b"."
        assert not is_at_work or os.read(own, 1) == b"+"
        yield process
    finally:
        os.close(own)
        process.kill()
        process.communicate()


def assert_interrupted(process: subprocess.Popen[str]) -> str:
    """Hold that a process ends with its line and its code, and nothing after it; return what it printed."""
    out, err = process.communicate(timeout=120)
    lines = err.splitlines()
    assert process.returncode == INTERRUPTED, err
    assert lines[-1].startswith("mushrooms: interrupted"), err
    assert [line for line in lines if not line.startswith(("compiling ", "seed "))] == lines[-1:]
    return out


# Each takes longer than the longest wait below, on any machine.
LONG = {
    "simulate": "simulate moving-cap --particles 1e8 --energy 1e7",
    "a stored run": "simulate moving-cap --particles 1e6 --energy 1e7 --out run --block 64",
    "section": "draw moving-cap --section --particles 1000 --collisions 1000000 --out a.png",
    "exponents": "draw moving-cap --lyapunov --collisions 1000000 --out a.png",
    "audit": "audit --full --only X2,L4 --out report",
    "check": f"check -- {sys.executable} -m conformance.plain",
    "attack": "attack --cases 1000000",
    "bench": "bench --out bench",
    "theory": "theory moving-cap --digits 1000 --energy 1e7",
}
SIGNALS = int(os.environ.get("MUSHROOMS_SIGNALS", "2"))


@pytest.mark.parametrize("name", deep_but(LONG, "a stored run", "section"))
def test_a_signal_at_any_moment_ends_a_command_in_one_line(tmp_path, name):
    """While modules are imported, kernels loaded or compiled, particles followed, files written."""
    moments = random.Random(name)
    for number in range(SIGNALS):
        folder = tmp_path / str(number)
        folder.mkdir()
        with listening(folder, LONG[name].split()) as process:
            time.sleep(moments.uniform(0, 3) ** 2 / 3)
            if process.poll() is not None:  # a theory that a fast machine has found out before
                assert name == "theory"
                continue
            process.send_signal(signal.SIGINT)
            assert_interrupted(process)
        assert not list(folder.rglob(".*.part"))


# What throws an exception away, with a signal in the middle of it.
THROWN = {
    "a callback from C": """
        import ctypes
        ctypes.CFUNCTYPE(None)(interrupt)()
    """,
    "__del__": """
        class Freed:
            def __del__(self):
                interrupt()
        Freed()
    """,
    "a weak reference": """
        import weakref
        class Freed:
            pass
        freed = Freed()
        kept = weakref.ref(freed, lambda _: interrupt())
        del freed
    """,
    "a bare except": """
        try:
            interrupt()
        except:
            pass
    """,
    "a module that may be missing": """
        try:
            try:
                interrupt()
            except BaseException as error:
                raise ImportError("initialization failed") from error
        except ImportError:
            pass
    """,
    "twice": """
        for _ in range(2):
            try:
                interrupt()
                time.sleep(1)
            except BaseException:
                pass
    """,
}
WORK = """
import time
from mushrooms import scenes

def interrupt():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)

def work(*_arguments):
    if True:{}
    for _ in range(200):  # seconds in all: here an interrupt that is raised again is heard
        time.sleep(0.05)
    print("all was done")

scenes.print_scenes = work
"""


@pytest.mark.parametrize("place", THROWN)
def test_an_interrupt_that_is_thrown_away_comes_again(tmp_path, place):
    with listening(tmp_path, ["scenes"], WORK.format(THROWN[place])) as process:
        assert assert_interrupted(process) == ""


CLEANING = """
import atexit, time
from mushrooms import scenes

def work(*_arguments):
    try:
        os.write(ready, b"+")
        time.sleep(60)
    finally:
        for _ in range({}):
            time.sleep(0.05)
        print("cleaned", flush=True)

atexit.register(print, "what a library reports at its end")
scenes.print_scenes = work
"""


@pytest.mark.parametrize(("pause", "n_waits", "told"), [(0.0, 4, "cleaned\n"), (2 * SAME, 2000, "")])
def test_a_second_signal_ends_a_command_at_once_if_it_is_no_echo_of_the_first(tmp_path, pause, n_waits, told):
    """A wrapper passes Ctrl-C on that the terminal sends to both: that is one interrupt."""
    with listening(tmp_path, ["scenes"], CLEANING.format(n_waits), is_at_work=True) as process:
        process.send_signal(signal.SIGINT)
        time.sleep(pause)
        process.send_signal(signal.SIGINT)
        assert assert_interrupted(process) == told
