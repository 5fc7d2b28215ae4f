"""Protocol 1: its messages, and the server that answers them for an implementation."""
