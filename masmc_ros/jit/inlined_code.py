# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compilation of functions that are inlined or exported, without machine instructions."""

from __future__ import annotations

from masmc_ros.aliases import Function
from masmc_ros.jit.generated import Type
from masmc_ros.jit.sized_records import has_sizes_at_run_time
from numba import types
from numba.core.codegen import JITCodeLibrary, ll
from numba.core.compiler import Compiler


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
        for function in module.functions:
            if not function.is_declaration and function.linkage == ll.Linkage.external:
                function.linkage = 'linkonce_odr'
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


class ExportedCompiler(InlinedCompiler):
    """Compiler of functions for other processors, which are optimised for each of them."""

    def is_optimised(self) -> bool:
        """Return True for an entry with sizes at run time, none of which becomes a constant."""
        return any(
            isinstance(kind, types.CPointer) and has_sizes_at_run_time(kind.dtype)
            for kind in self.state.args
        )
