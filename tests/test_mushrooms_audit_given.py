"""An ensemble of another program: how its file is read, what it is held to, and which cause is named.

Ensembles are drawn from theory, or written by hand: no engine runs here.
"""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
import zarr
from mpmath import fp
from support.refusals import one_line

import theory
from mushrooms.audit import ensemble_checks as audited, ensemble_command, ensemble_table
from mushrooms.audit.claim import Check
from mushrooms.audit.ensemble_checks import (
    CAPTURED,
    FREE,
    IDENTITY,
    OUTWARD,
    PEAK,
    RELEASE,
    SHARE,
    STARTS,
    TIMES,
    GivenEnsemble,
    HighEnergies,
    checks,
    cycle_start,
    expected,
    likely_causes,
    nu_at,
    reversal,
)  # fmt: skip
from mushrooms.audit.ensemble_command import EnsembleAudit
from mushrooms.audit.ensemble_table import Reading
from scene import Fourier, Mushroom, load
from scene.geometry import table_at

SCENE, ENERGY = load("moving-cap"), 1e6
CLOCK = load("fixed-cap-anticlockwise")  # of period 1
THEIRS = expected(SCENE, ENERGY)
OWN = Mushroom(r=1.0, h=Fourier(1.0, 1.0, (), (0.3,)), nu=Fourier(0.7, 1.0, (0.3,)), slope=0.0)
PLAIN = Reading(ENERGY, "v2/2", None, None)
SPAN = 2 * math.pi


def drawn(n: int = 4000, seed: int = 1) -> GivenEnsemble:
    """Draw one cycle of n particles from theory, with the capture intervals that go with it."""
    masses, random = THEIRS.point_masses, np.random.default_rng(seed)
    i = random.choice(len(masses.weight), n, p=masses.weight / masses.weight.sum())
    width = np.sqrt(np.maximum(masses.variance[i], 0))
    s = float(theory.predict(SCENE).log_e_nc) + masses.gain[i] + masses.shift[i]
    s = s + width * random.standard_normal(n)
    t_in = np.where(masses.is_free[i], np.nan, masses.t_in[i])
    curve = theory.capture_curve(SCENE, 2001)
    return GivenEnsemble(
        SCENE,
        ENERGY,
        s,
        captured=~masses.is_free[i],
        t_in=t_in,
        t_out=np.interp(t_in, curve.t_in, curve.t_out),
    )


RIGHT = drawn()


def failing(found: list[Check]) -> list[str]:
    return [check.what for check in found if check.holds is False]


def test_an_ensemble_of_the_theory_passes_every_figure_and_has_no_cause():
    found = checks(RIGHT, THEIRS)
    assert failing(found) == []
    assert {SHARE, PEAK, FREE, CAPTURED, TIMES, RELEASE, IDENTITY} <= {check.what for check in found}
    assert likely_causes(RIGHT, THEIRS, found) == []


def test_figures_are_those_of_the_sample_and_the_theory():
    found = {check.what: check for check in checks(RIGHT, THEIRS)}
    s, free, left = RIGHT.s, RIGHT.s[~RIGHT.captured], THEIRS.theory_error
    for what, values, wanted, band in (
        ("m1: mean of log E1/E0", s, THEIRS.mean_s, left.mean_s),
        (IDENTITY, np.exp(-s), float(THEIRS.mean_of_exp(-1)), left.mean_s),
        (SHARE, ~RIGHT.captured, THEIRS.p_nc, left.p_nc),
        (PEAK, free, THEIRS.peak[0], left.peak_mean),
    ):
        check = found[what]
        assert check.value == pytest.approx(np.mean(values))
        assert check.error == pytest.approx(np.std(values) / len(values) ** 0.5, rel=2e-3)
        assert float(check.expected) == pytest.approx(wanted, rel=1e-8)
        assert check.band == pytest.approx(band)
    assert found[SHARE].against == "nobody is captured"
    assert found[SHARE].power == pytest.approx(1.0)
    assert found["m1: mean of log E1/E0"].against == "no growth"
    width = found["width of their peak"]
    sigma = THEIRS.peak[1] ** 0.5
    assert (width.value, float(width.expected)) == (pytest.approx(free.std(ddof=1)), pytest.approx(sigma))
    assert width.band == pytest.approx(sigma * left.variance / 2)
    t_in = RIGHT.t_in[RIGHT.captured]
    gap = nu_at(SCENE, RIGHT.t_out[RIGHT.captured]) - nu_at(SCENE, t_in)
    assert found[RELEASE].value == pytest.approx(gap.mean(), abs=1e-9)
    assert found[RELEASE].band == pytest.approx(4 * 2 * 1.5 / (2 * ENERGY) ** 0.5 * 0.4, rel=1e-3)


