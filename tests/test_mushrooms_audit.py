"""`mushrooms audit`: a report that is complete, stands alone and goes on; its runs on disk are taken up."""

import json
import re
import shlex
import shutil
from functools import partial
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from support import adiabatic_particles
from support.depth import deep_among, deep_but
from support.harm import held
from support.pages import assert_stands_alone
from support.refusals import assert_refused, one_line
from support.schemas import validator

import fast
import scene as scenes
from mushrooms.audit import command as audit, figures, page as audit_page, session
from mushrooms.audit.claim import AuditSteppers, Check, Finding
from mushrooms.audit.claims import all_claims, select_claims
from mushrooms.audit.runs import RUNS, Sample, Simulation, draw, run_seed, scene_of
from mushrooms.audit.session import AuditResult, AuditSettings
from mushrooms.folders import locked
from mushrooms.store import conduct
from mushrooms.store.run import attributes_of
from scene.named import SCENES

pytestmark = pytest.mark.usefixtures("unsynced")
FIGURES = ("X1", "X2")
EVERY_FIGURE = tuple(sorted({picture.claim for picture in figures.ALL}))


@pytest.fixture
def call(command_line, monkeypatch):
    monkeypatch.setattr(fast, "simulate", adiabatic_particles.simulate)
    monkeypatch.setattr(fast, "go_on", adiabatic_particles.go_on)
    monkeypatch.setattr(figures, "ALL", [])  # pictures take most of the time: they are drawn elsewhere
    return partial(command_line, "audit")


@pytest.fixture(scope="module")
def everything():
    """A result that has every claim of the claims, and no samples."""
    claims = all_claims()
    checks = [
        Check("as it is", True, "0.5", 0.51, 0.01, 0.002, "claim", 1, "a note"),
        Check("as printed", False, "> 0", form="printed", note="fails"),
        Check("unclear", None, "<= 0.1", 0.2, None, 0.01, "corrected", 1, "n = 5 <b>&"),
        Check("not a number", False, "1", float("nan"), float("nan"), 0.0, "claim", 1),
    ]
    findings = [Finding(claim.id, claim.expected, checks, 0.1) for claim in claims]
    return AuditResult(AuditSettings(), claims, findings, {}, 12.3)


def samples_of(pictures):
    """Draw what the figures need, few particles of each run."""
    needed = {name for picture in pictures for name in picture.needs}
    return {
        name: session.draw(
            adiabatic_particles.simulate, each._replace(quick=min(each.quick, 2000)), size="quick", seed=1
        )
        for name, each in session.RUNS.items()
        if each.quick and name in needed
    }


def test_the_report_has_every_id_and_meets_its_published_schema(everything):
    data = json.loads(audit_page.to_json(audit_page.to_data(everything)))
    wanted = {f"{letter}{k}" for letter, n in (("M", 13), ("X", 8), ("L", 7)) for k in range(1, n + 1)}
    assert wanted <= {finding["id"] for finding in data["findings"]}
    for finding in data["findings"]:
        fields = ("where", "statement", "method", "tolerance", "expected", "verdict")
        assert all(finding[field] for field in fields)
        assert (finding["checks"][0]["value"], finding["checks"][0]["error"]) == (0.51, 0.01)
    schema = validator("report").schema
    closed = {name: part | {"additionalProperties": False} for name, part in schema["$defs"].items()}
    jsonschema.Draft202012Validator(schema | {"$defs": closed}).validate(data)  # all fields are described
    del data["findings"][0]["verdict"]
    with pytest.raises(jsonschema.ValidationError, match="verdict"):
        validator("report").validate(data)


