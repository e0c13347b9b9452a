# SPDX-License-Identifier: Apache-2.0
"""The simulated robot: state, disturbance and torque limit, advanced tick by tick."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from masmc_ros.control.command_interface import (
    COMMAND_INTERFACE,
    COMMAND_INTERFACES,
    ENABLE_STAMPED_CMD_VEL,
    VELOCITY,
)
from masmc_ros.control.limits import TORQUE_LIMIT, TORQUE_RATE_LIMIT
from masmc_ros.errors import InputError
from masmc_ros.loop.plant_records import PLANT_MEMORY, PLANT_SETTINGS
from masmc_ros.loop.plant_tick import plant_hold, plant_start, plant_tick
from masmc_ros.loop.timing import check_count, MOST_TICKS
from masmc_ros.loop.velocity_loop import joint_inertias
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import AXES
from masmc_ros.robot.parameters import Robot

PLANT = (
    Parameter(
        'initial_pose',
        (0.0, 0.0, math.pi / 2),
        'x_C, y_C, yaw at t = 0',
        unit='m, m, rad',
        length=3,
    ),
    Parameter(
        'initial_joints',
        (0.0, 0.0, math.pi / 4, -math.pi / 2),
        'Angles of wheel_right, wheel_left, arm_1, arm_2 at t = 0',
        unit='rad',
        length=4,
    ),
    Parameter(
        'initial_velocity',
        (0.0, 0.0, 0.0, 0.0),
        'Rates of wheel_right, wheel_left, arm_1, arm_2 at t = 0',
        unit='rad/s',
        length=4,
    ),
    Parameter(
        'disturbance.amplitude',
        (1.5, 1.5, 3.0, 3.0),
        'Amplitude of the disturbance torque, amplitude sin(frequency t + phase)',
        unit='N·m',
        length=4,
    ),
    Parameter(
        'disturbance.frequency',
        (3.0, 3.0, 1.5, 1.5),
        'Frequency of the disturbance torque',
        unit='rad/s',
        length=4,
    ),
    Parameter(
        'disturbance.phase',
        (0.0, math.pi / 2, 0.0, math.pi / 2),
        'Phase of the disturbance torque at t = 0',
        unit='rad',
        length=4,
    ),
    Parameter(
        'integrator_step',
        0.0005,
        'Step of the Runge-Kutta integration, rounded to a whole number per control period',
        unit='s',
        minimum=0.0,
        exclusive_minimum=True,
    ),
    Parameter(
        'torque_limit',
        TORQUE_LIMIT,
        "Limit of each motor's torque, unknown to the controller; 0 is none",
        unit='N·m',
        length=4,
        minimum=0.0,
    ),
    Parameter(
        'torque_rate_limit',
        TORQUE_RATE_LIMIT,
        'Limit of its change per time under commanded torques; 0 is none',
        unit='N·m/s',
        length=4,
        broadcast=True,
        minimum=0.0,
    ),
    COMMAND_INTERFACE,
    ENABLE_STAMPED_CMD_VEL,
    Parameter(
        'velocity_loop.bandwidth',
        (100.0, 100.0, 100.0, 100.0),
        "Bandwidth of the drives' velocity loops, which follow commanded rates, and hold the "
        'joints where nothing is commanded',
        unit='rad/s',
        length=4,
        broadcast=True,
        minimum=0.0,
        exclusive_minimum=True,
    ),
    Parameter(
        'encoder_resolution',
        (0.0, 0.0, 0.0, 0.0),
        'Step of the encoders of wheel_right, wheel_left, arm_1, arm_2; 0 is exact',
        unit='rad',
        length=4,
        broadcast=True,
        minimum=0.0,
    ),
    Parameter(
        'velocity_noise',
        (0.0, 0.0, 0.0, 0.0),
        'Standard deviation of the noise on the measured rates of the same joints',
        unit='rad/s',
        length=4,
        broadcast=True,
        minimum=0.0,
    ),
    Parameter(
        'measurement_delay',
        0.0,
        'Delay of the measured state, rounded to whole control periods',
        unit='s',
        minimum=0.0,
        maximum=1.0,
    ),
    Parameter(
        'seed', 0, 'Which noise it is', minimum=0, maximum=4294967295
    ),
)
"""The plant's declarations."""


_BANDWIDTH_STEP = 0.1
"""Most that the bandwidth of drives that hold is, times the step of integration.

A joint that feels a quarter of its own inertia, as in a stretched arm, is stable up to 0.25.
"""


