"""What the reference proves, proved again in Arb from its certificate alone."""
