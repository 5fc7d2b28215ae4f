"""Compiling what only compiled functions call: up to LLVM's text, and no further.

numba optimises every function and makes machine code of it, with all that it calls in it, also where nobody
ever calls it by itself. A kernel needs neither: its text goes into the libraries of its callers, and is
optimised there, once for each entry that Python or an address leads to.
"""

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import AnnotateTypes, NativeLowering


class LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A function's text with that of what it calls, to be linked into others."""

    def finalize(self) -> None:
        """Link what is called, and leave it at that; kernels use nothing that numba must reload."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._final_module.verify()
        self._finalized = True


@register_pass(mutates_CFG=False, analysis_only=False)
class TakeLinkedLibrary(LoweringPass):  # type: ignore[misc]
    """Before a function is lowered: say where to, and that no machine code is asked for."""

    _name = "take_linked_library"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """See numba's `LoweringPass`."""
        state.library = LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class ShowToCallers(LoweringPass):  # type: ignore[misc]
    """After it is lowered: let callers find it, by a key in place of the machine code's address."""

    _name = "show_to_callers"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """See numba's `LoweringPass`."""
        key = object()
        state.targetctx.insert_user_function(key, state.cr.fndesc, [state.library])
        state["cr"] = state.cr._replace(cfunc=key)
        return True


class ForCallers(CompilerBase):  # type: ignore[misc]
    """numba's compiler with these two passes."""

    def define_pipelines(self) -> list[Any]:
        """See numba's `CompilerBase`."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(TakeLinkedLibrary, AnnotateTypes)
        passes.add_pass_after(ShowToCallers, NativeLowering)
        passes.finalize()
        return [passes]
