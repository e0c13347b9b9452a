# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Target CPUs of compiled code other than this machine's own."""

from __future__ import annotations

import platform

import llvmlite.binding as llvm

OTHERS = {'plain SSE2': 'generic', 'AVX2 and FMA': 'haswell'}


def host_has(cpu: str) -> bool:
    """Return True if this machine can run code compiled for a CPU."""
    if cpu == 'generic':
        return True
    if platform.machine() not in ('x86_64', 'AMD64'):
        return False
    features = llvm.get_host_cpu_features()
    return all(features.get(name, False) for name in ('avx2', 'fma', 'bmi2'))
