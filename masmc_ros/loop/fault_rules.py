# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Rules of faults and timeouts, shared by the controller core and compiled supervision.

The core calls them in plain Python; `supervision.py` compiles them.
"""

from __future__ import annotations


def is_overdue(now: float, start: float, timeout: float) -> bool:
    """Return True if more than a timeout has passed since its start, all in s or all in ns."""
    return now - start > timeout


def takes_fault(is_active: bool, is_latched_fault: bool, latches: bool) -> bool:
    """
    Return True if a fault has an effect.

    Only an active controller has a passing fault. A latched fault takes effect in all states
    except another latched fault.
    """
    return not is_latched_fault if latches else is_active


def recovers(is_fault: bool, is_latched: bool, has_ended: bool) -> bool:
    """Return True if a fault whose cause has ended, or not, changes to active."""
    return is_fault and has_ended and not is_latched
