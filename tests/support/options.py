"""Records of options, as a command line makes them that says little."""

from typing import Any

from mushrooms.draw import DrawOptions

NO_PICTURE = dict.fromkeys(("trajectory", "section", "boundary_map", "growth", "lyapunov"), False)


def draw_options(**said: Any) -> DrawOptions:
    """Return the options of `mushrooms draw`; what is not said is None, and no picture is asked for."""
    unsaid = dict.fromkeys(DrawOptions.__dataclass_fields__) | NO_PICTURE
    return DrawOptions(**{**unsaid, **said})