def test_where_nobody_can_be_captured_no_rival_says_so():
    theirs = expected(load("ergodic"), ENERGY)
    s = theirs.draw(1, 500, 1)[:, 0]
    given = GivenEnsemble(load("ergodic"), ENERGY, s, captured=np.zeros(500, bool), t_in=np.full(500, np.nan))
    found = {check.what: check for check in checks(given, theirs)}
    assert (found[SHARE].against, found[SHARE].power) == ("", None)
    assert failing(list(found.values())) == []
    assert likely_causes(given, theirs, wrongly("m1")) == []


FEW = 19  # particles of which nothing is said


@pytest.mark.parametrize("n", [FEW, FEW + 1])
def test_of_few_particles_of_a_group_nothing_is_said(n):
    some = np.zeros(200, bool)
    some[:n] = True
    for captured, group in ((some, CAPTURED), (~some, PEAK)):
        given = GivenEnsemble(SCENE, ENERGY, RIGHT.s[:200], captured=captured)
        assert (group in {check.what for check in checks(given, THEIRS)}) == (n > FEW)


def test_what_is_not_told_is_not_asked():
    whats = {check.what for check in checks(GivenEnsemble(SCENE, ENERGY, RIGHT.s), THEIRS)}
    assert whats.isdisjoint((SHARE, PEAK, FREE, CAPTURED, TIMES, RELEASE, STARTS, OUTWARD))
    alone = GivenEnsemble(SCENE, ENERGY, RIGHT.s, t_in=RIGHT.t_in)
    whats = {check.what for check in checks(alone, THEIRS)}
    assert TIMES in whats
    assert RELEASE not in whats
    x, y = uniform_starts()
    for half in ({"x0": x}, {"y0": y}):
        whats = {check.what for check in checks(RIGHT._replace(**half), THEIRS)}
        assert whats.isdisjoint((STARTS, OUTWARD))


def uniform_starts(n: int = 3000):
    """Draw places uniform in the table at the begin of a cycle."""
    random, now = np.random.default_rng(3), table_at(fp, SCENE, cycle_start(SCENE))
    x, y = random.uniform(-now.r, now.r, 9 * n), random.uniform(-now.h, now.r, 9 * n)
    inside = np.where(y > 0, np.hypot(x, y) < now.r, np.abs(x) < now.half_width(y))
    return x[inside][:n], y[inside][:n]


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        (lambda x, y: (x, y), []),
        (lambda x, y: (x, np.where(np.arange(len(y)) % 3, y, np.abs(y))), [STARTS, OUTWARD]),
        (lambda x, y: (x / np.hypot(x, y), np.abs(y) / np.hypot(x, y)), [STARTS, OUTWARD]),
    ],
)
def test_starts_are_held_to_the_area(change, wrong):
    x, y = change(*uniform_starts())
    given = RIGHT._replace(x0=x, y0=y)
    found = {check.what: check for check in checks(given, THEIRS)}
    now = table_at(fp, SCENE, cycle_start(SCENE))
    share = float(now.cap_area() / (now.cap_area() + now.stem_area()))
    assert float(found[STARTS].expected) == pytest.approx(share)
    assert found[STARTS].value == pytest.approx(np.mean(y > 0))
    assert found[OUTWARD].value == pytest.approx(np.mean((x**2 + y**2)[y > 0]) / float(now.r) ** 2)
    failed = failing(list(found.values()))
    assert set(failed) <= set(wrong)
    assert bool(failed) == bool(wrong)
    causes = likely_causes(given, THEIRS, list(found.values()))
    assert ("starts are not uniform in area" in " ".join(causes)) == bool(wrong)


