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

MEMORY = 16384
"""Bytes on the stack for arrays of a call; a formula that needs more ends in a status."""

_MEMORY = '%masmc.memory'
"""Pointer to this memory."""

_ARRAYS = f"""
; Arrays of a call: 64 bytes with the number of references in byte 0, the array before in byte 8
; and the address in byte 24, where Numba reads it, then the numbers. The memory starts with the
; number of its used bytes and the place of the last array.
define internal ptr @NRT_MemInfo_alloc_aligned(ptr {_MEMORY}, i64 %size, i32 %align) {{
  %used = load i64, ptr {_MEMORY}
  %free = sub i64 {MEMORY}, %used
  %more = add i64 %size, 127
  %room = and i64 %more, -64
  %small = icmp ult i64 %size, {MEMORY}
  %fit = icmp ule i64 %room, %free
  %fits = and i1 %small, %fit
  br i1 %fits, label %new, label %full
new:
  %after = add i64 %used, %room
  store i64 %after, ptr {_MEMORY}
  %last = getelementptr i8, ptr {_MEMORY}, i64 8
  %before = load i64, ptr %last
  store i64 %used, ptr %last
  %array = getelementptr i8, ptr {_MEMORY}, i64 %used
  store i64 1, ptr %array
  %link = getelementptr i8, ptr %array, i64 8
  store i64 %before, ptr %link
  %data = getelementptr i8, ptr %array, i64 64
  %place = getelementptr i8, ptr %array, i64 24
  store ptr %data, ptr %place
  ret ptr %array
full:
  ret ptr null
}}
define internal void @NRT_incref(ptr %array) {{
  %is.view = icmp eq ptr %array, null
  br i1 %is.view, label %end, label %own
own:
  %count = load i64, ptr %array
  %more = add i64 %count, 1
  store i64 %more, ptr %array
  br label %end
end:
  ret void
}}
define internal void @NRT_decref(ptr {_MEMORY}, ptr %array) {{
  %is.view = icmp eq ptr %array, null
  br i1 %is.view, label %end, label %own
own:
  %count = load i64, ptr %array
  %less = sub i64 %count, 1
  store i64 %less, ptr %array
  %last = getelementptr i8, ptr {_MEMORY}, i64 8
  br label %test
test:
  %place = load i64, ptr %last
  %is.empty = icmp eq i64 %place, 0
  br i1 %is.empty, label %end, label %look
look:
  %top = getelementptr i8, ptr {_MEMORY}, i64 %place
  %users = load i64, ptr %top
  %is.used = icmp ne i64 %users, 0
  br i1 %is.used, label %end, label %release
release:
  store i64 %place, ptr {_MEMORY}
  %link = getelementptr i8, ptr %top, i64 8
  %before = load i64, ptr %link
  store i64 %before, ptr %last
  br label %test
end:
  ret void
}}
"""

_WITHOUT_ARRAYS = """
define internal void @NRT_incref(ptr %array) { ret void }
define internal void @NRT_decref(ptr %array) { ret void }
"""

RUNTIME = """
; Places of an array of another shape; all arrays are contiguous, with the last index first.
define internal i32 @numba_attempt_nocopy_reshape(i64 %nd, ptr %dims, ptr %strides, i64 %newnd,
    ptr %newdims, ptr %newstrides, i64 %itemsize, i32 %order) {
  br label %test
test:
  %i = phi i64 [ %newnd, %0 ], [ %j, %body ]
  %step = phi i64 [ %itemsize, %0 ], [ %wider, %body ]
  %more = icmp sgt i64 %i, 0
  br i1 %more, label %body, label %end
body:
  %j = sub i64 %i, 1
  %out = getelementptr i64, ptr %newstrides, i64 %j
  store i64 %step, ptr %out
  %in = getelementptr i64, ptr %newdims, i64 %j
  %length = load i64, ptr %in
  %wider = mul i64 %step, %length
  br label %test
end:
  ret i32 1
}
; Differing bits of words at two addresses.
define internal i64 @masmc.difference(ptr %a, ptr %b, i64 %count) {
  br label %body
body:
  %i = phi i64 [ 0, %0 ], [ %next, %body ]
  %before = phi i64 [ 0, %0 ], [ %after, %body ]
  %ap = getelementptr i64, ptr %a, i64 %i
  %bp = getelementptr i64, ptr %b, i64 %i
  %av = load i64, ptr %ap
  %bv = load i64, ptr %bp
  %bits = xor i64 %av, %bv
  %after = or i64 %before, %bits
  %next = add i64 %i, 1
  %more = icmp ult i64 %next, %count
  br i1 %more, label %body, label %end
end:
  ret i64 %after
}
; A square root, which every target has as an instruction.
define internal double @sqrt(double %x) alwaysinline {
  %y = call double @llvm.sqrt.f64(double %x)
  ret double %y
}
declare double @llvm.sqrt.f64(double)
"""

