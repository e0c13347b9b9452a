# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Display of any robot in viewers: lines of the layout, and meshes in a served log."""

from __future__ import annotations

from collections import Counter
import json
from pathlib import Path
import resource
from typing import Any

from helpers.small_tree import parameters
from masmc_ros.cli.commands.layout import layout_for, robot_in
from masmc_ros.cli.commands.view import _served
from masmc_ros.cli.file_server import FileServer
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.cdr_layout import definition
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import string_message, text_of
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import DEFAULT, joint_names_of, mechanism_from
from masmc_ros.robot.urdf import read_urdf
from masmc_ros.robot.visuals import mesh_files
from mcap.reader import make_reader
from mcap.writer import Writer
import pytest
from test_view_command import ask, Remote, ROOT, viewing
import yaml

STATIC = json.loads((ROOT / 'config' / 'foxglove.json').read_text('utf-8'))
MESH = bytes(range(200))


def lines(layout: dict[str, Any], plot: str) -> list[tuple[str, str]]:
    return [
        (path['label'], path['value'])
        for path in layout['configById'][f'Plot!{plot}']['paths']
    ]


@pytest.fixture(scope='module')
def tree(tmp_path_factory: pytest.TempPathFactory) -> tuple[Mechanism, dict[str, Any]]:
    """Return the mechanism of a parameter file with a small tree, and its layout."""
    file = tmp_path_factory.mktemp('tree') / 'tree.yaml'
    values = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in parameters().items()
    }
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': values}}), 'utf-8')
    mechanism = robot_in(str(file)).mechanism
    return mechanism, layout_for(mechanism)


def test_layout_papers_robot_equals_installed_layout() -> None:
    assert layout_for(DEFAULT) == STATIC


def test_layout_lines_match_their_labels(tree: tuple[Mechanism, dict[str, Any]]) -> None:
    mechanism, layout = tree
    topics = {'error': 'tracking_error', 'surface': 'sliding_surface'}
    for plot, topic in topics.items():
        assert lines(layout, plot) == [
            (axis.name, f'/controller/{topic}.data[{2 + i}]')
            for i, axis in enumerate(mechanism.axes)
        ]
    assert lines(layout, 'torque') == [
        (f'{name}_joint', f'/effort_commands.data[{i}]')
        for i, name in enumerate([
            'wheel_right', 'wheel_left', 'turret', 'lift', 'upper', 'fore', 'hand',
        ])
    ]  # fmt: skip
    # The positions after the base's pose and the wheels.
    assert lines(layout, 'paths') == [
        (f'{name}_joint', f'/joint_states.position[{5 + i}]')
        for i, name in enumerate(['turret', 'lift', 'upper', 'fore', 'hand'])
    ]
    # Each body has ten inertial parameters; the first one is its mass.
    assert lines(layout, 'estimate') == [
        (name, f'/controller/parameter_estimate.data[{2 + 10 * i}]')
        for i, name in enumerate(['base_link', 'turret', 'lift', 'upper', 'fore', 'hand'])
    ]
    # The first axis in metres and the first axis in radians.
    assert lines(layout, 'gains')[:2] == [
        (f'K_s1, {mechanism.axes[i].name}', f'/masmc/controller.k_s1[{i}]') for i in (0, 3)
    ]
    assert '/masmc/paths' not in json.dumps(layout)


def urdf(*meshes: str) -> str:
    visuals = ''.join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>' for name in meshes
    )
    return f'<robot name="shown"><link name="base_link">{visuals}</link></robot>'


def test_mesh_files_only_existing_meshes(tmp_path: Path) -> None:
    (tmp_path / 'arm.STL').write_bytes(MESH)
    (tmp_path / 'secret.txt').write_bytes(MESH)
    address = f'file://{tmp_path}/arm.STL'
    files = mesh_files(urdf(
        address, f'file://{tmp_path}/secret.txt', f'file://{tmp_path}/gone.stl',
        'package://no_such_package/arm.stl', 'http://example.org/arm.stl', 'arm.STL',
    ))  # fmt: skip
    assert files == {address: tmp_path / 'arm.STL'}


