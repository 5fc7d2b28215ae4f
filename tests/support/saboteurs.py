"""Implementations that break the protocol, each in one way; `python saboteurs.py NAME` is one of them.

Each is an honest citizen (it answers every step alike, as physics is not asked of it here) whose one fault
is a function below. None may hang the runner, outlive it, or pass.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

INTRODUCTION = {
    "protocol": 1,
    "name": "saboteur",
    "version": "1",
    "language": "Python",
    "profiles": ["step"],
    "tables": ["cap", "stem", "mushroom"],
    "laws": ["constant", "fourier", "bang-bang"],
}
HIT = {"outcome": "collision", "wall": "arc", "dt": 1.0, "t": 1.0, "x": 0.6, "y": 0.8, "vx": -0.6, "vy": -0.8}
SLEEP = 600.0
Request = dict[str, Any]


class Citizen:
    """The honest part: what it says when nothing is sabotaged."""

    n_steps = 0

    def run(self) -> None:
        """Answer requests until `stop`."""
        for line in sys.stdin:
            request = json.loads(line)
            if request["cmd"] == "stop":
                self.end()
                return
            self.reply(request)

    def reply(self, request: Request) -> None:
        """Answer one request."""
        if request["cmd"] == "start":
            self.start()
        elif request["cmd"] == "echo":
            self.echo(request["values"])
        elif "vy" not in request["state"]:
            self.reject(request)
        else:
            self.n_steps += 1
            self.step(request)

    def start(self) -> None:
        """Introduce itself."""
        say(INTRODUCTION)

    def echo(self, values: list[float]) -> None:
        """Return the numbers."""
        say({"values": values})

    def reject(self, request: Request) -> None:
        """Refuse a state without vy."""
        say({"seq": request["seq"], "outcome": "rejected", "reason": "state.vy is missing"})

    def step(self, request: Request) -> None:
        """Answer a step."""
        say({"seq": request["seq"], **HIT})

    def end(self) -> None:
        """Leave."""


def say(data: Any) -> None:
    """Write one line of JSON."""
    write(json.dumps(data) + "\n")


def write(text: str) -> None:
    """Write and flush."""
    sys.stdout.write(text)
    sys.stdout.flush()


def saboteur(name: str, method: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a function as the one method in which a saboteur differs."""

    def register(function: Callable[..., None]) -> Callable[..., None]:
        SABOTEURS[name] = type(name, (Citizen,), {method: function})
        return function

    return register


SABOTEURS: dict[str, type[Citizen]] = {"honest": Citizen}
# Odd manners that are no faults: these must pass.
HONEST = ("honest", "dribble", "noise", "more-fields", "answer-and-exit")
# What is answered to a step in place of the honest answer.
ANSWERS: dict[str, Callable[[Request], Request]] = {
    "more-fields": lambda hit: {**hit, "iterations": 7, "note": "\u221e"},
    "huge-line": lambda hit: {"seq": hit["seq"], "filler": "x" * (2**24 + 2**20)},
    "wrong-seq": lambda hit: {**hit, "seq": hit["seq"] + 1},
    "no-seq": lambda _: HIT,
    "nan": lambda hit: {**hit, "vx": float("nan")},
    "number-as-text": lambda hit: {**hit, "dt": "1.0"},
    "missing-field": lambda hit: {name: value for name, value in hit.items() if name != "vy"},
    "unknown-wall": lambda hit: {**hit, "wall": "lid"},
    "reason-of-its-own": lambda hit: {"seq": hit["seq"], "outcome": "undefined", "reason": "too hard"},
    "own-error": lambda hit: {"seq": hit["seq"], "error": "out of memory"},
}
# What is written in place of the honest line.
LINES: dict[str, Callable[[str], str]] = {
    "duplicate": lambda line: line + line,
    "split-line": lambda line: line[:20] + "\n" + line[20:],
    "junk": lambda line: "debug: stepping\n" + line,
    "blank-line": lambda _: "\n",
    "deep-nesting": lambda _: "[" * 100_000 + "]" * 100_000 + "\n",
    "infinity": lambda line: line.replace("-0.6", "1e999"),
}
# What becomes of the numbers to be echoed.
ECHOES: dict[str, Callable[[float], float]] = {
    "no-minus-zero": lambda value: value or 0.0,
    "flush-subnormals": lambda value: value if abs(value) >= sys.float_info.min else 0.0 * value,
    "misread-exponents": lambda value: float(repr(value).replace("e+22", "e+21")),
}


def answering(change: Callable[[Request], Request]) -> Callable[..., None]:
    """Return a step that says a changed answer."""
    return lambda _, request: say(change({"seq": request["seq"], **HIT}))


def writing(change: Callable[[str], str]) -> Callable[..., None]:
    """Return a step that writes something else for its line."""
    return lambda _, request: write(change(json.dumps({"seq": request["seq"], **HIT}) + "\n"))


def echoing(change: Callable[[float], float]) -> Callable[..., None]:
    """Return an echo of changed numbers."""
    return lambda _, values: say({"values": [change(value) for value in values]})


