"""The audit: claims of the paper as data, checked against theory and simulation, a verdict on each.

`ledger.toml` is the ledger, `ledger` reads it; `misprints`, `finite_energy`, `experiments`, `many_cycles`,
`laws` and `further` hold the checks; `runs` says what is simulated, `samples` does it; `session` conducts
an audit.
"""