_WIDE_PRODUCT = """
; Product of two numbers of 128 bits, low words first: a function of compilers, here for sizes of
; arrays, whose product may overflow.
define void @__multi3(ptr %out, i64 %a, i64 %a.high, i64 %b, i64 %b.high) {
  %a0 = and i64 %a, 4294967295
  %a1 = lshr i64 %a, 32
  %b0 = and i64 %b, 4294967295
  %b1 = lshr i64 %b, 32
  %p00 = mul i64 %a0, %b0
  %p01 = mul i64 %a0, %b1
  %p10 = mul i64 %a1, %b0
  %p11 = mul i64 %a1, %b1
  %c00 = lshr i64 %p00, 32
  %l01 = and i64 %p01, 4294967295
  %l10 = and i64 %p10, 4294967295
  %m0 = add i64 %c00, %l01
  %middle = add i64 %m0, %l10
  %low = mul i64 %a, %b
  %c01 = lshr i64 %p01, 32
  %c10 = lshr i64 %p10, 32
  %carry = lshr i64 %middle, 32
  %h0 = add i64 %p11, %c01
  %h1 = add i64 %h0, %c10
  %h2 = add i64 %h1, %carry
  %x = mul i64 %a, %b.high
  %y = mul i64 %a.high, %b
  %h3 = add i64 %h2, %x
  %high = add i64 %h3, %y
  store i64 %low, ptr %out
  %second = getelementptr i64, ptr %out, i64 1
  store i64 %high, ptr %second
  ret void
}
"""

_ALLOCATION, _RELEASE = 'NRT_MemInfo_alloc_aligned', 'NRT_decref'

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
    _run(whole, 'add_global_dead_code_eliminate_pass')
    text = _with_single_constants(str(whole))
    if _SIZED in text:
        # It serves optimisations, which are done, and distinguishes copies of a function.
        text = _METADATA.sub('', text)
    has_arrays = f'@{_ALLOCATION}(' in text
    whole = llvm.parse_assembly(_with_memory(text) if has_arrays else text)
    runtime = llvm.parse_assembly(
        _layout_of(whole) + RUNTIME + (_ARRAYS if has_arrays else _WITHOUT_ARRAYS)
    )
    for function in runtime.functions:
        if not function.is_declaration:
            function.linkage = 'external'  # internal names cannot be linked
    whole.link_in(runtime)
    _keep(whole, functions)
    # Entries that call the same function have copies of it.
    _run(whole, 'add_merge_functions_pass')
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


def _run(module: Any, addition: str) -> None:
    """Run a pass on a module; `addition` is the method of llvmlite that adds it."""
    passes = llvm.create_new_module_pass_manager()
    getattr(passes, addition)()
    passes.run(module, llvm.create_pass_builder(_host(), llvm.create_pipeline_tuning_options()))


