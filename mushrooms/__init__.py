"""The face of the project: command line, plots, HTML report."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("oscillating-mushrooms")
except PackageNotFoundError:  # a source tree on the path, never installed
    __version__ = "0+source"

__all__ = ["__version__"]
