"""The benchmark: speed against error on the same runs, and error growth.

`workloads` draws questions and has them answered by proof; `solvers` are the steppers, given as callables
or as commands, timed and graded in turns, and `baselines` those that most people would write; `solvers`
also follow errors along trajectories; `record` is what is kept; `scoreboard` grades all of them as
`mushrooms check` does.
It imports no stepper of ours but the baselines; callers pass the others.
"""
