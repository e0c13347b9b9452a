# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Independent implementation of the sampled closed loop in NumPy, on dense matrices.

It shares no function with the package. The model is derived from the Lagrangian
(lagrangian.py). LAPACK solves the linear systems; the C library computes sines. Seven robots of
one body each yield the columns of Y. The implicit law tries all combinations of signs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
import math

from helpers.lagrangian import Array, Matrices, matrices, PARAMETERS
from helpers.scenario import Scenario
import numpy as np

_SIDES = np.array(list(product((-1.0, 0.0, 1.0), repeat=4)))


def base_parameters(p: dict[str, float]) -> Array:
    """Return theta (7) of a robot."""
    arm = p['link_1_mass'] + p['link_2_mass']
    offset = p['com_offset'] + p['arm_offset']
    rolling = p['wheel_mass'] + p['wheel_spin_inertia'] / p['wheel_radius'] ** 2
    return np.array(
        [
            p['platform_mass'] + 2 * rolling + arm,
            p['platform_inertia']
            + p['platform_mass'] * p['com_offset'] ** 2
            + 2 * p['wheel_yaw_inertia']
            + 2 * rolling * p['half_track'] ** 2
            + arm * offset**2,
            p['platform_mass'] * p['com_offset'] + arm * offset,
            p['link_1_mass'] * p['link_1_com'] + p['link_2_mass'] * p['link_1_length'],
            p['link_2_mass'] * p['link_2_com'],
            p['link_1_inertia']
            + p['link_1_mass'] * p['link_1_com'] ** 2
            + p['link_2_mass'] * p['link_1_length'] ** 2,
            p['link_2_inertia'] + p['link_2_mass'] * p['link_2_com'] ** 2,
        ]
    )


def one_body_robots(p: dict[str, float]) -> list[dict[str, float]]:
    """Return seven robots with the lengths of this one and linearly independent theta."""
    lengths = {name: p[name] for name in PARAMETERS if name.endswith(('_radius', '_track'))}
    lengths |= {name: p[name] for name in ('link_1_length', 'link_2_length')}
    arm_base = p['com_offset'] + p['arm_offset']
    empty = dict.fromkeys(PARAMETERS, 0.0) | lengths | {'arm_offset': arm_base}
    return [
        empty | {'platform_mass': 1.0},
        empty | {'platform_inertia': 1.0},
        empty | {'platform_mass': 1.0, 'com_offset': 1.0, 'arm_offset': arm_base - 1.0},
        empty | {'link_1_mass': 1.0, 'link_1_com': 1.0},
        empty | {'link_1_inertia': 1.0},
        empty | {'link_2_mass': 1.0, 'link_2_com': 1.0},
        empty | {'link_2_inertia': 1.0},
    ]


def switching(kind: str, s: Array, delta: float) -> Array:
    """Return sw(s) axis by axis."""
    if kind == 'sign':
        return np.sign(s)
    if kind == 'saturation':
        return np.clip(s / delta, -1.0, 1.0)
    if kind == 'sigmoid':
        return s / (np.abs(s) + delta)
    return np.array([math.tanh(value / delta) for value in s])


def implicit(h_x: Array, period: float, k_s1: Array, k_s2: Array, s: Array) -> tuple[Array, Array]:
    """Return s+ and zeta: solve for all 81 combinations of signs, return the consistent one."""
    right, box = h_x @ s, period * k_s2
    matrix = h_x + period * np.diag(k_s1)
    is_sliding_off = _SIDES != 0.0
    both = is_sliding_off[:, :, None] & is_sliding_off[:, None, :]
    systems = np.where(both, matrix, np.eye(4))
    known = np.where(is_sliding_off, right - box * _SIDES, 0.0)
    following = np.linalg.solve(systems, known[:, :, None])[:, :, 0]
    residual = right - following @ matrix.T
    wrong = np.where(
        is_sliding_off, np.maximum(-_SIDES * following, 0.0) / (np.abs(s).max() + 1e-300), 0
    )
    over = np.where(is_sliding_off, 0.0, np.maximum(np.abs(residual) - box, 0.0) / box)
    best = int(np.argmin(np.max(wrong + over, axis=1)))
    return following[best], np.where(is_sliding_off[best], _SIDES[best], residual[best] / box)


@dataclass
class Trace:
    """State, command and estimate at every tick."""

    position: Array
    velocity: Array
    torque: Array
    estimate: Array


