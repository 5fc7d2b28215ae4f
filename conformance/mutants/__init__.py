"""Mutants: the plain stepper with one physics error each, of the kind that people make.

MUTANTS prove that the suite can fail. Each is killed by a `fail`, not by a crash, and none is subsumed by
another, that is, killed by all the vectors that kill that other, if these are at least five. `kill_matrix`
holds both.
COMMON are mistakes that a diagnosis names too, though mutants subsume them.
"""

from conformance.mutants import laws, paths, walls
from conformance.mutants.mutant import COMMON, MUTANTS, PLAIN, Mutant, make_mutant, mutant

__all__ = [
    "COMMON",
    "MUTANTS",
    "PLAIN",
    "Mutant",
    "laws",
    "make_mutant",
    "mutant",
    "paths",
    "walls",
]
