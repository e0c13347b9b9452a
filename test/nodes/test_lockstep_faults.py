# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes stopped or killed in lockstep: the run waits and remains bitwise identical."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time

from builtin_interfaces.msg import Time
from helpers.log_contents import LogContents, read_log
from helpers.processes import NodeProcess, NODES, PAPER, Peer, peer, processes, ros_arguments
from masmc_ros.cli.main import main
import pytest
from std_msgs.msg import String
from std_srvs.srv import SetBool

DURATION = 16.0
SETTINGS = ('controller.law=smc', f'duration={DURATION}')
"""The law smc has no state; therefore a new controller continues the run identically."""


class Lockstep:
    """Run of four nodes in lockstep, which the test can pause."""

    def __init__(self, tester: Peer, start: Callable[[str], NodeProcess]) -> None:
        self.tester = tester
        self.start = start
        self.stamps = tester.watch_time()
        self.nodes = {name: start(name) for name in NODES}

    def wait_for_progress(self) -> None:
        """Wait until the robot has moved further."""
        seen = len(self.stamps)
        self.tester.until(lambda: len(self.stamps) > seen + 1, 'motion')
        assert self.stamps[-1] < DURATION * 1e9, 'the run ended before the test'

    def pause(self, *, on: bool) -> None:
        answer = self.tester.call(SetBool, '/plant/pause', SetBool.Request(data=on))
        assert answer.success

    def replace(self, name: str, message_type: type, topic: str) -> None:
        """Kill and restart a node, and wait for the first message of the new one."""
        self.nodes[name].signal(signal.SIGKILL)
        self.nodes[name].wait()
        # A killed node does not send earlier messages to a new subscriber.
        messages = self.tester.collect(message_type, topic)
        self.nodes[name] = self.start(name)
        self.tester.until(lambda: messages, f'a new {name}')


@contextmanager
def lockstep(folder: Path) -> Iterator[Lockstep]:
    """Yield a started run; all of its nodes must end without a signal, with status 0."""
    with processes(folder) as started, peer(started.domain) as tester:

        def start(name: str) -> NodeProcess:
            number = len(list(folder.glob('*.mcap')))
            arguments = ros_arguments(
                PAPER,
                **{f'{node}__duration': DURATION for node in NODES},
                plant__wait_for='[controller, trajectory, recorder, peer]',
                controller__law='smc',
                recorder__output=folder / f'{number}.mcap',
            )
            return started.start(name, *arguments)

        run = Lockstep(tester, start)
        yield run
        for name, node in run.nodes.items():
            assert node.wait() == 0, (name, started.output())
        assert 'Traceback' not in started.output()


@pytest.fixture(scope='module')
def computed(tmp_path_factory: pytest.TempPathFactory) -> LogContents:
    log = tmp_path_factory.mktemp('computed') / 'run.mcap'
    settings = [word for setting in SETTINGS for word in ('--set', setting)]
    assert main(['simulate', str(PAPER), '--output', str(log), *settings]) == 0
    return read_log(log)


@pytest.mark.slow
def test_lockstep_any_node_stopped_run_identical(computed: LogContents, tmp_path: Path) -> None:
    """The other nodes wait for the stopped one; no message is lost or changed."""
    with lockstep(tmp_path) as run:
        for name in NODES:
            run.wait_for_progress()
            run.nodes[name].signal(signal.SIGSTOP)
            # The run uses up the reference (2 s ahead) and fills the recorder's queue (0.8 s).
            wait_for_standstill(run)
            run.nodes[name].signal(signal.SIGCONT)
    live = read_log(tmp_path / '0.mcap')
    for topic in ('joint_states', 'effort_commands', 'controller/tracking_error', 'odom', 'tf'):
        assert live.stamps(topic) == computed.stamps(topic), topic
        assert live.messages[topic] == computed.messages[topic], topic


def wait_for_standstill(run: Lockstep) -> None:
    """Wait until no state has arrived for 0.3 s."""
    seen, since = -1, 0.0

    def has_stood() -> bool:
        nonlocal seen, since
        if seen != len(run.stamps):
            seen, since = len(run.stamps), time.monotonic()
        return time.monotonic() > since + 0.3

    run.tester.until(has_stood, 'standstill of the run')


@pytest.mark.slow
def test_lockstep_any_node_restarted_run_ends_regularly(
    computed: LogContents, tmp_path: Path
) -> None:
    """A new plant restarts the run; the other new nodes continue it. All nodes exit."""
    with lockstep(tmp_path) as run:
        run.wait_for_progress()
        run.pause(on=True)
        run.replace('trajectory', String, 'trajectory/parameters')
        run.pause(on=False)
        run.wait_for_progress()
        # During the run the plant waits for the new controller.
        run.replace('controller', String, 'controller/parameters')
        run.wait_for_progress()
        run.pause(on=True)
        run.replace('recorder', Time, 'recorder/progress')
        run.pause(on=False)
        run.wait_for_progress()
        run.replace('plant', String, 'plant/parameters')
    live = read_log(tmp_path / '1.mcap')
    stamps = live.stamps('joint_states')
    start = len(stamps) - stamps[::-1].index(0) - 1
    assert live.messages['joint_states'][start:] == computed.messages['joint_states']
    # All earlier states and torques are those of the run, too.
    for log in ('0.mcap', '1.mcap'):
        contents = read_log(tmp_path / log)
        for topic in ('joint_states', 'effort_commands'):
            assert set(contents.messages[topic]) <= set(computed.messages[topic]), (log, topic)
            assert contents.messages[topic]
