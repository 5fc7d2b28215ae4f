"""Example implementations of protocol 1 in other languages, and how to run each here."""