class SimulatedRobot:
    """The plant's state and how it moves.

    `position` (7), `velocity` (7) are what is measured at the tick, in the order of
    joint_states, SI units and radians, `true_position` and `true_velocity` what is so.
    `applied` (4) is the torque over the interval just ended, in N m: that commanded, within the
    motors' limits, or with commanded rates the mean of what the drives made of them.
    """

    def __init__(self, robot: Robot, period: float, values: Mapping[str, Any]) -> None:
        """Take the true robot, the control period in s and checked values of PLANT."""
        self.period = period
        self.plant = plant_record(robot, period, values)
        self.memory = np.zeros(1, PLANT_MEMORY)
        self.delayed = np.zeros((int(self.plant['delay'][0]) + 1, 14))
        self.geometry = robot.geometry
        self.is_exact = bool(self.plant['is_exact'][0])
        self._com_offset = robot.com_offset
        self._values = values
        self.true_position, self.true_velocity = (
            self.memory[name][0] for name in ('position', 'velocity')
        )
        self.position, self.velocity = np.zeros(7), np.zeros(7)
        self.applied = np.zeros(AXES)
        self.tick = 0
        self.reset()

    def reset(self) -> None:
        """Return to the initial state at t = 0; InputError where that is not finite."""
        self.tick = 0
        self.applied[:] = 0.0
        finite = plant_start(
            self.plant,
            self.memory,
            self.delayed,
            self._com_offset,
            np.array(self._values['initial_pose']),
            np.array(self._values['initial_joints']),
            np.array(self._values['initial_velocity']),
            self.position,
            self.velocity,
        )
        if not finite:
            raise InputError(
                'initial_pose, initial_joints or initial_velocity make no state of a robot; '
                'expected finite numbers, and angles that have a sine'
            )

    def advance(self, command: NDArray[np.float64] | None) -> None:
        """Hold a command (4) for one control period; with None the drives hold the joints.

        Torques in N m, or with `command_interface` velocity the platform's forward speed in
        m/s, its yaw rate and the arm joints' rates in rad/s. Raises InputError where the state
        is no longer finite.
        """
        before = self.plant, self.memory, self.delayed, self.tick
        after = self.position, self.velocity, self.applied
        if command is None:
            finite = plant_hold(*before, *after)
        else:
            finite = plant_tick(*before, command, *after)
        self.tick += 1
        if not finite:
            raise diverged(self.tick * self.period)


def plant_record(robot: Robot, period: float, values: Mapping[str, Any]) -> NDArray[np.void]:
    """Return one record of PLANT_SETTINGS; the period is in s, the values are those of PLANT."""
    plant = np.zeros(1, PLANT_SETTINGS)
    plant['geometry'], plant['theta'] = robot.geometry, robot.theta
    for name in ('amplitude', 'frequency', 'phase'):
        plant[name] = values[f'disturbance.{name}']
    plant['limit'] = values['torque_limit']
    plant['rate_limit'] = values['torque_rate_limit']
    plant['period'] = period
    step = values['integrator_step']
    steps = Decimal(period) / Decimal(step)
    check_count(steps, MOST_TICKS, 'integrator_step', step, 'steps in a control period')
    plant['steps'] = max(1, round(period / step))
    plant['resolution'] = values['encoder_resolution']
    plant['noise'] = values['velocity_noise']
    plant['delay'] = round(values['measurement_delay'] / period)
    plant['seed'] = values['seed']
    plant['command_interface'] = COMMAND_INTERFACES.index(values['command_interface'])
    plant['bandwidth'] = values['velocity_loop.bandwidth']
    if values['command_interface'] != COMMAND_INTERFACES[VELOCITY]:
        # Whoever commands torques integrates as the robot needs it; drives that hold follow.
        most = _BANDWIDTH_STEP * plant['steps'] / period
        plant['bandwidth'] = np.minimum(plant['bandwidth'], most)
    _, _, arm_1, arm_2 = values['initial_joints']
    plant['inertia'] = joint_inertias(robot.geometry, robot.theta, arm_1, arm_2)
    plant['is_exact'] = not any(plant[name].any() for name in ('resolution', 'noise', 'delay'))
    return plant


def diverged(time: float) -> InputError:
    """Return the error of a closed loop whose numbers are no longer finite at a time in s."""
    return InputError(
        f'the closed loop diverged at t = {time:g} s; expected gains and a control_period '
        'with which it is stable'
    )