@pytest.fixture
def described(tmp_path: Path) -> tuple[Path, list[str]]:
    """Return a log with a robot description, and the meshes in the description."""
    names = []
    for number in (1, 2):  # the same name in two folders
        mesh = tmp_path / str(number) / 'part one.stl'
        mesh.parent.mkdir()
        mesh.write_bytes(MESH * number)
        names.append(f'file://{mesh}')
    names.append('package://no_such_package/arm.stl')
    log = tmp_path / 'run.mcap'
    with log.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        kind = 'std_msgs/msg/String'
        schema = writer.register_schema(kind, 'ros2msg', definition(kind).text.encode())
        for topic in ('/left/robot_description', '/other'):
            channel = writer.register_channel(topic, 'cdr', schema)
            for time in (10, 20):
                writer.add_message(channel, time, string_message(urdf(*names)), time)
        writer.finish()
    return log, names


def test_view_description_has_addresses_of_meshes(described: tuple[Path, list[str]]) -> None:
    log, names = described
    original = log.read_bytes()
    with viewing(log) as served, log.open('rb') as stream:
        reader = make_reader(Remote(served.url))
        messages = [(channel.topic, message) for _, channel, message in reader.iter_messages()]
        own = [message for _, _, message in make_reader(stream).iter_messages()]
        topic, last = max(messages, key=lambda pair: (pair[0] != '/other', pair[1].log_time))
        assert topic == '/left/robot_description'
        assert sorted((m.log_time, m.data) for _, m in messages if m is not last) == sorted(
            (m.log_time, m.data) for m in own
        )
        assert last.log_time == 21
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 5
        meshes = read_urdf(text_of(last.data), 'what is served').links['base_link'].meshes
        assert meshes[2] == names[2]
        for number, address in enumerate(meshes[:2], start=1):
            assert ask(address)[1] == MESH * number
    assert log.read_bytes() == original


def test_view_no_space_for_copy_raises_one_line(
    described: tuple[Path, list[str]], tmp_path: Path
) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with FileServer() as server:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
        try:
            with pytest.raises(InputError, match=r'cannot be written: .*TMPDIR'):
                _served(server, described[0], tmp_path)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_view_log_without_meshes_served_unmodified(tmp_path: Path) -> None:
    log = tmp_path / 'empty.mcap'
    with log.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        writer.finish()
    with viewing(log) as served:
        assert ask(served.url)[1] == log.read_bytes()


def test_layout_log_without_plant_is_that_of_controller(tmp_path: Path) -> None:
    """The log of a robot has no simulated plant."""
    log = tmp_path / 'robot.mcap'
    values = parameters()
    expected = mechanism_from(values)
    record = ParameterRecord('/controller', 0, 0, values, ())
    with LogWriter(log) as writer:
        states = writer.channel('/joint_states', 'sensor_msgs/msg/JointState')
        channel = writer.channel('/controller/parameters', 'std_msgs/msg/String')
        writer.write(channel, 0, string_message(record.to_text()))
        writer.write(states, 0, JointStateCdr(joint_names_of(expected)).to_bytes())
    assert layout_for(*robot_in(str(log))) == layout_for(expected) != STATIC


@pytest.mark.parametrize('paper', [True, False])
def test_layout_hybrid_interface_has_torques_of_arm(
    tree: tuple[Mechanism, dict[str, Any]], tmp_path: Path, paper: bool
) -> None:
    """The command contains no torques of the base."""
    file = tmp_path / 'hybrid.yaml'
    values = {'command_interface': 'hybrid'} | ({} if paper else parameters())
    text = json.dumps({'/**': {'ros__parameters': values}})
    file.write_text(text, 'utf-8')
    layout = layout_for(*robot_in(str(file)))
    arm = (DEFAULT if paper else tree[0]).joints[2:]
    assert lines(layout, 'torque') == [
        (joint.short, f'/effort_commands.data[{i}]') for i, joint in enumerate(arm)
    ]
    assert lines(layout, 'error') == lines(STATIC if paper else tree[1], 'error')


def test_layout_log_without_robot_one_error_line(
    described: tuple[Path, list[str]], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    output = tmp_path / 'layout.json'
    assert main(['layout', str(described[0]), '--output', str(output)]) == 2
    error = capsys.readouterr().err
    assert Counter(error)['\n'] == 1
    assert str(described[0]) in error
    assert not output.exists()
