# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Node names of parameter files, with wildcards."""

from __future__ import annotations

import re

_NODE_NAME_LIMIT = 255
_NAMESPACE_LIMIT = 245
_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')
_WILDCARDS = ('*', '**')


def complaint(pattern: str) -> str:
    """
    Return the reason why rcl rejects a node name in a parameter file.

    Parameters
    ----------
    pattern
        the name with its namespace, as in `controller`, `/left/controller`,
        `/**/controller`, `/*` or `/**`.

    Returns
    -------
        The reason, '' for a valid name.

    """
    if pattern in ('/*', '/**'):
        return ''
    namespace, _, name = pattern.rpartition('/')
    # A pattern of one leading slash (or none) stands in the root namespace.
    tokens = namespace.removeprefix('/').split('/') if namespace else []
    for token in tokens:
        if not token:
            return 'it has two slashes in a row'
        if token not in _WILDCARDS and (problem := _token_complaint(token, _NAMESPACE_LIMIT - 1)):
            return problem
    if name in _WILDCARDS:
        return ''
    return _token_complaint(name, _NODE_NAME_LIMIT)


def _token_complaint(token: str, limit: int) -> str:
    if not token:
        return 'it ends with a slash'
    if not _TOKEN.fullmatch(token):
        return f"'{token}' is not made of letters, digits and _ with no digit first"
    if len(token) > limit:
        return f"'{token}' is longer than {limit} characters"
    return ''


def is_wildcard(pattern: str) -> bool:
    """Return True if a pattern applies to nodes of any name, such as `/**` and `/left/*`."""
    return pattern.rpartition('/')[2] in _WILDCARDS


def qualified(name: str, namespace: str = '/') -> str:
    """Join a namespace ('/', '/left' or 'left') and a node name to '/left/name'."""
    return '/'.join(('', *filter(None, namespace.split('/')), name))


def matches(pattern: str, qualified_name: str) -> bool:
    """
    Return True if a block of a parameter file applies to a node.

    Parameters
    ----------
    pattern
        the key of the block; `*` stands for one name, `**` for any number of them.
    qualified_name
        the node's name with its namespace, as in `/left/controller`.

    """
    absolute = pattern if pattern.startswith('/') else '/' + pattern
    # '/**' thereby becomes '(/\w+)*'.
    expression = absolute.replace('/*', r'(?:/\w+)')
    return re.fullmatch(expression, qualified_name, re.ASCII) is not None
