"""Vectors: questions with certified answers, and the corpus of all vectors.

A vector asks for one step, one trajectory or one particle's flow. Its answers are enclosures that the
reference found and `conformance.verify` proved. The corpus has one file of JSON lines for each group, one
for all hard cases, and a manifest with its version and the SHA-256 of each file. `load` refuses a corpus
that does not match its manifest. `request` builds the line that is sent to an implementation; it contains
no answer.

A level says how delicate a question is. It depends on the condition number (the largest relative change of an
answer per relative change of the inputs), and on the effect of a small change of the inputs:
    core      condition <= 1e6, and a relative change of 2^-30 in every input leaves the walls met the same.
              An answer that passes (backward error 1e-9, see `grading.agreement`) is then right to three
              digits. A simple stepper that loses twice the necessary digits (at worst 1e6^2 u = 1e-4 in
              the answer, 1e6 u = 1e-10 backward) still passes.
    extended  condition <= 1e12, walls the same under a change of 2^-44. A backward stable stepper in
              binary64 can answer. Bad input that must be refused is here too.
    stress    the rest, and degenerate answers: ties of two walls, tangencies, sliding.

The version is MAJOR.MINOR. A published vector never changes its question, and an id is never used again.
New vectors take the next number of their group and raise MINOR. If a vector is wrong or unfair, its id
moves to `retired` of the manifest, its line is removed, and MAJOR is raised. MAJOR is also raised if
enclosures or levels of published vectors change. Results with the same MAJOR are comparable.

`python -m conformance.vectors > docs/vector.schema.json` prints the schema of a line.
Not handled: questions that JSON or `scene.State` cannot represent (nan, missing or unknown fields).
"""

from __future__ import annotations

import decimal
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from scene import BadInput, Outcome, Rejected, Scene, State, Wall, from_data, to_data
from scene.protocol.wire import Flowing
from scene.states import Stepper

Level = Literal["core", "extended", "stress"]
Kind = Literal["step", "trajectory", "flow"]
OutcomeName = Literal["collision", "horizon", "undefined", "undecided", "rejected"]
LEVELS: tuple[Level, ...] = ("core", "extended", "stress")
NUMBERS = ("dt", "x", "y", "vx", "vy")
MANIFEST = "manifest.json"
VERSIONS = ("1.0", "1.1", "1.2", "1.3", "1.4")  # of the corpus, all that were published
Follow = Callable[[Scene, State, int, float], list[Outcome]]
Decimal = Annotated[str, msgspec.Meta(pattern=r"^-?[0-9]{1,40}(\.[0-9]{1,40})?(E[+-]?[0-9]{1,4})?$")]
Enclosure = tuple[Decimal, Decimal]
Ends = tuple[Fraction, Fraction]  # low and high of an enclosure, exactly
DIGITS = 24  # decimals that an enclosure in the corpus is written with
Hash = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]


class BadCorpus(BadInput):
    """A corpus that does not match its manifest: one line naming file, field, value and bound."""


