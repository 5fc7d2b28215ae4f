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

N = 10  # questions of each family
PINNED: dict[str, str] = {
    "deep-waves": "150bd009e5412e70",
    "anywhere": "374541b827e42d4b",
    "anywhere-cap-arc": "f63756a2ec76c075",
    "anywhere-cap-base": "8713e6b3113f5d82",
    "anywhere-stem-base": "5a88284d1716649b",
    "anywhere-stem-left": "63276be9c9176638",
    "anywhere-stem-right": "f9978887131939c0",
    "anywhere-stem-floor": "72cb6ea138235a30",
    "anywhere-mushroom-arc": "576affc296e6f9ed",
    "anywhere-mushroom-base": "f3ce19784c21c356",
    "anywhere-mushroom-left": "88d44e5b4fe4205a",
    "anywhere-mushroom-right": "e43088cae6de924d",
    "anywhere-mushroom-floor": "815f2740fc08b4f3",
    "returning-cap-arc": "96cbb3db466edec4",
    "returning-stem-left": "90072147d50428fb",
    "returning-stem-right": "50c237cc335e9409",
    "returning-stem-floor": "8d1ae11cd1ff5a42",
    "returning-mushroom-arc": "22f5a1a93b105f6f",
    "returning-mushroom-left": "51c371dcc4099184",
    "returning-mushroom-right": "040e94bf7e335c7e",
    "returning-mushroom-floor": "32618cc52e5ff0ca",
    "many-knots-cap": "9b4a49def10099db",
    "many-knots-stem": "447218be79049c08",
    "leaning-left": "3dad563042ef18e0",
    "leaning-right": "9f6c1b10d4df9708",
    "changed-mouth-base": "25726e2fbf1d1df5",
    "changed-mouth-left": "3b71f050d6032094",
    "changed-mouth-right": "7645336dee7b9253",
    "changed-mouth-floor": "ba9ca46c7faeb381",
    "hurried": "d947d23384e61508",
    "from-the-base": "e9da8b4331fa7d02",
    "vibrating-cap": "8873c85a95d82501",
    "vibrating-stem": "197750755cda005e",
    "bend-r-rate-fourier": "3e7cc17d1869a938",
    "bend-r-rate-bang-bang": "c35ad466d0dabdcb",
    "bend-r-bend-fourier": "ef89b1c8d3098b10",
    "bend-r-bend-bang-bang": "d76b96247b60d9ba",
    "bend-h-bend-fourier": "09a203547e8d151e",
    "bend-h-bend-bang-bang": "e6a09c261364b95c",
    "bend-w-bend-fourier": "27a8c1c0b17e77cb",
    "bend-w-bend-bang-bang": "4942ea61348f708a",
    "bend-slope-bend-fourier": "e3ab360a45692770",
    "bend-slope-bend-bang-bang": "f51cd07cfec8e1c6",
    "bend-slope-rate-fourier": "c1739479f9266477",
    "bend-slope-rate-bang-bang": "fe5518c6c3d776e9",
    "bend-nu-bend-fourier": "deeedc905c974e40",
    "bend-nu-bend-bang-bang": "36ebcc0abceb46fe",
    "bend-nu-rate-fourier": "1497e941e6adba81",
    "bend-nu-rate-bang-bang": "8325a43f39fbab4f",
    "bend-nu-r-bend-fourier": "183a3de870cfadcd",
    "bend-nu-r-bend-bang-bang": "29fb11b0d0187c66",
    "brief-cap-arc": "ab6e21bf3368502f",
    "brief-stem-left": "62e43050c061dbea",
    "brief-stem-right": "b53c57c30ee6e901",
    "brief-stem-floor": "e20fab884e0185ad",
    "brief-mushroom-arc": "5f0ee68b3f317ce3",
    "brief-mushroom-left": "82a8d7eb41098600",
    "brief-mushroom-right": "c0a10b0cf3155874",
    "brief-mushroom-floor": "e273af684096aa77",
    "thin-ring": "a8c25757cd8e9542",
    "steep": "7aabde4d95483f2a",
    "growing-cap": "2b42f955525f133a",
    "growing-stem": "ab62c2ec8db0b2b6",
    "corner-start": "90b914779351ca30",
    "corner-arrival": "c740365a25560f7f",
    "hit-at-end": "d5d6ed1f81521567",
    "knot-at-event": "1e12aa76f6317549",
    "across-a-knot": "e3d398f8ca371997",
    "tiny-slope": "94cf63cfda7700b5",
    "on-the-wall": "c8a8ae92420acba0",
    "extreme-scale": "5a176c8a9d1234bc",
    "rest-and-sweep": "48c4f24b01d5ca51",
    "slow-towards-waves": "9fc8b1775bf43691",
    "nearly-shut": "701050a3d94cc690",
    "all-but-gone": "e4051e5c6b8dc45f",
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
