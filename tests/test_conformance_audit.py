"""The audit must confirm an ensemble drawn from theory itself, and find out every planted error."""

from __future__ import annotations

from functools import cache

import mpmath
import numpy as np
import pytest

import fast
import scene as scenes
import theory
from conformance.audit import (
    MIN_PARTICLES,
    N_SIGMA,
    Finding,
    Measured,
    compare,
    examine,
    measure,
    run_ensembles,
)
from conformance.audit_forms import FORMS, rounds_to
from conformance.claims import CLAIMS, ENERGIES, SIMULATED

N = 20_000
WIDTH = 0.02
QUANTITIES = [claim for claim in CLAIMS if claim.quantity]


@cache
def theory_of(scene):
    return theory.predict(scene, 15), theory.capture_curve(scene, 801)


def draw_ensemble(scene, *, n_particles, energy, seed, threads=None, progress=None):
    """An ensemble from theory's own distribution: captured by p_cha, the rest a narrow peak."""
    rng = np.random.default_rng(seed)
    prediction, curve = theory_of(scene)
    p_cha = np.asarray(curve.p_cha)[::-1]
    u = rng.random(n_particles)
    captured = u > float(prediction.p_nc)
    drift = WIDTH**2 / 4
    s = float(prediction.log_e_nc) + drift + WIDTH * rng.standard_normal(n_particles)
    s[captured] = np.interp(u[captured], p_cha, np.asarray(curve.s)[::-1])
    t_in, t_out = (
        np.where(captured, np.interp(u, p_cha, np.asarray(times)[::-1]), np.nan)
        for times in (curve.t_in, curve.t_out)
    )
    final = energy * np.exp(s)
    if progress:
        progress(n_particles)
    fields = {
        "energy0": energy, "energy": final, "cycle_energies": final[:, None],
        **dict.fromkeys(("t", "x", "y", "vx", "vy"), np.zeros(n_particles)),
        "n_collisions": np.full(n_particles, 100), "outcome": np.zeros(n_particles, np.int8),
        "t_in": t_in[:, None], "t_out": t_out[:, None],
        "wall_counts": np.full((n_particles, 5), 20), "n_careful": np.zeros(n_particles, np.int64),
        "phase_energies": np.empty((n_particles, 1, 0)),
        "phase_captured": np.empty((n_particles, 1, 0), bool),
        "seconds": 1.0, "threads": 1,
    }  # fmt: skip
    return fast.Ensemble(**{name: fields[name] for name in fast.Ensemble._fields})


@pytest.fixture(scope="module")
def ensembles():
    return run_ensembles(draw_ensemble, n_particles=N, seed=3)


@pytest.fixture(scope="module")
def predict():
    return cache(theory.predict)


def samples_of(ensembles):
    return {name: measure(scenes.load(name), ensemble) for name, ensemble in ensembles.items()}


def verdicts(ensembles, predict, **changes) -> dict[str, Finding]:
    changed = {name: ensemble._replace(**changes.get(name, {})) for name, ensemble in ensembles.items()}
    return {finding.id: finding for finding in examine(samples_of(changed), predict=predict)}


def test_honest_ensembles_meet_every_expected_verdict(ensembles, predict):
    findings = examine(samples_of(ensembles), predict=predict)
    assert [finding.id for finding in findings] == [claim.id for claim in CLAIMS]
    assert [finding for finding in findings if not finding.is_as_expected] == []


def test_the_fast_stepper_meets_the_moving_caps_claims(predict):
    scene = scenes.load("moving-cap")
    sample = measure(scene, fast.simulate(scene, n_particles=2000, energy=1e4, seed=5))
    assert sample.is_whole
    for claim in QUANTITIES:
        if claim.scene == "moving-cap":
            finding = compare(claim, sample, getattr(predict(scene, 30), claim.quantity))
            assert finding.verdict == "confirmed", finding


def test_every_finding_is_complete(ensembles, predict):
    for claim, finding in zip(CLAIMS, examine(samples_of(ensembles), predict=predict), strict=True):
        assert finding.claim == claim.statement
        assert finding.theory
        assert finding.note
        numbers = (finding.simulation, finding.error, finding.band)
        if claim.forms:
            assert numbers == (None, None, None)
        else:
            assert all(np.isfinite(number) for number in numbers)
            assert finding.error > 0


