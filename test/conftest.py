# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Settings of all tests: order of files, time limits, signals, and missing packages."""

from __future__ import annotations

from collections.abc import Generator
import gc
from pathlib import Path
import re
import signal

from hypothesis import HealthCheck, settings
from masmc_ros.optional import PACKAGES
import pytest

settings.register_profile(
    'any machine', deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile('any machine')

# Imported objects are permanent; the garbage collector need not scan them.
gc.disable()

# Background jobs and nohup ignore these signals, and their children would inherit this.
for number, usual in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, usual)

# websockets of Ubuntu 24.04 has no `websockets.sync` yet, and sybil is not in it.
INSTALLED_BY = {**PACKAGES, 'sybil': 'sybil', 'websockets': "'websockets>=11'"}
MISSING = re.compile(
    r'ModuleNotFoundError: .*\b(?P<module>rclpy|\w+_msgs|std_srvs|(?P<pip>'
    + '|'.join(INSTALLED_BY)
    + r'))\b'
)


LONG = (
    'package/test_documentation_examples.py',
    'nodes/test_law_change_nodes.py',
    'loop/test_latency.py',
    'loop/test_tree_run.py',
    'campaign/test_cluster.py',
    'loop/test_tree_sizes.py',
    'loop/test_tree_tasks.py',
    'loop/test_hybrid_interface.py',
    'nodes/test_hostile_input.py',
    'loop/test_same_bits.py',
    'nodes/recorder/test_recorder_killed.py',
    'loop/test_lanes.py',
    'log/test_damaged_logs.py',
    'robot/test_tree_formulas.py',
    'nodes/recorder/test_listeners_killed.py',
    'loop/test_tree_friction.py',
    'nodes/test_drives_nodes.py',
    'nodes/test_random_changes.py',
    'campaign/test_rows.py',
    'control/test_pauses.py',
    'identification/test_identify.py',
    'nodes/test_shipped_files_nodes.py',
    'nodes/test_busy_machine.py',
    'report/test_report_figures.py',
    'loop/test_other_mechanism.py',
    'robot/test_tree_natural_adaptation.py',
    'nodes/test_composed_nodes.py',
    'cli/test_param_command.py',
)
"""Files that take minutes, longest first: those with slow tests, then the others.

If a process started one of them last, all other processes would wait for it.
"""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort long files first; pytest-xdist distributes files to processes in this order."""
    folder = Path(__file__).parent
    ranks = {folder / name: rank for rank, name in enumerate(LONG)}
    items.sort(key=lambda item: ranks.get(item.path, len(LONG)))


def pytest_collection_finish() -> None:
    """Enable the garbage collector for objects that are created from now on."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """
    Skip a file whose imports need ROS or a missing pip package.

    Otherwise one such file would stop the whole collection.
    """
    report = yield
    missing = MISSING.search(str(report.longrepr)) if report.failed else None
    if missing is not None:
        remedy = f'pip install {INSTALLED_BY[missing["pip"]]}' if missing['pip'] else 'install ROS'
        reason = f'Skipped: {missing["module"]} is not installed; {remedy}'
        report.outcome = 'skipped'
        report.longrepr = str(collector.path), 1, reason
    return report
