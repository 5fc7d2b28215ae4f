"""Ensembles that go on: the bits of all cycles at once, wherever they are cut, and who may not go on."""

from itertools import product

import numpy as np
import pytest
from msgspec.structs import replace

import fast
from fast import ensemble, pieces
from fast.kernel import follow
from fast.kernel.arithmetic import MAX_QUADRANT
from fast.kernel.records import BANG_BANG, CONSTANT
from fast.prepared import prepare
from scene import BadInput, BangBang, Cap, Fourier, Mushroom, load

TWICE = tuple(zip(map(float, range(9)), (1.0, 1.0, 0.3, 0.3, 1.0, 1.0, 0.3, 0.3, 1.0), strict=True))
BREATH = ((0.0, 1.0), (2.0, 1.0), (2.5, 1.25), (6.0, 1.25), (6.5, 1.0), (8.0, 1.0))
WAVE = Fourier(mean=1.0, omega=1.0, sin=(0.3,))
# By what is special in them: a cap alone is always unfolded, a mouth as wide as the cap captures nobody.
SCENES = {
    "moving cap": load("moving-cap"),
    "fixed cap": load("fixed-cap-clockwise"),
    "a cap alone": load("breathing-circle"),
    "a stem alone": load("fermi-ulam"),
    "ergodic": load("ergodic"),
    "frozen": load("frozen-mushroom"),
    "nu = 1 at rest": Mushroom(r=WAVE, h=1.0, nu=1.0, slope=0.0),
    "two narrowings": Mushroom(r=BangBang(knots=BREATH), h=1.0, nu=BangBang(knots=TWICE), slope=0.1),
    "many harmonics": Mushroom(
        r=Fourier(mean=1.0, omega=1.0, sin=(0.3, 0.0, 0.05)),
        h=Fourier(mean=1.0, omega=1.0, cos=(0.2, 0.1, 0.1)),
        nu=Fourier(mean=0.6, omega=1.0, cos=(0.2, 0.0, 0.1)),
        slope=Fourier(0.1, 1.0, (0.05,)),
    ),
    "narrowest at the end": Mushroom(
        r=1.0, h=1.0, nu=Fourier(mean=0.6, omega=1.0, cos=(-0.3,)), slope=Fourier(0.1, 1.0, (0.05,))
    ),
}


def in_goes(scene, cuts, **asked):
    found = None
    for n_cycles in cuts:
        found = fast.go_on(scene, n_cycles=n_cycles, before=found, **asked)
    return found


def cuts_of(random, most=8):
    """Draw after how many cycles a run is cut; it may be gone on with for no more cycles than it has."""
    n_cycles = int(random.integers(2, most + 1))
    return [*sorted(random.integers(1, n_cycles + 1, 3).tolist()), n_cycles]


def is_same(found, wanted):
    """Tell whether two runs are the same to the bit, also in what they would go on from."""
    ones, others = ((*run.ensemble[1:-2], run.lanes) for run in (found, wanted))
    pairs = zip(ones, others, strict=True)
    return all(one.tobytes() == other.tobytes() for one, other in pairs)


@pytest.mark.parametrize("name", SCENES)
def test_cycles_in_goes_are_those_at_once(name):
    scene, random = SCENES[name], np.random.default_rng(len(name))
    for energy in (0.01, 1.0, 40.0, 1500.0):  # at 0.01 a flight lasts for several stops, and pieces of laws
        cuts, phases = cuts_of(random), sorted(random.uniform(0.01, 0.99, 2).tolist())
        asked = {"n_particles": 80, "energy": energy, "seed": int(energy), "phases": phases}
        found = in_goes(scene, cuts, threads=1, **asked)
        assert is_same(found, fast.go_on(scene, n_cycles=cuts[-1], threads=2, **asked))
        assert found.ensemble.sha256() == fast.simulate(scene, n_cycles=cuts[-1], **asked).sha256()
        assert found.ensemble.ns_per_collision() > 0.0


def test_the_last_energy_is_known_however_the_horizon_is_rounded():
    """The last flight takes a cycle: its begin plus its length, rounded, may be just before the end."""
    h = ((0.0, 1.83), (0.24, 1.83), (0.63, 2.71), (0.77, 2.15), (1.0, 1.83))
    scene = Mushroom(r=1.0, h=BangBang(knots=h), nu=0.2)
    for n_cycles in (1, 2, 3):
        run = fast.simulate(scene, n_particles=200, energy=0.3, n_cycles=n_cycles, seed=1)
        assert np.isfinite(run.energy[run.outcome == 0]).all()


