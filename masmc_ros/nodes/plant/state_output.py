# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Topics of the robot: its state at every tick, and derived quantities less often."""

from __future__ import annotations

from geometry_msgs.msg import Twist
from masmc_ros.loop.signals import largest_slip
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.names import CLOCK_TOPIC, CONTACT_LABEL, CONTACT_TOPIC
from masmc_ros.messages.platform_messages import OdometryCdr, TimeCdr, TwistCdr
from masmc_ros.messages.telemetry import TelemetryCdr
from masmc_ros.nodes.middleware.qos import DEEP
from masmc_ros.nodes.plant.robot_display import RobotDisplay
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.params.declaration import MutableValues
from masmc_ros.robot.joint_names import joint_names
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray


class StateOutput:
    """Publishers of joint_states, odom, base_twist, contact, clock and the display."""

    def __init__(self, robot: SimulatedRobot, timing: Timing, values: MutableValues) -> None:
        """
        Initialise the messages.

        Parameters
        ----------
        robot
            Robot whose state is published.
        timing
            Control period and number of ticks of the run.
        values
            Checked parameter values of the plant.

        """
        self._robot, self._timing = robot, timing
        self._odom_decimation: int = values['odom_decimation']
        self._clock_decimation: int = values['clock_decimation']
        self._display = RobotDisplay(values)
        state = JointStateCdr(joint_names(values))
        self._state = state.writer(robot.position, robot.velocity, robot.applied)
        self._sent = b''
        self._odometry = OdometryCdr(values['frame_prefix'], robot.mechanism.frames[0][1])
        self._twist = TwistCdr()
        self._slip = 0.0
        self._contact = TelemetryCdr(CONTACT_LABEL, len(robot.contact))
        self._time = TimeCdr()
        self._base_motion = robot.mechanism.formulas.base_motion
        # The first call compiles the kernel, or loads it.
        self._base_motion(robot.position[None], robot.velocity[None])

    def connect(self, node: SuiteNode) -> None:
        """Create the topics."""
        self._states = node.publisher(JointState, 'joint_states')
        # The same time span of past messages as that of the states.
        depth = max(1, DEEP // self._odom_decimation)
        self._odom = node.publisher(Odometry, 'odom', depth)
        self._base_twist = node.publisher(Twist, 'base_twist', depth)
        if len(self._contact.values):
            self._contacts = node.publisher(Float64MultiArray, CONTACT_TOPIC, depth)
        self._clock = node.stream(Clock, CLOCK_TOPIC)
        self._display.connect(node)

    @property
    def topic(self) -> str:
        """Return the full name of joint_states."""
        return str(self._states.topic_name)

    def publish(self, stamp: int) -> None:
        """Publish the robot's state with a stamp in ns, and the other topics that are due."""
        tick = self._robot.tick
        # The state is first: the controller computes while the plant sends the other topics.
        self._sent = self._state(stamp)
        self._states.publish(self._sent)
        last = tick == self._timing.last
        if last or tick % self._odom_decimation == 0:
            self._publish_motion(stamp)
        if self._clock_decimation and (last or tick % self._clock_decimation == 0):
            self._time.set_stamp(stamp)
            self._clock.publish(self._time.to_bytes())
        self._display.show(tick, self._robot.position)

    def send_again(self) -> None:
        """Publish the last state again."""
        self._states.publish(self._sent)

    def slip_since(self) -> float | None:
        """Return the fastest slip in m/s since the last call, None if wheels cannot slip."""
        if not len(self._contact.values):
            return None
        slip, self._slip = self._slip, 0.0
        return slip

    def _publish_motion(self, stamp: int) -> None:
        pose, twist = self._base_motion(self._robot.position[None], self._robot.velocity[None])
        odometry, velocity = self._odometry, self._twist
        odometry.set_stamp(stamp)
        odometry.position[:], odometry.orientation[:] = pose[0, :3], pose[0, 3:]
        odometry.linear[:], odometry.angular[:] = twist[0, :3], twist[0, 3:]
        self._odom.publish(odometry.to_bytes())
        velocity.linear[:], velocity.angular[:] = twist[0, :3], twist[0, 3:]
        self._base_twist.publish(velocity.to_bytes())
        if len(self._contact.values):
            self._contact.set_stamp(stamp)
            self._contact.values[:] = self._robot.contact
            self._contacts.publish(self._contact.to_bytes())
            self._slip = max(self._slip, largest_slip(self._robot.contact))
