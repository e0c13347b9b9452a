# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Source files that compiled code depends on.

Compiled code contains its function, the formulas that interfaces select by the types of the
arguments, and all they call. Therefore it depends on the files of these functions and on the files
that they import, directly or not. A change in another file leaves it valid.

Files of this package are read when this module is imported, like the modules themselves: after
an edit, a process must not save its code under the digest of the new text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache
import hashlib
import os
from pathlib import Path
import re
import sys
import sysconfig
from types import ModuleType

from masmc_ros.jit.generated import Type, Types
from masmc_ros.jit.sized_records import TAG
from numba import __version__ as numba_version
from numba import types

_PACKAGE = Path(__file__).parents[1]

_OWN = str(_PACKAGE) + os.sep

_FOLDERS = ('jit', 'numerics', 'robot', 'plant_model', 'law', 'reference', 'loop')
"""Folders of the package that contain compiled code."""

_WITHOUT_FORMULAS = ('params',)
"""Folders whose names compiled code does not use; declarations of parameters are in the types."""

_LIBRARIES = tuple(sysconfig.get_path(name) + os.sep for name in ('stdlib', 'purelib', 'platlib'))

_IMPORT = re.compile(
    r'^[ \t]*(?:from[ \t]+(\.*)([\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)'
    r'|import[ \t]+([^\n]*))',
    re.MULTILINE,
)
_NAME = re.compile(r'[\w.]+')

SELECTED_BY_TAG: dict[str, Callable[[str], object]] = {}
"""Functions from the value of a tag to the formulas that it selects, by the name of the tag."""

SELECTED_BY_CLASS: list[Callable[[type], object]] = []
"""Functions from the class of a named tuple to the formulas that it selects."""


def _read(path: str | Path) -> str:
    try:
        return Path(path).read_text(encoding='utf-8')
    except OSError:  # a cell of a notebook, or a module in an archive
        return ''


_modules = {
    '.'.join(path.relative_to(_PACKAGE.parent).with_suffix('').parts): str(path)
    for name in _FOLDERS
    for path in sorted((_PACKAGE / name).rglob('*.py'))
}
_contents = {path: _read(path) for path in _modules.values()}


def remember(path: str, stamp: Callable[[], object] = str) -> None:
    """Read the file of a module that is being imported; `stamp` is the version of no file."""
    if not _contents.get(path):
        _contents[path] = _read(path) or str(stamp())


def digest(roots: Iterable[str]) -> str:
    """Return a digest of files and of all that they import."""
    return _digest(frozenset(roots))


@cache
def _digest(roots: frozenset[str]) -> str:
    whole = hashlib.sha256(numba_version.encode())
    for path in sorted(closure(roots)):
        whole.update(path.encode() + _hash(path))
    return whole.hexdigest()[:16]


@cache
def _hash(path: str) -> bytes:
    return hashlib.sha256(_contents[path].encode()).digest()


def closure(roots: Iterable[str]) -> set[str]:
    """Return files, those that they import, and those that extend the compiler."""
    known: set[str] = set()
    waiting = [*roots, *_extensions()]
    while waiting:
        path = waiting.pop()
        if path not in known:
            known.add(path)
            waiting += _imported(path)
    return known


@cache
def _extensions() -> tuple[str, ...]:
    """Return the files of the package that extend Numba: types of theirs reach all code."""
    folder = str(_PACKAGE / 'jit') + os.sep
    return tuple(
        path for path, text in _contents.items()
        if path.startswith(folder) and '\nfrom numba' in text
    )


@cache
def _imported(path: str) -> tuple[str, ...]:
    """Return the imported files of this package, and of the package of the file."""
    remember(path)
    names: set[str] = set()
    for dots, module, of_module, modules in _IMPORT.findall(_contents[path].replace('\\\n', ' ')):
        names.update(_NAME.findall(modules))
        base = _absolute(path, len(dots), module) if dots else module
        names.add(base)
        if base not in _modules:  # perhaps a package
            names.update(f'{base}.{name}' for name in _NAME.findall(of_module))
    files = (_modules.get(name) or _file_of(name, path) for name in names)
    return tuple(file for file in files if file)


def _absolute(path: str, dots: int, module: str) -> str:
    """Return the full name of a module that a file imports relative to its package."""
    folder = Path(path).parents[dots - 1]
    parts = [module] if module else []
    while (folder / '__init__.py').exists():
        parts.insert(0, folder.name)
        folder = folder.parent
    return '.'.join(parts)


def _file_of(name: str, importing: str) -> str:
    """Return the file of a module, if compiled code of `importing` may depend on it, or ''."""
    first, *parts = name.split('.')
    if first == _PACKAGE.name:
        is_known = len(parts) < 2 or parts[0] in (*_FOLDERS, *_WITHOUT_FORMULAS)
        path = _PACKAGE.joinpath(*parts).with_suffix('.py')
        return '' if is_known or not path.is_file() else str(path)
    if importing.startswith(_OWN):
        return ''
    module = sys.modules.get(name)
    file = getattr(module, '__file__', None) or ''
    is_neighbour = os.path.dirname(file) == os.path.dirname(importing)
    is_own = is_neighbour or first in Path(importing).parts or not file.startswith(_LIBRARIES)
    return file if file.endswith('.py') and (is_own or _has_formulas(module)) else ''


def _has_formulas(module: ModuleType | None) -> bool:
    # `hasattr` would call the `__getattr__` of foreign objects, which may raise.
    names = getattr(module, '__dict__', {})
    return any('py_func' in getattr(value, '__dict__', ()) for value in names.values())


def files_of_types(kinds: Types) -> set[str]:
    """Return the files of the formulas that interfaces select by types of arguments."""
    files: set[str] = set()
    for kind in kinds:
        files |= _files_of_type(kind)
    return files


@cache
def _files_of_type(kind: Type) -> frozenset[str]:
    files: set[str] = set()
    if isinstance(kind, types.Dispatcher):
        files.add(kind.dispatcher.py_func.__code__.co_filename)
    named = getattr(kind, 'instance_class', None)
    if named is not None:
        file = getattr(sys.modules.get(named.__module__), '__file__', None)
        files |= _selected(SELECTED_BY_CLASS, named) | ({file} if file else set())
    for name, _, value in (tag.partition(TAG) for tag in _tags(kind)):
        if name in SELECTED_BY_TAG:
            files |= _selected([SELECTED_BY_TAG[name]], value)
    for part in _parts(kind):
        files |= _files_of_type(part)
    return frozenset(files)


def _tags(kind: Type) -> tuple[str, ...]:
    """Return the tags of a type of records."""
    is_record = isinstance(kind, types.Record)
    names = kind.fields if is_record else getattr(kind, 'names', ())
    return tuple(name for name in names if TAG in name)


def _parts(kind: Type) -> Iterator[Type]:
    """Yield the types in a type: entries of tuples, elements of arrays, the record of a lane."""
    yield from getattr(kind, 'types', ())
    for name in ('dtype', 'record'):
        part = getattr(kind, name, None)
        if isinstance(part, types.Type) and part is not kind:
            yield part


def _selected(finders: Iterable[Callable[..., object]], value: object) -> set[str]:
    files: set[str] = set()
    for find in finders:
        with suppress(LookupError, StopIteration):  # a tag or a class that selects nothing
            files |= files_of(find(value))
    return files


def files_of(formulas: object) -> set[str]:
    """Return the files of formulas: those of a namespace, or of a module."""
    if isinstance(formulas, ModuleType):
        return {str(formulas.__file__)}
    values = vars(formulas).values()
    return {value.py_func.__code__.co_filename for value in values if hasattr(value, 'py_func')}
