"""Which processes descend from a command: another one that starts meanwhile claims none of them."""

import subprocess
import sys

import psutil
import pytest

from conformance.suite.process import Descendants


@pytest.mark.skipif(sys.platform == "win32", reason="the suite starts commands on POSIX systems")
def test_children_of_the_first_command_are_not_older_than_the_second():
    """What was there before any command is nobody's; what the first has started is its own."""
    assert not Descendants._leaders
    sleeping = [sys.executable, "-c", "input()"]
    with subprocess.Popen(sleeping, stdin=subprocess.PIPE) as older:
        first = Descendants()
        with subprocess.Popen(sleeping, stdin=subprocess.PIPE) as leader:
            first.follow(leader.pid)
            second = Descendants()
            try:
                known = {process.pid for process in Descendants._before}
                assert older.pid in known
                assert leader.pid not in known
            finally:
                second.follow(0)
                Descendants._leaders.discard(leader.pid)
            leader.communicate(b"\n")
        older.communicate(b"\n")
    assert not psutil.pid_exists(older.pid) or psutil.Process(older.pid).status() == "zombie"
