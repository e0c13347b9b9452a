# SPDX-License-Identifier: Apache-2.0
"""The controller as an object: gains, memory between ticks, and live changes of gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from masmc_ros.control.laws import registry
from masmc_ros.control.laws.plug_in import PlugInLaw
from masmc_ros.control.laws.update import BUILT_IN
from masmc_ros.control.reaching import SWITCHING
from masmc_ros.errors import InputError
from masmc_ros.loop.control_tick import control_tick
from masmc_ros.loop.dense import tick_input
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.parameters import Robot


def _gain(name: str, default: float, description: str, unit: str, **bounds: Any) -> Parameter:
    return Parameter(
        name,
        (default,) * AXES,
        f'{description}, per task axis x_E, y_E, x_F, y_F',
        unit=unit,
        length=AXES,
        broadcast=True,
        minimum=0.0,
        read_only=False,
        **bounds,
    )


def parameters() -> tuple[Parameter, ...]:
    """Return the controller's declarations, those of plugged-in laws with them."""
    return (
        Parameter('law', 'rasmc', 'Control law', choices=registry.names(), read_only=False),
        _gain('k_s1', 100.0, 'Gain K_s1 of the linear reaching term', 'N·s/m'),
        _gain('k_s2', 100.0, 'Gain K_s2 of the switching term', 'N'),
        _gain('sigma', 2.0, 'Slope sigma of the sliding surface', '1/s'),
        Parameter(
            'gamma',
            (1.0,) * BASE_PARAMETERS,
            'Adaptation matrix Gamma, per base inertial parameter; larger adapts more slowly',
            unit='J·s/θ²',
            length=BASE_PARAMETERS,
            broadcast=True,
            minimum=0.0,
            exclusive_minimum=True,
            read_only=False,
        ),
        Parameter(
            'switching',
            'tanh',
            'Switching term: the sign, a smooth approximation of it, or implicit Euler',
            choices=SWITCHING,
            read_only=False,
        ),
        Parameter(
            'boundary_layer',
            0.2,
            'Thickness delta of the boundary layer of the smooth approximations',
            unit='m/s',
            minimum=0.0,
            exclusive_minimum=True,
            read_only=False,
        ),
        Parameter(
            'observer_gain',
            0.0,
            'Gain beta of the disturbance estimate of the implicit law; 0 is off',
            minimum=0.0,
            maximum=1.0,
            read_only=False,
        ),
        Parameter(
            'model_scale',
            0.5,
            'Nominal model as a multiple of the robot parameters, and the start of theta_hat',
            minimum=0.0,
            exclusive_minimum=True,
        ),
        *registry.parameters(),
    )


class Controller:
    """A control law with its memory; arrays are written in place at every tick.

    `torque` (4, N m), `error` (4, m) and `surface` (4, m/s) are the last tick's results,
    `used_estimate` (7) the theta_hat in that torque, `estimate` (7) the next tick's.
    """

    def __init__(self, robot: Robot, period: float, values: Mapping[str, Any]) -> None:
        """Take the robot, the control period in s and checked values of `parameters()`."""
        self.geometry = robot.geometry
        self.nominal = values['model_scale'] * robot.theta
        self.period = period
        self.torque = np.zeros(AXES)
        self.error = np.zeros(AXES)
        self.surface = np.zeros(AXES)
        self.used_estimate = np.zeros(BASE_PARAMETERS)
        self.estimate = self.nominal.copy()
        self.disturbance = np.zeros(AXES)
        self.predicted = np.full(AXES, np.nan)
        self.values: dict[str, Any] = {}
        self._plug_in: PlugInLaw | None = None
        self._apply(values)

    def reset(self) -> None:
        """Forget what was learned: theta_hat and the disturbance estimate as at the start."""
        self.estimate[:] = self.nominal
        self._forget_disturbance()
        if self.law < 0:
            self._plug_in = self._new_plug_in(self.values)

    def change(self, values: Mapping[str, Any]) -> None:
        """Apply checked values of some parameters from the next tick on.

        theta_hat persists. Entering the implicit law, or a disturbance estimate switched on
        or off, starts that estimate from zero.
        """
        before = self.switching, self.observer_gain
        self._apply({**self.values, **values})
        now = self.switching, self.observer_gain
        if now[0] != before[0] or (now[1] == 0.0) != (before[1] == 0.0):
            self._forget_disturbance()

    @property
    def is_compiled(self) -> bool:
        """Whether the law in force is a built-in one, which whole runs are compiled with."""
        return self.law >= 0

    def tick(
        self,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        reference: NDArray[np.float64],
    ) -> bool:
        """Compute one tick; True where the arm is close to singular.

        `position` and `velocity` (7) in the order of joint_states, `reference` (12).
        """
        self.used_estimate[:] = self.estimate
        if self._plug_in is not None:
            return self._tick_plug_in(self._plug_in, position, velocity, reference)
        return bool(
            control_tick(
                self.geometry,
                self.nominal,
                self.period,
                self.law,
                self.switching,
                self.k_s1,
                self.k_s2,
                self.sigma,
                self.gamma,
                self.boundary_layer,
                self.observer_gain,
                position,
                velocity,
                reference,
                self.estimate,
                self.disturbance,
                self.predicted,
                self.torque,
                self.error,
                self.surface,
            )
        )

    def _apply(self, values: Mapping[str, Any]) -> None:
        plug_in = None
        if values['law'] not in BUILT_IN:
            plug_in = self._new_plug_in(values)
        self.values = dict(values)
        self._plug_in = plug_in
        self.law = -1 if plug_in is not None else BUILT_IN.index(values['law'])
        self.switching = SWITCHING.index(values['switching'])
        self.k_s1 = np.array(values['k_s1'])
        self.k_s2 = np.array(values['k_s2'])
        self.sigma = np.array(values['sigma'])
        self.gamma = np.array(values['gamma'])
        self.boundary_layer: float = values['boundary_layer']
        self.observer_gain: float = values['observer_gain']

    @staticmethod
    def _new_plug_in(values: Mapping[str, Any]) -> PlugInLaw:
        return registry.load(values['law'])()

    def _forget_disturbance(self) -> None:
        self.disturbance[:] = 0.0
        self.predicted[:] = np.nan

    def _tick_plug_in(
        self,
        law: PlugInLaw,
        position: NDArray[np.float64],
        velocity: NDArray[np.float64],
        reference: NDArray[np.float64],
    ) -> bool:
        gains = {
            name: np.array(value) if isinstance(value, tuple) else value
            for name, value in self.values.items()
        }
        inputs = tick_input(
            self.geometry,
            self.nominal,
            self.period,
            gains,
            position,
            velocity,
            reference,
            self.estimate,
        )
        torque, estimate = law.step(inputs)
        for array, given, what in (
            (self.torque, torque, 'torque'),
            (self.estimate, estimate, 'estimate'),
        ):
            found = np.asarray(given, dtype=np.float64)
            if found.shape != array.shape or not np.isfinite(found).all():
                raise InputError(
                    f'law = {self.values["law"]}: its {what} is {found.tolist()}, expected '
                    f'{array.size} finite numbers'
                )
            array[:] = found
        self.error[:] = inputs.error
        self.surface[:] = inputs.surface
        return inputs.singular
