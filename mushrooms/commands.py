"""The commands: their options and their help.

This module imports typer and the standard library alone. The body of each command makes one record
of its options and hands it to the function that does the work. It imports both, so no `--help`
waits for numba or matplotlib.
"""

import math
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Annotated, Any

import typer

MOST_ON_DISK = 10**10  # particles of a run
LARGEST_BLOCK = 2**20  # particles: in memory some gigabytes
MOST_SEED = 2**64 - 1
WEEK = 7 * 86_400.0  # seconds

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help=(
        "Particles between moving walls: theory, simulation and the audit of Oscillating mushrooms."
    ),
    epilog="Example: mushrooms audit --out audit-report",
)


def whole(help: str, low: int, high: int | None = None) -> Any:
    """Return an option that is a whole number within bounds, written as 1000, 1e3 or 1000.0."""
    bounds = f">= {low}" if high is None else f"{low} to {high}"

    def parse(text: str | int) -> int:
        try:
            number = Decimal(text)
        except InvalidOperation:
            number = Decimal("nan")
        # 1e1000000 is refused before it is made an integer of a million digits.
        if not number.is_finite() or number.adjusted() > 30 or number != number.to_integral_value():
            raise typer.BadParameter(f"{str(text)[:40]!r}, must be a whole number, {bounds}")
        if number < low or (high is not None and number > high):
            raise typer.BadParameter(f"{int(number)}, must be {bounds}")
        return int(number)

    return typer.Option(parser=parse, metavar="N", help=help)


def positive(help: str, most: float = math.inf) -> Any:
    """Return an option that is a finite number above 0."""
    bounds = "finite and > 0" if most == math.inf else f"> 0 and at most {most:g}"

    def parse(text: str | float) -> float:
        try:
            number = float(text)
        except ValueError:
            raise typer.BadParameter(f"{str(text)[:40]!r} is not a number") from None
        if not 0 < number < math.inf or number > most:
            raise typer.BadParameter(f"{number}, must be {bounds}")
        return number

    return typer.Option(parser=parse, metavar="X", help=help)


def file(help: str, *names: str, metavar: str = "FILE") -> Any:
    """Return an option that is a path."""
    return typer.Option(*names, metavar=metavar, help=help)


