"""The audit: claims of the paper as data, checked against theory and simulation, a verdict on each.

`claims.toml` holds the claims and `claims/` checks them, a file for each group; `claim` has the forms of a
claim, its evidence and its checks; `runs` says what is simulated; `session` conducts an audit.
"""
