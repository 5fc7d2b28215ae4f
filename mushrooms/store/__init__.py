"""Runs on disk: blocks of an ensemble in a Zarr group, which an interruption cannot harm."""
