# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Modules of WebAssembly from object code, without a linker.

Object code of LLVM for WebAssembly is a module already: its addresses are those of a program of
one file, with constants from address 0. It only lacks exports, whose names are in a section for
linkers. Here they become a section of exports, and the sections for linkers are left out.
https://github.com/WebAssembly/tool-conventions/blob/main/Linking.md
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

from masmc_ros.errors import InputError

_CUSTOM, _IMPORTS, _EXPORTS = 0, 2, 7
"""Numbers of sections."""

_AFTER_EXPORTS = (8, 9, 10, 11, 12)
"""Sections that follow the exports: start, elements, code, data, number of data."""

_SYMBOLS, _FUNCTION = 8, 0
"""Table of symbols in the section `linking`; kind of a symbol, and of an export."""

_UNDEFINED, _NAMED_ANYWAY = 0x10, 0x40
"""Flags of a symbol: imported; named although it is imported."""

_OF_DATA, _OF_SECTION = 1, 3
"""Kinds of symbols that are no entries of an index."""

_PROVIDED = {b'__linear_memory', b'__stack_pointer'}
"""Imports that the page provides: memory, and the address below which the stack is."""


def web_module(code: bytes, names: Collection[str]) -> bytes:
    """
    Return a module that exports functions of object code.

    It imports `env.__linear_memory` and `env.__stack_pointer`; constants are at addresses from 0.

    Parameters
    ----------
    code
        Object code for `targets.WEB`.
    names
        Functions to be exported.

    Raises
    ------
    InputError
        If the code needs other imports.

    """
    kept, places = bytearray(code[:8]), dict[str, int]()
    sections = list(_sections(code))
    for number, content in sections:
        if number == _IMPORTS:
            _check_imports(content)
        elif number == _CUSTOM and content.startswith(b'\x07linking'):
            places = _functions(content[8:])
    exports = _number(len(names)) + b''.join(
        _text(name) + bytes([_FUNCTION]) + _number(places[name]) for name in names
    )
    has_exports = False
    for number, content in sections:
        if number in _AFTER_EXPORTS and not has_exports:
            kept += bytes([_EXPORTS]) + _text(exports)
            has_exports = True
        if number != _CUSTOM:
            kept += bytes([number]) + _text(content)
    return bytes(kept)


class _Reader:
    """Numbers and texts of a section, one after the other."""

    def __init__(self, content: bytes) -> None:
        self.content, self.place = content, 0

    def byte(self) -> int:
        self.place += 1
        return self.content[self.place - 1]

    def number(self) -> int:
        """Return an unsigned number of LEB128."""
        value = shift = 0
        while (byte := self.byte()) & 0x80:
            value |= (byte & 0x7F) << shift
            shift += 7
        return value | byte << shift

    def text(self) -> bytes:
        length = self.number()
        self.place += length
        return self.content[self.place - length : self.place]

    @property
    def is_over(self) -> bool:
        return self.place >= len(self.content)


def _sections(code: bytes) -> Iterator[tuple[int, bytes]]:
    reader = _Reader(code)
    reader.place = 8
    while not reader.is_over:
        yield reader.byte(), reader.text()


def _check_imports(content: bytes) -> None:
    reader = _Reader(content)
    for _ in range(reader.number()):
        reader.text()
        name, kind = reader.text(), reader.byte()
        if name not in _PROVIDED:
            raise InputError(
                f'the compiled law needs {name.decode()}; expected a law without functions of '
                'the system, see docs/guides/native.md'
            )
        if kind == 2:  # memory: with a maximum or not, and its pages
            has_maximum = reader.number()
            reader.number()
            if has_maximum:
                reader.number()
        else:  # global: type, and whether it can change
            reader.place += 2


def _functions(content: bytes) -> dict[str, int]:
    """Return the numbers of the defined functions by name."""
    reader, places = _Reader(content), {}
    reader.number()  # version
    while not reader.is_over:
        kind, table = reader.byte(), _Reader(reader.text())
        for _ in range(table.number() if kind == _SYMBOLS else 0):
            symbol, flags = table.byte(), table.number()
            if symbol == _OF_SECTION:
                table.number()
            elif symbol == _OF_DATA:
                table.text()
                for _ in range(0 if flags & _UNDEFINED else 3):
                    table.number()
            else:
                place = table.number()
                if not flags & _UNDEFINED or flags & _NAMED_ANYWAY:
                    name = table.text().decode()
                    if symbol == _FUNCTION:
                        places[name] = place
    return places


def _number(value: int) -> bytes:
    """Return an unsigned number as LEB128."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _text(content: bytes | str) -> bytes:
    content = content.encode() if isinstance(content, str) else content
    return _number(len(content)) + content
