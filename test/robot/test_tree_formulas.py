# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mechanism interface of trees: dualities, derivatives, redundancy and limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from helpers.small_tree import parameters, START
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import interpreted
from masmc_ros.jit.record import tag_of
from masmc_ros.jit.sized_records import type_of
from masmc_ros.loop.records import plant_settings
from masmc_ros.robot import mechanism
from masmc_ros.robot.declaration import formulas_of_tag
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.tree.formulas import model_of
from masmc_ros.robot.tree.friction import CREEP
from masmc_ros.robot.tree.natural_adaptation import adapted
from masmc_ros.robot.tree.task.null_space_drift import _unseen
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.tree.tree_model import (
    damped_time_of,
    least_pivot_of,
    mobility_begins,
    TreeModel,
)
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

FEW = settings(max_examples=20, deadline=None)
SEED = st.integers(0, 2**32 - 1)
TASK = st.sampled_from((
    ('pose',),
    ('position',),
    ('planar',),
    ('base',),
    ('joints',),
    ('orientation', 'joints lift_joint'),
    ('position', 'heading'),
    ('position', 'planar turret'),
    ('planar turret', 'joints'),
    ('base', 'joints'),
    ('planar hand', 'base'),
))
"""Tasks with at most as many axes as velocities; `base` requires an omnidirectional base."""
H = 1e-4

VISCOUS = (0.1, 0.2, 3.0, 4.0, 0.5, 0.6, 0.7)
COULOMB = (0.7, 0.6, 0.5, 4.0, 3.0, 0.2, 0.1)


@pytest.fixture(autouse=True, scope='module')
def _plain_python() -> Iterator[None]:
    """Call kernels as plain Python: each would be compiled alone, for every size of a task."""
    with interpreted():
        yield


class Drawn:
    """The small robot in a random regular state."""

    def __init__(
        self,
        seed: int,
        task: tuple[str, ...] = ('pose',),
        friction: bool = False,
        **settings_: Any,
    ) -> None:
        """Draw the state; `settings_` are parameters of the robot."""
        values: dict[str, Any] = {**parameters(), 'robot.task': task}
        if friction:
            values |= {'robot.friction': 'parameters', 'robot.viscous_friction': VISCOUS}
            values |= {'robot.coulomb_friction': COULOMB}
        nominal_posture = START
        if 'base' in task:
            # A base on two wheels cannot move sideways.
            values |= {'robot.base': 'omnidirectional', 'robot.wheels': ()}
            values |= {'robot.held_joints': parameters()['robot.wheels']}
            values |= {'robot.joints': ('turret_joint', 'lift_joint', 'upper_joint')}
            values |= {'robot.posture': START[2:5]}
            nominal_posture = (0.0, 0.0, 0.0, *START[2:5])
        self.mechanism = tree_mechanism(values)
        values = {p.name: p.default for p in self.mechanism.parameters} | values
        self.values = values | {f'robot.{name}': value for name, value in settings_.items()}
        self.robot = robot_of(self.values)
        numbers = self.robot.geometry
        axes = (0.0,) * len(self.mechanism.axes)
        self.model = TreeModel(numbers, axes)
        draw = np.random.default_rng(seed)
        self.position = np.array([0.0, 0.0, 0.0, *nominal_posture])
        self.position += draw.uniform(-0.3, 0.3, len(self.position))
        self.rates, self.force, self.torques = draw.normal(size=(3, len(nominal_posture)))
        self.twist, self.change, self.pull = draw.normal(size=(3, len(axes)))
        # Too slow for any speed limit.
        self.twist *= 0.02
        self.theta = self.robot.theta
        self.template = tuple(self.rates.tolist())

    def posture(self, position: Array | None = None) -> Any:
        """Return the kinematics of positions."""
        return mechanism.posture(self.model, numbers(self.at(position)))

    def at(self, position: Array | None = None) -> Array:
        """Return the positions, or those of the state for None."""
        return self.position if position is None else position

    def moved(self, time: float) -> Array:
        """Return the positions after `time` at constant velocities nu, by Runge and Kutta."""
        nu = mechanism.motion(self.model, numbers(self.rates))

        def slope(at: Array) -> Array:
            rates = mechanism.joint_rates(self.model, nu)
            return np.array(mechanism.position_rates(self.model, self.posture(at), rates))

        start = self.position
        one = slope(start)
        two = slope(start + 0.5 * time * one)
        three = slope(start + 0.5 * time * two)
        four = slope(start + time * three)
        return np.asarray(start + time / 6.0 * (one + 2.0 * two + 2.0 * three + four))

    def reference(self, time: float) -> tuple[Array, Array]:
        """Return nu_r and a_r after `time`, for a task whose velocity changes."""
        at = self.moved(time)
        v, a, _ = mechanism.reference_motion(
            self.model,
            self.posture(at),
            numbers(at),
            mechanism.motion(self.model, numbers(self.rates)),
            numbers(self.twist + time * self.change),
            numbers(self.change),
        )
        return np.array(v), np.array(a)

    def jacobian(self) -> Array:
        """Return J, column by column."""
        return np.array([
            mechanism.task_velocity(self.model, self.posture(), numbers(unit))
            for unit in np.eye(len(self.rates))
        ]).T

    def inertia(self) -> Array:
        """Return H, column by column."""
        h = mechanism.inertia(self.model, self.posture(), self.theta)
        return np.array([
            mechanism.inertia_times(self.model, h, numbers(unit))
            for unit in np.eye(len(self.rates))
        ])


