# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Compilation of formulas, and the folder of the compiled code.

Decorators for everything numerical in this package:

* `formula`: a pure function of numbers and tuples. It is inlined into every compiled function
  that calls it, and Python can call it as well.
* `inlined`: a part of a kernel, separated for the reader or shared with another kernel.
* `kernel`: a function of arrays that Python calls once per tick or once per run. Its compiled
  code persists on the disk.

Neither uses fast-math: LLVM must neither reassociate a sum nor contract a product into a
fused multiply-add, because runs are bitwise identical on every machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, cached_property, update_wrapper
import gc
import hashlib
import os
from pathlib import Path
import pickle
import sys
from threading import local
from typing import Any, cast, NamedTuple
import zlib

from llvmlite import __version__ as llvmlite_version
from masmc_ros.aliases import AnyFunction, Function
from masmc_ros.errors import InputError, UserError
from masmc_ros.jit.code_files import CodeFiles, Key, LOCKS
from masmc_ros.jit.compiler_errors import COMPILER_ERRORS, explained
from masmc_ros.jit.generated import Types
from masmc_ros.jit.inlined_code import (
    CalledCompiler,
    ExportedCompiler,
    InlinedCompiler,
    KernelCompiler,
    LargePartCompiler,
    subroutines_of,
    types_of_caller,
)
from masmc_ros.jit.sized_records import has_sized_records, type_of
from masmc_ros.jit.sources import digest, files_of_types, remember
from masmc_ros.jit.supported_numba import (
    FIRST_UNSUPPORTED,
    OLDEST,
    OLDEST_OF_EXPORT,
    version_numbers,
)
from masmc_ros.user_folder import runtime_folder
from numba import __version__ as numba_version
from numba import config, njit
from numba.core import event
from numba.core.codegen import ll
from numba.core.typing import Signature
import numpy as np

_settings: Any = config  # its attributes are made when it is imported


if version_numbers(numba_version) < version_numbers(OLDEST):
    raise UserError(
        f'numba {numba_version} is too old: expected {OLDEST} or later;'
        ' pip install --upgrade numba'
    )


class _RareCollections(event.Listener):
    """
    Listener that reduces garbage collection during compilation.

    The compiler creates many lasting objects, which every collection visits again. This takes a
    fifth of the compilation time of a law.
    """

    def __init__(self) -> None:
        self._usual: list[tuple[int, int, int]] = []

    def on_start(self, event: event.Event) -> None:
        usual = gc.get_threshold()
        self._usual.append(usual)
        # Zero disables the collection.
        gc.set_threshold(usual[0] and max(usual[0], 20_000), *usual[1:])

    def on_end(self, event: event.Event) -> None:
        gc.set_threshold(*self._usual.pop())


event.register('numba:compile', _RareCollections())


_EXPORTED: Mapping[str, Any] = {
    'error_model': 'numpy', 'no_cpython_wrapper': True, 'no_cfunc_wrapper': True,
    'pipeline_class': ExportedCompiler,
}  # fmt: skip
"""Options of functions for other processors, which this process does not run."""


def _failure(error: Exception) -> InputError:
    """Return the line of an error of the compiler, and let other processes compile the code."""
    LOCKS.release_all()
    return explained(error)


class Formula:
    """Formula that compiled functions inline; a call from Python computes it in plain Python."""

    def __init__(
        self, function: Function, compiler: type[InlinedCompiler] = InlinedCompiler
    ) -> None:
        """Initialise the formula of a function in plain Python, and its compiler."""
        update_wrapper(self, function)
        self._compiler = compiler
        self.py_func = function
        # A later edit of the file is another source than that of this process.
        remember(function.__code__.co_filename)

    @cached_property
    def _compiled(self) -> Any:
        # Created when its caller is compiled, which most processes never do.
        return _compile(
            self.py_func,
            forceinline=True,
            no_cpython_wrapper=True,
            pipeline_class=self._compiler,
        )

    @cached_property
    def _exported(self) -> Any:
        return njit(**_EXPORTED, forceinline=self._compiler is InlinedCompiler)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        """Function that compiled code uses in place of this object."""
        is_exporting = getattr(_thread, 'is_exporting', False)
        return (self._exported if is_exporting else self._called)._numba_type_

    @property
    def _called(self) -> Any:
        """Function for calls from compiled functions of this process."""
        return self._compiled

    def __call__(self, *arguments: object) -> Any:
        """Call it from Python, with the same bits; compiling it would take longer."""
        try:
            return self.py_func(*arguments)
        except ZeroDivisionError:
            with np.errstate(all='ignore'):
                return self.py_func(*_with_ieee_division(arguments))


