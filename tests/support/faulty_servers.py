"""Servers that break protocol 1, each in one way; `python faulty_servers.py NAME` is one of them.

Each answers every step alike, as physics is not asked of it here, except in one place, where it does what the
table of faults says. None may hang the runner, outlive it, or pass.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

INTRODUCTION = {
    "protocol": 1,
    "name": "faulty",
    "version": "1",
    "language": "Python",
    "profiles": ["step"],
    "tables": ["cap", "stem", "mushroom"],
    "laws": ["constant", "fourier", "bang-bang"],
}
HIT = {"outcome": "collision", "wall": "arc", "dt": 1.0, "t": 1.0, "x": 0.6, "y": 0.8, "vx": -0.6, "vy": -0.8}
SLEEP = 600.0
Answer = dict[str, Any]
Act = Callable[[Answer], object]  # what is done with the right answer, in place of saying it
helpers: list[subprocess.Popen[bytes]] = []  # held, so that their pipes are open while this process lives
asked: list[int] = []  # the seq of every step so far


def command(name: str) -> list[str]:
    """Return the command of a faulty server."""
    return [sys.executable, "-I", "-S", __file__, name]


def run(name: str) -> None:
    """Answer requests until `stop`."""
    place, fault = FAULTS[name]
    for line in sys.stdin:
        try:
            request = json.loads(line)
            where, answer = right_answer(request)
        except (ValueError, TypeError, KeyError):
            say({"seq": None, "outcome": "rejected", "reason": "no request"})
            continue
        if where == "step":
            asked.append(request["seq"])
        (fault if where == place else say)(answer)
        if where == "stop":
            return


def right_answer(request: dict[str, Any]) -> tuple[str, Answer]:
    """Return what is asked, and what a server that breaks nothing says: nothing, to `stop`."""
    if request["cmd"] in ("start", "stop"):
        return request["cmd"], INTRODUCTION if request["cmd"] == "start" else {}
    if request["cmd"] == "echo":
        return "echo", {"values": request["values"]}
    if "vy" not in request["state"]:
        return "reject", {"seq": request["seq"], "outcome": "rejected", "reason": "state.vy is missing"}
    return "step", {"seq": request["seq"], **HIT}


def line_of(answer: Answer) -> bytes:
    """Return a line of JSON."""
    return json.dumps(answer).encode() + b"\n"


def write(data: bytes) -> None:
    """Write and flush."""
    sys.stdout.buffer.write(data)
    sys.stdout.flush()


def say(answer: Answer) -> None:
    """Write one line of JSON, or nothing."""
    write(line_of(answer) if answer else b"")


def says(change: Callable[[Answer], Answer]) -> Act:
    """Say a changed answer."""
    return lambda answer: say(change(answer))


def writes(change: Callable[[bytes], bytes]) -> Act:
    """Write something else for the line."""
    return lambda answer: write(change(line_of(answer)))


def echoes(change: Callable[[float], float]) -> Act:
    """Echo changed numbers."""
    return says(lambda answer: {"values": [change(value) for value in answer["values"]]})


def then(*acts: Act) -> Act:
    """Do several things, one after the other."""
    return lambda answer: [act(answer) for act in acts]


def forever(act: Act) -> Act:
    """Do one thing without end."""

    def repeat(answer: Answer) -> None:
        while True:
            act(answer)

    return repeat


def leave(status: int) -> Act:
    """Exit at once."""
    return lambda _: os._exit(status)


def wait(seconds: float) -> Act:
    """Do nothing for so long."""
    return lambda _: time.sleep(seconds)


def child(*, is_detached: bool) -> Act:
    """Start a child that holds this process's pipes."""
    program = [sys.executable, "-c", f"import time; time.sleep({SLEEP})"]
    return lambda _: subprocess.Popen(program, start_new_session=is_detached)


def orphan(_: Answer) -> None:
    """Start a process that nothing ties to this one: forked twice, in its own session, all cleared."""
    token = os.environ.get("FAULTY_SERVER", "")  # for the tests alone, in the arguments
    if os.fork():
        os.wait()
        return
    os.setsid()
    if not os.fork():
        for stream in range(3):
            os.close(stream)
        program = f"import time; time.sleep({SLEEP})"
        os.execve(sys.executable, [sys.executable, "-I", "-S", "-c", program, token], {})
    os._exit(0)


