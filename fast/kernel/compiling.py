"""How kernels are compiled: by themselves, or as parts of their callers.

numba optimises every compiled function together with all that it calls, and again with each of its callers,
so long chains of calls compile slowly. What one function alone calls is a part of it. So is a short function;
a long one that several call costs more as a part, whose text is copied and typed again with each. What many
need is called by its address.
"""

import hashlib
import os
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import numba
from llvmlite.binding import get_host_cpu_features, get_host_cpu_name
from numba import config, njit
from numba.extending import overload, register_jitable

from fast.kernel import numba_internals
from fast.kernel.numba_internals import UNCOUNTED, UNWRAPPED, cache_folder, is_compiled, is_newly_compiled

F = TypeVar("F", bound=Callable[..., Any])
SEAL = hashlib.sha256().digest_size  # bytes, at the end of an index file
# No fastmath, so that results are the same bits on every machine; quotients by zero are infinite or nan, as
# in numpy.
HOW: dict[str, Any] = {"error_model": "numpy", **UNWRAPPED, **UNCOUNTED}


def digest_of_sources(folder: Path) -> str:
    """Return a digest of the Python files in a folder and the folders in it."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _host_features() -> str:
    try:
        features: str = get_host_cpu_features().flatten()
    except RuntimeError:  # LLVM does not know this processor; numba then asks for no features
        return ""
    return features


SOURCES = digest_of_sources(Path(__file__).parent.parent)
# What makes machine code of them, and for which processor; numba's switches say otherwise where they are set.
TOOLS = (
    numba.__version__,
    llvmlite.__version__,
    get_host_cpu_name() if config.CPU_NAME is None else config.CPU_NAME,
    _host_features() if config.CPU_FEATURES is None else config.CPU_FEATURES,
    sys.implementation.cache_tag,
    config.ENABLE_AVX,
)


def kept(*variant: object, **options: Any) -> Callable[[Any], Any]:
    """Return a decorator that compiles a function for Python, and keeps that on disk under a name of its own.

    numba's disk cache looks only at the file of the function it keeps, not at those of the functions compiled
    into it. Nor is what it keeps tied to what it was made of: an index says which number has which code, and
    is written before that code. Let a process end in between, or two write at a time, and a number may lead
    to code of other sources, of another variant or for another processor, which is then run. So what
    decides what a function compiles to is in the name of its files, but for numba's switches for debugging:
    whatever lies under it is the right code. Files of other sources stay until somebody removes them.

    numba also takes the files for what it wrote: one that is cut off ends the process, and one with another
    bit is run. So an index ends in a digest of itself and of the code beside it, which numba does not read.
    Where that does not fit, the files are removed, and the function is compiled again. So it is, but kept
    nowhere, where no folder can be written in or the disk is full.

    Args:
        variant: values that it closes over, which tell it from others of its name.
        options: for numba.
    """

    def compiled(function: Any) -> Any:
        rest = hashlib.sha256(repr((function.__module__, variant, TOOLS)).encode()).hexdigest()
        function.__qualname__ += f"-{SOURCES[:16]}-{rest[:16]}"
        try:
            entry = njit(cache=True, **options)(function)
        except RuntimeError:  # numba finds no folder that can be written in
            return njit(**options)(function)
        if not config.DISABLE_JIT:
            numba_internals.compile_with(entry, partial(_load_or_compile, entry, entry.compile))
        return entry

    return compiled


def _load_or_compile(entry: Any, compile_or_load: Callable[[Any], Any], signature: Any) -> Any:
    """Let numba load an entry if its files are as they were written, else compile it, and seal the files."""
    if is_compiled(entry, signature):
        return compile_or_load(signature)
    files = _files_of(entry)
    if files and not _is_sealed(files):
        for path in reversed(files):  # the index first: no code is found without it
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    try:
        found = compile_or_load(signature)
    except OSError:  # it is compiled before it is written, and numba has it still
        found = compile_or_load(signature)
    if is_newly_compiled(entry, signature):
        with suppress(OSError):
            files = _files_of(entry)
            for index in (path for path in files if path.suffix == ".nbi"):
                content = index.read_bytes()
                sealed = index.with_name(f".{index.name}.{os.getpid()}.part")
                sealed.write_bytes(content + _seal(files, content))
                sealed.replace(index)
    return found


def is_at_hand(entry: Any) -> bool:
    """Tell whether an entry is compiled, in this process or on disk, for some types of arguments."""
    if config.DISABLE_JIT or entry.signatures:
        return True
    files = _files_of(entry)
    return bool(files) and _is_sealed(files)


def _files_of(entry: Any) -> list[Path]:
    """Return the files that an entry is kept in, the index last."""
    name = entry.py_func.__qualname__.split(">.")[-1]  # of one in a function numba drops the brackets
    folder = cache_folder(entry)
    return [] if folder is None else sorted(folder.glob(f"*.{name}-*.nb[ic]"))


def _is_sealed(files: list[Path]) -> bool:
    """Tell whether an index and the code beside it are as they were when the index was sealed."""
    try:
        found = files[-1].read_bytes()
        return files[-1].suffix == ".nbi" and found[-SEAL:] == _seal(files, found[:-SEAL])
    except OSError:
        return False


def _seal(files: list[Path], index: bytes) -> bytes:
    """Return a digest of an index's content, of the code beside it, and of their names."""
    digest = hashlib.sha256(index)
    for path in files:
        digest.update(path.name.encode())
        digest.update(path.read_bytes() if path.suffix == ".nbc" else b"")
    return digest.digest()


# A function of its own, compiled where compiled functions call it. Python, which calls the function as it is
# written, has nothing compiled for it.
kernel: Callable[[F], F] = register_jitable(**HOW)
# The same, which LLVM always inlines: a loop over lanes with a call in it is not packed.
packed: Callable[[F], F] = register_jitable(forceinline=True, **HOW)
# A function whose text is put into its callers before types are inferred.
part: Callable[[F], F] = njit(**HOW, inline="always")


def in_kernels(function: Callable[..., Any]) -> Callable[[F], F]:
    """Return a decorator for what kernels run in place of a function, which Python runs as it is written.

    It decorates a function of the same arguments, which returns the function that kernels run.
    """
    return overload(function, inline="always", strict=False, jit_options=HOW)  # type: ignore[no-any-return]


def caller(signature: Any) -> Callable[..., Any]:
    """Return a function that calls a function, for kernels its address, with a tuple of arguments."""
    call_address = numba_internals.caller_by_address(signature)

    def call(function: Any, arguments: tuple[Any, ...]) -> Any:
        return function(*arguments)

    @in_kernels(call)
    def compiled(function: Any, arguments: Any) -> Any:
        return lambda function, arguments: call_address(function, arguments)

    return call


def widest_registers() -> None:
    """Ask, in the function that calls this, for the widest registers there are.

    Left to itself the compiler takes 256 bits on machines that have 512. The answers are the same bits. A
    loop is packed by itself and again where it is inlined, which keeps only the outer function's attributes:
    both ask.
    """


@in_kernels(widest_registers)
def _ask_for_registers() -> Any:
    return lambda: numba_internals.widest_registers()