class Simulator:
    """The closed loop of one scenario."""

    def __init__(self, scenario: Scenario) -> None:
        """Initialise the loop of a scenario at tick 0."""
        self.scenario = scenario
        self.parameters = scenario.robot.physical
        self._bodies = one_body_robots(self.parameters)
        self._coordinates = np.array([base_parameters(body) for body in self._bodies])
        self.nominal = scenario.model_scale * base_parameters(self.parameters)
        self.estimate = self.nominal.copy()
        self.q = np.concatenate([scenario.pose, scenario.joints])
        self.v = scenario.rates.copy()
        self._disturbance = np.zeros(4)
        self._predicted: Array | None = None
        self._commanded = np.zeros(4)
        self._extra = {
            'torque_limit': np.zeros(4),
            'torque_rate_limit': np.zeros(4),
            'leakage': 0.0,
            'e_modification': 0.0,
            'dead_zone': 0.0,
            'freeze_when_saturated': 0,
            **dict(scenario.extra),
        }

    def run(self) -> Trace:
        """Compute every tick."""
        n, reference = self.scenario.ticks, self.scenario.reference
        trace = Trace(np.empty((n, 7)), np.empty((n, 7)), np.empty((n, 4)), np.empty((n, 7)))
        for k in range(n):
            trace.position[k], trace.velocity[k] = self._as_joint_states()
            trace.estimate[k] = self.estimate
            trace.torque[k] = self._control(*reference[k].reshape(3, 4))
            if k + 1 < n:
                self._advance(k * self.scenario.period, trace.torque[k])
        return trace

    def _matrices(self, q: Array, v: Array) -> Matrices:
        return matrices(self.parameters, q, v)

    def _as_joint_states(self) -> tuple[Array, Array]:
        """Return positions and velocities with the axle's centre instead of the centre of mass."""
        d, yaw = self.parameters['com_offset'], self.q[2]
        q_dot = self._matrices(self.q, self.v).null_space @ self.v
        position, velocity = self.q.copy(), q_dot.copy()
        position[:2] -= d * np.array([math.cos(yaw), math.sin(yaw)])
        velocity[:2] -= d * q_dot[2] * np.array([-math.sin(yaw), math.cos(yaw)])
        return position, velocity

    def _regressor(self, v_r: Array, a_r: Array) -> Array:
        """Return Y (4, 7) from the forces on robots of one body."""
        forces = []
        for body in self._bodies:
            m = matrices(body, self.q, self.v)
            forces.append(m.reduced_inertia @ a_r + m.reduced_coriolis @ v_r)
        return np.linalg.solve(self._coordinates, np.array(forces)).T

    def _control(self, x_d: Array, x_dot_d: Array, x_ddot_d: Array) -> Array:
        c = self.scenario
        m = self._matrices(self.q, self.v)
        jacobian = m.jacobian
        e = m.task_position - x_d
        e_dot = jacobian @ self.v - x_dot_d
        s = e_dot + c.sigma * e
        v_r = np.linalg.solve(jacobian, x_dot_d - c.sigma * e)
        a_r = np.linalg.solve(jacobian, x_ddot_d - c.sigma * e_dot - m.jacobian_rate @ v_r)
        y = self._regressor(v_r, a_r)
        if c.switching == 'implicit':
            u = self._implicit(np.linalg.inv(jacobian), m, s)
        else:
            u = -c.k_s1 * s - c.k_s2 * switching(c.switching, s, c.boundary_layer)
        raw = y @ self.estimate + jacobian.T @ u
        torque = self._limited(raw)
        if self._predicted is not None:
            acceleration = np.linalg.solve(c.model_scale * m.reduced_inertia, torque - raw)
            self._predicted = self._predicted + c.period * jacobian @ acceleration
        if c.law == 'rasmc':
            self._adapt(s, y.T @ np.linalg.solve(jacobian, s), saturated=(torque != raw).any())
        return torque

    def _limited(self, raw: Array) -> Array:
        limit, rate = (
            np.where(bound > 0.0, bound, np.inf)
            for bound in (self._extra['torque_limit'], self._extra['torque_rate_limit'])
        )
        step = self.scenario.period * rate
        reached = np.clip(raw, self._commanded - step, self._commanded + step)
        torque = np.clip(reached, -limit, limit)
        self._commanded = torque
        return torque

    def _adapt(self, s: Array, gradient: Array, *, saturated: bool) -> None:
        c, extra = self.scenario, self._extra
        beyond = max(0.0, float(np.linalg.norm(s)) - extra['dead_zone'])
        if saturated and extra['freeze_when_saturated']:
            beyond = 0.0
        slope = gradient * (beyond / np.linalg.norm(s)) / c.gamma
        rate = extra['leakage'] + extra['e_modification'] * beyond
        # theta+ = theta - T slope - T rate (theta+ - nominal)
        self.estimate = (self.estimate - c.period * slope + c.period * rate * self.nominal) / (
            1.0 + c.period * rate
        )

    def _implicit(self, inverse: Array, m: Matrices, s: Array) -> Array:
        c = self.scenario
        h_x = c.model_scale * inverse.T @ m.reduced_inertia @ inverse
        if self._predicted is not None:
            gain = c.observer_gain / c.period
            self._disturbance = self._disturbance + gain * h_x @ (s - self._predicted)
        self._predicted, zeta = implicit(h_x, c.period, c.k_s1, c.k_s2, s)
        return -(c.k_s1 * self._predicted + c.k_s2 * zeta) - self._disturbance

    def _advance(self, time: float, command: Array) -> None:
        c = self.scenario
        bound = np.where(c.limit > 0.0, c.limit, np.inf)
        held = np.clip(command, -bound, bound)

        def rate(t: float, state: Array) -> Array:
            q, v = state[:7], state[7:]
            m = self._matrices(q, v)
            disturbance = c.amplitude * np.sin(c.frequency * t + c.phase)
            force = held + disturbance - m.reduced_coriolis @ v
            return np.concatenate([m.null_space @ v, np.linalg.solve(m.reduced_inertia, force)])

        h, state = c.period / c.steps, np.concatenate([self.q, self.v])
        for step in range(c.steps):
            t = time + step * h
            k1 = rate(t, state)
            k2 = rate(t + h / 2, state + h / 2 * k1)
            k3 = rate(t + h / 2, state + h / 2 * k2)
            k4 = rate(t + h, state + h * k3)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.q, self.v = state[:7], state[7:]
