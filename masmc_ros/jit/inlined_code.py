# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compilation of functions that are inlined or exported, without machine instructions."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
import re
from threading import local
from typing import Any, NamedTuple

from masmc_ros.aliases import Function
from masmc_ros.jit.generated import Builder, IrValue, Type, Types
from masmc_ros.jit.shared_records import calls_large_parts, is_large_part
from masmc_ros.jit.sized_records import has_sizes_at_run_time
from numba import types
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, ll
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.errors import UnsupportedError
from numba.core.runtime.context import NRTContext
from numba.core.typed_passes import NativeLowering

_ALLOCATION = re.compile('NRT_.*alloc', re.IGNORECASE)
"""Names of the functions of Numba's run time that take memory from the heap."""


class Subroutine(NamedTuple):
    """Function with separate machine instructions; the code of its callers has its symbol only."""

    symbol: str
    module: str
    name: str
    arguments: tuple[types.Type, ...]

    @property
    def dispatcher(self) -> Any:
        """Return Numba's dispatcher of the function."""
        return getattr(import_module(self.module), self.name)._called

    def register(self) -> None:
        """Let callers that are compiled from now on load the function."""
        _subroutines[self.symbol] = self

    def load(self) -> None:
        """Load the function, or compile it, before its caller is loaded."""
        self.register()
        self.dispatcher.compile(self.arguments)
        code = self.dispatcher.overloads[self.arguments]
        # It has another symbol if it was compiled again after its caller.
        engine = code.library.codegen._engine
        ll.add_symbol(self.symbol, engine.get_function_address(code.fndesc.llvm_func_name))


def subroutines_of(stored: Sequence[Any]) -> list[Subroutine]:
    """Return the subroutines that Numba's stored code of a function calls."""
    *_, at_load, _ = stored
    return [function.__self__ for function in at_load if function.__name__ == 'load']


_subroutines: dict[str, Subroutine] = {}
"""Known subroutines by their symbols."""


class _Library(JITCodeLibrary):
    """Code of a function, which loads the subroutines that it calls."""

    def __init__(self, function: Function, state: Any) -> None:
        """Initialise the code of a function that is compiled."""
        super().__init__(state.targetctx.codegen(), function.__qualname__)
        self.enable_object_caching()
        code = function.__code__
        self._place = f'File "{code.co_filename}", line {code.co_firstlineno}'
        # Numba stores these functions with the code, and calls them before it loads the code.
        self._at_load = state.reload_init

    def _verify_declare_only_symbols(self) -> None:
        super()._verify_declare_only_symbols()
        self._at_load += [
            _subroutines[function.name].load
            for function in self._final_module.functions
            if function.is_declaration and function.name in _subroutines
        ]


class _CalledLibrary(_Library):
    """Code of a function whose arrays have no owner: those of its arguments belong to Python."""

    def add_ir_module(self, ir_module: Any) -> None:
        """Add the code of the function; arrays in its arguments lose their owners."""
        for function in ir_module.functions:
            for instruction in function.blocks[0].instructions if function.blocks else ():
                if instruction.name.startswith(('inserted.meminfo', 'inserted.parent')):
                    owner = instruction.operands[1]
                    if owner in function.args:
                        instruction.value = owner.type(None)
                        instruction.replace_usage(owner, instruction.value)
        super().add_ir_module(ir_module)

    def check_memory(self) -> None:
        """Raise UnsupportedError if the function takes memory from the heap."""
        if any(_ALLOCATION.match(function.name) for function in self._final_module.functions):
            raise UnsupportedError(
                f'{self.name} takes memory from the heap; expected tuples, fields of records, or'
                f' scratch of masmc_ros.jit.scratch\n{self._place}'
            )


class _SubroutineLibrary(_CalledLibrary):
    """Code of a function that its callers do not contain."""

    def _finalize_final_module(self) -> None:
        self.check_memory()
        super()._finalize_final_module()

    def _get_module_for_linking(self) -> Any:
        return ll.parse_assembly(str(self._codegen._create_empty_module(self.name)))


