# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Errors that the user can correct, each reported in one line, and the remedies of missing packages.

Packages that an installation may lack are for logs, reports and viewers. rosdep installs some of
them by pip, which a machine may not allow, and does not know the others. Therefore no node that
controls a robot imports them.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from importlib import import_module


class UserError(Exception):
    """
    Error that the user can correct, with the value, its place and the remedy.

    The message is one line: line breaks in quoted values become spaces. A command prints only
    the message and ends with `exit_status`.
    """

    exit_status = 2

    def __init__(self, message: str) -> None:
        """Initialise the error with one line from `message`."""
        super().__init__(' '.join(message.splitlines()))


class InputError(UserError):
    """Invalid file, parameter, option or name."""


def suggestion(word: str, known: Iterable[str]) -> str:
    """
    Return a suggestion for an unknown `word`.

    Parameters
    ----------
    word
        unknown name.
    known
        known names.

    Returns
    -------
        'did you mean A or B?' with the nearest names, 'known are A, B, C' if none is near,
        'none is known' without known names.

    """
    names = list(known)
    if not names:
        return 'none is known'
    near = get_close_matches(word, names, n=3)
    if near:
        return f'did you mean {" or ".join(near)}?'
    return f'known are {", ".join(names)}'


PACKAGES = {
    'clarabel': 'clarabel',
    'cuda': 'cuda-bindings',
    'distributed': 'distributed',
    'gymnasium': 'gymnasium',
    'lz4': 'lz4',
    'mcap': 'mcap',
    'mcap_ros2': 'mcap-ros2-support',
    'mujoco': 'mujoco-core',
    'optuna': 'optuna',
    'pandas': 'pandas',
    'plotly': 'plotly',
    'pyarrow': 'pyarrow',
    'rosbags': 'rosbags',
    'ruckig': 'ruckig',
    'scipy': 'scipy',
    'toppra': 'toppra',
    'trimesh': 'trimesh',
    'viser': 'viser',
    'xarray': 'xarray',
    'zstandard': 'zstandard',
}
"""Names of the modules for pip."""


def remedy(error: ModuleNotFoundError) -> UserError:
    """Return the remedy for a missing module; raise the error for a module not in PACKAGES."""
    module = (error.name or '').partition('.')[0]
    if module not in PACKAGES:
        raise error
    return UserError(f'{module} is not installed; pip install {PACKAGES[module]}')


def require_rclpy() -> None:
    """Raise UserError with the remedy if rclpy cannot be imported."""
    try:
        import_module('rclpy')
    except ImportError as error:
        raise UserError(
            f'rclpy cannot be imported ({error}); source a ROS 2 Jazzy installation, or install'
            " its wheels in a checkout with pip install '.[ros]' (Linux x86_64); masmc simulate"
            ' runs without it'
        ) from error
