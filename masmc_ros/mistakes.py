# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Mistakes in the code of users, each reported in one line with its place.

Laws, paths and mechanisms of other packages can raise any error. Its traceback has many lines of
this package. The line of the user is the last one in their files.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
import linecache
from pathlib import Path
import sysconfig
import traceback
from types import ModuleType

from masmc_ros.errors import InputError, suggestion, UserError

_PACKAGE = Path(__file__).parent

_PYTHON = sysconfig.get_path('stdlib')


class MistakeError(Exception):
    """Mistake with a description of its own."""

    def __init__(self, text: str, file: str = '', line: int = 0) -> None:
        """
        Initialise the mistake.

        Parameters
        ----------
        text
            Description in one line.
        file, line
            Its place, if that is not the last line of the user in the traceback.

        """
        source = linecache.getline(file, line).strip() if file else ''
        place = f'{file}:{line}: ' if file else ''
        super().__init__(f'{place}{text}{f" in: {source}" if source else ""}')
        self.has_place = bool(file)


def place_and_text(error: BaseException, files: Collection[str] = (), otherwise: str = '') -> str:
    """
    Return place, text and source of a mistake.

    Parameters
    ----------
    error
        Error with the traceback.
    files
        Files of the user; without them, all files outside this package.
    otherwise
        Place of a mistake that no line of the user raised.

    """
    message = _message(error)
    if isinstance(error, MistakeError) and (
        error.has_place or any(message.startswith(file) for file in files)
    ):
        return message
    if isinstance(error, SyntaxError) and error.filename:
        return f'{error.filename}:{error.lineno}: {error.msg} in: {(error.text or "").strip()}'
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename in files] or [
        frame for frame in frames if _is_of_user(frame.filename)
    ]
    for frame in own[-1:]:
        return f'{frame.filename}:{frame.lineno}: {message} in: {frame.line}'
    return f'{otherwise}: {message}' if otherwise else message


@contextmanager
def reported(start: str, files: Collection[str], otherwise: str) -> Iterator[None]:
    """
    Raise InputError with one line for any error of a user's code.

    The line is `start` and that of `place_and_text`, whose arguments are the others. Errors that
    are already one line for the user pass.
    """
    try:
        yield
    except UserError:
        raise
    except Exception as error:
        raise InputError(f'{start}: {place_and_text(error, files, otherwise)}') from error


def _is_of_user(file: str) -> bool:
    """Return True for a file that belongs neither to this package nor to those below it."""
    if {'numba', 'numpy'} & set(Path(file).parts):
        return False
    return 'site-packages' in file or not file.startswith((str(_PACKAGE), '<', _PYTHON))


def _message(error: BaseException) -> str:
    """Return the text of a mistake, with the known names."""
    if isinstance(error, MistakeError):
        return str(error)
    if isinstance(error, AttributeError) and error.name is not None:
        owner = error.obj
        if hasattr(owner, '_fields'):
            name, names = type(owner).__name__.lower(), owner._fields
        elif isinstance(owner, ModuleType):
            name, names = owner.__name__.rpartition('.')[2], _public(vars(owner))
        else:
            return f'{error}; vectors have no methods' if isinstance(owner, tuple) else str(error)
        if error.name in names:
            return f'{name}.{error.name} is read-only'
        return f'{name} has no {error.name!r}: {suggestion(error.name, names)}'
    if isinstance(error, NameError) and error.name is not None:
        return f'{error.name} is not defined; expected an import or a declaration'
    text = f'{type(error).__name__}: {error}'
    is_arithmetic = isinstance(error, TypeError) and any(
        word in str(error) for word in ('operand', 'sequence', 'concatenate', 'tuple')
    )
    return f'{text}; elementwise(formula, a, b) computes with vectors' if is_arithmetic else text


def _public(names: Iterable[str]) -> list[str]:
    return [name for name in names if not name.startswith('_')]
