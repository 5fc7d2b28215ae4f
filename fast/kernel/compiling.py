"""How kernels are compiled: by themselves, or as parts of their callers.

numba optimises every compiled function together with all that it calls, and again with each of its callers,
so long chains of calls compile slowly. A function with one or two callers is better a part of them.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config, njit, types
from numba.extending import intrinsic

# A function of its own. No fastmath, so that results are the same bits on every machine; quotients by zero
# are infinite or nan, as in numpy. Wrappers for callers in C, which there are none of, are left out.
kernel = njit(error_model="numpy", no_cfunc_wrapper=True, _nrt=False)
# A function whose text is put into its callers before types are inferred. In a loop over lanes it may not be
# given an array: numba counts one more reference to it there, and the loop is not packed.
part = njit(error_model="numpy", no_cfunc_wrapper=True, _nrt=False, inline="always")
# A function that LLVM always inlines: a loop over lanes with a call in it is not packed either.
packed = njit(error_model="numpy", no_cfunc_wrapper=True, _nrt=False, forceinline=True)


@intrinsic
def _compiled_widest_registers(_context: Any) -> Any:
    def generate(context: Any, builder: ir.IRBuilder, _: Any, __: Any) -> Any:
        # llvmlite's own `add` knows none of the attributes that are strings.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.none(), generate


def _no_registers() -> None:
    pass


# Asks, in the function that calls it, for the widest registers there are: left to itself the compiler takes
# 256 bits on machines that have 512. The answers are the same bits.
widest_registers = _no_registers if config.DISABLE_JIT else _compiled_widest_registers


@intrinsic
def _compiled_borrowed(_context: Any, array: Any) -> Any:
    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
        view = context.make_array(array)(context, builder, arguments[0])
        view.meminfo = ir.Constant(view.meminfo.type, None)
        view.parent = ir.Constant(view.parent.type, None)
        return view._getvalue()

    return array(array), generate


def _itself(array: Any) -> Any:
    return array


# A view of an array that keeps no count of its references: one that is taken from a tuple is counted, and
# each count is an atomic operation. Only for what a caller holds while the view is used.
borrowed = _itself if config.DISABLE_JIT else _compiled_borrowed
