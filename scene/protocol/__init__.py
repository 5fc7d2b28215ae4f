"""Protocol 1: its messages, and the side of an implementation that answers them."""
