# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Topics of the robot: its state at every tick; other quantities and the display less often."""

from __future__ import annotations

from geometry_msgs.msg import Twist
from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import bound
from masmc_ros.log.traced_paths import ActualPath
from masmc_ros.loop.plant_parameters import CLOCK_DECIMATION, ODOM_DECIMATION, TF_DECIMATION
from masmc_ros.loop.signals import largest_slip
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import Timing
from masmc_ros.messages import topics
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import string_message
from masmc_ros.messages.platform_messages import OdometryCdr, TimeCdr, TwistCdr
from masmc_ros.messages.telemetry import TelemetryCdr
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.nodes.middleware.ros_topics import DEEP, raw_class
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.params.declaration import MutableValues
from masmc_ros.robot.mechanisms import check_frame_prefix, FRAME_PREFIX, joint_names
from masmc_ros.robot.robot import robot_description, robot_of
from nav_msgs.msg import Odometry, Path
import numpy as np
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String


class RobotDisplay:
    """Publishers of a robot's description, frames and path."""

    def __init__(self, values: MutableValues) -> None:
        """
        Initialise with the checked values of the plant, and compile the kernels.

        Raises InputError for an invalid prefix of frame names.
        """
        robot, prefix = robot_of(values), check_frame_prefix(FRAME_PREFIX.of(values))
        self._timing = Timing.from_values(values)
        self._decimation = TF_DECIMATION.of(values)
        self._description = string_message(robot_description(values, prefix))
        self._prefix = prefix
        self._message = TransformsCdr(prefix, robot.mechanism.frames)
        self._path = ActualPath(self._timing, robot, prefix)
        self._position = np.zeros((1, len(robot.mechanism.positions)))
        if self._path.takes(0):
            self._path.add(0, self._position[0])
        self._origins = robot.frame_origins
        transforms = robot.mechanism.formulas.frame_transforms
        self._frames = bound(transforms, self._origins, self._position)

    def connect(self, node: SuiteNode) -> None:
        """Create the topics and publish the description."""
        self._transforms: Publisher | None = None
        if self._decimation:
            try:
                message_type = raw_class(topics.TRANSFORMS.type_name)
            except InputError as error:
                node.log.warning(f'no {topics.TRANSFORMS.name}: {error}')
            else:
                topic = topics.transforms_topic(node.node.get_namespace(), self._prefix)
                self._transforms = node.publisher(message_type, topic)
        self._paths = node.latched(Path, topics.ACTUAL_PATH_TOPIC)
        description = node.latched(String, topics.DESCRIPTION_TOPIC)
        description.publish(self._description)

    def show(self, tick: int, position: Array) -> None:
        """Publish frames and path if they are due; `position` is in the order of joint_states."""
        if self._transforms is not None and (
            tick % self._decimation == 0 or tick == self._timing.last
        ):
            self._position[:] = position
            transforms = self._frames(self._origins, self._position)[0]
            self._transforms.publish(self._message.fill(self._timing.stamp(tick), transforms))
        if self._path.takes(tick):
            path = self._path.add(tick, position)
            if path is not None:
                self._paths.publish(path)


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
        self._odom_decimation = ODOM_DECIMATION.of(values)
        self._clock_decimation = CLOCK_DECIMATION.of(values)
        self._display = RobotDisplay(values)
        state = JointStateCdr(joint_names(values))
        self._state = state.writer(robot.position, robot.velocity, robot.applied)
        self._sent = b''
        self._odometry = OdometryCdr(FRAME_PREFIX.of(values), robot.mechanism.frames[0][1])
        self._twist = TwistCdr()
        self._slip = 0.0
        self._contact = TelemetryCdr(topics.CONTACT_LABEL, len(robot.contact))
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
            self._contacts = node.publisher(Float64MultiArray, topics.CONTACT_TOPIC, depth)
        self._clock = node.stream(Clock, topics.CLOCK_TOPIC)
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
