"""The face of the project: command line, plots, HTML reports.

`mushrooms.main` lists the commands, and the module of each. From Python one uses `orbits`,
`lyapunov` and `figures`; `store` keeps long runs on disk.
"""

__all__ = ["__version__"]


def __getattr__(name: str) -> str:
    """Look the version up when it is asked for: that takes as long as a short command."""
    if name != "__version__":
        raise AttributeError(f"module 'mushrooms' has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("oscillating-mushrooms")
    except PackageNotFoundError:  # a source tree on the path, never installed
        return "0+source"
