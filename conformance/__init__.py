"""Holds any stepper to the certified answers and exact properties of moving walls.

A tester imports `vectors`, `strategies`, `properties` and `profiles`. The folders are what makes the vectors
(`cases`), what grades answers (`grading`, `suite`), what shows that both can fail (`mutants`, and
`tests/planted_faults.md`), and the benchmark.
"""
