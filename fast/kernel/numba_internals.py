"""What this package uses of numba's inside, which numba does not document and may change.

No other file names any of it. `tests/test_fast_numba_internals.py` tests each name for the
meaning that we rely on: a release of numba that changes one fails there first, by name. The events
of `numba.core.event` are not here, because numba documents them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic as numba_intrinsic

# A function for kernels whose code is written by hand; numba types it by what it returns.
intrinsic: Callable[[Callable[..., Any]], Any] = numba_intrinsic

# Options of `njit`. A function that only kernels call needs no wrapper for C. The caller of a kernel
# holds its arrays while it runs, so no references are counted: each count is an atomic operation,
# and much to compile. So a kernel cannot allocate.
UNWRAPPED: dict[str, Any] = {"no_cfunc_wrapper": True}
UNCOUNTED: dict[str, Any] = {"_nrt": False}


def is_compiled(entry: Any, arguments: Any) -> bool:
    """Tell whether a process has an entry's code for arguments of these types."""
    return arguments in entry.overloads


def compile_with(entry: Any, compile_entry: Callable[[Any], Any]) -> None:
    """Let numba call a function of ours when an entry is to be compiled for some types of arguments."""
    entry.compile = compile_entry


def cache_folder(entry: Any) -> Path | None:
    """Return the folder that an entry is kept in; None for one that is not kept."""
    found = entry.stats.cache_path
    return Path(found) if found else None


def is_newly_compiled(entry: Any, arguments: Any) -> bool:
    """Tell whether an entry was looked for in its folder, not found there, and compiled."""
    return arguments in entry.stats.cache_misses


def is_loaded(entry: Any) -> bool:
    """Tell whether an entry was found in its folder."""
    return bool(entry.stats.cache_hits)


def returned_type(entry: Any, arguments: Any) -> Any:
    """Return the type that a compiled entry returns for arguments of these types."""
    return entry.overloads[arguments].signature.return_type


def address_of(entry: Any, arguments: Any) -> int:
    """Return where the code of a compiled entry is, for kernels that call it."""
    found = entry.overloads[arguments]
    address: int = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
    return address


def function_of(entry: Any, arguments: Any) -> Callable[..., Any]:
    """Return a compiled entry as a function of Python that does not look at the types of its arguments."""
    function: Callable[..., Any] = entry.overloads[arguments].entry_point
    return function


def caller_by_address(signature: Any) -> Callable[..., Any]:
    """Return a function for kernels that calls what lies at an address with a tuple of arguments."""

    @intrinsic
    def call(_context: Any, _address: Any, _arguments: Any) -> Any:
        def generate(context: Any, builder: ir.IRBuilder, _: Any, given: Any) -> Any:
            result, parameters = signature.return_type, signature.args
            convention = context.call_conv
            kind = convention.get_function_type(result, parameters)
            function = builder.inttoptr(given[0], ir.PointerType(kind))
            arguments = [builder.extract_value(given[1], i) for i in range(len(parameters))]
            _, found = convention.call_function(builder, function, result, parameters, arguments)
            return found

        return signature.return_type(types.int64, types.Tuple(signature.args)), generate

    return call  # type: ignore[no-any-return]


@intrinsic
def widest_registers(_context: Any) -> Any:
    """Ask, in the function that calls this, for the widest registers there are."""

    def generate(context: Any, builder: ir.IRBuilder, _: Any, __: Any) -> Any:
        # llvmlite's own `add` knows none of the attributes that are strings.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        # Registers that are put aside cross no cache line then, wherever the caller's stack ends.
        builder.function.attributes.alignstack = 64
        return context.get_dummy_value()

    return types.none(), generate
