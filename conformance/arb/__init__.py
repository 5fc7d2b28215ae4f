"""Ball arithmetic (Arb, through python-flint), written apart from `reference` and sharing nothing with it.

Two programs use it to check the reference: `conformance.second_proof` proves its certificates again, and
`conformance.second_stepper` answers the same questions by an argument of its own. What is the same for both
is here: numbers, laws of motion, and the walls along a straight flight. Needs the test extra (python-flint).
"""
