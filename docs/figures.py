"""The numbers of the pages that a command or a published file has: each page takes them from there.

On a page a region begins with `<!-- figures: NAME -->` and ends with `<!-- end -->`. What stands between them
is made by the function of that name in `REGIONS`. The site makes all regions anew whenever it is built.
`python -m docs.figures` writes them into the sources, so that they stand in the repository too. The tests
compare both.
"""

import re
import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from html import unescape
from pathlib import Path
from statistics import median

from conformance import vectors
from conformance.bench import record
from scene.files.writer import write_file

DOCS = Path(__file__).resolve().parent
REGION = re.compile(r"(<!-- figures: ([a-z-]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
HEADLINE = "moving-cap-1e7"
FAST = ("fast, lanes", "fast, careful", "fast, a call", "fast, trajectory")
# The steppers of the first table of the page on speed.
COMPARED = (
    *("fast, lanes", "fast, careful", "fast, a call", "fast, pairs", "lean C", "plain Python"),
    *("proof, 15 digits", "proof, 50 digits", "proof, 200 digits"),
    *("solve_ivp, rtol 1e-09", "steps, flight/100", "steps, flight/1000"),
    *("example in C", "example in JavaScript", "example in Python"),
)


def refreshed(text: str) -> str:
    """Return a page with all its regions made anew.

    Raises:
        KeyError: a region has a name that `REGIONS` does not know.
    """
    return REGION.sub(lambda found: f"{found[1]}\n{REGIONS[found[2]]()}\n\n{found[4]}", text)


def as_table(head: Sequence[str], rows: Sequence[Sequence[str]], n_left: int = 1) -> str:
    """Return a table in Markdown, its first columns left aligned and the others right."""
    marks = ["---"] * n_left + ["---:"] * (len(head) - n_left)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, marks, *rows))


def sentences(*parts: str) -> str:
    """Return a paragraph in lines as wide as those of the pages."""
    return textwrap.fill(" ".join(parts), 120, break_long_words=False, break_on_hyphens=False)


def bench() -> record.Record:
    """Return the published benchmark."""
    return record.read(DOCS / "bench" / "bench.json")


def significant(number: float) -> str:
    """Return a positive number to two significant digits, of more than three places as a power of ten."""
    text = f"{number:.2g}"
    return text if "e" in text else f"{float(text):g}"


def speed_in_short() -> str:
    """Return the sentences at the head of the page on speed."""
    found = bench()
    ns = {(p.workload, p.solver): median(p.ns) for p in found.points}
    on_lanes = [workload for workload, solver in ns if solver == "fast, lanes"]
    ensembles = [workload for workload in on_lanes if workload != "one-path"]
    lanes = [round(ns[workload, "fast, lanes"]) for workload in ensembles]
    gains = [round(ns[workload, "lean C"] / ns[workload, "fast, lanes"]) for workload in ensembles]
    proofs = [median(p.ns) / 1e6 for p in found.points if p.family == "proof"]
    here = [median(p.ns) / 1e6 for p in found.points if p.family == "proof" and p.workload == HEADLINE]
    worst = max(max(p.ulps) for p in found.points if p.solver in FAST)
    return sentences(
        f"In an ensemble one core computes a collision in {min(lanes)} to {max(lanes)} nanoseconds.",
        f"There, on {len(ensembles)} of [{len(on_lanes)} workloads](#the-simd-lanes-on-other-workloads),",
        f"`fast` is {min(gains)} to {max(gains)} times as fast as an event-driven solver in plain C.",
        "A single step of `fast` is slower than that solver.",
        "The worst [backward error](glossary.md#backward-error) of `fast` in this benchmark is",
        f"{worst:.1f} ulps; [longer searches](lanes.md#what-the-tests-do-not-show) found larger ones.",
        f"A proof takes {min(here):.1f} to {max(here):.1f} milliseconds on `{HEADLINE}`,",
        f"and {min(proofs):.1f} to {max(proofs):.0f} on all workloads.",
    )


