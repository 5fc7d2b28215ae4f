"""Runs on disk: an ensemble in blocks of particles, as a Zarr group, that an interruption cannot harm."""
