"""A family, a seed and a number name a question for ever: what each family has drawn so far is pinned.

A published name must not come to mean another question. So a family is changed by a new one beside it, and a
new family gets its line here: the failing test prints it. Nine digits are compared, since sines differ in
their last ones from system to system.
"""

import hashlib
import json
from typing import Any

import pytest

from conformance.cases.draw import Question
from conformance.cases.table import FAMILIES

N = 6  # questions of each family
PINNED: dict[str, str] = {
    "deep-waves": "69bcaa83e5598ed4",
    "anywhere": "55eda994c2951a41",
    "anywhere-cap-arc": "668ceb242d6c1e9f",
    "anywhere-cap-base": "a7b737129bfc1348",
    "anywhere-stem-base": "bb82d887469babe7",
    "anywhere-stem-left": "e23b6fc38cb4cbb9",
    "anywhere-stem-right": "46ba6d117686b876",
    "anywhere-stem-floor": "1f0f8ad6d00a35ba",
    "anywhere-mushroom-arc": "b6ef885ab9434647",
    "anywhere-mushroom-base": "ed538f4cfd6d0593",
    "anywhere-mushroom-left": "dc260562efd612e3",
    "anywhere-mushroom-right": "884a497730bc379b",
    "anywhere-mushroom-floor": "b850648bacfd103a",
    "returning-cap-arc": "8c3aa3cb4d107a88",
    "returning-stem-left": "8adfca72d15bdab7",
    "returning-stem-right": "d16ba89dbdc66208",
    "returning-stem-floor": "34f0b3992bd16e2c",
    "returning-mushroom-arc": "97c7269fcf6726b4",
    "returning-mushroom-left": "474f82671f2331a1",
    "returning-mushroom-right": "05b8795990162f70",
    "returning-mushroom-floor": "31ce04cf94894511",
    "many-knots-cap": "e68a2f6a1ebab009",
    "many-knots-stem": "9b2986348adeb423",
    "leaning-left": "6c5c99d584837fc6",
    "leaning-right": "c507280b9ad8a87b",
    "changed-mouth-base": "56c51ad9e48e226c",
    "changed-mouth-left": "323c27a66dded919",
    "changed-mouth-right": "93a365280320307c",
    "changed-mouth-floor": "b1dd2f2f62f3a638",
    "hurried": "0fcaff8bd08e5369",
    "from-the-base": "07446998284abb5e",
    "vibrating-cap": "6d0ef50be61f9942",
    "vibrating-stem": "51453d7db6ae1859",
    "bend-r-rate-fourier": "7de664d49d9a7d1d",
    "bend-r-rate-bang-bang": "9541bee82d771a66",
    "bend-r-bend-fourier": "bc83a87128a885e4",
    "bend-r-bend-bang-bang": "d7aa4fceafac8744",
    "bend-h-bend-fourier": "132010a12ab2e3ad",
    "bend-h-bend-bang-bang": "8697f82a1b70d1bc",
    "bend-w-bend-fourier": "a0b136361476750d",
    "bend-w-bend-bang-bang": "562100f7de0bc4ee",
    "bend-slope-bend-fourier": "7e20b2173eed1e33",
    "bend-slope-bend-bang-bang": "1a6fdc8bf65c4ced",
    "bend-slope-rate-fourier": "3e9453757550df42",
    "bend-slope-rate-bang-bang": "7205598bf7480c74",
    "bend-nu-bend-fourier": "e597c7c702a5bfc8",
    "bend-nu-bend-bang-bang": "a56a78f9a01e9c51",
    "bend-nu-rate-fourier": "969a75cbe7dc7c5b",
    "bend-nu-rate-bang-bang": "53004206982a35e2",
    "bend-nu-r-bend-fourier": "b72d50636420c477",
    "bend-nu-r-bend-bang-bang": "b27d36b768e63305",
    "brief-cap-arc": "122a6a9e1d63654c",
    "brief-stem-left": "63e38c4fa3d88091",
    "brief-stem-right": "7edacd423ed03d5e",
    "brief-stem-floor": "182c5354afd7ccd9",
    "brief-mushroom-arc": "e7aedf1e2956a2e5",
    "brief-mushroom-left": "d3f206caf2893b0a",
    "brief-mushroom-right": "bff536e33fc8c228",
    "brief-mushroom-floor": "3b47f46c622988aa",
    "thin-ring": "13cbccda06321993",
    "steep": "29ed926dcbd42e68",
    "growing-cap": "c21a876632ef479a",
    "growing-stem": "cd8ff20bda4292a5",
    "corner-start": "4803283b02cb5aa6",
    "corner-arrival": "7ad61b146d373958",
    "hit-at-end": "b8aaa86d14a07619",
    "knot-at-event": "2d1353aa2934e832",
    "across-a-knot": "e90392edfbbe1359",
    "tiny-slope": "093619d7e8dee291",
    "on-the-wall": "3f02bfd677b5f69e",
    "extreme-scale": "91e743e0403c3c6f",
    "rest-and-sweep": "9d5d705d9d76a71c",
    "slow-towards-waves": "6033a64acc14955f",
    "nearly-shut": "07062b95936d1e63",
    "all-but-gone": "83d9bfeaa07bfdbf",
}  # fmt: skip


def rounded(data: Any) -> Any:
    """Return data with nine digits of each number."""
    if isinstance(data, dict):
        return {name: rounded(part) for name, part in data.items()}
    if isinstance(data, list | tuple):
        return [rounded(part) for part in data]
    return f"{data:.9g}" if isinstance(data, float) else data


def asked(question: Question) -> str:
    """Return all that a question says, as text."""
    state = {name: getattr(question.state, name) for name in ("t", "x", "y", "vx", "vy", "wall")}
    filed = question.group, question.source, question.kind, question.collisions, question.also, question.level
    return json.dumps(rounded([*filed, question.wire_scene(), state, question.t_end, question.longest]))


def digest(name: str) -> str:
    texts = [asked(FAMILIES[name].question(f"2014/{index}")) for index in range(N)]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]


@pytest.mark.parametrize("name", FAMILIES)
def test_a_name_means_the_same_question_for_ever(name: str) -> None:
    assert f'"{name}": "{digest(name)}",' == f'"{name}": "{PINNED.get(name)}",'


def test_no_pinned_family_is_gone() -> None:
    assert PINNED.keys() <= FAMILIES.keys()
