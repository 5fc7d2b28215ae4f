"""Figures: of a table, of a claim, of a benchmark."""
