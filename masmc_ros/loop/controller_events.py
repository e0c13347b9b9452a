# SPDX-License-Identifier: Apache-2.0
"""What else than parameters changes the torque that a controller computes, from one tick on."""

from __future__ import annotations

ACTIVATED = 'activated'
"""The controller starts anew, as at the start of a run; if it was inactive, by an approach."""

RESUMED = 'resumed'
"""It goes on with what it had learned before it was deactivated."""

DEACTIVATED = 'deactivated'
"""No torque is computed, and nothing commanded: the drives hold."""

ADAPTATION_RESET = 'adaptation reset'
"""What was learned is forgotten; what was commanded is not."""

EVENTS = (ACTIVATED, RESUMED, DEACTIVATED, ADAPTATION_RESET)