def sleep(*_: Any) -> None:
    """Do nothing for longer than anyone waits."""
    time.sleep(SLEEP)


for _name, _answer in ANSWERS.items():
    saboteur(_name, "step")(answering(_answer))
for _name, _line in LINES.items():
    saboteur(_name, "step")(writing(_line))
for _name, _number in ECHOES.items():
    saboteur(_name, "echo")(echoing(_number))
saboteur("fewer-numbers", "echo")(lambda _, values: say({"values": values[:-1]}))
for _name, _method in (("hang", "step"), ("hang-at-start", "start"), ("ignore-stop", "end")):
    saboteur(_name, _method)(sleep)


@saboteur("dribble", "step")
def write_in_pieces(_: Citizen, request: Request) -> None:
    line = json.dumps({"seq": request["seq"], **HIT}) + "\n"
    for start in range(0, len(line), 50):
        write(line[start : start + 50])
        time.sleep(0.02)


@saboteur("noise", "step")
def write_much_to_standard_error(_: Citizen, request: Request) -> None:
    os.write(2, b"stepping " * 50_000)
    say({"seq": request["seq"], **HIT})


@saboteur("answer-and-exit", "end")
def exit_before_the_input_ends(_: Citizen) -> None:
    os._exit(0)


@saboteur("late-answer", "step")
def answer_late(_: Citizen, request: Request) -> None:
    time.sleep(3.0)
    say({"seq": request["seq"], **HIT})


@saboteur("ignore-sigterm", "step")
def ignore_termination(_: Citizen, request: Request) -> None:
    for name in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(name, signal.SIG_IGN)
    time.sleep(SLEEP)


@saboteur("half-a-line", "step")
def stop_within_a_line(_: Citizen, request: Request) -> None:
    write(json.dumps({"seq": request["seq"], **HIT})[:40])
    time.sleep(SLEEP)


@saboteur("endless-line", "step")
def write_without_end(_: Citizen, request: Request) -> None:
    while True:
        write("9" * 2**20)


@saboteur("flood-stderr", "step")
def flood_standard_error(_: Citizen, request: Request) -> None:
    while True:
        os.write(2, b"help! " * 10_000)


@saboteur("stale-answer", "step")
def answer_the_question_before(self: Any, request: Request) -> None:
    before, self.seq = getattr(self, "seq", request["seq"]), request["seq"]
    say({"seq": before, **HIT})


@saboteur("early-answers", "start")
def answer_before_being_asked(_: Citizen) -> None:
    lines = [INTRODUCTION, *({"seq": seq, **HIT} for seq in range(10))]
    write("".join(json.dumps(line) + "\n" for line in lines))


@saboteur("banner", "start")
def write_a_banner_first(_: Citizen) -> None:
    write("Welcome to the stepper!\n")
    say(INTRODUCTION)


@saboteur("not-utf8", "step")
def write_bytes(_: Citizen, request: Request) -> None:
    sys.stdout.buffer.write(b'{"seq": %d, "outcome": "\xff\xfe"}\n' % request["seq"])
    sys.stdout.flush()


@saboteur("other-protocol", "start")
def speak_another_protocol(_: Citizen) -> None:
    say({**INTRODUCTION, "protocol": 2})


@saboteur("fifteen-digits", "echo")
def print_fifteen_digits(_: Citizen, values: list[float]) -> None:
    write('{"values": [' + ", ".join(f"{value:.15g}" for value in values) + "]}\n")


@saboteur("crash-on-invalid", "reject")
def crash_on_invalid(_: Citizen, request: Request) -> None:
    raise KeyError("vy")


@saboteur("guess-on-invalid", "reject")
def guess_what_is_missing(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], **HIT})


@saboteur("crash-at-second", "step")
def crash_at_the_second(self: Citizen, request: Request) -> None:
    if self.n_steps == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
    say({"seq": request["seq"], **HIT})


@saboteur("exit-silently", "step")
def exit_silently(_: Citizen, request: Request) -> None:
    os._exit(0)


@saboteur("close-stdout", "step")
def close_standard_output(_: Citizen, request: Request) -> None:
    os.close(1)
    time.sleep(SLEEP)


@saboteur("fork-and-die", "step")
def die_and_leave_a_child(_: Citizen, request: Request) -> None:
    spawn(is_detached=False)
    os._exit(3)


@saboteur("daemon", "step")
def die_and_leave_a_daemon(_: Citizen, request: Request) -> None:
    spawn(is_detached=True)
    os._exit(3)


@saboteur("leave-a-child", "end")
def leave_a_child_at_stop(_: Citizen) -> None:
    spawn(is_detached=True)


@saboteur("talk-after-stop", "end")
def talk_after_stop(_: Citizen) -> None:
    write("goodbye\n")


def spawn(is_detached: bool) -> None:
    """Start a child that holds this process's pipes."""
    subprocess.Popen(
        [sys.executable, "-c", f"import time; time.sleep({SLEEP})"], start_new_session=is_detached
    )


if __name__ == "__main__":
    SABOTEURS[sys.argv[1]]().run()
