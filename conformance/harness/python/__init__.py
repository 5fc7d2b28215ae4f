"""Example implementations of protocol 1 in Python."""
