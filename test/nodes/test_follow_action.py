# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Action FollowJointTrajectory: rules of goals, and the server where control_msgs is installed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import time
from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Duration
from helpers.processes import PAPER, peer, processes, ros_arguments
from masmc_ros.errors import InputError
from masmc_ros.loop.timing import Timing
from masmc_ros.nodes.trajectory.follow_action import (
    ACTION,
    Feedback,
    FollowedGoal,
    GOAL_TOLERANCE_VIOLATED,
    INVALID_GOAL,
    Outcome,
    PATH_TOLERANCE_VIOLATED,
    SUCCESSFUL,
)
from masmc_ros.nodes.trajectory.path_messages import PathMessages, PathRequest
from masmc_ros.nodes.trajectory.received_paths import ReceivedPaths
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.mechanisms import joint_names
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

VALUES = load_scenario(str(PAPER))['trajectory']
NAMES = joint_names(VALUES)
ROBOT = robot_of(VALUES)
START = np.array([0.0, 0.0, 1.57, 0.0, 0.0, 0.8, -1.5])
FIRST = 2500
"""First tick of a path in lock-step, for which no sample was sent."""


def plan(names: Sequence[str], *positions: Sequence[float]) -> JointTrajectory:
    """Return a plan with a point at each second, at rest there."""
    message = JointTrajectory(joint_names=list(names))
    for second, values in enumerate(positions, 1):
        point = JointTrajectoryPoint(positions=list(values), velocities=[0.0] * len(names))
        point.time_from_start.sec = second
        message.points.append(point)
    return message


ARM = plan(['arm_joint_2', 'arm_joint_1'], [-1.4, 0.9], [-1.3, 1.0])


def goal_of(trajectory: JointTrajectory = ARM, **changes: Any) -> Any:
    """Return a goal with the fields of FollowJointTrajectory.Goal."""
    fields = {
        'trajectory': trajectory,
        'multi_dof_trajectory': MultiDOFJointTrajectory(),
        'path_tolerance': [],
        'goal_tolerance': [],
        'goal_time_tolerance': Duration(),
    }
    return SimpleNamespace(**{**fields, **changes})


def tolerance(name: str, position: float) -> Any:
    return SimpleNamespace(name=name, position=position, velocity=0.0, acceleration=0.0)


def request_of(trajectory: JointTrajectory, topic: str = ACTION) -> PathRequest:
    read = PathMessages(ROBOT.mechanism, NAMES, '').topics['trajectory/joint_trajectory'][1]
    return read(topic, serialize_message(trajectory))


class Run:
    """Paths of the paper's robot, and goals that follow them."""

    def __init__(self) -> None:
        self.timing = Timing.from_values(VALUES)
        trajectory = Trajectory(VALUES, self.timing.period, ROBOT)
        self.paths = ReceivedPaths(trajectory, ROBOT, self.timing, VALUES)

    def accept(self, goal: Any) -> FollowedGoal:
        request = request_of(goal.trajectory)
        followed = FollowedGoal(goal, request, NAMES, is_planar=True)
        self.take(request)
        return followed

    def take(self, request: PathRequest) -> None:
        self.paths.wait(request, unsent=FIRST, tick=500, origin_ns=0)
        deadline = time.monotonic() + 60.0
        while self.paths.is_loading:
            assert time.monotonic() < deadline
            time.sleep(0.001)

    def update(self, goal: FollowedGoal, tick: int, **off: float) -> Outcome | Feedback | None:
        """Update a goal with the joints on their path, except some that are off by a distance."""
        state = self.paths.joints_at(tick)
        position = START.copy() if state is None else state.position.copy()
        for name, distance in off.items():
            position[NAMES.index(name)] += distance
        return goal.update(self.paths, self.timing, tick, position)


def test_goal_is_followed_to_its_end_with_feedback() -> None:
    run = Run()
    goal = run.accept(goal_of())
    assert run.update(goal, FIRST - 1) is None
    assert run.paths.start(FIRST, START) == FIRST
    middle = run.update(goal, FIRST + 1500, arm_joint_1=0.01)
    assert isinstance(middle, Feedback)
    assert goal.names == ['arm_joint_2', 'arm_joint_1']
    assert middle.time == pytest.approx(1500 * run.timing.period)
    assert middle.error == pytest.approx([0.0, 0.01])
    assert (middle.actual - middle.desired == middle.error).all()
    assert np.abs(middle.velocities).max() > 0.0
    assert isinstance(run.update(goal, run.paths.end - 1), Feedback)
    assert run.update(goal, run.paths.end) == Outcome('succeed', SUCCESSFUL, '')


def test_joint_off_its_path_ends_the_goal() -> None:
    run = Run()
    goal = run.accept(goal_of(path_tolerance=[tolerance('arm_joint_1', 0.1)]))
    run.paths.start(FIRST, START)
    assert isinstance(run.update(goal, FIRST + 10, arm_joint_1=0.099, arm_joint_2=1.0), Feedback)
    end = run.update(goal, FIRST + 1000, arm_joint_1=-0.2)
    assert isinstance(end, Outcome)
    assert end[:2] == ('abort', PATH_TOLERANCE_VIOLATED)
    assert end.text == 'arm_joint_1 is 0.2 from the path at t = 3.5 s; expected at most 0.1'


