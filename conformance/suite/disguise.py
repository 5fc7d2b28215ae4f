"""Disguises: every question is asked as one of its exact images, so that nobody passes by memory.

A disguise is drawn from the run's seed: the mirror image in x, lengths and times by powers of two, and
bang-bang knots that begin at another knot, whole periods away, with several periods written down as one. The
law of motion is the same function after the last two, and the others are symmetries of the billiard, so the
certified answer is carried over without a rounding: the implementation's answer is taken back to the question
as it is published, and graded there.
Scales are drawn for a scene and not for a question, so that a scene stays one scene for a whole run.

Beside its vectors a run asks `drawn` questions, whose answers are in no file: a flight that is certified to
meet its first wall after dt meets nothing before, so that at any earlier t_end the particle is at the
exact place x + vx s, y + vy s. `cases.generated` draws questions in scenes that no file holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import msgspec

from conformance.cases.draw import Draw
from conformance.cases.generated import GROUP as FRESH
from conformance.grading.error import condition_number, free_flight, inputs_of, moved
from conformance.vectors import NUMBERS, Expectation, Vector, certified
from scene import BadInput, BangBang, Fourier, Scene, from_data, to_data, transforms
from scene.given import MAX_HARMONICS, MAX_KNOTS
from scene.tables import laws

LARGEST = 12  # exponents of two are drawn between this and its negative
RANGE = 2.0**-350, 2.0**350  # numbers that a scale may lead to: their squares are far from both ends
ROUNDS = 1, 2, 3, 6  # the corpus itself has at most four legs
DRAWN, N_DRAWN = "drawn", 60  # a group of questions, and how many it has
PARTS = 0.05, 0.95  # of the certified flight, at which the particle is asked for


class Disguise(NamedTuple):
    """An exact symmetry of a question.

    Attributes:
        is_mirrored: x -> -x, left and right exchanged.
        length: lengths are multiplied by 2^length.
        time: times are multiplied by 2^time.
        first_knot: bang-bang laws begin at this knot, counted from 0.
        periods: and so many whole periods later.
        rounds: so many of their periods are written as one; a Fourier law beside them has a period as long.
    """

    is_mirrored: bool = False
    length: int = 0
    time: int = 0
    first_knot: int = 0
    periods: int = 0
    rounds: int = 1

    def __str__(self) -> str:
        """Say what was asked in place of the question as published."""
        said = ["mirrored"] if self.is_mirrored else []
        said += [f"lengths x 2^{self.length}"] if self.length else []
        said += [f"times x 2^{self.time}"] if self.time else []
        if self.first_knot or self.periods:
            said.append(f"knots from number {self.first_knot} on, {self.periods} periods later")
        said += [f"{self.rounds} periods written as one"] if self.rounds > 1 else []
        return ", ".join(said) or "as published"


def drawn_disguise(vector: Vector, seed: int) -> Disguise:
    """Draw the symmetry by which a vector is asked in the run of a seed; what is fresh needs none."""
    if vector.group == FRESH:
        return Disguise()
    own, shared = Draw(f"{seed}/{vector.id}"), Draw(f"{seed}/{msgspec.json.encode(vector.scene).decode()}")
    is_mirrored = own.pick((False, True))
    scene = _scene(vector)
    exponents = [k for k in range(-LARGEST, LARGEST + 1) if k]
    length, time = shared.pick(exponents), shared.pick(exponents)
    if scene is None or not _stays_in_range(vector, length, time):
        return Disguise(is_mirrored=True)
    first_knot, periods = shared.pick(range(8)), shared.pick((-1, 0, 1))
    rounds = shared.pick(ROUNDS)
    if any(isinstance(law, BangBang) for law in laws(scene).values()):
        for knots in ((first_knot, periods, rounds), (first_knot, periods, 1)):
            if _with_knots(scene, *knots):
                return Disguise(is_mirrored, length, time, *knots)
    return Disguise(is_mirrored, length, time)


def asked(vector: Vector, disguise: Disguise) -> Vector:
    """Return the question in disguise; its certified answers are still those of the question as published."""
    state, scene = vector.state, _scene(vector)
    if disguise.is_mirrored:
        state = transforms.mirrored(state)
    if scene is None or disguise._replace(is_mirrored=False) == Disguise():
        return msgspec.structs.replace(vector, state=state)
    scene = _with_knots(scene, disguise.first_knot, disguise.periods, disguise.rounds) or scene
    scene = transforms.scaled(scene, disguise.length, disguise.time)
    return msgspec.structs.replace(
        vector,
        scene=to_data(scene),
        state=transforms.scaled_state(state, disguise.length, disguise.time),
        t_end=vector.t_end * 2.0**disguise.time,
    )


def published(answer: Any, disguise: Disguise) -> Any:
    """Return an answer to the question in disguise as one to the question as published."""
    if isinstance(answer, list | tuple):
        return [published(part, disguise) for part in answer]
    if not isinstance(answer, dict):
        return answer
    exponents = dict.fromkeys(("dt", "t", "captured"), -disguise.time)
    exponents |= dict.fromkeys(("x", "y"), -disguise.length)
    exponents |= dict.fromkeys(("vx", "vy"), disguise.time - disguise.length)
    found = {
        name: _scaled(published(part, disguise), exponents.get(name, 0)) for name, part in answer.items()
    }
    if disguise.is_mirrored:
        found |= {name: -found[name] for name in ("x", "vx") if isinstance(found.get(name), float)}
        if isinstance(answer.get("wall"), str):
            found["wall"] = transforms.mirrored_wall(answer["wall"])
    return found


def drawn_horizons(vectors: Sequence[Vector], seed: int) -> list[Vector]:
    """Draw questions that no file holds: certified flights, asked for at a time before their end."""
    draw = Draw(f"{seed}/drawn")
    usable = [v for v in vectors if v.kind == "step" and [e.outcome for e in v.expect] == ["collision"]]
    found: list[Vector] = []
    for _ in range(2 * N_DRAWN if usable else 0):
        early = _before_the_hit(draw.pick(usable), draw.between(*PARTS), len(found) + 1)
        found += [early] if early is not None else []
    return found[:N_DRAWN]


def _scene(vector: Vector) -> Scene | None:
    """Return a vector's scene; None where it is a bad one, which is to be refused."""
    try:
        return from_data(vector.scene)
    except BadInput:
        return None


