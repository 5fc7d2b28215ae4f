"""The entry of the command line, which listens for signals before any import that takes long."""

from __future__ import annotations

import os
import sys

from mushrooms.interrupts import INTERRUPTED, Listener, say_interrupted


def run(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 a claim failed, 2 bad input, 130 interrupted.

    Args:
        arguments: of the command, which ends with SystemExit; None for those of this process. A
            process that is interrupted ends at once, without what libraries do or report at its
            end.
    """
    listener = Listener(is_program=arguments is None)
    listener.begin()
    try:
        try:
            from mushrooms.endings import call

            code = call(sys.argv[1:] if arguments is None else arguments, listener)
        except BaseException:
            if not listener.has_heard:
                raise
            # It came before there was what tells of it, or just after the command had ended.
            code = INTERRUPTED
            listener.end(code)
            say_interrupted()
    finally:
        listener.stop()
    if arguments is None and listener.has_heard:
        os._exit(code)
    sys.exit(code)
