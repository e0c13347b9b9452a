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

from collections.abc import Callable, Iterable, Mapping, Sequence
import hashlib
import re
from typing import Any

import llvmlite.binding as llvm
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import ExportedCode
from masmc_ros.loop.closed_loop import NOT_FINITE
from masmc_ros.native.entries import Entry, OTHER_RECORDS
from masmc_ros.native.targets import Target
from masmc_ros.native.template import filled
import numpy as np

_SIZED = 'SizedRecord'
"""Part of the names of functions with sizes at run time."""

_AVAILABLE = {'memcpy', 'memset'}
"""Functions that every C compiler expects to find."""

_FUSED = re.compile(r'fmuladd|@llvm\.fma\.|= f(?:add|sub|mul|div) (?:fast|contract|reassoc)')
_LONG_NAME = re.compile(r'(?<![@"\w.$-])[\w.$-]{900,}')
"""Label of a block that the parser rejects, because it contains the name of a function."""

_METADATA = re.compile(r'(?:, ![\w.]+ !\d+)+$', re.MULTILINE)

_CONSTANT = re.compile(r'^(@[\w.$-]+) = (internal constant .*)\n', re.MULTILINE)
_NAME = re.compile(r'@[\w.$-]+')

_DEFINITION = re.compile(r'^(define .*?@([\w.]+)\(.*) \{$', re.MULTILINE)
"""First line of a function, whose name contains no quotation marks."""

_WITH_POINTERS = re.compile(
    r'^(  %\S+ = alloca )(ptr|[\[{].*\bptr\b.*[\]}])(?=, align)', re.MULTILINE
)
"""Variable of a function with pointers, and its type."""

_VARIABLE = re.compile(r'^@\S+ = (?:[a-z_]+ )*global .*', re.MULTILINE)
_POINTER_IN_STRUCT = re.compile(r'getelementptr[^,\n]*\{[^}\n]*\bptr\b')


