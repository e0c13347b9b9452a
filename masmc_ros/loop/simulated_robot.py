# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Simulated robot: state, disturbance and torque limit, advanced tick by tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from decimal import Decimal
from functools import lru_cache
from importlib import import_module
import math

from masmc_ros.aliases import Array, Records
from masmc_ros.errors import InputError, remedy
from masmc_ros.jit.compiled import bound
from masmc_ros.jit.record import AT_RUN_TIME, fill
from masmc_ros.law.command_interface import by_velocity, is_hybrid, MEASURES_VELOCITY
from masmc_ros.law.parts.moving_base import BASE_LAG
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import plant_hold, plant_start, plant_tick
from masmc_ros.loop.plant_parameters import (
    BANDWIDTH,
    CLASSES,
    DELAY_JITTER,
    ENCODER_RESOLUTION,
    INITIAL_JOINTS,
    INITIAL_POSE,
    INTEGRATOR_STEP,
    JOINT_DAMPING,
    JOINT_STIFFNESS,
    MEASUREMENT_DELAY,
    MOTOR_LAG,
    PAYLOAD_MASS,
    PAYLOAD_TIME,
    PHYSICS,
    PUSH,
    RIGID,
    ROTOR_INERTIA,
    STICTION_TORQUE,
    STICTION_VELOCITY,
    VELOCITY_NOISE,
)
from masmc_ros.loop.signals import OF_PLANT
from masmc_ros.loop.timing import check_count, MOST_TICKS
from masmc_ros.params.declaration import Values
from masmc_ros.plant_model.drives import joint_inertias, lag_shares
from masmc_ros.plant_model.joint_effects import bristle_gains, LONGEST_STEP, natural_frequency
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import Robot, robot_of, robot_with
import numpy as np
from numpy.typing import ArrayLike, NDArray

NO_STATE = (
    'initial_pose, initial_joints or initial_velocity make no state of a robot; '
    'expected finite numbers, and angles that have a sine'
)
"""Error of a robot whose initial state is not finite."""

_BANDWIDTH_STEP = 0.1
"""Largest product of the bandwidth of holding drives and the integration step.

A joint with a quarter of its own inertia, as in a stretched arm, is stable up to 0.25.
"""

_STILL = (
    'drive_integral', 'driven', 'target', 'motor', 'deflection', 'stiction', 'followed_rates'
)  # fmt: skip
"""Fields of the memory that are zero at the start."""

_COPIED = {
    'disturbance.amplitude': 'amplitude', 'disturbance.frequency': 'frequency',
    'disturbance.phase': 'phase', 'torque_limit': 'limit', 'torque_rate_limit': 'rate_limit',
    'measurement_loss': 'measurement_loss', 'command_loss': 'command_loss', 'seed': 'seed',
}  # fmt: skip
"""Fields of the settings by the parameter of the plant that is their value."""

_STARTS = {
    'initial_velocity': ('rates', 'rotor_rates'), 'initial_joints': ('rotor_angles',),
}  # fmt: skip
"""Fields of the memory by the parameter of the plant that is their value at the start."""

Write = Callable[[Records, str, ArrayLike, int | None], None]
"""Function that writes a value into a field of a record, in a lane or, without one, in all."""


