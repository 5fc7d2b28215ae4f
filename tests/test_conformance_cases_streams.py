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
    "deep-waves": "8fc293d758668498",
    "anywhere": "83a7a0353ce74881",
    "anywhere-cap-arc": "650869f7a5d884a3",
    "anywhere-cap-base": "c6cc49508b4592a1",
    "anywhere-stem-base": "f0baefbc41809d7e",
    "anywhere-stem-left": "364699b759f44d0d",
    "anywhere-stem-right": "890ea5d563c67208",
    "anywhere-stem-floor": "6829c9be031c96c0",
    "anywhere-mushroom-arc": "a802520a0f17fbd1",
    "anywhere-mushroom-base": "39ec13a457451c3d",
    "anywhere-mushroom-left": "9d317e3a9d062762",
    "anywhere-mushroom-right": "62651a125d52c29d",
    "anywhere-mushroom-floor": "382db490475428f8",
    "returning-cap-arc": "9dc157d9a9a90d09",
    "returning-stem-left": "693fc6f490e08210",
    "returning-stem-right": "17b3bf7b704bda72",
    "returning-stem-floor": "4aaf84dcef37c6f7",
    "returning-mushroom-arc": "d454c5e453df6ffd",
    "returning-mushroom-left": "25ff4c3871528e74",
    "returning-mushroom-right": "a90d540e6fd8da58",
    "returning-mushroom-floor": "fa00277c51f3a11a",
    "many-knots-cap": "ed23c12950fb3670",
    "many-knots-stem": "46d5ce4c247b6c58",
    "leaning-left": "823f754b94e4fc43",
    "leaning-right": "1b8410fca267e819",
    "changed-mouth-base": "256e60836686ffb1",
    "changed-mouth-left": "a7097c67feee73b4",
    "changed-mouth-right": "6b41aa93c852eb78",
    "changed-mouth-floor": "11ce4f98065c0a4c",
    "hurried": "bed57343b1b31b39",
    "from-the-base": "83c04ae93ed84035",
    "vibrating-cap": "bafa274db1df8316",
    "vibrating-stem": "45d4e7b65843ca62",
    "bend-r-rate-fourier": "f77c2796449aae04",
    "bend-r-rate-bang-bang": "b3d34c4817341ce8",
    "bend-r-bend-fourier": "6a9980d7a95e7243",
    "bend-r-bend-bang-bang": "49399af995ca36a9",
    "bend-h-bend-fourier": "6971c41b418ca099",
    "bend-h-bend-bang-bang": "d98e7d1b50889918",
    "bend-w-bend-fourier": "ed9e4edc19515f59",
    "bend-w-bend-bang-bang": "c2a50bfcfe007e7b",
    "bend-slope-bend-fourier": "dee1aafcd8d7e86e",
    "bend-slope-bend-bang-bang": "7151b1faaad0be20",
    "bend-slope-rate-fourier": "adc6693d4b10d589",
    "bend-slope-rate-bang-bang": "8d4e72a50a6bb01a",
    "bend-nu-bend-fourier": "aac559b78688ff90",
    "bend-nu-bend-bang-bang": "efb5b2f74f1a11ab",
    "bend-nu-rate-fourier": "3983469a57f181f9",
    "bend-nu-rate-bang-bang": "dd374346911ced63",
    "bend-nu-r-bend-fourier": "cef6a7295b294ee7",
    "bend-nu-r-bend-bang-bang": "949a6752edde599b",
    "brief-cap-arc": "690cbe11cda069cb",
    "brief-stem-left": "f75697194112f375",
    "brief-stem-right": "59d2305404254c24",
    "brief-stem-floor": "735ae6d41d107848",
    "brief-mushroom-arc": "3a386fb6415bbf1e",
    "brief-mushroom-left": "152479812eef492e",
    "brief-mushroom-right": "62722164c746ed2b",
    "brief-mushroom-floor": "a25ff2ec85f46dd8",
    "thin-ring": "16a037cb868324e8",
    "steep": "b5c1ab3cff5a2599",
    "growing-cap": "77c99e4d7fe2b497",
    "growing-stem": "2fcd0d80fe7bdf44",
    "corner-start": "501bea13cc0d54b9",
    "corner-arrival": "a12bc1760654ae87",
    "hit-at-end": "663bdd0215170274",
    "knot-at-event": "7755646ca9b5cbe2",
    "across-a-knot": "23935d52adc6c678",
    "tiny-slope": "0647621604e3d46a",
    "on-the-wall": "28d6c37a476e92bc",
    "extreme-scale": "fb54f7dba1d8a1ba",
    "rest-and-sweep": "bfd18fb26b3a9399",
    "slow-towards-waves": "6798c0774eed5daf",
    "nearly-shut": "d121fad4fd196985",
    "all-but-gone": "7cf9e36d14bfa503",
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
    filed = question.group, question.source, question.kind, question.collisions, question.level
    return json.dumps(rounded([*filed, question.wire_scene(), state, question.t_end, question.longest]))


def digest(name: str) -> str:
    texts = [asked(FAMILIES[name].question(f"2014/{index}")) for index in range(N)]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]


@pytest.mark.parametrize("name", FAMILIES)
def test_a_name_means_the_same_question_for_ever(name: str) -> None:
    assert f'"{name}": "{digest(name)}",' == f'"{name}": "{PINNED.get(name)}",'


def test_no_pinned_family_is_gone() -> None:
    assert PINNED.keys() <= FAMILIES.keys()
