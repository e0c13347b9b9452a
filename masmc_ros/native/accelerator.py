# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Devices that compute many runs at once: a GPU, and a stand-in that is this processor.

Both run the code of `native.gpu_code`, so batches, transfers and errors are the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
import ctypes
import re
from threading import Lock
from typing import Any

import llvmlite.binding as llvm
from masmc_ros.aliases import AnyArray
from masmc_ros.errors import InputError
from masmc_ros.native.gpu_code import KERNEL, ptx, THREAD
from masmc_ros.native.object_code import optimised
from masmc_ros.native.targets import Target
import numpy as np

ARGUMENTS = 12
"""Number of arguments of the kernel, each of 8 bytes."""

_THREADS = 64
"""Threads of a block: with 255 registers each, four blocks fit into a multiprocessor."""


class DeviceMemoryError(Exception):
    """Raised if the memory of a device does not suffice for a batch."""


class Accelerator(ABC):
    """
    Memory and processor of a device.

    Attributes
    ----------
    name
        Name for messages.
    most_runs
        Number of runs that fill the device, and with which a batch has little start-up.
    lock
        Lock of the device: one batch at a time.
    functions
        Loaded functions by the types of their records.

    """

    name: str
    most_runs: int

    def __init__(self) -> None:
        """Initialise a device without functions."""
        self.lock = Lock()
        self.functions: dict[object, Callable[..., None]] = {}

    @abstractmethod
    def enter(self) -> None:
        """Select the device in this thread."""

    @abstractmethod
    def free_memory(self) -> int:
        """Return the number of free bytes."""

    @abstractmethod
    def load(self, code: str) -> Callable[..., None]:
        """
        Return a function of code by `gpu_code.thread_code`.

        It takes the number of runs and the arguments of the kernel, and returns after the last
        run.
        """

    @abstractmethod
    def allocate(self, size: int) -> int:
        """Return the address of memory filled with zeros; DeviceMemoryError without enough."""

    @abstractmethod
    def release(self, address: int) -> None:
        """Release memory by `allocate`."""

    @abstractmethod
    def upload(self, address: int, values: AnyArray) -> None:
        """Copy an array to the device."""

    @abstractmethod
    def download(self, address: int, values: AnyArray) -> None:
        """Copy memory of the device into an array."""


class StandIn(Accelerator):
    """Stand-in of a GPU: the processor of this machine, one run after the other."""

    name = 'stand-in'
    most_runs = 1024

    def __init__(self, memory: int = 2**30) -> None:
        """Initialise a stand-in with a number of bytes of memory."""
        super().__init__()
        self._memory, self._blocks = memory, dict[int, AnyArray]()
        self._engines: list[Any] = []

    def enter(self) -> None:
        """Do nothing."""

    def free_memory(self) -> int:
        """Return the number of free bytes."""
        return self._memory - sum(block.nbytes for block in self._blocks.values())

    def load(self, code: str) -> Callable[..., None]:
        """Return a function of the code, see `Accelerator`."""
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        triple = llvm.get_default_triple()
        engine = llvm.create_mcjit_compiler(
            self.module_of(code, triple),
            llvm.Target.from_triple(triple).create_target_machine(opt=3, jit=True),
        )
        engine.finalize_object()
        self._engines.append(engine)  # it owns the code
        words = [ctypes.c_int64] * (1 + ARGUMENTS)
        run = ctypes.CFUNCTYPE(None, *words)(engine.get_function_address(THREAD))

        def launch(lanes: int, *arguments: int) -> None:
            for lane in range(lanes):
                run(lane, *arguments)

        return launch

    def module_of(self, code: str, triple: str) -> Any:
        """Return the optimised module of the code for this processor."""
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


