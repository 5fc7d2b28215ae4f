"""The corpus as it was published, and what is added to it; `python -m conformance.cases`.

A published question stands in its line, and nowhere else; a new one is written by hand, or drawn by
a family. All are answered by the reference and proved by the verifier. The command makes the corpus
anew, adds to it, checks that it is what would be made, or packs it: some ten minutes on one core;
`--jobs N` shares them out.
"""

import argparse
import hashlib
import sys
import zipfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from math import inf, isclose
from pathlib import Path
from typing import Any

import msgspec

from conformance.cases.certify import certify
from conformance.cases.draw import Question, Unfit
from conformance.cases.table import FAMILIES
from conformance.vectors import (
    MANIFEST,
    NUMBERS,
    VERSIONS,
    Certified,
    File,
    Manifest,
    Vector,
    digest,
    encode,
    load,
    manifest,
)
from conformance.verify import verify_line
from scene import BadInput
from scene.files.writer import write_file

VERSION = VERSIONS[-1]
RETIRED: tuple[str, ...] = ()
FOLDER = Path(__file__).parent.parent / "corpus"
ROUNDING = 1e-30  # relative: the reference works with at least 30 digits


def question_of(line: Vector) -> Question:
    """Return what a published line asks.

    It takes the path as far as the line does, and keeps its level.
    """
    return Question(
        line.scene,
        line.state,
        line.t_end,
        None if line.kind == "step" else line.collisions,
        line.kind == "flow",
        longest=inf,
        level=line.level,
        rule=line.rule,
        group=line.group,
        source=line.source,
    )


@cache
def published() -> dict[str, Vector]:
    """Return the published vectors by their ids, in order."""
    return {vector.id: vector for vector in load("stress", FOLDER)}


def groups() -> dict[str, int]:
    """Return how many vectors every group has, numbered from 1."""
    return Counter(name.partition("/")[0] for name in (*published(), *RETIRED))


def make(name: str) -> Vector:
    """Make a published vector anew; its line stays if what is made agrees with it.

    If only a further answer is missing, or is too much, the answer that was proved keeps its line.
    """
    line = published()[name]
    made = certify(question_of(line), int(name.partition("/")[2]))
    if agrees(made, line):
        return line
    mended = msgspec.structs.replace(line, expect=(line.expect[0], *made.expect[1:]))
    return mended if agrees(made, mended) else made


def errata() -> list[str]:
    """Return the ids of published vectors that lack further answers which the rules permit."""
    return [
        name for name, line in published().items() if verify_line(_plain(line)).status == "false"
    ]


def _plain(line: Vector) -> Any:
    return msgspec.json.decode(msgspec.json.encode(line))


def agrees(made: Vector, line: Vector) -> bool:
    """Tell whether two answers are the same, but for how closely their numbers are enclosed.

    That depends on the digits with which the reference works: on how far ahead it looks, and on its
    version. What vanishes may be rounding: allowances are compared to a part ROUNDING of the size
    of their vectors.
    """
    if _outline(made) != _outline(line):
        return False
    for one, other in zip(_steps(made), _steps(line), strict=True):
        slack = _slack(other)
        for name, a, b in zip(NUMBERS, one.allowance, other.allowance, strict=True):
            low, high = one.ends(name)
            least, most = other.ends(name)
            if low > most or least > high or not isclose(a, b, rel_tol=1e-2, abs_tol=slack[name]):
                return False
    return True


def _slack(step: Certified) -> dict[str, float]:
    """Return what an allowance that vanishes may differ by: a part of time, place or velocity."""
    sizes = dict(zip(NUMBERS, step.allowance, strict=True))
    sizes = {
        name: max(size, *(abs(float(end)) for end in step.ends(name)))
        for name, size in sizes.items()
    }
    place = max(sizes["x"], sizes["y"])
    velocity = max(sizes["vx"], sizes["vy"])
    found = {"dt": sizes["dt"], "x": place, "y": place, "vx": velocity, "vy": velocity}
    return {name: ROUNDING * size for name, size in found.items()}


def _outline(vector: Vector) -> list[Any]:
    """Return what is compared exactly."""
    answers = [(known, [step.wall for step in known.steps]) for known in vector.expect]
    return [
        vector.level,
        *((known.outcome, known.reason, known.stays, walls) for known, walls in answers),
    ]


def _steps(vector: Vector) -> list[Certified]:
    return [step for known in vector.expect for step in known.steps]


def certify_added(path: Path) -> list[Vector]:
    """Certify new questions, which go to the ends of their groups.

    Args:
        path: JSON lines. A family's question is given by `family`, `seed` and `index`, as
            `mushrooms attack` names it. One that is written by hand has group, rule, source, scene,
            state and t_end; for a path kind and collisions. Which further answers pass follows from
            the rules.
    """
    found: list[Vector] = []
    for i, line in enumerate(path.read_bytes().splitlines(), 1):
        try:
            asked = _asked(msgspec.json.decode(line, type=dict[str, Any]))
        except (msgspec.MsgspecError, KeyError) as error:
            raise BadInput(
                f"{path.name}:{i}: {error}, must be a question as CONTRIBUTING has it"
            ) from None
        number = (
            groups().get(asked.group, 0) + sum(vector.group == asked.group for vector in found) + 1
        )
        try:
            found.append(certify(asked, number))
        except Unfit as why:
            raise BadInput(f"{path.name}:{i}: no vector can be made of it: {why}") from None
    return found


