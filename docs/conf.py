"""How the documentation site is built: `pip install -e '.[docs]'`, then `sphinx-build -W docs site`.

Sphinx with MyST, because the pages are Markdown that must read well in the repository too, because `-W`
makes every broken reference an error, and because autodoc shows signatures as they are. Formulas become
MathML when the site is built: a browser needs neither scripts nor a network for them.
"""

import os
import re
import shutil
import sys
import tomllib
from pathlib import Path
from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))

about = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
REPOSITORY = about["urls"]["Repository"] + "/blob/main/"

project = html_title = "Oscillating Mushrooms"
author = copyright = about["authors"][0]["name"]
version = release = about["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["generated", "scoreboard.md"]  # included, or tables by commands
html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_search_scorer = str(DOCS / "search.js")
html_theme_options = {
    "source_repository": about["urls"]["Repository"],
    "source_branch": "main",
    "source_directory": "docs/",
}
html_math_renderer = "mathml"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
# Lines of the protocol begin with > or <, which no lexer of JSON knows.
suppress_warnings = ["misc.highlighting_failure"]
autodoc_member_order = "bysource"
napoleon_use_ivar = True
napoleon_attr_annotations = False  # the signature has them
autodoc_type_aliases = {
    name: name
    for name in (
        *("ArrayLike", "BoolArray", "FloatArray", "Floats", "Gains", "IntArray"),
        *("Flowing", "Follow", "GivenLaw", "Outcome", "Question", "Scene", "Stepper", "Wall"),
    )
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

WHOLE = ("audit", "bench")  # folders that are on the site as they are


# Files outside docs/ that the site has as pages.
PAGES = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "theory/equations.md": "equations.md",
}


def new_figures(app: Any, name: str, text: list[str]) -> None:
    """Take a page's numbers from the commands and files that have them, its pictures from its code."""
    from docs import figures

    text[0] = figures.refreshed(text[0]).replace("](gallery/", "](generated/")


def in_the_repository(app: Any, name: str, text: list[str]) -> None:
    """Point links that leave docs/ at the pages that the site makes of them, or else at the repository."""
    folder = (DOCS / name).parent

    def address(found: re.Match[str]) -> str:
        target = (folder / found[1]).resolve()
        if target.is_relative_to(ROOT) and (page := PAGES.get(target.relative_to(ROOT).as_posix())):
            return f"]({os.path.relpath(DOCS / page, folder)}"
        if target.is_relative_to(DOCS) or not target.is_relative_to(ROOT):
            return found[0]
        return f"]({REPOSITORY}{target.relative_to(ROOT).as_posix()}"

    text[0] = re.sub(r"\]\((\.\./[^)#:]+)(?=[)#])", address, text[0])
    text[0] = re.sub(r"\]\((scoreboard)\.md", rf"]({REPOSITORY}docs/\1.md", text[0])


def included(app: Any, path: Path, parent: str, text: list[str]) -> None:
    """Point links of a page from outside docs/ at the site or the repository."""

    def address(found: re.Match[str]) -> str:
        target = (DOCS / path).parent.joinpath(found[1]).resolve()
        if target.is_relative_to(DOCS) and target.name not in exclude_patterns:
            return f"]({target.relative_to(DOCS).as_posix()}"
        return f"]({REPOSITORY}{target.relative_to(ROOT).as_posix()}"

    text[0] = re.sub(r"\]\(([^)#:]+)(?=[)#])", address, text[0])


def plain_docstring(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Turn what our docstrings write (`code`, |x|, a * b) into what the markup means by them."""
    found: list[str] = []
    is_shown = False  # in a part of a module's docstring that is set apart, as it is
    for line in lines:
        if what == "module" and line.startswith("    ") != is_shown and line:
            is_shown = not is_shown
            found += ["", "::", ""] if is_shown else [""]
        found.append(line if is_shown else _plain(line))
    lines[:] = found


def _plain(line: str) -> str:
    named = re.match(r"( {4}\w+(?:, \w+)+): ", line)
    if named:  # several attributes at once: one name for the markup
        line = named[1].replace(", ", ",") + line[named.end(1) :]
    parts = re.split(r"(`[^`]*`|(?<!\*)\*\w[\w ]*\w\*(?!\*))", line)
    for k, part in enumerate(parts):
        if part[:1] == "`" and len(part) > 2:
            parts[k] = f"``{part[1:-1]}``"
        elif k % 2 == 0:
            parts[k] = re.sub(r"([|*\\]|_(?=\W|$))", r"\\\1", part)
    return "".join(parts)


def bare_alias(
    app: Any, what: str, name: str, obj: Any, options: Any, arguments: str | None, answer: str | None
) -> list[str | None]:
    """Write an alias inside a union as one that stands alone: Sphinx shows its own class there."""
    return [text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text) for text in (arguments, answer)]


def no_alias(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out what only repeats a class's own list of attributes."""
    return True if (getattr(obj, "__doc__", "") or "").startswith("Alias for field") else None


def draw_gallery(app: Any) -> None:
    """Make the pictures of the pages; those that are there are kept until docs/generated/ is deleted."""
    from docs import pictures

    for page in DOCS.glob("*.md"):
        if not all((DOCS / "generated" / name).exists() for name, _ in pictures.blocks(page)):
            pictures.draw(page, DOCS / "generated")


def write_commands(_: Any) -> None:
    """Write what every command says of itself."""
    from typer.main import get_command
    from typer.testing import CliRunner

    from mushrooms.commands import app

    sections = []
    for name in get_command(app).commands:
        shown = CliRunner().invoke(app, [name, "--help"], prog_name="mushrooms", terminal_width=86)
        sections.append(f"## mushrooms {name}\n\n```none\n{shown.output.strip()}\n```\n")
    (DOCS / "generated").mkdir(exist_ok=True)
    (DOCS / "generated" / "commands.md").write_text("\n".join(sections), "utf-8")


def copy_reports(app: Any, error: Exception | None) -> None:
    """Put the reports beside the pages."""
    if error is None:
        for name in WHOLE:
            shutil.copytree(DOCS / name, Path(app.outdir) / name, dirs_exist_ok=True)


def whole_options(app: Any, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    """Mark the names of options, which a narrow page would break after their hyphens."""
    if "body" in context:
        context["body"] = re.sub(r'<span class="pre">(?=--)', '<span class="pre option">', context["body"])


def as_mathml(is_block: bool) -> Any:
    """Return how a formula is written into a page."""

    def visit(self: Any, node: Any) -> None:
        formula = tex2mathml(node.astext(), as_block=is_block)
        self.body.append(f'<div class="math">{formula}</div>' if is_block else formula)
        raise SkipNode

    return visit


def setup(app: Any) -> None:
    """Register all of this."""
    app.add_html_math_renderer("mathml", (as_mathml(False), None), (as_mathml(True), None))
    app.connect("builder-inited", draw_gallery)
    app.connect("builder-inited", write_commands)
    app.connect("source-read", new_figures)
    app.connect("source-read", in_the_repository)
    app.connect("include-read", included)
    app.connect("autodoc-process-docstring", plain_docstring, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", bare_alias)
    app.connect("autodoc-skip-member", no_alias)
    app.connect("html-page-context", whole_options)
    app.connect("build-finished", copy_reports)
