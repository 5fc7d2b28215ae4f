"""The ledger, read from ledger.toml, with each entry's check beside it."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources

from conformance.audit.claims import (
    experiments,
    exponents,
    filling,
    finite_energy,
    identities,
    misprints,
    shapes,
    slow_growth,
)
from conformance.audit.finding import Entry
from conformance.audit.tolerances import N_SIGMA
from scene.refusal import BadInput

CHECKS = {
    **misprints.CHECKS,
    **finite_energy.CHECKS,
    **experiments.CHECKS,
    **exponents.CHECKS,
    **identities.CHECKS,
    **filling.CHECKS,
    **shapes.CHECKS,
    **slow_growth.CHECKS,
}


@cache
def entries() -> tuple[Entry, ...]:
    """Return the whole ledger, in its order."""
    text = (resources.files("conformance.audit") / "ledger.toml").read_text("utf-8")
    return tuple(
        Entry(
            **data
            | {
                "runs": tuple(data.get("runs", ())),
                "tolerance": data["tolerance"].replace("{sigma}", f"{N_SIGMA:.2f}"),
                "examine": CHECKS[data["id"]],
            }
        )
        for data in tomllib.loads(text)["entry"]
    )


def select(only: str) -> tuple[Entry, ...]:
    """Return the entries with these ids, separated by commas; all for "".

    Raises:
        BadInput: naming an id that is none, and those that are.
    """
    known = {entry.id: entry for entry in entries()}
    wanted = [part.strip().upper() for part in only.split(",") if part.strip()]
    for name in wanted:
        if name not in known:
            raise BadInput(f"claim {name!r}, must be one of {', '.join(known)}")
    return tuple(entry for entry in entries() if not wanted or entry.id in wanted)