@pytest.mark.parametrize("ids", deep_among([FIGURES, EVERY_FIGURE], EVERY_FIGURE))
def test_the_page_loads_nothing_from_elsewhere_and_shows_every_figure(everything, ids, monkeypatch):
    monkeypatch.setattr(figures, "ALL", [each for each in figures.ALL if each.claim in ids])
    page = audit_page.to_html(audit_page.to_data(everything), samples_of(figures.ALL))
    pictures = assert_stands_alone(page, links=[audit_page.PAPER])
    assert len(pictures) == len(figures.ALL) + 1  # and the first screen's
    assert "http" not in re.sub('src="data:[^"]*"', "", page).replace(audit_page.PAPER, "")
    assert len(page) < 1.2e6
    assert "The main numbers" in page
    assert "n = 5 &lt;b&gt;&amp;" in page
    assert not any(re.search(r"peak 0\.\d{0,3} wide", picture) for picture in pictures)  # numbers are not cut
    for claim in everything.claims:
        assert f'id="{claim.id}"' in page


def test_the_summary_tells_what_is_not_as_expected(everything):
    findings = [*everything.findings[:-1], everything.findings[-1]._replace(verdict="refuted")]
    text = audit_page.to_text(audit_page.to_data(everything._replace(findings=findings)))
    assert "! N6  refuted" in text
    assert "expected: confirmed" in text
    assert "corrected: unclear" in text
    assert f"{len(findings) - 1} of {len(findings)} claims" in text


@pytest.fixture
def blocks(monkeypatch, request):
    """Return the list of blocks followed, (run's seed, first particle); a parameter says which breaks off.

    A resumed run's first few particles, followed again to see whether they come out the same, are none.
    """
    followed, last = [], getattr(request, "param", None)
    monkeypatch.setattr(conduct, "MOST_BLOCK", 4096)

    def counted(scene, **options):
        if options["n_particles"] != conduct.PROBED:
            followed.append((options["seed"], options["first"]))
            if len(followed) == last:
                raise KeyboardInterrupt
        return adiabatic_particles.go_on(scene, **options)

    monkeypatch.setattr(fast, "go_on", counted)
    return followed