def test_a_scene_without_rates_has_the_limit_and_a_guess_of_what_is_left():
    theirs = expected(OWN, ENERGY)
    assert isinstance(theirs, HighEnergies)
    found = theory.predict(OWN, 12)
    assert (theirs.mean_s, theirs.p_nc) == pytest.approx((float(found.m1), float(found.p_nc)))
    assert theirs.peak == pytest.approx((float(found.log_e_nc), 0.0))
    # The mouth's half-width 0.7 + 0.3 cos t and the depth move at 0.3 at most.
    guess = (0.3 / (2 * ENERGY) ** 0.5) ** (2 / 3)
    assert theirs.theory_error[:4] == pytest.approx((guess,) * 4)
    assert audited.shape_band(theirs) == pytest.approx(guess)
    assert theirs.mean_of_exp(-1) == 1.0
    s = np.array([-9.0, 9.0])
    for cdf in (theirs.cdf, theirs.captured_cdf, theirs.free_cdf):
        assert cdf(s) == pytest.approx([0, 1], abs=1e-6)
    assert theirs.free_cdf(np.array([theirs.peak[0] - 1e-9, theirs.peak[0]])).tolist() == [0, 1]
    middle = np.linspace(-1, 1, 9)
    mixed = theirs.p_nc * theirs.free_cdf(middle) + (1 - theirs.p_nc) * theirs.captured_cdf(middle)
    assert mixed == pytest.approx(theirs.cdf(middle), abs=1e-6)
    begin = cycle_start(OWN)
    ends = theirs.capture_cdf(np.array([begin, begin + OWN.period / 2, begin + OWN.period]))
    assert ends == pytest.approx([0, 1, 1], abs=2e-3)  # the mouth narrows in the first half
    fast = expected(OWN, 4 * ENERGY)
    assert fast.theory_error.mean_s == pytest.approx(guess / 4 ** (1 / 3))


@pytest.mark.parametrize("n_lost", [4, 5])
def test_a_thousandth_of_the_particles_may_be_lost(n_lost):
    given = GivenEnsemble(SCENE, ENERGY, RIGHT.s[: 4000 - n_lost], n_lost=n_lost)
    [lost] = [check for check in checks(given, THEIRS) if check.what == "every particle has an energy"]
    assert lost.holds is (n_lost == 4)
    told = " ".join(likely_causes(given, THEIRS, checks(given, THEIRS)))
    assert ("of the particles are missing" in told) is (n_lost == 5)


def wrongly(*whats: str) -> list[Check]:
    """Return checks that fail by name."""
    return [Check(what, False, "0") for what in whats]


ODD = np.where(np.arange(4000) % 2, RIGHT.s + 3.0, RIGHT.s - 5.0)  # of no known mistake


@pytest.mark.parametrize(
    ("s", "wrong", "named"),
    [
        (ODD, (IDENTITY, PEAK, FREE), True),
        (ODD, (IDENTITY, PEAK, FREE, "m1"), True),
        (ODD, (IDENTITY, PEAK), False),
        (ODD, ("m1",), False),
        (-RIGHT.s, (IDENTITY, PEAK, FREE), False),  # a known mistake fits
        (RIGHT.s, (IDENTITY, PEAK, FREE), False),  # the energies are right
    ],
)
def test_the_bounce_is_named_where_all_its_signs_are_there_and_nothing_else_fits(s, wrong, named):
    causes = likely_causes(RIGHT._replace(s=s), THEIRS, wrongly(*wrong))
    assert (causes == [audited.BOUNCE]) is named


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (np.negative, "s has the wrong sign"),
        (np.exp, "E1/E0 is given in place of its logarithm"),
        (np.expm1, "E1/E0 - 1 is given in place of log E1/E0"),
        (lambda s: s / 2, "speeds are given in place of energies"),
        (lambda s: s / math.log(10), "a logarithm to base 10"),
    ],
)
def test_a_change_of_the_numbers_is_named_first_and_two_causes_at_most(change, words):
    given = GivenEnsemble(SCENE, ENERGY, change(RIGHT.s))
    causes = likely_causes(given, THEIRS, wrongly("m1"))
    assert words in causes[0]
    assert len(causes) <= 2


def test_a_cycle_that_was_run_backwards_is_named():
    turned = theory.at_energy(load("moving-cap-reversed"), ENERGY).draw(1, 4000, 2)[:, 0]
    causes = likely_causes(GivenEnsemble(SCENE, ENERGY, turned), THEIRS, wrongly("m1"))
    assert "the cycle was run backwards" in causes[0]


