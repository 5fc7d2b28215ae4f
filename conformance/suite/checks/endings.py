"""How paths end: as many steps as asked for, or fewer and last what came instead, with its reason."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from conformance.cases.draw import Draw
from conformance.suite.checks.form import FOREVER, Implementation, Question, question
from scene import Cap, Mushroom, Scene, State, Stem

# At t = 0.5 and its like two walls are met at once, in numbers that are exact.
CORNERS: tuple[tuple[Scene, State, str], ...] = (
    (Mushroom(r=1.0, w=0.5, h=1.0), State(0.0, 0.25, -0.5, 0.5, -1.0), "corner"),
    (Mushroom(r=1.0, w=0.5, h=1.0), State(0.0, 0.25, 0.5, 0.5, -1.0), "mouth-edge"),
    (Cap(r=1.0), State(0.0, 0.5, 0.25, 1.0, -0.5), "corner"),
    (Cap(r=1.0), State(0.0, 0.75, 0.0, 0.1, 0.0, "base"), "sliding"),
    (Stem(w=1.0, h=1.5), State(0.0, 0.0, -0.75, 2.0, -1.5), "corner"),
    (Stem(w=1.0, h=1.5), State(0.0, 0.5, 0.0, 0.1, 0.0, "base"), "sliding"),
)
# Likewise after a hit: of the base at t = 0.25, before the corner at t = 1.
LATER = Stem(w=1.0, h=1.5), State(0.0, 0.0, -0.5, 1.0, 2.0)
INSIDE: tuple[tuple[Scene, State], ...] = (
    (Mushroom(r=1.0, w=0.5, h=1.0), State(0.0, 0.1, 0.3, 0.4, -0.9)),
    (Cap(r=1.0), State(0.0, 0.1, 0.3, 0.4, 0.9)),
    (Stem(w=1.0, h=1.5), State(0.0, 0.1, -0.3, 0.4, -0.9)),
)


def endings(draw: Draw, profile: str) -> Iterator[Question]:
    """Ask for no hits, for some, and for some that another end precedes."""
    for scene, state in INSIDE:
        for n in (0, 1, 2 + draw.pick(range(8))):
            if profile == "trajectory":
                yield scene, state, n, FOREVER, ("collision",) * n
            if profile == "trajectory" or n == 1:
                yield scene, state, n, draw.part() * 2.0**-3, ("horizon",)[:n]
    for scene, state, reason in CORNERS:
        yield scene, state, 3, 10.0, (reason,)
    if profile == "trajectory":
        yield *LATER, 5, FOREVER, ("collision", "corner")
        yield *LATER, 5, 0.5, ("collision", "horizon")


def end_as_due(
    side: Implementation, scene: Scene, state: State, n: int, t_end: float, due: Sequence[str]
) -> bool:
    """Hold the outcomes, or the reasons of those that are undefined, to those that are due."""
    parts = side.parts(question(side.profile, scene, state, t_end, n))
    found = [part["reason"] if part["outcome"] == "undefined" else part["outcome"] for part in parts]
    side.n_asked += 1
    if found[-1:] == ["undecided"] and len(found) <= len(due):
        side.n_undecided += due[-1] in ("collision", "horizon")  # where mathematics has no answer it may be
        return False
    where = f"{n} hits from {state} to {t_end} in {scene}"
    assert found == list(due), f"{where} are answered {found}, must be {list(due)}"
    return True
