# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""State timeout in real time: missing states raise a fault, a pause does not."""

from __future__ import annotations

from pathlib import Path
import signal
import time

from diagnostic_msgs.msg import DiagnosticArray
from helpers.processes import Peer, peer, processes, ros_arguments
from masmc_ros.messages.message import text_of
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.stamps import header_stamp
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

NODES = ('plant', 'trajectory', 'controller')


def collect_states(tester: Peer) -> list[str]:
    """Return a list to which every text of `controller/state` is appended."""
    texts: list[str] = []
    tester.subscribe(
        String, 'controller/state', lambda raw: texts.append(text_of(raw)), raw=True
    )
    return texts


def test_state_timeout_foreign_parameters_still_active(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = collect_states(tester)
        nodes = started.start_all(*ros_arguments(None), nodes=NODES)
        stamps = tester.watch_time()
        tester.until(lambda: stamps[-1] > 500_000_000, 'motion')
        foreign = tester.publisher(String, 'plant/parameters', latched=True)
        tester.wait_for_subscribers(foreign)
        wrong = ParameterRecord('/plant', 0, 0, {'pacing': 'lockstep'}, ())
        foreign.publish(String(data=wrong.to_text()))
        controller = nodes['controller']
        tester.until(lambda: controller.logged('WARN', 'a plant has lockstep'), 'the difference')
        nodes['plant'].abort()
        tester.until(lambda: 'no usable joint_states' in states[-1], f'a fault, not {states}')


def test_pause_raises_no_fault_late_ticks_counted(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = collect_states(tester)
        late: list[int] = []

        def on_health(message: DiagnosticArray) -> None:
            for status in message.status:
                late.extend(int(v.value) for v in status.values if v.key == 'late ticks')

        tester.subscribe(DiagnosticArray, '/diagnostics', on_health)
        # Longer than the delays on a busy machine.
        arguments = ros_arguments(None, controller__state_timeout=1.0)
        nodes = started.start_all(*arguments, nodes=NODES)
        stamps: list[int] = []
        tester.subscribe(
            JointState, 'joint_states', lambda raw: stamps.append(header_stamp(raw)), raw=True
        )
        tester.until(lambda: stamps and stamps[-1] > 500_000_000, 'motion')
        tester.until(lambda: states and states[-1] == 'active', 'an active controller')
        seen = len(states)
        assert tester.call(SetBool, '/plant/pause', SetBool.Request(data=True)).success
        start = time.monotonic()
        tester.until(lambda: time.monotonic() > start + 3.0)
        assert stamps[-1] == stamps[-5]
        assert states[seen:] == []
        pause_stamp = stamps[-1]
        assert tester.call(SetBool, '/plant/pause', SetBool.Request(data=False)).success
        tester.until(lambda: stamps[-1] > pause_stamp + 500_000_000, 'motion again')
        assert states[seen:] == []
        previous = late[-1] if late else 0
        nodes['plant'].signal(signal.SIGSTOP)
        time.sleep(0.1)
        nodes['plant'].signal(signal.SIGCONT)
        tester.until(lambda: late and late[-1] >= previous + 5, f'late ticks, not {late}')