def helper(last: str = "") -> Act:
    """Start a child that ends a little after this process, because it has ended, with last words."""
    program = f"import sys, time; sys.stdin.read(); time.sleep(0.2); sys.stdout.write({last!r})"
    line = [sys.executable, "-I", "-S", "-c", program]
    return lambda _: helpers.append(subprocess.Popen(line, stdin=subprocess.PIPE))


def cry(what: bytes) -> Act:
    """Write to standard error."""
    return lambda _: os.write(2, what)


def ignore_termination(_: Answer) -> None:
    """Ignore the signals that ask a process to end."""
    for name in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(name, signal.SIG_IGN)


def write_in_pieces(answer: Answer) -> None:
    """Write the line in pieces, slowly."""
    line = line_of(answer)
    for start in range(0, len(line), 50):
        write(line[start : start + 50])
        time.sleep(0.02)


def print_digits(n: int) -> Act:
    """Echo numbers to so many digits, as C writes them: minus zero is -0."""
    return lambda answer: write(
        b'{"values": [%b]}\n' % ", ".join(f"{value:.{n}g}" for value in answer["values"]).encode()
    )


def crash(_: Answer) -> None:
    """End with a traceback."""
    raise KeyError("vy")


def crash_at_the_second(answer: Answer) -> None:
    """Be killed at the second step."""
    if len(asked) == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
    say(answer)


def answer_before_being_asked(answer: Answer) -> None:
    """Introduce itself and answer ten steps at once."""
    write(b"".join(map(line_of, [answer, *({"seq": seq, **HIT} for seq in range(10))])))


