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


@saboteur("more-fields", "step")
def answer_more_than_asked(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], **HIT, "iterations": 7, "note": "\u221e"})


@saboteur("answer-and-exit", "end")
def exit_before_the_input_ends(_: Citizen) -> None:
    os._exit(0)


@saboteur("hang", "step")
def hang(_: Citizen, request: Request) -> None:
    time.sleep(SLEEP)


@saboteur("late-answer", "step")
def answer_late(_: Citizen, request: Request) -> None:
    time.sleep(3.0)
    say({"seq": request["seq"], **HIT})


@saboteur("hang-at-start", "start")
def hang_at_start(_: Citizen) -> None:
    time.sleep(SLEEP)


@saboteur("ignore-sigterm", "step")
def ignore_termination(_: Citizen, request: Request) -> None:
    for name in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(name, signal.SIG_IGN)
    time.sleep(SLEEP)


@saboteur("ignore-stop", "end")
def ignore_stop(_: Citizen) -> None:
    time.sleep(SLEEP)


@saboteur("half-a-line", "step")
def stop_within_a_line(_: Citizen, request: Request) -> None:
    write(json.dumps({"seq": request["seq"], **HIT})[:40])
    time.sleep(SLEEP)


@saboteur("endless-line", "step")
def write_without_end(_: Citizen, request: Request) -> None:
    while True:
        write("9" * 2**20)


@saboteur("huge-line", "step")
def write_a_huge_line(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], "filler": "x" * (2**24 + 2**20)})


@saboteur("flood-stderr", "step")
def flood_standard_error(_: Citizen, request: Request) -> None:
    while True:
        os.write(2, b"help! " * 10_000)


@saboteur("wrong-seq", "step")
def answer_another_question(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"] + 1, **HIT})


@saboteur("stale-answer", "step")
def answer_the_question_before(self: Any, request: Request) -> None:
    before, self.seq = getattr(self, "seq", request["seq"]), request["seq"]
    say({"seq": before, **HIT})


@saboteur("no-seq", "step")
def answer_without_seq(_: Citizen, request: Request) -> None:
    say(HIT)


@saboteur("duplicate", "step")
def answer_twice(_: Citizen, request: Request) -> None:
    line = json.dumps({"seq": request["seq"], **HIT}) + "\n"
    write(line + line)


@saboteur("early-answers", "start")
def answer_before_being_asked(_: Citizen) -> None:
    lines = [INTRODUCTION, *({"seq": seq, **HIT} for seq in range(10))]
    write("".join(json.dumps(line) + "\n" for line in lines))


@saboteur("split-line", "step")
def split_a_line(_: Citizen, request: Request) -> None:
    line = json.dumps({"seq": request["seq"], **HIT})
    write(line[:20] + "\n" + line[20:] + "\n")


@saboteur("junk", "step")
def write_junk_first(_: Citizen, request: Request) -> None:
    write("debug: stepping\n")
    say({"seq": request["seq"], **HIT})


@saboteur("banner", "start")
def write_a_banner_first(_: Citizen) -> None:
    write("Welcome to the stepper!\n")
    say(INTRODUCTION)


@saboteur("blank-line", "step")
def write_a_blank_line(_: Citizen, request: Request) -> None:
    write("\n")


@saboteur("not-utf8", "step")
def write_bytes(_: Citizen, request: Request) -> None:
    sys.stdout.buffer.write(b'{"seq": %d, "outcome": "\xff\xfe"}\n' % request["seq"])
    sys.stdout.flush()


@saboteur("deep-nesting", "step")
def nest_deeply(_: Citizen, request: Request) -> None:
    write("[" * 100_000 + "]" * 100_000 + "\n")


@saboteur("nan", "step")
def answer_nan(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], **HIT, "vx": float("nan")})


@saboteur("infinity", "step")
def answer_beyond_binary64(_: Citizen, request: Request) -> None:
    write(json.dumps({"seq": request["seq"], **HIT}).replace("-0.6", "1e999") + "\n")


@saboteur("number-as-text", "step")
def quote_a_number(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], **HIT, "dt": "1.0"})


@saboteur("missing-field", "step")
def leave_out_a_field(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], **{name: value for name, value in HIT.items() if name != "vy"}})


@saboteur("unknown-wall", "step")
def name_an_unknown_wall(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], **HIT, "wall": "lid"})


@saboteur("reason-of-its-own", "step")
def invent_a_reason(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], "outcome": "undefined", "reason": "too hard"})


@saboteur("own-error", "step")
def report_an_error(_: Citizen, request: Request) -> None:
    say({"seq": request["seq"], "error": "out of memory"})


@saboteur("other-protocol", "start")
def speak_another_protocol(_: Citizen) -> None:
    say({**INTRODUCTION, "protocol": 2})


@saboteur("fifteen-digits", "echo")
def print_fifteen_digits(_: Citizen, values: list[float]) -> None:
    write('{"values": [' + ", ".join(f"{value:.15g}" for value in values) + "]}\n")


@saboteur("no-minus-zero", "echo")
def lose_the_sign_of_zero(_: Citizen, values: list[float]) -> None:
    say({"values": [value or 0.0 for value in values]})


@saboteur("flush-subnormals", "echo")
def flush_subnormals(_: Citizen, values: list[float]) -> None:
    say({"values": [value if abs(value) >= sys.float_info.min else 0.0 * value for value in values]})


@saboteur("misread-exponents", "echo")
def misread_exponents(_: Citizen, values: list[float]) -> None:
    say({"values": [float(repr(value).replace("e+22", "e+21")) for value in values]})


@saboteur("fewer-numbers", "echo")
def lose_a_number(_: Citizen, values: list[float]) -> None:
    say({"values": values[:-1]})


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
