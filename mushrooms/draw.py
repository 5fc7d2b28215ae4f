"""`mushrooms draw`: a table through its cycle, and what particles do in it.

The export of a trajectory.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from matplotlib.figure import Figure

import fast
from mushrooms import orbits
from mushrooms.figures import energies, orbits as pictures, style, table as tables
from mushrooms.folders import check_file
from mushrooms.progress import Watch, announce_compilation, progress_bar
from mushrooms.simulate import draw_energies
from mushrooms.store.run import is_run, open_run
from scene import BadInput, Scene, Stem
from scene.files.tables import SUFFIXES
from scene.files.writer import write_file
from scene.named import is_scene, scene_named
from scene.refusal import refuse_unheeded


class Usual(NamedTuple):
    """What a picture takes if nothing is asked: particles, crossings in a cycle, the end."""

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
SECTION_OF_STEM = Usual(40, 4.0, 4000)
OF_STEM_AT_PHASE = Usual(40, 4.0, None, 400)
SECTION_AT_PHASE = Usual(40, 60.0, None, 60)
OF_MANY = ("section", "map", "growth", "lyapunov")
LEAST_DRAWN = 1e-100  # of lengths and times; its inverse is the greatest


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawOptions:
    """The options of `mushrooms draw`; None is what the command line does not say.

    Attributes:
        scene: a name, a file, or the folder of a run.
        out: file of the picture; several get their kinds into its name.
        trajectory, section, boundary_map, growth, lyapunov: the pictures that are asked for.
        export: file for a trajectory.
        energy, collisions, cycles, particles, seed: of the particles of every picture.
        phase: of a section.
    """

    scene: str
    out: Path | None
    trajectory: bool
    section: bool
    boundary_map: bool
    growth: bool
    lyapunov: bool
    export: Path | None
    energy: float | None
    collisions: int | None
    cycles: int | None
    particles: int | None
    seed: int | None
    phase: float | None

    def kinds(self) -> list[str]:
        """Return the kinds of pictures of particles that are asked for."""
        asked = {
            "trajectory": self.trajectory,
            "section": self.section,
            "map": self.boundary_map,
            "growth": self.growth,
            "lyapunov": self.lyapunov,
        }
        return [kind for kind, is_asked in asked.items() if is_asked]

    def of_particles(self) -> dict[str, object]:
        """Return what is said of the particles, by the names of the options."""
        names = ("energy", "collisions", "cycles", "particles", "seed", "phase")
        return {f"--{name}": getattr(self, name) for name in names}

    def follow(
        self, scene: Scene, kind: str, n_orbits: int | None = None
    ) -> list[orbits.FollowedOrbit]:
        """Return the orbits for a kind of picture."""
        usual = usual_of(kind, scene, self.phase)
        n_cycles = self.cycles or (None if self.collisions else usual.n_cycles)
        n_collisions = self.collisions or (None if n_cycles else usual.n_collisions)
        n = n_orbits or self.particles or usual.n_orbits
        with progress_bar() as bar:
            return orbits.follow(
                scene,
                n_collisions or orbits.MAX_COLLISIONS,
                energy=self.energy or orbits.usual_energy(scene, usual.crossings),
                seed=self.seed or 0,
                n_orbits=n,
                n_cycles=n_cycles,
                progress=partial(Watch(bar, "particles", "particles").update, n_total=n),
            )


def usual_of(kind: str, scene: Scene, phase: float | None) -> Usual:
    """Return what a kind of picture takes of a scene when nothing is asked."""
    if kind == "section" and isinstance(scene, Stem):
        return SECTION_OF_STEM if phase is None else OF_STEM_AT_PHASE
    return PICTURES[kind] if kind != "section" or phase is None else SECTION_AT_PHASE


def draw_scene(options: DrawOptions) -> None:
    """Draw pictures of a scene, or of a stored run, and export a trajectory.

    Print the names of the files.
    """
    name = options.scene
    out = options.out
    export = options.export
    kinds = options.kinds()
    if is_run(Path(name)) or (Path(name).is_dir() and not is_scene(name)):
        asked = {f"--{kind}": True for kind in kinds} | {"--export": export}
        refuse_unheeded(asked | options.of_particles(), f"{name!r} is a run")
        _draw_run(Path(name), out)
        return
    scene = scene_named(name)
    _check_heeded(options)
    check_file(export, SUFFIXES)
    is_drawn = kinds or export is None or out is not None
    paths = _paths(scene, out or Path(f"{Path(name).stem}.svg"), kinds) if is_drawn else {}
    with announce_compilation():
        if export is not None:
            options.follow(scene, "trajectory", 1)[0].write(export)
            print(export)
        for kind, path in paths.items():
            write_file(path, partial(_draw, kind, path.suffix, scene, options))
            print(path)


def _check_heeded(options: DrawOptions) -> None:
    """Refuse options that no picture heeds."""
    kinds = options.kinds()
    if not set(kinds) & set(OF_MANY):
        refuse_unheeded({"--particles": options.particles}, f"it is of --{', --'.join(OF_MANY)}")
    if "section" not in kinds:
        refuse_unheeded({"--phase": options.phase}, "it is of --section")
    if kinds == ["growth"] and options.particles != 1:
        refuse_unheeded(
            {"--collisions": options.collisions}, "the growth of many goes through --cycles"
        )
    if not kinds and options.export is None:
        refuse_unheeded(options.of_particles(), "the picture of the walls has no particles")


def _draw_run(folder: Path, out: Path | None) -> None:
    """Draw the energies of a stored run, with theory, and print the file's name."""
    path = out or Path(f"{folder.resolve().name}.svg")
    check_file(path, (".svg", ".png"))
    run = open_run(folder)
    draw_energies(path, run.spec, run.gains(), run.shape.n_particles)
    print(path)


