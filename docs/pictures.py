"""The pictures of the documentation: code blocks of a page that name one, run one after the other.

A block whose first line is three backticks and `python NAME.svg` leaves a matplotlib `figure`, or bytes: they
are written as NAME.svg. The blocks of a page share their names, as a notebook's cells do. The site makes the
pictures of all pages, and the tests run the same blocks. `python -m docs.pictures` writes them into
docs/gallery, where the pages find them in the repository. `blocks.json` beside them holds a digest of the
code of each page, so that a test sees when it has changed.
"""

import json
import re
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from mushrooms.figures import style
from scene.files.writer import write_file

DOCS = Path(__file__).resolve().parent
GALLERY = DOCS / "gallery"
BLOCK = re.compile(r"^```python (\S+\.(?:svg|png|gif))\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path) -> list[tuple[str, str]]:
    """List the picture's name and the code of each block of a page."""
    return BLOCK.findall(page.read_text("utf-8"))


def draw(page: Path, folder: Path) -> None:
    """Run the blocks of a page and write their pictures.

    Args:
        page: a Markdown file.
        folder: for the pictures; made if it is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names: dict[str, Any] = {}
    for name, code in blocks(page):
        exec(compile(code, f"{page.name}: {name}", "exec"), names)
        picture = names.pop("figure")
        if isinstance(picture, Figure):
            picture = partial(style.save, picture, suffix=Path(name).suffix)
        write_file(folder / name, picture)


def digests() -> dict[str, str]:
    """Return a digest of the code of each page that makes pictures."""
    codes = {page.name: "".join(code for _, code in blocks(page)) for page in sorted(DOCS.glob("*.md"))}
    return {name: sha256(code.encode()).hexdigest() for name, code in codes.items() if code}


def main() -> None:
    """Write the pictures of all pages for the repository."""
    for page in DOCS.glob("*.md"):
        draw(page, GALLERY)
    write_file(GALLERY / "blocks.json", json.dumps(digests(), indent=1) + "\n")


if __name__ == "__main__":
    main()
