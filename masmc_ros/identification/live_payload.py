# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Payload of a running robot, estimated from its states and commanded torques.

The equations of motion are averaged over windows (`regressor`) and need no accelerations.
The measured torques differ from those of the nominal robot. This difference is linear in

- the mass, first and second moments of a load that is fixed to the last link (Atkeson, An and
  Hollerbach 1986),
- the difference of each joint's friction from its nominal friction, and
- a small error of the latency.

A block of 1 s (100 periods if that is longer) contributes sums of products only, and the estimate
uses the latest blocks.
The cost is therefore constant, and the estimate follows a change of the load.

Shapes: n joints with commanded torques, W windows, c columns, K blocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array, Flags
from masmc_ros.identification import regressor
from masmc_ros.identification.latency_fit import Estimate, StateBuffer
from masmc_ros.identification.payload import EXPECTED_MOMENTS, Load, load_of
from masmc_ros.robot.robot import Robot
import numpy as np

BLOCK = 1.0
"""Shortest length of a block in s."""

_BLOCK_PERIODS = 100
"""Shortest length of a block in control periods."""

_SPACING = 0.01
"""Shortest interval in s between two states that are used; all torques are used."""

_HALF_PERIODS = 10
"""Number of intervals between used states in half of a window."""

_LATENCY_ERROR = 0.005
"""Expected error of the latency in s."""

_FINEST = 1.0e-3
"""Smallest standard deviation of a torque, relative to its RMS value."""

_ROUNDS = 3
"""Number of iterations of the weights of the joints."""

_FEWEST_BLOCKS = 3
"""Smallest number of blocks of an estimate."""

_CONTRADICTION = 0.5
"""Ratio of errors, with the latest blocks and with all, below which the load has changed."""

_EXPLAINED = 0.9
"""Smallest share of the unexplained squared torques that a reported payload explains."""

_LIGHTEST = 0.01
"""Smallest mass in kg that is reported."""

_DETERMINED = 0.05
"""Largest standard error in m of a determined coordinate of the centre of mass."""

_LOAD, _DELAY, _FRICTION, _MISSING, _TORQUE = 10, 10, slice(11, 13), 13, 14
"""Columns: moments of the load, latency, viscous and Coulomb friction, torques."""


class Block(NamedTuple):
    """
    States and commanded torques without a gap.

    Attributes
    ----------
    times
        (N) Stamps of the states in s, ascending from zero.
    position
        (N, positions) Positions in m and rad.
    rates
        (N, joints) Measured joint rates in rad/s or m/s.
    torque
        (N, joints) Torques in N·m or N, each computed from the state of the same row.

    """

    times: Array
    position: Array
    rates: Array
    torque: Array


class PayloadEstimate(NamedTuple):
    """
    Payload of the robot in the frame of its tip.

    Attributes
    ----------
    load
        Mass in kg and centre of mass in m, with standard errors.
    explained
        Share of the weighted squared torques that the payload explains, of those that the
        nominal robot and its friction do not explain.
    later
        Additional latency in s, positive if the torques act later than assumed, with standard
        error.

    """

    load: Load
    explained: float
    later: Estimate

    @property
    def is_significant(self) -> bool:
        """Return True if the mass exceeds three standard errors, and explains the torques."""
        return self.explained > _EXPLAINED and self.load.mass > self.load.margin(_LIGHTEST)

    @property
    def centre(self) -> Array:
        """Return the centre of mass (3) in m, NaN for coordinates that are not determined."""
        return np.where(self.load.centre_error < _DETERMINED, self.load.centre, np.nan)


class BlockBuffer:
    """Buffer of the states and torques of a block."""

    def __init__(self, positions: int, joints: int, period: float) -> None:
        """Initialise an empty buffer for a control period in s."""
        count = max(round(BLOCK / period), _BLOCK_PERIODS) + 1
        self._buffer = StateBuffer(count, (positions, joints, joints), period)

    def add(self, stamp: int, position: Array, rates: Array, torque: Array) -> Block | None:
        """
        Add a state and its command; return a block when it is complete.

        Parameters
        ----------
        stamp
            Stamp of the state in ns.
        position, rates, torque
            Positions (positions), rates (joints) and commanded torques (joints).

        """
        part = self._buffer.add(stamp, position, rates, torque)
        return None if part is None else Block(*part)


