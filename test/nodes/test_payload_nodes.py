# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Estimate of a payload by the controller node: topic, diagnostics, and recomputation."""

from __future__ import annotations

from pathlib import Path
from threading import Event

from helpers.core_loop import CoreLoop, node_values
from helpers.processes import PAPER, processes, ros_arguments
from masmc_ros.cli.main import main
from masmc_ros.identification.live_payload import BlockBuffer, PayloadEstimator
from masmc_ros.identification.parameter_file import nominal_of_run
from masmc_ros.log.read.reader import read_run
from masmc_ros.nodes.controller.live_identification import Background, PayloadOutput
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from rclpy.logging import get_logger

MASS = 0.8
EFFECTS = {
    'plant__command_delay': 0.004,
    'plant__encoder_resolution': 0.0001,
    'plant__measures_velocity': 'false',
    'controller__velocity_source': 'estimated',
    'controller__latency': 0.004,
}
IDEAL = {
    'control_period': 0.002,
    'duration': 12.0,
    'plant__disturbance.amplitude': '[0.0, 0.0, 0.0, 0.0]',
    'controller__law': 'computed_torque',
    'controller__model_scale': 1.0,
}


@pytest.mark.slow
@pytest.mark.parametrize('settings', [{}, EFFECTS], ids=['ideal', 'effects'])
def test_picked_up_payload_is_published_and_recomputed(
    settings: dict[str, object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    arguments = ros_arguments(
        PAPER, recorder__output=log, **IDEAL, **settings,
        **{
            'plant__payload.mass': MASS,
            'plant__payload.time': 4.5,
            'controller__payload.estimation_time': 5.0,
        },
    )  # fmt: skip
    with processes(tmp_path) as started:
        started.start('composed', '--record', *arguments)
        assert started.wait() == {'composed': 0}, started.output()
        output = started.output()
    published, texts = {}, []
    with log.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            if channel.topic == '/controller/payload':
                stamp = message.header.stamp
                published[stamp.sec * 10**9 + stamp.nanosec] = message
            if channel.topic == '/diagnostics':
                texts += [v.value for v in message.status[0].values if v.key == 'payload']
    # There is no report before the pick-up.
    assert min(published) > 4.5e9
    last = published[max(published)].inertia
    # The last one that is published depends on the speed of the machine.
    assert last.m == pytest.approx(MASS, rel=0.2 if settings else 0.02)
    assert last.com.x == pytest.approx(0.0, abs=0.03)
    assert np.isnan([last.com.y, last.com.z, last.ixx]).all()
    assert published[max(published)].header.frame_id == 'end_effector'
    assert 'announce it with: ros2 param set /controller payload.com' in output
    assert texts

    run = read_run(log)
    nominal = nominal_of_run(run)
    estimator = PayloadEstimator(
        nominal.robot, nominal.theta, nominal.friction, np.ones(4, np.bool_), 5.0
    )
    buffer, masses = BlockBuffer(run.position.shape[1], 4, 0.002), {}
    latency = float(str(settings.get('controller__latency', 0.0)))
    rates = np.nan_to_num(run.velocity[:, -4:])
    for k, torque in enumerate(run.torque.values):
        stamp = round(1e9 * run.times[k])
        block = buffer.add(stamp, run.position[k], rates[k], torque)
        if block is not None:
            estimator.add(block, latency, uses_rates=not settings)
            estimate = estimator.estimate()
            if estimate is not None and estimate.is_significant:
                masses[stamp] = estimate.load.mass
                assert abs(estimate.load.mass - MASS) < 3.0 * estimate.load.mass_error + 1e-3
    assert {stamp: message.inertia.m for stamp, message in published.items()}.items() <= (
        masses.items()
    )
    assert main(['simulate', str(log)]) == 0
    assert 'recomputed: all 6001 states and' in capsys.readouterr().out


@pytest.mark.slow
def test_payload_estimate_of_commanded_velocities_prints_error(tmp_path: Path) -> None:
    arguments = ros_arguments(
        PAPER, controller__command_interface='velocity',
        **{'controller__payload.estimation_time': 5.0},
    )  # fmt: skip
    with processes(tmp_path) as started:
        started.start('controller', *arguments)
        assert started.wait() == {'controller': 2}
        assert 'payload.estimation_time = 5: expected 0 with commanded' in started.output()


@pytest.mark.slow
def test_latency_by_motion_after_changed_latency_is_right() -> None:
    """The delay beyond `latency` is estimated again for the new one, not added to it."""
    values = node_values(
        {'control_period': 0.002},
        plant={'command_delay': 0.008, 'disturbance.amplitude': (0.0,) * 4},
        controller={
            'law': 'computed_torque', 'model_scale': 1.0, 'payload.estimation_time': 10.0,
        },
        trajectory={'line_sine.frequency': (3.0,) * 4},
    )  # fmt: skip
    loop = CoreLoop(values)
    background, log = Background(), get_logger('payload')
    output = PayloadOutput(loop.controller, values['controller'], background, log)
    output._name = '/controller'
    reported = []

    def report() -> None:
        if text := output.figures().get('latency by motion, with motor lag (ms)'):
            reported.append(float(text.split()[0]))

    try:
        for second in range(16):
            if second == 8:
                loop.controller.change({'latency': 0.009})
                report()
            for _ in range(500):
                loop.step()
                output.add(loop.timing.stamp(loop.tick - 1))
            done = Event()
            background.call(done.set)
            assert done.wait(10.0)
            report()
    finally:
        background.close()
    assert len(reported) > 5
    np.testing.assert_allclose(reported, 8.0, atol=1.0)
