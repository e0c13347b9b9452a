# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robot simulated by MuJoCo, with friction and slip of the wheels."""

from __future__ import annotations

from collections.abc import Callable
import math

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import bound
from masmc_ros.loop.closed_loop import plant_drive, plant_observe
from masmc_ros.loop.plant_parameters import (
    CASTOR_DISTANCE,
    FRICTION,
    INTEGRATOR_STEP,
    PAYLOAD_MASS,
    PAYLOAD_TIME,
)
from masmc_ros.loop.signals import CONTACT
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.params.declaration import Values
from masmc_ros.physics.mujoco_model import contact_model
from masmc_ros.robot.robot import Robot
import mujoco
import numpy as np

_SETTLING = 0.5
"""Time in s for the robot to settle on wheels and castors before the start."""

_CALM = 0.95
"""Share of the vertical motion that remains after one step of settling."""

_UPRIGHT = 0.95
"""Smallest cosine of the base's tilt; with a smaller one the robot has fallen over."""

_LOST = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)

# Otherwise MuJoCo writes a log file into the current folder.
mujoco.set_mju_user_warning(lambda _: None)


class ContactRobot(SimulatedRobot):
    """
    Robot on wheels, simulated by MuJoCo, with the interface of `SimulatedRobot`.

    The measured base pose is the true one even with slip. If encoders have a resolution, it is
    that of odometry, without slip. For an omnidirectional base, commands are forces on the base,
    produced by the wheels; disturbances of the base act on it directly. Own wheels produce them
    within their limits.
    """

    is_compiled = False

    def __init__(self, robot: Robot, period: float, values: Values) -> None:
        """Initialise like `SimulatedRobot`; raise InputError if MuJoCo rejects the robot."""
        springs = ('joint_stiffness', 'joint_damping', 'rotor_inertia')
        self._steps = max(1, round(period / INTEGRATOR_STEP.of(values)))
        self._parts, self._loaded = (
            contact_model(
                robot,
                period / self._steps,
                friction=FRICTION.of(values),
                castor_distance=CASTOR_DISTANCE.of(values),
                load=load,
                springs=np.transpose([values[name] for name in springs]),
            )
            for load in (0.0, PAYLOAD_MASS.of(values))
        )
        self._pick_up = round(PAYLOAD_TIME.of(values) / period)
        self._data = mujoco.MjData(self._parts.model)
        self._base = len(robot.mechanism.base)
        self._yaw, self._turned = 0.0, np.zeros(9)
        self._gone = np.zeros(self._parts.forces)
        # Wheel torques of minimum norm that produce forces on the base.
        self._shares = np.linalg.pinv(self._parts.rolling).T
        self._level = self._parts.model.geom_quat[self._parts.wheels]
        self._back = np.zeros(4)
        self._drive: Callable[..., None] | None = None
        self._observe: Callable[..., bool] | None = None
        super().__init__(robot, period, values)

    def reset(self) -> None:
        """Return to the initial state at t = 0, on wheels and castors."""
        super().reset()
        mujoco.mj_resetData(self._model, self._data)
        self._settle()
        self._write_state()
        self._see()

    def advance(self, command: Array | None) -> None:
        """Hold a command (joints) for one period, like `SimulatedRobot`."""
        holds = command is None
        if command is not None:
            self._take(command)
        data, memory, model = self._data, self.memory[0], self._model
        parts, forces = self._parts, self._parts.forces
        for step in range(self._steps):
            moved = (
                self.settings, self.memory, self.delayed, self.tick, step, self.signals, holds
            )
            self._drive = self._drive or bound(plant_drive, *moved)
            memory['rates'][:, 0] = self._rates()
            memory['rotor_rates'][forces:, 0] = data.qvel[parts.rotor_rates]
            self._drive(*moved)
            driven, disturbance = memory['driven'][:, 0], memory['disturbance'][:, 0]
            data.qfrc_applied[parts.rotor_rates] = 0.0
            data.qfrc_applied[parts.rates] = disturbance[forces:]
            data.qfrc_applied[parts.rotor_rates] += driven[forces:]
            if forces:
                pushed = driven[:forces]
                data.qfrc_applied[parts.turning] = (
                    self._shares @ pushed
                    if parts.driving is None
                    else parts.driving.wheel_torques(pushed[None])[0]
                )
                self._push_base(disturbance[:forces])
            self._level_rollers()
            mujoco.mj_step(model, data)
            self._gone += self._rates()[:forces] * self.period / self._steps
        self.tick += 1
        self._write_state()
        if not self._see(holds) or self._is_lost or self._turned[8] < _UPRIGHT:
            raise InputError(
                f'the robot lost its footing at t = {self.tick * self.period:g} s; expected a '
                'start without a jump (active_on_start false), limits of torques and an inertia '
                'of wheels (with their rotors) with which slipping wheels are not thrown about, '
                'or castors further away from the axle (castor_distance)'
            )

    def _rates(self) -> Array:
        """Return the joint velocities of the mechanism; those of a base are in its frame."""
        rates: Array = self._data.qvel[self._parts.rates]
        return np.concatenate([self._base_rates(), rates]) if self._parts.forces else rates

    def _base_rates(self) -> Array:
        """Return the base velocity: forwards and sideways in m/s, rotation in rad/s."""
        data = self._data
        mujoco.mju_quat2Mat(self._turned, data.qpos[3:7])
        yaw = math.atan2(self._turned[3], self._turned[0])
        c, s = math.cos(yaw), math.sin(yaw)
        x_rate, y_rate = data.qvel[:2]
        turn = self._turned[6:] @ data.qvel[3:6]
        return np.array([x_rate * c + y_rate * s, y_rate * c - x_rate * s, turn])

    def _push_base(self, disturbance: Array) -> None:
        """Apply a force to the base: forwards and sideways in N, torque in N·m."""
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        x, y, turn = disturbance[:3]
        self._data.qfrc_applied[:2] = x * c - y * s, x * s + y * c
        self._data.qfrc_applied[5] = turn

    def _level_rollers(self) -> None:
        """Turn the contact geometries of own wheels with rollers back by their angles."""
        parts, model = self._parts, self._model
        if parts.driving is None:
            return
        for wheel, number in enumerate(parts.wheels):
            angle = -self._data.qpos[parts.angles[wheel]]
            mujoco.mju_axisAngle2Quat(self._back, parts.spun[wheel], angle)
            mujoco.mju_mulQuat(model.geom_quat[number], self._back, self._level[wheel])

    @property
    def _model(self) -> mujoco.MjModel:
        """Return the model at this tick, with or without the payload."""
        return (self._parts if self.tick < self._pick_up else self._loaded).model

    @property
    def _is_lost(self) -> bool:
        """Return True if MuJoCo has reported numbers that are too large."""
        return any(self._data.warning[warning].number for warning in _LOST)

    def _settle(self) -> None:
        """Place the robot at its start, at rest on its wheels."""
        data, memory, parts = self._data, self.memory[0], self._parts
        start, velocity = memory['position'][:, 0].copy(), memory['velocity'][:, 0].copy()
        x, y, self._yaw = start[:self._base]
        first = self._base + parts.forces
        self._gone = start[self._base:first].copy()
        data.qpos[:3] = x, y, parts.height
        data.qpos[3:7] = math.cos(0.5 * self._yaw), 0.0, 0.0, math.sin(0.5 * self._yaw)
        for _ in range(round(_SETTLING * self._steps / self.period)):
            self._place(x, y, start[first:])
            heave, roll, pitch = _CALM * data.qvel[2:5]
            data.qvel[:] = 0.0
            data.qvel[2:5] = heave, roll, pitch
            self._level_rollers()
            mujoco.mj_step(self._model, data)
        self._place(x, y, start[first:])
        data.qvel[:] = 0.0
        data.qvel[:2], data.qvel[5] = velocity[:2], velocity[2]
        data.qvel[parts.turning] = parts.rolling @ self._base_rates()
        data.qvel[parts.rates] = data.qvel[parts.rotor_rates] = velocity[first:]
        data.qvel[parts.mimic_rates] = parts.multipliers * velocity[first:][parts.sources]
        data.time = 0.0

    def _place(self, x: float, y: float, angles: Array) -> None:
        """Move the base to a place in m and the joints to angles, without a change of tilt."""
        data, parts = self._data, self._parts
        data.qpos[:2], data.qpos[parts.positions] = (x, y), angles
        data.qpos[parts.rotor_positions] = angles
        data.qpos[parts.mimic_positions] = parts.multipliers * angles[parts.sources]

    def _write_state(self) -> None:
        """Write the state of MuJoCo as the true state."""
        data, memory, parts = self._data, self.memory[0], self._parts
        mujoco.mju_quat2Mat(self._turned, data.qpos[3:7])
        yaw = math.atan2(self._turned[3], self._turned[0])
        self._yaw += math.remainder(yaw - self._yaw, 2.0 * math.pi)
        rates, angles = self._rates(), data.qpos[parts.positions]
        memory['position'][:, 0] = *data.qpos[:2], self._yaw, *self._gone, *angles
        memory['velocity'][:, 0] = *data.qvel[:2], self._turned[6:] @ data.qvel[3:6], *rates
        memory['rates'][:, 0] = rates
        memory['rotor_angles'][parts.forces:, 0] = data.qpos[parts.rotor_positions]
        memory['rotor_rates'][parts.forces:, 0] = data.qvel[parts.rotor_rates]

    def _see(self, holds: bool = False) -> bool:
        """Measure the state; return True if it is finite."""
        moved = self.settings, self.memory, self.delayed, self.tick, self.signals, holds
        self._observe = self._observe or bound(plant_observe, *moved)
        return self._observe(*moved)

    @property
    def contact(self) -> Array:
        """Return the signals of `CONTACT` for each wheel (4 * wheels)."""
        data, parts = self._data, self._parts
        base = self._base_rates()
        rows = np.zeros((len(parts.radii), len(CONTACT)))
        rows[:, 0] = parts.radii * (data.qvel[parts.turning] - parts.rolling @ base)
        rows[:, 1] = 0.0 if parts.has_rollers else base[1]
        # Every contact point has a normal force and two friction forces.
        for wheel, touches in enumerate(parts.wheels[:, None] == data.contact.geom[:, 1]):
            firsts = data.contact.efc_address[touches]
            normal, along, across = data.efc_force[firsts[:, None] + range(3)].sum(axis=0)
            rows[wheel, 2:] = normal, math.hypot(along, across)
        return rows.ravel()
