"""`mushrooms scenes` and `theory`: the catalogue, a scene as a file, theory for one cycle."""

import json
import math
import sys
from dataclasses import dataclass
from typing import Any

from rich.table import Column, Table

import scene as scenes
import theory
from mushrooms.output import new_console, print_pairs, print_table
from mushrooms.progress import progress_bar
from mushrooms.store.summary import expected_collisions
from scene import BadInput, Scene
from scene.load import catalogue_text, read_data
from scene.named import SCENES, scene_named


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenesOptions:
    """The options of `mushrooms scenes`.

    Attributes:
        name: of a scene; empty for all of the catalogue.
        as_toml: print it as a scene file.
        as_json: print JSON.
    """

    name: str
    as_toml: bool
    as_json: bool


def print_scenes(options: ScenesOptions) -> None:
    """Print the catalogue, or one scene of it or of the audit."""
    name = options.name
    if options.as_toml and options.as_json:
        raise BadInput("--toml and --json: must be one of them")
    if options.as_toml and not name:
        raise BadInput(f"--toml needs NAME, one of {', '.join(scenes.catalogue())}")
    if name:
        print(_one_scene(name, options.as_json))
        return
    rows = [_catalogue_row(each) for each in scenes.catalogue()]
    if options.as_json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    table = Table(Column("name", no_wrap=True), "table", "period", "notes", title="Catalogue")
    for row in rows:
        table.add_row(row["name"], row["table"], *_period_and_notes(row))
    print_table(new_console(), table)


def _one_scene(name: str, as_json: bool) -> str:
    """Return a scene of the catalogue or of the audit as TOML or JSON."""
    of_audit = scenes.to_data(SCENES[name]) if name in SCENES else None
    if as_json:
        return json.dumps(of_audit or read_data(name), indent=2, ensure_ascii=False)
    return (_toml(of_audit) if of_audit else catalogue_text(name)).rstrip("\n")


def _period_and_notes(row: dict[str, Any]) -> tuple[str, str]:
    """Return what the table of the catalogue has in its last columns."""
    if row["refused"]:
        return "refused", f"Refused: {row['refused']}"
    length = "static" if row["period"] is None else f"{row['period']:.6g}"
    return length, row["notes"]


def _toml(data: dict[str, Any]) -> str:
    """Return a scene as TOML: a line for each field, a law in one of them."""

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{name} = {text(part)}" for name, part in value.items()) + " }"
        return json.dumps(value)  # of numbers, lists and plain strings TOML says the same

    return "\n".join(f"{name} = {text(value)}" for name, value in data.items())


def _catalogue_row(name: str) -> dict[str, Any]:
    data = read_data(name)
    row = {"name": name, "table": data["table"], "period": None, "notes": data.get("notes", "")}
    try:
        return row | {"period": scenes.load(name).period or None, "refused": None}
    except scenes.InvalidScene as error:
        return row | {"refused": str(error).partition(": ")[2]}


# s = log E1/E0 over one cycle.
FIGURES = {
    "p_nc": "probability of never being captured in a cycle (eq. ps)",
    "m1": "mean of s = log E1/E0 over a cycle (eq. Erate)",
    "log_e_nc": "s of particles never captured (eq. lnEnc/E0)",
    "sd": "standard deviation of s",
    "mean_exp_minus": "mean of E0/E1; 1 for every cycle, because phase volume is constant",
    "mean_exp_plus": "mean of E1/E0: growth factor of the mean energy",
    "energy": "initial energy v²/2 of the figures below",
    "v": "initial speed at this energy",
    "collisions": "approximate mean number of collisions in a cycle",
    "p_nc_at": "p_nc at this energy: lags change the probability of capture",
    "m1_at": "m1 at this energy: diffusion and lags change it",
    "sd_at": "standard deviation of s at this energy",
    "peak_at": "mean s of particles never captured, at this energy",
    "peak_width_at": "standard deviation of s of particles never captured, roughly as E0^(-1/4)",
    "captured_at": "mean s of captured particles at this energy; - if there are none",
    "p_nc_error": "possible error of p_nc_at",
    "m1_error": "possible error of m1_at",
    "peak_error": "possible error of peak_at",
    "peak_width_error": "possible error of peak_width_at",
    "is_in_reach": "false if the variance may be wrong by half or more: the energy is too low",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TheoryOptions:
    """The options of `mushrooms theory`.

    Attributes:
        scene: a name or a file.
        digits: correct digits.
        energy: initial energy to predict for, too; None for none.
        as_json: print JSON.
    """

    scene: str
    digits: int
    energy: float | None
    as_json: bool


def print_prediction(options: TheoryOptions) -> None:
    """Print what the theory predicts for one cycle, and at an energy if one is given."""
    found = scene_named(options.scene)
    with progress_bar() as bar:
        task = bar.add_task("resolution 1 of two or more", total=100)

        def advance(number: int, share: float) -> None:
            bar.update(
                task,
                completed=round(100 * share),
                description=f"resolution {number} of two or more",
            )

        predicted = theory.predict(found, options.digits, progress=advance)
    pairs: dict[str, Any] = dict(predicted.strings(options.digits))
    if options.energy is not None:
        pairs |= _at_energy(found, options.energy)
    print_pairs(pairs, options.as_json, FIGURES)


def _at_energy(scene: Scene, energy: float) -> dict[str, float | bool | None]:
    """Return the figures of one cycle at an initial energy.

    Where there are none, say why on stderr.
    """
    speed = math.sqrt(2 * energy)
    n_collisions = expected_collisions(scene, energy, 1)
    first: dict[str, float | bool | None] = {
        "energy": energy,
        "v": float(f"{speed:.7g}"),
        "collisions": float(f"{n_collisions:.3g}") if math.isfinite(n_collisions) else None,
    }
    try:
        found = theory.at_energy(scene, energy)
    except theory.NotCovered as reason:
        print(f"{reason}. What is printed is the limit of high energies", file=sys.stderr)
        return first
    peak, variance = found.peak
    left = found.theory_error
    figures = {
        "p_nc_at": found.p_nc,
        "m1_at": found.mean_s,
        "sd_at": found.variance_s**0.5,
        "peak_at": peak,
        "peak_width_at": variance**0.5,
        "captured_at": found.captured_mean if found.p_nc < 1 else None,
        "p_nc_error": left.p_nc,
        "m1_error": left.mean_s,
        "peak_error": left.peak_mean,
        "peak_width_error": variance**0.5 * left.variance / 2,
    }
    digits = {name: 2 if name.endswith("_error") else 7 for name in figures}
    rounded = {
        name: x if x is None else float(f"{x:.{digits[name]}g}") for name, x in figures.items()
    }
    return {**first, **rounded, "is_in_reach": left.variance < 0.5}
