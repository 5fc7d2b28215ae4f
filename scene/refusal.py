"""The one error that bad input raises, so that a bug of ours is never mistaken for it."""


class BadInput(ValueError):  # noqa: N818 (the caller's input is bad, not the program)
    """One line naming the field, its value and the bound it breaks."""
