"""The benchmark: speed against error on the same runs, error growth, cost against work, hard cases.

`workloads` draws questions and has them answered by proof; `contenders` are the steppers, given as callables
or as commands, and `baselines` those that most people would write, in C and numba; `measure` times and grades
them in turns; `growth` follows errors along trajectories; `work` finds what time grows with; `hard_cases`
tabulates the corpus's hard cases; `record` is what is kept, and `comparison` sets two records side by side.
It imports no stepper of ours but the baselines; callers pass the others.
"""
