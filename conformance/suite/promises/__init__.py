"""What protocol 1 promises beyond right answers, each held to an implementation by questions of its own.

An answer is compared with another answer of the same implementation: what a field left out means, that bad
lines do no harm, that many particles or collisions asked at once are answered as when asked one by one.
Whether such answers are right is for the vectors. Promises of one kind have a module each: what a request
may be in `requests`, what must be refused in `refusals` and `scenes`, where answers must agree in
`consistency`, what a table at rest conserves in `conserved`, what an answer may depend on in `sameness` and
`changes`, flows whose arrivals are known in `crowds`, how trajectories end in `endings`, and what holds
`time` to a clock in `timing`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

from conformance.suite.process import NOT_NUMBERS, Trouble
from conformance.suite.promises import (
    changes,
    conserved,
    consistency,
    crowds,
    endings,
    refusals,
    requests,
    sameness,
    scenes,
    timing,
)
from conformance.suite.result import NamedVerdict
from conformance.suite.session import Session

_CHECKS: dict[str, Callable[[Session], str]] = {
    "repeated-questions": requests.repeated_questions,
    "absent-wall": requests.absent_wall,
    "malformed-lines": requests.malformed_lines,
    "extra-fields": requests.extra_fields,
    "bad-states": refusals.bad_states,
    "bad-scenes": scenes.bad_scenes,
    "flow-alone": consistency.flow_alone,
    "long-trajectory": consistency.long_trajectory,
    "trajectory-ends": endings.trajectory_ends,
    "at-rest": conserved.at_rest,
    "trajectory-steps": consistency.trajectory_steps,
    "flow-arrivals": consistency.flow_arrivals,
    "spelling": sameness.spelling,
    "minus-zero": sameness.minus_zero,
    "near-questions": sameness.near_questions,
    "changed-questions": changes.changed_questions,
    "many-particles": sameness.many_particles,
    "twin-particles": crowds.twin_particles,
    "long-flow": crowds.long_flow,
    "time-steps": timing.same_steps,
    "time-clock": timing.honest_clock,
}
PROMISES = tuple(_CHECKS)


def ask_promises(session: Session, names: Sequence[str] = ()) -> Iterator[NamedVerdict]:
    """Hold an implementation to what the protocol promises.

    Args:
        session: open.
        names: of PROMISES; all when empty.

    Yields:
        Name, verdict, reason, seconds of each: `unsupported` where the promise is about something that is
        not offered, `declined` where an answer is undecided.
    """
    for name in names or PROMISES:
        begin, verdict = time.monotonic(), "pass"
        try:
            why = _CHECKS[name](session)
        except Trouble as trouble:
            verdict, why = trouble.verdict, trouble.why
        except NOT_NUMBERS as error:
            verdict, why = "fail", f"its answers cannot be calculated with: {error}"
        yield name, verdict, why, time.monotonic() - begin
