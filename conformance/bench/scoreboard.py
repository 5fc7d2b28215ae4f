"""`python -m conformance.bench.scoreboard`: our steppers, the examples and the baselines side by side.

Writes docs/scoreboard.md: what passes, what fails, and why. One seed, level core; every answer has a minute
and every stepper ten, so that the slowest does not hold up the rest. Some 15 minutes on one core.
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from conformance import suite
from conformance.bench.baselines import NAMES
from conformance.harness.examples import Example, find_examples, find_kit_examples
from conformance.suite.result import Run
from conformance.suite.session import Limits
from scene.files.writer import write_file

PAGE = Path(__file__).parent.parent.parent / "docs" / "scoreboard.md"
SEED = 1
LIMITS = Limits(timeout=60.0, restarts=10, total=600.0)
OURS = {"fast": "fast", "plain": "conformance.plain"}
# The reference proves every answer; what it is to others it cannot be to itself, so it has no row.
LEFT_OUT = ("solve-ivp-1e-03", "solve-ivp-1e-12")  # slow, and like their neighbours
N_GROUPS = 3
KINDS = {
    "wrong numbers": "is off by",
    "an earlier hit was missed": "an earlier hit was missed",
    "wrong capture interval": "captured:",
}
HEAD = """# Scoreboard

This page shows the verdicts of `mushrooms check` at level core of corpus {corpus}, with seed {seed}. The
command `python -m conformance.bench.scoreboard` makes the page.

- `fast` and `plain` are our own steppers.
- The examples and the kits are in `conformance/harness/`. A kit lets an engine speak the protocol.
- The other steppers use simple methods and come from the [benchmark](speed.md#what-is-compared). `lean-c`
  is event-driven and does not check its answers. `steps-N` moves particles by fixed time steps of 1/N of
  a flight. `solve-ivp-TOLERANCE` uses scipy's integrator with event detection. The command
  `python -m conformance.bench.baselines NAME` runs one of them.

`pass`, `fail` and `other` count cases. `other` counts all [other verdicts](protocol.md#other-verdicts). A/B/C
counts passed answers by [precision class](protocol.md#precision-class). The class counts only answers that
passed, even if these are few. A run ends after 600 seconds.

Below the table, each stepper has a line that says what was graded ([how to read
it](protocol.md#the-last-line)). Up to three kinds of line say why a stepper is not accepted:

- *Fails most in*: the groups with the most failures, and their number.
- *Failures by kind*: `fail` counts the wrong answers that fit none of the other kinds.
- *Like a mutant*: a [mutant](glossary.md#mutant) is a stepper with one known mistake. It is asked up to 20
  of the questions that failed and up to 20 of those that passed. The line says how many of the former it
  fails too, and how many of the latter it fails. A stepper that fails most questions resembles every mutant
  that fails most questions. Then the line says little about the cause.

| stepper | verdict | pass | fail | other | A/B/C | seconds |
| --- | --- | ---: | ---: | ---: | ---: | ---: |
"""


class Graded(NamedTuple):
    """A row: a name, and the run, or why there is none."""

    name: str
    run: Run | None
    why_not: str = ""


def find_steppers(folder: Path) -> dict[str, Example]:
    """Return by name how each stepper of the page runs here, or why it cannot."""
    baselines = [name for name in NAMES if name not in LEFT_OUT]
    return {
        **{name: Example((sys.executable, "-m", module)) for name, module in OURS.items()},
        **{f"example in {language}": example for language, example in find_examples(folder).items()},
        **{f"kit, {engine}": example for engine, example in find_kit_examples(folder).items()},
        **{name: Example((sys.executable, "-m", "conformance.bench.baselines", name)) for name in baselines},
    }


def page(entries: list[Graded], corpus: str) -> str:
    """Return the page: a table, and for each that fails what fails and why."""
    lines = [HEAD.format(corpus=corpus, seed=SEED).rstrip("\n")]
    lines += [_row(entry) for entry in entries]
    lines += ["", "## What was graded, and what fails", ""]
    for entry in entries:
        if entry.run is None:
            lines.append(f"- **{entry.name}**: not run here: {entry.why_not}.")
            continue
        lines.append(f"- **{entry.name}**: {entry.run.scope()}.")
        lines += [f"  - {reason}." for reason in reasons(entry.run)]
    return "\n".join(lines) + "\n"


def reasons(run: Run) -> list[str]:
    """Say in a few lines what fails: the groups that fail most, the kinds of failure, the likest mutants."""
    failed = [r for r in run.results if r.verdict not in ("pass", "declined", "unsupported")]
    if not failed:
        return []
    groups = Counter(r.group for r in failed).most_common(N_GROUPS)
    found = [f"fails most in {', '.join(f'{group} ({n})' for group, n in groups)}"]
    kinds = Counter(next((k for k, sign in KINDS.items() if sign in r.why), r.verdict) for r in failed)
    found.append(f"failures by kind: {', '.join(f'{kind} ({n})' for kind, n in kinds.most_common())}")
    return found + [line.rstrip(".") for line in run.diagnosis]


def _row(entry: Graded) -> str:
    if entry.run is None:
        return f"| {entry.name} | not run | | | | | |"
    counts, classes = entry.run.counts(), "/".join(map(str, entry.run.classes().values()))
    other = sum(counts.values()) - counts["pass"] - counts["fail"]
    cells = [entry.name, entry.run.verdict(), counts["pass"], counts["fail"], other, classes]
    return f"| {' | '.join(map(str, cells))} | {entry.run.seconds:.0f} |"


def main() -> None:
    """Grade all and write the page."""
    entries = []
    with tempfile.TemporaryDirectory() as folder:
        for name, example in find_steppers(Path(folder)).items():
            run = suite.check(example.command, seed=SEED, limits=LIMITS) if example.command else None
            entries.append(Graded(name, run, example.why_not))
            print(f"{name}: {run.verdict() if run else example.why_not}", file=sys.stderr, flush=True)
    corpus = next(entry.run.corpus for entry in entries if entry.run)
    write_file(PAGE, page(entries, corpus))


if __name__ == "__main__":
    if sys.argv[1:]:
        print(f"{' '.join(sys.argv[1:])!r} is no option: it has none", file=sys.stderr)
        sys.exit(2)
    main()