def test_groups_that_are_left_out_are_named():
    for kept, words in (
        (~RIGHT.captured, "only the never captured are there"),
        (RIGHT.captured, "only the captured"),
    ):
        causes = likely_causes(GivenEnsemble(SCENE, ENERGY, RIGHT.s[kept]), THEIRS, wrongly("m1"))
        assert words in " ".join(causes)
    some = RIGHT.captured | (np.arange(4000) % 2 == 0)  # half of the never captured are lost
    for told in (None, RIGHT.captured[some]):
        given = GivenEnsemble(SCENE, ENERGY, RIGHT.s[some], captured=told)
        causes = " ".join(likely_causes(given, THEIRS, wrongly("m1", SHARE)))
        assert f"where theory has {THEIRS.p_nc:.1%}, both with the right energies" in causes
        share = float(causes.split("never captured ")[1].split("%")[0]) / 100
        assert share == pytest.approx(np.mean(~RIGHT.captured[some]), abs=0.03)
    given = RIGHT._replace(s=RIGHT.s[some], captured=RIGHT.captured[some])
    causes = likely_causes(given, THEIRS, wrongly("m1", SHARE, CAPTURED))
    assert "both with the right energies" not in " ".join(causes)  # one group is not as it should be


def ending(at: float, share: float) -> GivenEnsemble:
    """Return captures of which a share ends at one part of the cycle, none later."""
    n = 1000
    t_out = cycle_start(SCENE) + SPAN * at * np.where(np.arange(n) < share * n, 1.0, np.linspace(0.1, 0.9, n))
    return RIGHT._replace(t_in=np.full(n, 1.0), t_out=t_out)


@pytest.mark.parametrize(
    ("at", "share", "named"), [(0.5, 0.3, True), (0.91, 0.3, True), (0.93, 0.3, False), (0.5, 0.01, False)]
)
def test_captures_that_end_together_are_of_a_cycle_that_was_cut_off(at, share, named):
    causes = likely_causes(ending(at, share), THEIRS, wrongly(RELEASE, "m1"))
    words = f"many captures end together at {at:.3f} of the cycle"
    assert (words in " ".join(causes)) is named
    assert not named or causes == [f"{words}: it was followed no further"]


@pytest.mark.parametrize(("late", "how"), [(0.3, "after"), (-0.3, "before")])
def test_captured_that_are_let_out_early_or_late_are_told(late, how):
    given = RIGHT._replace(t_out=RIGHT.t_out + late)
    drop = np.nanmean(nu_at(SCENE, given.t_out) - nu_at(SCENE, given.t_in))
    [cause] = [one for one in likely_causes(given, THEIRS, wrongly(RELEASE, SHARE)) if "let out" in one]
    assert f"let out {how} the mouth is as wide" in cause
    assert f"(nu by {abs(drop):.3f})" in cause


@pytest.mark.parametrize(("keep", "word"), [(0.5, "few"), (1.0, "many")])
def test_too_few_or_too_many_captures_are_told(keep, word):
    n = len(RIGHT.s)
    some = np.arange(n) < keep * n
    t_in = np.where(some & RIGHT.captured, RIGHT.t_in, np.nan) if word == "few" else np.full(n, 1.0)
    for wrong, more in ((wrongly(SHARE), True), (wrongly(SHARE, TIMES), False)):
        [cause] = [one for one in likely_causes(RIGHT._replace(t_in=t_in), THEIRS, wrong) if "too " in one]
        share = np.mean(np.isfinite(t_in))
        assert cause.startswith(f"too {word} are captured, {share:.1%} for {1 - THEIRS.p_nc:.1%}")
        assert ("starts are not uniform" in cause) is more


