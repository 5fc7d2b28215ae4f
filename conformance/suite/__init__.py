"""The suite: every question put to one implementation as a process, the verdicts, and their reports."""

from conformance.suite.result import BAD, VERDICTS, Result, Run, Scope, Speed
from conformance.suite.run import ask_vector, check, choose, measure_speed, read_known

__all__ = [
    "BAD",
    "VERDICTS",
    "Result",
    "Run",
    "Scope",
    "Speed",
    "ask_vector",
    "check",
    "choose",
    "measure_speed",
    "read_known",
]