def test_ledger_entries_are_whole_and_unique():
    assert len({claim.id for claim in CLAIMS}) == len(CLAIMS)
    for claim in CLAIMS:
        assert all((claim.where, claim.statement, claim.checked, claim.tolerance))
        assert sum(bool(kind) for kind in (claim.quantity, claim.relation, claim.forms)) == 1
    assert {claim.scene for claim in QUANTITIES} == set(SIMULATED)
    assert {claim.forms for claim in CLAIMS if claim.forms} == set(FORMS)


@pytest.mark.parametrize("claim", QUANTITIES, ids=lambda claim: claim.id)
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_planted_theory_value_is_refuted_beyond_five_errors_and_the_band(ensembles, claim, sign):
    sample = measure(scenes.load(claim.scene), ensembles[claim.scene])
    measured = sample.quantities[claim.quantity]
    unprinted = claim._replace(paper="")
    far = measured.value + sign * (5 * measured.error + measured.band)
    near = measured.value + sign * (3 * measured.error + measured.band)
    assert compare(unprinted, sample, mpmath.mpf(far)).verdict == "refuted"
    assert compare(unprinted, sample, mpmath.mpf(near)).verdict == "confirmed"


@pytest.mark.parametrize("name", SIMULATED)
def test_an_escape_probability_off_by_two_percent_is_refuted(ensembles, predict, name):
    claim = next(claim for claim in QUANTITIES if claim.scene == name and claim.quantity == "p_nc")
    sample = measure(scenes.load(name), ensembles[name])
    truth = predict(scenes.load(name), 15).p_nc
    away = 1 if truth > sample.quantities["p_nc"].value else -1
    assert compare(claim._replace(paper=""), sample, truth + away * mpmath.mpf("0.02")).verdict == "refuted"


@pytest.mark.parametrize("claim", [claim for claim in QUANTITIES if claim.paper], ids=lambda claim: claim.id)
def test_one_wrong_printed_digit_is_refuted(ensembles, predict, claim):
    last = "1" if claim.paper[-1] != "1" else "2"
    wrong = claim._replace(paper=claim.paper[:-1] + last)
    sample = measure(scenes.load(claim.scene), ensembles[claim.scene])
    prediction = getattr(predict(scenes.load(claim.scene), 30), claim.quantity)
    assert compare(claim, sample, prediction).verdict == "confirmed"
    assert compare(wrong, sample, prediction).verdict == "refuted"


@pytest.mark.parametrize("name", SIMULATED)
def test_raised_energies_are_refuted(ensembles, predict, name):
    found = verdicts(ensembles, predict, **{name: {"energy": ensembles[name].energy * np.exp(0.05)}})
    for claim in QUANTITIES:
        is_touched = claim.scene == name and claim.quantity != "p_nc"
        assert found[claim.id].verdict == ("refuted" if is_touched else "confirmed"), claim.id


@pytest.mark.parametrize("share", [0.2, 1.0])
@pytest.mark.parametrize("name", SIMULATED)
def test_dropped_capture_flags_are_refuted(ensembles, predict, name, share):
    t_in = ensembles[name].t_in.copy()
    captured = np.flatnonzero(~np.isnan(t_in[:, 0]))
    t_in[captured[: int(share * len(captured))]] = np.nan
    found = verdicts(ensembles, predict, **{name: {"t_in": t_in}})
    claim = next(claim for claim in QUANTITIES if claim.scene == name and claim.quantity == "p_nc")
    assert found[claim.id].verdict == "refuted"


def test_all_captured_is_refuted_not_a_crash(ensembles, predict):
    found = verdicts(ensembles, predict, **{"moving-cap": {"t_in": np.zeros((N, 1))}})
    assert {found[f"X2.{quantity}"].verdict for quantity in ("m1", "p_nc", "log_e_nc")} == {"refuted"}


