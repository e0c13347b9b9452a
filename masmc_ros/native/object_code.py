# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Object code of compiled functions for any processor that LLVM knows.

Numba compiles a function for this processor and this process. Its intermediate code is compiled
again here: everything that is not a function of the library becomes internal, so LLVM removes what
needs Python, and `check` rejects what it could not remove. The formulas use no function of a C
library but `memcpy` and `memset`, and no fused operation, so every target computes the same bits.

Tested with Numba 0.62 to 0.68, whose intermediate code has opaque pointers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
import re
from typing import Any

import llvmlite.binding as llvm
from masmc_ros.errors import InputError, UserError
from masmc_ros.jit.supported_numba import version_numbers
from masmc_ros.native.targets import Target
from numba import __version__ as numba_version

OLDEST_NUMBA = '0.62'
"""First version of Numba whose intermediate code can be compiled again."""


RUNTIME = """
; What remains of Numba's run time. Arrays are views of the records, so references are not counted:
; code that allocates one needs a further function, and `check` rejects it.
define internal void @NRT_incref(ptr %array) { ret void }
define internal void @NRT_decref(ptr %array) { ret void }
; A square root, which every target has as an instruction.
define internal double @sqrt(double %x) alwaysinline {
  %y = call double @llvm.sqrt.f64(double %x)
  ret double %y
}
declare double @llvm.sqrt.f64(double)
"""

_AVAILABLE = {'memcpy', 'memset'}
"""Functions that every C compiler expects to find."""

_FUSED = re.compile(r'fmuladd|@llvm\.fma\.|= f(?:add|sub|mul|div) (?:fast|contract|reassoc)')
_VARIABLE = re.compile(r'^@\S+ = (?:[a-z_]+ )*global .*', re.MULTILINE)
_POINTER_IN_STRUCT = re.compile(r'getelementptr[^,\n]*\{[^}\n]*\bptr\b')


def merged(functions: Mapping[str, Any]) -> str:
    """
    Return the intermediate code of callbacks of Numba under the given names.

    Raises UserError for a Numba that is too old.
    """
    if version_numbers(numba_version) < version_numbers(OLDEST_NUMBA):
        raise UserError(
            f'numba {numba_version} makes no libraries: expected {OLDEST_NUMBA} or later'
        )
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    whole: Any = None
    for name, callback in functions.items():
        # These two contain instructions of this processor already.
        text = re.sub(
            r'^define [^@]*@NRT_(incref|decref)\(.*?^}$', r'declare void @NRT_\1(ptr)',
            callback.inspect_llvm(), flags=re.M | re.S,
        )  # fmt: skip
        module = llvm.parse_assembly(text)
        _keep(module, ())
        function = module.get_function(callback.native_name)
        function.name, function.linkage = name, 'external'
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    layout = f'target triple = "{whole.triple}"\ntarget datalayout = "{whole.data_layout}"\n'
    runtime = llvm.parse_assembly(layout + RUNTIME)
    for function in runtime.functions:
        if not function.is_declaration:
            function.linkage = 'external'  # internal names cannot be linked
    whole.link_in(runtime)
    _keep(whole, functions)
    return str(whole)


def object_of(text: str, target: Target) -> bytes:
    """
    Return the object code of intermediate code for a target; the same input gives the same bytes.

    Raises InputError for code that needs Python or memory of the system; see `check`.
    """
    return joined_object([optimised(text, target)], target)


def optimised(text: str, target: Target) -> Any:
    """
    Return a module for a target, without everything that its exported functions do not need.

    Raises InputError for code that needs Python or memory of the system; see `check`.
    """
    machine = _machine(target)
    # The code stores no pointer in a record, so their size in another target does not matter.
    for name, value in (('triple', target.triple), ('datalayout', str(machine.target_data))):
        text = re.sub(rf'^target {name} = .*$', f'target {name} = "{value}"', text, flags=re.M)
    module = llvm.parse_assembly(text)
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    passes.getModulePassManager().run(module, passes)
    check(module)
    return module


def joined_object(modules: Iterable[Any], target: Target) -> bytes:
    """Return the object code of modules by `optimised`, which are used up."""
    whole, *others = modules
    for other in others:
        whole.link_in(other)
    # Numba numbers its functions, so their names differ between two compilations.
    for number, thing in enumerate((*whole.functions, *whole.global_variables)):
        if thing.linkage in (llvm.Linkage.internal, llvm.Linkage.private):
            thing.name = f'part.{number}'
    whole.verify()
    return bytes(_machine(target).emit_object(whole))


def _machine(target: Target) -> Any:
    return llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.processor, features=target.features, opt=3, reloc=target.relocation,
        codemodel='default',
    )  # fmt: skip


def check(module: Any) -> None:
    """
    Raise InputError for intermediate code that cannot leave Python.

    It needs functions of Python or memory of the system, has a state of its own, contains fused
    or reassociated operations, or stores pointers in records.
    """
    missing = sorted(set(_undefined(module)) - _AVAILABLE)
    if missing:
        further = f' and {len(missing) - 2} more' if len(missing) > 2 else ''
        raise InputError(
            f'the compiled law needs {", ".join(missing[:2])}{further} of Python; expected a law '
            'without memory of the system and without exceptions, see docs/guides/native.md'
        )
    text = str(module)
    for pattern in (_FUSED, _POINTER_IN_STRUCT, _VARIABLE):
        found = pattern.search(text)
        if found:
            line = found.group().strip()
            raise InputError(f"the compiled law contains '{line}'; expected plain operations")


def _undefined(module: Any) -> list[str]:
    """Return the names of functions and variables that intermediate code needs from outside."""
    things = (*module.functions, *module.global_variables)
    names = [thing.name for thing in things if thing.is_declaration]
    return [name for name in names if not name.startswith('llvm.')]


def _keep(module: Any, names: Mapping[str, Any] | tuple[str, ...]) -> None:
    """Make everything but the named functions internal."""
    for thing in (*module.functions, *module.global_variables):
        if not thing.is_declaration and thing.name not in names:
            thing.linkage = 'internal'


def archive(name: str, code: bytes, symbols: list[str]) -> bytes:
    """Return a static library (the archive format of System V) of one file of object code."""
    names = b''.join(symbol.encode() + b'\0' for symbol in symbols)
    index_size = 4 + 4 * len(symbols) + len(names)
    place = 8 + 60 + index_size + index_size % 2
    numbers = [len(symbols), *[place] * len(symbols)]
    index = b''.join(number.to_bytes(4, 'big') for number in numbers) + names
    return b'!<arch>\n' + _member('/', index) + _member(f'{name[:15]}/', code)


def _member(name: str, content: bytes) -> bytes:
    # Time, owner and group are 0, so the same content gives the same bytes.
    header = f'{name:<16}{0:<12}{0:<6}{0:<6}{"100644":<8}{len(content):<10}`\n'
    return header.encode() + content + b'\n' * (len(content) % 2)
