# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Digests of closed-loop runs, computed in this process or for another CPU.

`python closed_loop_bits.py TICKS [NAME...]` prints them as JSON, together with the kinds of
instructions in the compiled code.
The digests in test_same_bits.py are those of 2001 ticks.
"""

from __future__ import annotations

from collections.abc import Sequence
import hashlib
import json
import re
import sys
from typing import Any

from helpers.scenario import axes, PAPER_LAWS, Run, Scenario, whole
from masmc_ros.law.parts.velocity_estimator import ESTIMATED
from masmc_ros.law.registry import SWITCHING
from masmc_ros.loop.closed_loop import closed_loop
import numpy as np


def scenarios(ticks: int) -> dict[str, Scenario]:
    """Return a run of every law with every switching, and runs with all other options."""
    runs = {
        f'{law} {switching}': Scenario(law, switching, ticks=ticks)
        for law in PAPER_LAWS
        for switching in SWITCHING
    }
    runs['everything on'] = Scenario(
        'rasmc',
        'implicit',
        0.5,
        ticks=ticks,
        steps=3,
        limit=axes(6.0, 5.0, 0.0, 8.0),
        k_s1=axes(120.0, 80.0, 100.0, 0.0),
        k_s2=axes(90.0, 0.0, 100.0, 70.0),
        gamma=np.linspace(0.5, 8.0, 7),
        rates=axes(1.0, -1.0, 0.3, -0.2),
    )
    runs['imperfect'] = Scenario(
        'rasmc',
        'implicit',
        0.3,
        ticks=ticks,
        gamma=np.full(7, 0.01),
        extra=(
            ('torque_limit', axes(4.0, 4.0, 9.0, 6.0)),
            ('torque_rate_limit', axes(0.0, 2e3, 9e3, 4e3)),
            ('leakage', 0.1),
            ('e_modification', 0.2),
            ('dead_zone', 1e-3),
            ('projection_lower', 0.5),
            ('projection_upper', 2.0),
            ('freeze_when_saturated', 1),
            ('velocity_source', ESTIMATED),
            ('estimator_bandwidth', 1000.0),
        ),
        measured=(
            ('resolution', np.full(4, 1e-4)),
            ('noise', np.full(4, 0.02)),
            ('delay', 1),
            ('seed', 3),
        ),
    )
    return runs


def digest(run: Run) -> str:
    """Return the SHA-256 of every number of a run, with one bit pattern for NaN."""
    sha = hashlib.sha256()
    for name in ('position', 'velocity', 'applied', 'torque', 'error', 'surface', 'estimate'):
        values = np.where(np.isnan(getattr(run, name)), np.nan, getattr(run, name))
        sha.update(values.astype('<f8').tobytes())
    sha.update(str(run.singular).encode())
    return sha.hexdigest()


def machine_code() -> dict[str, int]:
    """Count the kinds of instructions in the closed loop's compiled code (x86-64)."""
    kinds = {'avx': r'\bvmulsd\b|\bvmulpd\b', 'sse': r'\bmulsd\b|\bmulpd\b', 'fma': r'\bvfn?m'}
    texts = closed_loop.inspect_asm().values() if hasattr(closed_loop, 'inspect_asm') else ()
    return {name: sum(len(re.findall(kind, t)) for t in texts) for name, kind in kinds.items()}


def report(ticks: int, names: Sequence[str]) -> dict[str, Any]:
    """Return the digests of some or all scenarios, and the kinds of instructions."""
    known = scenarios(ticks)
    digests = {name: digest(whole(known[name])) for name in names or known}
    return {'digests': digests, 'machine code': machine_code()}


if __name__ == '__main__':
    print(json.dumps(report(int(sys.argv[1]), sys.argv[2:]), indent=1))
