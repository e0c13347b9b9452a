# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Services of the plant: pause, step and reset, in lockstep and in real time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time
from typing import Any, NamedTuple

from helpers.log_contents import read_log
from helpers.processes import PAPER, Peer, peer, Processes, processes, ros_arguments, shortened
from masmc_ros.cli.main import main
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.messages.stamps import header_stamp
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

PERIOD = 1_000_000


class Robot(NamedTuple):
    """Plant and its messages; the test is its controller."""

    tester: Peer
    commands: Any
    states: list[bytes]
    """States without repetitions."""
    all_states: list[bytes]
    """States with repetitions."""

    def call(self, name: str, request: Any) -> Any:
        kind = Trigger if isinstance(request, Trigger.Request) else SetBool
        return self.tester.call(kind, f'/plant/{name}', request, again=name == 'pause')

    def pause(self) -> int:
        """Pause the plant; return the last tick when its state and all earlier have arrived."""
        answer = self.call('pause', SetBool.Request(data=True))
        assert answer.success
        tick = round(paused_at(answer.message) / (1e-9 * PERIOD))
        self.wait_for_state(tick)
        return tick

    def resume(self) -> None:
        assert self.call('pause', SetBool.Request(data=False)).success

    def step(self) -> Any:
        return self.call('step', Trigger.Request())

    def stamps(self) -> list[int]:
        return [header_stamp(raw) for raw in self.states]

    def wait_for_state(self, tick: int) -> JointStateCdr:
        """Return the last state once it is that of a tick."""
        self.tester.until(
            lambda: self.states and header_stamp(self.states[-1]) == tick * PERIOD,
            f'state {tick}',
        )
        state = JointStateCdr()
        assert state.load(self.states[-1])
        return state

    def send(self, tick: int, *torque: float) -> None:
        """Send the command that answers the state of a tick."""
        command = EffortCdr()
        command.data[:] = torque
        command.set_stamp(tick * PERIOD)
        self.commands.publish(command.to_bytes())


def paused_at(message: str) -> float:
    """Return the time in s in the response to a pause."""
    words, _, time_text = message.partition(' = ')
    assert words == 'paused at t'
    return float(time_text.removesuffix(' s'))


@contextmanager
def robot(folder: Path, pacing: str, **settings: object) -> Iterator[tuple[Processes, Robot]]:
    """Yield a single plant that has started, at tick 0 in lockstep."""
    with processes(folder) as started, peer(started.domain) as tester:
        states: list[bytes] = []
        all_states: list[bytes] = []

        def on_state(raw: bytes) -> None:
            all_states.append(raw)
            # A paused plant repeats its state.
            if states[-1:] != [raw]:
                states.append(raw)

        tester.subscribe(JointState, 'joint_states', on_state, raw=True)
        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        arguments = {'pacing': pacing, 'wait_for': '[peer]', **settings}
        started.start('plant', *ros_arguments(PAPER, duration=0.0, **arguments))
        tester.wait_for_subscribers(commands)
        tester.until(lambda: states, 'the first state')
        yield started, Robot(tester, commands, states, all_states)


def test_plant_lockstep_paused_advances_by_steps(tmp_path: Path) -> None:
    with robot(tmp_path, 'lockstep') as (_, plant):
        assert not plant.step().success
        plant.wait_for_state(0)
        plant.pause()
        plant.send(0, 1.0, 2.0, 3.0, 4.0)
        assert plant.step().success
        assert plant.wait_for_state(1).effort.tolist()[3:] == [1.0, 2.0, 3.0, 4.0]
        # A step that is requested before its command waits for it.
        assert plant.step().success
        plant.send(1, 5.0, 6.0, 7.0, 8.0)
        assert plant.wait_for_state(2).effort.tolist()[3:] == [5.0, 6.0, 7.0, 8.0]
        plant.send(2, 1.0, 1.0, 1.0, 1.0)
        # The response to the pause shows the effect of that command.
        plant.pause()
        plant.resume()
        plant.wait_for_state(3)
        plant.send(3, 0.0, 0.0, 0.0, 0.0)
        plant.wait_for_state(4)
        assert plant.stamps() == [tick * PERIOD for tick in range(5)]


