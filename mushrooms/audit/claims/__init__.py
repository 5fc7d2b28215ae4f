"""The claims of the paper, read from claims.toml, and how each is checked, a file a group."""

import tomllib
from functools import cache
from importlib import resources

from mushrooms.audit.claim import Claim
from mushrooms.audit.claims import (
    assumptions,
    experiments,
    exponents,
    finite_energy,
    many_cycles,
    misprints,
)
from mushrooms.audit.tolerances import N_SIGMA
from scene.refusal import BadInput

CHECKS = {
    **misprints.CHECKS,
    **finite_energy.CHECKS,
    **experiments.CHECKS,
    **exponents.CHECKS,
    **assumptions.CHECKS,
    **many_cycles.CHECKS,
}


@cache
def all_claims() -> tuple[Claim, ...]:
    """Return all claims, in their order."""
    text = (resources.files("mushrooms.audit") / "claims.toml").read_text("utf-8")
    return tuple(
        Claim(
            **data
            | {
                "runs": tuple(data.get("runs", ())),
                "tolerance": data["tolerance"].replace("{sigma}", f"{N_SIGMA:.2f}"),
                "examine": CHECKS[data["id"]],
            }
        )
        for data in tomllib.loads(text)["claim"]
    )


def select_claims(only: str) -> tuple[Claim, ...]:
    """Return the claims with these ids, separated by commas; all for "".

    Raises:
        BadInput: naming an id that is none, and those that are.
    """
    known = {claim.id: claim for claim in all_claims()}
    wanted = [part.strip().upper() for part in only.split(",") if part.strip()]
    for name in wanted:
        if name not in known:
            raise BadInput(f"claim {name!r}, must be one of {', '.join(known)}")
    return tuple(claim for claim in all_claims() if not wanted or claim.id in wanted)
