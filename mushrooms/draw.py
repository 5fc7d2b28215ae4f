"""`mushrooms draw`: a table through its cycle, and what particles do in it; the export of a trajectory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, BinaryIO, NamedTuple

import typer

from mushrooms import output
from mushrooms.stored import draw_run
from mushrooms.terminal import (
    SceneName,
    check_energy,
    check_range,
    compilation_told,
    load_scene,
    progress_bar,
    refuse_unheeded,
)
from scene import Scene
from scene.files import write_file
from scene.refusal import BadInput, check_seed


class Usual(NamedTuple):
    """What a picture takes when nothing is asked: collisions, particles, crossings of the table a cycle."""

    n_collisions: int
    n_orbits: int
    crossings: float


PICTURES = {
    "trajectory": Usual(60, 1, 60.0),
    "section": Usual(400, 40, 1000.0),
    "map": Usual(400, 40, 1000.0),
    "growth": Usual(12_000, 1, 1000.0),
    "lyapunov": Usual(256, 3, 1000.0),
}


Picture = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="A .svg, .png, .pdf or .gif file; SCENE's name with .svg by default. Of several pictures each "
        "gets its kind into the name.",
    ),
]
Export = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="A .csv or .parquet file for the start and every collision."),
]
Energy = Annotated[
    float | None, typer.Option(help="Initial energy v²/2, > 0; by default one that suits the picture.")
]
Length = Annotated[int | None, typer.Option(help="Collisions of each particle, 1 to 10^6.")]
Many = Annotated[int | None, typer.Option(help="Particles of a section, a map, exponents; 1 to 1000.")]
Seed = Annotated[int | None, typer.Option(help="Seed of the random starts, 0 to 2^64 - 1; by default 0.")]
OF_PARTICLES = ("--energy", "--collisions", "--seed", "--particles")
OF_MANY = ("section", "map", "lyapunov")
LEAST_DRAWN = 1e-100  # of lengths and times; its inverse is the greatest


def draw(
    scene: SceneName,
    out: Picture = None,
    trajectory: Annotated[
        bool, typer.Option("--trajectory", help="One particle's path; a .gif shows it on its way.")
    ] = False,
    section: Annotated[
        bool, typer.Option("--section", help="Poincare section: place on the arc against sin phi.")
    ] = False,
    boundary_map: Annotated[
        bool, typer.Option("--map", help="Boundary map: place along all walls against the angle's sine.")
    ] = False,
    growth: Annotated[bool, typer.Option("--growth", help="log E against time, with theory's line.")] = False,
    lyapunov: Annotated[
        bool, typer.Option("--lyapunov", help="Finite-time Lyapunov exponents with their errors.")
    ] = False,
    export: Export = None,
    energy: Energy = None,
    collisions: Length = None,
    particles: Many = None,
    seed: Seed = None,
) -> None:
    """Draw the walls through the cycle, or what particles do between them; export a trajectory.

    The particles are the first of `mushrooms simulate SCENE --energy E --seed S`. Given the folder of a run
    (simulate --out), draw its histogram of log E1/E0, with theory.
    """
    from mushrooms.store.blocks import is_run

    asked = (trajectory, section, boundary_map, growth, lyapunov)
    kinds = [kind for kind, is_asked in zip(PICTURES, asked, strict=True) if is_asked]
    options = dict(zip(OF_PARTICLES, (energy, collisions, seed, particles), strict=True))
    if is_run(Path(scene)):
        pictures = {f"--{kind}": True for kind in kinds}
        refuse_unheeded({**pictures, "--export": export, **options}, f"{scene!r} is a run")
        print(draw_run(Path(scene), out))
        return
    table = load_scene(scene)
    _check(energy, collisions, particles, seed)
    if not kinds and export is None:
        refuse_unheeded(options, "the picture of the walls has no particles")
    if not set(kinds) & set(OF_MANY):
        refuse_unheeded({"--particles": particles}, f"it is of --{', --'.join(OF_MANY)}")
    if export is not None:
        output.check_file(export, (".csv", ".parquet"))
    is_drawn = bool(kinds) or export is None or out is not None
    if is_drawn:
        _check_drawable(table)
    paths = _paths(out or Path(f"{Path(scene).stem}.svg"), kinds, is_drawn=is_drawn)
    follow = _Asked(table, energy, collisions, particles, seed or 0)
    with compilation_told():
        if export is not None:
            follow("trajectory", 1)[0].write(export)
            print(export)
        for kind, path in paths.items():
            write_file(path, _picture(table, kind, path.suffix, follow))
            print(path)


class _Asked(NamedTuple):
    """What was asked of the orbits of every picture."""

    table: Scene
    energy: float | None
    n_collisions: int | None
    n_orbits: int | None
    seed: int

    def __call__(self, kind: str, n_orbits: int | None = None) -> list[Any]:
        """Return the orbits for a kind of picture."""
        from mushrooms import orbits

        usual = PICTURES[kind]
        return orbits.follow(
            self.table,
            self.n_collisions or usual.n_collisions,
            energy=self.energy or orbits.usual_energy(self.table, usual.crossings),
            seed=self.seed,
            n_orbits=n_orbits or self.n_orbits or usual.n_orbits,
        )


def _check_drawable(table: Scene) -> None:
    """Refuse lengths and periods whose squares or sums a figure cannot hold."""
    from mpmath import fp

    from scene.laws import bounds
    from scene.tables import laws, period

    shared = period(table)
    found = {f"scene.{name}": bounds(law).highest for name, law in laws(table).items() if name != "slope"}
    if shared is not None:
        found["period"] = float(shared.value(fp))
    for name, size in found.items():
        if not LEAST_DRAWN <= size <= 1 / LEAST_DRAWN:
            raise BadInput(f"{name} = {size:.3g}, must be 1e-100 to 1e+100 in a picture")


def _check(energy: float | None, collisions: int | None, particles: int | None, seed: int | None) -> None:
    check_energy(energy)
    if collisions is not None:
        check_range("--collisions", collisions, 1, 10**6)
    if particles is not None:
        check_range("--particles", particles, 1, 1000)
    if seed is not None:
        check_seed(seed, "--seed")


def _paths(out: Path, kinds: list[str], *, is_drawn: bool) -> dict[str, Path]:
    """Return the file of each picture; several get their names into that of the one given.

    Raises:
        BadInput: one of them cannot be written, or does not move and is to be a .gif.
    """
    from mushrooms.figures import table as pictures

    if not is_drawn:
        return {}
    paths = dict.fromkeys(kinds or ["walls"], out)
    if len(kinds) > 1:
        paths = {kind: out.with_stem(f"{out.stem}-{kind}") for kind in kinds}
    for kind, path in paths.items():
        moves = kind in ("walls", "trajectory")
        output.check_file(path, tuple(s for s in pictures.SUFFIXES if moves or s != ".gif"))
    return paths


def _picture(table: Scene, kind: str, suffix: str, follow: _Asked) -> bytes | Callable[[BinaryIO], object]:
    from mushrooms.figures import orbits, style
    from mushrooms.figures import table as pictures

    if kind == "walls":
        return lambda file: pictures.write_picture(table, suffix, file)
    found = follow(kind, 1 if kind in ("trajectory", "growth") else None)
    if kind == "trajectory" and suffix == ".gif":
        return lambda file: orbits.write_animation(found[0], file)
    if kind == "trajectory":
        figure = orbits.trajectory(found[0])
    elif kind == "growth":
        figure = orbits.energy_in_time(found[0])
    elif kind == "lyapunov":
        with progress_bar() as bar:
            task = bar.add_task("Jacobians", total=sum(len(orbit.walls) for orbit in found))
            figure = orbits.exponents(found, lambda n: bar.update(task, completed=n))
    else:
        figure = orbits.section(found) if kind == "section" else orbits.collision_map(found)
    return lambda file: style.save(figure, file, suffix)
