"""What the reference proves, proved again in Arb (`conformance.arb`) from its certificate alone.

`step.check` takes the certificate of a step, `trajectory.check_path` that of a trajectory, and
`chain.recheck` the enclosures that a vector of the corpus writes down. Each raises `Refuted` where something
does not hold.
"""