class SimulatedRobot:
    """
    Plant with its state; the arrays are views of `signals`, the signals of the tick.

    Attributes
    ----------
    position, velocity
        Measured state of the tick (positions), in the order of joint_states; SI units, radians.
    true_position, true_velocity
        True state of the tick, in the same order.
    applied
        Torque (joints) in N·m over the last interval: the command within the motor limits or,
        with commanded rates, the mean torque of the drives.
    by_velocity
        True for the entries (joints) of a command that are velocities.
    pick_up
        Tick from which the robot has the payload; 0: from the start, or without one.

    """

    is_compiled = True
    """True if the kernel of whole runs can compute it."""

    def __init__(self, robot: Robot, period: float, values: Values) -> None:
        """
        Initialise the plant in its initial state.

        Parameters
        ----------
        robot
            True robot.
        period
            Control period in s.
        values
            Checked values of `plant_parameters.parameters`.

        """
        self.period = period
        self.robot, self.mechanism = robot, robot.mechanism
        self.settings = records.plant_settings(self.mechanism, has_effects=has_effects(values))
        self.pick_up, loaded = self._payload_of(values)
        without = {**values, PAYLOAD_MASS.name: 0.0}
        write_plant(self.settings, robot, period, without if self.pick_up else loaded)
        self._theta = robot.theta, _true_theta(robot, loaded)
        self.memory = records.plant_memory(self.mechanism)
        self.signals = records.signals(self.mechanism)
        self.delayed = delay_line(self.settings, self.mechanism)
        self._values = values
        self.position, self.velocity, self.true_position, self.true_velocity, self.applied = (
            self.signals[name][0, :, 0] for name in OF_PLANT if name != 'age'
        )
        self.by_velocity = by_velocity(values, self.mechanism)
        self._commands = tuple(
            (self.signals[name][0, :, 0], slice(None) if mask.all() else mask)
            for name, mask in (('rates', self.by_velocity), ('torque', ~self.by_velocity))
            if mask.any()
        )
        self._move: Callable[..., bool] | None = None
        self._hold: Callable[..., bool] | None = None
        self.tick = 0
        self.reset()

    @property
    def delay(self) -> float:
        """Return the mean age of measured states in s."""
        return stamp_age(MEASUREMENT_DELAY.of(self._values), self.period)

    @property
    def contact(self) -> NDArray[np.float64]:
        """Return the signals of `CONTACT` for each wheel; empty if wheels cannot slip."""
        return np.zeros(0)

    def reset(self) -> None:
        """Return to the initial state at t = 0; raise InputError if it is not finite."""
        self.tick = 0
        if self.pick_up:
            fill(self.settings, 'theta', self._theta[0])
        self.applied[:] = 0.0
        write_start(self.memory, self.robot, self._values)
        if not plant_start(self.settings, self.memory, self.delayed, self.signals):
            raise InputError(NO_STATE)

    def _payload_of(self, values: Values) -> tuple[int, Values]:
        """Return the tick of the pick-up, and the values of the robot with its payload."""
        if PHYSICS.of(values) != RIGID or PAYLOAD_MASS.of(values) == 0.0:
            return 0, values
        return round(PAYLOAD_TIME.of(values) / self.period), {**values, 'payload.time': 0.0}

    def check_change(self, values: Values) -> None:
        """Raise InputError if the running robot cannot use checked values of `parameters`."""
        mass, expected = PAYLOAD_MASS.of(values), PAYLOAD_MASS.of(self._values)
        if PHYSICS.of(values) != RIGID and mass != expected:
            raise InputError(
                f'payload.mass = {mass:g}: read-only with physics = {PHYSICS.of(values)}; '
                f'expected {expected:g}, or a plant that is started with this payload'
            )
        _true_theta(self.robot, self._payload_of(values)[1])

    def change(self, values: Values) -> None:
        """Use payload and push of checked values, which `check_change` accepts, from now on."""
        if PHYSICS.of(values) == RIGID:
            self.pick_up, loaded = self._payload_of(values)
            self._theta = self.robot.theta, _true_theta(self.robot, loaded)
            # At the tick of the pick-up, `advance` adds the payload.
            fill(self.settings, 'theta', self._theta[self.tick >= self.pick_up])
        for name, wave in disturbance_waves(values).items():
            fill(self.settings, name, wave)

    def compile(self) -> None:
        """Compile or load the kernels by two ticks without effect, and return to t = 0."""
        for command in (np.zeros(len(self.mechanism.joints)), None):
            self.advance(command)
        self.reset()

    def take_payload(self) -> None:
        """Add the payload to the parameters of the robot; to be called at the tick `pick_up`."""
        fill(self.settings, 'theta', self._theta[1])

    def _take(self, command: NDArray[np.float64]) -> None:
        for signal, entries in self._commands:
            signal[entries] = command[entries]

    def advance(self, command: NDArray[np.float64] | None) -> None:
        """
        Hold a command (joints) for one period; with None the drives hold the joints.

        The command consists of torques in N·m. With `command_interface` velocity it consists of
        the base velocities and the rates of the joints that do not move the base. With hybrid it
        consists of the base velocities and the torques of these joints. Raises InputError if the
        new state is not finite.
        """
        if self.pick_up and self.tick == self.pick_up:
            self.take_payload()
        moved = self.settings, self.memory, self.delayed, self.tick, self.signals
        if command is None:
            self._hold = self._hold or bound(plant_hold, *moved)
            finite = self._hold(*moved)
        else:
            self._take(command)
            self._move = self._move or bound(plant_tick, *moved)
            finite = self._move(*moved)
        self.tick += 1
        if not finite:
            raise diverged(self.tick * self.period)