class Certified(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The proved state just after a collision, or at the horizon.

    Attributes:
        dt: flight time since the collision before [time]: lower and upper end of its enclosure, as decimals.
            In a flow, time since the step written before.
        x: position [length], enclosed.
        y: position [length], enclosed.
        vx: velocity [length/time], enclosed.
        vy: velocity [length/time], enclosed.
        allowance: for dt, x, y, vx, vy: sum over inputs of |d out / d in| |in|. In a trajectory the
            sum is over the inputs of every step so far, with chained Jacobians: the possible effect of
            rounding each intermediate state.
        wall: the wall met; None at the horizon.
    """

    dt: Enclosure
    x: Enclosure
    y: Enclosure
    vx: Enclosure
    vy: Enclosure
    allowance: tuple[float, float, float, float, float]
    wall: Wall | None = None

    def ends(self, name: str) -> Ends:
        """Return both ends of one of the enclosures, exactly."""
        low, high = getattr(self, name)
        return Fraction(low), Fraction(high)

    def centre(self, name: str) -> Fraction:
        """Return the middle of one of the enclosures, exactly."""
        low, high = self.ends(name)
        return (low + high) / 2


class Expectation(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One answer that is right.

    Attributes:
        outcome: of the step; of a trajectory: how it ends, "collision" when all asked for are found.
        steps: the collisions, and the horizon when it ends there; empty for undefined and rejected steps.
            Of a flow, whose whole path is proved, the collisions that begin or end a capture interval,
            and the horizon.
        reason: of an undefined outcome.
        stays: of a flow, the capture intervals (docs/protocol.md) as places in `steps`, counted from 0:
            the arc hit that begins it and the collision that ends it, or the horizon. Empty for none.
    """

    outcome: OutcomeName
    steps: tuple[Certified, ...] = ()
    reason: str = ""
    stays: tuple[tuple[int, int], ...] = ()


class Vector(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A question and its certified answers.

    Attributes:
        id: "<group>/<number>", never reused.
        group: a table, a hard case, or a generated family.
        level: core, extended or stress.
        kind: step, trajectory or flow.
        rule: what it tests, in words.
        source: place in the paper, or hard case number.
        scene: in the form of the protocol.
        state: the start.
        t_end: horizon [time].
        expect: the right answers; any of them passes. The first is what the reference proved.
        collisions: of a trajectory, the number asked for; of a flow, the number of steps of its path,
            including the last one to the horizon.
        condition: condition number, the largest over a trajectory; 0 if no wall is met; 1e300 stands
            for infinity.
    """

    id: Annotated[str, msgspec.Meta(pattern="^[a-z0-9-]+/[0-9]+$")]
    group: str
    level: Level
    kind: Kind
    rule: str
    source: str
    scene: dict[str, Any]
    state: State
    t_end: float
    expect: Annotated[tuple[Expectation, ...], msgspec.Meta(min_length=1)]
    collisions: Annotated[int, msgspec.Meta(ge=1)] = 1
    condition: float = 0.0


class File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file of the corpus: its SHA-256 and how many vectors it holds."""

    sha256: Hash
    vectors: int


class Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of the corpus.

    Attributes:
        corpus: version, "MAJOR.MINOR".
        digest: SHA-256 over the files' names and hashes in order, and the retired ids.
        files: by name.
        retired: ids of removed vectors, never used again.
    """

    corpus: Annotated[str, msgspec.Meta(pattern=r"^[0-9]+\.[0-9]+$")]
    digest: Hash
    files: dict[str, File]
    retired: tuple[str, ...] = ()


def certified(
    ends: Mapping[str, Ends],
    allowance: Sequence[float],
    wall: Wall | None,
    *,
    digits: int = DIGITS,
    is_wide: bool = False,
) -> Certified:
    """Write down a proved state: its enclosures in decimals, rounded outward.

    Args:
        ends: low and high of dt, x, y, vx, vy.
        allowance: of these, in this order; written with four digits.
        wall: the wall met; None at the horizon.
        digits: decimals to write.
        is_wide: go one unit of the last decimal further, so that an enclosure in balls fits in.
    """
    numbers = {name: _written(ends[name], digits, is_wide) for name in NUMBERS}
    dt, x, y, vx, vy = map(four_digits, allowance)
    return Certified(**numbers, allowance=(dt, x, y, vx, vy), wall=wall)


def four_digits(number: float) -> float:
    """Return a number rounded to four digits, as allowances and condition numbers are written."""
    return float(f"{number:.3e}")


def _written(ends: Ends, digits: int, is_wide: bool) -> Enclosure:
    low, high = (
        decimal.Context(prec=digits, rounding=rounding, Emin=-9999, Emax=9999)
        for rounding in (decimal.ROUND_FLOOR, decimal.ROUND_CEILING)
    )
    lowest, highest = (
        context.divide(decimal.Decimal(end.numerator), decimal.Decimal(end.denominator))
        for context, end in zip((low, high), ends, strict=True)
    )
    if is_wide:
        lowest = lowest and lowest.next_minus(low)
        highest = highest and highest.next_plus(high)
    return str(lowest.normalize(low)), str(highest.normalize(high))


def load(level: str = "core", path: Path | None = None) -> list[Vector]:
    """Load the vectors up to a level: extended includes core, stress includes all.

    Args:
        level: core, extended or stress.
        path: folder of the corpus; None for the one in the package.

    Raises:
        BadCorpus: the level is unknown, or files and manifest do not match.

    The vectors of the package are cached and shared: do not change them.
    """
    if level not in LEVELS:
        raise BadCorpus(f"level = {level!r}, must be one of {', '.join(LEVELS)}")
    wanted = LEVELS[: LEVELS.index(level) + 1]
    found: list[Vector] = []
    seen: set[str] = set()
    for name, entry in manifest(path).files.items():
        held = _shipped(name, entry) if path is None else _read_lines(name, entry, path)
        for vector in held:
            if vector.id in seen:
                raise BadCorpus(f"corpus {name}: id {vector.id} appears twice, must be unique")
            seen.add(vector.id)
        found += [vector for vector in held if vector.level in wanted]
    return found


def manifest(path: Path | None = None) -> Manifest:
    """Read a corpus's manifest and check its digest.

    Raises:
        BadCorpus: it cannot be read, or is not valid.
    """
    try:
        found = msgspec.json.decode(_read(MANIFEST, path), type=Manifest)
    except msgspec.DecodeError as error:
        raise BadCorpus(f"corpus {MANIFEST}: {error}") from None
    if found.digest != digest(found.files, found.retired):
        raise BadCorpus(f"corpus {MANIFEST}: digest = {found.digest}, must fit its files and retired ids")
    return found


def digest(files: dict[str, File], retired: tuple[str, ...]) -> str:
    """Return the SHA-256 that names a corpus: over its files' names and hashes, and its retired ids."""
    lines = [f"{name} {file.sha256}" for name, file in sorted(files.items())]
    return hashlib.sha256("\n".join([*lines, *sorted(retired)]).encode()).hexdigest()


def encode(vectors: list[Vector]) -> bytes:
    """Return the lines of a corpus file."""
    return b"".join(msgspec.json.encode(vector) + b"\n" for vector in vectors)


def request(vector: Vector, seq: int) -> dict[str, Any]:
    """Return the protocol line that asks a vector's question, without the answer.

    Args:
        vector: the question.
        seq: number of the request.
    """
    asked = question(vector.kind, vector.scene, vector.state, vector.t_end, vector.collisions)
    return {"cmd": vector.kind, "seq": seq, **asked}


def question(
    cmd: str, scene: Scene | Mapping[str, Any], start: State | Sequence[State], t_end: float, n: int = 1
) -> dict[str, Any]:
    """Return a request of the protocol, all but its seq.

    Args:
        cmd: step, trajectory, flow or time.
        scene: a scene, or its data in the form of the protocol.
        start: the state; of a flow one or several.
        t_end: horizon [time]; a `time` request has none.
        n: number of collisions, of a trajectory or a `time` request.
    """
    starts = [start] if isinstance(start, State) else start
    states = [msgspec.structs.asdict(state) for state in starts]
    place: dict[str, Any] = {"states": states} if cmd == "flow" else {"state": states[0]}
    more = {"trajectory": {"collisions": n}, "time": {"collisions": n, "repeat": 1}}.get(cmd, {})
    end = {} if cmd == "time" else {"t_end": t_end}
    return {"cmd": cmd, "scene": wire_data(scene), **place, **more, **end}


def wire_data(scene: Scene | Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the data of a scene in the form of the protocol, or such data as they are."""
    return scene if isinstance(scene, Mapping) else to_data(scene)


@lru_cache(maxsize=4096)
def _scene(encoded: str) -> Scene:
    return from_data(json.loads(encoded))


def answer(vector: Vector, step: Stepper, follow: Follow, carry: Flowing) -> dict[str, Any]:
    """Ask a stepper of Python functions a vector; return its answer in the form of the protocol.

    Args:
        vector: the question.
        step: (scene, state, t_end) -> outcome.
        follow: (scene, state, collisions, t_end) -> collisions; the last entry may be another outcome.
        carry: (scene, states, t_end) -> outcome and first capture interval of each.
    """
    try:
        scene = _scene(json.dumps(vector.scene))
        if vector.kind == "step":
            return dict(msgspec.to_builtins(step(scene, vector.state, vector.t_end)))
        if vector.kind == "flow":
            arrivals = carry(scene, [vector.state], vector.t_end)
            return {"states": [{**msgspec.to_builtins(at), "captured": stay} for at, stay in arrivals]}
        return {"steps": msgspec.to_builtins(follow(scene, vector.state, vector.collisions, vector.t_end))}
    except BadInput as error:
        return dict(msgspec.to_builtins(Rejected(str(error))))


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of one line of the corpus, published as docs/vector.schema.json."""
    schema = msgspec.json.schema(Vector)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Vector", **schema}


def _read(name: str, path: Path | None) -> bytes:
    folder = resources.files("conformance") / "corpus" if path is None else path
    try:
        return (folder / name).read_bytes()
    except OSError as error:
        raise BadCorpus(f"corpus {name} cannot be read: {error.strerror}") from None


@cache
def _shipped(name: str, entry: File) -> list[Vector]:
    return _read_lines(name, entry, None)


def _read_lines(name: str, entry: File, path: Path | None) -> list[Vector]:
    data = _read(name, path)
    found = hashlib.sha256(data).hexdigest()
    if found != entry.sha256:
        raise BadCorpus(f"corpus {name}: sha256 = {found}, must be {entry.sha256}")
    vectors = []
    for number, line in enumerate(data.splitlines(), 1):
        try:
            vectors.append(_decoder.decode(line))
        except msgspec.DecodeError as error:
            raise BadCorpus(f"corpus {name}:{number}: {error}") from None
    if len(vectors) != entry.vectors:
        raise BadCorpus(f"corpus {name}: {len(vectors)} vectors, must be {entry.vectors}")
    return vectors


_decoder = msgspec.json.Decoder(Vector)

if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
