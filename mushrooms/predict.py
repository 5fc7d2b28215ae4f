"""`mushrooms theory`: what the theory predicts for one cycle, as decimal strings."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from mushrooms.terminal import (
    AsJson,
    SceneName,
    check_energy,
    check_range,
    load_scene,
    print_pairs,
    progress_bar,
)

MAX_DIGITS = 1000


def predict(
    scene: SceneName,
    digits: Annotated[int, typer.Option(help=f"Correct digits, 1 to {MAX_DIGITS}.")] = 15,
    energy: Annotated[
        float | None, typer.Option(help="Add the same figures at this initial energy v²/2, > 0.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print the paper's predictions for one cycle as decimal strings, and what each is.

    With --energy, what particles that begin with it will show, and the size of what that leaves out. It takes
    rates of frozen tables: those of the audit's scenes are known (python -m conformance.audit.frozen).
    """
    import theory
    from mushrooms.explained import FIGURES, at_energy

    check_range("--digits", digits, 1, MAX_DIGITS)
    check_energy(energy)
    found = load_scene(scene)
    with progress_bar() as bar:
        task = bar.add_task("resolution 1 of two or more", total=100)

        def advance(number: int, share: float) -> None:
            bar.update(task, completed=round(100 * share), description=f"resolution {number} of two or more")

        pairs: dict[str, Any] = dict(theory.predict(found, digits, progress=advance).strings(digits))
    pairs |= at_energy(found, energy) if energy is not None else {}
    print_pairs(pairs, as_json, FIGURES)
