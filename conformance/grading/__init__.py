"""From a stepper's answer and a certified one to a verdict: backward ulps, agreement, grades."""
