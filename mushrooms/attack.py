"""The attack command: families of nasty questions, which the reference answers and the verifier judges."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.table import Column, Table

import fast
from conformance.cases.attacks import UnderAttack, run
from conformance.cases.table import FAMILIES
from conformance.files import write_file
from mushrooms import output
from mushrooms.terminal import announce_compilation, new_console, progress_bar
from scene import BadInput, Horizon, Mushroom, Scene, State, Undefined

CHOICES = ("reference", "fast", "both")
SLOWEST = 10.0  # seconds that one question may take the reference: its work is bounded


def attack_steppers(family: str, cases: int, seed: int, stepper: str, json_file: Path | None) -> int:
    """Ask steppers the questions of one family or of all, print the counts, and return the exit code."""
    if stepper not in CHOICES:
        raise BadInput(f"--stepper = {stepper!r}, must be one of {', '.join(CHOICES)}")
    names = list(FAMILIES) if family == "all" else [family]
    if family != "all" and family not in FAMILIES:
        raise BadInput(f"--family = {family!r}, must be all or one of {', '.join(FAMILIES)}")
    if json_file is not None:
        output.check_file(json_file, (".json",))
    with announce_compilation(), progress_bar() as bar:
        task = bar.add_task("attack", total=cases * len(names))
        tallies = run(
            [FAMILIES[name] for name in names],
            cases,
            seed,
            steppers(stepper),
            progress=lambda _: bar.advance(task),
        )
    _print(tallies)
    if json_file is not None:
        write_file(json_file, json.dumps([_row(tally) for tally in tallies], indent=1) + "\n")
    return int(any(tally.cases["wrong"] or tally.slowest > SLOWEST for tally in tallies))


def steppers(choice: str) -> UnderAttack:
    """Return what "reference", "fast" or "both" puts under attack."""
    if choice == "reference":
        return UnderAttack()
    return UnderAttack(fast.next_collision, count_hits, is_proved=choice == "both")


def count_hits(scene: Scene, state: State, t_end: float) -> dict[str, int] | None:
    """Return how often the lanes meet each wall up to t_end; None where a flow is undecided or refused."""
    try:
        carried = fast.flow(scene, [state], t_end)
    except BadInput:
        return None
    if not isinstance(carried.outcomes[0], Horizon | Undefined):
        return None
    return dict(zip(Mushroom.walls, map(int, carried.wall_counts[0]), strict=True))


def _row(tally: Any) -> dict[str, Any]:
    row = {"family": tally.family, "cases": tally.n_cases, **tally.counts}
    row |= {"worst_ulps": tally.worst_ulps, "slowest_s": tally.slowest}
    return row | {f"{kind}_cases": cases for kind, cases in tally.cases.items()}


def _print(tallies: list[Any]) -> None:
    heads = ("cases", "agreed", "undecided", "refused", "open", "wrong", "worst ulps", "slowest s")
    # The name is needed to ask again: a narrow terminal cuts the heads instead.
    table = Table(Column("family", no_wrap=True), *heads, title="Attacks: verdicts of all steppers asked")
    for tally in tallies:
        counts = [str(count) for count in tally.counts.values()]
        table.add_row(
            tally.family, str(tally.n_cases), *counts, f"{tally.worst_ulps:.3g}", f"{tally.slowest:.2f}"
        )
    new_console().print(table)
    for tally in tallies:
        for kind in ("open", "wrong"):
            for case in tally.cases[kind]:
                print(f"{kind}: {case}")