class PayloadEstimator:
    """Estimator of a payload from the blocks of a limited time."""

    def __init__(
        self,
        robot: Robot,
        theta: Array,
        friction: Array,
        has_torque: Flags,
        span: float,
    ) -> None:
        """
        Initialise the estimator without a block, and compile its kernel.

        Parameters
        ----------
        robot
            Robot without friction.
        theta
            (q) Inertial parameters of the nominal robot without payload.
        friction
            (2 joints) Nominal viscous and Coulomb friction.
        has_torque
            (joints) True for joints with a commanded torque.
        span
            Time in s whose blocks are used, at least three blocks.

        Raises
        ------
        InputError
            if the type of robot has no description of payloads.

        """
        self._robot, self._nominal = robot, np.concatenate([theta, friction])
        self._has_torque = has_torque
        self._factors = robot.payload_factors * EXPECTED_MOMENTS
        self._tip = robot.tip_on_link
        self._blocks: deque[_Products] = deque()
        self._span = span
        sizes = robot.mechanism.sizes
        times, joints = np.linspace(0.0, BLOCK, 101), np.zeros((101, sizes['joints']))
        self.add(Block(times, np.zeros((101, sizes['positions'])), joints, joints), 0.0)
        self.restart()

    def restart(self) -> None:
        """Discard all blocks."""
        self._blocks.clear()

    def add(self, block: Block, latency: float, *, uses_rates: bool = True) -> None:
        """
        Add a block.

        Parameters
        ----------
        block
            States and torques.
        latency
            Age of a state in s when its torque acts, with the lag of the motors.
        uses_rates
            False if the rates are not measured; differences of the positions replace them.

        """
        period = (block.times[-1] - block.times[0]) / (len(block.times) - 1)
        step = max(1, round(_SPACING / period))
        spacing = step * period
        states = slice(None, None, step)
        times, position, rates = (part[states] for part in block[:3])
        smoothing = None
        if not uses_rates:
            angles = position[:, -rates.shape[1]:]
            rates = (angles[2:] - angles[:-2]) / (times[2:] - times[:-2])[:, None]
            times, position = times[1:-1], position[1:-1]
            # These differences are averages of the rates, so torques are averaged in the same way.
            smoothing = regressor.Average(np.full(2, 0.5 / spacing), spacing)
        valid = np.ones(len(times) - 1, np.bool_)
        margin = latency + _LATENCY_ERROR + spacing
        windows = regressor.windows_in(times, _HALF_PERIODS * spacing, valid, margin)
        if not len(windows.centres):
            return
        weights = regressor.sample_weights(times, windows)
        equations = regressor.averaged(self._robot, position, rates, weights)
        torques = np.hstack([
            regressor.average_of_held(block.times, block.torque, windows, delay, 0.0, smoothing)
            for delay in (latency, latency + _LATENCY_ERROR)
        ])
        acting, later = np.split(torques, 2, axis=1)
        matrix, inertial = equations.matrix, len(self._factors)
        of_load = matrix[:, :, :inertial] @ self._factors
        joints = np.arange(acting.shape[1])
        friction = [matrix[:, joints, inertial + k * len(joints) + joints] for k in range(2)]
        missing = acting - equations.known - matrix @ self._nominal
        single = np.stack([acting - later, *friction, missing, acting], axis=2)
        rows = np.concatenate([of_load, single], axis=2)[:, self._has_torque]
        self._blocks.append(_Products(np.einsum('wja,wjb->jab', rows, rows), len(rows)))
        count = max(_FEWEST_BLOCKS, round(self._span / block.times[-1]))
        while len(self._blocks) > count:
            self._blocks.popleft()

    def estimate(self) -> PayloadEstimate | None:
        """Return the payload, and discard blocks of another load; None with too few blocks."""
        blocks = list(self._blocks)
        if len(blocks) < _FEWEST_BLOCKS:
            return None
        estimate = self._estimate_of(blocks)
        if len(blocks) > _FEWEST_BLOCKS:
            recent = self._estimate_of(blocks[-_FEWEST_BLOCKS:])
            # With the same load, the error of all blocks would be smaller than that of a few.
            if recent.load.mass_error < _CONTRADICTION * estimate.load.mass_error:
                del blocks[:-_FEWEST_BLOCKS]
                self._blocks.clear()
                self._blocks.extend(blocks)
                return recent
        return estimate

    def _estimate_of(self, blocks: Sequence[_Products]) -> PayloadEstimate:
        products = np.array([block.products for block in blocks])
        return _estimate(products, sum(block.windows for block in blocks), self._tip)


