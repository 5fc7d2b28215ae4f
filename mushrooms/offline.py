"""`mushrooms check --questions` and `--answers`: the suite for programs that cannot hold a dialogue."""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from mushrooms import output
from scene.refusal import BadInput, check_seed

if TYPE_CHECKING:
    from conformance.suite.result import Run


def write_questions(path: Path, level: str, seed: int | None) -> None:
    """Write the questions of a run: as JSON lines into a .jsonl file, or else as CSV into a folder.

    Raises:
        BadInput: the level, the seed or the path is none; nothing is written then.
    """
    from conformance.suite import sheet_files
    from conformance.suite.run import NEW_SEEDS, choose
    from conformance.suite.sheet import Sheet

    choose(level)
    seed = secrets.randbelow(NEW_SEEDS) if seed is None else check_seed(seed, "--seed")
    if path.suffix == ".jsonl":
        output.check_file(path, (".jsonl",))
        sheet = Sheet(level, seed)
        n = sheet_files.write_lines(sheet, path)
    elif path.suffix:
        raise BadInput(f"--questions = {str(path)!r}, must end in .jsonl, or be a folder for CSV")
    else:
        with output.writable_folder(path) as folder:
            if any(folder.iterdir()):
                raise BadInput(f"--questions = {str(path)!r} is not empty, must be a new folder")
            sheet = Sheet(level, seed)
            n = sheet_files.write_tables(sheet, folder)
    more = f", {len(sheet.questions) - n} left out that CSV cannot hold" if n < len(sheet.questions) else ""
    print(f"{n} questions of level {level} and seed {seed}{more}: {path}")
    print(f"Grade the answers with: mushrooms check --questions {path} --answers FILE")


def grade(answers: Path, questions: Path | None, level: str, seed: int | None) -> Run:
    """Grade a file of answers.

    Args:
        answers: the file, or a folder of CSV files.
        questions: what they answer, where the key is beside it; else the fresh questions are proved anew.
        level: of the questions, where nothing else tells.
        seed: likewise; None where the answers tell it.

    Raises:
        BadInput: in one line.
    """
    from conformance.suite import sheet_files
    from conformance.suite.sheet import Sheet, grade_answers, signed

    found = sheet_files.read_answers(answers)
    if questions is not None:
        sheet = sheet_files.read_key(questions)
        if seed not in (None, sheet.seed):
            raise BadInput(f"--seed = {seed}, must be {sheet.seed}, that of the questions")
        return grade_answers(sheet, found)
    told = signed(found.echoes)
    if told is None and seed is None:
        raise BadInput("--answers: give --questions, or the --seed and --level that they were written with")
    level, seed = told if told is not None and seed is None else (level, seed)
    assert seed is not None
    return grade_answers(Sheet(level, check_seed(seed, "--seed")), found)
