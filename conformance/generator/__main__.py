"""`python -m conformance.generator`: make the corpus, or check that it is what would be made.

Every vector is drawn from a stream seeded by its id, or written down as a hard case; answered by the
reference; and proved by the verifier. The same corpus comes out on every machine, bit for bit.
Some ten minutes on one core; `--jobs N` shares them out.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path

import msgspec

from conformance.generator.certify import certify
from conformance.generator.coverage_families import at_the_horizon, coverage_families
from conformance.generator.draws import Draw
from conformance.generator.families import VectorFamily, families
from conformance.generator.flow_families import flow_families
from conformance.generator.links import Unfit
from conformance.generator.mouth_and_time_cases import cases
from conformance.vectors import MANIFEST, File, Manifest, Vector, digest, encode, load
from scene import BadInput
from scene.files import write_file

VERSION = "1.3"
RETIRED: tuple[str, ...] = ()
# Published when the reference enclosed a place after 10^323 units of time closer by a unit of the last
# decimal. Both enclosures are right; a published line never changes.
KEPT = ("hard-case-41/1", "hard-case-41/2", "hard-case-41/3", "hard-case-41/4")
FOLDER = Path(__file__).parent.parent / "corpus"
ATTEMPTS = 64
Maker = Callable[[int], Vector]


@cache
def groups() -> dict[str, list[Maker]]:
    """Return for every group what makes its vectors, in order; number n is made by entry n - 1."""
    found: dict[str, list[Maker]] = {}
    for case in [*cases(), *at_the_horizon()]:
        found.setdefault(case.group, []).append(partial(certify, case))
    for family in [*families(), *flow_families(), *coverage_families()]:
        found[family.group] = [partial(drawn, family)] * family.n_vectors
    return found


def drawn(family: VectorFamily, number: int) -> Vector:
    """Return a family's vector of that number: its first draw that has a certified answer."""
    first = family.first_attempts[number - 1] if family.first_attempts else 0
    for attempt in range(first, first + ATTEMPTS):
        question = family.ask(Draw(f"{family.group}/{number}/{attempt}"))
        try:
            vector = certify(question, number)
        except Unfit:
            continue
        outcome = vector.expect[0].outcome
        if outcome == family.wanted or (family.wanted is None and outcome in ("collision", "horizon")):
            return vector
    raise BadInput(f"{family.group}/{number}: none of {ATTEMPTS} draws has a certified answer")


def make(group: str, number: int) -> Vector:
    """Make one vector of the corpus anew.

    Raises:
        BadInput: when there is no such vector.
    """
    makers = groups().get(group, [])
    if not 1 <= number <= len(makers) or f"{group}/{number}" in RETIRED:
        raise BadInput(f"vector = {group}/{number}, must be one of the corpus")
    if f"{group}/{number}" in KEPT:
        return next(vector for vector in load("stress", FOLDER) if vector.id == f"{group}/{number}")
    return makers[number - 1](number)


def write(folder: Path, files: Mapping[str, list[Vector]]) -> Manifest:
    """Write files of vectors and their manifest, each complete or not at all; the manifest last."""
    folder.mkdir(parents=True, exist_ok=True)
    entries = {}
    for name, vectors in sorted(files.items()):
        data = encode(vectors)
        write_file(folder / name, data)
        entries[name] = File(hashlib.sha256(data).hexdigest(), len(vectors))
    manifest = Manifest(VERSION, digest(entries, RETIRED), entries, RETIRED)
    write_file(folder / MANIFEST, msgspec.json.format(msgspec.json.encode(manifest)) + b"\n")
    for stale in sorted(folder.glob("*.jsonl")):
        if stale.name not in entries:
            stale.unlink()
    return manifest


def _file_name(group: str) -> str:
    return ("hard-cases" if group.startswith("hard-case-") else group) + ".jsonl"


def _made(most: int | None, n_jobs: int) -> dict[str, list[Vector]]:
    """Make all vectors, or the first few of each group, on so many processes."""
    wanted = [
        (group, number)
        for group, makers in groups().items()
        for number in range(1, len(makers[:most]) + 1)
        if f"{group}/{number}" not in RETIRED
    ]
    files: dict[str, list[Vector]] = defaultdict(list)
    with ProcessPoolExecutor(n_jobs) as pool:
        for done, vector in enumerate(pool.map(make, *zip(*wanted, strict=True), chunksize=4), 1):
            files[_file_name(vector.group)].append(vector)
            if done % 100 == 0:
                print(f"{done} of {len(wanted)} vectors", file=sys.stderr, flush=True)
    return files


def _summary(files: Mapping[str, list[Vector]]) -> str:
    kinds = Counter((vector.kind, vector.level) for vectors in files.values() for vector in vectors)
    names = {"step": "steps", "trajectory": "trajectories", "flow": "flows"}
    return ", ".join(f"{n} {level} {names[kind]}" for (kind, level), n in sorted(kinds.items()))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0; 1 when `--check` finds a corpus that differs; 2 for bad input.
    """
    parser = argparse.ArgumentParser(
        prog="python -m conformance.generator",
        description="Make the corpus of vectors.",
        epilog="example: python -m conformance.generator --check",
    )
    parser.add_argument(
        "--out", type=Path, default=FOLDER, metavar="DIR", help="where it goes, or is checked"
    )
    parser.add_argument("--check", action="store_true", help="make it, and compare with what is there")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes")
    parser.add_argument("--most", type=int, metavar="N", help="at most so many vectors of each group")
    options = parser.parse_args(arguments)
    for name, number in (("most", options.most), ("jobs", options.jobs)):
        if number is not None and number < 1:
            parser.error(f"--{name} = {number}, must be >= 1")
    try:
        files = _made(options.most, options.jobs)
        if options.check:
            return _check(options.out, files)
        manifest = write(options.out, files)
    except (BadInput, OSError) as error:
        print(f"conformance.generator: {error}", file=sys.stderr)
        return 2
    print(f"corpus {manifest.corpus}, {manifest.digest[:12]}: {_summary(files)}")
    return 0


def _check(folder: Path, files: Mapping[str, list[Vector]]) -> int:
    there = {vector.id: encode([vector]) for vector in load("stress", folder)}
    made = {vector.id: encode([vector]) for vectors in files.values() for vector in vectors}
    different = [name for name in made if there.get(name) != made[name]]
    different += [name for name in there if name not in made]
    for name in different:
        print(f"{name}: differs")
    print(f"{len(made)} vectors made, {len(different)} differ")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
