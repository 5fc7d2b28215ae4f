"""The audit: claims of the paper as data, checked against theory and simulation, a verdict on each.

`ledger.toml` holds the claims and `ledger` reads it; `claims/` checks them, a file for each group; `runs`
says what is simulated and `samples` simulates it; `session` conducts an audit.
"""