def numbers(array: Array) -> tuple[float, ...]:
    """Return an array as a tuple for compiled functions."""
    return tuple(array.tolist())


def derivative(function: Callable[[float], Array], step: float = H) -> Array:
    """Return the derivative at zero, by differences of fourth order."""
    inner, outer = function(step) - function(-step), function(2.0 * step) - function(-2.0 * step)
    return (8.0 * inner - outer) / (12.0 * step)


@FEW
@given(SEED)
def test_tree_wheel_velocity_and_force_maps_preserve_power(seed: int) -> None:
    drawn = Drawn(seed)
    model = drawn.model
    nu = np.array(mechanism.motion(model, numbers(drawn.rates)))
    assert mechanism.joint_rates(model, numbers(nu)) == pytest.approx(drawn.rates, abs=1e-12)
    f = np.array(mechanism.forces(model, numbers(drawn.torques)))
    assert mechanism.joint_torques(model, numbers(f)) == pytest.approx(drawn.torques, abs=1e-12)
    assert f @ nu == pytest.approx(drawn.torques @ drawn.rates, abs=1e-11)


@FEW
@given(SEED, TASK)
def test_tree_jacobian_is_derivative_of_task_error(
    seed: int, task: tuple[str, ...]
) -> None:
    """Origins, rotations and joints move at J nu; forces of J' have the same power."""
    drawn = Drawn(seed, task)
    nu = mechanism.motion(drawn.model, numbers(drawn.rates))
    twist = np.array(mechanism.task_velocity(drawn.model, drawn.posture(), nu))
    pose = mechanism.task_position(drawn.model, drawn.posture(), numbers(drawn.position))

    def error(time: float) -> Array:
        at = drawn.moved(time)
        return np.array(
            mechanism.task_error(drawn.model, drawn.posture(at), numbers(at), pose)
        )

    assert error(0.0) == pytest.approx(np.zeros(len(twist)), abs=1e-14)
    # Near zero, the orientation error is the angle of the rotation.
    assert derivative(error) == pytest.approx(twist, abs=1e-8)
    force = mechanism.forces_from_task(
        drawn.model, drawn.posture(), numbers(drawn.pull), drawn.template
    )
    assert np.dot(force, nu) == pytest.approx(drawn.pull @ twist, abs=1e-11)


