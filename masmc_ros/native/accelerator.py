# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Devices that compute many runs at once: a GPU, and a stand-in that is this processor.

Both run the code of `native.gpu_code`, so batches, transfers and errors are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import ctypes
import re
from threading import RLock
from typing import Any, Self

import llvmlite.binding as llvm
from masmc_ros.aliases import AnyArray
from masmc_ros.errors import InputError
from masmc_ros.native.targets import KERNEL, Target, THREAD
import numpy as np

_THREADS = 64
"""Threads of a block: with 255 registers each, four blocks fit into a multiprocessor."""


class DeviceMemoryError(Exception):
    """Raised if the memory of a device does not suffice."""


class _Functions:
    """Functions of a device by the types of their records, and its lock: one batch at a time."""

    def __init__(self) -> None:
        self.lock = RLock()
        self.functions: dict[object, Callable[..., None]] = {}

    @contextmanager
    def entered(self) -> Iterator[Self]:
        """Lock the device, and select it in this thread."""
        with self.lock:
            self.enter()
            yield self

    def enter(self) -> None:
        """Select the device in this thread."""


class StandIn(_Functions):
    """Stand-in of a GPU: the processor of this machine, one run after the other; see `Cuda`."""

    name = 'stand-in'
    most_runs = 1024

    def __init__(self, memory: int = 2**30) -> None:
        """Initialise a stand-in with a number of bytes of memory."""
        super().__init__()
        self._memory, self._blocks = memory, dict[int, AnyArray]()
        self._engines: list[Any] = []

    def free_memory(self) -> int:
        """Return the number of free bytes."""
        return self._memory - sum(block.nbytes for block in self._blocks.values())

    def load(self, code: str) -> Callable[..., None]:
        """Return a function of the code."""
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        triple = llvm.get_default_triple()
        engine = llvm.create_mcjit_compiler(
            self.module_of(code, triple),
            llvm.Target.from_triple(triple).create_target_machine(opt=3, jit=True),
        )
        engine.finalize_object()
        self._engines.append(engine)  # it owns the code
        address = engine.get_function_address(THREAD)

        def launch(threads: int, *arguments: int) -> None:
            run = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * (2 + len(arguments)))(address)
            for thread in range(threads):
                run(thread, threads, *arguments)

        return launch

    def module_of(self, code: str, triple: str) -> Any:
        """Return the optimised module of the code for this processor."""
        from masmc_ros.native.object_code import optimised  # the start of commands is faster

        return optimised(code, Target(triple, llvm.get_host_cpu_name()))

    def allocate(self, size: int) -> int:
        """Return the address of memory filled with zeros."""
        if size > self.free_memory():
            raise DeviceMemoryError
        block = np.zeros(size, np.uint8)
        self._blocks[block.ctypes.data] = block
        return int(block.ctypes.data)

    def release(self, address: int) -> None:
        """Release memory."""
        del self._blocks[address]

    def upload(self, address: int, values: AnyArray) -> None:
        """Copy an array."""
        ctypes.memmove(address, values.ctypes.data, values.nbytes)

    def download(self, address: int, values: AnyArray) -> None:
        """Copy memory into an array."""
        ctypes.memmove(values.ctypes.data, address, values.nbytes)


