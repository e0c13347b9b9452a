# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs read from logs of this project and of other recorders."""

import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from helpers.logged_runs import ARRAY, numbers, part, STATE, write_numbers, write_run
from masmc_ros.errors import InputError
from masmc_ros.log.codec import ChannelRows
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.loop.signals import CONTACT, PUBLISHED
from masmc_ros.messages.cdr_layout import definition
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import string_message
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.platform_messages import OdometryCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.telemetry import telemetry_messages
from masmc_ros.messages.topics import CONTACT_LABEL, JOINTS, ODOMETRY, STRING
from masmc_ros.report.measure.metrics import metrics
from mcap.writer import Writer
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)


@pytest.mark.parametrize('namespace', ['/', '/left_robot/', '/hall/left_robot/'])
def test_read_run_round_trip_restores_run(tmp_path: Path, namespace: str) -> None:
    path = tmp_path / 'run.mcap'
    # Stamp labels with one, two and three digits of seconds occur.
    written = numbers(1200, period_ns=100_000_000)
    write_run(path, written, namespace)
    run = read_run(path)
    seconds = written.stamps / 1e9
    assert run.path == path
    assert np.array_equal(run.times, seconds)
    assert np.array_equal(run.torque.times, seconds)
    assert np.array_equal(run.position, written.position)
    assert np.array_equal(run.velocity, written.velocity)
    assert np.array_equal(run.applied_effort, written.effort[:, 3:])
    assert np.array_equal(run.torque.values, written.torque)
    assert run.reference is not None
    assert np.array_equal(run.reference, written.reference)
    for signal in PUBLISHED:
        recorded = run.telemetry[signal.name]
        assert np.array_equal(recorded.values, written.telemetry[signal.label])
        assert np.array_equal(recorded.times, seconds)
    assert run.topics[f'{namespace}joint_states'] == 1200
    assert len(run.topics) == 3 + len(PUBLISHED)
    assert run.metadata == {'origin': [{'law': 'smc'}]}
    assert run.attachments == {'paper.yaml': b'plant: {}'}


