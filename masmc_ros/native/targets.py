# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Processors of libraries, and names of the functions of a GPU, known without the compiler."""

from __future__ import annotations

from typing import NamedTuple


class Target(NamedTuple):
    """A kind of processor and its conventions of calls."""

    triple: str
    processor: str
    features: str = ''
    relocation: str = 'pic'
    """Model of addresses in LLVM."""


TARGETS = {
    'x86_64-linux-gnu': Target('x86_64-unknown-linux-gnu', 'x86-64'),
    'x86_64-v3-linux-gnu': Target('x86_64-unknown-linux-gnu', 'x86-64-v3'),
    'aarch64-linux-gnu': Target('aarch64-unknown-linux-gnu', 'generic'),
    'arm-linux-gnueabihf': Target('armv7-unknown-linux-gnueabihf', 'generic', '+neon,+vfp3'),
    # Without a vendor, LLVM ignores `eabihf` and passes numbers in registers of whole numbers.
    'thumbv7em-none-eabihf': Target(
        'thumbv7em-unknown-none-eabihf', 'cortex-m7', relocation='static'
    ),
    'riscv64-linux-gnu': Target('riscv64-unknown-linux-gnu', 'generic-rv64', '+m,+a,+f,+d,+c'),
}
"""Known targets, named as the GNU tools for them; the first one is the default."""

WEB = Target('wasm32-unknown-unknown', 'generic', '+bulk-memory', 'static')
"""WebAssembly, for `web_module.web_module`."""

KERNEL, THREAD = 'masmc_kernel', 'masmc_thread'
"""Names of the function of a GPU, and of that of a single thread."""
