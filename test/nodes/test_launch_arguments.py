# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Texts of launch arguments, which reach the nodes unmodified."""

from __future__ import annotations

from collections.abc import Sequence

from helpers.child_environment import domain
from helpers.launch_file import launched, PAPER
from masmc_ros.nodes.process.command_line import parse
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

HARDWARE = 'hardware.launch.py'

TEXTS = (
    '20251126', '007', '0x1F', '1.0', '1e3', '.5', '-1', '1:30', '12_000', 'nan', '.inf', 'inf',
    'true', 'yes', 'Y', 'off', 'null', '~', '~/runs', 'a b', ' a ', 'a # b', '#a', 'a: b', 'a:=b',
    '[a, b]', '[', '{a: b}', '*a', '&a', '!a', '- a', '%a', '@a', '`a', '|', '"a"', "it's", 'a"b',
    'C:\\new', '$(a)', 'Läufe/1', '軌道', '-p', '--ros-args', '\t', 'a\nb',
)
"""Texts that YAML often reads as another type, another text, or not at all."""


def rcl_values(settings: Sequence[str], node: str, number: int) -> dict[str, object]:
    """Return the values of settings `-p NODE:NAME:=VALUE` that rcl gives a node, by name."""
    context = Context()
    rclpy.init(
        args=['--ros-args', *settings],
        context=context,
        domain_id=number,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    try:
        own = Node(node, context=context, automatically_declare_parameters_from_overrides=True)
        values = {name: p.value for name, p in own.get_parameters_by_prefix('text').items()}
        own.destroy_node()
    finally:
        context.try_shutdown()
    return values


def setting_of(name: str, file: str, **arguments: str) -> str:
    """Return the argument of the process of a launch file that sets NODE:NAME."""
    (setting,) = (
        setting
        for started in launched(file, **arguments)
        for flag, setting in zip(started.arguments, started.arguments[1:], strict=False)
        if flag == '-p' and setting.startswith(f'{name}:=')
    )
    return setting


@pytest.mark.parametrize(
    ('file', 'options', 'name'),
    [
        (PAPER, {}, 'recorder:output'),
        (PAPER, {'composed': 'true'}, 'recorder:output'),
        (PAPER, {}, 'plant:frame_prefix'),
        (PAPER, {'composed': 'true'}, 'plant:frame_prefix'),
        (PAPER, {}, 'controller:law'),
        (HARDWARE, {'params_file': 'robot.yaml'}, 'recorder:output'),
        (HARDWARE, {'params_file': 'robot.yaml'}, 'controller:pose_frame'),
    ],
)
def test_launch_argument_any_text_reaches_node(
    file: str, options: dict[str, str], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    node, _, argument = name.partition(':')
    renamed = []
    for number, text in enumerate(TEXTS):
        setting = setting_of(name, file, **options, **{argument: text})
        values = parse(['--ros-args', '-p', setting]).for_node(node).values
        assert values == {argument: text}
        # One node of rcl gets all texts, as different parameters.
        renamed += ['-p', setting.replace(name, f'{node}:text.t{number}', 1)]
    with domain() as number:
        values = rcl_values(renamed, node, number)
    assert values == {f't{number}': text for number, text in enumerate(TEXTS)}


@pytest.mark.parametrize('text', ['1e-3', '0.001'])
def test_hardware_launch_number_reaches_controller(text: str) -> None:
    setting = setting_of('controller:latency', HARDWARE, params_file='robot.yaml', latency=text)
    values = parse(['--ros-args', '-p', setting]).for_node('controller').values
    assert values == {'latency': 0.001}
