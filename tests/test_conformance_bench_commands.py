"""Commands on the benchmark: they time themselves, and their clocks are held to ours."""

from __future__ import annotations

import sys
from contextlib import ExitStack

import pytest
from support.depth import deep_but
from support.truth import proved_step

from conformance.bench import measure, solvers, workloads
from conformance.suite.process import Trouble
from conformance.suite.promises import timing


@pytest.fixture(scope="module")
def breathing_disk() -> workloads.Workload:
    (rule,) = (rule for rule in workloads.RULES if rule.name == "breathing-disk")
    return workloads.draw_workload(rule, 7, 3, proved_step)


def tried(workload, *these):
    # Laps of several ticks of a clock that counts milliseconds: none adds up to nothing.
    brief = measure.Effort(repeats=3, least_ns=5e6, most_ns=1e9)
    return measure.measure(workload, these, brief, lambda _: None)


def test_a_tick_of_a_coarse_clock_is_no_lie():
    """A repeat of .1 ms may be said to last 1 ms; not so 10 ms where the answer came after .2."""
    steps = [{"outcome": "undecided", "reason": "x"}]
    assert timing.read_repeats({"ns": [10**6], "steps": steps}, 1, 2e-4, 0.0)[0] == [10**6]
    with pytest.raises(Trouble, match="the answer came after 200000 ns"):
        timing.read_repeats({"ns": [10**7], "steps": steps}, 1, 2e-4, 0.0)


def test_commands_time_themselves_and_their_troubles_are_told(breathing_disk):
    with ExitStack() as stack:
        able = solvers.by_command("fast", "command", [sys.executable, "-m", "fast"], stack)
        unable = solvers.by_command("plain", "command", [sys.executable, "-m", "conformance.plain"], stack)
        points, troubles = tried(breathing_disk, able, unable)
    assert [p.solver for p in points] == ["fast"]
    assert points[0].right == 3
    assert min(points[0].ns) > 0
    assert troubles["plain"].startswith("unsupported")


IMPOSTOR = """
import json, sys
for line in sys.stdin:
    asked = json.loads(line)
    if asked["cmd"] == "start":
        every = {"profiles": ["step", "time"], "tables": ["cap"], "laws": ["constant", "fourier"]}
        answer = {"protocol": 1, "name": "impostor", "version": "1", "language": "Python", **every}
    elif asked["cmd"] == "time":
        answer = {"seq": asked["seq"], "ns": NS, "steps": STEPS}
    print(json.dumps(answer), flush=True)
"""


@pytest.mark.parametrize(
    ("ns", "steps", "trouble"),
    [
        ("[]", "[]", "fail: 1 repeats are answered"),
        ("[5]", "[]", "fail: 1 repeats are answered"),
        ("[5]", "[{'outcome': 'undecided', 'reason': ''}] * 2", "fail: 1 repeats are answered"),
        ("[10**300]", "[{'outcome': 'undecided', 'reason': ''}]", "fail: 1 repeats are said to last 1000"),
        ("[0] * asked['repeat']", "[{'outcome': 'undecided', 'reason': ''}]", "declined: undecided"),
    ],
)
def test_a_command_that_times_nothing_is_left_out(breathing_disk, tmp_path, ns, steps, trouble):
    (tmp_path / "impostor.py").write_text(IMPOSTOR.replace("NS", ns).replace("STEPS", steps))
    with ExitStack() as stack:
        impostor = solvers.by_command("it", "command", [sys.executable, str(tmp_path / "impostor.py")], stack)
        points, troubles = tried(breathing_disk, impostor)
    assert not points
    assert troubles["it"].startswith(trouble)


SPOILT_CLOCK = """
import json, subprocess, sys
pipe = subprocess.PIPE
fast = subprocess.Popen([sys.executable, "-m", "fast"], stdin=pipe, stdout=pipe, text=True)
passed = 0

def at_ticks(ns):
    global passed
    before, passed = passed // 10**6, passed + ns
    return (passed // 10**6 - before) * 10**6

for line in sys.stdin:
    fast.stdin.write(line)
    fast.stdin.flush()
    answer = json.loads(fast.stdout.readline())
    if "ns" in answer:
        answer["ns"] = [SAID for ns in answer["ns"]]
    print(json.dumps(answer), flush=True)
"""


SAYINGS = {
    "1": "fail: a repeat of",
    "ns // 20": "fail: a repeat of",
    "0": "fail: a repeat of",
    "at_ticks(ns)": "",
}


@pytest.mark.parametrize("said", deep_but(SAYINGS, "ns // 20"))
def test_a_command_is_timed_by_a_clock_that_is_true(breathing_disk, tmp_path, said):
    why = SAYINGS[said]
    # One that counts milliseconds is: most of its steps are said to last 0 ns.
    (tmp_path / "spoilt.py").write_text(SPOILT_CLOCK.replace("SAID", said))
    with ExitStack() as stack:
        spoilt = solvers.by_command("it", "command", [sys.executable, str(tmp_path / "spoilt.py")], stack)
        points, troubles = tried(breathing_disk, spoilt)
    assert [p.solver for p in points] == ([] if why else ["it"])
    assert troubles.get("it", "").startswith(why)
