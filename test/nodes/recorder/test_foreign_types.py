# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recording of topics whose message types are not installed on the recorder's machine."""

from __future__ import annotations

from pathlib import Path
import signal
import subprocess
import sys
import textwrap

from helpers.child_environment import child_environment, domain_variables
from helpers.processes import PATIENCE, peer, processes
from masmc_ros.messages.cdr_layout import definition
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.duration import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WITHOUT = """
    import sys
    sys.modules['trajectory_msgs'] = sys.modules['trajectory_msgs.msg'] = None
    from masmc_ros.messages import cdr_layout
    for name in [n for n in cdr_layout._store().fielddefs if n.startswith('trajectory_msgs/')]:
        del cdr_layout._store().fielddefs[name]
    from masmc_ros.nodes.recorder.node import main
    sys.exit(main(sys.argv[1:]))
"""
"""Recorder on a machine without trajectory_msgs."""


def test_recorder_unknown_type_definition_from_publisher(tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    sent = JointTrajectory(joint_names=['shoulder', 'elbow'])
    sent.header.frame_id = 'somewhere'
    sent.points = [JointTrajectoryPoint(positions=[0.5 * n, 1.0]) for n in range(3)]
    with processes(tmp_path) as started, peer(started.domain) as tester:
        publisher = tester.publisher(JointTrajectory, 'foreign', latched=True)
        publisher.publish(sent)
        arguments = ['-p', f'output:={log}', '-p', 'extra_topics:=[foreign]']
        recorder = subprocess.Popen(
            [sys.executable, '-c', textwrap.dedent(WITHOUT), '--ros-args', *arguments],
            env={
                **child_environment(),
                **domain_variables(started.domain),
                'PYTHONUNBUFFERED': '1',
            },
        )
        try:
            tester.wait_for_subscribers(publisher)
            publisher.publish(sent)
            assert publisher.wait_for_all_acked(Duration(seconds=PATIENCE))
            recorder.send_signal(signal.SIGTERM)
            assert recorder.wait(PATIENCE) == 0
        finally:
            recorder.kill()
            recorder.wait()
    with log.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = [
            (schema.name, channel.metadata['topic_type_hash'], message)
            for schema, channel, _, message in reader.iter_decoded_messages(topics=['/foreign'])
        ]
    # The latched message and the later one.
    assert len(decoded) == 2
    for name, type_hash, message in decoded:
        assert name == 'trajectory_msgs/msg/JointTrajectory'
        assert type_hash == definition(name).type_hash
        assert message.header.frame_id == 'somewhere'
        assert list(message.joint_names) == ['shoulder', 'elbow']
        expected = [[0.0, 1.0], [0.5, 1.0], [1.0, 1.0]]
        assert [list(point.positions) for point in message.points] == expected
