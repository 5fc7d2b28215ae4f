"""`mushrooms draw`: a table through its cycle, and what particles do in it; the export of a trajectory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, BinaryIO, NamedTuple

import numpy as np
import typer

import fast
from conformance.audit.runs import scene_named
from conformance.files import write_file
from mushrooms import orbits, output
from mushrooms.simulate import draw_energies
from mushrooms.store.run import is_run, open_run
from mushrooms.terminal import (
    SceneName,
    announce_compilation,
    progress_bar,
    refuse_unheeded,
)
from scene import Scene, Stem
from scene.laws import bounds
from scene.refusal import MAX_SEED, BadInput
from scene.tables import laws


class Usual(NamedTuple):
    """What a picture takes when nothing is asked: particles, crossings of the table a cycle, the end."""

    n_orbits: int
    crossings: float
    n_collisions: int | None
    n_cycles: int | None = None


PICTURES = {
    "trajectory": Usual(1, 60.0, 60),
    "section": Usual(40, 1000.0, 400),
    "map": Usual(40, 1000.0, 400),
    "growth": Usual(500, 1000.0, None, 10),
    "lyapunov": Usual(3, 1000.0, 256),
}
# Slow particles: where the wall moves as fast as they do, chaos and islands lie side by side.
SECTION_OF_STEM, OF_STEM_AT_PHASE = Usual(40, 4.0, 4000), Usual(40, 4.0, None, 400)
SECTION_AT_PHASE = Usual(40, 60.0, None, 60)


Picture = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="A .svg, .png, .pdf or .gif file; default: SCENE.svg. If there are several pictures, the kind "
        "is added to each name.",
    ),
]
Trajectory = Annotated[
    bool, typer.Option("--trajectory", help="Path of one particle; a .gif is an animation.")
]
Section = Annotated[
    bool,
    typer.Option(
        "--section",
        help="Poincare section: place on the arc against sin phi. For a stem: phase of the moving wall "
        "against the velocity after the hit.",
    ),
]
BoundaryMap = Annotated[
    bool, typer.Option("--map", help="Boundary map: place along all walls against the sine of the angle.")
]
Growth = Annotated[
    bool,
    typer.Option(
        "--growth",
        help="Mean and spread of ln(E/E0) against the cycle, with the theory. With --particles 1: ln(E/E0) "
        "against time.",
    ),
]
Lyapunov = Annotated[
    bool, typer.Option("--lyapunov", help="Finite-time Lyapunov exponents with their errors.")
]
Export = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write the start and every collision to a .csv or .parquet file."),
]
Energy = Annotated[
    float | None, typer.Option(min=0, help="Initial energy v²/2, > 0; default: one that suits the picture.")
]
Length = Annotated[int | None, typer.Option(min=1, max=10**6, help="Collisions of each particle, 1 to 10^6.")]
Cycles = Annotated[
    int | None, typer.Option(min=1, max=10**4, help="Cycles to follow, instead of collisions, 1 to 10,000.")
]
Phase = Annotated[
    float | None,
    typer.Option(help="Section at this phase t/T of the walls, 0 to 1. For a stem: y against vy."),
]
Many = Annotated[
    int | None,
    typer.Option(min=1, max=1000, help="Particles in a section, map, growth or exponent plot, 1 to 1000."),
]
Seed = Annotated[
    int | None,
    typer.Option(min=0, max=MAX_SEED, help="Seed of the random starts, 0 to 2^64 - 1; default: 0."),
]
OF_PARTICLES = ("--energy", "--collisions", "--cycles", "--seed", "--particles", "--phase")
OF_MANY = ("section", "map", "growth", "lyapunov")
LEAST_DRAWN = 1e-100  # of lengths and times; its inverse is the greatest


def draw(
    scene: SceneName,
    out: Picture = None,
    trajectory: Trajectory = False,
    section: Section = False,
    boundary_map: BoundaryMap = False,
    growth: Growth = False,
    lyapunov: Lyapunov = False,
    export: Export = None,
    energy: Energy = None,
    collisions: Length = None,
    cycles: Cycles = None,
    particles: Many = None,
    seed: Seed = None,
    phase: Phase = None,
) -> None:
    """Draw the table during its cycle, or paths of particles in it, or export a trajectory.

    Pictures of particles follow the first particles of `mushrooms simulate SCENE --energy E --seed S`. If
    SCENE is the folder of a run (simulate --out), its histogram of ln(E1/E0) is drawn with the theory. If the
    run has several cycles, the mean after each cycle is drawn too.
    """
    asked = (trajectory, section, boundary_map, growth, lyapunov)
    kinds = [kind for kind, is_asked in zip(PICTURES, asked, strict=True) if is_asked]
    given = (energy, collisions, cycles, seed, particles, phase)
    options = dict(zip(OF_PARTICLES, given, strict=True))
    if is_run(Path(scene)):
        pictures = {f"--{kind}": True for kind in kinds}
        refuse_unheeded({**pictures, "--export": export, **options}, f"{scene!r} is a run")
        print(draw_run(Path(scene), out))
        return
    table = scene_named(scene)
    arguments = DrawArgs(table, energy, collisions, cycles, particles, seed or 0, phase)
    arguments.check(kinds)
    if not kinds and export is None:
        refuse_unheeded(options, "the picture of the walls has no particles")
    if export is not None:
        output.check_file(export, (".csv", ".parquet"))
    paths: dict[str, Path] = {}
    if kinds or export is None or out is not None:
        _check_drawable(table)
        paths = _paths(out or Path(f"{Path(scene).stem}.svg"), kinds)
    with announce_compilation():
        if export is not None:
            arguments.follow("trajectory", 1)[0].write(export)
            print(export)
        for kind, path in paths.items():
            write_file(path, _picture(kind, path.suffix, arguments))
            print(path)


class DrawArgs(NamedTuple):
    """What the command line says of the scene and of the particles of every picture."""

    table: Scene
    energy: float | None
    n_collisions: int | None
    n_cycles: int | None
    n_orbits: int | None
    seed: int
    phase: float | None

    def check(self, kinds: list[str]) -> None:
        """Refuse what no picture heeds.

        Raises:
            BadInput: naming the option.
        """
        if not set(kinds) & set(OF_MANY):
            refuse_unheeded({"--particles": self.n_orbits}, f"it is of --{', --'.join(OF_MANY)}")
        if "section" not in kinds:
            refuse_unheeded({"--phase": self.phase}, "it is of --section")
        if kinds == ["growth"] and self.n_orbits != 1:
            refuse_unheeded({"--collisions": self.n_collisions}, "the growth of many goes through --cycles")

    def usual(self, kind: str) -> Usual:
        """Return what a kind of picture takes of this scene when nothing is asked."""
        if kind != "section":
            return PICTURES[kind]
        of_stem = isinstance(self.table, Stem)
        if self.phase is not None:
            return OF_STEM_AT_PHASE if of_stem else SECTION_AT_PHASE
        return SECTION_OF_STEM if of_stem else PICTURES[kind]

    def energy_of(self, kind: str) -> float:
        """Return the initial energy of a kind of picture."""
        return self.energy or orbits.usual_energy(self.table, self.usual(kind).crossings)

    def follow(self, kind: str, n_orbits: int | None = None) -> list[orbits.FollowedOrbit]:
        """Return the orbits for a kind of picture."""
        usual = self.usual(kind)
        n_cycles = self.n_cycles or (None if self.n_collisions else usual.n_cycles)
        n_collisions = self.n_collisions or (None if n_cycles else usual.n_collisions)
        return orbits.follow(
            self.table,
            n_collisions or orbits.MAX_COLLISIONS,
            energy=self.energy_of(kind),
            seed=self.seed,
            n_orbits=n_orbits or self.n_orbits or usual.n_orbits,
            n_cycles=n_cycles,
        )


def draw_run(folder: Path, out: Path | None) -> Path:
    """Draw the energies of a stored run, with theory; return the file's path."""
    path = out or Path(f"{folder.resolve().name}.svg")
    output.check_file(path, (".svg", ".png"))
    run = open_run(folder)
    draw_energies(path, run.spec, run.gains(), run.shape.n_particles)
    return path