class _InlinedLibrary(_CalledLibrary):
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
        self.check_memory()
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


class _WithoutCounting(NRTContext):
    """
    Numba's run time for functions whose arrays have no owner: they count no references.

    Counting takes a tenth of the time of a run of a robot from a URDF.
    """

    def incref(self, builder: Builder, typ: Type, value: IrValue) -> None:
        """Omit the instructions."""

    def decref(self, builder: Builder, typ: Type, value: IrValue) -> None:
        """Omit the instructions."""


_internal_functions: dict[Any, Any] = {}
"""Functions of Numba without counting, which it compiles once."""


def _omit_counting(context: Type) -> None:
    """Let functions that are compiled in a context count no references."""
    context.nrt = _WithoutCounting(context, context.enable_nrt)
    context.cached_internal_func = _internal_functions


_caller = local()
"""Types of the arguments of the function that this thread compiles."""


def types_of_caller() -> Types:
    """Return the types of the arguments of the function that this thread compiles."""
    kinds: Types = getattr(_caller, 'kinds', ())
    return kinds


class KernelCompiler(Compiler):
    """Compiler of functions that Python calls."""

    def library(self, function: Function) -> _Library:
        """Return the empty code of a function."""
        return _Library(function, self.state)

    def compile_extra(self, function: Function) -> Type:
        """Compile a function."""
        outer = types_of_caller()
        _caller.kinds = self.state.args
        try:
            self.state.library = self.library(function)
            return super().compile_extra(function)
        finally:
            _caller.kinds = outer

    def has_sizes_at_run_time(self) -> bool:
        """Return True if an argument has sizes that are known at run time."""
        return any(map(has_sizes_at_run_time, self.state.args))


class InlinedCompiler(KernelCompiler):
    """Compiler of functions that other compiled functions inline."""

    def compile_extra(self, function: Function) -> Type:
        """Compile a function, whose arrays have no owner."""
        _omit_counting(self.state.targetctx)
        return super().compile_extra(function)

    def library(self, function: Function) -> _Library:
        """
        Return the empty code of a function, which is optimised alone if its sizes are constant.

        Lanes are then 3 % faster. Functions of sizes at run time compile faster without it.
        """
        library = _InlinedLibrary(function, self.state)
        library.is_optimised = not self.has_sizes_at_run_time()
        return library


class CalledCompiler(InlinedCompiler):
    """
    Compiler of functions that are inlined only if their sizes are constant.

    Functions of sizes at run time are compiled once for all callers, which contain their names
    only. They are long, and LLVM takes more than twice as long for a function of twice the length.
    """

    @staticmethod
    def is_called_by(caller: Types) -> bool:
        """Return True if functions with arguments of these types call the function."""
        return any(map(has_sizes_at_run_time, caller))

    def is_called(self) -> bool:
        """Return True if no caller inlines the function."""
        return self.has_sizes_at_run_time()

    def library(self, function: Function) -> _Library:
        """Return the empty code of a function."""
        if self.is_called():
            return _SubroutineLibrary(function, self.state)
        return super().library(function)

    def compile_extra(self, function: Function) -> Type:
        """Compile a function, whose callers inline it or call it."""
        if not self.is_called():
            return super().compile_extra(function)
        self.state.flags.forceinline = False
        code = super().compile_extra(function)
        subroutine = Subroutine(
            code.fndesc.llvm_func_name, function.__module__, function.__qualname__,
            self.state.args,
        )  # fmt: skip
        subroutine.register()
        code.reload_init.append(subroutine.register)
        return code


class LargePartCompiler(CalledCompiler):
    """Compiler of functions that are inlined only if they compute several lanes."""

    @staticmethod
    def is_called_by(caller: Types) -> bool:
        """Return True if functions with arguments of these types call the function."""
        return calls_large_parts(caller)

    def is_called(self) -> bool:
        """Return True if no caller inlines the function."""
        return is_large_part(self.state.args)


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
        _omit_counting(self.state.targetctx)
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
