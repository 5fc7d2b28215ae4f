"""What is published: typed packages, one version and address everywhere, a README with absolute links."""

import hashlib
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from conformance.cases.corpus import archive
from conformance.vectors import manifest

ROOT = Path(__file__).parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = PYPROJECT["project"]
REPOSITORY = PROJECT["urls"]["Repository"]


def published_readme(text: str) -> str:
    """Return the README as a package index shows it."""
    for change in PYPROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(change["pattern"], change["replacement"], text)
    return text


def test_every_package_says_that_it_is_typed():
    for package in PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]:
        assert (ROOT / package / "py.typed").is_file()


def test_the_published_readme_has_no_relative_link():
    readme = (ROOT / "README.md").read_text("utf-8")
    published = published_readme(readme)
    raw = REPOSITORY.replace("https://github.com/", "https://raw.githubusercontent.com/") + "/main/"
    links, found = (re.findall(r"\]\(([^)]+)\)", text) for text in (readme, published))
    assert len(links) > 20
    for link, address in zip(links, found, strict=True):
        start = raw if link.endswith(".svg") else f"{REPOSITORY}/blob/main/"
        assert address == (link if link.startswith("https://") else start + link)
    assert published_readme(published) == published


def test_the_citation_is_of_this_version():
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"\nrepository-code: {REPOSITORY}\n" in citation
    assert PROJECT["authors"] == [{"name": "The Oscillating Mushrooms authors"}]
    assert "family-names: Gelfreich" in citation
    assert PROJECT["urls"]["Paper"].endswith(re.search(r"doi: (\S+)", citation)[1])
    assert {PROJECT["version"], PROJECT["urls"]["Paper"], REPOSITORY} <= set(
        re.findall(r"[^\s(){},]+", (ROOT / "docs" / "cite.md").read_text("utf-8"))
    )


@pytest.mark.parametrize("name", ["ci.yml", "release.yml"])
def test_what_the_workflows_run_exists(name):
    text = (ROOT / ".github" / "workflows" / name).read_text("utf-8")
    for path in re.findall(r"\.ci/[\w.]+", text):
        assert (ROOT / path).is_file()
    assert text.count("id-token: write") == 1  # only the job that publishes may sign


def test_the_archive_of_the_corpus_proves_itself(tmp_path, capsys):
    """Twice the same bytes; what is in it needs nothing else."""
    for name in ("a.zip", "b.zip"):
        assert archive(tmp_path / name) == 0
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    told = capsys.readouterr().out
    assert hashlib.sha256((tmp_path / "a.zip").read_bytes()).hexdigest() in told
    assert manifest().digest in told
    with zipfile.ZipFile(tmp_path / "a.zip") as members:
        members.extractall(tmp_path)
    command = [sys.executable, "-I", "verify.py", "corpus/static-cap.jsonl"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.endswith(" proved\n")