@pytest.mark.parametrize("blocks", [3], indirect=True)
def test_a_broken_off_audit_goes_on(call, tmp_path, blocks):
    assert call("--only", "X5", "--out", tmp_path).code == 130
    fresh = call("--only", "X5", "--out", tmp_path, "--resume", "--json").data()
    assert len(blocks) == len(set(blocks)) + 1 == 7  # two runs of three blocks
    assert [finding["id"] for finding in fresh["findings"]] == ["X5"]
    assert {run["name"] for run in fresh["runs"]} == {"ergodic@1e6", "ergodic@1e7"}
    assert json.loads((tmp_path / "report.json").read_text("utf-8")) == fresh
    names = ["findings", "report.html", "report.json", "report.txt", "runs"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    again = call("--only", "X5", "--out", tmp_path, "--resume", "--json").data()
    assert len(blocks) == 7
    assert again["runs"] == fresh["runs"]
    assert again["findings"] == fresh["findings"]


def test_no_run_is_replaced_and_broken_findings_are_made_again(call, tmp_path, blocks):
    call("--only", "X5", "--out", tmp_path)
    before = held(tmp_path)
    for more, words in (
        (["--resume", "--seed", 1], ["holds another run: seed = ", " there, ", "asked for", "ergodic@1e7"]),
        ([], [str(tmp_path / "runs" / "ergodic@1e7"), "--resume takes it up"]),
    ):
        assert_refused(call("--only", "X5", "--out", tmp_path, *more), *words)
        assert held(tmp_path) == before
    for path in (tmp_path / "findings").iterdir():
        content = path.read_bytes()
        path.write_bytes(content[:90] + bytes([content[90] ^ 1]) + content[91:])
    assert call("--only", "X5", "--out", tmp_path, "--resume").code == 0
    assert call("--only", "N6", "--out", tmp_path).code == 0  # it has no runs
    assert len(blocks) == 6


def test_without_a_folder_there_is_nothing_to_take_up(everything):
    """Nor without being told to."""
    claim = next(one for one in everything.claims if one.id == "M8")
    assert session._kept(claim, AuditSettings(resume=True)) == {}


def test_what_a_killed_audit_was_writing_is_taken_away(call, tmp_path):
    (tmp_path / "findings").mkdir()
    left = tmp_path / ".report.html.7.part", tmp_path / "findings" / ".M8.finding.7.part"
    other = tmp_path / ".picture.svg.7.part"  # somebody else's, and under way perhaps
    for path in (*left, other):
        path.write_bytes(b"half of it")
    assert call("--only", "M8", "--out", tmp_path, "--resume").code == 0
    assert [path.exists() for path in (*left, other)] == [False, False, True]


def test_what_other_sources_found_is_found_again(call, tmp_path, monkeypatch):
    """A claim's code had changed and its words had not: what the old code said was told as the new one's."""
    assert call("--only", "X5", "--out", tmp_path).code == 0
    monkeypatch.setattr(session, "examine", lambda claim, *_: Finding(claim.id, "refuted", [], 0.0))
    assert call("--only", "X5", "--out", tmp_path, "--resume").code == 0
    monkeypatch.setattr(session, "code", lambda: "of another day")
    done = call("--only", "M8", "--out", tmp_path, "--resume")
    assert done.code == 1
    assert "! X5  refuted" in done.out  # neither given up nor taken over
    assert "! M8  refuted" in done.out
    assert "(expected: confirmed)" in (tmp_path / "report.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("name", "is_other"),
    [
        ("audit/claims/printed.py", True),
        ("audit/claims.toml", True),
        ("audit/page.py", False),
        ("scene/catalogue/moving-cap.toml", True),
        ("fast/kernel/scalar_step.py", True),
        ("theory/finite_energy/frozen_rates.json", True),
    ],
)
def test_a_byte_of_the_sources_makes_other_code(tmp_path, monkeypatch, name, is_other):
    """Measured rates are one: predictions at an energy are made of them. How claims are shown is none."""
    for package in (session.scene, session.fast, session.theory):
        place = Path(package.__path__[0])
        shutil.copytree(place, tmp_path / place.name, ignore=shutil.ignore_patterns("__pycache__"))
        monkeypatch.setattr(package, "__path__", [str(tmp_path / place.name)])
    here = Path(session.__file__)
    shutil.copytree(here.parent, tmp_path / "audit", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(session, "__file__", str(tmp_path / "audit" / here.name))
    before = session.code()
    assert session.code.__wrapped__() == before
    with (tmp_path / name).open("ab") as file:
        file.write(b"\n")
    assert (session.code.__wrapped__() != before) is is_other


def test_sources_are_looked_at_before_anything_is_examined(tmp_path, monkeypatch):
    """What is edited while an audit runs would be told as what had run."""
    order = []

    def simulate(*_, **__):
        order.append("simulated")
        raise InterruptedError

    monkeypatch.setattr(session, "code", lambda: order.append("code") or "of today")
    monkeypatch.setattr(
        session, "examine", lambda claim, *_: order.append(claim.id) or Finding(claim.id, "refuted", [], 0.0)
    )
    steppers, settings = AuditSteppers(simulate, fast.trajectory, fast.flow), AuditSettings(folder=tmp_path)
    with pytest.raises(InterruptedError):
        session.conduct(steppers, settings, claims=select_claims("N6,X5"))
    assert order[0] == "code"
    assert order[-1] == "simulated"


@pytest.mark.deep
def test_resumed_with_other_claims_a_report_has_both(call, tmp_path, blocks):
    """Never fewer: what other settings would leave out is not given up."""
    for ids, wanted in (("X5,N6", "X5,N6"), ("M10", "M10,X5,N6"), ("N6", "M10,X5,N6")):
        data = call("--only", ids, "--out", tmp_path, "--resume", "--json").data()
        assert [finding["id"] for finding in data["findings"]] == wanted.split(",")
    assert len(blocks) == 6
    before = (tmp_path / "report.json").read_bytes()
    for more in (["--seed", 1], ["--full"]):
        done = call("--only", "N6", "--out", tmp_path, "--resume", *more)
        assert_refused(done, "a report of 3 claims", "seed = 0; 1 are asked for")
    assert (tmp_path / "report.json").read_bytes() == before


def test_one_audit_holds_a_folder(call, tmp_path):
    with locked(tmp_path):
        assert_refused(call("--only", "M3", "--out", tmp_path), "one run at a time")
    assert list(tmp_path.iterdir()) == []


SMALL = {
    "breathing": Simulation("breathing-circle", 60.0, 100, 270, n_cycles=2, phases=(0.25, 0.5)),
    "mouth": Simulation("only-mouth", 60.0, 100, 270, phases=(0.1, 0.5, 0.9)),
    "cycles": Simulation("moving-cap", 40.0, 100, 270, n_cycles=3),
}
N_QUICK, SEED = 100, 5


@pytest.fixture
def followed(followed, monkeypatch):
    """Have small blocks; what is followed, probes among it: first particle, how many, cycles."""
    monkeypatch.setattr(conduct, "MOST_BLOCK", 64)
    return followed


def ranges(followed):
    """Return the ranges that were followed, (first particle, how many), without probes."""
    return [(first, n) for first, n, _, _ in followed if n != conduct.PROBED]


def kept(folder, run, size="quick", *, resume=True, seed=SEED):
    """Return a run's sample as an audit in the folder has it."""
    audit.check_runs(folder, [run], seed, resume)
    return draw(
        partial(audit.follow_run, folder / "runs" / run.name, resume), run, size=size, seed=seed, threads=1
    )


def at_once(run, size="quick"):
    return draw(fast.simulate, run, size=size, seed=SEED, threads=1)


def assert_same(found, wanted):
    """Hold that two samples are one to the bit; times are none."""
    for name in set(Sample._fields) - {"run", "seconds"}:
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


def made(command_line, run, folder, n, *more):
    """Make a run as the audit's command says, with n particles."""
    words = shlex.split(audit.command(run, "quick", SEED, folder))[1:]
    words[words.index("--particles") + 1] = n
    return command_line(*words, "--threads", 1, "--json", *more).data()


@pytest.mark.parametrize("name", deep_but(SMALL, "breathing"))
def test_a_kept_run_is_the_one_at_once_and_quick_is_the_begin_of_full(tmp_path, followed, name):
    run = SMALL[name]
    quick, full = at_once(run), at_once(run, "full")
    followed.clear()
    assert_same(kept(tmp_path, run, resume=False), quick)
    assert ranges(followed) == [(0, 64), (64, 36)]
    assert_same(kept(tmp_path, run, "full"), full)
    assert ranges(followed)[2:] == [(64, 64), (128, 64), (192, 64), (256, 14)]
    assert_same(kept(tmp_path, run), quick)  # of the larger run
    assert len(ranges(followed)) == 6
    np.testing.assert_array_equal(quick.s, full.s[: quick.n])


@pytest.mark.parametrize("name", deep_but(["breathing", "mouth"], "mouth"))
def test_what_simulate_has_made_is_taken_up(command_line, tmp_path, followed, name):
    """One with more particles too; and the audit's report tells the digest that `simulate` prints."""
    run = SMALL[name]
    summary = made(command_line, run, tmp_path, N_QUICK)
    found = kept(tmp_path, run)
    assert found.sha256 == summary["sha256"]
    assert_same(found, at_once(run))
    larger = made(command_line, run, tmp_path, 300)
    followed.clear()
    assert_same(kept(tmp_path, run), found)
    wanted = kept(tmp_path, run, "full")
    assert ranges(followed) == []
    assert_same(wanted, at_once(run, "full"))
    for number in (1, 3):  # broken off there: only what the audit needs is followed
        (tmp_path / "runs" / run.name / "blocks" / f"{number}.marker").unlink()
    followed.clear()
    assert_same(kept(tmp_path, run), found)
    assert ranges(followed) == [(64, 64)]
    assert made(command_line, run, tmp_path, 300)["sha256"] == larger["sha256"]
    assert ranges(followed)[1:] == [(192, 64)]


def test_another_run_or_one_in_use_is_refused_before_anything_is_followed(command_line, tmp_path, followed):
    run = SMALL["mouth"]
    made(command_line, run, tmp_path, N_QUICK)
    followed.clear()
    place = str(tmp_path / "runs" / run.name)
    seeds = f"seed = {run_seed(SEED, run)} there, {run_seed(6, run)} asked for"
    for change, words in (
        ({"seed": 6}, [place, seeds]),
        ({"run": run._replace(phases=(0.1, 0.5))}, ["phases = [0.1, 0.5, 0.9] there, [0.1, 0.5] asked for"]),
        ({"run": run._replace(phases=())}, ["phases = [0.1, 0.5, 0.9] there, [] asked for"]),
        ({"resume": False}, [place, "--resume takes it up"]),
    ):
        line = one_line(kept, tmp_path, **{"run": run, **change})
        assert all(word in line for word in words), line
    with locked(tmp_path / "runs" / run.name):
        assert "one run at a time" in one_line(kept, tmp_path, run)
    assert followed == []
    made(command_line, run, tmp_path, N_QUICK, "--cycles", 2)
    followed.clear()
    assert "cycles = 2 there, 1 asked for: a run only grows" in one_line(kept, tmp_path, run)
    assert followed == []


@pytest.mark.usefixtures("followed")
def test_a_run_is_held_while_the_audit_follows_it(command_line, tmp_path, monkeypatch):
    run, go_on = SMALL["mouth"], fast.go_on
    words = shlex.split(audit.command(run, "quick", SEED, tmp_path))[1:]
    refused = []

    def meanwhile(scene, **options):
        monkeypatch.setattr(fast, "go_on", go_on)
        refused.append(command_line(*words))
        return go_on(scene, **options)

    monkeypatch.setattr(fast, "go_on", meanwhile)
    assert kept(tmp_path, run).n_particles == N_QUICK
    assert_refused(refused[0], "one run at a time")


def test_the_commands_of_an_audit_make_its_runs(command_line, tmp_path, monkeypatch):
    """Each asks for what the audit asks for, of a scene that `simulate` knows; nothing is made yet."""
    monkeypatch.chdir(tmp_path)
    for more, size in (([], "quick"), (["--full"], "full")):
        lines = command_line("audit", "--commands", "--out", "here", "--seed", 3, *more).out.splitlines()
        runs = audit.needed(all_claims(), size)
        assert {run.name for run in runs} == {name for name, run in RUNS.items() if run.n_particles(size)}
        assert len({run_seed(3, run) for run in runs}) == len(runs)
        for line, run in zip(lines, runs, strict=True):
            assert scene_of(run).name == run.scene
            phases = f"--phases {','.join(map(str, run.phases))} " if run.phases else ""
            assert line == (
                f"mushrooms simulate {run.scene} --particles {run.n_particles(size)} --energy {run.energy}"
                f" --cycles {run.n_cycles} --seed {run_seed(3, run)}"
                f" {phases}--out here/runs/{run.name} --resume"
            )
    assert len(command_line("audit", "--commands", "--only", "X5", "--json").data()) == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", SCENES)
def test_the_audit_s_scenes_are_known_by_name(command_line, tmp_path, name):
    for kind in ("toml", "json"):
        path = tmp_path / f"a.{kind}"
        path.write_text(command_line("scenes", name, f"--{kind}").out)
        assert scenes.load(path) == SCENES[name]


@pytest.mark.usefixtures("followed")
def test_without_phases_a_run_says_what_it_always_said(tmp_path):
    run = SMALL["cycles"]
    kept(tmp_path, run)
    place = tmp_path / "runs" / run.name
    assert "phases" not in attributes_of(place)
    assert "phases" not in audit.spec_of(run, SEED).to_data()  # nor in what markers are held to
    assert not list(place.rglob("phase*"))
