"""What pages say in numbers is what the code says that knows them."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import pytest
from mpmath import fp

import fast
import theory
from conformance.cases.generated import ROUND
from conformance.cases.table import FAMILIES
from conformance.mutants import MUTANTS
from conformance.suite.checks.flows import MAX_STATES
from conformance.suite.checks.paths import MAX_HITS, MAX_WAIT
from conformance.suite.checks.requests import MOST_SAMPLES
from fast.kernel.follow import LANE_ROWS
from fast.validation import MAX_CYCLES, MOST_IN_CYCLES, MOST_TO_A_TIME
from mushrooms.commands import MOST_ON_DISK
from mushrooms.orbits import MAX_COLLISIONS, MAX_ORBITS
from mushrooms.simulate import MOST_IN_MEMORY
from mushrooms.store import conduct
from mushrooms.store.spec import FIELDS, RunSpec, Shape, shape_of
from reference.arithmetic import MAX_WORK
from scene import from_data, load
from scene.laws import MAX_HARMONICS, MAX_KNOTS, value
from theory.distribution import loss_probability

ROOT = Path(__file__).parent.parent
BENCH = json.loads((ROOT / "docs" / "bench" / "bench.json").read_bytes())


def sentence_of_the_knots() -> str:
    """Evaluate the bang-bang law of docs/scenes.md at a quarter of its first leg."""
    page = (ROOT / "docs" / "scenes.md").read_text("utf-8")
    r = from_data(tomllib.loads(page.split("```toml bang-bang.toml")[1].split("```")[0])).r
    (start, first), (end, second) = r.knots[:2]
    linear = (3 * first + second) / 4
    return f"at {(t := start + (end - start) / 4)} the value is {value(fp, r, t)}, not {linear}"


def row_of_losses(name: str, label: str) -> str:
    """Return the row of theory/equations.md for P(E_n < E_0) of a scene."""
    energies = theory.energies(load(name))
    numbers = [loss_probability(energies, n) for n in (1, 10, 30, 100)]
    return f"| {label} | {' | '.join(f'{number:.4f}'[1:] for number in numbers)} |"


def lines_of_growth() -> str:
    all_kept = BENCH["growth"]["collisions"]
    lasts = BENCH["growth"]["lasts"].items()
    return " ".join(f"- {name}: {'over ' * (n >= all_kept)}{n:.0f}" for name, n in lasts)


def size_of_the_audit() -> str:
    n_bytes = 0
    for made in json.loads((ROOT / "docs" / "audit" / "report.json").read_bytes())["runs"]:
        spec = RunSpec(
            from_data(made["scene"]), *(made[x] for x in ("energy", "cycles", "seed")), tuple(made["phases"])
        )
        block = conduct.block_of_new(spec, made["particles"], threads=2)
        shape = shape_of(spec, made["particles"], block)
        n_bytes += -(-made["particles"] // block) * block * shape.bytes_of_a_particle
    return f"{n_bytes / 1e9:.1f} GB for a full audit"


def words_of_whole_arrays() -> str:
    whole = [f"`{name}`" for name, field in FIELDS.items() if field.kind.startswith("int")]
    return f"-1 in arrays of whole numbers ({', '.join(sorted(whole))})"


BYTES = Shape(1, 1, 1, 1, 0, 1).bytes_of_a_particle
NS = {p["solver"]: median(p["ns"]) for p in BENCH["points"] if p["workload"] == "moving-cap-1e7"}
TEN = {10**k: f"10^{k}" for k in range(12)}
# What a page says of numbers that code knows: the page, and what must stand in it, its spaces as one.
FIGURES: dict[str, tuple[str, Callable[[], str]]] = {
    "bang-bang law": ("docs/scenes.md", sentence_of_the_knots),
    "mutants": ("README.md", lambda: f"{len(MUTANTS)} deliberately broken steppers"),
    "attacks": ("CHANGELOG.md", lambda: f"{len(FAMILIES)} families of seeded questions"),
    "harmonics": ("docs/scenes.md", lambda: f"Up to {MAX_HARMONICS} each"),
    "knots": ("docs/scenes.md", lambda: f"Up to {MAX_KNOTS} knots"),
    "laws": (
        "docs/limits.md",
        lambda: f"{MAX_HARMONICS} harmonics, or a bang-bang law of at most {MAX_KNOTS} ",
    ),
    "particles": (
        "docs/limits.md",
        lambda: f"| {TEN[MOST_IN_MEMORY]} in memory, {TEN[MOST_ON_DISK]} with `--out` |",
    ),
    "cycles": ("docs/limits.md", lambda: f"| cycles of a run | {TEN[MAX_CYCLES]} |"),
    "collisions": (
        "docs/limits.md",
        lambda: f"| {TEN[MOST_IN_CYCLES]} in a run; {TEN[MOST_TO_A_TIME]} in `fast.flow`",
    ),
    "orbits": ("docs/limits.md", lambda: f"| {MAX_ORBITS}, with {TEN[MAX_COLLISIONS]} collisions each |"),
    "times": ("README.md", lambda: f"| {NS['fast, lanes']:.0f} ns |"),
    "times of others": ("README.md", lambda: f"| {NS['lean C']:.0f} ns |"),
    "time of a call": ("README.md", lambda: f"| {NS['fast, a call'] / 1e3:.1f} µs |"),
    "time of a proof": ("README.md", lambda: f"| {NS['proof, 50 digits'] / 1e6:.1f} ms |"),
    "fresh questions": (
        "docs/protocol.md",
        lambda: f"{ROUND} questions ({2 * ROUND} above core)",
    ),
    "legs": ("docs/protocol.md", lambda: f"up to {MAX_KNOTS - 1} legs"),
    "bounds of hits": ("docs/detection.md", lambda: f"hits of a path | 2 | 2^{MAX_HITS.bit_length() - 1}"),
    "bounds of states": (
        "docs/detection.md",
        lambda: f"of a flow | 1 | 2^{MAX_STATES.bit_length() - 1}",
    ),
    "bounds of waits": ("docs/detection.md", lambda: f"one flight | 1 | 2^{MAX_WAIT.bit_length() - 1}"),
    "share of the period": ("docs/detection.md", lambda: f"is broken | 1/{MOST_SAMPLES} | 1/4"),
    "work of a step": ("docs/proof.md", lambda: f"the limit is {MAX_WORK:,.0f} of them"),
    "lane": ("docs/ensembles.md", lambda: f"{LANE_ROWS} numbers, the array `lanes`, {8 * LANE_ROWS} bytes"),
    "room": ("docs/ensembles.md", lambda: f"{BYTES} bytes a particle for one cycle with one narrowing"),
    "audit": ("docs/audit.md", size_of_the_audit),
    "blocks": ("docs/ensembles.md", lambda: f"by default {conduct.LEAST_BLOCK} to {conduct.MOST_BLOCK},"),
    "fill values": ("docs/ensembles.md", words_of_whole_arrays),
    **{f"fast.{name}": ("docs/api/fast.md", partial("fast.{} ".format, name)) for name in fast.__all__},
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