def may_be_damped(drawn: Drawn) -> bool:
    """Return True if the task is so close to singular that its velocity may be damped."""
    jacobian, first = drawn.jacobian(), mobility_begins(drawn.model)
    mobilities = np.array(drawn.model.numbers[first:first + jacobian.shape[1]])
    pivots = np.linalg.cholesky(jacobian * mobilities @ jacobian.T).diagonal() ** 2
    bound = (damped_time_of(drawn.model) * np.linalg.norm(drawn.twist)) ** 2
    # The bound contains the velocity less that of the secondary motion, which is small.
    return bool(pivots.min() <= 2.0 * max(bound, least_pivot_of(drawn.model)))


@pytest.mark.parametrize('seed', [2910, 2959])
def test_tree_damped_task_is_recognised(seed: int) -> None:
    drawn = Drawn(seed, ('position', 'planar turret'), base_mobility=0.3, posture_gain=0.02)
    assert np.abs(drawn.jacobian() @ drawn.reference(0.0)[0] - drawn.twist).max() > 1e-4
    assert may_be_damped(drawn)


@FEW
@given(SEED, TASK)
def test_tree_reference_motion_fulfils_task_with_derivative(
    seed: int, task: tuple[str, ...]
) -> None:
    drawn = Drawn(seed, task, damping=0.0, base_mobility=0.3, posture_gain=0.02)
    assume(not may_be_damped(drawn))
    nu = mechanism.motion(drawn.model, numbers(drawn.rates))
    v_r, a_r = drawn.reference(0.0)
    assert drawn.jacobian() @ v_r == pytest.approx(drawn.twist, abs=1e-11)
    size = 1.0 + np.abs(a_r).max()
    assert a_r == pytest.approx(derivative(lambda time: drawn.reference(time)[0]), abs=1e-6 * size)
    # The damping is proportional to the velocity error.
    damped = Drawn(seed, task, damping=3.0, base_mobility=0.3, posture_gain=0.02)
    _, damped_acceleration, _ = mechanism.reference_motion(
        damped.model, damped.posture(), numbers(damped.position), nu,
        numbers(damped.twist), numbers(damped.change),
    )  # fmt: skip
    damping = 3.0 * (np.array(nu) - v_r)
    assert a_r - np.array(damped_acceleration) == pytest.approx(damping, abs=1e-9)


@FEW
@given(SEED, st.floats(0.02, 0.98), st.booleans())
def test_tree_reference_motion_near_joint_limit_slows_joint(
    seed: int, part: float, is_upper: bool
) -> None:
    """The contribution vanishes at the end, and a_r is the derivative of the reduced motion."""
    drawn = Drawn(seed, ('position',), damping=0.0, limit_margin=0.1, posture_gain=0.02)
    lower, upper = (drawn.mechanism.joint_limits[name][5] for name in ('lower', 'upper'))
    margin = 0.1 * (upper - lower)
    place = 3 + 5
    drawn.position[place] = upper - part * margin if is_upper else lower + part * margin
    v_r, a_r = drawn.reference(0.0)
    assert drawn.jacobian() @ v_r == pytest.approx(drawn.twist, abs=1e-10)
    size = 1.0 + np.abs(a_r).max()
    assert a_r == pytest.approx(derivative(lambda time: drawn.reference(time)[0]), abs=1e-5 * size)
    # At its end the joint only follows the posture term, which leads back.
    drawn.position[place] = upper if is_upper else lower
    v_r, _ = drawn.reference(0.0)
    nominal = parameters()['robot.posture'][3]
    assert v_r[5] == pytest.approx(-0.02 * (drawn.position[place] - nominal), abs=1e-12)


