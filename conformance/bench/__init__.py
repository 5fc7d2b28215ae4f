"""The benchmark: speed against error on the same runs, error growth, cost against work, hard cases.

`workloads` draws questions and has them answered by proof; `contenders` are the steppers, given as callables
or as commands; `measure` times and grades them in turns; `growth` follows errors along trajectories; `work`
finds what time grows with; `hard_cases` tabulates the corpus's hard cases; `record` is what is kept, and
`comparison` sets two records side by side. It meets steppers only as it is given them.
"""
