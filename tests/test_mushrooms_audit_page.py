"""The audit's page, its summary and its JSON say the numbers of the checks and of the runs.

A result is made of checks with known numbers, and of one run. What must stand on the page is written here, or
computed from the run's particles.
"""

import html
import math
import re

import numpy as np
import pytest
from support import adiabatic_particles

import scene as scenes
import theory
from mushrooms.audit import figures, page as audit_page
from mushrooms.audit.claim import Check, Claim, Finding
from mushrooms.audit.runs import RUNS, Sample, draw, run_seed
from mushrooms.audit.session import AuditResult, AuditSettings

MAIN, LOST = "moving-cap@1e7", "ergodic@1e6"
# A check of a claim, and what stands in the columns Found, Expected, Pull, Band and Detects.
CHECKS = [
    (Check("in words", True, "a loop", note="as it is"), ["as it is", "a loop", "–", "–", ""]),
    (Check("exact", True, "1/3", 1 / 3, band=0.25), ["0.3333333333", "1/3", "–", "–", ""]),
    (Check("a level", True, "> 1e-3", 0.123456, n_tests=2), ["0.1235", "> 1e-3", "–", "–", ""]),
    (
        Check("a mean", True, "0.512345678", 0.51, 0.01, 0.0025, n_tests=1, sees=0.0441),
        ["0.510 ± 0.010", "0.5123", "-0.2", "0.0025", "0.04"],
    ),
    (
        Check("last digit", True, "2", 1.5, 1e-6, 0.0, n_tests=1, sees=1e-5, against="half", power=0.25),
        ["1.5000000 ± 0.0000010", "2.00000000", "-500000.0", "0", "1e-05; half: 0.25"],
    ),
    (
        Check("finer yet", True, "2", 1.5, 2.5e-7, 0.5, n_tests=1, sees=1e-6, against="one", power=0.99951),
        ["1.5 ± 2.5e-07", "2.000000000", "-2000000.0", "0.5", "1e-06; one: > 0.999"],
    ),
    (
        Check("finest", True, "2", 2.5, 2.5e-11, 0.5, n_tests=1, against="one", power=0.999),
        ["2.5 ± 2.5e-11", "2.0000000000", "+20000000000.0", "0.5", "; one: 1"],
    ),
    (Check("coarse", None, "30", 42.4, 25.0, n_tests=1), ["42 ± 25", "30.0", "+0.5", "–", ""]),
    (Check("a bound", True, "> 3", 4.25, 0.5, n_tests=1), ["4.25 ± 0.50", "> 3", "–", "–", ""]),
    (Check("no spread", True, "3", 4.25, 0.0, n_tests=1), ["4.250000 ± 0.000000", "3", "–", "–", ""]),
    (
        Check("as printed", False, "0.25", 0.5, 0.125, form="printed", n_tests=3),
        ["0.50 ± 0.12", "0.250", "+2.0", "–", ""],
    ),
]  # fmt: skip
SIGNS = {True: "✓ holds", False: "✗ fails", None: "? open"}


def claim_of(name: str, where: str, expected: str = "confirmed") -> Claim:
    return Claim(name, where, f"{name} is so.", "By looking.", "none", expected, lambda _: [], ())


@pytest.fixture(scope="module")
def sample() -> Sample:
    run = RUNS[MAIN]._replace(quick=300)
    return draw(adiabatic_particles.simulate, run, size="quick", seed=5)


@pytest.fixture(scope="module")
def result(sample) -> AuditResult:
    claims = [
        claim_of("X2", "sec. 4.2"), claim_of("L1", "sec. 2.1"), claim_of("C1", "sec. 4.1"),
        claim_of("X10", "sec. 2.1"), claim_of("M3", "nowhere", "misprint"),
        claim_of("D1", "secs. 3.10 and 2"),
    ]  # fmt: skip
    checks = [[check for check, _ in CHECKS], *[[check for check, _ in CHECKS[:2]]] * 5]
    verdicts = ["refuted", "confirmed", "confirmed", "confirmed", "misprint", "confirmed"]
    findings = [
        Finding(claim.id, verdict, found, 0.12345)
        for claim, verdict, found in zip(claims, verdicts, checks, strict=True)
    ]
    nobody = sample._replace(
        run=RUNS[LOST], s=sample.s[:0], t_in=sample.t_in[:0], t_out=sample.t_out[:0], n_collisions=0,
        takes_part=sample.takes_part[:0], phase_s=sample.phase_s[:0], n_undecided=7, n_undefined=2,
    )  # fmt: skip
    return AuditResult(AuditSettings(seed=5), claims, findings, {MAIN: sample, LOST: nobody}, 12.34567)


def as_text(cell: str) -> str:
    return html.unescape(re.sub("<[^>]*>", "", re.sub(r"<br>.*", "", cell))).replace("−", "-").strip()


def rows_of(table: str) -> list[list[str]]:
    return [[as_text(cell) for cell in re.findall(r"<td.*?</td>", row, re.S)] for row in table.split("</tr>")]


@pytest.fixture(scope="module")
def page(result) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "ALL", [])
        patch.setattr(figures, "FIRST", figures.FIRST._replace(needs=("none",)))
        return audit_page.to_html(audit_page.to_data(result), {MAIN: result.samples[MAIN]})