@FEW
@given(SEED, TASK)
def test_tree_reference_motion_keeps_speed_limits(seed: int, task: tuple[str, ...]) -> None:
    drawn = Drawn(seed, task, speed_limits=('lift_joint 0.07',))
    drawn.twist *= 100.0
    v_r, _ = drawn.reference(0.0)
    rates = np.abs(mechanism.joint_rates(drawn.model, numbers(v_r)))
    limits = 0.9 * np.array(mechanism_from(drawn.values).speed_limits)
    assert (rates <= limits * (1.0 + 1e-12)).all()
    assert rates.max() > 0.01


@FEW
@given(SEED)
def test_tree_reference_motion_limited_has_its_derivative(seed: int) -> None:
    limits = ('wheel_right_joint 0.01', 'wheel_left_joint 0.01')
    drawn = Drawn(seed, damping=0.0, posture_gain=0.02, speed_limits=limits)
    v_r, a_r = drawn.reference(0.0)
    rates = np.abs(mechanism.joint_rates(drawn.model, numbers(v_r)))
    assert rates[:2].max() == pytest.approx(0.009, rel=1e-9)
    # Two steps bound the error of the differences. They do not converge at the transition of the
    # limit from one wheel to the other.
    coarse, fine = (derivative(lambda time: drawn.reference(time)[0], step) for step in (H, H / 2))
    size, difference = 1.0 + np.abs(a_r).max(), np.abs(fine - coarse).max()
    assume(difference < 1e-3 * size)
    assert a_r == pytest.approx(fine, abs=difference + 1e-6 * size)


def test_tree_path_out_of_reach_ends_at_rest_without_chatter() -> None:
    drawn = Drawn(0, ('position',))
    drawn.position[:] = 0.0, 0.0, 0.0, *START
    still = numbers(np.zeros(7))
    goal = np.array([0.5, 0.0, 10.0])
    speeds, before = [], np.zeros(7)
    for _ in range(600):
        posture, at = drawn.posture(), numbers(drawn.position)
        error = np.array(mechanism.task_position(drawn.model, posture, at)) - goal
        v_r, _, _ = mechanism.reference_motion(
            drawn.model, posture, at, still, numbers(-2.0 * error), numbers(np.zeros(3))
        )
        rates = mechanism.joint_rates(drawn.model, v_r)
        drawn.position += 0.01 * np.array(mechanism.position_rates(drawn.model, posture, rates))
        speeds.append((np.abs(rates[2:]).max(), np.abs(np.array(rates) - before)[2:].max()))
        before = np.array(rates)
    assert max(speed for speed, _ in speeds) <= 2.7 * (1.0 + 1e-12)
    assert speeds[-1][0] < 0.1
    assert max(step for _, step in speeds[100:]) < 0.5


@FEW
@given(SEED, TASK)
def test_tree_null_space_motion_does_not_move_task(seed: int, task: tuple[str, ...]) -> None:
    drawn = Drawn(seed, task)
    unseen = _unseen(drawn.model, drawn.posture(), drawn.template)
    assert drawn.jacobian() @ unseen == pytest.approx(np.zeros(len(drawn.twist)), abs=1e-9)
    again = _unseen(drawn.model, drawn.posture(), numbers(np.array(unseen)))
    assert np.array(again) == pytest.approx(np.array(unseen), abs=1e-9)