def disturbance_waves(values: Values) -> dict[str, NDArray[np.float64]]:
    """
    Return amplitude, frequency and phase (joints) of the disturbance, with an active push.

    The torque is amplitude sin(frequency t + phase); that of a pushed joint is constant.
    """
    push = np.array(PUSH.of(values))
    constants: dict[str, ArrayLike] = {
        'amplitude': push, 'frequency': 0.0, 'phase': 0.5 * math.pi
    }
    return {
        name: np.where(push != 0.0, constant, values[f'disturbance.{name}'])
        for name, constant in constants.items()
    }


def plant_of(values: Values, period: float) -> SimulatedRobot:
    """
    Return the simulated robot of a plant's checked values, in its initial state.

    The control period is in s. Raises InputError if there is no such robot, and UserError if its
    physics is not installed.
    """
    module, name = CLASSES[PHYSICS.of(values)]
    try:
        kind = getattr(import_module(module), name)
    except ModuleNotFoundError as missing:
        raise remedy(missing) from missing
    robot: SimulatedRobot = kind(robot_of(values), period, values)
    return robot


def write_plant(
    settings: Records,
    robot: Robot,
    period: float,
    values: Values,
    lane: int | None = None,
    write: Write = fill,
) -> None:
    """
    Write a robot, the control period in s and checked values of `parameters` into a record.

    See `Write`.
    """
    delay, delay_span = _ticks_of_delay(values, 'measurement_delay', period)
    command_delay, command_delay_span = _ticks_of_delay(values, 'command_delay', period)
    if any(PUSH.of(values)):
        raise InputError(
            f'plant.push.torque = {list(PUSH.of(values))}: expected 0 at the start; set it while '
            'the plant runs'
        )
    lacks_velocity = not MEASURES_VELOCITY.of(values)
    stiffness = JOINT_STIFFNESS.of(values)
    imperfect = (
        *ENCODER_RESOLUTION.of(values),
        *VELOCITY_NOISE.of(values),
        *stiffness,
        delay,
        lacks_velocity,
    )
    step = INTEGRATOR_STEP.of(values)
    check_count(
        Decimal(period) / Decimal(step),
        MOST_TICKS,
        'integrator_step',
        step,
        'steps in a control period',
    )
    steps = max(1, round(period / step))
    follows = by_velocity(values, robot.mechanism)
    with_rates = bool(follows.any())
    bandwidth = np.array(BANDWIDTH.of(values))
    if not with_rates:
        # With commanded torques the robot determines the step; drives that hold use it too.
        bandwidth = np.minimum(bandwidth, _BANDWIDTH_STEP * steps / period)
    for name, value in {
        'geometry': robot.geometry,
        'theta': _true_theta(robot, values),
        **{field: values[parameter] for parameter, field in _COPIED.items()},
        'period': period,
        'steps': steps,
        'takes_rates': with_rates,
        'is_hybrid': is_hybrid(values),
        'by_velocity': follows,
        'is_exact': not any(imperfect),
        'resolution': ENCODER_RESOLUTION.of(values),
        'noise': VELOCITY_NOISE.of(values),
        'lacks_velocity': lacks_velocity,
        'delay': delay,
        'delay_span': delay_span,
        'command_delay': command_delay,
        'command_delay_span': command_delay_span,
        'bandwidth': bandwidth,
        'has_losses': _has_losses(values),
        'stiction': STICTION_TORQUE.of(values),
        'stiction_velocity': STICTION_VELOCITY.of(values),
        'is_elastic': any(stiffness),
        'joint_stiffness': stiffness,
        'joint_damping': JOINT_DAMPING.of(values),
        'rotor_inertia': ROTOR_INERTIA.of(values),
    }.items():
        write(settings, name, value, lane)
    angles, theta = np.array(INITIAL_JOINTS.of(values)), _true_theta(robot, values)
    (inertias,) = _inertias(robot.mechanism, robot.geometry[None], theta[None], angles[None])
    write(settings, 'inertia', inertias, lane)
    step = period / steps
    _check_frequencies(values, robot.mechanism, inertias, step)
    base_decay = np.zeros(len(follows))
    lag = lag_shares(BASE_LAG.of(values), period, 2.0 * step)
    base_decay[:len(robot.mechanism.twist)] = lag[0]
    write(settings, 'base_decay', base_decay, lane)
    shares = np.array([lag_shares(lag, period, step) for lag in MOTOR_LAG.of(values)])
    write(settings, 'lag_decay', shares[:, 0], lane)
    write(settings, 'lag_mean', shares[:, 1], lane)
    of_stiction = STICTION_TORQUE.of(values), STICTION_VELOCITY.of(values), inertias
    gains = np.array([bristle_gains(*joint, step) for joint in zip(*of_stiction, strict=True)])
    write(settings, 'bristle_stiffness', gains[:, 0], lane)
    write(settings, 'bristle_damping', gains[:, 1], lane)