def _check_drawable(table: Scene) -> None:
    """Refuse lengths and periods whose squares or sums a figure cannot hold."""
    found = {f"scene.{name}": bounds(law).highest for name, law in laws(table).items() if name != "slope"}
    if table.period:
        found["period"] = table.period
    for name, size in found.items():
        if not LEAST_DRAWN <= size <= 1 / LEAST_DRAWN:
            raise BadInput(f"{name} = {size:.3g}, must be 1e-100 to 1e+100 in a picture")


def _paths(out: Path, kinds: list[str]) -> dict[str, Path]:
    """Return the file of each picture; several get their names into that of the one given.

    Raises:
        BadInput: one of them cannot be written, or does not move and is to be a .gif.
    """
    from mushrooms.figures.table import SUFFIXES  # drawing takes a second to import

    paths = dict.fromkeys(kinds or ["walls"], out)
    if len(kinds) > 1:
        paths = {kind: out.with_stem(f"{out.stem}-{kind}") for kind in kinds}
    for kind, path in paths.items():
        moves = kind in ("walls", "trajectory")
        output.check_file(path, tuple(s for s in SUFFIXES if moves or s != ".gif"))
    return paths


def _picture(kind: str, suffix: str, arguments: DrawArgs) -> Callable[[BinaryIO], object]:
    """Return what writes a picture."""
    from mushrooms.figures import orbits as pictures
    from mushrooms.figures import style
    from mushrooms.figures import table as tables

    if kind == "walls":
        return lambda file: tables.write_picture(arguments.table, suffix, file)
    if kind == "growth" and arguments.n_orbits != 1:
        figure = _growth(arguments)
        return lambda file: style.save(figure, file, suffix)
    found = arguments.follow(kind, 1 if kind in ("trajectory", "growth") else None)
    if kind == "trajectory" and suffix == ".gif":
        return lambda file: pictures.write_animation(found[0], file)
    if kind == "trajectory":
        figure = pictures.trajectory(found[0])
    elif kind == "growth":
        figure = pictures.energy_in_time(found[0])
    elif kind == "lyapunov":
        with progress_bar() as bar:
            task = bar.add_task("Jacobians", total=sum(len(orbit.walls) for orbit in found))
            figure = pictures.exponents(found, lambda n: bar.update(task, completed=n))
    elif kind == "section":
        figure = pictures.section(found, arguments.phase)
    else:
        figure = pictures.collision_map(found)
    return lambda file: style.save(figure, file, suffix)


def _growth(arguments: DrawArgs) -> Any:
    """Return the figure of an ensemble's energies from cycle to cycle."""
    from mushrooms.figures import energies

    usual, energy = PICTURES["growth"], arguments.energy_of("growth")
    n, n_cycles = arguments.n_orbits or usual.n_orbits, arguments.n_cycles or usual.n_cycles or 1
    found = fast.simulate(
        arguments.table, n_particles=n, energy=energy, n_cycles=n_cycles, seed=arguments.seed
    )
    gains = np.log(found.cycle_energies[found.takes_part()] / energy)
    return energies.growth(arguments.table, energy, gains, n)
