"""Commands that compile say so: each kernel that takes long is announced, and what is loaded is not."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from numba import config
from numba.core import event
from support.entries import kept_entries

import fast
from fast.kernel import fine_step, follow, path, scalar_step, worker
from mushrooms import bench, orbits, progress, questions
from mushrooms.audit import session

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled without the compiler")
ROOT = Path(__file__).parent.parent
IN_MEMORY = ["simulate", "moving-cap", "--particles", 60, "--energy", 1e4, "--threads", 1, "--json"]
SLOW = "compiling the fast stepper for this machine: about half a minute; kept for next time\n"
FINE = SLOW.replace("half a minute", "ten seconds")
# Kernels that compile in three seconds or less, by themselves.
QUICK = {
    "single",
    "off_wall",
    "fill_pieces",
    "directions",
    "fill_lane",
    "step_lanes",
    "residual",
    "fill_careful",
}


def compile_again(*entries):
    """Do what numba does around the compilation of kernels, which are not in the disk cache then."""
    for entry in entries:
        with event.trigger_event(
            "numba:compile", data={"dispatcher": entry, "args": (), "return_type": None}
        ):
            pass


def test_each_kernel_that_takes_long_is_announced_and_no_other(capsys):
    """All that stand in the disk cache: a new one, or a new name, has to be put into one of the lists."""
    entries = kept_entries()
    assert len(entries) > 30
    announced = {}
    for entry in entries:
        with progress.announce_compilation():
            compile_again(entry)
        announced.setdefault(capsys.readouterr().err, set()).add(entry.py_func.__name__)
    assert announced == {
        SLOW: {"scalar_step", "loop", "follow_particles", "follow_path"},
        FINE: {"fine_path"},
        "": QUICK,
    }
    compile_again(scalar_step.scalar_step)  # nobody listens any more
    assert capsys.readouterr().err == ""


def test_what_is_compiled_together_is_announced_once(capsys):
    loops = [*worker.FLIES.values(), *worker.CHORDS.values(), *path.PATHS.values()]
    with progress.announce_compilation():
        compile_again(scalar_step.scalar_step, *loops, follow.follow_particles, fine_step.fine_path)
    assert capsys.readouterr().err == SLOW + FINE


@pytest.mark.parametrize(
    ("module", "cache", "said"),
    [
        ("fast.kernel.worker", "kept", SLOW),
        (
            "fast.kernel.worker",
            "",
            SLOW.replace("kept for next time", "no folder can be written in to keep it"),
        ),
        ("faster.worker", "kept", ""),
        ("somebody.worker", "kept", ""),
    ],
)
def test_only_our_kernels_are_announced_and_whether_they_are_kept(capsys, module, cache, said):
    """A program beside ours may compile a function that is called as one of ours."""

    def loop():
        """Stand for a kernel."""

    loop.__module__ = module
    with progress.announce_compilation():
        compile_again(SimpleNamespace(py_func=loop, stats=SimpleNamespace(cache_path=cache)))
    assert capsys.readouterr().err == said


@pytest.mark.parametrize(
    ("command", "owner", "name"),
    [
        (IN_MEMORY, fast, "simulate"),
        (["audit", "--out"], session, "conduct"),
        (["bench", "--quick", "--out"], bench, "_measure"),
        (["attack", "--cases", 1, "--json"], questions, "run"),
        (["draw", "ergodic", "--trajectory"], orbits, "follow"),
    ],
)
def test_commands_that_compile_say_so_and_only_then(
    command_line, monkeypatch, tmp_path, command, owner, name
):
    """The second process finds what the first has kept."""
    waiting = [[], [scalar_step.scalar_step, follow.follow_particles]]

    def compiles(*_args, **_options):
        compile_again(*waiting.pop())
        raise KeyboardInterrupt

    monkeypatch.setattr(owner, name, compiles)
    out = [tmp_path / "out.json"] if command[-1] in ("--out", "--json") and command is not IN_MEMORY else []
    for n_lines in (1, 0):
        code, _, err = command_line(*command, *out)
        assert (code, err.count("\n"), err.count(SLOW)) == (130, 1 + n_lines, n_lines)


@pytest.mark.deep
def test_a_new_machine_waits_with_a_notice(tmp_path):
    """Real kernels and an empty cache; the second process loads what the first has kept."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    command = [
        sys.executable,
        "-m",
        "mushrooms",
        "draw",
        "breathing-circle",
        "--trajectory",
        "--out",
        "a.svg",
    ]
    said = []
    for _ in range(2):
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0
        said.append(done.stderr)
    assert said == [SLOW, ""]