def test_the_page_has_the_numbers_of_each_check(page):
    part = page.partition('<h3 id="X2">')[2].partition("</table>")[0]
    found = [row for row in rows_of(part.partition("<tbody>")[2]) if row]
    assert len(found) == len(CHECKS)
    for row, (check, columns) in zip(found, CHECKS, strict=True):
        form = "printed: " if check.form == "printed" else ""
        assert row == [f"{form}{check.what}", *columns, SIGNS[check.holds]]


def test_claims_stand_in_groups_by_section_letter_and_number(page):
    """A claim of no section stands last; section 3.10 is not 3.1."""
    assert re.findall(r'<h3 id="(\w+)">', page) == ["L1", "X10", "C1", "X2", "M3", "D1"]
    assert re.findall("<h2>(.*?)</h2>", page)[2:5] == [
        "Claims, in the paper&#39;s order", "Misprints and gaps", "Beyond the paper",
    ]  # fmt: skip
    assert audit_page._place({"where": "nowhere", "id": "M3"}) == ([9], "M", 3)
    assert audit_page._place({"where": "secs. 3.1 and 2", "id": "D12"}) == ([3, 1], "D", 12)


def test_the_main_numbers_are_those_of_theory_and_of_the_run(page, sample):
    part = page.partition("The main numbers")[2].partition("</table>")[0].partition("<tbody>")[2]
    found = [row for row in rows_of(part) if row]
    limit, here = theory.predict(scenes.load("moving-cap")), theory.at_energy(scenes.load("moving-cap"), 1e7)
    gain = sample.s[:, 0]
    is_free = np.isnan(sample.t_in[:, 0]).all(axis=1)[sample.takes_part]
    p = is_free.mean()
    for row, there, of_limit, predicted, value, error in (
        (found[0], ["0.1213 ± 0.0033", "0.122768"], float(limit.m1), here.mean_s, gain.mean(),
         gain.std(ddof=1) / len(gain) ** 0.5),
        (found[1], ["0.3878", "0.38474"], float(limit.p_nc), here.p_nc, p,
         math.sqrt(p * (1 - p) / len(is_free))),
    ):  # fmt: skip
        assert row[:1] == [MAIN]
        assert row[2:6] == [*there, f"{of_limit:.6f}", f"{predicted:.5f}"]
        shown, spread = map(float, row[6].split(" ± "))
        assert shown == pytest.approx(value, abs=6e-6)
        assert spread == pytest.approx(error, rel=1e-2)  # of a share, as if one more could tell
        assert float(row[7]) == pytest.approx((value - predicted) / error, abs=0.06)
    assert len(found) == 2


def test_the_summary_is_these_lines(result):
    lines = audit_page.to_text(audit_page.to_data(result)).splitlines()
    assert lines[:6] == [
        "! X2  refuted                       9/10  sec. 4.2",
        "      expected: confirmed",
        "      claim: coarse: 42 ± 25, expected 30",
        "  L1  confirmed                     2/2   sec. 2.1",
        "  C1  confirmed                     2/2   sec. 4.1",
        "  X10 confirmed                     2/2   sec. 2.1",
    ]
    assert lines[8] == ""
    assert lines[9].startswith("5 of 6 claims have their expected verdict. ")


def test_false_alarms_are_bounded_by_the_comparisons_there_are(result):
    alarms = audit_page.to_data(result)["false_alarms"]
    n = sum(check.n_tests for finding in result.findings for check in finding.checks)
    assert (alarms["tests"], alarms["bound"]) == (n, pytest.approx(n * alarms["level"]))
    assert alarms["level"] == pytest.approx(math.erfc(alarms["standard_errors"] / math.sqrt(2)), rel=1e-6)


def test_a_run_is_described_by_its_particles(result, sample):
    data = audit_page.to_data(result)
    found, nobody = data["runs"]
    gain = sample.s[:, 0]
    is_captured = np.isfinite(sample.t_in[:, 0]).any(axis=1)
    expected = {
        "name": MAIN, "scene": scenes.to_data(scenes.load("moving-cap")), "energy": 1e7, "cycles": 1,
        "particles": 300, "phases": list(RUNS[MAIN].phases), "seed": run_seed(5, RUNS[MAIN]),
        "followed": len(gain), "undecided": 0, "undefined": 0, "collisions": sample.n_collisions,
        "careful": sample.n_careful,
        "captured": pytest.approx(is_captured.mean()), "m1": pytest.approx(gain.mean()),
        "m1_error": pytest.approx(gain.std(ddof=1) / len(gain) ** 0.5),
        "sigma_w": pytest.approx(gain[~is_captured].std(ddof=1)), "seconds": round(sample.seconds, 3),
        "ns_per_collision": pytest.approx(sample.seconds * 1e9 / sample.n_collisions),
        "sha256": sample.sha256,
    }  # fmt: skip
    assert found == expected
    assert (nobody["captured"], nobody["m1"], nobody["sigma_w"]) == (0.0, None, None)
    assert (nobody["followed"], nobody["undecided"], nobody["undefined"]) == (0, 7, 2)
    assert nobody["ns_per_collision"] == pytest.approx(sample.seconds * 1e9)
    assert data["kernel_time_s"] == round(2 * sample.seconds, 3)
    assert (data["wall_time_s"], data["seed"], data["passed"]) == (12.346, 5, False)
    assert [one["seconds"] for one in data["findings"]] == [0.123] * 6
    assert [one["as_expected"] for one in data["findings"]] == [False, *[True] * 5]