sleep = wait(SLEEP)  # longer than anyone waits
# Odd manners that are no faults: these must pass.
HONEST = (
    "honest",
    "dribble",
    "noise",
    "more-fields",
    "answer-and-exit",
    "control-characters",
    "numbers-as-c-writes-them",
    "whole-numbers-with-a-point",
    "lines-as-windows-ends-them",
    "helper-that-ends-later",
    "slow-to-stop",
    "last-words",
)
CONTROLS = "\x1b]0;owned\x07\x1b[2J\r\x9b31m\u202e\u2028\x00"  # for terminals, and what XML cannot hold
HAS_NAMELESS = hasattr(signal, "SIGRTMIN")  # signals of POSIX's real-time extension
# Where each differs from a right server (in what it makes of `start`, `echo`, a step, a step without vy,
# or `stop`), and what it does there.
FAULTS: dict[str, tuple[str, Act]] = {
    "honest": ("step", say),
    "dribble": ("step", write_in_pieces),
    "noise": ("step", then(cry(b"stepping " * 50_000), say)),
    "more-fields": ("step", says(lambda hit: {**hit, "iterations": 7, "note": "\u221e"})),
    "answer-and-exit": ("stop", leave(0)),
    "control-characters": (
        "start",
        then(
            cry(CONTROLS.encode()),
            says(lambda said: {**said, "name": CONTROLS, "laws": [*said["laws"], CONTROLS]}),
        ),
    ),
    "numbers-as-c-writes-them": ("echo", print_digits(17)),
    "whole-numbers-with-a-point": (
        "step",
        writes(lambda line: re.sub(rb'"seq": (\d+)', rb'"seq": \1.0', line)),
    ),
    "lines-as-windows-ends-them": ("step", writes(lambda line: b" " + line[:-1] + b" \t\r\n")),
    "helper-that-ends-later": ("start", then(helper(), say)),
    "last-words": ("stop", then(lambda _: os.close(1), cry(b"statistics " * 50_000), leave(0))),
    # Something else is said.
    "huge-line": ("step", says(lambda hit: {"seq": hit["seq"], "filler": "x" * (2**24 + 2**20)})),
    "wrong-seq": ("step", says(lambda hit: {**hit, "seq": hit["seq"] + 1})),
    "no-seq": ("step", says(lambda _: HIT)),
    "stale-answer": ("step", says(lambda hit: {**hit, "seq": asked[-2:][0]})),
    "nan": ("step", says(lambda hit: {**hit, "vx": float("nan")})),
    "number-as-text": ("step", says(lambda hit: {**hit, "dt": "1.0"})),
    "missing-field": ("step", says(lambda hit: {name: hit[name] for name in hit if name != "vy"})),
    "unknown-wall": ("step", says(lambda hit: {**hit, "wall": "lid"})),
    "reason-of-its-own": (
        "step",
        says(lambda hit: {"seq": hit["seq"], "outcome": "undefined", "reason": "too hard"}),
    ),
    "own-error": ("step", says(lambda hit: {"seq": hit["seq"], "error": "out of memory"})),
    "own-error-beside-an-outcome": ("step", says(lambda hit: {**hit, "error": "out of memory"})),
    "control-characters-in-errors": ("step", says(lambda hit: {"seq": hit["seq"], "error": CONTROLS})),
    "control-characters-in-reasons": (
        "step",
        says(lambda hit: {"seq": hit["seq"], "outcome": "rejected", "reason": CONTROLS * 10**5}),
    ),
    "other-protocol": ("start", says(lambda introduction: {**introduction, "protocol": 2})),
    "early-answers": ("start", answer_before_being_asked),
    "guess-on-invalid": ("reject", says(lambda refusal: {"seq": refusal["seq"], **HIT})),
    "talk-after-stop": ("stop", lambda _: write(b"goodbye\n")),
    "helper-that-talks": ("start", then(helper("farewell\n"), say)),
    # The line is spoilt.
    "duplicate": ("step", writes(lambda line: line + line)),
    "split-line": ("step", writes(lambda line: line[:20] + b"\n" + line[20:])),
    "junk": ("step", writes(lambda line: b"debug: stepping\n" + line)),
    "blank-line": ("step", writes(lambda _: b"\n")),
    "deep-nesting": ("step", writes(lambda _: b"[" * 100_000 + b"]" * 100_000 + b"\n")),
    "infinity": ("step", writes(lambda line: line.replace(b"-0.6", b"1e999"))),
    "endless-line": ("step", forever(writes(lambda _: b"9" * 2**20))),
    "half-a-line": ("step", then(writes(lambda line: line[:40]), sleep)),
    "not-utf8": ("step", writes(lambda line: line.replace(b"collision", b"coll\xffision"))),
    "not-utf8-in-a-further-field": ("step", writes(lambda line: line[:-2] + b', "note": "\xe9"}\n')),
    "banner": ("start", writes(lambda line: b"Welcome to the stepper!\n" + line)),
    # Numbers are misread or misprinted.
    "no-minus-zero": ("echo", echoes(lambda value: value or 0.0)),
    "flush-subnormals": ("echo", echoes(lambda v: v if abs(v) >= sys.float_info.min else 0.0 * v)),
    "misread-exponents": ("echo", echoes(lambda value: float(repr(value).replace("e+22", "e+21")))),
    "fourteen-digits": ("echo", print_digits(14)),
    "fewer-numbers": ("echo", says(lambda answer: {"values": answer["values"][:-1]})),
    # Nothing is said, or too late, or nothing but noise.
    "hang": ("step", sleep),
    "hang-at-start": ("start", sleep),
    "ignore-stop": ("stop", sleep),
    "slow-to-stop": ("stop", then(wait(6.0), leave(0))),  # as machine code that is freed on a busy machine
    "late-answer": ("step", then(wait(3.0), say)),
    "slow": ("step", then(wait(0.7), say)),
    "ignore-sigterm": ("step", then(ignore_termination, sleep)),
    "flood-stderr": ("step", forever(cry(b"help! " * 10_000))),
    # The process ends, or its children stay.
    "crash-on-invalid": ("reject", crash),
    "crash-at-second": ("step", crash_at_the_second),
    "exit-silently": ("step", leave(0)),
    "close-stdout": ("step", then(lambda _: os.close(1), sleep)),
    **({"end-by-a-nameless-signal": ("step", lambda _: os.kill(os.getpid(), 40))} if HAS_NAMELESS else {}),
    "fork-and-die": ("step", then(child(is_detached=False), leave(3))),
    "daemon": ("step", then(child(is_detached=True), leave(3))),
    "leave-a-child": ("stop", child(is_detached=True)),
    "orphan": ("step", then(orphan, leave(3))),
    "leave-an-orphan": ("stop", orphan),
}


if __name__ == "__main__":
    run(sys.argv[1])
