# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""CPUs for which code is made besides this machine's own."""

from __future__ import annotations

import platform

import llvmlite.binding as llvm

OTHERS = {'plain SSE2': 'generic', 'AVX2 and FMA': 'haswell'}


def host_has(cpu: str) -> bool:
    """Tell whether this machine runs code made for a CPU."""
    if cpu == 'generic':
        return True
    if platform.machine() not in ('x86_64', 'AMD64'):
        return False
    features = llvm.get_host_cpu_features()
    return all(features.get(name, False) for name in ('avx2', 'fma', 'bmi2'))