class Cuda(Accelerator):
    """GPU of NVIDIA, by the bindings of its driver."""

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
            self._call(driver.cuInit, 0)
            count = self._call(driver.cuDeviceGetCount)
        except (RuntimeError, ImportError, OSError, InputError) as error:
            raise InputError(
                f'{place}: no driver of NVIDIA, or no card ({_first_line(error)}); expected a '
                'machine on which nvidia-smi lists a GPU'
            ) from None
        if number >= count:
            raise InputError(f'{place}: expected a number below {count}, the number of cards')
        device = self._call(driver.cuDeviceGet, number)
        self.name = self._call(driver.cuDeviceGetName, 256, device).split(b'\0')[0].decode()
        attributes = driver.CUdevice_attribute
        major, minor, processors = (
            self._call(driver.cuDeviceGetAttribute, attribute, device)
            for attribute in (
                attributes.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR,
                attributes.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR,
                attributes.CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT,
            )
        )
        self._capability, self.most_runs = (major, minor), processors * 4 * _THREADS
        self._device, self._processors = device, processors
        self._context = self._call(driver.cuDevicePrimaryCtxRetain, device)

    def operations_per_second(self, rates: Mapping[tuple[int, int], int]) -> float:
        """Return the double-precision rate, from that of a multiprocessor and cycle; others 2."""
        attribute = self._driver.CUdevice_attribute.CU_DEVICE_ATTRIBUTE_CLOCK_RATE
        clock = self._call(self._driver.cuDeviceGetAttribute, attribute, self._device)
        return 1e3 * float(clock * self._processors * rates.get(self._capability, 2))

    def _call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return the results of a function of the driver; InputError for an error."""
        status, *results = function(*arguments)
        if status == self._driver.CUresult.CUDA_ERROR_OUT_OF_MEMORY:
            raise DeviceMemoryError
        if status != self._driver.CUresult.CUDA_SUCCESS:
            raise InputError(f'device cuda: {function.__name__}: {status.name}')
        return results[0] if len(results) == 1 else results

    def enter(self) -> None:
        """Select the card in this thread."""
        self._call(self._driver.cuCtxSetCurrent, self._context)

    def free_memory(self) -> int:
        """Return the number of free bytes."""
        return int(self._call(self._driver.cuMemGetInfo)[0])

    def load(self, code: str) -> Callable[..., None]:
        """Return a function of the code, see `Accelerator`."""
        driver = self._driver
        text = np.frombuffer(ptx(code, self._capability).encode() + b'\0', np.uint8)
        module = self._call(driver.cuModuleLoadData, text.ctypes.data)
        kernel = self._call(driver.cuModuleGetFunction, module, KERNEL.encode())
        kinds = (ctypes.c_int64,) * ARGUMENTS

        def launch(lanes: int, *arguments: int) -> None:
            self._call(
                driver.cuLaunchKernel, kernel, -(-lanes // _THREADS), 1, 1, _THREADS, 1, 1, 0, 0,
                (arguments, kinds), 0,
            )  # fmt: skip
            self._call(driver.cuCtxSynchronize)

        return launch

    def allocate(self, size: int) -> int:
        """Return the address of memory filled with zeros."""
        address = self._call(self._driver.cuMemAlloc, size)
        self._call(self._driver.cuMemsetD8, address, 0, size)
        return int(address)

    def release(self, address: int) -> None:
        """Release memory."""
        self._call(self._driver.cuMemFree, address)

    def upload(self, address: int, values: AnyArray) -> None:
        """Copy an array to the card."""
        self._call(self._driver.cuMemcpyHtoD, address, values.ctypes.data, values.nbytes)

    def download(self, address: int, values: AnyArray) -> None:
        """Copy memory of the card into an array."""
        self._call(self._driver.cuMemcpyDtoH, values.ctypes.data, address, values.nbytes)


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0].rstrip('.')


def named(name: str) -> Accelerator:
    """
    Return the device of a name: `cuda`, `cuda:NUMBER` or `stand-in`.

    Raises InputError if the name is unknown, or if the package, the driver or the card is missing.
    """
    match = re.fullmatch(r'cuda(?::([0-9]+))?|stand-in', name)
    if not match:
        raise InputError(f"device '{name}': expected cpu, cuda, cuda:NUMBER or stand-in")
    return StandIn() if name == 'stand-in' else Cuda(int(match[1] or 0))
