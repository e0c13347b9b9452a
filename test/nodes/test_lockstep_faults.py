# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""In lock-step every node may hang or be killed: the run waits, goes on, and has the same bits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time

from builtin_interfaces.msg import Time
from log_contents import LogContents, read_log
from masmc_ros.cli.main import main
from processes import NodeProcess, NODES, PAPER, Peer, peer, processes, ros_arguments
import pytest
from std_msgs.msg import String
from std_srvs.srv import SetBool

DURATION = 16.0
SETTINGS = ('controller.law=smc', f'duration={DURATION}')
"""Under smc nothing is lost with the controller: its successor has the same bits."""


class Lockstep:
    """A run in lock-step of four nodes, stood still wherever the test wants it."""

    def __init__(self, tester: Peer, start: Callable[[str], NodeProcess]) -> None:
        self.tester = tester
        self.start = start
        self.stamps = tester.watch_time()
        self.nodes = {name: start(name) for name in NODES}

    def goes_on(self) -> None:
        """Wait until the robot has moved on."""
        seen = len(self.stamps)
        self.tester.until(lambda: len(self.stamps) > seen + 1, 'motion')
        assert self.stamps[-1] < DURATION * 1e9, 'too late to show anything'

    def pause(self, *, on: bool) -> None:
        answer = self.tester.call(SetBool, '/plant/pause', SetBool.Request(data=on))
        assert answer.success

    def replace(self, name: str, message_type: type, topic: str) -> None:
        """Kill a node, start it again and wait for what its successor says first of all."""
        self.nodes[name].signal(signal.SIGKILL)
        self.nodes[name].wait()
        # The dead do not send their past to a new listener.
        said = self.tester.collect(message_type, topic)
        self.nodes[name] = self.start(name)
        self.tester.until(lambda: said, f'a new {name}')


@contextmanager
def lockstep(folder: Path) -> Iterator[Lockstep]:
    """Yield a run that has begun; all of its nodes must end by themselves, with status 0."""
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
def test_every_node_hangs_in_turn(computed: LogContents, tmp_path: Path) -> None:
    """Nothing is lost and nothing is different: nobody goes on without the other."""
    with lockstep(tmp_path) as run:
        for name in NODES:
            run.goes_on()
            run.nodes[name].signal(signal.SIGSTOP)
            # The reference is 2 s ahead, and the recorder's queue 0.8 s long.
            stands_still(run)
            run.nodes[name].signal(signal.SIGCONT)
    live = read_log(tmp_path / '0.mcap')
    for topic in ('joint_states', 'effort_commands', 'controller/tracking_error', 'odom', 'tf'):
        assert live.stamps(topic) == computed.stamps(topic), topic
        assert live.messages[topic] == computed.messages[topic], topic


def stands_still(run: Lockstep) -> None:
    """Wait until nothing has come for a while."""
    seen, since = -1, 0.0

    def has_stood() -> bool:
        nonlocal seen, since
        if seen != len(run.stamps):
            seen, since = len(run.stamps), time.monotonic()
        return time.monotonic() > since + 0.3

    run.tester.until(has_stood, 'a run that stands still')


@pytest.mark.slow
def test_every_node_is_killed_in_turn(computed: LogContents, tmp_path: Path) -> None:
    """Each successor takes up the run; a new plant begins it again; all come to their end."""
    with lockstep(tmp_path) as run:
        run.goes_on()
        run.pause(on=True)
        run.replace('trajectory', String, 'trajectory/parameters')
        run.pause(on=False)
        run.goes_on()
        # In mid-run: the plant waits for its successor.
        run.replace('controller', String, 'controller/parameters')
        run.goes_on()
        run.pause(on=True)
        run.replace('recorder', Time, 'recorder/progress')
        run.pause(on=False)
        run.goes_on()
        run.replace('plant', String, 'plant/parameters')
    live = read_log(tmp_path / '1.mcap')
    stamps = live.stamps('joint_states')
    begin = len(stamps) - stamps[::-1].index(0) - 1
    assert live.messages['joint_states'][begin:] == computed.messages['joint_states']
    # Before that, too, every state and every torque is that of the run.
    for log in ('0.mcap', '1.mcap'):
        contents = read_log(tmp_path / log)
        for topic in ('joint_states', 'effort_commands'):
            assert set(contents.messages[topic]) <= set(computed.messages[topic]), (log, topic)
            assert contents.messages[topic]
