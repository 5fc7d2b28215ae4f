"""The claims of the paper, checked: a file for each group of ledger entries."""
