"""`python -m conformance.bench.serve NAME`: a baseline behind protocol 1, to be graded like any other.

Baselines take a state as it is and refuse nothing but what the protocol's decoder refuses: what their own
code makes of it is what the suite shall see. Flow is their steps, one after the other.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from conformance import plain
from conformance.bench import baselines
from conformance.bench.time_stepping import TOLERANCES, next_collision_by
from scene import BadInput
from scene.protocol.wire import serve
from scene.states import Stepper

FLAGS = ("-O3", "-march=native")


def _in_c(name: str) -> Stepper:
    with tempfile.TemporaryDirectory() as folder:  # the library stays loaded
        library, _ = baselines.build(Path(folder), FLAGS)
        found = next(one for one in baselines.in_c(library) if one.name == name)
        return baselines.stepper(found)


NAMES: dict[str, Callable[[], Stepper]] = {
    "lean-c": partial(_in_c, "lean C"),
    "lean-numba": lambda: baselines.stepper(baselines.in_numba()),
    **{f"steps-{parts}": partial(_in_c, f"steps, flight/{parts}") for parts in baselines.PARTS},
    **{f"solve-ivp-{rtol:.0e}": partial(next_collision_by, rtol) for rtol in TOLERANCES},
}


def main(arguments: Sequence[str]) -> None:
    """Speak protocol 1 as the baseline of that name.

    Raises:
        BadInput: there is no such baseline.
        Trouble: it cannot be built here.
    """
    name = arguments[0] if len(arguments) == 1 else ""
    if name not in NAMES:
        raise BadInput(f"NAME = {name!r}, must be one of {', '.join(NAMES)}")
    step = NAMES[name]()

    follow, carry = partial(plain.trajectory, step=step), partial(plain.flow, step=step)
    serve(name, step, follow, sys.stdin.buffer, sys.stdout.buffer, flow=carry)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except BadInput as error:
        sys.exit(f"conformance.bench.serve: {error}")