SceneName = Annotated[
    str,
    typer.Argument(
        metavar="SCENE", help="A name of the catalogue or the audit, or a .toml or .json file."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Seed = Annotated[int, whole("Seed of the random starts, 0 to 2^64 - 1.", 0, MOST_SEED)]


def print_version(is_wanted: bool) -> None:
    """Print the version and stop."""
    if is_wanted:
        from mushrooms import __version__

        print(f"mushrooms {__version__}")
        raise typer.Exit


@app.callback()
def main(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=print_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Hold the options that come before any command."""


@app.command(
    epilog="Example: mushrooms scenes moving-cap --toml > mine.toml",
    help=(
        "List the catalogue. A scene that is refused is shown with the reason. "
        "With NAME print that scene."
    ),
)
def scenes(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="Print this scene of the catalogue or of the audit."),
    ] = "",
    as_toml: Annotated[
        bool, typer.Option("--toml", help="Print the scene NAME as a TOML file.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List the catalogue, or print a scene."""
    from mushrooms.scenes import ScenesOptions, print_scenes

    options = ScenesOptions(name=name, as_toml=as_toml, as_json=as_json)
    print_scenes(options)


@app.command(epilog="Example: mushrooms warm moving-cap")
def warm(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE", help="Only kernels for this scene: a name, or a .toml or .json file."
        ),
    ] = "",
) -> None:
    """Compile the fast stepper ahead, so that no later command waits for it.

    The code is kept for this user and machine: in the folder NUMBA_CACHE_DIR if that is set, else
    beside the package. Without SCENE all kernels are compiled, which takes minutes.
    """
    from mushrooms.warm import WarmOptions, warm_kernels

    options = WarmOptions(scene=scene)
    warm_kernels(options)


@app.command(epilog="Example: mushrooms theory moving-cap --digits 40")
def theory(
    scene: SceneName,
    digits: Annotated[int, whole("Correct digits, 1 to 1000.", 1, 1000)] = 15,
    energy: Annotated[
        float | None, positive("Also predict for this initial energy v²/2, > 0.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print the paper's predictions for one cycle as decimal strings.

    With --energy also predict at that energy, with the possible error of the prediction. This needs
    rates that python -m mushrooms.audit.frozen measures. They are known for moving-cap,
    moving-cap-trivial, both fixed caps, ergodic, retraced-arc, the scenes of the audit, and the
    reverses of all these. For another scene only the limit of high energies is printed, and a line
    on stderr says why.
    """
    from mushrooms.scenes import TheoryOptions, print_prediction

    options = TheoryOptions(scene=scene, digits=digits, energy=energy, as_json=as_json)
    print_prediction(options)


Picture = Annotated[
    Path | None,
    file(
        "A .svg, .png, .pdf or .gif file; default: SCENE.svg. If there are several pictures, the "
        "kind is added to each name."
    ),
]
Section = Annotated[
    bool,
    typer.Option(
        "--section",
        help="Poincare section: place on the arc against sin phi. For a stem: phase of the moving "
        "wall against the velocity after the hit.",
    ),
]
Growth = Annotated[
    bool,
    typer.Option(
        "--growth",
        help="Mean and spread of ln(E/E0) against the cycle, with the theory. With --particles 1: "
        "ln(E/E0) against time.",
    ),
]

BoundaryMap = Annotated[
    bool,
    typer.Option(
        "--map", help="Boundary map: place along all walls against the sine of the angle."
    ),
]
Phase = Annotated[
    float | None,
    typer.Option(
        metavar="X",
        help="Section at this phase t/T of the walls, 0 to 1. For a stem: y against vy.",
    ),
]


@app.command(
    epilog="Example: mushrooms draw moving-cap --trajectory --seed 1 --out orbit.gif",
)
def draw(
    scene: SceneName,
    out: Picture = None,
    trajectory: Annotated[
        bool, typer.Option("--trajectory", help="Path of one particle; a .gif is an animation.")
    ] = False,
    section: Section = False,
    boundary_map: BoundaryMap = False,
    growth: Growth = False,
    lyapunov: Annotated[
        bool, typer.Option("--lyapunov", help="Finite-time Lyapunov exponents with their errors.")
    ] = False,
    export: Annotated[
        Path | None, file("Write the start and every collision to a .csv or .parquet file.")
    ] = None,
    energy: Annotated[
        float | None, positive("Initial energy v²/2, > 0; default: one that suits the picture.")
    ] = None,
    collisions: Annotated[
        int | None, whole("Collisions of each particle, 1 to 10^6.", 1, 10**6)
    ] = None,
    cycles: Annotated[
        int | None, whole("Cycles to follow, instead of collisions, 1 to 10,000.", 1, 10**4)
    ] = None,
    particles: Annotated[
        int | None,
        whole("Particles in a section, map, growth or exponent plot, 1 to 1000.", 1, 1000),
    ] = None,
    seed: Annotated[
        int | None, whole("Seed of the random starts, 0 to 2^64 - 1; default: 0.", 0, MOST_SEED)
    ] = None,
    phase: Phase = None,
) -> None:
    """Draw a table during its cycle, or paths of particles in it.

    Pictures of particles follow the first particles of `mushrooms simulate SCENE --energy E --seed
    S`. If SCENE is the folder of a run (simulate --out), its histogram of ln(E1/E0) is drawn with
    the theory. If the run has several cycles, the mean after each cycle is drawn too.
    """
    from mushrooms.draw import DrawOptions, draw_scene

    options = DrawOptions(
        scene=scene, out=out, trajectory=trajectory, section=section, boundary_map=boundary_map,
        growth=growth, lyapunov=lyapunov, export=export, energy=energy, collisions=collisions,
        cycles=cycles, particles=particles, seed=seed, phase=phase,
    )  # fmt: skip
    draw_scene(options)


Resume = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Continue the run in DIR; with more --particles or more --cycles, extend it.",
    ),
]
Dask = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers simulate the blocks."),
]
Block = Annotated[
    int | None,
    whole("Particles stored at a time; default: some seconds of work.", 1, LARGEST_BLOCK),
]
Phases = Annotated[
    str | None,
    typer.Option(
        metavar="A,B,...",
        help="Fractions of a cycle at which energies are stored too; needs --out.",
    ),
]


@app.command(
    epilog=(
        "Example: mushrooms simulate moving-cap --particles 25000 --energy 1e7 --seed 1 --out run"
    ),
)
def simulate(
    scene: SceneName,
    particles: Annotated[
        int, whole("Number of particles, 1 to 10^8; with --out to 10^10.", 1, MOST_ON_DISK)
    ],
    energy: Annotated[float, positive("Initial energy v²/2 of every particle, > 0.")],
    cycles: Annotated[int, whole("Cycles of the walls, at least 1.", 1)] = 1,
    seed: Seed = 0,
    phases: Phases = None,
    out: Annotated[
        Path | None, file("Folder for the run (ensemble.zarr) and summary.json.", metavar="DIR")
    ] = None,
    resume: Resume = False,
    dask: Dask = None,
    block: Block = None,
    max_collisions: Annotated[
        int | None, whole("Stop if a particle makes more collisions than this.", 1)
    ] = None,
    max_seconds: Annotated[
        float | None, positive("Stop after this time; --resume continues.")
    ] = None,
    plot: Annotated[
        Path | None, file("Draw the energies after each cycle, with the theory (.svg, .png).")
    ] = None,
    threads: Annotated[
        int | None, whole("Threads; default: all cores, or one per block with --dask.", 1)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Simulate an ensemble. Undecided particles are counted, never guessed.

    Prints: particles; collisions; lost (not followed to the end); undecided (lost because the
    stepper could not decide); careful (collisions computed by the scalar step, some tens of times
    slower); collision_time (mean time between two collisions of a particle); m1 (mean of log E/E0
    per cycle); p_nc (share of cycles without capture); _se (standard error); _theory (prediction);
    _z (difference in standard errors); ns_per_collision; SHA-256 of the results. Particles that are
    captured for the whole run count neither in m1 nor in p_nc. docs/ensembles.md explains each
    line.

    With --out particles are stored block by block. After any interruption --resume continues the
    run, to the same bits. Exit code 0; 3 if a limit stopped the run; 130 if it was interrupted.

    On stderr: progress and the time left, after 20 s and then every minute; a note if scalar steps
    took over a tenth of the time; a note if the prediction is the limit of high energies.
    """
    from mushrooms.simulate import SimulateOptions, simulate_scene

    options = SimulateOptions(
        scene=scene, particles=particles, energy=energy, cycles=cycles, seed=seed, phases=phases,
        out=out, resume=resume, dask=dask, block=block, max_collisions=max_collisions,
        max_seconds=max_seconds, plot=plot, threads=threads, as_json=as_json,
    )  # fmt: skip
    simulate_scene(options)


@app.command(
    epilog="Example: mushrooms export run --to run.csv",
    help=(
        "Write a finished run as one table, one row per particle. "
        "An .npz holds the arrays of `fast.Ensemble`.\n\n"
        "The run is read block by block and its checksums are tested. A damaged run is refused."
    ),
)
def export(
    run: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that `simulate --out` wrote.")],
    to: Annotated[Path, file("A .parquet, .csv or .npz file.")],
) -> None:
    """Write a finished run as one table, or as arrays."""
    from mushrooms.store.export import ExportOptions, export_run

    options = ExportOptions(run=run, to=to)
    export_run(options)


@app.command(epilog="Example: mushrooms attack --family knot-at-event --cases 20000 --seed 1")
def attack(
    family: Annotated[str, typer.Option(help="Name of a family of questions, or all.")] = "all",
    cases: Annotated[int, whole("Cases of each family, 1 to 10^7.", 1, 10**7)] = 100,
    seed: Annotated[
        int,
        whole(
            "Seed of the questions, 0 to 2^64 - 1. Family, seed and index identify a case.",
            0,
            MOST_SEED,
        ),
    ] = 0,
    stepper: Annotated[str, typer.Option(help="Stepper to ask: reference, fast or both.")] = "both",
    json_file: Annotated[
        Path | None, file("Write the counts and every wrong case.", "--json")
    ] = None,
) -> int:
    """Ask our own steppers questions that aim at their weak points.

    The verifier proves the answer of the reference, and the fast stepper is compared with it. Each
    wrong answer and each unproved claim is printed as a line of JSON.

    Exit code 1 if an answer is wrong or the reference took over 10 s, 2 on bad input, else 0.
    """
    from mushrooms.questions import AttackOptions, attack_steppers

    options = AttackOptions(
        family=family,
        cases=cases,
        seed=seed,
        stepper=stepper,
        json_file=json_file,
    )
    return attack_steppers(options)


@app.command(epilog="Example: mushrooms audit --only X2,L4 --out audit-report")
def audit(
    out: Annotated[Path, file("Folder for the report.", metavar="DIR")] = Path("audit-report"),
    full: Annotated[
        bool, typer.Option("--full", help="The paper's sizes; an hour on two cores.")
    ] = False,
    only: Annotated[
        str | None,
        typer.Option(metavar="IDS", help="Only these claims, separated by commas: X2,L4."),
    ] = None,
    seed: Seed = 0,
    threads: Annotated[int | None, whole("Threads; all cores by default.", 1)] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue with DIR/runs and DIR/findings.")
    ] = False,
    commands: Annotated[
        bool,
        typer.Option(
            "--commands", help="Print the runs as simulate commands, one per line, and stop."
        ),
    ] = False,
    as_json: AsJson = False,
    ensemble: Annotated[Path | None, file("Audit this ensemble: CSV, Parquet or Zarr.")] = None,
    scene: Annotated[str | None, typer.Option(metavar="SCENE", help="Scene of --ensemble.")] = None,
    backwards: Annotated[
        Path | None, file("An ensemble of the reversed cycle, to compare with --ensemble.")
    ] = None,
    energy: Annotated[
        float | None, positive("Initial energy: chooses rows, or replaces a missing column E0.")
    ] = None,
    energy_unit: Annotated[
        str | None, typer.Option(help="Unit of energies: v2/2 (default) or v2.")
    ] = None,
    time_unit: Annotated[
        str | None, typer.Option(help="Unit of times: scene or cycles; default: inferred.")
    ] = None,
    particles: Annotated[
        int | None, whole("Number of started particles, if some have no row.", 1)
    ] = None,
) -> int:
    """Check the claims of the paper. Writes report.html, report.json and report.txt.

    Particles are stored in DIR/runs/NAME, like those of simulate --out, and results in
    DIR/findings. --resume continues after an interruption, with --full or with other claims
    (--only). The report then holds the old and the new claims. The runs that --commands prints may
    be made anywhere; --resume uses them. No run is ever replaced.

    --ensemble compares an ensemble of another program with theory at its energy.

    Exit code 0 if every claim has its expected verdict, 1 if one has not, 2 on bad input.
    """
    from mushrooms.audit.command import audit_claims
    from mushrooms.audit.options import AuditOptions

    options = AuditOptions(
        out=out, full=full, only=only, seed=seed, threads=threads, resume=resume, commands=commands,
        as_json=as_json, ensemble=ensemble, scene=scene, backwards=backwards, energy=energy,
        energy_unit=energy_unit, time_unit=time_unit, particles=particles,
    )  # fmt: skip
    return audit_claims(options)


@app.command(epilog="Example: mushrooms bench --quick --out bench-report")
def bench(
    command: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[-- COMMAND...]", help="Also measure this stepper; it speaks protocol 1."
        ),
    ] = None,
    out: Annotated[Path, file("Folder for the results.", metavar="DIR")] = Path("bench-report"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer questions and runs: five minutes.")
    ] = False,
    seed: Annotated[int, whole("Seed of the questions, 0 to 2^64 - 1.", 0, MOST_SEED)] = 0,
    table: Annotated[
        Path | None,
        file("Print a table of an earlier bench.json as Markdown, and stop.", metavar="OLD.json"),
    ] = None,
    workload: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Workload of --table, or `all`; default: moving-cap-1e7."
        ),
    ] = None,
) -> None:
    """Measure speed against error. Writes bench.json, bench.svg and bench.html.

    Exit code 0, or 2 on bad input.
    """
    from mushrooms.bench import BenchOptions, measure_solvers

    options = BenchOptions(
        command=command,
        out=out,
        quick=quick,
        seed=seed,
        table=table,
        workload=workload,
    )
    measure_solvers(options)


