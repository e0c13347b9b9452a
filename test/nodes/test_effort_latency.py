# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Latency of the drives that the controller reads from the efforts of a plant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from helpers.processes import PAPER, peer, processes, ros_arguments
from masmc_ros.nodes.process.base import WARN
import pytest

KEY = 'latency by effort (ms)'
DELAYED = {
    'control_period': 0.002,
    'duration': 0.0,
    'plant__measurement_delay': 0.002,
    'plant__command_delay': 0.006,
    'plant__motor_lag': 0.004,
    'plant__disturbance.amplitude': '[0.3, 0.3, 0.2, 0.2]',
    # Tolerates the latency while it is unknown.
    'controller__law': 'computed_torque',
    'controller__computed_torque.k_d': 10.0,
    'controller__computed_torque.k_p': 25.0,
    'controller__model_scale': 1.0,
}


@pytest.mark.slow
def test_efforts_of_plant_show_latency_and_warn_of_wrong_one(tmp_path: Path) -> None:
    # In real time the command to a state acts a tick after its delay.
    latency, tolerance = 0.01, 2.5
    arguments = ros_arguments(PAPER, pacing='realtime', **DELAYED)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        reports: list[Any] = []

        def report(message: DiagnosticArray) -> None:
            reports.extend(s for s in message.status if s.name == '/controller')

        def values() -> dict[str, str]:
            return {pair.key: pair.value for pair in reports[-1].values} if reports else {}

        tester.subscribe(DiagnosticArray, '/diagnostics', report)
        started.start('composed', *arguments)
        tester.until(lambda: KEY in values(), started.output)
        total, _, *_, lag, _, _ = values()[KEY].replace(',', '').split()
        assert float(total) == pytest.approx(1e3 * latency + 4.0, abs=tolerance)
        assert float(lag) == pytest.approx(4.0, abs=tolerance)
        assert reports[-1].level == WARN
        assert reports[-1].message.startswith('latency = 0, motor_lag = 0: the efforts in')
        expected = float(reports[-1].message.split('expected latency = ')[1].split()[0])
        assert expected == pytest.approx(latency, abs=1e-3 * tolerance)
        tester.change('controller', latency=latency, motor_lag=0.004)
        tester.until(
            lambda: not reports[-1].message.startswith('latency'), lambda: reports[-1].message
        )