def _paths(scene: Scene, out: Path, kinds: list[str]) -> dict[str, Path]:
    """Return the file of each picture; several get their names into that of the one given.

    Raises:
        BadInput: one of them cannot be drawn, or not written, or does not move and is to be a .gif.
    """
    found = {
        f"scene.{name}": law.bounds().highest for name, law in scene.laws.items() if name != "slope"
    }
    found |= {"period": scene.period} if scene.period else {}
    for name, size in found.items():  # squares and sums of them are in a figure
        if not LEAST_DRAWN <= size <= 1 / LEAST_DRAWN:
            raise BadInput(f"{name} = {size:.3g}, must be 1e-100 to 1e+100 in a picture")
    paths = dict.fromkeys(kinds or ["walls"], out)
    if len(kinds) > 1:
        paths = {kind: out.with_stem(f"{out.stem}-{kind}") for kind in kinds}
    for kind, path in paths.items():
        moves = kind in ("walls", "trajectory")
        check_file(path, tables.SUFFIXES if moves else tables.SUFFIXES[:-1])
    return paths


def _draw(kind: str, suffix: str, scene: Scene, options: DrawOptions, file: BinaryIO) -> None:
    """Draw one kind of picture into an open file."""
    if kind == "walls":
        with progress_bar() as bar:
            tables.write_picture(scene, suffix, file, Watch(bar, "GIF", "frames").update)
    elif kind == "trajectory" and suffix == ".gif":
        [orbit] = options.follow(scene, kind, 1)
        with progress_bar() as bar:
            pictures.write_animation(orbit, file, progress=Watch(bar, "GIF", "frames").update)
    elif kind == "growth" and options.particles != 1:
        style.save(_growth(scene, options), file, suffix)
    else:
        style.save(_figure(kind, scene, options), file, suffix)


def _figure(kind: str, scene: Scene, options: DrawOptions) -> Figure:
    """Return a picture of the paths of particles."""
    found = options.follow(scene, kind, 1 if kind in ("trajectory", "growth") else None)
    match kind:
        case "trajectory":
            return pictures.trajectory(found[0])
        case "growth":
            return pictures.energy_in_time(found[0])
        case "section":
            return pictures.section(found, options.phase)
        case "map":
            return pictures.collision_map(found)
    with progress_bar() as bar:
        task = bar.add_task("Jacobians", total=sum(len(orbit.walls) for orbit in found))
        return pictures.exponents(found, lambda n: bar.update(task, completed=n))


def _growth(scene: Scene, options: DrawOptions) -> Figure:
    """Return the figure of an ensemble's energies from cycle to cycle."""
    usual = PICTURES["growth"]
    energy = options.energy or orbits.usual_energy(scene, usual.crossings)
    n = options.particles or usual.n_orbits
    n_cycles = options.cycles or usual.n_cycles or 1
    with progress_bar() as bar:
        found = fast.simulate(
            scene,
            n_particles=n,
            energy=energy,
            n_cycles=n_cycles,
            seed=options.seed or 0,
            progress=partial(Watch(bar, "particles", "particles").update, n_total=n),
        )
    gains = np.log(found.cycle_energies[found.takes_part()] / energy)
    return energies.growth(scene, energy, gains, n)
