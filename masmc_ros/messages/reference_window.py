# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Windows of the reference, which are sent ahead of time as std_msgs/Float64MultiArray."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from masmc_ros.aliases import Array, Stamps
from masmc_ros.errors import InputError
from masmc_ros.messages import deserialised
from masmc_ros.messages.cdr_layout import Layout, NANOSECONDS
from masmc_ros.messages.message import multi_array_layout
from masmc_ros.messages.topics import DERIVATIVES, TASK_AXES
import numpy as np

STAMP_NUMBERS = 3
"""Number of entries before the samples: seconds, nanoseconds, sample period."""

LABELS = ('samples', 'derivative', 'task')
_SECONDS = 2.0**31
_LONGEST_PERIOD = 1e4
"""Longest time in s between two samples."""


@lru_cache(maxsize=64)
def reference_layout(samples: int, axes: int = TASK_AXES) -> Layout:
    """Return the layout of a window with these numbers of samples and task axes."""
    sizes = (samples, DERIVATIVES, axes)
    return multi_array_layout(list(zip(LABELS, sizes, strict=True)), STAMP_NUMBERS)


@dataclass(frozen=True)
class ReferenceWindow:
    """
    Samples of the reference at equal intervals, or a single set-point.

    Attributes
    ----------
    stamp_ns
        Time of the first sample in ns; None for a set-point, which is valid from its arrival on.
    period
        Time between two samples in s; 0 for a set-point.
    samples
        Position (m), velocity (m/s) and acceleration (m/s^2) of the task axes,
        (n, derivatives, axes).

    """

    stamp_ns: int | None
    period: float
    samples: Array

    def stamps(self) -> Stamps:
        """Return the time (n) of each sample in ns; 0 for a set-point."""
        steps = np.rint(np.arange(len(self.samples)) * (NANOSECONDS * self.period))
        return np.asarray((self.stamp_ns or 0) + steps.astype(np.int64))

    def to_bytes(self) -> bytes:
        """Return the serialised message; that of a set-point has neither stamp nor labels."""
        if self.stamp_ns is None:
            layout, head = multi_array_layout([('', self.samples.size)], 0), []
        else:
            count, _, axes = self.samples.reshape(len(self.samples), DERIVATIVES, -1).shape
            layout = reference_layout(count, axes)
            head = [*divmod(self.stamp_ns, NANOSECONDS), self.period]
        return layout.messages(data=np.append(head, self.samples)[None]).tobytes()

    @staticmethod
    def from_bytes(raw: bytes, axes: int = TASK_AXES) -> ReferenceWindow | None:
        """
        Read a received window in the package's own layout.

        Parameters
        ----------
        raw
            Message with its encapsulation header.
        axes
            Number of task axes.

        Returns
        -------
            None for every other message, which rclpy has to deserialise for `from_message`.

        Raises
        ------
        InputError
            As `from_message`.

        """
        start = reference_layout(1, axes).places['data'].start
        samples, remainder = divmod((len(raw) - start) // 8 - STAMP_NUMBERS, DERIVATIVES * axes)
        if samples < 1 or remainder:
            return None
        layout = reference_layout(samples, axes)
        if not (len(raw) == layout.size and layout.read([raw])[0][0]):
            return None
        return _window(np.frombuffer(raw, np.float64, offset=start).copy(), axes)

    @staticmethod
    def from_message(
        message: deserialised.Float64MultiArray, axes: int = TASK_AXES
    ) -> ReferenceWindow:
        """
        Read a deserialised window or set-point of any sender.

        Parameters
        ----------
        message
            std_msgs/Float64MultiArray of any deserialiser.
        axes
            Number of task axes.

        Raises
        ------
        InputError
            if dimensions are not samples x derivative x task, or do not match the number of
            values; if a set-point has incomplete positions, velocities or accelerations; if stamp
            or period are invalid; or if numbers are not finite.

        """
        numbers = np.array(message.data, dtype=np.float64)
        dimensions = [(dimension.label, int(dimension.size)) for dimension in message.layout.dim]
        if message.layout.data_offset == 0 and len(dimensions) < len(LABELS):
            return _set_point(numbers, axes)
        samples = dimensions[0][1] if dimensions else 0
        expected = list(zip(LABELS, (samples, DERIVATIVES, axes), strict=True))
        if (
            dimensions != expected
            or message.layout.data_offset != STAMP_NUMBERS
            or samples < 1
            or len(numbers) != STAMP_NUMBERS + samples * DERIVATIVES * axes
        ):
            shape = ' x '.join(f'{label} {size}' for label, size in dimensions)
            raise InputError(
                f'reference: {len(numbers)} numbers, data_offset {message.layout.data_offset},'
                f' as {shape or "no dimensions"}; expected samples n'
                f' x derivative {DERIVATIVES} x task {axes} after {STAMP_NUMBERS} numbers'
                f' (seconds, nanoseconds, period), or {axes}, {2 * axes} or {3 * axes} numbers'
                ' without dimensions'
            )
        return _window(numbers, axes)


def _window(numbers: Array, axes: int) -> ReferenceWindow:
    """Return the window of [seconds, nanoseconds, period, samples...]."""
    _check_finite(numbers)
    seconds, nanoseconds, period = numbers[:STAMP_NUMBERS].tolist()
    is_whole = seconds.is_integer() and nanoseconds.is_integer()
    if not (is_whole and abs(seconds) < _SECONDS and 0 <= nanoseconds < NANOSECONDS):
        raise InputError(
            f'reference: stamp [{seconds:g}, {nanoseconds:g}] is not whole seconds within 32'
            ' bits and nanoseconds below 1e9'
        )
    samples = numbers[STAMP_NUMBERS:].reshape(-1, DERIVATIVES, axes)
    if not 1.0 <= period * NANOSECONDS <= NANOSECONDS * _LONGEST_PERIOD:
        raise InputError(
            f'reference: sample period {period:g} s; expected 1e-9 to {_LONGEST_PERIOD:g} s'
        )
    if (len(samples) - 1) * period >= _SECONDS:
        raise InputError(
            f'reference: {len(samples)} samples {period:g} s apart end beyond 2**31 s'
        )
    return ReferenceWindow(int(seconds) * NANOSECONDS + int(nanoseconds), period, samples)


def _set_point(numbers: Array, axes: int) -> ReferenceWindow:
    """Return the set-point of positions, with or without velocities and accelerations."""
    if len(numbers) not in (axes, 2 * axes, 3 * axes):
        raise InputError(
            f'reference: a set-point of {len(numbers)} numbers; expected {axes} positions, or'
            f' {2 * axes} with velocities, or {3 * axes} with accelerations'
        )
    _check_finite(numbers)
    samples = np.zeros((1, DERIVATIVES, axes))
    samples.reshape(-1)[: len(numbers)] = numbers
    return ReferenceWindow(None, 0.0, samples)


def _check_finite(numbers: Array) -> None:
    if not np.isfinite(numbers).all():
        raise InputError(f'reference: number {int(np.argmin(np.isfinite(numbers)))} is not finite')