def write_plants(
    settings: Records,
    memory: Records,
    plants: Mapping[int, Values],
    base: Values,
    period: float,
    write: Write = fill,
) -> Set[int]:
    """
    Write plants into lanes that have the values of another plant.

    Those that differ in few parameters, as mostly in campaigns, are written all at once.
    Return the lanes of the others.

    Parameters
    ----------
    settings, memory
        Records of plants.
    plants
        Checked values of `parameters` by lane.
    base
        Values of the other plant.
    period
        Control period in s.
    write
        See `Write`.

    """
    mechanism = mechanism_from(base)
    names, quick, written = _names_of_columns(mechanism, base), dict[int, Values](), set[str]()
    for lane, plant in plants.items():
        # Equal numbers may have different bits: 0 and -0.
        others = {name for name, value in plant.items() if value is not base[name]}
        if others <= names:
            quick[lane] = plant
            written |= others
        else:
            robot = robot_of(plant)
            write_plant(settings, robot, period, plant, lane, write)
            write_start(memory, robot, plant, lane, write)
    if written:
        _write_columns(settings, memory, mechanism, quick, written)
    return plants.keys() - quick.keys()


def _names_of_columns(mechanism: Mechanism, values: Values) -> frozenset[str]:
    """Return the parameters in which plants of `_write_columns` differ from one with values."""
    # Gains of bristles and rotors depend on the inertia.
    has_gains = any((*JOINT_STIFFNESS.of(values), *STICTION_TORQUE.of(values)))
    if AT_RUN_TIME in mechanism.sizes or has_gains:
        return frozenset()
    names = (parameter.name for parameter in mechanism.parameters)
    return frozenset({*names, *_COPIED, *_STARTS, PAYLOAD_MASS.name, 'initial_pose'})


def _write_columns(
    settings: Records,
    memory: Records,
    mechanism: Mechanism,
    plants: Mapping[int, Values],
    names: Set[str],
) -> None:
    """Write plants by lane, whose parameters of these names differ from those of the lanes."""
    lanes = list(plants)
    robots = [robot_with(mechanism, values) for values in plants.values()]
    geometry = np.array([robot.geometry for robot in robots])
    theta = np.array([_true_theta(*pair) for pair in zip(robots, plants.values(), strict=True)])
    poses = [(INITIAL_POSE.of(values), INITIAL_JOINTS.of(values)) for values in plants.values()]
    angles = np.array([joints for _, joints in poses])
    columns: dict[str, ArrayLike] = {'geometry': geometry, 'theta': theta}
    columns['inertia'] = _inertias(mechanism, geometry, theta, angles)
    starts = [robot.start(*pose) for robot, pose in zip(robots, poses, strict=True)]
    memories: dict[str, ArrayLike] = {'position': starts}
    for name in names & {*_COPIED, *_STARTS}:
        column = np.array([values[name] for values in plants.values()])
        if name in _COPIED:
            columns[_COPIED[name]] = column
        memories |= dict.fromkeys(_STARTS.get(name, ()), column)
    for record, fields in ((settings, columns), (memory, memories)):
        for field, values in fields.items():
            record[field][0][..., lanes] = np.asarray(values).T


