"""The audit: claims of the paper as data, checked against theory and simulation, a verdict on each.

What decides: `claims.toml` holds the claims and `claims/` checks them, a file for each group;
`claim` has the forms of a claim, its evidence and its checks; `runs` says what is simulated;
`tolerances` compares; `session` conducts an audit; `ensemble_checks` judges an ensemble of another
program; `frozen` measures the rates that theory takes at a finite energy.

What shows: `figures`, `page`. `command` and `ensemble_command` do the work of `mushrooms audit`;
`ensemble_table` reads an ensemble of another program. What decides imports nothing that shows,
stores or commands.
"""