def described(
    estimate: PayloadEstimate | None, announced: float, *, tip: str, node: str
) -> str:
    """
    Return the payload as text.

    Parameters
    ----------
    estimate
        Payload; None if it is not known yet.
    announced
        Mass in kg that is announced to the controller.
    tip, node
        Names of the frame of the tip and of the controller.

    """
    if estimate is None:
        return (
            f'not known yet; expected {_FEWEST_BLOCKS * BLOCK:g} s of control, '
            f'{_FEWEST_BLOCKS * _BLOCK_PERIODS} periods if that is longer'
        )
    load, centre = estimate.load, estimate.centre
    mass = f'{round(load.mass, 3) + 0.0:.3f} ± {load.mass_error:.3f} kg'
    margin = load.margin(_LIGHTEST)
    differs = abs(load.mass - announced) > margin
    if not estimate.is_significant:
        if load.mass > margin:
            share = 100.0 * estimate.explained
            return (
                f'not determined: {mass} would explain {share:.0f} % of the torques that the '
                f'model does not, expected at least {100.0 * _EXPLAINED:.0f} %'
            )
        remedy = f'; announce it with: ros2 param set {node} payload.mass 0.0'
        return f'none: {mass}' + remedy * (announced > 0.0 and differs)
    places, errors = _numbers(centre, centre), _numbers(load.centre_error, centre)
    text = f'{mass} at ({places}) ± ({errors}) m of {tip}'
    if np.isnan(centre).any():
        text += '; the motion does not determine the coordinates ?'
    if not differs:
        return f'{text}; announced'
    return (
        f'{text}; announced {announced:g} kg; announce it with: ros2 param set {node} '
        f'payload.com "[{_numbers(np.nan_to_num(centre))}]"; ros2 param set {node} '
        f'payload.mass {load.mass:.3f}'
    )


def _numbers(numbers: Array, known: Array | None = None) -> str:
    """Return numbers (3) in m, with ? for those that are not known."""
    missing = np.isnan(numbers if known is None else known)
    texts = [f'{number:.3f}' for number in np.round(numbers, 3) + 0.0]
    return ', '.join('?' if no else text for no, text in zip(missing, texts, strict=True))


class _Products(NamedTuple):
    """Sums of products (n, c, c) of the columns of the joints over the windows of a block."""

    products: Array
    windows: int


def _estimate(blocks: Array, count: int, tip: tuple[Array, Array]) -> PayloadEstimate:
    """Return the payload from products (K, n, c, c) over a number of windows."""
    total = blocks.sum(axis=0)
    size = np.sqrt(total[:, _TORQUE, _TORQUE] / count)
    floor = _FINEST * size + 1e-3 * _FINEST * size.max() + 1e-12
    speed = np.sqrt(total[:, _FRICTION.start, _FRICTION.start] / count) + 1e-3
    scale = np.stack([size / speed, regressor.COULOMB_SHARE * size], axis=1) + 1e-12
    deviation = 0.05 * size + floor
    shared = _DELAY + 1
    for _ in range(_ROUNDS):
        weighted = total / deviation[:, None, None] ** 2
        # Friction belongs to one joint each, and is eliminated first.
        own = weighted[:, _FRICTION, _FRICTION] + np.eye(2) * scale[:, None] ** -2.0
        reduced = np.linalg.solve(own, weighted[:, _FRICTION])
        normal = weighted - weighted[:, :, _FRICTION] @ reduced
        summed = normal.sum(axis=0)
        matrix = summed[:shared, :shared] + np.eye(shared)
        right = summed[:shared, _MISSING]
        solution = np.linalg.solve(matrix, right)
        # The residual is the sum of the columns with these factors.
        factors = np.zeros((len(size), total.shape[1]))
        factors[:, :shared], factors[:, _MISSING] = -solution, 1.0
        factors[:, _FRICTION] = -np.einsum('jfa,ja->jf', reduced, factors)
        squares = np.einsum('ja,jab,jb->j', factors, total, factors)
        deviation_before, deviation = deviation, np.sqrt(np.maximum(squares, 0.0) / count) + floor
    remaining = summed[_MISSING, _MISSING] - right @ solution
    alone = right[_DELAY] ** 2 / matrix[_DELAY, _DELAY]
    before = summed[_MISSING, _MISSING] - alone
    # Errors of the model are the same in neighbouring windows, and differ between blocks.
    slopes = np.einsum('kjab,jb->kja', blocks / deviation_before[:, None, None] ** 2, factors)
    own_slopes = np.einsum('jfa,kjf->ka', reduced[:, :, :shared], slopes[:, :, _FRICTION])
    scores = slopes[:, :, :shared].sum(axis=1) - own_slopes
    inverse = np.linalg.inv(matrix)
    spread = scores @ inverse * np.sqrt(len(blocks) / (len(blocks) - 1.0))
    covariance = inverse + spread.T @ spread
    expected = EXPECTED_MOMENTS
    load = load_of(
        solution[:_LOAD] * expected,
        covariance[:_LOAD, :_LOAD] * np.outer(expected, expected),
        *tip,
    )
    later = _LATENCY_ERROR * solution[_DELAY], _LATENCY_ERROR * covariance[_DELAY, _DELAY] ** 0.5
    return PayloadEstimate(load, 1.0 - float(remaining / before), Estimate(*map(float, later)))
