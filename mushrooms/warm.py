"""`mushrooms warm`: the kernels of the fast stepper, compiled ahead and kept."""

import time
from dataclasses import dataclass

from mushrooms.progress import announce_compilation
from scene.named import scene_named


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmOptions:
    """The options of `mushrooms warm`.

    Attributes:
        scene: a name or a file; empty for the kernels of all scenes.
    """

    scene: str


def warm_kernels(options: WarmOptions) -> None:
    """Compile the kernels, or load them, and say where they are kept."""
    import fast

    found = scene_named(options.scene) if options.scene else None
    begin = time.monotonic()
    with announce_compilation():
        fast.warm(found)
    seconds = time.monotonic() - begin
    folder = fast.kept_in()
    place = f"kept in {folder}" if folder else "kept nowhere: no folder can be written in"
    print(f"{options.scene or 'all scenes'}: compiled code is {place} ({seconds:.1f} s)")
