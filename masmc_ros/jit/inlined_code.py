# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compilation of functions that are inlined or exported, without machine instructions."""

from __future__ import annotations

from typing import Any

from masmc_ros.aliases import Function
from masmc_ros.jit.generated import Type
from masmc_ros.jit.sized_records import has_sizes_at_run_time
from numba import types
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, ll
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class _InlinedLibrary(JITCodeLibrary):
    """
    Code of an inlined or exported function, without machine instructions.

    Generating instructions takes a third of the compile time, and no caller uses them.
    """

    is_optimised = True

    def _optimize_final_module(self) -> None:
        # The kernel optimises the code of all its callees in any case.
        if self.is_optimised:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        module = self._final_module
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        _share(module)
        self._shared_module = module
        # Numba writes the environment of the function into its variable.
        variables = [
            str(variable)
            for variable in module.global_variables
            if variable.linkage == ll.Linkage.common
        ]
        empty = str(self._codegen._create_empty_module(self.name))
        self._final_module = ll.parse_assembly('\n'.join([empty, *variables]))
        self._final_module.name = module.name
        super()._finalize_final_module()

    def get_llvm_str(self) -> str:
        """Return the intermediate code, which the final module lacks."""
        return str(self._shared_module)


def _share(module: Any) -> None:
    """Allow several definitions of the functions of a module, which are the same."""
    for function in module.functions:
        if not function.is_declaration and function.linkage == ll.Linkage.external:
            function.linkage = 'linkonce_odr'


class InlinedCompiler(Compiler):
    """Compiler of functions that other compiled functions inline."""

    def compile_extra(self, function: Function) -> Type:
        """
        Compile a function, and optimise it alone if its sizes are constant.

        Lanes are then 3 % faster. Functions of sizes at run time compile faster without it.
        """
        library = _InlinedLibrary(self.state.targetctx.codegen(), function.__qualname__)
        library.is_optimised = self.is_optimised()
        library.enable_object_caching()
        self.state.library = library
        return super().compile_extra(function)

    def is_optimised(self) -> bool:
        """Return True if the code is optimised alone."""
        return not any(map(has_sizes_at_run_time, self.state.args))


class CalledCompiler(InlinedCompiler):
    """
    Compiler of functions that are inlined only if their sizes are constant.

    Functions of sizes at run time are long, and LLVM takes more than twice as long for a function
    of twice the length.
    """

    def compile_extra(self, function: Function) -> Type:
        """Compile a function, whose callers inline it or call it."""
        if not self.is_optimised():
            self.state.flags.forceinline = False
        return super().compile_extra(function)


class _ExportedLibrary(JITCodeLibrary):
    """
    Code of a function for other processors; this process does not run it.

    A library of Numba contains the code of all callees, so each caller copies it. This one
    contains the function alone. The code of all callees is added once, when it is read.
    """

    is_optimised = False

    def _optimize_functions(self, ll_module: Any) -> None:
        # Numba also runs the passes on declarations, most of the functions of a module.
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def finalize(self) -> None:
        """Keep the code of the function alone."""
        self._raise_if_finalized()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: the function has no address in this process."""
        return 0

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = self._linked()
        return self._shared_module

    def _linked(self) -> Any:
        """Return the code with that of all callees."""
        exported: dict[_ExportedLibrary, None] = {}
        others: dict[CPUCodeLibrary, None] = {}
        further: list[CPUCodeLibrary] = [self]
        while further:
            library = further.pop()
            if not isinstance(library, _ExportedLibrary):
                others[library] = None
            elif library not in exported:
                exported[library] = None
                further += library._linking_libraries
        module = self._final_module.clone()
        for library in exported:
            if library is not self:
                module.link_in(library._final_module, preserve=True)
        # These have functions that are linked if there is a call already.
        for library in others:
            module.link_in(library._get_module_for_linking(), preserve=True)
        if self.is_optimised:
            self._optimize_final_module()
        _share(module)
        return module

    def get_llvm_str(self) -> str:
        """Return the intermediate code with that of all callees."""
        return str(self._get_module_for_linking())


@register_pass(mutates_CFG=True, analysis_only=False)
class _ExportedLowering(NativeLowering):
    """Generation of intermediate code without an executable function."""

    _name = 'exported_lowering'

    def run_pass(self, state: Any) -> bool:
        """Generate the code, and register the function for its callers."""
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state['cr']
        # Numba finds a callee by its executable function, which has to be a new built-in one.
        key = object().__reduce__
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state['cr'] = lowered._replace(cfunc=key)
        return True


class ExportedCompiler(Compiler):
    """Compiler of functions for other processors, which are optimised for each of them."""

    def compile_extra(self, function: Function) -> Type:
        """
        Compile a function to intermediate code.

        An entry is optimised if its sizes stay unknown until it runs.
        """
        library = _ExportedLibrary(self.state.targetctx.codegen(), function.__qualname__)
        library.is_optimised = any(
            isinstance(kind, types.CPointer) and has_sizes_at_run_time(kind.dtype)
            for kind in self.state.args
        )
        self.state.library = library
        return super().compile_extra(function)

    def define_pipelines(self) -> list[PassManager]:
        """Return the passes of Numba, with another generation of code."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state, 'exported')
        passes.passes = [
            (_ExportedLowering if kind is NativeLowering else kind, name)
            for kind, name in passes.passes
        ]
        passes.finalize()
        return [passes]
