"""The disk cache of compiled code: names tell sources apart, and what is damaged is compiled again."""

import errno
import os
import pickle
import resource
import runpy
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
from numba import config
from numba.core.caching import IndexDataCacheFile
from support.depth import deep_but
from support.entries import kept_entries

import fast
from fast.kernel import compiling
from fast.kernel.numba_internals import is_loaded

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is kept without the compiler")
SOURCE = """
from fast.kernel.compiling import kept

@kept()
def entry(x):
    return x + NUMBER
"""


class Kept:
    """One compiled function, loaded as a new process would load it."""

    def __init__(self, folder: Path) -> None:
        self.source, self.folder = folder / "source.py", folder / "kept"
        self.source.write_text(SOURCE)

    def is_hit(self, number: float = 1.0) -> bool:
        """Call it, and tell whether it was kept; its code has the number in it."""
        entry = runpy.run_path(str(self.source), {"NUMBER": number})["entry"]
        assert entry(1.0) == 1.0 + number
        return is_loaded(entry)

    def file(self, ending: str) -> Path:
        (found,) = self.folder.rglob(f"*.{ending}")
        return found


@pytest.fixture
def entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kept:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "kept"))
    return Kept(tmp_path)


def flip(share: float, path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[int(share * (len(content) - 1))] ^= 1
    path.write_bytes(content)


def cut(share: float, path: Path) -> None:
    os.truncate(path, int(share * path.stat().st_size))


def replace(make: Callable[[Path], object], path: Path) -> None:
    path.unlink()
    make(path)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "emptied": partial(cut, 0.0),
    "cut early": partial(cut, 0.02),
    "cut": partial(cut, 0.5),
    "cut late": partial(cut, 0.999),
    **{f"a bit at {share}": partial(flip, share) for share in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)},
    "noise": lambda path: path.write_bytes(os.urandom(5000)),
    "another object": lambda path: path.write_bytes(pickle.dumps({"an": "object"})),
    "a folder": partial(replace, lambda path: (path / "in").mkdir(parents=True)),
    "not to be read": partial(replace, lambda path: path.symlink_to(path)),
    "missing": Path.unlink,
}


@pytest.mark.parametrize("ending", ["nbi", "nbc"], ids=["index", "code"])
@pytest.mark.parametrize(
    "damage",
    deep_but(
        DAMAGES,
        "emptied",
        "cut",
        "a bit at 0.5",
        "noise",
        "another object",
        "a folder",
        "not to be read",
        "missing",
    ),
)
def test_what_is_damaged_is_compiled_again_and_kept(entry, damage, ending):
    assert [entry.is_hit(), entry.is_hit()] == [False, True]
    DAMAGES[damage](entry.file(ending))
    assert [entry.is_hit(), entry.is_hit()] == [False, True]


@pytest.mark.parametrize("endings", [["nbi"], ["nbc"], ["nbi", "nbc"]])
def test_the_files_of_another_are_no_hit(entry, monkeypatch, endings):
    """Of other sources: numba's key is the same, and what they are called from is not."""
    assert not entry.is_hit(1.0)
    own = {ending: entry.file(ending) for ending in ("nbi", "nbc")}
    with monkeypatch.context() as context:
        context.setattr(compiling, "SOURCES", "0" * 64)
        assert not entry.is_hit(2.0)
    for ending in endings:
        (other,) = entry.folder.rglob(f"*{'0' * 16}*.{ending}")
        own[ending].write_bytes(other.read_bytes())
    assert [entry.is_hit(1.0), entry.is_hit(1.0)] == [False, True]


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """Let the system refuse what is written beyond a size."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.parametrize("size", [0, 2000])  # of nothing, of the index alone
@pytest.mark.parametrize("damage", [None, "emptied", "noise"])
def test_on_a_full_disk_it_is_compiled_each_time(entry, size, damage):
    if damage:
        assert not entry.is_hit()
        DAMAGES[damage](entry.file("nbi"))
    with full_disk(size):
        assert [entry.is_hit(), entry.is_hit()] == [False, False]
    assert [entry.is_hit(), entry.is_hit()] == [False, True]
    assert {path.suffix for path in entry.folder.rglob("*.*")} == {".nbi", ".nbc"}


def test_where_no_seal_can_be_written_it_is_compiled_each_time(entry, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "no room")

    with monkeypatch.context() as context:
        context.setattr(compiling.Path, "write_bytes", full)
        assert [entry.is_hit(), entry.is_hit()] == [False, False]
    assert [entry.is_hit(), entry.is_hit()] == [False, True]


def test_where_no_folder_can_be_written_in_it_is_compiled_each_time(entry, tmp_path, monkeypatch):
    (tmp_path / "__pycache__").write_text("a file")
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "__pycache__"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "__pycache__"))
    assert [entry.is_hit(), entry.is_hit()] == [False, False]


HALF_KEPT = """
from fast.kernel.compiling import kept

def made(number, variant):
    @kept(variant)
    def entry(x):
        return x + number

    return entry
"""


def test_a_change_in_any_source_makes_the_kernels_anew(tmp_path):
    """Numba's cache looks at one file only; the digest in the names of its files looks at all."""
    folder = Path(fast.__file__).parent
    copy = shutil.copytree(folder, tmp_path / "fast", ignore=shutil.ignore_patterns("__pycache__"))
    assert compiling.digest_of_sources(copy) == compiling.SOURCES
    for path in (copy / "units.py", copy / "kernel" / "walls.py"):
        path.write_text(path.read_text("utf-8") + "\n", "utf-8")
        assert compiling.digest_of_sources(copy) != compiling.SOURCES
        path.write_text(path.read_text("utf-8")[:-1], "utf-8")
    names = [entry.py_func.__qualname__ for entry in kept_entries()]
    assert all(compiling.SOURCES[:16] in name for name in names)
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("what", ["variant", "sources", "processor"])
def test_what_was_half_kept_leads_to_no_other_code(tmp_path, monkeypatch, what):
    """The process ends when numba has written the index and not yet the code: that of another is there."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "kept"))
    source = tmp_path / "half_kept.py"

    def called(number: float) -> float:
        source.write_text(f"{HALF_KEPT}\n# {number}\n")  # of another file numba forgets the index
        if what == "sources":
            monkeypatch.setattr(compiling, "SOURCES", f"{number:016}")
        elif what == "processor":
            monkeypatch.setattr(compiling, "TOOLS", (*compiling.TOOLS[:2], f"{number}", compiling.TOOLS[3]))
        module = runpy.run_path(str(source))
        return float(module["made"](number, number if what == "variant" else 0.0)(0.0))

    def ended(*_: object) -> None:
        raise KeyboardInterrupt

    assert called(1.0) == 1.0
    with monkeypatch.context() as context:
        context.setattr(IndexDataCacheFile, "_save_data", ended)
        with pytest.raises(KeyboardInterrupt):
            called(2.0)
    assert called(2.0) == 2.0