def merged(functions: Mapping[str, Entry]) -> str:
    """Return the intermediate code of entries under the given names."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    whole: Any = None
    kernels: dict[ExportedCode, str] = {}
    for name, entry in functions.items():
        kernel = kernels.setdefault(entry.code, f'masmc.{name}')
        if kernel == f'masmc.{name}':
            module = _module_of(entry.code, kernel)
            if whole is None:
                whole = module
            else:
                whole.link_in(module)
        kinds = [str(value.type) for value in whole.get_function(kernel).arguments]
        own = _function(name, entry, kernel, kinds)
        whole.link_in(llvm.parse_assembly(_layout_of(whole) + own))
    _keep(whole, functions)
    _run(whole, lambda passes: passes.add_global_dead_code_eliminate_pass())
    text = _with_single_constants(str(whole))
    if _SIZED in text:
        # It serves optimisations, which are done, and distinguishes copies of a function.
        text = _METADATA.sub('', text)
    whole = llvm.parse_assembly(text)
    runtime = llvm.parse_assembly(filled('runtime.ll.jinja', {'layout': _layout_of(whole)}))
    for function in runtime.functions:
        if not function.is_declaration:
            function.linkage = 'external'  # internal names cannot be linked
    whole.link_in(runtime)
    _keep(whole, functions)
    # Entries that call the same function have copies of it.
    _run(whole, lambda passes: passes.add_merge_functions_pass())
    return str(whole)


def _with_single_constants(text: str) -> str:
    """Return code in which equal constants are one: functions that use them become equal."""
    first: dict[str, str] = {}
    renamed: dict[str, str] = {}
    for name, value in _CONSTANT.findall(text):
        if first.setdefault(value, name) != name:
            renamed[name] = first[value]
    if not renamed:
        return text
    text = _CONSTANT.sub(lambda m: '' if m[1] in renamed else m[0], text)
    # Constants that point to these may be equal now.
    return _with_single_constants(_NAME.sub(lambda m: renamed.get(m[0], m[0]), text))


def _run(module: Any, add: Callable[[Any], None]) -> None:
    """Run a pass on a module; `add` adds it to a pass manager of llvmlite."""
    passes = llvm.create_new_module_pass_manager()
    add(passes)
    passes.run(module, llvm.create_pass_builder(_host(), llvm.create_pipeline_tuning_options()))


def _module_of(code: ExportedCode, name: str) -> Any:
    """Return the module of a kernel under a name; its other functions are internal."""
    module = llvm.parse_assembly(_LONG_NAME.sub(_short_name, code.text))
    kernel = module.get_function(code.name)
    kernel.name = name
    kernel.linkage = 'external'  # internal names cannot be linked
    _keep(module, (name,))
    return module


def _layout_of(module: Any) -> str:
    return f'target triple = "{module.triple}"\ntarget datalayout = "{module.data_layout}"\n'


def _short_name(match: re.Match[str]) -> str:
    return f'block.{hashlib.sha256(match.group().encode()).hexdigest()[:16]}'


def _function(name: str, entry: Entry, kernel: str, kinds: Sequence[str]) -> str:
    """Return a function of a library, which calls a kernel with arguments of these types."""
    first = 2  # the places of the result and of the exception
    count = len(kinds) - len(entry.further)
    return filled('entry.ll.jinja', {
        'name': name, 'kernel': kernel, 'kinds': kinds,
        'arguments': [f'{kind} %a{i}' for i, kind in enumerate(kinds[first:count])],
        'further': [f'i64 {number}' for number in entry.further],
        'layouts': {
            i: np.frombuffer(layout, '<i8').tolist()
            for i, layout in enumerate(entry.layouts) if layout
        },
        'failure': entry.failure,
        'rejected': 0 if entry.failure == 0 else NOT_FINITE | OTHER_RECORDS,
    })  # fmt: skip


def object_of(text: str, target: Target) -> bytes:
    """
    Return the object code of intermediate code for a target; the same input gives the same bytes.

    Raises InputError for code that needs Python; see `check`.
    """
    return joined_object([optimised(text, target)], target)


def optimised(text: str, target: Target) -> Any:
    """
    Return a module for a target, without everything that its exported functions do not need.

    Raises InputError for code that needs Python; see `check`.
    """
    machine = _machine(target)
    if _SIZED in text:
        text = _with_places_of_host(text, machine.target_data)
    # The code stores no pointer in a record, so their size in another target does not matter.
    for name, value in (('triple', target.triple), ('datalayout', str(machine.target_data))):
        text = re.sub(rf'^target {name} = .*$', f'target {name} = "{value}"', text, flags=re.M)
    module = llvm.parse_assembly(text)
    # Code for robots from URDFs is optimised already, and no size in it becomes a constant.
    level = 0 if _SIZED in text else 3
    options = llvm.create_pipeline_tuning_options(speed_level=level)
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(module, passes)
    check(module)
    return module


def _with_places_of_host(text: str, target: Any) -> str:
    """
    Return optimised code whose variables with pointers have the size that they have here.

    It contains the places of their members here, which differ if pointers are shorter. Raises
    InputError for members that a target with such pointers would place itself.
    """
    kinds = sorted({kind for _, kind in _WITH_POINTERS.findall(text)})
    layout = re.search(r'^target datalayout = "(.*)"$', text, re.M)
    assert layout is not None
    here = llvm.create_target_data(layout[1])
    module = llvm.parse_assembly(
        '\n'.join(f'@kind.{i} = external global {kind}' for i, kind in enumerate(kinds))
    )
    sizes = {}
    for kind, variable in zip(kinds, module.global_variables, strict=True):
        sizes[kind] = here.get_abi_size(variable.global_value_type)
        is_same = target.get_abi_size(variable.global_value_type) == sizes[kind]
        whole = rf'= load {re.escape(kind)},|store {re.escape(kind)} '
        if kind != 'ptr' and not is_same and re.search(whole, text):
            raise InputError(f'the compiled law stores {kind} in memory; expected no pointers')
    return _WITH_POINTERS.sub(lambda m: f'{m[1]}[{sizes[m[2]]} x i8]', text)


def joined_object(modules: Iterable[Any], target: Target) -> bytes:
    """Return the object code of modules by `optimised`, which are used up."""
    whole, *others = modules
    for other in others:
        whole.link_in(other)
    # A page has no library of a compiler; other 32-bit processors do not need one for this.
    if target.triple.startswith('wasm') and 'mul.with.overflow' in str(whole):
        layout = {'layout': _layout_of(whole)}
        whole.link_in(llvm.parse_assembly(filled('wide_product.ll.jinja', layout)))
    # Numba numbers its functions, so their names differ between two compilations.
    for number, thing in enumerate((*whole.functions, *whole.global_variables)):
        if thing.linkage in (llvm.Linkage.internal, llvm.Linkage.private):
            thing.name = f'part.{number}'
    if not target.triple.startswith('wasm'):
        # A linker can omit the functions that a program does not use (--gc-sections).
        whole = llvm.parse_assembly(_DEFINITION.sub(r'\1 section ".text.\2" {', str(whole)))
    whole.verify()
    return bytes(_machine(target).emit_object(whole))


def _host() -> Any:
    return llvm.Target.from_default_triple().create_target_machine()


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