def speed_of_one_collision() -> str:
    """Return the table of one workload."""
    found = bench()
    points = {p.solver: p for p in found.points if p.workload == HEADLINE}
    rows = [
        (
            solver,
            f"{float(f'{median(points[solver].ns):.4g}'):,.0f}",
            significant(max(points[solver].ulps)),
            f"{points[solver].wrong} of {found.questions}",
        )
        for solver in COMPARED
    ]
    return as_table(("stepper", "ns per collision", "worst backward ulps", "wrong walls"), rows)


def speed_of_lanes() -> str:
    """Return the table of all workloads that the lanes serve."""
    found = bench()
    ns = {(p.workload, p.solver): median(p.ns) for p in found.points}
    rows = []
    for drawn in found.workloads:
        if (drawn.name, "fast, lanes") in ns:
            lanes, lean = ns[drawn.name, "fast, lanes"], ns[drawn.name, "lean C"]
            rows.append((f"{drawn.name}: {drawn.what}", f"{lanes:.0f}", significant(lean / lanes)))
    return as_table(("workload", "lanes, ns per collision", "lean C over lanes"), rows)


def speed_of_growth() -> str:
    """Return how long a path keeps a digit."""
    growth = bench().growth
    lines = [
        f"- {name}: {'over ' if n >= growth.collisions else ''}{n:.0f}" for name, n in growth.lasts.items()
    ]
    return "\n".join(lines)


def size_of_corpus() -> str:
    """Return how many vectors there are, by kind and by level."""
    corpus = vectors.load("stress")
    kinds = Counter(vector.kind for vector in corpus)
    levels = Counter(vector.level for vector in corpus)
    return sentences(
        f"Corpus {vectors.manifest().corpus} holds {kinds['step']:,} steps,",
        f"{kinds['trajectory']} trajectories and {kinds['flow']} flows:",
        f"{levels['core']:,} of them at level core, {levels['extended']} at extended,",
        f"{levels['stress']} at stress.",
    )


def numbers_of_audit() -> str:
    """Return the first table of the audit's report: the paper's main numbers, predicted and simulated."""
    report = (DOCS / "audit" / "report.html").read_text("utf-8")
    table = report[report.index("<table") : report.index("</table>")]
    rows = [
        [
            " ".join(unescape(re.sub(r"<[^>]+>", "", cell)).split())
            for cell in re.findall(CELL, row, re.DOTALL)
        ]
        for row in re.findall(r"<tr.*?</tr>", table, re.DOTALL)
    ]
    # Two lines a cell where that keeps the table narrow enough for a telephone.
    short = [
        (f"{run}<br>{what}", f"{theory}<br>{there}", predicted, found.replace(" ± ", "<br>± "), pull)
        for run, what, there, theory, _, predicted, found, pull in rows[1:]
    ]
    head = ("run, number", "paper: theory, simulated", "predicted at E0", "simulated", "pull")
    return as_table(head, short)


CELL = r"<t[hd].*?</t[hd]>"


def summary_of_audit() -> str:
    """Return the audit's summary, as it is printed."""
    return f"```none\n{(DOCS / 'audit' / 'report.txt').read_text('utf-8').rstrip()}\n```"


REGIONS: dict[str, Callable[[], str]] = {
    "speed-in-short": speed_in_short,
    "speed-of-one-collision": speed_of_one_collision,
    "speed-of-lanes": speed_of_lanes,
    "speed-of-growth": speed_of_growth,
    "size-of-corpus": size_of_corpus,
    "numbers-of-audit": numbers_of_audit,
    "summary-of-audit": summary_of_audit,
}


def main() -> None:
    """Write all regions of all pages anew."""
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text("utf-8")
        again = refreshed(text)
        if again != text:
            write_file(page, again)
            print(f"written: {page}")


if __name__ == "__main__":
    main()
