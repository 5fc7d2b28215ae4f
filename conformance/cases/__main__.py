"""`python -m conformance.cases`: make the corpus, add to it, check that it is what would be made, or pack it.

Some ten minutes on one core; `--jobs N` shares them out.
"""

import argparse
import hashlib
import sys
import zipfile
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from conformance.cases.corpus import FOLDER, RETIRED, added, groups, make, write
from conformance.vectors import Vector, encode, load, manifest
from scene import BadInput


def _made(most: int | None, n_jobs: int) -> list[Vector]:
    """Make all vectors, or the first few of each group, on so many processes."""
    wanted = [
        (group, number)
        for group, n in groups().items()
        for number in range(1, min(n, most or n) + 1)
        if f"{group}/{number}" not in RETIRED
    ]
    found = []
    with ProcessPoolExecutor(n_jobs) as pool:
        for vector in pool.map(make, *zip(*wanted, strict=True), chunksize=4):
            found.append(vector)
            if len(found) % 100 == 0:
                print(f"{len(found)} of {len(wanted)} vectors", file=sys.stderr, flush=True)
    return found


def _summary(vectors: Iterable[Vector]) -> str:
    kinds = Counter((vector.kind, vector.level) for vector in vectors)
    names = {"step": "steps", "trajectory": "trajectories", "flow": "flows"}
    return ", ".join(f"{n} {level} {names[kind]}" for (kind, level), n in sorted(kinds.items()))


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
    parser.add_argument("--check", action="store_true", help="make it, and compare with what is there")
    parser.add_argument(
        "--add", type=Path, metavar="FILE", help="add the questions of a file, and make no other"
    )
    parser.add_argument("--archive", type=Path, metavar="FILE", help="write the corpus and verify.py as .zip")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes")
    parser.add_argument("--most", type=int, metavar="N", help="at most so many vectors of each group")
    options = parser.parse_args(arguments)
    for name, number in (("most", options.most), ("jobs", options.jobs)):
        if number is not None and number < 1:
            parser.error(f"--{name} = {number}, must be >= 1")
    try:
        if options.archive:
            return archive(options.archive)
        if options.check:
            return _check(options.out, _made(options.most, options.jobs))
        known = [*load("stress", FOLDER), *added(options.add)] if options.add else None
        vectors = known or _made(options.most, options.jobs)
        written = write(options.out, vectors)
    except (BadInput, OSError) as error:
        print(f"conformance.cases: {error}", file=sys.stderr)
        return 2
    print(f"corpus {written.corpus}, {written.digest[:12]}: {_summary(vectors)}")
    return 0


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


if __name__ == "__main__":
    sys.exit(main())