@pytest.mark.parametrize('patience', [0, 2])
def test_joint_off_the_goal_ends_it_after_the_time(patience: int) -> None:
    run = Run()
    goal = run.accept(
        goal_of(
            goal_tolerance=[tolerance('arm_joint_2', 0.05)],
            goal_time_tolerance=Duration(sec=patience),
        )
    )
    run.paths.start(FIRST, START)
    last = run.paths.end
    assert isinstance(run.update(goal, last + 1999, arm_joint_2=0.1), Feedback)
    end = run.update(goal, last + 2001, arm_joint_2=0.1)
    if patience:
        assert isinstance(end, Outcome)
        assert end[:2] == ('abort', GOAL_TOLERANCE_VIOLATED)
        assert 'arm_joint_2 is 0.1 from the goal' in end.text
    else:
        assert isinstance(end, Feedback)
        end = run.update(goal, last + 90_000, arm_joint_2=0.04)
        assert end == Outcome('succeed', SUCCESSFUL, '')


def test_yaw_of_the_base_counts_within_half_a_turn() -> None:
    run = Run()
    goal = run.accept(
        goal_of(
            plan(['base_yaw_joint'], [1.7]), path_tolerance=[tolerance('base_yaw_joint', 0.1)]
        )
    )
    run.paths.start(FIRST, START)
    turned = run.update(goal, FIRST + 500, base_yaw_joint=2.0 * np.pi + 0.01)
    assert isinstance(turned, Feedback)
    assert turned.error == pytest.approx([0.01])


def test_newer_path_ends_a_goal_and_is_named() -> None:
    run = Run()
    goal = run.accept(goal_of())
    run.paths.start(FIRST, START)
    run.take(request_of(ARM, 'trajectory/joint_trajectory'))
    # It may still be rejected at its start.
    assert isinstance(run.update(goal, FIRST + 5), Feedback)
    run.paths.start(FIRST + 10, START)
    assert run.update(goal, FIRST + 10) == Outcome(
        'abort', INVALID_GOAL, 'replaced by trajectory/joint_trajectory'
    )


def test_reset_robot_ends_a_goal() -> None:
    run = Run()
    goal = run.accept(goal_of())
    run.paths.start(FIRST, START)
    run.paths.reset()
    assert run.update(goal, 0) == Outcome(
        'abort', INVALID_GOAL, 'replaced by the trajectory of the parameters'
    )


def test_cancelled_and_rejected_goals_end_at_the_next_state() -> None:
    run = Run()
    goal = run.accept(goal_of())
    goal.rejection = 'arm_joint_1 is too fast'
    assert run.update(goal, 1) == Outcome('abort', INVALID_GOAL, 'arm_joint_1 is too fast')
    goal.is_cancelled = True
    end = run.update(goal, 1)
    assert isinstance(end, Outcome)
    assert end.kind == 'canceled'


@pytest.mark.parametrize(
    ('goal', 'error'),
    [
        (goal_of(JointTrajectory()), 'no points; expected some'),
        (goal_of(plan(['arm_joint1'], [0.0])), "unknown joint 'arm_joint1'; did you mean arm_"),
        (goal_of(plan(['arm_joint_1'], [np.nan])), 'not finite'),
        (
            goal_of(path_tolerance=[tolerance('arm_joint_3', 0.1)]),
            "path_tolerance: unknown joint 'arm_joint_3'",
        ),
        (
            goal_of(
                multi_dof_trajectory=MultiDOFJointTrajectory(
                    points=[MultiDOFJointTrajectoryPoint()]
                )
            ),
            'multi_dof_trajectory has points; expected none',
        ),
    ],
)
def test_wrong_goal_is_rejected_with_one_line(goal: Any, error: str) -> None:
    with pytest.raises(InputError, match=error) as caught:
        FollowedGoal(goal, request_of(goal.trajectory), NAMES, is_planar=True)
    assert '\n' not in str(caught.value)


def test_server_ends_goals_as_their_clients_expect(tmp_path: Path) -> None:
    """Of a goal that succeeds, one that is replaced, one that is cancelled, and a wrong one."""
    pytest.importorskip('control_msgs')
    from action_msgs.msg import GoalStatus
    from control_msgs.action import FollowJointTrajectory
    from rclpy.action import ActionClient

    arguments = ros_arguments(PAPER, duration=0.0, plant__max_real_time_factor=2.0)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        nodes = started.start_all(*arguments, nodes=('trajectory', 'controller', 'plant'))
        client = ActionClient(tester.node, FollowJointTrajectory, ACTION)
        tester.until(client.server_is_ready, started.output)
        feedback: list[Any] = []

        def send(trajectory: JointTrajectory) -> Any:
            goal = FollowJointTrajectory.Goal(trajectory=trajectory)
            sent = client.send_goal_async(goal, feedback_callback=feedback.append)
            tester.until(sent.done, started.output)
            return sent.result()

        def result(handle: Any) -> Any:
            assert handle.accepted
            ended = handle.get_result_async()
            tester.until(ended.done, started.output)
            return ended.result()

        end = result(send(ARM))
        assert (end.status, end.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, SUCCESSFUL)
        assert feedback[-1].feedback.joint_names == ['arm_joint_2', 'arm_joint_1']
        assert np.abs(feedback[-1].feedback.error.positions).max() < 0.1
        first, second = send(ARM), send(ARM)
        end = result(first)
        assert end.status == GoalStatus.STATUS_ABORTED
        assert end.result.error_string == f'replaced by {ACTION}'
        tester.until(second.cancel_goal_async().done, started.output)
        assert result(second).status == GoalStatus.STATUS_CANCELED
        assert not send(plan(['arm_joint1'], [0.0])).accepted
        assert nodes['trajectory'].logged('WARN', f"{ACTION} rejected: unknown joint 'arm_joint1'")
        # The reference of the controller continues.
        torques = tester.collect(Float64MultiArray, 'effort_commands', raw=True)
        tester.until(lambda: len(torques) > 10, started.output)