def _inertias(mechanism: Mechanism, geometry: Array, theta: Array, angles: Array) -> Array:
    """Return the inertias (n, joints) of robots; see `joint_inertias`."""
    inertias: Array = joint_inertias(_plant_of_one(mechanism).copy(), geometry, theta, angles)
    return inertias


# The type has one lane, so the code does not depend on the number of lanes.
_plant_of_one = lru_cache(maxsize=16)(records.plant_settings)


def has_effects(values: Values) -> bool:
    """Return True if motors lag, or joints stick or are elastic."""
    return _has_losses(values) or any(JOINT_STIFFNESS.of(values))


def _has_losses(values: Values) -> bool:
    return any((*MOTOR_LAG.of(values), *STICTION_TORQUE.of(values)))


def _true_theta(robot: Robot, values: Values) -> NDArray[np.float64]:
    """Return the true parameters of the robot; the contact model has another payload."""
    mass = PAYLOAD_MASS.of(values)
    if PHYSICS.of(values) != RIGID or mass == 0.0:
        return robot.theta
    if PAYLOAD_TIME.of(values) > 0.0:
        raise InputError(
            f'plant.payload.time = {PAYLOAD_TIME.of(values):g}: expected 0 for runs in one batch; '
            'nodes and masmc simulate have later times'
        )
    return robot.theta_with_payload(mass, np.zeros(3), np.zeros(6))


def _check_frequencies(
    values: Values, mechanism: Mechanism, inertias: NDArray[np.float64], step: float
) -> None:
    """Raise InputError if an elastic joint is too fast for the integration step in s."""
    parts = zip(JOINT_STIFFNESS.of(values), ROTOR_INERTIA.of(values), inertias, strict=True)
    for joint, part in zip(mechanism.joints, parts, strict=True):
        frequency = natural_frequency(*part)
        if frequency * step > LONGEST_STEP:
            raise InputError(
                f'plant.integrator_step: elastic joint {joint.short} has a natural frequency of '
                f'{frequency:.4g} rad/s; expected at most {LONGEST_STEP / frequency:.2g} s, or a '
                'smaller joint_stiffness'
            )


def stamp_age(delay: float, period: float) -> float:
    """Return the mean time in s from a measurement to its stamp, for a `measurement_delay`."""
    return round(delay / period) * period


def _ticks_of_delay(values: Values, name: str, period: float) -> tuple[int, int]:
    """Return the largest delay of a parameter in ticks, and by how many it can be shorter."""
    delay, jitter = values[name] / period, DELAY_JITTER.of(values)
    largest = round(delay * (1.0 + jitter))
    return largest, largest - round(delay * (1.0 - jitter))


def write_start(
    memory: Records,
    robot: Robot,
    values: Values,
    lane: int | None = None,
    write: Write = fill,
) -> None:
    """Write the initial state for checked values of `parameters` into a record; see `Write`."""
    for name, value in {
        'position': robot.start(INITIAL_POSE.of(values), INITIAL_JOINTS.of(values)),
        **{field: values[name] for name, fields in _STARTS.items() for field in fields},
        **dict.fromkeys(_STILL, 0.0),
        'acting': 0,
    }.items():
        write(memory, name, value, lane)


def delay_line(settings: Records, mechanism: Mechanism) -> NDArray[np.float64]:
    """Return a buffer for delayed values, see `delay_line_shape`."""
    return np.zeros(delay_line_shape(settings, mechanism))


def delay_line_shape(settings: Records, mechanism: Mechanism) -> tuple[int, int, int]:
    """Return the shape of the delay line: (delay + 2, measurements and commands, lanes)."""
    longest = max(int(settings[name].max()) for name in ('delay', 'command_delay'))
    width = 2 * mechanism.sizes['positions'] + 2 * mechanism.sizes['joints']
    return longest + 2, width, settings['delay'].shape[-1]


def diverged(time: float) -> InputError:
    """Return the error of a closed loop with a number that is not finite, at a time in s."""
    return InputError(
        f'the closed loop diverged at t = {time:g} s; expected gains and a control_period '
        'with which it is stable'
    )