def _module_of(code: ExportedCode, name: str) -> Any:
    """Return the module of a kernel under a name; its other functions are internal."""
    # These two contain instructions of this processor already.
    text = re.sub(
        r'^define [^@]*@NRT_(incref|decref)\(.*?^}$', r'declare void @NRT_\1(ptr)',
        _LONG_NAME.sub(_short_name, code.text), flags=re.M | re.S,
    )  # fmt: skip
    module = llvm.parse_assembly(text)
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
    count = len(kinds) - len(entry.further)
    arguments = [f'{kind} %a{i}' for i, kind in enumerate(kinds[2:count])]
    further = map('i64 {}'.format, entry.further)
    constants, checks, differences = [], [], []
    for i, layout in enumerate(entry.layouts):
        if not layout:
            continue
        words = [
            f'i64 {int.from_bytes(layout[k:k + 8], "little")}' for k in range(0, len(layout), 8)
        ]
        constant, size = f'@masmc.layout.{name}.{i}', f'[{len(words)} x i64]'
        constants.append(f'{constant} = internal constant {size} [{", ".join(words)}]')
        checks.append(
            f'%d{i} = call i64 @masmc.difference(ptr %a{i}, ptr {constant}, i64 {len(words)})'
        )
        differences.append(f'%d{i}')
    total = '0'
    for i, difference in enumerate(differences):
        checks.append(f'%t{i} = or i64 {total}, {difference}')
        total = f'%t{i}'
    rejected = 0 if entry.failure == 0 else NOT_FINITE | OTHER_RECORDS
    lines = '\n  '.join([
        *checks,
        f'%is_other = icmp ne i64 {total}, 0',
        'br i1 %is_other, label %other, label %own',
    ])
    return f"""
{chr(10).join(constants)}
{'declare i64 @masmc.difference(ptr, ptr, i64)' if constants else ''}
declare i32 @{kernel}({', '.join(kinds)})
define i64 @{name}({', '.join(arguments)}) {{
  {_MEMORY} = alloca [{MEMORY} x i8], align 64
  store i64 64, ptr {_MEMORY}
  %last = getelementptr i8, ptr {_MEMORY}, i64 8
  store i64 0, ptr %last
  %result = alloca i64
  %exception = alloca ptr
  store i64 0, ptr %result
  {lines}
own:
  %code = call i32 @{kernel}({', '.join(['ptr %result', 'ptr %exception', *arguments, *further])})
  %value = load i64, ptr %result
  %is_raised = icmp ne i32 %code, 0
  %status = select i1 %is_raised, i64 {entry.failure}, i64 %value
  ret i64 %status
other:
  ret i64 {rejected}
}}
"""


def _with_memory(text: str) -> str:
    """Return intermediate code whose functions with arrays have their memory as an argument."""
    called = re.compile(r'(\bcall [^@\n]*@)("[^"\n]*"|[\w.$-]+)\((?=([^\n]))')
    defined = re.compile(r'^(define [^@\n]*@)("[^"\n]*"|[\w.$-]+)\((?=([^\n]))', re.M)
    callees: dict[str, set[str]] = {}
    own = set()
    for part in re.split(r'^(?=define )', text, flags=re.M)[1:]:
        start = defined.match(part)
        assert start is not None
        callees[start.group(2)] = {call.group(2) for call in called.finditer(part)}
        if f'{_MEMORY} = alloca' in part:
            own.add(start.group(2))
    users, size = {_ALLOCATION, _RELEASE}, 0
    while len(users) > size:
        size = len(users)
        users |= {name for name, calls in callees.items() if calls & users}

    def inserted(pointer: str) -> Callable[[re.Match[str]], str]:
        def replacement(match: re.Match[str]) -> str:
            if match.group(2) not in users - own:
                return match.group()
            comma = '' if match.group(3) == ')' else ', '
            return f'{match.group(1)}{match.group(2)}({pointer}{comma}'

        return replacement

    text = called.sub(inserted(f'ptr {_MEMORY}'), defined.sub(inserted(f'ptr {_MEMORY}'), text))
    declared = re.compile(r'^(declare [^@\n]*@)("[^"\n]*"|[\w.$-]+)\((?=([^\n]))', re.M)
    text = declared.sub(inserted('ptr'), text)
    return text.replace(f'declare noalias ptr @{_ALLOCATION}', f'declare ptr @{_ALLOCATION}')


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
    # Code for robots from URDFs is optimised already, and no size in it becomes a constant.
    level = 0 if _SIZED in text else 3
    options = llvm.create_pipeline_tuning_options(speed_level=level)
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(module, passes)
    check(module)
    return module


def joined_object(modules: Iterable[Any], target: Target) -> bytes:
    """Return the object code of modules by `optimised`, which are used up."""
    whole, *others = modules
    for other in others:
        whole.link_in(other)
    # A page has no library of a compiler; other 32-bit processors do not need one for this.
    if target.triple.startswith('wasm') and 'mul.with.overflow' in str(whole):
        whole.link_in(llvm.parse_assembly(_layout_of(whole) + _WIDE_PRODUCT))
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
