# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Play node without a run: samples, ranges of sliders, ratios, and access to the page."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import socket

from helpers.viewed_run import computed_run
from masmc_ros.errors import InputError
from masmc_ros.files import scenario_file
from masmc_ros.log.read.reader import read_run
from masmc_ros.nodes.play.controls import Controls
from masmc_ros.nodes.play.page import is_local, Page, PlayServer
from masmc_ros.nodes.play.plots import Plots, shown_robot
from masmc_ros.nodes.play.replay import Replay
from masmc_ros.nodes.play.run_report import write_report_so_far
from masmc_ros.nodes.play.samples import SampleWindow, TimeSpeed, WINDOW
from masmc_ros.nodes.play.scene import RobotScene
from masmc_ros.params.presentation import gain_text, level_of, scaled, slider_range, SLIDERS
from masmc_ros.robot.declaration import shown_parameters
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
import viser
from websockets.sync.client import connect


@pytest.fixture(scope='module')
def server() -> Iterator[PlayServer]:
    started = PlayServer('127.0.0.1', 0)
    yield started
    started.stop()


def test_window_keeps_last_seconds_and_bounded_number() -> None:
    window = SampleWindow(2, 50)
    for tick in range(100):
        window.append(0.5 * tick, (tick, -tick))
    assert window.times[0] == window.times[-1] - WINDOW
    assert np.array_equal(window.values[-1], (99.0, -99.0))
    for tick in range(200):
        window.append(100.0 + 0.01 * tick, (tick, tick))
    assert len(window.times) == 50


def test_window_paused_or_reset_robot_keeps_order() -> None:
    window = SampleWindow(1, 10)
    for time in (1.0, 2.0, 2.0, 3.0):
        window.append(time, (time,))
    assert window.times.tolist() == [1.0, 2.0, 3.0]
    window.append(0.5, (9.0,))
    assert window.values.tolist() == [[9.0]]


def test_window_marks_first_sample_after_each_change() -> None:
    window = SampleWindow(1, 10)
    for time in (1.0, 2.0, 3.0, 4.0):
        window.append(time, (0.0,))
    # The first change precedes the window; the last one has no sample yet.
    assert window.marks((0.5, 1.5, 3.0, 4.5)).tolist() == [0.0, 1.0, 1.0, 0.0]


def test_time_speed_is_that_of_last_seconds() -> None:
    speed = TimeSpeed()
    assert speed.text == ''
    now, robot_time = 10.0, 0.0
    for rate in (1.0, 0.6):
        for _ in range(25):
            speed.add(now, robot_time)
            now, robot_time = now + 0.2, robot_time + 0.2 * rate
        assert speed.text == f'time at {rate} of real time'
    for _ in range(25):
        # Paused.
        speed.add(now, robot_time)
        now += 0.2
    assert speed.text == 'time at 0.0 of real time'
    speed.add(now, 0.0)
    assert speed.text == ''


@pytest.mark.parametrize('name', ['paper', 'ur5'])
def test_slider_every_end_of_range_accepted_by_parameter(name: str) -> None:
    if name == 'ur5':
        # The extra `robots` has its URDF.
        pytest.importorskip('pinocchio')
    values = load_scenario(scenario_file(name))['controller']
    parameters = {p.name: p for p in declared('controller', mechanism_from(values))}
    for gain in SLIDERS:
        bounds = slider_range(parameters[gain], level_of(values[gain]))
        assert bounds.contains(level_of(values[gain]))
        for level in (bounds.lowest, bounds.highest):
            parameters[gain].check(scaled(values[gain], level))


def test_slider_scales_array_by_largest_entry() -> None:
    assert level_of((50.0, 100.0)) == 100.0
    assert scaled([50.0, 100.0], 150.00000000000003) == [75.0, 150.0]
    assert scaled([0.0, 0.0], 2.0) == 2.0
    assert scaled(0.2, 0.3) == 0.3
    assert (gain_text([1.0, 1.0]), gain_text([1.0, 2.0])) == ('1.0', '[1.0, 2.0]')