def test_plant_paused_before_start_waits_at_first_state(tmp_path: Path) -> None:
    """The answer to the first state is applied after the run continues."""
    file = shortened(tmp_path, 0.3, wait_for='[controller, trajectory, peer]')
    with processes(tmp_path) as started:
        started.start('plant', *ros_arguments(file))
        with peer(started.domain, 'early') as tester:
            states = tester.collect(JointState, 'joint_states', raw=True)
            answers = tester.collect(Float64MultiArray, 'effort_commands', raw=True)
            answer = tester.call(SetBool, '/plant/pause', SetBool.Request(data=True))
            assert answer.message == 'paused before the start of the run'
            assert not tester.call(Trigger, '/plant/step', Trigger.Request()).success
            started.start_all(*ros_arguments(file), nodes=('controller', 'trajectory'))
            with peer(started.domain):
                tester.until(lambda: states and answers, 'the first state and its answer')
            assert [header_stamp(raw) for raw in states] == [0]
            assert tester.call(SetBool, '/plant/pause', SetBool.Request(data=False)).success
            tester.until(lambda: header_stamp(states[-1]) == 300 * PERIOD, 'the last state')
        assert set(started.wait().values()) == {0}, started.output()


def test_plant_pause_response_has_time_of_standstill(tmp_path: Path) -> None:
    """A request before the start may arrive later; the robot stands when it is answered."""
    file = shortened(tmp_path, 30.0, wait_for='[controller, trajectory, peer]')
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = tester.collect(JointState, 'joint_states', raw=True)
        started.start_all(*ros_arguments(file), nodes=('plant', 'controller', 'trajectory'))
        message = tester.call(SetBool, '/plant/pause', SetBool.Request(data=True)).message
        stamp = 0.0 if message == 'paused before the start of the run' else paused_at(message)
        tester.until(lambda: states and header_stamp(states[-1]) == round(1e9 * stamp), message)
        start = time.monotonic()
        tester.until(lambda: time.monotonic() > start + 0.2)
        assert header_stamp(states[-1]) == round(1e9 * stamp)


def test_plant_lockstep_command_before_discovery_applied(tmp_path: Path) -> None:
    command = EffortCdr()
    command.data[:] = [1.0, 2.0, 3.0, 4.0]
    command.set_stamp(0)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = tester.collect(JointState, 'joint_states', raw=True)
        started.start('plant', *ros_arguments(PAPER, wait_for='[peer]', duration=0.0))
        tester.until(lambda: states, 'the first state')
        with peer(started.domain, 'new') as new:
            commands = new.publisher(Float64MultiArray, 'effort_commands', latched=True)
            commands.publish(command.to_bytes())
            tester.until(lambda: len(states) >= 2, 'state 1')
    state = JointStateCdr()
    assert state.load(states[1])
    assert state.effort.tolist()[3:] == [1.0, 2.0, 3.0, 4.0]


def test_plant_lockstep_reset_restarts_run(tmp_path: Path) -> None:
    with robot(tmp_path, 'lockstep', initial_velocity='[0.5, 0.1, 0.2, 0.3]') as (_, plant):
        for tick in range(3):
            plant.wait_for_state(tick)
            plant.send(tick, 1.0, -1.0, 0.5, 0.25)
        plant.wait_for_state(3)
        assert plant.call('reset', Trigger.Request()).success
        plant.wait_for_state(0)
        plant.send(3, 9.0, 9.0, 9.0, 9.0)  # the answer to a state before the reset
        for tick in range(3):
            plant.wait_for_state(tick)
            plant.send(tick, 1.0, -1.0, 0.5, 0.25)
        plant.wait_for_state(3)
        assert plant.states[:4] == plant.states[4:]


def test_lockstep_run_after_reset_equals_simulation(tmp_path: Path) -> None:
    """Controller and trajectory follow the plant back to t = 0."""
    # Without an end: the run must not end before the reset.
    file = shortened(tmp_path, 0.0, wait_for='[controller, trajectory, recorder, peer]')
    log, computed = tmp_path / 'run.mcap', tmp_path / 'computed.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        stamps = tester.watch_time()
        started.start_all(*ros_arguments(file, recorder__output=log))
        tester.until(lambda: stamps[-1] >= 300 * PERIOD, 'tick 300')
        reset = tester.call(Trigger, '/plant/reset', Trigger.Request(), again=False)
        assert reset.success
        tester.until(lambda: stamps.count(0) == 2 and stamps[-1] >= 2000 * PERIOD, 'tick 2000')
        started.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}, started.output()
    live = read_log(log)
    last = live.stamps('joint_states')[-1]
    assert last is not None
    settings = ['--set', f'duration={last * 1e-9:.3f}', '--output', str(computed)]
    assert main(['simulate', str(file), *settings]) == 0
    expected = read_log(computed)
    for topic in ('joint_states', 'effort_commands', 'controller/parameter_estimate'):
        starts = [i for i, stamp in enumerate(live.stamps(topic)) if stamp == 0]
        assert len(starts) == 2, topic
        again = live.messages[topic][starts[1]:]
        # The last state may have no answer.
        assert len(expected.messages[topic]) - len(again) <= (topic != 'joint_states'), topic
        assert again == expected.messages[topic][: len(again)], topic


