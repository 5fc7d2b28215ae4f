"""The pages of the site do what they say: every block of code is run, here or in tests/test_docs.py."""

from __future__ import annotations

import doctest
import importlib
import json
import re
import shlex
from pathlib import Path

import pytest
from support.depth import deep_but
from support.refusals import assert_refused

from mushrooms import gallery
from scene import load
from scene.load import catalogue, catalogue_text, from_data

DOCS = Path(__file__).parent.parent / "docs"
FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Blocks that another test runs, by page and first line; "" is a line for a shell that installs something.
RUN_ELSEWHERE = {
    "your-stepper.md": {"python", "console"},  # test_docs: the tutorial, one block after the other
    "scenes.md": {"toml", "text", "python", "console"},  # test_docs: files loaded, doctests
    "protocol.md": {"json"},  # test_docs: against the schema and the plain stepper
    "corpus.md": {"json"},  # test_docs: the published line
    "cite.md": {"bibtex"},  # test_house_package
    "clusters.md": {"bash"},  # test_docs: with few particles
    "audit.md": {""},  # test_mushrooms_audit: the commands, and the runs that they make taken up
    "ensembles.md": {"", "python"},  # test_mushrooms_simulate, with fewer particles
}
INSTALLS = ("pip install", "mushrooms --version", "git clone", "cd oscillating-mushrooms")


MODULES = [
    (page.name, name)
    for page in sorted((DOCS / "api").glob("*.md"))
    for name in re.findall(r"automodule:: (\S+)", page.read_text("utf-8"))
]


def undocumented(page: str, name: str) -> list[str]:
    """List the public names of a module that `dir` does not find, or that its page says nothing of.

    The page says what the docstring does of a function or class under its own name, and names the others.
    """
    module, text = importlib.import_module(name), (DOCS / "api" / page).read_text("utf-8")
    made_here = [
        n for n, one in vars(module).items() if n[0] != "_" and getattr(one, "__module__", 0) == name
    ]
    public = getattr(module, "__all__", made_here)
    own = [n for n in public if getattr(getattr(module, n), "__name__", "") == n]
    told = {n for n in own if getattr(module, n).__doc__}
    return [n for n in public if not (n in dir(module) and (n in told or f"`{n}`" in text))]


@pytest.mark.parametrize(("page", "name"), MODULES)
def test_every_public_name_is_found_and_documented(page, name):
    assert undocumented(page, name) == []


def test_a_public_name_that_is_hidden_is_seen(monkeypatch):
    module = importlib.import_module("fast")
    monkeypatch.setattr(module, "nowhere", 1, raising=False)
    monkeypatch.setattr(module, "__all__", ["nowhere", *module.__all__])
    assert undocumented("fast.md", "fast") == ["nowhere"]
    monkeypatch.delattr(module, "__dir__")
    assert set(undocumented("fast.md", "fast")) >= {"simulate", "Ensemble"}


def blocks(page: Path) -> list[tuple[str, str]]:
    """List the first line and the text of each block of a page."""
    return FENCE.findall(page.read_text("utf-8"))


@pytest.mark.parametrize("name", ["start.md", "theory.md", "your-scene.md", "scenes.md"])
def test_the_python_of_a_page_does_what_it_says(name):
    found = doctest.testfile(str(DOCS / name), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert found.attempted >= 4
    assert found.failed == 0


@pytest.mark.parametrize("name", deep_but(["start.md", "your-scene.md", "scenes.md"], "scenes.md"))
def test_the_commands_of_a_page_do_what_they_say(command_line, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    for first, text in blocks(DOCS / name):
        kind, _, file = first.partition(" ")
        if kind == "toml":
            (tmp_path / file).write_text(text, "utf-8")
        if kind != "console":
            continue
        command, _, shown = text.removeprefix("$ mushrooms ").partition("\n")
        command, _, target = command.partition(" > ")
        code, out, _ = command_line(*shlex.split(command))
        assert code == 0
        if target:
            (tmp_path / target).write_text(out, "utf-8")
            load(tmp_path / target)
        assert re.search(re.escape(shown.strip()).replace(r"\.\.\.", ".*?"), out, re.DOTALL), out


@pytest.mark.deep
def test_the_pictures_of_the_pages_are_made(tmp_path):
    """All of them, by the code that stands above each; a page shows every picture that it makes."""
    for page in gallery.pages(DOCS):
        shown = re.findall(r"\]\(generated/([^)]+)\)", page.read_text("utf-8"))
        made = gallery.draw(page, tmp_path)
        assert [path.name for path in made] == [name for name, _ in gallery.blocks(page)]
        assert sorted(path.name for path in made) == sorted(shown)
        for path in made:
            start = {".svg": b"<?xml", ".png": b"\x89PNG", ".gif": b"GIF89a"}[path.suffix]
            assert path.read_bytes().startswith(start)


def test_a_block_that_fails_is_not_passed_over(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python a.svg\nfigure = nothing\n```\n")
    with pytest.raises(NameError):
        gallery.draw(page, tmp_path / "pictures")


def is_run(name: str, first: str, text: str) -> bool:
    """Tell whether a test runs a block of a page."""
    kind = first.partition(" ")[0]
    return (
        kind in RUN_ELSEWHERE.get(name, ())
        or kind.startswith("{")  # a directive: Sphinx acts on it, and warnings are errors
        or (kind == "python" and (" " in first or text.startswith(">>>")))
        or kind in ("console", "toml")
        or all(line.startswith(INSTALLS) for line in text.splitlines())
    )


def unaccounted(name: str, page: str) -> list[str]:
    """List the first lines of blocks that no test runs."""
    return [first for first, text in FENCE.findall(page) if not is_run(name, first, text)]


def test_every_block_of_the_site_is_run():
    pages = [path for path in DOCS.rglob("*.md") if "generated" not in path.parts]
    assert {
        page.name: missed for page in pages if (missed := unaccounted(page.name, page.read_text("utf-8")))
    } == {}
    runs = {
        page.name for page in pages if re.search(r"^(```console|>>>)", page.read_text("utf-8"), re.MULTILINE)
    }
    assert runs == {f"{name}.md" for name in ("start", "your-scene", "theory", "scenes", "your-stepper")}


@pytest.mark.parametrize(
    "planted", ["```python\nx = 1\n```\n", "```\nrm -r x\n```\n", "```yaml\na: 1\n```\n"]
)
def test_a_block_that_nobody_runs_is_seen(planted):
    assert len(unaccounted("start.md", planted)) == 1


def test_scenes_are_printed_as_files_to_begin_from(command_line, tmp_path):
    for name in catalogue():
        code, out, _ = command_line("scenes", name, "--toml")
        assert (code, out) == (0, catalogue_text(name).rstrip("\n") + "\n")
    assert from_data(json.loads(command_line("scenes", "moving-cap", "--json")[1])) == load("moving-cap")
    for arguments in (["nowhere"], ["--toml"]):
        assert_refused(command_line("scenes", *arguments), "moving-cap")
