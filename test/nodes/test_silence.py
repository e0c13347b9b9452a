# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""By the wall clock silence is a fault whoever says what; a plant that is paused is not silent."""

from __future__ import annotations

from pathlib import Path
import signal
import time

from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.text import text_of
from processes import Peer, peer, processes, ros_arguments
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

NODES = ('plant', 'trajectory', 'controller')


def told_by_the_controller(tester: Peer) -> list[str]:
    """Return a list that grows by every state that the controller tells."""
    found: list[str] = []
    tester.subscribe(
        String, 'controller/state', lambda raw: found.append(text_of(raw)), raw=True
    )
    return found


def test_a_stranger_does_not_switch_the_timeout_off(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        told = told_by_the_controller(tester)
        nodes = started.start_all(*ros_arguments(None), nodes=NODES)
        stamps = tester.watch_time()
        tester.until(lambda: stamps[-1] > 500_000_000, 'motion')
        stranger = tester.publisher(String, 'plant/parameters', latched=True)
        tester.wait_for_subscribers(stranger)
        lie = ParameterRecord('/plant', 0, 0, {'pacing': 'lockstep'}, ())
        stranger.publish(String(data=lie.to_text()))
        controller = nodes['controller']
        tester.until(lambda: controller.logged('WARN', 'a plant has lockstep'), 'the difference')
        nodes['plant'].abort()
        tester.until(lambda: 'no usable joint_states' in told[-1], f'a fault, not {told}')


def test_a_pause_is_no_fault_and_late_ticks_are_counted(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        told = told_by_the_controller(tester)
        late: list[int] = []

        def on_health(message: DiagnosticArray) -> None:
            for status in message.status:
                late.extend(int(v.value) for v in status.values if v.key == 'late ticks')

        tester.subscribe(DiagnosticArray, '/diagnostics', on_health)
        # Longer than a busy machine holds anybody up.
        arguments = ros_arguments(None, controller__state_timeout=1.0)
        nodes = started.start_all(*arguments, nodes=NODES)
        stamps: list[int] = []
        tester.subscribe(
            JointState, 'joint_states', lambda raw: stamps.append(header_stamp(raw)), raw=True
        )
        tester.until(lambda: stamps and stamps[-1] > 500_000_000, 'motion')
        tester.until(lambda: told and told[-1] == 'active', 'an active controller')
        seen = len(told)
        assert tester.call(SetBool, '/plant/pause', SetBool.Request(data=True)).success
        begun = time.monotonic()
        tester.until(lambda: time.monotonic() > begun + 3.0)
        assert stamps[-1] == stamps[-5]
        assert told[seen:] == []
        stood = stamps[-1]
        assert tester.call(SetBool, '/plant/pause', SetBool.Request(data=False)).success
        tester.until(lambda: stamps[-1] > stood + 500_000_000, 'motion again')
        assert told[seen:] == []
        before = late[-1] if late else 0
        nodes['plant'].signal(signal.SIGSTOP)
        time.sleep(0.1)
        nodes['plant'].signal(signal.SIGCONT)
        tester.until(lambda: late and late[-1] >= before + 5, f'late ticks, not {late}')
