"""What pages say in numbers is what the code says that knows them."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from mpmath import fp

import theory
from conformance.attacks import FAMILIES
from conformance.generator.fresh import USUAL
from conformance.generator.seldom import EXTRA
from conformance.mutants import MUTANTS
from conformance.suite import run
from conformance.suite.disguise import N_DRAWN
from conformance.suite.promises import conserved, crowds, refusals, scenes
from fast.kernel.kept import LANE_ROWS
from mushrooms.store import conduct, layout
from mushrooms.store.asked import Asked
from reference.arithmetic import MAX_WORK
from scene import from_data, load
from scene.given import MAX_HARMONICS, MAX_KNOTS
from scene.laws import value
from theory.large_deviations import loss_probability

ROOT = Path(__file__).parent.parent
BENCH = json.loads((ROOT / "docs" / "bench" / "bench.json").read_bytes())


def sentence_of_the_knots() -> str:
    """Evaluate the bang-bang law of docs/start.md between its first knots."""
    page = (ROOT / "docs" / "start.md").read_text("utf-8")
    r = from_data(tomllib.loads(page.split("```toml knots.toml")[1].split("```")[0])).r
    (_, first), (_, second) = r.knots[:2]
    return f"at 0.25 the value is {value(fp, r, 0.25)}, not {first + (second - first) / 4}"


def row_of_losses(name: str, label: str) -> str:
    """Return the row of theory/equations.md for P(E_n < E_0) of a scene."""
    energies = theory.energies(load(name))
    numbers = [loss_probability(energies, n) for n in (1, 10, 30, 100)]
    return f"| {label} | {' | '.join(f'{number:.4f}'[1:] for number in numbers)} |"


def sentence_of_bad_states() -> str:
    asked = [state for scene, t in refusals.tables() for state in refusals.states(scene, t)]
    return f"{sum(bool(state.why) for state in asked)} states that must be refused"


def sentence_of_bad_scenes() -> str:
    judged = [*scenes.broken_at_times(), *scenes.broken_as_written(), *scenes.valid_though_near()]
    n_bad = sum(bool(scene.why) for scene in judged)
    return (
        f"{n_bad} scenes that must be refused, most of them broken for a fiftieth of the period only, by 2^-9"
        f" of a size, at another time than is asked about; and {len(judged) - n_bad} as near"
    )


def lines_of_growth() -> str:
    all_kept = BENCH["growth"]["collisions"]
    lasts = BENCH["growth"]["lasts"].items()
    return " ".join(f"- {name}: {'over ' * (n >= all_kept)}{n:.0f}" for name, n in lasts)


def size_of_the_audit() -> str:
    n_bytes = 0
    for made in json.loads((ROOT / "docs" / "audit" / "report.json").read_bytes())["runs"]:
        asked = Asked(
            from_data(made["scene"]), *(made[x] for x in ("energy", "cycles", "seed")), tuple(made["phases"])
        )
        block = conduct.block_of_new(asked, made["particles"], threads=2)
        shape = conduct.shape_of(asked, made["particles"], block)
        n_bytes += -(-made["particles"] // block) * block * shape.bytes_of_a_particle
    return f"{n_bytes / 1e9:.1f} GB for a full audit"


def words_of_whole_arrays() -> str:
    whole = [f"`{name}`" for name, field in layout.FIELDS.items() if field.kind.startswith("int")]
    return f"-1 in arrays of whole numbers ({', '.join(sorted(whole))})"


N_FRESH = USUAL + len(EXTRA)  # `suite.run.N_FRESH` is less in tests
BYTES = layout.Shape(1, 1, 1, 1, 0, 1).bytes_of_a_particle
# What a page says of numbers that code knows: the page, and what must stand in it, its spaces as one.
FIGURES: dict[str, tuple[str, Callable[[], str]]] = {
    "bang-bang law": ("docs/start.md", sentence_of_the_knots),
    "mutants": ("README.md", lambda: f"{len(MUTANTS)} faulty steppers"),
    "attacks": ("CHANGELOG.md", lambda: f"{len(FAMILIES)} families of seeded questions"),
    "harmonics": ("docs/scenes.md", lambda: f"Up to {MAX_HARMONICS} each"),
    "drawn questions": ("docs/verdict.md", lambda: f"{N_DRAWN} drawn questions"),
    "fresh questions": (
        "docs/verdict.md",
        lambda: f"{N_FRESH} questions ({2 * N_FRESH} above core)",
    ),
    "legs": ("docs/verdict.md", lambda: f"up to {MAX_KNOTS - 1} legs"),
    "drawn states": ("docs/verdict.md", lambda: f"on {run.N_STATES} drawn states"),
    "bad states": ("docs/verdict.md", sentence_of_bad_states),
    "bad scenes": ("docs/verdict.md", sentence_of_bad_scenes),
    "long flow": ("docs/verdict.md", lambda: f"a flow of {crowds.N_HITS} hits"),
    "hits at rest": ("docs/verdict.md", lambda: f"a path of {conserved.N_HITS} hits"),
    "work of a step": ("docs/proof.md", lambda: f"{MAX_WORK:,.0f} of a parabola's"),
    "lane": ("docs/ensembles.md", lambda: f"{LANE_ROWS} numbers, the array `lane`, {8 * LANE_ROWS} bytes"),
    "room": ("docs/ensembles.md", lambda: f"{BYTES} bytes a particle for one cycle with one narrowing"),
    "audit": ("docs/audit.md", size_of_the_audit),
    "chunks": ("docs/ensembles.md", lambda: f"{conduct.MOST_CHUNKS} times as many"),
    "blocks": ("docs/ensembles.md", lambda: f"by default {conduct.LEAST_BLOCK} to {conduct.MOST_BLOCK},"),
    "fill values": ("docs/ensembles.md", words_of_whole_arrays),
    "growth": ("docs/speed.md", lines_of_growth),
    **{
        name: ("theory/equations.md", partial(row_of_losses, name, label))
        for name, label in {
            "moving-cap": "moving cap",
            "moving-cap-reversed": "moving cap reversed",
            "fixed-cap-anticlockwise": "fixed cap, anticlockwise",
            "fixed-cap-clockwise": "fixed cap, clockwise",
        }.items()
    },
}


@pytest.mark.parametrize("name", FIGURES)
def test_a_number_on_a_page_is_what_the_code_says(name):
    page, said = FIGURES[name]
    assert said() in " ".join((ROOT / page).read_text("utf-8").split())