def test_tree_joint_at_limit_stops_while_others_continue() -> None:
    reached = {}
    for margin in (0.0, 0.1):
        drawn = Drawn(0, ('position',), limit_margin=margin, posture_gain=0.0)
        drawn.position[:] = 0.0, 0.0, 0.0, *START
        drawn.position[3 + 5] = 2.95
        still, path = numbers(np.zeros(7)), []
        start = np.array(
            mechanism.task_position(drawn.model, drawn.posture(), numbers(drawn.position))
        )
        # The direction in which this joint moves the hand.
        wanted = 0.1 * drawn.jacobian()[:, 5] / np.linalg.norm(drawn.jacobian()[:, 5])
        for _ in range(300):
            v_r, _, _ = mechanism.reference_motion(
                drawn.model, drawn.posture(), numbers(drawn.position), still,
                numbers(wanted), numbers(np.zeros(3)),
            )  # fmt: skip
            rates = mechanism.joint_rates(drawn.model, v_r)
            moved = mechanism.position_rates(drawn.model, drawn.posture(), rates)
            drawn.position += 0.01 * np.array(moved)
            path.append(drawn.position[3 + 5])
        end = np.array(
            mechanism.task_position(drawn.model, drawn.posture(), numbers(drawn.position))
        )
        assert end - start == pytest.approx(3.0 * wanted, abs=0.01)
        reached[margin] = max(path)
    assert reached[0.1] < 3.0 < reached[0.0]


@FEW
@given(SEED, TASK)
def test_tree_tracking_error_derivatives_equal_differences(
    seed: int, task: tuple[str, ...]
) -> None:
    drawn = Drawn(seed, task)
    nu = mechanism.motion(drawn.model, numbers(drawn.rates))
    pose = np.array(
        mechanism.task_position(drawn.model, drawn.posture(), numbers(drawn.position))
    )
    wanted = pose + 0.3 * drawn.pull

    def tracking(time: float) -> Any:
        at = drawn.moved(time)
        desired = (
            wanted + time * drawn.twist + 0.5 * time * time * drawn.change,
            drawn.twist + time * drawn.change,
            drawn.change,
        )
        return mechanism.tracking(
            drawn.model, drawn.posture(at), numbers(at), nu, tuple(map(numbers, desired))
        )

    current = tracking(0.0)
    assert np.array(current.error_derivative) == pytest.approx(
        derivative(lambda time: np.array(tracking(time).error)), abs=1e-7
    )
    assert np.array(current.acceleration) == pytest.approx(
        derivative(lambda time: np.array(tracking(time).velocity)), abs=1e-7
    )
    twist = np.array(mechanism.task_velocity(drawn.model, drawn.posture(), nu))
    assert current.velocity_error == pytest.approx(twist - np.array(current.velocity), abs=1e-12)


@FEW
@given(SEED, TASK, st.booleans())
def test_tree_dynamics_functions_agree_with_each_other(
    seed: int, task: tuple[str, ...], friction: bool
) -> None:
    drawn = Drawn(seed, task, friction and 'base' not in task)
    model, posture = drawn.model, drawn.posture()
    nu, a = numbers(drawn.rates), numbers(drawn.force)
    h, jacobian = drawn.inertia(), drawn.jacobian()
    assert h == pytest.approx(h.T, abs=1e-12)
    y = mechanism.regressor(model, posture, nu, nu, a)
    total = np.array(mechanism.regressor_times(model, y, drawn.theta))
    bias = np.array(mechanism.coriolis(model, posture, drawn.theta, nu))
    assert total == pytest.approx(h @ np.array(a) + bias, abs=1e-9)
    # The inertia of rotors and wheels is part of H and no parameter: Y' contains the remainder.
    armature_forces = np.array(mechanism.regressor_times(model, y, np.zeros(len(drawn.theta))))
    gradient = mechanism.regressor_transpose_times(model, y, nu, drawn.theta)
    power = np.dot(nu, total - armature_forces)
    assert np.dot(gradient, drawn.theta) == pytest.approx(power, abs=1e-8)
    acceleration = mechanism.inertia_solve(
        model, mechanism.inertia(model, posture, drawn.theta), numbers(drawn.torques)
    )
    assert h @ np.array(acceleration) == pytest.approx(drawn.torques, abs=1e-9)
    columns = mechanism.task_inertia(model, posture, drawn.theta, numbers(drawn.twist))
    product = np.array(columns).T @ (jacobian @ np.linalg.solve(h, jacobian.T))
    assert product == pytest.approx(np.eye(len(drawn.twist)), abs=1e-3)


