# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Preparation of the compiled code of all laws before a live change."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
import os
from pathlib import Path
import subprocess
import sys

from masmc_ros.jit.compiled import is_interpreted
from masmc_ros.law import registry
from masmc_ros.law.smc import SMC
from masmc_ros.loop import law_change, law_code
from masmc_ros.loop.closed_loop import control_tick, post_update
from masmc_ros.loop.controller import Controller
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml'
TIMEOUT = 60.0


@pytest.mark.slow
@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_preparation_loaded_live_change_compiles_nothing() -> None:
    law_code.load(TWO_LINK, law_code.laws_loaded_at_start())
    compiled = len(control_tick.signatures), len(post_update.signatures)
    values = load_scenario(str(PAPER), ('controller.projection.lower=0.5',))['controller']
    controller = Controller(robot_of(values), 1e-3, values)
    for law in ('smc', 'rasmc'):
        for switching in registry.SWITCHING:
            controller.change({'law': law, 'switching': switching})
            controller.tick(np.ones(7), np.zeros(7), np.zeros(12))
            assert np.isfinite(controller.torque).all()
    assert (len(control_tick.signatures), len(post_update.signatures)) == compiled


def test_preparation_loads_only_laws_that_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An installed law for smaller robots does not stop a controller of another law."""
    small = replace(SMC, name='small', most_parameters=3)
    monkeypatch.setattr(law_code, 'laws', lambda: (small,))
    monkeypatch.setattr(law_change, 'mark', lambda mechanism: tmp_path)
    loaded: list[str] = []
    monkeypatch.setattr(
        law_change, 'load', lambda mechanism, which: loaded.extend(law.name for law in which)
    )
    assert law_change.prepare(TWO_LINK) is None
    assert loaded == []


def test_preparation_law_source_changed_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    marks = set()
    for number in range(2):
        path = tmp_path / f'law_{number}.py'
        path.write_text(f'def torque():\n    return {number}\n', encoding='utf-8')
        names: dict[str, object] = {}
        exec(compile(path.read_text(encoding='utf-8'), str(path), 'exec'), names)
        # Under another name, because a law registers itself.
        law = replace(SMC, name='changed', torque=names['torque'])
        monkeypatch.setattr(law_code, 'laws', lambda law=law: (law,))
        marks.add(law_code.mark(TWO_LINK))
    assert len(marks) == 2


def test_preparation_process_has_no_real_time_priority() -> None:
    script = (
        'import os, sys\n'
        'from masmc_ros.loop.compiling_process import started\n'
        'from masmc_ros.robot.two_link.paper_robot import TWO_LINK\n'
        'try:\n'
        '    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))\n'
        'except OSError:\n'
        '    sys.exit(77)\n'
        'process = started(TWO_LINK, None)\n'
        'awaited = started(TWO_LINK, None, is_awaited=True)\n'
        'policies = [os.sched_getscheduler(p.pid) for p in (process, awaited)]\n'
        'for p in (process, awaited):\n'
        '    p.kill()\n'
        'sys.exit(policies != [os.SCHED_IDLE, os.SCHED_OTHER])\n'
    )
    status = subprocess.run([sys.executable, '-c', script], timeout=TIMEOUT).returncode
    if status == 77:
        pytest.skip('no permission for real-time priority')
    assert status == 0


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_preparation_pauses_while_a_request_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(law_change, 'mark', lambda mechanism: tmp_path / 'not there')
    prepared = law_change.Preparation(TWO_LINK)
    first = prepared._process
    assert first is not None
    with prepared.paused(), prepared.paused():
        assert first.returncode is not None
        assert prepared._process is first
    second = prepared._process
    assert second is not None
    assert second is not first
    assert second.poll() is None
    prepared.close()
    assert second.returncode is not None
    with prepared.paused():
        pass
    assert prepared._process is None


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_preparation_process_node_exits_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(law_change, 'mark', lambda mechanism: tmp_path / 'not there')
    process = law_change.prepare(TWO_LINK)
    assert isinstance(process, subprocess.Popen)
    try:
        with suppress(PermissionError):
            # Tests on all processors leave no time to a process for idle ones.
            os.sched_setscheduler(process.pid, os.SCHED_OTHER, os.sched_param(0))
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(TIMEOUT) == 0
    finally:
        process.kill()
        process.wait()