class _Part(Formula):
    """Formula whose statements replace its calls, unless the sizes or lanes require calls."""

    _compiler: type[CalledCompiler]

    @property
    def targetoptions(self) -> Mapping[str, str]:
        """Return the option by which Numba decides whether statements replace the calls."""
        # Exported code has no results with pointers in memory, see `object_code.optimised`.
        is_exporting = getattr(_thread, 'is_exporting', False)
        is_called = self._compiler.is_called_by(types_of_caller()) and not is_exporting
        return {'inline': 'never' if is_called else 'always'}


def _with_ieee_division(value: Any) -> Any:
    """Return numbers in nested tuples as those of NumPy, which divide by zero as compiled code."""
    if isinstance(value, tuple):
        numbers = map(_with_ieee_division, value)
        return value._make(numbers) if hasattr(value, '_make') else tuple(numbers)
    return np.float64(value) if isinstance(value, float) else value


class Kernel(Formula):
    """Compiled function that Python calls; the attributes are those of Numba's dispatcher."""

    def __init__(
        self,
        function: Function,
        compiled: Function,
        compiler: type[InlinedCompiler] = InlinedCompiler,
    ) -> None:
        """Initialise the kernel of a function, with the compiler for calls from other kernels."""
        super().__init__(function, CalledCompiler)
        self.__dict__['_compiled'] = compiled
        self._compiler_of_called = compiler

    @cached_property
    def _called(self) -> Any:
        # Callers optimise it and make its instructions, unless it is a subroutine.
        return _compile(
            self.py_func, 'called', no_cpython_wrapper=True,
            pipeline_class=self._compiler_of_called,
        )  # fmt: skip

    def __call__(self, *arguments: object) -> Any:
        """Call it from Python; raise InputError with one line if it cannot be compiled."""
        if _is_interpreting():
            return self.py_func(*arguments)
        if has_sized_records(arguments):
            return bound(self, *arguments)(*arguments)
        try:
            return self._compiled(*arguments)
        except COMPILER_ERRORS as error:
            raise _failure(error) from error

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the dispatcher."""
        return getattr(self.__dict__['_compiled'], name)


_thread = local()


def _is_interpreting() -> bool:
    return getattr(_thread, 'is_interpreting', False)


@contextmanager
def interpreted() -> Iterator[None]:
    """Let this thread run formulas and kernels as plain Python."""
    before = _is_interpreting()
    _thread.is_interpreting = True
    try:
        yield
    finally:
        _thread.is_interpreting = before


def formula(function: AnyFunction) -> AnyFunction:
    """Compile a pure scalar function, inlined where it is called from compiled code."""
    return function if _settings.DISABLE_JIT else cast(AnyFunction, Formula(function))


def inlined(function: AnyFunction) -> AnyFunction:
    """
    Compile a function such that its statements replace its calls in compiled functions.

    The compiler optimises a formula alone and again in each caller that inlines it. This takes
    most of the compile time if the function has few callers and calls most others.
    """
    if _settings.DISABLE_JIT:
        return function
    compiled = Kernel(function, njit(inline='always')(function))
    compiled.__dict__['_exported'] = compiled.__dict__['_called'] = compiled.__dict__['_compiled']
    return cast(AnyFunction, compiled)


def subroutine(function: AnyFunction) -> AnyFunction:
    """
    Compile a formula of many operations; robots whose sizes are known at run time call it.

    It is compiled once for all callers, which contain its name only.
    """
    if _settings.DISABLE_JIT:
        return function
    return cast(AnyFunction, Formula(function, CalledCompiler))


def part(function: AnyFunction) -> AnyFunction:
    """
    Compile a part of a tick: for sizes known at run time as `subroutine`, others as `inlined`.

    Parts that do not depend on the law are compiled once for all laws, see `lanes.shared`.
    """
    if _settings.DISABLE_JIT:
        return function
    return cast(AnyFunction, _Part(function, CalledCompiler))


def large_part(function: AnyFunction) -> AnyFunction:
    """
    Compile a `part` that takes much longer than its call: functions of one lane call it as well.

    Loops over several lanes inline it, because they vectorise only without calls.
    """
    if _settings.DISABLE_JIT:
        return function
    return cast(AnyFunction, _Part(function, LargePartCompiler))


def kernel(function: AnyFunction) -> AnyFunction:
    """Compile a function over arrays, and store its compiled code on the disk."""
    compiled = _compile(function)
    return cast(AnyFunction, compiled if _settings.DISABLE_JIT else Kernel(function, compiled))


def called_kernel(function: AnyFunction) -> AnyFunction:
    """
    Compile a kernel that other kernels call, as `subroutine`, if its sizes are known at run time.

    Other kernels are a part of the code of their callers.
    """
    compiled = _compile(function)
    if _settings.DISABLE_JIT:
        return cast(AnyFunction, compiled)
    return cast(AnyFunction, Kernel(function, compiled, CalledCompiler))


def kernel_of_threads(function: AnyFunction) -> AnyFunction:
    """
    Compile a kernel that runs without Python's lock, so threads compute at the same time.

    It is for calls of many milliseconds: after a short one, a thread would wait for the lock.
    """
    compiled = _compile(function, nogil=True)
    return cast(AnyFunction, compiled if _settings.DISABLE_JIT else Kernel(function, compiled))


def is_interpreted() -> bool:
    """Return True if NUMBA_DISABLE_JIT makes all formulas plain Python, without a compiler."""
    return bool(_settings.DISABLE_JIT)


def bound(kernel: Function, *arguments: object) -> Function:
    """
    Return the compiled code of a kernel for the types of these arguments.

    A function that is no kernel, as all are without a compiler, is returned as it is, and an
    `interpreted` one as plain Python. Raises InputError with one line if the kernel cannot be
    compiled.

    It accepts only arguments of the same types. A kernel checks the types at every call, which
    takes longer than a control tick.
    """
    if not isinstance(kernel, Kernel):
        return kernel
    if _is_interpreting():
        return kernel.py_func
    types = tuple(map(type_of, arguments))
    # Loaded code is used without Numba's lock, which another thread may hold for a long time.
    loaded = kernel.overloads.get(types)
    try:
        code = kernel.compile(types) if loaded is None else loaded.entry_point
    except COMPILER_ERRORS as error:
        raise _failure(error) from error
    return cast(Function, code)


def is_loaded(kernel: Function, *arguments: object) -> bool:
    """Return True if this process has the compiled code for the types of these arguments."""
    if not isinstance(kernel, Kernel):
        return True
    return tuple(map(type_of, arguments)) in kernel.overloads


def code_file(kernel: Function, *arguments: object) -> Path:
    """Return the path of the file of the compiled code, which may be missing."""
    return _code_files(kernel).path(_key(kernel, tuple(map(type_of, arguments))))


def is_on_disk(kernel: Function, *arguments: object) -> bool:
    """Return True if the disk has a file of the compiled code; it may be damaged."""
    return code_file(kernel, *arguments).exists()


def is_whole_on_disk(kernel: Function, *arguments: object) -> bool:
    """Return True if no part of the code is missing; reads the files that are not loaded."""
    return _are_whole([(kernel, tuple(map(type_of, arguments)))])


def _are_whole(functions: list[tuple[Any, Types]]) -> bool:
    """Return True if this process or the disk has the code of dispatchers for these types."""
    known = set(functions)
    while functions:
        dispatcher, kinds = functions.pop()
        if kinds in dispatcher.overloads:
            continue  # this process has loaded it, with its subroutines
        data = _code_files(dispatcher).read(_key(dispatcher, kinds))
        if data is None:
            return False
        called = {(s.dispatcher, s.arguments) for s in subroutines_of(cast(list[Any], data))}
        functions += called - known
        known |= called
    return True


def _code_files(kernel: Function) -> CodeFiles:
    files: CodeFiles = cast(Kernel, kernel)._cache._cache_file
    return files


def _key(dispatcher: Any, kinds: Types) -> Key:
    """Return the key under which Numba keeps the code for types of arguments."""
    key: Key = dispatcher._cache._index_key(kinds, dispatcher.targetctx.codegen())
    return key


def _compile(function: Function, kind: str = '', **options: Any) -> Any:
    """
    Return the dispatcher of a function.

    Parameters
    ----------
    function
        Function in plain Python.
    kind
        Part of the names of its files, for a second dispatcher of the same function.
    options
        Options of Numba.

    """
    # IEEE division (error_model) instead of a branch that raises ZeroDivisionError.
    previous, _settings.CACHE_DIR = _settings.CACHE_DIR, str(code_directory())
    try:
        # No caller uses C's conventions, and a wrapper for them takes long to compile.
        options = {
            'error_model': 'numpy', 'cache': True, 'no_cfunc_wrapper': True,
            'pipeline_class': KernelCompiler, **options,
        }  # fmt: skip
        compiled = njit(**options)(function)
    finally:
        _settings.CACHE_DIR = previous
    if not _settings.DISABLE_JIT:
        _replace_files(compiled, function.__code__.co_filename, kind)
    return compiled


def _replace_files(compiled: Any, source: str, kind: str) -> None:
    """
    Replace Numba's files of compiled code.

    Numba has no public way to do so. Its own files mix the code of processes that compile at
    once, and it keeps outdated code if an inlined function changes.
    """
    try:
        cache = compiled._cache
        remember(source, cache._impl.locator.get_source_stamp)
        cache._cache_file = CodeFiles(
            cache.cache_path,
            cache._impl.filename_base + kind,
            lambda key: digest({source, *files_of_types(key[0])}),
        )
    except AttributeError as error:
        raise UserError(
            f'numba {numba_version} is not supported ({error}): expected {OLDEST} or later, below '
            f"{FIRST_UNSUPPORTED}; pip install 'numba<{FIRST_UNSUPPORTED}'"
        ) from error


class ExportedCode(NamedTuple):
    """Intermediate code of a function, and the name of the function in it."""

    text: str
    name: str


def exported_code(
    function: Function,
    signature: Signature,
    *contents: object,
    on_compilation: Callable[[], None] = lambda: None,
) -> ExportedCode:
    """
    Return the intermediate code of a function for other processors, from the disk if it is there.

    Everything it calls is compiled for the export alone, so the code does not depend on what the
    process has compiled.

    Parameters
    ----------
    function
        Function in plain Python, which may be a closure.
    signature
        Types of its arguments and of its result.
    contents
        Values in its closure, which the code depends on.
    on_compilation
        Called before the function is compiled, if the disk lacks its code.

    Raises
    ------
    InputError
        If it cannot be compiled, with one line.
    UserError
        If Numba is too old.

    """
    if version_numbers(numba_version) < version_numbers(OLDEST_OF_EXPORT):
        raise UserError(
            f'numba {numba_version} makes no libraries: expected {OLDEST_OF_EXPORT} or later'
        )

    def compiled() -> ExportedCode:
        on_compilation()
        _thread.is_exporting = True
        try:
            code = njit(**_EXPORTED)(function)
            code.compile(signature)
        except COMPILER_ERRORS as error:
            raise _failure(error) from error
        finally:
            _thread.is_exporting = False
        name = code.overloads[signature.args].fndesc.llvm_func_name
        return ExportedCode(code.inspect_llvm(signature.args), name)

    source = function.__code__.co_filename
    key = function.__qualname__, *contents
    return ExportedCode(*stored('exported', [source], signature.args, key, compiled))


def stored(
    name: str,
    sources: Iterable[str],
    kinds: Types,
    contents: tuple[object, ...],
    compute: Callable[[], Any],
) -> Any:
    """
    Return a result of the compiler, which is computed unless the disk has it.

    Parameters
    ----------
    name
        First part of the name of the file.
    sources
        Files that the result depends on, also by their imports.
    kinds
        Types of arguments, whose formulas are further sources.
    contents
        Other inputs.
    compute
        Function that computes the result.

    """
    for source in sources:
        remember(source)
    files = CodeFiles(
        str(code_directory()), name, lambda key: digest({*sources, *files_of_types(key[0])})
    )
    key = kinds, (ll.get_host_cpu_name(), llvmlite_version), contents
    data = cast(bytes | None, files.load(key))
    if data is None:
        try:
            data = zlib.compress(pickle.dumps(compute()), 1)
            files.save(key, data)
        finally:
            LOCKS.release(files.path(key))
    return pickle.loads(zlib.decompress(data))


def machine_code(name: str, sources: Iterable[str], *contents: str) -> Path:
    """
    Return the path of a file next to the compiled code of these sources for this machine.

    Parameters
    ----------
    name
        First part of the name of the file.
    sources
        Files that the compilation depends on, also by their imports.
    contents
        Further inputs of the compilation.

    """
    # Numba distinguishes machines by the same values of llvmlite.
    machine = f'{ll.get_host_cpu_name()} {ll.get_host_cpu_features().flatten()}'
    kind = hashlib.sha256(f'{machine} {sys.version_info} {digest(sources)} {contents}'.encode())
    return code_directory() / f'{name}-{kind.hexdigest()[:12]}'


def _user_cache() -> Path:
    """Return the folder for caches of this package; RuntimeError if the user has no home."""
    return Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'masmc_ros'


@cache
def code_directory() -> Path:
    """Return the directory of compiled code."""
    # The temporary folder is shared: code from another user must not be executed.
    for parent in (_user_cache, runtime_folder):
        try:
            directory = parent() / 'code'
            directory.mkdir(parents=True, exist_ok=True)
        except (OSError, RuntimeError, UserError):
            continue
        if os.access(directory, os.W_OK):
            return directory
    return Path(__file__).parents[1] / '__pycache__'