def test_plots_show_estimates_relative_to_reference(server: PlayServer) -> None:
    robot = robot_of(load_scenario(scenario_file('paper'))['plant'])
    plots = Plots(server.gui, robot.mechanism, lambda _: robot.theta[None], 'true value', 10)
    plots.add_estimate(0.1, 0.5 * robot.theta)
    plots.add_error(0.1, np.array([3e-3, 4e-3, 0.0, 1e-3]))
    plots.send([])
    assert np.allclose(plots._ratios.samples.values, 0.5)
    assert np.allclose(plots._errors.samples.values, (5.0, 1.0))


def test_plots_of_many_bodies_show_masses() -> None:
    pytest.importorskip('pinocchio')
    theta = mechanism_from(load_scenario(scenario_file('ur5'))['plant']).theta
    assert {theta[i].unit for i in shown_parameters(theta)} == {'kg'}


def test_server_port_in_use_rejected_in_one_line() -> None:
    with socket.create_server(('127.0.0.1', 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(InputError, match=rf'port = {port}: .*; name a free port') as raised:
            PlayServer('127.0.0.1', port)
    assert '\n' not in str(raised.value)


def test_server_other_page_in_browser_has_no_command(server: PlayServer) -> None:
    port = server.get_port()
    protocol = f'viser-v{viser.__version__}'
    own, foreign = f'http://127.0.0.1:{port}', 'http://example.com'
    for origin, is_own in ((own, True), (foreign, False), (None, False)):
        url = f'ws://127.0.0.1:{port}'
        with connect(url, origin=origin, subprotocols=[protocol]) as client:
            client.recv(timeout=10.0)
            number = max(server._websock_server._live_connections)
            assert server.is_own_page(number) is is_own


def test_controls_ignore_wrong_values_and_escape_reasons(server: PlayServer) -> None:
    values = load_scenario(scenario_file('paper'))['controller']
    declarations = {p.name: p for p in declared('controller')}
    controls = Controls(
        server, '/controller', may_command=True, asks_first=False, saved=lambda: None
    )
    controls.build(declarations, values)
    slider = next(
        handle
        for handle in controls._folder._children.values()
        if isinstance(handle, viser.GuiSliderHandle)
    )
    for shown, expected in (('abc', 100.0), ([1.0, 'x'], 100.0), (500, 500.0), ([50.0] * 4, 50.0)):
        controls.show_values({'/controller.k_s1': shown, '/controller.law': [1.0]})
        controls.refresh()
        assert slider.value == expected
    controls.show_error('/controller.k_s1', '<b>')
    assert '/controller.k_s1: &lt;b&gt;' in controls._notice.content


def test_plots_compare_errors_before_and_after_change(server: PlayServer) -> None:
    robot = robot_of(load_scenario(scenario_file('paper'))['plant'])
    plots = Plots(server.gui, robot.mechanism, lambda _: robot.theta[None], 'true value', 100)
    assert plots.compare(is_on=False) == ''
    for tick in range(40):
        if tick == 30:
            # A drag of a slider: its first change counts.
            plots.note_change(3.0)
            plots.note_change(3.2)
        size = 4e-3 if tick < 30 else 1e-3
        plots.add_error(0.1 * tick, np.array([size, 0.0, 0.0, size]))
    text = plots.compare(is_on=True)
    assert '|e_E| 4 → 1 mm, |e_F| 4 → 1 mm' in text
    plots.send([3.0])
    times, _, *lines = plots._errors._handle.data
    assert len(lines) == 4
    # The dashed lines end at the change; a longer window has no values before the start.
    assert np.allclose(lines[2][times > 1.0], 4.0)
    plots.compare(is_on=False)
    plots.send([3.0])
    assert len(plots._errors._handle.data) == 4


def test_scene_torques_shown_along_joint_axes(server: PlayServer) -> None:
    scenario = load_scenario(scenario_file('paper'))
    shown = shown_robot(scenario.values)
    assert shown is not None
    scene = RobotScene(server.scene, shown.robot, shown.description, print)
    disturbance = shown.disturbance(0.5)
    wheels, arm = 3.0 * 0.5, 1.5 * 0.5
    assert np.allclose(disturbance, [
        1.5 * np.sin(wheels), 1.5 * np.cos(wheels), 3.0 * np.sin(arm), 3.0 * np.cos(arm)
    ])  # fmt: skip
    scene.show_torques(np.array([0.0, 0.0, 0.0, -6.0]), disturbance)
    (torque, pushed) = scene._arrows[3][2]
    assert torque.visible
    assert not scene._arrows[0][2][0].visible
    assert np.allclose(torque.points, [[[0.0] * 3, [0.0, 0.0, -0.4]]], atol=1e-6)
    assert np.allclose(pushed.points[0, 1, 2], 0.4 * disturbance[3] / 6.0, atol=1e-6)
    scene.hide_torques()
    assert not torque.visible


def test_controls_ask_before_first_command(server: PlayServer) -> None:
    controls = Controls(
        server, '/controller', may_command=True, asks_first=True, saved=lambda: None
    )
    port = server.get_port()
    with connect(
        f'ws://127.0.0.1:{port}',
        origin=f'http://127.0.0.1:{port}',
        subprotocols=[f'viser-v{viser.__version__}'],
        max_size=None,
    ) as client:
        client.recv(timeout=10.0)
        number = max(server._websock_server._live_connections)
        controls.request(number, '/controller.k_s1', 1.0)
        assert controls.changes() == {}
        controls._is_allowed = True
        controls.request(number, '/controller.k_s1', 2.0)
        assert controls.changes() == {'/controller.k_s1': 2.0}


def test_report_of_unfinished_recording_is_written(tmp_path: Path) -> None:
    log, page = computed_run(tmp_path, 0.5), tmp_path / 'report.html'
    recording = tmp_path / 'recording.mcap'
    recording.write_bytes(log.read_bytes()[:-2000])
    write_report_so_far(recording, page)
    assert 'recording' in page.read_text()
    assert recording.stat().st_size == log.stat().st_size - 2000
    with pytest.raises(InputError, match=r'absent\.mcap: .*; is the recorder running\?'):
        write_report_so_far(tmp_path / 'absent.mcap', page)


def test_report_of_unfinished_parts_is_written(tmp_path: Path) -> None:
    log, page = computed_run(tmp_path, 0.5), tmp_path / 'report.html'
    parts = tmp_path / 'parts'
    parts.mkdir()
    (parts / 'parts_8.mcap').write_bytes(log.read_bytes())
    (parts / 'parts_9.mcap').write_bytes(log.read_bytes()[:-2000])
    # The recorder has created the next part, and metadata.yaml lists one that it has deleted.
    (parts / 'parts_10.mcap').touch()
    files = [f'parts_{number}.mcap' for number in (7, 8, 9, 10)]
    content = {'rosbag2_bagfile_information': {'relative_file_paths': files}}
    (parts / 'metadata.yaml').write_text(json.dumps(content))
    write_report_so_far(parts, page)
    assert 'parts' in page.read_text()
    assert len(list(parts.iterdir())) == 4


def test_replay_shows_robot_and_signals_of_its_time(tmp_path: Path) -> None:
    run = read_run(computed_run(tmp_path, 0.5))
    page = Page(PlayServer('127.0.0.1', 0))
    try:
        replay = Replay(run, page, print)
        replay._seek(0.2)
        replay.update(0.0)
        index = np.searchsorted(run.times, 0.2)
        assert replay._plots is not None
        torques = replay._plots._torques.samples
        assert torques.times[-1] == run.times[index]
        assert np.array_equal(torques.values[-1], run.applied_effort[index])
        transforms = replay._robot.frame_transforms(run.position[index][None])[0]
        assert np.allclose(replay._scene._frames[0].position, transforms[0, :3], atol=1e-6)
        for _ in range(4):
            replay.update(0.0)
        assert 't = 0.20 s of 0.50 s' in replay._notice.content
    finally:
        page.server.stop()


@pytest.mark.parametrize(
    ('host', 'expected'),
    [('127.0.0.1', True), ('localhost', True), ('::1', True), ('0.0.0.0', False), ('', False)],
)
def test_server_local_hosts_recognised(host: str, expected: bool) -> None:
    assert is_local(host) is expected