def test_plant_real_time_paused_state_repeated(tmp_path: Path) -> None:
    with robot(tmp_path, 'realtime') as (_, plant):
        plant.send(0, 0.0, 0.0, 0.0, 0.0)
        plant.tester.until(lambda: len(plant.states) > 20, 'motion')
        plant.pause()
        count, first = len(plant.states), len(plant.all_states)
        plant.tester.until(lambda: len(plant.all_states) > first + 5, 'repeated states')
        assert len(plant.states) == count
        assert set(plant.all_states[first:]) == {plant.states[-1]}
        plant.resume()
        plant.tester.until(lambda: len(plant.states) > count + 50, 'motion again')
        stamps = plant.stamps()
        assert stamps == [tick * PERIOD for tick in range(len(stamps))]
        assert plant.call('reset', Trigger.Request()).success
        plant.tester.until(lambda: plant.stamps().count(0) == 2, 'the state at t = 0')


def test_plant_real_time_step_keeps_last_command(tmp_path: Path) -> None:
    """The age of a command does not increase while the plant is paused."""
    timeout = 0.5  # longer than the delays of the plant on a busy machine
    with robot(tmp_path, 'realtime', command_timeout=timeout) as (_, plant):
        plant.send(0, 0.0, 0.0, 0.0, 0.0)
        plant.tester.until(lambda: len(plant.states) > 5, 'motion')
        plant.send(plant.pause(), 0.5, 0.25, 1.0, -1.0)
        state = JointStateCdr()

        def applied() -> list[float]:
            """Advance by one step; return its torque."""
            count = len(plant.states)
            assert plant.step().success
            plant.tester.until(lambda: len(plant.states) > count, 'a state')
            assert state.load(plant.states[-1])
            return state.effort.tolist()[3:]

        plant.tester.until(lambda: applied() == [0.5, 0.25, 1.0, -1.0], 'the command')
        start = time.monotonic()
        plant.tester.until(lambda: time.monotonic() > start + 1.5 * timeout)
        for _ in range(3):
            assert applied() == [0.5, 0.25, 1.0, -1.0]
        first = len(plant.states) - 3
        plant.resume()
        plant.tester.until(lambda: len(plant.states) > first + 3, 'motion again')
        assert state.load(plant.states[first + 3])
        assert state.effort.tolist()[3:] == [0.5, 0.25, 1.0, -1.0]


def test_plant_real_time_command_timeout_ends_torque(tmp_path: Path) -> None:
    # Longer than the delays on a busy machine: the command must not time out before its use.
    with robot(tmp_path, 'realtime', command_timeout=0.5) as (started, plant):
        plant.send(0, 0.5, 0.25, 1.0, -1.0)

        def applied() -> list[float]:
            state = JointStateCdr()
            assert state.load(plant.states[-1])
            return list(state.effort.tolist()[3:])

        plant.tester.until(lambda: applied() == [0.5, 0.25, 1.0, -1.0], 'torque')
        plant.tester.until(lambda: applied() == [0.0] * 4, 'no torque')
        assert len([line for line in started.output().splitlines() if 'no command' in line]) == 1


def test_plant_changed_parameter_is_published(tmp_path: Path) -> None:
    """The log of a run contains the change with its tick."""
    with processes(tmp_path) as started, peer(started.domain) as tester:
        records = tester.collect(String, 'plant/parameters')
        started.start('plant', *ros_arguments(pacing='realtime', duration=0.0, wait_for='[""]'))
        stamps = tester.watch_time()
        tester.until(lambda: stamps[-1] > 0 and records, 'states and parameters')
        tester.change('plant', real_time_factor=0.5)
        tester.until(lambda: len(records) > 1, 'a record of the change')
    first, last = (read_record(record.data) for record in (records[0], records[-1]))
    assert first.is_start
    assert last.changes == {'real_time_factor': 0.5}
    assert last.tick > 0
