"""Signals that end a command: none is lost, and after each the command ends in one line.

Python raises an interrupt wherever the main thread is. Where that is a callback of a compiler, a
`__del__` or a bare `except`, the exception is thrown away and the command goes on. So an
`Interrupt` that is thrown away is raised again a moment later, until it reaches the place that ends
the command.

SIGTERM and SIGHUP do what SIGINT does: a batch system ends its jobs so. A signal that is ignored
from the start (`nohup`) stays ignored.

This module is imported before anything else is: it imports only what the interpreter has soon.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from types import FrameType

PROGRAM = "mushrooms"
INTERRUPTED = 130
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
AGAIN = 0.05  # seconds after which an interrupt that was thrown away is raised again
# Seconds in which further signals are the same Ctrl-C: a wrapper has it too, and passes it on.
SAME = 0.5


def say_interrupted() -> None:
    """Say on stderr that a command was interrupted.

    Only the system is used: anything may be half loaded.
    """
    if sys.stderr is not None:  # where it was closed, its number may be that of another file
        try:  # noqa: SIM105 (contextlib takes long to load)
            os.write(2, f"{PROGRAM}: interrupted\n".encode())
        except OSError:
            pass


class Interrupt(KeyboardInterrupt):
    """Raised by a signal; tells its listener when nothing holds it any more."""

    def __init__(self, listener: Listener | None = None) -> None:
        super().__init__()
        self._listener = listener

    def __reduce__(self) -> tuple[type[Interrupt], tuple[()]]:
        """Leave the listener behind.

        In another process, or as a copy, it is an interrupt like any other.
        """
        return Interrupt, ()

    def __del__(self) -> None:
        if self._listener is not None:
            self._listener.raise_again()


class Listener:
    """Raises an `Interrupt` at a signal, and again if it is thrown away.

    A second signal, half a second or more after the first, ends the process at once.

    Args:
        is_program: whether the process ends with the command; else nothing here ends it.

    Attributes:
        has_heard: whether a signal has come.
    """

    def __init__(self, *, is_program: bool) -> None:
        self.has_heard = False
        self._is_program = is_program
        self._first = 0.0
        self._code: int | None = None  # in which the command has ended
        self._before: dict[int, object] = {}
        self._can_repeat = False
        self._unraisable = sys.unraisablehook

    def begin(self) -> None:
        """Listen, if this is the main thread: no other one can."""
        usual = (signal.SIG_DFL, signal.default_int_handler)
        wanted = {**dict.fromkeys(SIGNALS, self._hear), "SIGALRM": self._repeat}
        try:
            for name, handler in wanted.items():
                number = getattr(signal, name, None)  # Windows lacks some
                if number is not None and signal.getsignal(number) in usual:
                    self._before[number] = signal.signal(number, handler)
                    self._can_repeat = name == "SIGALRM"
        except ValueError:
            return
        sys.unraisablehook = self._report

    def end(self, code: int) -> None:
        """Take note of how the command has ended: signals interrupt nothing any more."""
        self._code = code

    def stop(self) -> None:
        """Put back what was there before; a program keeps listening until the process ends."""
        if not self._is_program:
            sys.unraisablehook = self._unraisable
            for number, handler in self._before.items():
                signal.signal(number, handler)  # type: ignore[arg-type]

    def raise_again(self) -> None:
        """Raise an interrupt soon: the last one was thrown away, if the command has not ended.

        Not at once: what has thrown it away is still at work.
        """
        if self._code is None and self._can_repeat:
            signal.setitimer(signal.ITIMER_REAL, AGAIN)

    def _hear(self, _number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if self.has_heard and now - self._first < SAME:
            return
        if self._code is not None:
            if self._is_program:  # the interpreter may take seconds to free everything
                os._exit(self._code)
            return
        if self.has_heard and self._is_program:
            say_interrupted()
            os._exit(INTERRUPTED)
        self.has_heard = True
        self._first = now
        raise Interrupt(self)

    def _repeat(self, _number: int, _frame: FrameType | None) -> None:
        if self._code is None:
            raise Interrupt(self)

    def _report(self, lost: sys.UnraisableHookArgs) -> None:
        """Report what was thrown away, but no interrupt, which is raised again."""
        if not isinstance(lost.exc_value, Interrupt):
            self._unraisable(lost)