def _stays_in_range(vector: Vector, length: int, time: int) -> bool:
    """Tell whether a scale leads to no number, asked or certified, that is near an end of binary64."""
    least, most = RANGE
    state = vector.state
    numbers = [state.t, state.x, state.y, state.vx, state.vy, vector.t_end, *_leaves(vector.scene)]
    for step in (step for known in vector.expect for step in known.steps):
        numbers += [float(end) for name in NUMBERS for end in getattr(step, name)]
    factors = [2.0**k for k in (0, length, time, -time, length - time)]
    return all(least < abs(number) * factor < most for number in numbers if number for factor in factors)


def _leaves(data: Any) -> Iterable[float]:
    if isinstance(data, dict | list | tuple):
        for part in data.values() if isinstance(data, dict) else data:
            yield from _leaves(part)
    elif isinstance(data, int | float):
        yield float(data)


def _scaled(part: Any, exponent: int) -> Any:
    """Return a number, or a list of numbers, times a power of two; what is none stays as it is."""
    if isinstance(part, list) and exponent:
        return [_scaled(one, exponent) for one in part]
    return part * 2.0**exponent if exponent and isinstance(part, int | float) else part


def _with_knots(scene: Scene, first: int, periods: int, rounds: int) -> Scene | None:
    """Return the scene with its bang-bang laws begun at another knot, and periods written as one.

    None where a knot would be rounded, or a Fourier law beside them have too many harmonics.
    """
    changed: dict[str, Any] = {}
    for name, law in laws(scene).items():
        changed[name] = law
        if isinstance(law, BangBang):
            changed[name] = _begun_at(law, first, periods, rounds)
        elif isinstance(law, Fourier) and rounds > 1:
            changed[name] = _in_rounds(law, rounds)
    return None if None in changed.values() else type(scene)(**changed)


def _begun_at(law: BangBang, first: int, periods: int, rounds: int) -> BangBang | None:
    """Return the same law with knots from number `first` (modulo their count) on, whole periods later."""
    legs, times = len(law.knots) - 1, [Fraction(t) for t, _ in law.knots]
    numbers = range(first % legs, first % legs + rounds * legs + 1)
    moved_times = [times[i % legs] + (i // legs + periods) * (times[-1] - times[0]) for i in numbers]
    if len(moved_times) > MAX_KNOTS or any(Fraction(float(t)) != t for t in moved_times):
        return None
    return BangBang(
        knots=tuple((float(t), law.knots[i % legs][1]) for i, t in zip(numbers, moved_times, strict=True))
    )


def _in_rounds(law: Fourier, rounds: int) -> Fourier | None:
    """Return the same law with a period `rounds` times as long: harmonic k becomes harmonic rounds k."""
    if law.period is None or rounds * max(len(law.cos), len(law.sin)) > MAX_HARMONICS:
        return None  # a law without a period has none in common with knots: it stands still
    cos, sin = (tuple(x for a in given for x in (*[0.0] * (rounds - 1), a)) for given in (law.cos, law.sin))
    longer = rounds * law.period
    if Fraction(longer) != rounds * Fraction(law.period):
        return None
    return Fourier(mean=law.mean, period=longer, cos=cos, sin=sin)


def _before_the_hit(vector: Vector, part: float, number: int) -> Vector | None:
    """Return a vector's question with t_end within its certified flight; None where none fits."""
    state, step = vector.state, vector.expect[0].steps[0]
    t_end = state.t + part * float(step.ends("dt")[0])
    s = Fraction(t_end) - Fraction(state.t)
    if not 0 < s < step.ends("dt")[0]:
        return None
    place = {"x": Fraction(state.x) + Fraction(state.vx) * s, "y": Fraction(state.y) + Fraction(state.vy) * s}
    numbers = {"dt": s, **place, "vx": Fraction(state.vx), "vy": Fraction(state.vy)}
    centre, jacobian = [float(numbers[name]) for name in NUMBERS], free_flight(state, float(s))
    inputs = inputs_of(state)
    step = certified({n: (v, v) for n, v in numbers.items()}, [moved(row, inputs) for row in jacobian], None)
    return msgspec.structs.replace(
        vector,
        id=f"{DRAWN}/{number}",
        group=DRAWN,
        rule=f"{vector.id} at a time before its hit",
        t_end=t_end,
        expect=(Expectation("horizon", (step,)),),
        condition=condition_number(centre, jacobian, inputs),
    )