def _asked(data: dict[str, Any]) -> Question:
    if "family" in data:
        return FAMILIES[data["family"]].question(f"{data['seed']}/{data['index']}")
    given = {"level": "stress", "kind": "step", **data}
    unknown = {"id": f"{given['group']}/0", "expect": [{"outcome": "rejected"}]}
    written = msgspec.convert({**given, **unknown}, Vector)
    return question_of(written)._replace(level=None)


def write(folder: Path, vectors: Iterable[Vector]) -> Manifest:
    """Write vectors, by file, and their manifest, each complete or not at all.

    The manifest last.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = defaultdict[str, list[Vector]](list)
    entries = {}
    for vector in vectors:
        name = "hard-cases" if vector.group.startswith("hard-case-") else vector.group
        files[f"{name}.jsonl"].append(vector)
    for name, held in sorted(files.items()):
        data = encode(held)
        write_file(folder / name, data)
        entries[name] = File(hashlib.sha256(data).hexdigest(), len(held))
    written = Manifest(VERSION, digest(entries, RETIRED), entries, RETIRED)
    write_file(folder / MANIFEST, msgspec.json.format(msgspec.json.encode(written)) + b"\n")
    for stale in sorted(folder.glob("*.jsonl")):
        if stale.name not in entries:
            stale.unlink()
    return written


def _made(n_jobs: int) -> list[Vector]:
    """Make all vectors, on so many processes."""
    found: list[Vector] = []
    with ProcessPoolExecutor(n_jobs) as pool:
        for vector in pool.map(make, published(), chunksize=4):
            found.append(vector)
            if len(found) % 100 == 0:
                print(f"{len(found)} of {len(published())} vectors", file=sys.stderr, flush=True)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0; 1 when `--check` finds a corpus that differs; 2 for bad input.
    """
    parser = argparse.ArgumentParser(
        prog="python -m conformance.cases",
        description="Make the corpus of vectors.",
        epilog="example: python -m conformance.cases --check",
    )
    parser.add_argument(
        "--out", type=Path, default=FOLDER, metavar="DIR", help="where it goes, or is checked"
    )
    parser.add_argument(
        "--check", action="store_true", help="make it, and compare with what is there"
    )
    parser.add_argument(
        "--add", type=Path, metavar="FILE", help="add the questions of a file, and make no other"
    )
    parser.add_argument(
        "--errata",
        action="store_true",
        help="make those lines anew that the verifier holds to be false",
    )
    parser.add_argument(
        "--archive", type=Path, metavar="FILE", help="write the corpus and verify.py as .zip"
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes")
    options = parser.parse_args(arguments)
    if options.jobs < 1:
        parser.error(f"--jobs = {options.jobs}, must be >= 1")
    try:
        if options.archive:
            return archive(options.archive)
        if options.check:
            return _check(options.out, _made(options.jobs))
        vectors = _wanted(options)
        written = write(options.out, vectors)
    except (BadInput, OSError) as error:
        print(f"conformance.cases: {error}", file=sys.stderr)
        return 2
    print(f"corpus {written.corpus}, {written.digest[:12]}: {len(vectors)} vectors")
    return 0


def _wanted(options: argparse.Namespace) -> list[Vector]:
    """Return the corpus that the options ask for: lines added, lines mended, or all made anew."""
    if options.add:
        return [*published().values(), *certify_added(options.add)]
    if options.errata:
        mended = {name: make(name) for name in errata()}
        for name in mended:
            print(f"{name}: made anew")
        return [mended.get(name, line) for name, line in published().items()]
    return _made(options.jobs)


def archive(path: Path) -> int:
    """Write the published corpus and its verifier as a zip file, and print the file's SHA-256.

    The same corpus makes the same bytes: members bear no date of their own.
    """
    files = {f"corpus/{file.name}": file for file in sorted(FOLDER.iterdir())}
    files |= {"verify.py": FOLDER.parent / "verify.py", "LICENSE": FOLDER.parents[1] / "LICENSE"}
    with zipfile.ZipFile(path, "w") as members:
        for name, file in files.items():
            if file.is_file():
                members.writestr(zipfile.ZipInfo(name), file.read_bytes(), zipfile.ZIP_DEFLATED, 9)
    print(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}")
    print(f"corpus {manifest().corpus}, digest {manifest().digest}")
    return 0


def _check(folder: Path, vectors: Iterable[Vector]) -> int:
    there = {vector.id: encode([vector]) for vector in load("stress", folder)}
    made = {vector.id: encode([vector]) for vector in vectors}
    different = [name for name in made if there.get(name) != made[name]]
    different += [name for name in there if name not in made]
    for name in different:
        print(f"{name}: differs")
    print(f"{len(made)} vectors made, {len(different)} differ")
    return 1 if different else 0
