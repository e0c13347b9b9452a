# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Real-time run with clients that compete for the reference: `python -m benchmarks.soak --fight`.

Three clients at a time send paths of all kinds in random order, stop the reference, and change the
trajectory of the parameters. Every few seconds one of them is killed (SIGKILL) and another one
starts. The log then shows whether a tick lacked a reference, whether the reference jumped, and the
largest error. The run is also computed again from its log.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math
from pathlib import Path
import select
import subprocess
import sys
import tempfile
import time

from benchmarks.live_nodes import end, memory, realtime_nodes
from geometry_msgs.msg import PoseStamped, Transform, Twist, TwistStamped
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.simulation import Simulation, TimedSimulation
from masmc_ros.report.measure.recomputed import logged_responses, Recomputed
from masmc_ros.scenario.scenario import logged_scenario, logged_trajectory
from nav_msgs.msg import Path as PathMessage
import numpy as np
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.wait_for_message import wait_for_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

NODES = ('trajectory', 'controller', 'plant', 'recorder')
CLIENTS = 3
LARGEST_ERROR = 0.2
"""Largest error of E and F in m after the start."""

LARGEST_JUMP = 1e-5
"""Largest difference in m of a step of the reference from its velocities at both ends."""

LARGEST_GROWTH = 0.05
"""Largest growth of the memory of a node after a quarter of the run, as a share of it."""

_LIMITS = '[8.0, 8.0, 20.0, 10.0]'
_SETTINGS = {
    'controller.switching': 'implicit',
    'controller.observer_gain': 0.55,
    'controller.torque_limit': _LIMITS,
    'plant.torque_limit': _LIMITS,
    # A machine that is busy with clients delays the trajectory node.
    'trajectory.path_lead': 0.5,
}
_SETTLED = 2.0
"""Time in s of the approach at the start."""

_STEADY = 60.0
"""Length of a run in s from which on its memory is judged; before, code is loaded."""

_START = 90.0
"""Time in s within which the nodes start; laws may have to be compiled."""

_TYPES = ('arc', 'line_sine', 'figure_eight')


class Client:
    """Node that sends paths of random kinds."""

    def __init__(self, seed: int) -> None:
        """Initialise the node, whose messages follow from a seed."""
        self._rng = np.random.default_rng(seed)
        self._node = Node(f'client_{seed}')
        self._types = self._node.create_client(SetParameters, 'trajectory/set_parameters')
        create = self._node.create_publisher
        self._joints = create(JointTrajectory, 'trajectory/joint_trajectory', 10)
        self._bodies = create(MultiDOFJointTrajectory, 'trajectory/multi_dof_trajectory', 10)
        self._poses = {
            name: create(PoseStamped, f'trajectory/{name}', 10) for name in ('goal', 'base_goal')
        }
        self._paths = {
            name: create(PathMessage, f'trajectory/{name}', 10) for name in ('path', 'base_path')
        }
        self._twist = create(Twist, 'reference/cmd_vel', 10)
        self._stamped = create(TwistStamped, 'reference/cmd_vel_stamped', 10)

    def run(self, duration: float) -> None:
        """Send for a duration in s."""
        kinds: list[Callable[[], None]] = [
            self._stop, self._plan, self._goal, self._path, self._body, self._teleoperate,
            self._type,
        ]
        last = time.monotonic() + duration
        while time.monotonic() < last:
            kinds[self._rng.integers(len(kinds))]()
            print('sent', flush=True)
            rclpy.spin_once(self._node, timeout_sec=0.0)
            time.sleep(self._rng.uniform(0.1, 1.5))

    def _one_of(self, publishers: Mapping[str, Publisher]) -> Publisher:
        return publishers[str(self._rng.choice(list(publishers)))]

    def _stop(self) -> None:
        self._joints.publish(JointTrajectory())

    def _plan(self) -> None:
        plan = JointTrajectory(joint_names=['arm_joint_1', 'arm_joint_2'])
        for seconds in (3, 6):
            angles = np.array([0.8, -1.4]) + self._rng.uniform(-0.5, 0.5, 2)
            point = JointTrajectoryPoint(positions=angles.tolist())
            point.time_from_start.sec = seconds
            plan.points.append(point)
        self._joints.publish(plan)

    def _pose(self) -> PoseStamped:
        pose = PoseStamped()
        pose.header.frame_id = 'odom'
        pose.pose.position.x, pose.pose.position.y = self._rng.uniform(-1.0, 1.0, 2).tolist()
        pose.pose.orientation.w = 1.0
        return pose

    def _goal(self) -> None:
        self._one_of(self._poses).publish(self._pose())

    def _path(self) -> None:
        path = PathMessage(poses=[self._pose() for _ in range(3)])
        path.header.frame_id = 'odom'
        self._one_of(self._paths).publish(path)

    def _body(self) -> None:
        plan = MultiDOFJointTrajectory(joint_names=['base_link'])
        plan.header.frame_id = 'odom'
        for seconds in (4, 8):
            place = Transform()
            place.translation.x, place.translation.y = self._rng.uniform(-1.0, 1.0, 2).tolist()
            point = MultiDOFJointTrajectoryPoint(transforms=[place])
            point.time_from_start.sec = seconds
            plan.points.append(point)
        self._bodies.publish(plan)

    def _teleoperate(self) -> None:
        for _ in range(8):
            twist = Twist()
            twist.linear.x = self._rng.uniform(-0.3, 0.3)
            twist.angular.z = self._rng.uniform(-0.5, 0.5)
            if self._rng.random() < 0.5:
                self._twist.publish(twist)
            else:
                self._stamped.publish(TwistStamped(twist=twist))
            time.sleep(0.1)

    def _type(self) -> None:
        if self._types.service_is_ready():
            value = Parameter('type', value=str(self._rng.choice(_TYPES)))
            request = SetParameters.Request(parameters=[value.to_parameter_msg()])
            self._types.call_async(request)