def test_read_run_states_only_is_a_run(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    write_run(path, numbers(10), everything=False)
    run = read_run(path)
    assert len(run.times) == 10
    assert run.torque.values.shape == (0, 4)
    assert run.torque.times.shape == (0,)
    assert run.reference is None
    assert run.telemetry == {}


def rosbags_message(type_name: str, **fields: Any) -> bytes:
    """Return a message serialised by rosbags."""
    return bytes(STORE.serialize_cdr(STORE.types[type_name](**fields), type_name))


def foreign_state(stamp_ns: int, names: list[str], values: list[float]) -> bytes:
    """Return a joint state with joints in any order and no efforts."""
    time = STORE.types['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 10**9))
    return rosbags_message(
        STATE,
        header=STORE.types['std_msgs/msg/Header'](stamp=time, frame_id='world'),
        name=names,
        position=np.array(values),
        velocity=np.array(values) + 100.0,
        effort=np.array([]),
    )


def foreign_array(data: list[float], labels: list[str], data_offset: int = 0) -> bytes:
    """Return an array with these labels and sizes of 0."""
    dimension = STORE.types['std_msgs/msg/MultiArrayDimension']
    layout = STORE.types['std_msgs/msg/MultiArrayLayout'](
        dim=[dimension(label=label, size=0, stride=0) for label in labels],
        data_offset=data_offset,
    )
    return rosbags_message(ARRAY, layout=layout, data=np.array(data))


def test_read_run_void_commands_are_marked(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    command = EffortCdr()
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        commands = log.channel('/effort_commands', ARRAY)
        log.write(states, 0, JointStateCdr().to_bytes())
        for stamp, is_void in enumerate((True, False, True)):
            command.set_stamp(stamp)
            command.is_void = is_void
            log.write(commands, stamp, command.to_bytes())
        # An array of another program, void and not.
        log.write(commands, 10, foreign_array([0.0, 0.0, 0.0, 0.0], [], 4))
        log.write(commands, 11, foreign_array([0.0, 0.0, 0.0, 0.0], [], 0))
    torque = read_run(path).torque
    assert torque.stamps.tolist() == [0, 1, 2, 10, 11]
    assert torque.is_void is not None
    assert torque.is_void.tolist() == [True, False, True, True, False]
    assert torque.values.shape == (5, 4)
    assert not torque.values.any()


def test_read_run_messages_of_other_senders_are_merged(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    ours = JointStateCdr()
    ours.position[:] = np.arange(7)
    command = EffortCdr()
    command.data[:] = [1.0, 2.0, 3.0, 4.0]
    order = ['camera', *reversed(JOINTS)]
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        commands = log.channel('/effort_commands', ARRAY)
        errors = log.channel('/controller/tracking_error', ARRAY)
        log.write(states, 0, ours.to_bytes())
        log.write(states, 1, foreign_state(10**9, order, [float(n) for n in range(8)]))
        log.write(states, 2, foreign_state(2 * 10**9, ['camera'], [1.0]))
        log.write(commands, 0, command.to_bytes())
        log.write(commands, 10, foreign_array([5.0, 6.0, 7.0, 8.0], []))
        log.write(commands, 0, foreign_array([5.0, 6.0, 7.0], []))
        log.write(commands, 0, foreign_array([9.0, 9.0, 9.0, 9.0], ['effort@3.7']))
        log.write(errors, 0, foreign_array([1.0, 5.0, 1.0, 2.0, 3.0, 4.0], ['e'], 2))
        log.write(errors, 0, foreign_array([1.0, 2.0, 3.0, 4.0], ['e']))
    run = read_run(path)
    assert run.times.tolist() == [0.0, 1.0]
    assert run.position.tolist() == [[0, 1, 2, 3, 4, 5, 6], [7, 6, 5, 4, 3, 2, 1]]
    assert run.velocity[1].tolist() == [107, 106, 105, 104, 103, 102, 101]
    assert run.torque.values.tolist() == [[1, 2, 3, 4], [5, 6, 7, 8], [9, 9, 9, 9]]
    # Without a label, the time since the last state is that of the log times.
    assert run.torque.times.tolist() == [0.0, 1.000000009, 3.000000007]
    assert list(run.telemetry) == ['error']
    assert run.telemetry['error'].values.tolist() == [[1, 2, 3, 4]]
    assert run.telemetry['error'].times.tolist() == [1.000000005]


def test_read_run_messages_of_rclpy_are_read(tmp_path: Path) -> None:
    pytest.importorskip('rclpy', reason='serialises with ROS 2')
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import JointState

    path = tmp_path / 'run.mcap'
    with LogWriter(path, live=True) as log:
        states = log.channel('/joint_states', STATE)
        for number in range(50):
            message = JointState(
                name=list(JOINTS),
                position=[float(number)] * 7,
                velocity=[0.0] * 7,
                effort=[1.0] * 7,
            )
            message.header.stamp.nanosec = number
            log.write(states, number, serialize_message(message))
    run = read_run(path)
    assert run.position[:, 3].tolist() == list(range(50))
    assert (run.applied_effort == 1.0).all()


def test_read_run_set_point_of_other_sender_is_reference(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    state = JointStateCdr()
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        reference = log.channel('/reference', ARRAY)
        for stamp in range(4):
            state.set_stamp(10 * stamp)
            log.write(states, 10 * stamp, state.to_bytes())
        log.write(reference, 20, foreign_array([1.0, 2.0, 3.0, 4.0], []))
        log.write(reference, 30, foreign_array([1.0, 2.0, 3.0], []))
    run = read_run(path)
    assert run.reference is not None
    assert np.isnan(run.reference[:2]).all()
    assert run.reference[2:].tolist() == [[1, 2, 3, 4] + [0] * 8] * 2


def test_read_run_after_reset_keeps_last_pass(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    state, command = JointStateCdr(), EffortCdr()
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        commands = log.channel('/effort_commands', ARRAY)
        for count, ticks in enumerate([5, 3]):
            for tick in range(ticks):
                state.set_stamp(tick * 10**9)
                state.position[0] = 10 * count + tick
                command.set_stamp(tick * 10**9)
                command.data[0] = 10 * count + tick
                log.write(states, tick, state.to_bytes())
                log.write(commands, tick, command.to_bytes())
        log.write(states, 2, state.to_bytes())
    run = read_run(path)
    assert run.times.tolist() == [0.0, 1.0, 2.0]
    assert run.position[:, 0].tolist() == [10.0, 11.0, 12.0]
    assert run.torque.times.tolist() == [0.0, 1.0, 2.0]
    assert run.torque.values[:, 0].tolist() == [10.0, 11.0, 12.0]
    assert run.topics['/joint_states'] == 9


def test_read_run_contact_after_foreign_message_is_read(tmp_path: Path) -> None:
    path, written = tmp_path / 'run.mcap', numbers(20)
    values = np.arange(20 * 2 * len(CONTACT), dtype=float).reshape(20, -1)
    with LogWriter(path) as log:
        contact = log.channel('/plant/contact', ARRAY)
        log.write(contact, 0, b'\0\1\0\0of another type')
        states = log.channel('/joint_states', STATE)
        rows = telemetry_messages(CONTACT_LABEL, written.stamps, values)
        log.write_rows([
            ChannelRows(states, written.stamps, written.states()),
            ChannelRows(contact, written.stamps, rows),
        ])
    run = read_run(path)
    assert run.contact is not None
    assert np.array_equal(run.contact.values, values)


@pytest.mark.parametrize('answered', [0, 200])
def test_read_run_after_reset_drops_earlier_signals(tmp_path: Path, answered: int) -> None:
    """The controller is inactive at the start of the last pass, or in all of it."""
    path, before, after = tmp_path / 'run.mcap', numbers(1000), numbers(600)
    first = len(after.stamps) - answered
    with LogWriter(path) as log:
        write_numbers(log, before, window=50, everything=True)
        write_numbers(log, part(after, 0, first), window=50, everything=False)
        if answered:
            write_numbers(log, part(after, first, len(after.stamps)), window=50, everything=True)
    run = read_run(path)
    assert np.array_equal(run.position, after.position)
    assert np.array_equal(run.torque.values, after.torque[first:])
    signals = PUBLISHED if answered else ()
    assert sorted(run.telemetry) == sorted(signal.name for signal in signals)
    for signal in signals:
        values = run.telemetry[signal.name].values
        assert np.array_equal(values, after.telemetry[signal.label][first:])


@pytest.mark.parametrize('pacing', ['realtime', 'lockstep'])
def test_read_run_late_state_is_no_reset(tmp_path: Path, pacing: str) -> None:
    path = tmp_path / 'run.mcap'
    values = {'pacing': pacing, 'state_timeout': 0.1, 'control_period': 0.01, 'k_s1': 1.0}
    start = ParameterRecord('/controller', 0, 0, values, ())
    changed = ParameterRecord('/controller', 2, 20_000_000, {**values, 'k_s1': 2.0}, ('k_s1',))
    state = JointStateCdr()
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        parameters = log.channel('/controller/parameters', 'std_msgs/msg/String')
        log.write(parameters, 0, string_message(start.to_text()))
        for place, tick in enumerate([0, 1, 2, 3, 6, 4, 7, 8]):
            state.set_stamp(tick * 10_000_000)
            log.write(states, place, state.to_bytes())
            if place == 2:
                log.write(parameters, place, string_message(changed.to_text()))
    run = read_run(path)
    # A controller in real time ignores the late state.
    late = [0.04] if pacing == 'lockstep' else []
    assert run.times.tolist() == [0.0, 0.01, 0.02, 0.03, *late, 0.06, 0.07, 0.08]
    assert run.parameters['controller']['k_s1'] == 1.0
    assert run.changes == (changed,)
    counted = '/joint_states: 1 that arrived late, of 8 messages.'
    assert run.notes == (() if late else (counted,))


def test_read_run_metadata_of_equal_name_are_listed(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        log.write(states, 0, JointStateCdr().to_bytes())
        log.metadata('change', {'tick': '1'})
        log.metadata('change', {'tick': '2'})
    assert read_run(path).metadata == {'change': [{'tick': '1'}, {'tick': '2'}]}


def test_read_run_log_without_chunks_is_read(tmp_path: Path) -> None:
    """Recorders without compression or indexes write such logs."""
    path = tmp_path / 'run.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start()
        schema = writer.register_schema(STATE, 'ros2msg', definition(STATE).text.encode())
        channel = writer.register_channel('joint_states', 'cdr', schema)
        writer.add_message(channel, 0, JointStateCdr().to_bytes(), 0)
        writer.finish()
    assert read_run(path).times.tolist() == [0.0]


def test_read_run_invalid_file_raises(tmp_path: Path) -> None:
    (tmp_path / 'text.mcap').write_text('not an MCAP file\n' * 10)
    (tmp_path / 'empty.mcap').write_text('')
    (tmp_path / 'folder').mkdir()
    os.mkfifo(tmp_path / 'pipe.mcap')
    for name, expected in [
        ('none.mcap', 'none.mcap: cannot be read: No such file'),
        ('text.mcap', 'text.mcap: is not .* MCAP file'),
        ('empty.mcap', 'empty.mcap'),
        ('pipe.mcap', 'is not a file; name a .mcap file'),
        ('folder', r'folder: has no \.mcap file; name the folder of a recording'),
    ]:
        with pytest.raises(InputError, match=expected):
            read_run(tmp_path / name)


def test_read_run_truncated_log_suggests_recover(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    write_run(path, numbers(200))
    whole = path.read_bytes()
    cut = tmp_path / 'cut.mcap'
    ends = [*range(1, 400), *range(len(whole) - 40, len(whole))]
    for size in [*ends, *range(400, len(whole), 997)]:
        cut.write_bytes(whole[:size])
        with pytest.raises(InputError, match=r'cut\.mcap: ') as caught:
            read_run(cut)
        assert 'masmc recover' in str(caught.value) or size < 8


def test_read_run_damaged_log_raises(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    write_run(path, numbers(200))
    damaged = bytearray(path.read_bytes())
    for offset in range(1000, 20_000, 2000):
        changed = damaged.copy()
        changed[offset] ^= 0xFF
        path.write_bytes(changed)
        with pytest.raises(InputError, match=r'run\.mcap: the log is damaged'):
            read_run(path)


def test_read_run_unusable_topics_raise(tmp_path: Path) -> None:
    def refusal(*channels: tuple[str, str, bytes]) -> str:
        path = tmp_path / 'run.mcap'
        with LogWriter(path) as log:
            for topic, type_name, raw in channels:
                log.write(log.channel(topic, type_name), 0, raw)
        with pytest.raises(InputError) as caught:
            read_run(path)
        return str(caught.value).removeprefix(f'{path}: ')

    state = JointStateCdr().to_bytes()
    assert refusal().startswith('no joint_states in it; a run has at least these')
    assert refusal(('/other_joint_states', STATE, state)).startswith('no joint_states')
    renamed = refusal(('/robot/js', STATE, state))
    assert renamed.endswith('; /robot/js, of that type, would have to be called joint_states')
    two = refusal(('/a/joint_states', STATE, state), ('/b/joint_states', STATE, state))
    assert two.startswith('states of several robots (/a/joint_states, /b/joint_states)')
    other = refusal(('/joint_states', ARRAY, EffortCdr().to_bytes()))
    assert other == f'/joint_states is {ARRAY}; it takes {STATE}'
    wrong = refusal(('/joint_states', STATE, state), ('/reference', STATE, state))
    assert wrong == f'/reference is {STATE}; it takes {ARRAY}'
    camera = refusal(('/joint_states', STATE, foreign_state(0, ['camera'], [1.0])))
    assert camera.startswith("joint state: joint 'base_x_joint' is missing")
    moved = refusal(
        ('/joint_states', STATE, foreign_state(0, ['camera'], [1.0])),
        ('/base/odom', ODOMETRY, OdometryCdr().to_bytes()),
    )
    assert moved.startswith("joint state: joint 'base_x_joint' is missing")
    assert moved.endswith('; /base/odom, of that type, would have to be called /odom')
    garbage = refusal(('/joint_states', STATE, state[:40]))
    assert garbage.startswith('/joint_states: a message cannot be decoded')


def test_read_run_log_without_definitions_raises(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(STATE, 'ros2idl', b'')
        channel = writer.register_channel('/joint_states', 'cdr', schema)
        writer.add_message(channel, 0, foreign_state(0, ['camera'], [1.0]), 0)
        writer.finish()
    with pytest.raises(InputError, match="in 'ros2idl'; expected cdr with ros2msg"):
        read_run(path)


def test_read_run_without_ros_succeeds(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    write_run(path, numbers(10))
    script = (
        'import sys\n'
        'class NoRos:\n'
        '    def find_spec(self, name, *_):\n'
        '        package = name.partition(".")[0]\n'
        '        if package in ("rclpy", "std_msgs", "sensor_msgs", "builtin_interfaces"):\n'
        '            raise ImportError(name)\n'
        'sys.meta_path.insert(0, NoRos())\n'
        'from masmc_ros.log.read.reader import read_run\n'
        'print(len(read_run(sys.argv[1]).times), "numba" in sys.modules)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', script, path],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=Path(__file__).parents[2],
        check=False,
    )
    assert (done.stdout, done.stderr) == ('10 False\n', '')


def test_read_run_state_between_samples_interpolates_reference(tmp_path: Path) -> None:
    """In a real-time run the states lie between the samples."""
    path = tmp_path / 'run.mcap'
    times = np.arange(5) * 0.1
    samples = np.zeros((5, 3, 4))
    samples[:, 0] = times[:, None]
    samples[:, 1] = 1.0
    state = JointStateCdr()
    state.set_stamp(123_456_789)
    with LogWriter(path) as log:
        states = log.channel('/joint_states', STATE)
        reference = log.channel('/reference', ARRAY)
        log.write(reference, 0, ReferenceWindow(0, 0.1, samples).to_bytes())
        log.write(states, 123_456_789, state.to_bytes())
    run = read_run(path)
    assert run.reference is not None
    expected = [0.123456789] * 4 + [1.0] * 4 + [0.0] * 4
    assert run.reference[0] == pytest.approx(expected, abs=1e-9)


def test_controller_states_start_with_that_of_last_pass(tmp_path: Path) -> None:
    log, before, after = tmp_path / 'run.mcap', numbers(400), numbers(300, start=0)
    states = {
        (0, 0): 'inactive: not enabled yet', (0, 200): 'active', (0, 390): 'fault: late',
        (1, 100): 'active', (1, 250): 'fault: a\nreason',
    }  # fmt: skip
    with LogWriter(log) as writer:
        channel = writer.channel('/joint_states', STATE)
        texts = writer.channel('/controller/state', STRING)
        for number, run in enumerate((before, after)):
            for index, raw in enumerate(run.states()):
                writer.write(channel, int(run.stamps[index]), bytes(raw))
                if (number, index) in states:
                    text = states[number, index]
                    writer.write(texts, int(run.stamps[index]), string_message(text))
    run = read_run(log)
    assert run.controller_states == (
        (0.0, 'fault: late'), (0.1, 'active'), (0.25, 'fault: a\nreason')
    )  # fmt: skip
    assert metrics(run).notes[-2:] == (
        'Controller fault: late, from t = 0.000 s to 0.100 s.',
        'Controller fault: a reason, from t = 0.250 s to the end.',
    )
