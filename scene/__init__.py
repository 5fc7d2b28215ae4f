"""What all packages share: laws of motion, tables, states, outcomes.

`laws` and `tables` define scenes, and `validity` proves each one valid when it is made. `load`
reads a scene. `geometry` describes a table at one instant. `transforms` are changes that leave the
physics the same.
"""

from scene.laws import BangBang, Constant, Fourier, GivenLaw, Law
from scene.load import catalogue, from_data, load, to_data
from scene.notebook import of_scene
from scene.refusal import BadInput, InvalidScene, check_count, check_number
from scene.states import (
    Collision,
    Horizon,
    InvalidState,
    Outcome,
    Rejected,
    State,
    Undecided,
    Undefined,
)
from scene.tables import Cap, Mushroom, Scene, Stem, Wall, _Table, check_scene

__all__ = [
    "BadInput",
    "BangBang",
    "Cap",
    "Collision",
    "Constant",
    "Fourier",
    "GivenLaw",
    "Horizon",
    "InvalidScene",
    "InvalidState",
    "Law",
    "Mushroom",
    "Outcome",
    "Rejected",
    "Scene",
    "State",
    "Stem",
    "Undecided",
    "Undefined",
    "Wall",
    "catalogue",
    "check_count",
    "check_number",
    "check_scene",
    "from_data",
    "load",
    "to_data",
]


def __dir__() -> list[str]:
    """List the public names, without the modules that they come from."""
    return __all__


# The tables cannot import what makes their page in a notebook: it needs the tables.
_Table._repr_html_ = of_scene