def _fight(seconds: float, seed: int, check: Callable[[], None]) -> tuple[int, int]:
    """Start and kill clients for a time in s; return their number and that of kills."""
    clients: list[subprocess.Popen[bytes]] = []
    started = killed = 0
    last = math.inf
    try:
        while time.monotonic() < last:
            while len(clients) < CLIENTS:
                command = [sys.executable, '-m', __name__, str(seed + started)]
                clients.append(subprocess.Popen(command, stdout=subprocess.PIPE))
                started += 1
            if last == math.inf:
                # The first line of the first client.
                assert clients[0].stdout is not None
                select.select([clients[0].stdout], [], [], _START)
                last = time.monotonic() + seconds
            time.sleep(min(4.0, max(0.0, last - time.monotonic())))
            check()
            killed += clients[0].poll() is None
            clients[0].kill()
            clients[0].communicate()
            clients = [client for client in clients if client.poll() is None]
    finally:
        for client in clients:
            client.kill()
            client.communicate()
    return started, killed


def _wait_for_robot() -> None:
    """Wait until the robot moves."""
    rclpy.init()
    try:
        has_state, _ = wait_for_message(
            JointState, Node('fight'), 'joint_states', time_to_wait=_START
        )
    finally:
        rclpy.shutdown()
    if not has_state:
        raise SystemExit(f'no state of the robot within {_START:g} s')


def fight(seconds: float, seed: int, period: float, pacing: str = 'realtime') -> bool:
    """
    Run, print the figures, and return True if all are within their limits.

    Parameters
    ----------
    seconds
        Length in s.
    seed
        Seed of the clients.
    period
        Control period in s.
    pacing
        Pacing of the nodes. In lock-step the robot is at most as fast as in real time; velocities
        are rejected, and the limits hold on any machine.

    """
    sizes: dict[str, list[float]] = {node: [] for node in NODES}
    settings = {
        **_SETTINGS,
        **{f'{node}.pacing': pacing for node in NODES[:3]},
        'plant.max_real_time_factor': 1.0,
    }
    with (
        tempfile.TemporaryDirectory() as folder,
        realtime_nodes(Path(folder), period, *NODES, settings=settings) as processes,
    ):
        def check() -> None:
            for node, process in processes.items():
                if process.poll() is not None:
                    raise SystemExit(f'{node} ended with status {process.returncode}')
                sizes[node].append(memory(process.pid))

        _wait_for_robot()
        clients, kills = _fight(seconds, seed, check)
        statuses = end(processes)
        figures, is_well = _judged(Path(folder) / 'run.mcap')
    print(f'{clients} clients, {kills} of them killed; seed {seed}')
    print(figures)
    for node, values in sizes.items():
        before, after = values[len(values) // 4], values[-1]
        grows = seconds >= _STEADY and after > before * (1.0 + LARGEST_GROWTH)
        is_well &= statuses[node] == 0 and not grows
        print(f'{node:>10}: {before:.1f} MiB, then {after:.1f} MiB; status {statuses[node]}')
    return is_well


def _judged(log: Path) -> tuple[str, bool]:
    """Return the figures of a log as text, and True if they are within their limits."""
    run = read_run(log)
    assert run.reference is not None
    errors = run.telemetry['error']
    largest = float(np.nanmax(np.abs(errors.values[errors.times > _SETTLED])))
    missing = int(np.isnan(run.reference).any(axis=1).sum())
    position, velocity, _ = np.split(run.reference, 3, axis=1)
    step = 0.5 * np.diff(run.times)[:, None] * (velocity[1:] + velocity[:-1])
    jump = float(np.nanmax(np.abs(np.diff(position, axis=0) - step)))
    paths = sum(change.event == 'path received' for change in run.changes)
    values, changes = logged_scenario(run)
    responses, samples = logged_responses(run, values), logged_trajectory(run)
    comparison = Recomputed(run, responses)
    if responses is None:
        simulation = Simulation(values, changes, samples)
    else:
        simulation = TimedSimulation(values, changes, samples, responses)
    for block in simulation.run():
        comparison.compare(block, simulation.timing)
    figures = (
        f'{len(run.times)} states, {paths} paths; {missing} states without a reference, largest '
        f'jump of the reference {1e6 * jump:.2g} µm, largest error {1e3 * largest:.3g} mm\n'
        f'{comparison.verdict(is_changed=False)}'
    )
    counts = comparison.counts()
    is_well = responses is not None or counts['states'] == counts['identical_states']
    is_well &= not missing and jump < LARGEST_JUMP and largest < LARGEST_ERROR and paths > 0
    return figures, is_well


if __name__ == '__main__':
    rclpy.init()
    Client(int(sys.argv[1])).run(12.0)
