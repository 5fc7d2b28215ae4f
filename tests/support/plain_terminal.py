"""Forget what a shell or a CI service says of its terminal: tests compare the text of no terminal.

It is imported before anything that reads these when it is imported. A test that is about one sets it itself.
"""

import os

OF_TERMINALS = (
    "COLUMNS",
    "LINES",
    "NO_COLOR",
    "FORCE_COLOR",
    "CLICOLOR_FORCE",
    "GITHUB_ACTIONS",
)

for name in OF_TERMINALS:
    os.environ.pop(name, None)
