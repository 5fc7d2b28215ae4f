"""The benchmark: speed against error on the same runs, and error growth.

`workloads` draws questions and has them answered by proof; `solvers` are the steppers, given as callables
or as commands, and `baselines` those that most people would write, in C and numba; `measure` times and grades
them in turns; `growth` follows errors along trajectories; `record` is what is kept. `scoreboard` grades
baselines, examples and our steppers as `mushrooms check` does.
It imports no stepper of ours but the baselines; callers pass the others.
"""
