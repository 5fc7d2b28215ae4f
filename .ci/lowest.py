"""Print the lowest versions that pyproject.toml allows, as constraints for pip.

Usage: python .ci/lowest.py test > lowest.txt && pip install -e '.[test]' -c lowest.txt
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

FILE = Path(__file__).resolve().parent.parent / "pyproject.toml"
PROJECT = tomllib.loads(FILE.read_text("utf-8"))["project"]
REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)(?:\[(?P<extras>[\w,-]+)\])?(?:>=(?P<version>[\w.]+))?")


def lowest(requirements: list[str]) -> list[str]:
    """Return name==version for each requirement, and for those of the extras that it names."""
    found = []
    for requirement in requirements:
        parts = REQUIREMENT.fullmatch(requirement)
        if parts is None:
            sys.exit(f"{requirement!r} is not of the form NAME>=VERSION")
        if parts["name"] == PROJECT["name"]:
            for extra in (parts["extras"] or "").split(","):
                found += lowest(PROJECT["optional-dependencies"][extra])
        elif parts["version"] is None:
            sys.exit(f"{requirement!r} has no lowest version")
        else:
            found.append(f"{parts['name']}=={parts['version']}")
    return found


if __name__ == "__main__":
    print("\n".join(lowest([*PROJECT["dependencies"], f"{PROJECT['name']}[{','.join(sys.argv[1:])}]"])))
