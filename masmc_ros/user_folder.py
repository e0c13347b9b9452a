# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Folder that the running processes of one user share, inaccessible to other users."""

from __future__ import annotations

import os
from pathlib import Path
import stat
import tempfile

from masmc_ros.errors import UserError


def runtime_folder() -> Path:
    """
    Return the user's folder, created if missing: owned, no link, writable by no other user.

    It is in XDG_RUNTIME_DIR, or in the temporary folder if that is not set. Raises UserError if
    another user has created a file or folder of this name.
    """
    if not hasattr(os, 'getuid'):
        return Path(tempfile.gettempdir())  # on Windows each user has a separate one
    runtime = os.environ.get('XDG_RUNTIME_DIR')
    if runtime and is_private(Path(runtime)):
        folder = Path(runtime) / 'masmc_ros'
    else:
        folder = Path(tempfile.gettempdir()) / f'masmc_ros-{os.getuid()}'
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        hint = 'set XDG_RUNTIME_DIR to a folder of yours'
        raise UserError(f'{folder}: {error.strerror}; {hint}') from error
    if not is_private(folder):
        raise UserError(
            f'{folder} is not a folder of yours that only you can write to; remove it, or set'
            ' XDG_RUNTIME_DIR to one'
        )
    return folder


def is_private(folder: Path) -> bool:
    """Return True for a folder, not a link, of this user, writable by no other user."""
    try:
        status = folder.lstat()
    except OSError:
        return False
    others = stat.S_IWGRP | stat.S_IWOTH
    is_own = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
    return is_own and not status.st_mode & others