@pytest.mark.parametrize("code", [1, 2])
def test_lost_particles_are_counted_and_too_many_leave_it_open(ensembles, predict, code):
    for n_lost, expected in ((N // 2000, "confirmed"), (N // 500, "indeterminate")):
        outcome = np.zeros(N, np.int8)
        outcome[:n_lost] = code
        energy = ensembles["moving-cap"].energy.copy()
        energy[:n_lost] = np.nan
        found = verdicts(ensembles, predict, **{"moving-cap": {"outcome": outcome, "energy": energy}})
        assert found["X2.m1"].verdict == expected
        assert f"{n_lost} particles not followed" in found["X2.m1"].note
        assert found["X1.clockwise.m1"].verdict == "confirmed"


def test_peaks_on_the_same_side_refute_the_flip(ensembles, predict):
    twice = dict(ensembles) | {"fixed-cap-clockwise": ensembles["fixed-cap-anticlockwise"]}
    found = {finding.id: finding.verdict for finding in examine(samples_of(twice), predict=predict)}
    assert found["X8.flip"] == "refuted"


def test_no_growth_refutes_growth(ensembles, predict):
    for shift, expected in ((-0.05, "indeterminate"), (-0.1, "refuted")):
        energy = ensembles["fixed-cap-clockwise"].energy * np.exp(shift)
        found = verdicts(ensembles, predict, **{"fixed-cap-clockwise": {"energy": energy}})
        assert found["X8.growth"].verdict == expected


def test_a_band_as_large_as_half_the_value_tells_nothing(ensembles, predict):
    ensemble = ensembles["fixed-cap-clockwise"]
    noise = np.exp(0.45 * np.random.default_rng(0).standard_normal(N))  # the width at E0 = 1e6
    found = verdicts(ensembles, predict, **{"fixed-cap-clockwise": {"energy": ensemble.energy * noise}})
    assert found["X1.clockwise.m1"].verdict == "indeterminate"
    assert found["X8.flip"].verdict == "indeterminate"
    assert found["X1.clockwise.p_nc"].verdict == "confirmed"


@pytest.mark.parametrize("name", FORMS)
def test_each_misprint_fails_as_printed_and_holds_corrected(predict, name):
    forms = FORMS[name](predict)
    assert not forms.printed_holds
    assert forms.corrected_holds
    assert forms.printed != forms.corrected


def test_the_sign_misprint_inverts_the_printed_probabilities(predict):
    forms = FORMS["exponent_sign"](predict)
    printed = forms.printed.removeprefix("p_nc = ").split(", ")
    for value, known in zip(printed, ("1.18558", "1.39296"), strict=True):
        assert rounds_to(known, mpmath.mpf(value))
    for value, known in zip(forms.value.split(", "), ("0.843472", "0.717894"), strict=True):
        assert rounds_to(known, mpmath.mpf(value))


@pytest.mark.parametrize("name", FORMS)
def test_a_wrong_theory_upholds_no_correction(predict, name):
    def wrong(scene, digits):
        right = predict(scene, digits)
        return right._replace(m1=right.m1 + mpmath.mpf("1e-5"), p_nc=right.p_nc + mpmath.mpf("1e-5"))

    assert not FORMS[name](wrong).corrected_holds


def test_a_theory_that_upholds_the_print_is_no_misprint(ensembles, predict):
    def swapped(scene, digits):
        pair = {"moving-cap": "moving-cap-reversed", "moving-cap-reversed": "moving-cap"}
        return predict(scenes.load(pair.get(scene.name, scene.name)), digits)

    found = {finding.id: finding for finding in examine(samples_of(ensembles), predict=swapped)}
    assert found["M2"].verdict == "confirmed"
    assert not found["M2"].is_as_expected


def test_printed_digits_are_compared_by_rounding():
    assert rounds_to("0.05252", mpmath.mpf("0.0525207"))
    assert rounds_to("-0.422465", mpmath.mpf("-0.4224654"))
    assert not rounds_to("0.05252", mpmath.mpf("0.0525251"))
    assert not rounds_to("0.05252", mpmath.mpf("0.0525149"))


def test_acceptance_is_four_errors_and_the_band():
    measured = Measured(1.0, 0.25, 0.5)
    assert measured.accepts(1.0 + N_SIGMA * 0.25 + 0.5)
    assert not measured.accepts(1.0 - N_SIGMA * 0.25 - 0.5001)
    assert not measured.accepts(float("nan"))
    assert not Measured(1.0, float("nan"), 0.0).accepts(1.0)


def test_scenes_run_with_their_own_seeds_and_report_progress():
    seen, done = [], []

    def simulate(scene, **options):
        seen.append((scene.name, options["energy"], options["seed"]))
        return draw_ensemble(scene, **options)

    run_ensembles(
        simulate, n_particles=MIN_PARTICLES, seed=2**64 - 1, progress=lambda *args: done.append(args)
    )
    assert seen == list(zip(ENERGIES, ENERGIES.values(), (2**64 - 1, 0, 1), strict=True))
    assert done == [(name, MIN_PARTICLES) for name in SIMULATED]


def test_too_few_particles_are_refused():
    with pytest.raises(ValueError, match="particles = 1999, must be >= 2000"):
        run_ensembles(draw_ensemble, n_particles=1999)
