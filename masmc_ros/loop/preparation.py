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

"""
The kernels of all laws and switchings, compiled before a live change asks for one.

To compile one takes some seconds, in which a controller would stand still; to load machine code
from disk takes a thirtieth of one. So a node loads that of the paper's laws and of a user's own
while it starts; that of the others is loaded when `law` first names them. Where it is not on disk
yet, once on a machine, a process beside the node makes it, at the lowest priority.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
import json
import os
from pathlib import Path
import subprocess
import sys
from threading import Thread

from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.law.rasmc import RASMC
from masmc_ros.law.smc import SMC
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import control_tick, settle
from masmc_ros.loop.signals import inputs
from masmc_ros.numerics.compiled import bound, is_interpreted, machine_code
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.registry import chosen


def fitting(mechanism: Mechanism) -> tuple[Law, ...]:
    """Return the compiled laws that a robot of this kind can have."""
    return tuple(law for law in laws() if law.fits(mechanism))


def laws() -> tuple[Law, ...]:
    """Return the laws that are compiled, users' own among them."""
    found = (registry.load(name) for name in registry.names())
    return tuple(law for law in found if isinstance(law, Law))


def laws_at_hand() -> tuple[Law, ...]:
    """Return the laws of the paper and users' own, whose kernels a controller starts with."""
    others = set(registry.LAWS) - {SMC.name, RASMC.name}
    return tuple(law for law in laws() if law.name not in others)


def load(mechanism: Mechanism, which: Iterable[Law]) -> None:
    """Have the kernels of laws with all switchings at hand, compiled where they were not."""
    now = records.signals(mechanism)
    for law in which:
        memory = records.law_memory(mechanism, law)
        for switching in registry.SWITCHING if law.uses_switching else ('',):
            settings = records.law_settings(mechanism, law, switching)
            bound(control_tick, settings, memory, now, *inputs(now))
            bound(settle, settings, memory)


def mark(mechanism: Mechanism) -> Path:
    """Return the file that tells that the kernels of these laws are on this machine's disk."""
    name = f'prepared-{mechanism.tag}'.replace(' ', '-')
    return machine_code(name, *map(records.law_tag, laws()))


def prepare(mechanism: Mechanism) -> subprocess.Popen[bytes] | None:
    """Load the kernels, or let a process make them, which is returned; it ends with this one."""
    if is_interpreted(control_tick):
        return None
    if mark(mechanism).exists():
        load(mechanism, laws_at_hand())
        return None
    process = subprocess.Popen(
        [sys.executable, '-m', __name__], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdin is not None
    with suppress(BrokenPipeError):
        process.stdin.write(json.dumps(mechanism.choice).encode() + b'\n')
        process.stdin.flush()
    return process


def main() -> None:
    """Make the kernels of the mechanism in the first line of the input, unless another does."""
    mechanism = chosen(json.loads(sys.stdin.readline()))
    # Standard input is the node that asked: it is closed when that ends, however it does.
    Thread(target=_end_with_parent, daemon=True).start()
    if hasattr(os, 'nice'):
        os.nice(19)
    done = mark(mechanism)
    at_work = done.with_suffix('.lock')
    with at_work.open('w') as file:
        if _is_first(file.fileno()):
            load(mechanism, fitting(mechanism))
            done.touch()


def _is_first(file: int) -> bool:
    """Lock a file for as long as this process lives; tell whether nobody has."""
    try:
        import fcntl
    except ImportError:  # not on Windows
        return True
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == '__main__':
    main()
