"""How kernels are compiled: by themselves, or as parts of their callers.

numba optimises every compiled function together with all that it calls, and again with each of its callers,
so long chains of calls compile slowly. A function with one or two callers is better a part of them.
"""

from __future__ import annotations

from numba import njit

# A function of its own. No fastmath, so that results are the same bits on every machine; quotients by zero
# are infinite or nan, as in numpy. Wrappers for callers in C, which there are none of, are left out.
kernel = njit(error_model="numpy", no_cfunc_wrapper=True)
# A function whose text is put into its callers before types are inferred. In a loop over lanes it may not be
# given an array: numba counts one more reference to it there, and the loop is not packed.
part = njit(error_model="numpy", no_cfunc_wrapper=True, inline="always")
# A function that LLVM always inlines: a loop over lanes with a call in it is not packed either.
packed = njit(error_model="numpy", no_cfunc_wrapper=True, forceinline=True)