@pytest.mark.usefixtures("uncached")
@pytest.mark.parametrize("changes", [{"MAX_PIECES": 8}, {"IN_LANES": (CONSTANT, BANG_BANG)}], ids=str)
def test_cycles_in_goes_without_lanes(monkeypatch, changes):
    """Laws of too many pieces, or of a kind that lanes do not know: every step is a careful one."""
    wave = Fourier(mean=1.0, omega=1.0, sin=(0.3, 0.0, 0.05))  # three harmonics: in pieces
    asked = {"n_particles": 40, "energy": 30.0, "seed": 2}
    for limit, least in changes.items():
        monkeypatch.setattr(pieces, limit, least)
    for scene in (Mushroom(r=wave, h=1.0, nu=0.4, slope=0.1), Cap(r=wave)):
        found = in_goes(scene, (1, 2, 5), **asked)
        assert (found.ensemble.n_careful >= found.ensemble.n_collisions).all()
        assert is_same(found, fast.go_on(scene, n_cycles=5, **asked))


def test_who_cannot_go_on_is_followed_from_the_start(monkeypatch):
    """A lane that is not kept, or that on second sight has its collision before the last stop."""
    scene, asked = SCENES["moving cap"], {"n_particles": 60, "energy": 100.0, "seed": 6}
    one, three = (fast.go_on(scene, n_cycles=n, **asked) for n in (1, 3))
    lost = one._replace(lanes=one.lanes.copy())
    lost.lanes[::3] = np.nan
    assert is_same(fast.go_on(scene, n_cycles=3, before=lost, **asked), three)
    tied = one._replace(lanes=one.lanes.copy())
    is_right = tied.lanes[:, follow.IS_KNOWN] > 0
    assert is_right.any()
    tied.lanes[is_right, follow.FIRST_ROW] -= 0.25 * prepare(scene).cycle
    assert is_same(fast.go_on(scene, n_cycles=3, before=tied, **asked), three)
    monkeypatch.setattr(ensemble.records, "FOLLOW_ANEW", 99)  # nobody is followed anew
    found = fast.go_on(scene, n_cycles=3, before=tied, **asked)
    assert found.ensemble.sha256() != three.ensemble.sha256()


def test_no_number_of_a_lane_may_be_forgotten(monkeypatch):
    """Each is needed in some run. A last state, which has six of them, is thus not enough to go on from."""
    monkeypatch.setattr(ensemble.records, "FOLLOW_ANEW", 99)  # nobody is followed anew
    missed = set(range(follow.LANE_ROWS))
    for name in ("many harmonics", "fixed cap", "a cap alone"):
        scene, asked = SCENES[name], {"n_particles": 100, "energy": 3.0, "seed": 8, "phases": (0.3, 0.8)}
        one, three = (fast.go_on(scene, n_cycles=n, **asked) for n in (1, 3))
        assert is_same(fast.go_on(scene, n_cycles=3, before=one, **asked), three)
        for column, factor in product(sorted(missed), (0.0, 1.0 + 2.0**-40)):
            spoilt = one._replace(lanes=one.lanes.copy())
            spoilt.lanes[:, column] = factor * one.lanes[:, column] if factor else 0.0
            if not is_same(fast.go_on(scene, n_cycles=3, before=spoilt, **asked), three):
                missed.discard(column)
    assert missed == set()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"n_cycles": 1}, "n_cycles = 1, must be at least the 2 of before"),
        ({"n_particles": 5}, "before: n_particles = 4, must be 5"),
        ({"energy": 11.0}, "before: energy = 10.0, must be 11.0"),
        ({"phases": (0.25,)}, r"before: phases = \(0.5,\), must be \(0.25,\)"),
        ({"phases": ()}, r"before: phases = \(0.5,\), must be \(\)"),
        ({"first": -1}, "first = -1, must be 0 to"),
        ({"seed": 1}, "before: seed = 0, must be 1"),
        ({"first": 4}, "before: first = 0, must be 4"),
        ({"scene": load("moving-cap-reversed")}, r"before: r = Fourier\(.* must be Fourier\("),
    ],
)
def test_another_run_is_refused(changes, words):
    """Also one of the same shape: its particles would be gone on with, but for those followed anew."""
    asked = {"scene": SCENES["moving cap"], "n_particles": 4, "energy": 10.0, "phases": (0.5,)}
    two = fast.go_on(n_cycles=2, **asked)
    with pytest.raises(BadInput, match=words):
        fast.go_on(**{**asked, "n_cycles": 3, **changes}, before=two)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"n_particles": 3}, r"before: lanes has the shape \(1, (\d+)\), must have \(3, \1\)"),
        ({"energy": 11.0}, "before: energy = 10.0, must be 11.0"),
        ({"phases": (0.25, 0.5)}, r"before: ensemble.phase_energies has the shape \(1, 2, 1\)"),
        ({"phases": ()}, r"before: ensemble.phase_energies has the shape \(1, 2, 1\)"),
        ({"scene": SCENES["two narrowings"]}, r"before: ensemble.t_in has the shape \(1, 2, 1\), must have"),
    ],
)
def test_a_run_rebuilt_without_its_arguments_is_refused_by_its_arrays(changes, words):
    """Numpy would repeat the state of a single particle for all."""
    asked = {"scene": SCENES["moving cap"], "n_particles": 1, "energy": 10.0, "phases": (0.5,)}
    two = fast.go_on(n_cycles=2, **asked)._replace(asked=None)
    with pytest.raises(BadInput, match=words):
        fast.go_on(**{**asked, "n_cycles": 3, **changes}, before=two)


