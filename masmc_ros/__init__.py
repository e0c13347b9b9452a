# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robust adaptive sliding mode control of mobile manipulators for ROS 2."""

from importlib import import_module

__version__ = '0.1.0'

_INTERFACE = {
    'load': 'masmc_ros.api.scenario',
    'simulate': 'masmc_ros.api.simulate',
    'compare_laws': 'masmc_ros.api.campaigns',
    'sweep': 'masmc_ros.api.campaigns',
    'monte_carlo': 'masmc_ros.api.campaigns',
    'tune': 'masmc_ros.api.tuning',
    'read': 'masmc_ros.api.scenario',
    'laws': 'masmc_ros.api.scenario',
    'load_robot': 'masmc_ros.api.scenario',
}
"""Functions of the Python interface and their modules, imported on demand: nodes start without."""


def __getattr__(name: str) -> object:
    """Return a function of the Python interface."""
    if name not in _INTERFACE:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(_INTERFACE[name]), name)


def __dir__() -> list[str]:
    """Return the names of the module with those of the Python interface."""
    return sorted([*globals(), *_INTERFACE])