@app.command(epilog="Example: mushrooms check --html report.html -- ./my_stepper")
def check(
    command: Annotated[
        list[str] | None,
        typer.Argument(metavar="-- COMMAND...", help="The stepper; it speaks protocol 1."),
    ] = None,
    level: Annotated[str, typer.Option(help="core, extended or stress.")] = "core",
    seed: Annotated[
        int | None, whole("Seed of the questions; default: a new one.", 0, MOST_SEED)
    ] = None,
    timeout: Annotated[
        float, positive("Seconds for one answer, compilation included.", WEEK)
    ] = 120.0,
    total: Annotated[
        float | None, positive("Seconds for the whole run; no limit by default.", WEEK)
    ] = None,
    restarts: Annotated[int, whole("Fresh processes after the first, 0 to 1000.", 0, 1000)] = 10,
    groups: Annotated[
        str, typer.Option(help="Only these groups of cases, separated by commas; default: all.")
    ] = "",
    known_failures: Annotated[
        Path | None, file("Known to fail, one per line: ID, ID@SEED, fresh/*, declined/GROUP.")
    ] = None,
    json_file: Annotated[Path | None, file("JSON report.", "--json")] = None,
    junit: Annotated[Path | None, file("JUnit XML report.")] = None,
    html: Annotated[Path | None, file("HTML report.")] = None,
    badge: Annotated[Path | None, file("Badge (SVG) to publish.")] = None,
    summary: Annotated[Path | None, file("Verdict and scope as JSON.")] = None,
    questions: Annotated[
        Path | None,
        file("Write the questions to a .jsonl file, or as CSV into a folder.", metavar="PATH"),
    ] = None,
    answers: Annotated[
        Path | None, file("Grade these answers to the file of --questions.", metavar="PATH")
    ] = None,
    corpus: Annotated[
        str | None,
        typer.Option(metavar="VERSION", help="Refuse to run with another corpus than this."),
    ] = None,
) -> int:
    """Test a stepper in any language. COMMAND starts it; it speaks protocol 1 on stdin and stdout.

    Each question is randomly mirrored and rescaled. The seed is printed, and --seed repeats a run.
    Without a dialogue: --questions writes questions to a file, --answers grades the answers in a
    file.

    Exit code 0 if everything passes, 1 if something fails, 2 if the options or the suite are at
    fault.
    """
    from mushrooms.check import CheckOptions, check_stepper

    options = CheckOptions(
        command=command, level=level, seed=seed, timeout=timeout, total=total, restarts=restarts,
        groups=groups, known_failures=known_failures, json_file=json_file, junit=junit, html=html,
        badge=badge, summary=summary, questions=questions, answers=answers, corpus=corpus,
    )  # fmt: skip
    return check_stepper(options)