class Cuda(_Functions):
    """
    GPU of NVIDIA, by the bindings of its driver.

    Attributes
    ----------
    name
        Name for messages.
    most_runs
        Number of runs that fill the device, and with which a batch has little start-up.
    capability
        Compute capability, such as (9, 0).
    lock
        Lock of the device.
    functions
        Loaded functions by the types of their records.

    """

    def __init__(self, number: int = 0) -> None:
        """
        Initialise a card by its number.

        Raises InputError if the package, the driver or the card is missing.
        """
        super().__init__()
        place = f'device cuda:{number}'
        try:
            from cuda.bindings import driver
        except ImportError:
            raise InputError(
                f"{place}: the package cuda-bindings is missing; pip install 'masmc_ros[gpu]'"
            ) from None
        self._driver = driver
        try:
            self._call('cuInit', 0)
            count = self._call('cuDeviceGetCount')
        except (RuntimeError, ImportError, OSError, InputError) as error:
            reason = (str(error) or type(error).__name__).splitlines()[0].rstrip('.')
            raise InputError(
                f'{place}: no driver of NVIDIA, or no card ({reason}); expected a machine on '
                'which nvidia-smi lists a GPU'
            ) from None
        if number >= count:
            raise InputError(f'{place}: expected a number below {count}, the number of cards')
        self._device = self._call('cuDeviceGet', number)
        self.name = self._call('cuDeviceGetName', 256, self._device).split(b'\0')[0].decode()
        parts = 'MAJOR', 'MINOR'
        self.capability = tuple(self.attribute(f'COMPUTE_CAPABILITY_{part}') for part in parts)
        self.most_runs = self.attribute('MULTIPROCESSOR_COUNT') * 4 * _THREADS
        self._context = self._call('cuDevicePrimaryCtxRetain', self._device)

    def attribute(self, name: str) -> int:
        """Return an attribute of the card, such as `CLOCK_RATE` in kHz."""
        attribute = getattr(self._driver.CUdevice_attribute, f'CU_DEVICE_ATTRIBUTE_{name}')
        return int(self._call('cuDeviceGetAttribute', attribute, self._device))

    def _call(self, name: str, *arguments: Any) -> Any:
        """Return the result of a function of the driver; InputError for an error."""
        status, *results = getattr(self._driver, name)(*arguments)
        if status == self._driver.CUresult.CUDA_ERROR_OUT_OF_MEMORY:
            raise DeviceMemoryError
        if status != self._driver.CUresult.CUDA_SUCCESS:
            raise InputError(f'device cuda: {name}: {status.name}')
        return results[0] if len(results) == 1 else results

    def enter(self) -> None:
        """Select the card in this thread."""
        self._call('cuCtxSetCurrent', self._context)

    def free_memory(self) -> int:
        """Return the number of free bytes."""
        return int(self._call('cuMemGetInfo')[0])

    def load(self, code: str) -> Callable[..., None]:
        """
        Return a function of code by `gpu_code.thread_code`.

        It takes the number of threads and the further arguments of a thread, each of 8 bytes, and
        returns after the last thread.
        """
        from masmc_ros.native.gpu_code import ptx  # the start of commands is faster

        text = np.frombuffer(ptx(code, self.capability).encode() + b'\0', np.uint8)
        module = self._call('cuModuleLoadData', text.ctypes.data)
        kernel = self._call('cuModuleGetFunction', module, KERNEL.encode())

        def launch(threads: int, *arguments: int) -> None:
            self._call(
                'cuLaunchKernel', kernel, -(-threads // _THREADS), 1, 1, _THREADS, 1, 1, 0, 0,
                ((threads, *arguments), (ctypes.c_int64,) * (1 + len(arguments))), 0,
            )  # fmt: skip
            self._call('cuCtxSynchronize')

        return launch

    def allocate(self, size: int) -> int:
        """Return the address of memory filled with zeros; DeviceMemoryError without enough."""
        address = self._call('cuMemAlloc', size)
        self._call('cuMemsetD8', address, 0, size)
        return int(address)

    def release(self, address: int) -> None:
        """Release memory by `allocate`, in any thread."""
        self.enter()
        self._call('cuMemFree', address)

    def upload(self, address: int, values: AnyArray) -> None:
        """Copy an array to the card."""
        self._call('cuMemcpyHtoD', address, values.ctypes.data, values.nbytes)

    def download(self, address: int, values: AnyArray) -> None:
        """Copy memory of the card into an array."""
        self._call('cuMemcpyDtoH', values.ctypes.data, address, values.nbytes)


Accelerator = Cuda | StandIn
"""Device; `Cuda` describes the interface."""


def named(name: str) -> Accelerator:
    """
    Return the device of a name: `cuda`, `cuda:NUMBER` or `stand-in`.

    Raises InputError if the name is unknown, or if the package, the driver or the card is missing.
    """
    match = re.fullmatch(r'cuda(?::([0-9]+))?|stand-in', name)
    if not match:
        raise InputError(f"device '{name}': expected cpu, cuda, cuda:NUMBER or stand-in")
    return StandIn() if name == 'stand-in' else Cuda(int(match[1] or 0))