@FEW
@given(SEED)
def test_tree_friction_equals_joint_friction(seed: int) -> None:
    """Friction equals dense matrices, in a law's torque and in the plant's acceleration."""
    drawn, smooth = Drawn(seed, friction=True), Drawn(seed)
    rates = drawn.rates
    friction_torques = np.array(VISCOUS) * rates
    friction_torques += np.array(COULOMB) * rates / np.sqrt(rates**2 + CREEP**2)
    nu = mechanism.motion(drawn.model, numbers(rates))
    differences = np.array(
        mechanism.coriolis(drawn.model, drawn.posture(), drawn.theta, nu)
    ) - np.array(mechanism.coriolis(smooth.model, smooth.posture(), smooth.theta, nu))
    torques = mechanism.joint_torques(drawn.model, numbers(differences))
    assert torques == pytest.approx(friction_torques, abs=1e-9)
    # Conversely, torques that compensate the friction leave the acceleration unchanged.
    rough_robot = drawn.model, drawn.posture(), drawn.theta, numbers(rates)
    smooth_robot = smooth.model, smooth.posture(), smooth.theta, numbers(rates)
    torques = numbers(drawn.torques + friction_torques)
    accelerations = mechanism.joint_accelerations(*rough_robot, torques)
    assert accelerations == pytest.approx(
        np.array(mechanism.joint_accelerations(*smooth_robot, numbers(drawn.torques))), abs=1e-8
    )


@FEW
@given(SEED)
def test_tree_friction_adaptation_keeps_coefficients_positive(seed: int) -> None:
    drawn = Drawn(seed, friction=True)
    draw = np.random.default_rng(seed)
    gradient, gamma = draw.normal(size=len(drawn.theta)), np.full(len(drawn.theta), 0.01)
    theta = adapted(drawn.model, drawn.theta, drawn.theta, gradient, gamma, 0.01, 5.0)
    bodies = len(drawn.theta) - 2 * len(VISCOUS)
    expected = np.maximum(0.0, drawn.theta[bodies:] - gradient[bodies:])
    assert theta[bodies:] == pytest.approx(expected, abs=1e-12)
    without = Drawn(seed)
    bodies_only = adapted(
        without.model, without.theta, without.theta, gradient[:bodies], gamma[:bodies], 0.01, 5.0
    )
    np.testing.assert_array_equal(theta[:bodies], bodies_only)


@FEW
@given(SEED)
def test_tree_inconsistent_parameters_have_a_separating_normal(seed: int) -> None:
    drawn = Drawn(seed)
    theta = drawn.robot.theta
    assert mechanism.weakest_motion(drawn.model, theta)[0] > 0.0
    draw = np.random.default_rng(seed)
    wrong = theta + draw.normal(size=len(theta)) * np.abs(theta).max()
    pivot, x = mechanism.weakest_motion(drawn.model, wrong)
    normal = np.array(mechanism.consistency_normal(drawn.model, x, drawn.theta))
    if pivot <= 0.0:
        assert normal @ wrong == pytest.approx(pivot, rel=1e-9, abs=1e-9)
        assert normal @ theta > 0.0


def test_tree_base_task_on_two_wheels_raises() -> None:
    with pytest.raises(InputError, match=r'expected robot\.base omnidirectional or fixed'):
        tree_mechanism({**parameters(), 'robot.task': 'base'})


def test_tree_robots_with_other_tasks_share_compiled_functions() -> None:
    """Records of robots of other sizes have the same type in compiled code."""
    made = [
        tree_mechanism({**parameters(), 'robot.task': task}) for task in ('planar', 'position')
    ]
    kinds = {type_of(plant_settings(robot)) for robot in made}
    assert len(kinds) == 1
    tags = {tag_of(plant_settings(robot).dtype, 'mechanism') for robot in made}
    assert {formulas_of_tag(tag).model_of for tag in tags} == {model_of}
