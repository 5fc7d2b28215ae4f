"""Symmetry transforms: every question is asked as one of its exact images, so that nobody passes by memory.

A transform is drawn from the run's seed: the mirror image in x, and lengths and times by powers of two. These
are symmetries of the billiard, so the certified answer is carried over without a rounding: the answer of the
implementation is transformed back to the question as it is published, and graded there.
Scales are drawn for a scene and not for a question, so that a scene stays one scene for a whole run.
"""

from typing import Any, NamedTuple

import msgspec

from conformance.cases.draw import Draw, leaves, readable
from conformance.cases.generated import FRESH
from conformance.vectors import NUMBERS, Vector
from scene import to_data, transforms

LARGEST = 12  # exponents of two are drawn between this and its negative
RANGE = 2.0**-350, 2.0**350  # numbers that a scale may lead to: their squares are far from both ends


class Transform(NamedTuple):
    """An exact symmetry of a question.

    Attributes:
        is_mirrored: x -> -x, left and right exchanged.
        length: lengths are multiplied by 2^length.
        time: times are multiplied by 2^time.
    """

    is_mirrored: bool = False
    length: int = 0
    time: int = 0

    def __str__(self) -> str:
        """Say what was asked in place of the question as published."""
        said = ["mirrored"] if self.is_mirrored else []
        said += [f"lengths x 2^{self.length}"] if self.length else []
        said += [f"times x 2^{self.time}"] if self.time else []
        return ", ".join(said) or "as published"

    def apply(self, vector: Vector) -> Vector:
        """Return the image of a question; its certified answers stay those of the question as published."""
        state, scene = vector.state, readable(vector.scene)
        if self.is_mirrored:
            state = transforms.mirrored(state)
        if scene is None or not (self.length or self.time):
            return msgspec.structs.replace(vector, state=state)
        return msgspec.structs.replace(
            vector,
            scene=to_data(transforms.scaled(scene, self.length, self.time)),
            state=transforms.scaled_state(state, self.length, self.time),
            t_end=vector.t_end * 2.0**self.time,
        )

    def restore(self, answer: Any, exponent: int = 0) -> Any:
        """Return an answer to the image of a question as one to the question as published.

        Args:
            answer: or a part of one.
            exponent: of the power of two that a number is multiplied with.
        """
        if isinstance(answer, list | tuple):
            return [self.restore(part, exponent) for part in answer]
        if not isinstance(answer, dict):
            return answer * 2.0**exponent if exponent and isinstance(answer, int | float) else answer
        exponents = dict.fromkeys(("dt", "t", "captured"), -self.time)
        exponents |= dict.fromkeys(("x", "y"), -self.length)
        exponents |= dict.fromkeys(("vx", "vy"), self.time - self.length)
        found = {name: self.restore(part, exponents.get(name, 0)) for name, part in answer.items()}
        if self.is_mirrored:
            found |= {name: -found[name] for name in ("x", "vx") if isinstance(found.get(name), float)}
            if isinstance(answer.get("wall"), str):
                found["wall"] = transforms.mirrored_wall(answer["wall"])
        return found


def draw_transform(vector: Vector, seed: int) -> Transform:
    """Draw the transform by which a vector is asked in the run of a seed; a fresh question needs none."""
    if vector.group == FRESH:
        return Transform()
    own, shared = Draw(f"{seed}/{vector.id}"), Draw(f"{seed}/{msgspec.json.encode(vector.scene).decode()}")
    is_mirrored = own.pick((False, True))
    exponents = [k for k in range(-LARGEST, LARGEST + 1) if k]
    length, time = shared.pick(exponents), shared.pick(exponents)
    if readable(vector.scene) is None or not _stays_in_range(vector, length, time):
        return Transform(is_mirrored)
    return Transform(is_mirrored, length, time)


def _stays_in_range(vector: Vector, length: int, time: int) -> bool:
    """Tell whether a scale leads to no number, asked or certified, that is near an end of binary64."""
    least, most = RANGE
    numbers = [*msgspec.structs.astuple(vector.state)[:5], vector.t_end]
    numbers += [number for _, number in leaves(vector.scene)]
    for step in (step for known in vector.expect for step in known.steps):
        numbers += [float(end) for name in NUMBERS for end in getattr(step, name)]
    factors = [2.0**k for k in (0, length, time, -time, length - time)]
    return all(least < abs(number) * factor < most for number in numbers if number for factor in factors)