def test_records_tell_what_was_dropped():
    n = len(RIGHT.s)
    free = ~RIGHT.captured
    dropped = GivenEnsemble(
        SCENE,
        ENERGY,
        RIGHT.s[free],
        captured=RIGHT.captured[free],
        n_lost=int(n - free.sum()),
        is_binary32=True,
    )
    causes = likely_causes(dropped, THEIRS, wrongly("m1"))
    assert causes[0].startswith("energies were written or computed in single precision")
    assert f"{RIGHT.captured.mean():.1%} of the particles are missing" in causes[1]
    assert f"as many are missing as theory has captured, {1 - THEIRS.p_nc:.1%}" in causes[2]
    assert causes[3].startswith("nobody is captured")
    fewer = dropped._replace(n_lost=n // 10)
    assert "as many are missing" not in " ".join(likely_causes(fewer, THEIRS, wrongly("m1")))
    assert likely_causes(dropped, THEIRS, []) == []


def test_the_worst_place_of_the_reversal_identity_counts():
    here = theory.at_energy(SCENE, ENERGY).draw(1, 3000, 1)[:, 0]
    back = theory.at_energy(load("moving-cap-reversed"), ENERGY).draw(1, 3000, 2)[:, 0]
    one = GivenEnsemble(SCENE, ENERGY, here)
    check = reversal(one, GivenEnsemble(load("moving-cap-reversed"), ENERGY, back), THEIRS)
    places = np.quantile(np.concatenate([here, -back]), np.linspace(0.01, 0.99, 50))
    gaps = [np.mean(np.exp(-here) * (here <= x)) - np.mean(-back <= x) for x in places]
    assert min(abs(gap - check.value) for gap in gaps) < 1e-12
    assert check.holds
    assert check.band == pytest.approx(2 * audited.shape_band(THEIRS))
    assert reversal(one, GivenEnsemble(SCENE, ENERGY, back * 1.3), THEIRS).holds is False


def read(tmp_path: Path, rows: str, scene: Mushroom = SCENE, **options) -> tuple[GivenEnsemble, list[str]]:
    path = tmp_path / "e.csv"
    path.write_text(rows)
    return ensemble_table.read(path, scene, PLAIN._replace(**options))


def table(times, energy: float = ENERGY) -> str:
    return "E0,E1,t_in,t_out\n" + "".join(f"{energy},{2 * energy + k},{t},{t}\n" for k, t in enumerate(times))


@pytest.mark.parametrize(
    ("scene", "times", "unit"),
    [
        (SCENE, (1.5, 6.2), "scene"),
        (SCENE, (0.1, 1.04), "cycles"),  # nearer to theory's: most are captured before pi
        (SCENE, (0.2, SPAN * 1.04), "scene"),
        (SCENE, (-0.04 * SPAN, 3.0), "scene"),
        (CLOCK, (0.05, 0.9), "scene"),
    ],
)
def test_the_unit_of_times_is_that_in_which_they_are_in_the_cycle(tmp_path, scene, times, unit):
    given, notes = read(tmp_path, table(times), scene, energy=ENERGY)
    size = scene.period if unit == "cycles" else 1.0
    assert given.t_in.tolist() == pytest.approx([t * size for t in times])
    assert given.t_out.tolist() == pytest.approx([t * size for t in times])
    words = "as parts of a cycle" if unit == "cycles" else "in the unit of the scene"
    assert f"times are taken {words}, inferred" in notes


@pytest.mark.parametrize("times", [(0.2, SPAN * 1.06), (-0.06 * SPAN, 3.0)])
def test_times_outside_the_cycle_are_refused_unless_their_unit_is_given(tmp_path, times):
    line = one_line(read, tmp_path, table(times))
    assert f"t_in = {times[0]:g} to {times[1]:g}, must be in the cycle, 0 to 6.28319" in line
    given, notes = read(tmp_path, table(times), time_unit="cycles")
    assert given.t_in.tolist() == pytest.approx([t * SPAN for t in times])
    assert "times are taken as parts of a cycle, as said" in notes


def test_columns_have_the_names_that_people_give_them(tmp_path):
    rows = "e0,energy_2,energy_10,energy_1,captured_1,x_0,y0,t_in_1_2,t_in_1_1,other\n"
    rows += "2e6,3e6,8e6,4e6,true,.1,.2,3,2,x\n2e6,5e6,9e6,6e6,No,.3,.4,nan,,x\n2e6,nan,9e6,6e6,0,.3,.4,,,x\n"
    given, notes = read(tmp_path, rows, energy=None, energy_unit="v2")
    assert given.energy == ENERGY
    assert given.s == pytest.approx(np.log([2.0, 3.0]))
    assert given.later == pytest.approx(np.log([[1.5, 4.0], [2.5, 4.5]]))
    assert given.captured.tolist() == [True, False]
    assert (given.x0.tolist(), given.y0.tolist()) == ([0.1, 0.3], [0.2, 0.4])
    assert given.t_in.tolist() == pytest.approx([2.0, np.nan], nan_ok=True)  # the earliest
    assert given.n_lost == 1
    assert "energies are taken as v², lengths in the scene's unit: E0 = 1e+06 as v²/2" in notes


def test_rows_of_another_start_are_left_out_and_told(tmp_path):
    rows = "E0,E1\n" + "1e6,2e6\n" * 3 + "1000000.5,3e6\n2e6,3e6\n5e5,4e6\n"
    given, notes = read(tmp_path, rows, energy=1e6)
    assert len(given.s) == 4  # one was written in few digits
    assert "2 rows of another E0 are left out" in notes
    for other in ("2e6", "5e5"):
        line = one_line(read, tmp_path, f"E0,E1\n1e6,2e6\n{other},3e6\n", energy=None)
        assert f"1e+06 and {float(other):g} among them" in line


@pytest.mark.parametrize(("end", "is_short"), [("", True), ("1e6,2000000.0000001\n", False)])
def test_energies_of_24_bits_are_told(tmp_path, end, is_short):
    rows = "E0,E1\n" + "".join(f"1e6,{2_000_000 + k}\n" for k in range(20)) + end
    assert read(tmp_path, rows)[0].is_binary32 is is_short
    same = "E0,E1\n" + "1e6,2000000\n" * 20
    assert read(tmp_path, same)[0].is_binary32 is False  # of two or fewer energies it says nothing


def test_particles_that_are_not_there_count_as_lost(tmp_path):
    rows = "E0,E1\n" + "1e6,2e6\n" * 5 + "1e6,nan\n"
    assert read(tmp_path, rows, particles=9)[0].n_lost == 4
    assert read(tmp_path, rows, particles=6)[0].n_lost == 1
    assert "--particles = 5, must be at least the 6 rows" in one_line(read, tmp_path, rows, particles=5)


def test_arrays_of_unequal_lengths_and_folders_without_arrays_are_refused(tmp_path):
    group = zarr.open_group(tmp_path / "e.zarr", mode="w")
    for name, n in (("E0", 3), ("E1", 3), ("t_in", 2)):
        group.create_array(name, data=np.ones(n))
    line = one_line(ensemble_table.read, tmp_path / "e.zarr", SCENE, PLAIN)
    assert "arrays of" in line
    assert "'t_in': 2" in line
    assert "must be as many in each" in line
    (tmp_path / "none.zarr").mkdir()
    (tmp_path / "none.zarr" / "zarr.json").write_text("{")
    for name in ("none.zarr", "absent.zarr"):
        assert "is no Zarr group" in one_line(ensemble_table.read, tmp_path / name, SCENE, PLAIN)


def test_a_group_of_zarr_has_cycles_in_columns_and_the_first_of_several_narrowings(tmp_path):
    (tmp_path / "run").mkdir()
    group = zarr.open_group(tmp_path / "run" / "ensemble.zarr", mode="w")
    group.create_array("cycle_energies", data=np.array([[2e6, 3e6], [4e6, 5e6]]))
    group.create_array("t_in", data=np.array([[1.0, 9.0], [np.nan, np.nan]]))
    given, _ = ensemble_table.read(tmp_path / "run", SCENE, PLAIN._replace(time_unit="scene"))
    assert given.s == pytest.approx(np.log([2.0, 4.0]))
    assert given.later == pytest.approx(np.log([[3.0], [5.0]]))
    assert given.t_in.tolist() == pytest.approx([1.0, np.nan], nan_ok=True)
    assert given.captured.tolist() == [True, False]


def test_without_arrow_the_cells_are_read_alike(tmp_path, monkeypatch):
    rows = "E0,E1,captured\n" + "".join(f"1e6,{2e6 + k},{k % 2}\n" for k in range(30))
    before, _ = read(tmp_path, rows)
    monkeypatch.setattr(ensemble_table, "FEW", 7)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    after, _ = read(tmp_path, rows)
    assert after.s.tolist() == before.s.tolist()
    assert after.captured.tolist() == before.captured.tolist()


def test_the_report_says_how_it_came_to_its_verdict(tmp_path):
    found = [
        Check("a mean", False, "0.5", 0.61, 0.01, 0.02, n_tests=1, sees=0.08, note="a note"),
        Check("a law", True, "<= 0.1", 0.05, n_tests=1),
        Check("a share", None, "0.2", 0.3, 0.2, n_tests=1),
    ]
    result = EnsembleAudit(RIGHT, found, [], ["taken so"])
    assert result.verdict == "refuted"
    assert EnsembleAudit(RIGHT, found[1:], [], []).verdict == "indeterminate"
    assert EnsembleAudit(RIGHT, found[1:2], [], []).verdict == "confirmed"
    data = ensemble_command.to_data(result, tmp_path / "e.csv", "moving-cap")
    text = ensemble_command.to_text(data)
    assert text.startswith(
        f"{tmp_path / 'e.csv'} against moving-cap: refuted\n4,000 particles, 0 without an energy\n"
    )
    assert "note: taken so\n" in text
    assert "FAILS  a mean: 0.610 ± 0.010, must be 0.5000; left out 0.02; pull +11.0; detects 0.08\n" in text
    assert "holds  a law: 0.05, must be <= 0.1\n" in text
    assert "open   a share: 0.30 ± 0.20, must be 0.200; pull +0.5\n" in text
    assert text.endswith("likely cause: none of those that are known\n")
    named = {**data, "causes": ["it leaks"]}
    assert ensemble_command.to_text(named).endswith("likely cause: it leaks\n")


def test_where_nothing_is_known_of_an_energy_a_failed_figure_is_open(tmp_path, monkeypatch):
    """What finite energy adds there is a guess: it refutes nothing."""
    monkeypatch.setattr(ensemble_command, "checks", lambda *_: [
        Check("a guess", False, "0", 1.0, 0.1, 0.02), Check("a fact", False, "0", 1.0, 0.1),
    ])  # fmt: skip
    monkeypatch.setattr(ensemble_command, "likely_causes", lambda *_: [])
    (tmp_path / "e.csv").write_text("E0,E1\n1e6,2e6\n1e6,3e6\n")
    for scene, wanted in ((OWN, [None, False]), (SCENE, [False, False])):
        result = ensemble_command.examine(tmp_path / "e.csv", scene, None, PLAIN)
        assert [check.holds for check in result.checks] == wanted
        assert any("no frozen rates" in note for note in result.notes) is (scene is OWN)
    both = ensemble_command.examine(
        tmp_path / "e.csv", SCENE, tmp_path / "e.csv", PLAIN._replace(particles=2)
    )
    assert both.checks[-1].what.startswith("reversal identity")  # of two particles some shares have no error


def test_sums_of_cycles_are_held_to_theory(monkeypatch):
    monkeypatch.setattr(audited, "MOST_DRAWN", 60_000)
    sums = theory.at_energy(SCENE, ENERGY).draw(3, 3000, 7)
    given = GivenEnsemble(SCENE, ENERGY, sums[:, 0], later=sums[:, 1:])
    found = {check.what: check for check in checks(given, THEIRS)}
    for k in (2, 3):
        assert found[f"mean of log E{k}/E0"].value == pytest.approx(sums[:, k - 1].mean())
        assert found[f"mean of log E{k}/E0"].holds
        assert found[f"log E{k}/E0"].holds
        assert found[f"mean of log E{k}/E0"].band > k * THEIRS.theory_error.mean_s
    theirs = expected(OWN, ENERGY)
    later = GivenEnsemble(OWN, ENERGY, sums[:, 0], later=sums[:, 1:])
    found = {check.what: check for check in checks(later, theirs)}
    assert float(found["mean of log E3/E0"].expected) == pytest.approx(3 * theirs.mean_s)
    assert found["mean of log E3/E0"].band == pytest.approx(3 * theirs.theory_error.mean_s)
    assert "log E3/E0" not in found


def test_nu_is_that_of_the_scene():
    times = np.array([0.0, 1.0, 2.5])
    assert nu_at(SCENE, times) == pytest.approx([float(SCENE.laws["nu"].value(fp, t)) for t in times])
    assert cycle_start(SCENE) == pytest.approx(0.0, abs=1e-9)
