# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Play node: a running robot on a page in a browser, and its parameters there."""

from __future__ import annotations

from pathlib import Path
import re
from typing import Any

from helpers.command_process import COMPILING
from helpers.processes import BOUNDED, PAPER, Peer, peer, processes, ros_arguments
from helpers.webdriver import Browser, browser, needs_webdriver, PATIENCE
from masmc_ros.cli.main import main
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.scenario.scenario import load_scenario
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import String

NODES = ('recorder', 'trajectory', 'controller', 'plant')

RIGHT = '\ue014'
"""Key of WebDriver: arrow to the right, one step of a slider."""

CLICK = """
const found = [...document.querySelectorAll('button')].filter((b) => b.innerText == arguments[0]);
if (found.length) found[0].click();
return found.length > 0;
"""

MARKED = """
const plots = Object.values(window.__viserTestpoints?.uplots ?? {});
return plots.length == 3 && plots.every((plot) => plot.chart.data[1].includes(1));
"""

SLIDER = """
const slider = document.querySelectorAll('[role=slider]')[arguments[0]];
return slider.getAttribute('aria-valuenow') == arguments[1];
"""

LINKED = """
return [...document.querySelectorAll('a')].some((link) => link.download == 'report.html');
"""

SHOWN = 'return document.body.innerText.includes(arguments[0]);'
HIDDEN = 'return !document.body.innerText.includes(arguments[0]);'


def value(tester: Peer, name: str) -> Any:
    """Return a parameter of the controller, requested from the controller."""
    request = GetParameters.Request(names=[name])
    response = tester.call(GetParameters, '/controller/get_parameters', request)
    return parameter_value_to_python(response.values[0])


def click(page: Browser, label: str) -> None:
    page.until(CLICK, f'a button {label}', label)


def wait_for_text(page: Browser, text: str) -> None:
    page.until(SHOWN, text, text)


@needs_webdriver
@pytest.mark.slow
def test_play_slider_changes_running_controller(tmp_path: Path) -> None:
    pytest.importorskip('viser')
    with processes(tmp_path) as started, peer(started.domain) as tester:
        recording = tmp_path / 'run.mcap'
        play = started.start(
            'play', '--ros-args', '-p', 'port:=0', '-p', f'recording:={recording}'
        )
        records = tester.collect(String, 'plant/parameters')
        address = tester.until(lambda: re.search(r'http://\S+', '\n'.join(play.stderr())))[0]
        started.start_all(
            *ros_arguments(
                PAPER,
                duration=0.0,
                plant__pacing='realtime',
                # The page needs a controller at work, however late its torques are.
                controller__runaway_detection=False,
                recorder__output=recording,
                **BOUNDED,
            ),
            nodes=NODES,
        )
        with browser(tmp_path) as page:
            page.open(address)
            wait_for_text(page, 'controller: active')
            assert 'Estimates / true value' in page.text()

            # The node did not start these robots: it asks once, and the slider returns.
            page.press('[role=slider]', RIGHT)
            wait_for_text(page, 'Command this robot?')
            page.until(SLIDER, 'a slider that follows the node', 0, '100')
            assert value(tester, 'k_s1') == 100.0
            click(page, 'Allow commands')
            page.until(HIDDEN, 'no question', 'Command this robot?')

            page.press('[role=slider]', 10 * RIGHT)
            tester.until(lambda: value(tester, 'k_s1') == 110.0, 'the new gain')
            wait_for_text(page, 'k_s1: 110.0')
            # On a busy machine the browser may draw after the mark has left the window of 20 s.
            for gain in (130.0, 150.0, 170.0, 110.0):
                tester.change('controller', k_s1=gain)
                if page.result(MARKED, patience=PATIENCE / 3.0):
                    break
            else:
                raise AssertionError(f'no mark of a change in every plot\n{page.text()}')
            tester.change('controller', k_s1=110.0)
            wait_for_text(page, 'k_s1: 110.0')

            tester.change('controller', k_s2=120.0)
            page.until(SLIDER, 'a slider that follows the node', 1, '120')

            click(page, 'Push')
            tester.until(
                lambda: any('push.torque' in read_record(r.data).changed for r in records),
                'a push',
            )
            click(page, 'Report this run')
            # A process of a low priority writes it.
            assert page.result(LINKED, patience=COMPILING), page.text()

            click(page, 'Disable')
            wait_for_text(page, 'controller: inactive')
            click(page, 'Save as YAML')
            saved = tmp_path / 'masmc.yaml'
            tester.until(saved.exists, 'the saved file')
        assert play.process.poll() is None
        # The page has gone; the parameters stay.
        assert value(tester, 'k_s1') == 110.0
    control = load_scenario(str(saved))['controller']
    assert (control['k_s1'], control['k_s2']) == ((110.0,) * 4, (120.0,) * 4)
    log = tmp_path / 'saved.mcap'
    assert main(['simulate', str(saved), '--set', 'duration=0.2', '--output', str(log)]) == 0
    assert log.exists()