@pytest.mark.parametrize(
    ("part", "spoilt"),
    [
        ("lanes", lambda lanes: lanes[:, 1:]),
        ("lanes", lambda lanes: lanes[0]),
        ("lanes", lambda lanes: lanes.tolist()),
        ("asked", lambda asked: "moving-cap"),
        ("t_out", lambda t_out: t_out[:, :1]),
        ("t_in", lambda t_in: t_in[..., 0]),
        ("cycle_energies", lambda energies: energies[0]),
        ("phase_captured", lambda captured: captured[:1]),
        ("phase_energies", lambda energies: np.repeat(energies, 2, axis=2)),
    ],
)
def test_a_run_with_an_array_of_another_shape_is_refused(part, spoilt):
    asked = {"n_particles": 2, "energy": 10.0, "phases": (0.5,)}
    two = fast.go_on(SCENES["moving cap"], n_cycles=2, **asked)
    if part in ("lanes", "asked"):
        other = two._replace(**{part: spoilt(getattr(two, part))})
    else:
        found = {part: spoilt(getattr(two.ensemble, part))}
        other = two._replace(ensemble=two.ensemble._replace(**found))
    with pytest.raises(BadInput, match=f"before[: ].*({part} has the shape|what go_on has returned)"):
        fast.go_on(SCENES["moving cap"], n_cycles=3, **asked, before=other)


@pytest.mark.parametrize("kind", [float, np.float64, np.int32, np.uint64])
def test_whole_numbers_of_another_kind_are_taken(kind):
    asked = {"n_particles": 2, "energy": 10, "n_cycles": 1, "seed": 3, "first": 4, "threads": 1}
    given = {name: kind(value) for name, value in asked.items()}
    one = fast.go_on(SCENES["moving cap"], **given)
    wanted = fast.go_on(SCENES["moving cap"], **asked | {"n_cycles": 2})
    assert is_same(fast.go_on(SCENES["moving cap"], **given | {"n_cycles": kind(2)}, before=one), wanted)


def test_what_a_run_was_asked_for_is_kept_with_it_but_for_its_name():
    scene, asked = SCENES["moving cap"], {"n_particles": 4, "energy": 10.0}
    two = fast.go_on(scene, n_cycles=2, phases=(0.5,), **asked)
    for unlike in ({}, two.asked | {"phases": np.array([0.5, 0.6])}):
        with pytest.raises(BadInput, match=r"before: \w+ = .*, must be"):
            fast.go_on(scene, n_cycles=3, phases=(0.5,), **asked, before=two._replace(asked=unlike))
    renamed = replace(scene, name="mine")
    assert is_same(
        fast.go_on(renamed, n_cycles=3, phases=(0.5,), **asked, before=two),
        fast.go_on(scene, n_cycles=3, phases=(0.5,), **asked),
    )


def test_lanes_that_lose_the_laws_phases_are_not_gone_on_from():
    """A run at once would not have used them at all."""
    start = 0.125 * MAX_QUADRANT - 1.5
    law = BangBang(knots=((start, 1.0), (start + 0.5, 1.25), (start + 1.0, 1.0)))
    asked = {"n_particles": 4, "energy": 1e4}
    one = fast.go_on(Cap(r=law), n_cycles=1, **asked)
    assert (one.ensemble.n_careful < one.ensemble.n_collisions).any()
    with pytest.raises(BadInput, match="n_cycles = 2: beyond the time"):
        fast.go_on(Cap(r=law), n_cycles=2, before=one, **asked)
    two = fast.go_on(Cap(r=law), n_cycles=2, **asked)
    assert is_same(two, in_goes(Cap(r=law), (2, 2), **asked))
    asked["n_cycles"] = 3
    assert (
        fast.go_on(Cap(r=law), before=two, **asked).ensemble.sha256()
        == fast.simulate(Cap(r=law), **asked).sha256()
    )