@app.command(epilog="Example: mushrooms verify steps.csv --scene moving-cap --picture false.svg")
def verify(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="A CSV file, or JSON or JSON lines as in docs/corpus.md."
        ),
    ],
    scene: Annotated[
        str | None,
        typer.Option(metavar="SCENE", help="Scene of a CSV file. Its first row is the start."),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the first false step (.svg).")
    ] = None,
    t_end: Annotated[
        float | None, typer.Option(metavar="T", help="Horizon, where the file gives none.")
    ] = None,
    within: Annotated[
        float,
        typer.Option(metavar="ULPS", help="Largest backward error that agrees, in units of 2^-53."),
    ] = 1e-9 * 2.0**53,
    is_all: Annotated[
        bool, typer.Option("--all", help="Judge what follows a false step, too.")
    ] = False,
) -> int:
    """Check a trajectory computed in floating point. Each step is judged from the state before it.

    The errors are estimates, not proofs. At the end the worst and the mean errors are printed, and
    each bias over the path. Exit code 0 if every step agrees, 1 if one does not, 2 on bad input.
    """
    from mushrooms.questions import VerifyOptions, verify_file

    options = VerifyOptions(
        file=file,
        scene=scene,
        picture=picture,
        t_end=t_end,
        within=within,
        is_all=is_all,
    )
    return verify_file(options)


@app.command(epilog="Example: mushrooms ask near-corner/3 -- ./my_stepper")
def ask(
    case: Annotated[
        str, typer.Argument(metavar="ID", help="Name of the case, as check prints it.")
    ],
    command: Annotated[
        list[str] | None,
        typer.Argument(metavar="[-- COMMAND...]", help="Ask this stepper, and grade its answer."),
    ] = None,
    seed: Annotated[
        int | None,
        whole("Ask the question exactly as the run with this seed asked it.", 0, MOST_SEED),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the vector as JSON.")] = False,
) -> int:
    """Print a question of the test suite and its proved answer.

    -- COMMAND also asks a stepper this question, and grades the answer.

    Exit code 0; 1 if the stepper does not pass; 2 on bad input.
    """
    from mushrooms.questions import AskOptions, ask_case

    options = AskOptions(case=case, command=command, seed=seed, as_json=as_json)
    return ask_case(options)
