"""How numbers become checks, and checks a verdict: comparisons at their bounds, verdicts by their rule."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import kstwo, norm

import fast
import theory
from mushrooms.audit import runs
from mushrooms.audit.claim import Check, Claim, ClaimEvidence, Finding, from_data, to_data, verdict_of
from mushrooms.audit.claims import assumptions, experiments
from mushrooms.audit.runs import RUNS, Sample, Simulation, run_seed
from mushrooms.audit.session import AuditResult, AuditSettings, examine
from mushrooms.audit.tolerances import (
    FAMILY_LEVEL,
    LEVEL,
    MAX_TESTS,
    N_SIGMA,
    Mean,
    above,
    chance,
    close,
    critical_gap,
    exact,
    fits,
    half_unit,
    mean,
    power,
    seen_late,
    share,
    spread,
    stated,
    steepest,
)  # fmt: skip
from scene import load


def claim(expected: str = "misprint", made: tuple[Check, ...] = (), names: tuple[str, ...] = ()) -> Claim:
    return Claim("M0", "sec. 1", "so", "thus", "none", expected, lambda _: made, names)


def check(form: str, holds: bool | None) -> Check:
    return Check("it", holds, "0", form=form)


@pytest.mark.parametrize(
    ("printed", "others", "verdict"),
    [
        ([], [True], "misprint"), ([], [True, True], "misprint"), ([], [], "refuted"),
        ([False], [], "refuted"), ([True], [False], "refuted"),
        ([], [True, False], "refuted"), ([], [None, False], "refuted"), ([], [True, None], "indeterminate"),
        ([False], [True], "misprint"), ([False, True], [True], "misprint"), ([True], [True], "confirmed"),
        ([True, None], [True], "indeterminate"), ([False, None], [True], "misprint"),
        ([False], [None], "indeterminate"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("form", ["claim", "corrected"])
def test_a_verdict_follows_from_the_checks_of_each_form(printed, others, verdict, form):
    made = [*(check("printed", holds) for holds in printed), *(check(form, holds) for holds in others)]
    assert verdict_of(claim(), made) == verdict


@pytest.mark.parametrize(("lost", "is_whole"), [(0, True), (9, True), (10, False), (11, False)])
def test_lost_particles_leave_open_what_is_not_refuted(lost, is_whole):
    """A thousandth of the particles may be missing, less than that."""
    name = "ergodic@1e7"
    sample = Sample(RUNS[name], *[np.zeros((10_000 - lost, 1))] * 7, 10_000, 0, 0, 0, 0, 0.0, "")
    evidence = ClaimEvidence({name: sample}, None)
    for holds, verdict in ((True, "misprint"), (False, "refuted")):
        found = examine(claim(made=(check("claim", holds),), names=(name,)), evidence)
        assert found.verdict == (verdict if is_whole or verdict == "refuted" else "indeterminate")
    assert from_data(to_data(found)) == found


def test_an_audit_passes_if_every_claim_has_its_verdict():
    claims = (claim("misprint"), claim("confirmed"))
    tested = [check("claim", True)._replace(n_tests=2), check("claim", True)]
    for verdicts, is_passed in ((("misprint", "confirmed"), True), (("misprint", "misprint"), False)):
        findings = [Finding("M0", verdict, tested, 0.0) for verdict in verdicts]
        result = AuditResult(AuditSettings(), claims, findings, {}, 0.0)
        assert result.is_passed is is_passed
        assert result.n_tests == 4


def test_a_level_allows_few_false_alarms_in_all():
    assert FAMILY_LEVEL / MAX_TESTS == LEVEL
    assert 2 * norm.sf(N_SIGMA) == pytest.approx(LEVEL)


def test_means_shares_and_spreads_have_their_errors():
    x = np.array([1.0, 2.0, 4.0, 9.0])
    assert mean(x) == pytest.approx((4.0, x.std(ddof=1) / 2))
    assert share([True, True, False]) == pytest.approx((2 / 3, (4 / 7 * 3 / 7 / 7) ** 0.5))
    assert share([True] * 3).error > 0
    deviation = x - 4.0
    fourth = np.mean(deviation**4) - np.mean(deviation**2) ** 2
    assert spread(x) == pytest.approx((x.std(ddof=1), (fourth / 4 / (4 * np.mean(deviation**2))) ** 0.5))
    for of, few in ((mean, [1.0]), (share, []), (spread, [1.0, 2.0, 3.0])):
        assert np.isnan(of(few)).all()
    assert np.isfinite(mean([1.0, 2.0])).all()
    assert spread([2.0] * 9) == (0.0, 0.0)
    assert Mean(4.0, 0.4).root() == pytest.approx((2.0, 0.1))
    assert Mean(4.0, 0.4).less(1.0) == (3.0, 0.4)
    assert Mean(6.0, 0.6).over(Mean(3.0, 0.6)) == pytest.approx((2.0, 2 * math.hypot(0.1, 0.2)))
    assert [half_unit(text) for text in ("0.0463", "12", "1.5")] == pytest.approx([5e-5, 0.5, 0.05])


NEAR, FAR = 0.999, 1.001


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_number_is_close_up_to_its_errors_and_its_band(sign):
    error, band = 0.1, 0.05
    reach = N_SIGMA * error + band
    for size, holds in ((NEAR, True), (FAR, False)):
        found = close("it", (2 + sign * size * reach, error), 2.0, band=band)
        assert found.holds is holds
        assert found.sees == pytest.approx(reach + norm.isf(0.05) * error)
        assert (found.n_tests, found.band, float(found.expected)) == (1, band, 2.0)
    assert close("it", (2.0, math.nan), 2.0).holds is False
    assert close("it", (2.0, math.nan), 2.0).sees is None
    assert close("it", (2.0, error), 2.0, band=band, scale=reach * NEAR).holds is None  # too coarse to tell
    assert close("it", (2.0, error), 2.0, band=band, scale=reach * FAR).holds is True
    assert close("it", (9.0, error), 2.0, band=band, scale=reach * NEAR).holds is False
    assert close("it", (2.0, error), 2.0, against=("far", 4.0)).power == pytest.approx(1.0)
    assert close("it", (2.0, error), 2.0, against=("near", 2 + N_SIGMA * error)).power == pytest.approx(0.5)


def test_a_number_above_a_bound_is_so_beyond_its_error():
    reach = N_SIGMA * 0.1
    wanted = [(FAR, True), (NEAR, None), (-NEAR, None), (-FAR, False)]
    for size, holds in wanted:
        found = above("it", (1 + size * reach, 0.1), 1.0)
        assert found.holds is holds
        assert found.expected == "> 1"
    assert above("it", (2.0, 0.1), 1.0).sees == pytest.approx(reach + norm.isf(0.05) * 0.1)
    assert above("it", (2.0, 0.1), 1.0).power == pytest.approx(1 - LEVEL / 2)


def test_exact_numbers_agree_within_the_rounding():
    for off, holds in ((NEAR, True), (-NEAR, True), (FAR, False), (-FAR, False)):
        found = exact("it", 3.0 + off * 1e-9, 3.0, 1e-9)
        assert (found.holds, found.n_tests, found.error) == (holds, 0, None)
    assert stated("it", np.bool_(True), "found", "wanted")[:3] == ("it", True, "wanted")


def test_a_power_is_the_share_of_samples_that_are_too_far():
    assert power(1.0, 1.0, 0.5) == pytest.approx(0.5, abs=1e-4)
    assert power(-1.0, 1.0, 0.5) == pytest.approx(0.5, abs=1e-4)
    assert power(0.0, 1.0, 0.5) == pytest.approx(2 * norm.sf(2))
    assert [power(x, 1.0, 0.0) for x in (0.5, -2.0)] == [0.0, 1.0]
    assert [power(math.inf, 1.0, 1.0), power(1.0, math.nan, 1.0)] == [None, None]


def even(u):
    return np.clip(u, 0, 1)


def test_a_distribution_fits_up_to_the_critical_distance():
    n = 200
    assert kstwo.sf(critical_gap(n), n) == pytest.approx(LEVEL, rel=0.01)
    places = (np.arange(n) + 0.5) / n
    for shift, band, holds in (
        (NEAR * critical_gap(n), 0.01, True), (FAR * critical_gap(n), 0.01, True),
        (critical_gap(n) + 0.011, 0.01, False),
    ):  # fmt: skip
        found = fits("it", places + shift - 0.5 / n, even, band=band)
        assert found.holds is holds, shift
        assert found.value == pytest.approx(shift, abs=0.5 / n)
        assert found.expected == f"<= {critical_gap(n) + band:.4g}"
    assert fits("it", places, even, scale=critical_gap(n)).holds is None
    assert fits("it", places, even, scale=critical_gap(n) * FAR).holds is True
    assert fits("it", places[:1], even).holds is None
    assert fits("it", places, even, band=0.1).sees == pytest.approx(
        critical_gap(n) + 0.1 + norm.isf(0.05) * 0.5 / n**0.5
    )
    assert chance(places, even) > 0.999
    assert fits("it", places, even, against=("a step", lambda u: even(u + 0.5))).power > 0.9


def test_what_is_seen_late_and_how_steep_a_law_is():
    assert seen_late(even, np.array([0.0, 1.0]), 0.125) == pytest.approx(0.125)
    assert seen_late(lambda t: even(t) ** 2, np.array([0.0, 1.0]), 0.1) == pytest.approx(0.19)
    assert steepest(lambda t: even(t) ** 2, 0.0, 0.5) == pytest.approx(1.0, rel=0.01)


def test_runs_have_names_seeds_and_sizes():
    one = Simulation("moving-cap", 1e11, 5, 7)
    assert one.name == "moving-cap@1e11"
    assert one._replace(energy=1e4, n_cycles=30).name == "moving-cap@1e4x30"
    assert (one.n_particles("quick"), one.n_particles("full")) == (5, 7)
    seeds = {
        run_seed(0, one),
        run_seed(1, one),
        run_seed(0, one, 1),
        run_seed(0, one, 2),
        run_seed(0, RUNS["ergodic@1e4"]),
    }
    assert len(seeds) == 5
    assert all(0 <= seed < 2**64 for seed in seeds)


def test_a_sample_has_those_that_were_followed_to_the_end():
    asked = {}
    energies = np.array([[2.0, 4.0], [np.nan, 1.0], [0.0, 1.0], [8.0, 16.0], [1.0, 1.0], [1.0, 1.0]])
    t_in = np.full((6, 2, 2), np.nan)
    t_in[3, 0] = [2.0, 1.0]

    def simulate(scene, **options):
        asked.update(options, scene=scene)
        given = fast.simulate(load("moving-cap"), n_particles=6, energy=2.0, n_cycles=2, phases=(0.5,))
        outcome = np.array([0, 0, 0, 0, 1, 2], np.int8)
        return given._replace(
            cycle_energies=energies, outcome=outcome, t_in=t_in, t_out=t_in + 1, seconds=2.0, threads=3,
            wall_counts=np.arange(30).reshape(6, 5),
        )  # fmt: skip

    run = Simulation("moving-cap", 2.0, 6, 9, 2, (0.5,))
    sample = runs.draw(simulate, run, size="quick", seed=3, threads=2)
    wanted = {
        "n_particles": 6,
        "energy": 2.0,
        "n_cycles": 2,
        "seed": run_seed(3, run),
        "threads": 2,
        "phases": (0.5,),
    }
    assert {name: asked[name] for name in wanted} == wanted
    assert sample.s == pytest.approx(np.log([[1.0, 2.0], [4.0, 8.0]]))
    assert (sample.n, sample.n_particles, sample.n_undecided, sample.n_undefined) == (2, 6, 1, 1)
    assert sample.stem_hits.tolist() == [2 + 3 + 4, 17 + 18 + 19]
    assert sample.seconds == 6.0
    assert sample.gain == pytest.approx(np.log([1.0, 4.0]))
    assert sample.captured.tolist() == [False, True]
    assert sample.never_captured.tolist() == [True, False]
    begin, end = sample.first_capture
    assert (begin.tolist()[1], end.tolist()[1]) == (1.0, 2.0)
    assert np.isnan(begin[0])
    assert not sample.is_whole
    assert sample.speed == 2.0
    some = sample._replace(phase_s=np.array([[[1.0, 3.0]], [[5.0, 9.0]]]))
    assert some.change(np.array([False, True]), 0, 1).tolist() == [4.0]


@pytest.mark.parametrize(("m1", "log_e_nc"), [(0, 0), (0, 1), (1, 0)])
def test_a_parameter_that_moves_alone_has_neither_growth_nor_a_peak_elsewhere(monkeypatch, m1, log_e_nc):
    """X7, without its simulations: both must vanish, and the retraced arc must grow."""
    held = check("claim", True)
    monkeypatch.setattr(experiments, "one_cycle", lambda *_: [])
    monkeypatch.setattr(experiments, "less_bias", lambda *_, **__: held)
    monkeypatch.setattr(experiments, "escape", lambda *_: held)
    error = SimpleNamespace(p_nc=0.01)
    monkeypatch.setattr(experiments, "predicted", lambda _: SimpleNamespace(p_nc=0.3, theory_error=error))
    t_in = np.full((100, 1, 2), np.nan)
    t_in[:30, 0, 0] = t_in[10:40, 0, 1] = 1.0
    sample = SimpleNamespace(run=RUNS["retraced-arc@1e6"], t_in=t_in)
    grown = SimpleNamespace(m1=0.05, p_nc=0.25, log_e_nc=0.0)
    evidence = SimpleNamespace(
        sample=lambda _: sample, theory_of=lambda _: grown,
        predict=lambda _: SimpleNamespace(m1=m1, log_e_nc=log_e_nc),
    )  # fmt: skip
    made = {one.what: one for one in experiments.trivial_loops(evidence)}
    alone = [one.holds for what, one in made.items() if what.startswith("only the")]
    assert alone == [m1 == log_e_nc == 0] * 4
    [printed] = [one for one in made.values() if one.form == "printed" and "m1 = 0" in one.expected]
    assert printed.holds is False
    twice = made["retraced-arc@1e6: share captured in both of its windows"]
    assert (twice.value, float(twice.expected)) == (0.2, 0.25)
    assert twice.band == pytest.approx(0.01 + 0.05)


def test_evidence_has_the_theory_and_the_runs_of_its_size():
    asked = []
    evidence = ClaimEvidence(
        {"ergodic@1e7": "it"}, None, predict=lambda *given: asked.append(given) or "theory"
    )
    assert evidence.sample("ergodic@1e7") == "it"
    assert evidence.samples("ergodic@1e7", "moving-cap@1e9") == ["it"]  # of the latter a quick audit has none
    assert evidence.predict("ergodic") == evidence.predict(load("ergodic")) == "theory"
    assert asked == [(load("ergodic"), 30)] * 2
    assert evidence.theory_of(SimpleNamespace(run=RUNS["ergodic@1e7"])) == "theory"
    assert theory.predict(load("ergodic"), 5).p_nc == 1


def test_chords_are_counted_up_to_the_rim_and_what_rounding_puts_beyond_it():
    """The area in phase of the chords nearer to the centre than s: half of it is s sqrt(1 - s^2) + asin s."""
    s = np.array([0.0, 0.5, 1.0, 1 + 1e-15])
    wanted = [0.0, 0.5 * 0.75**0.5 + math.pi / 6, math.pi / 2, math.pi / 2]
    assert assumptions._chords(s) == pytest.approx(wanted)
