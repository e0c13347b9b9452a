# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests: compiling, or a machine that is held up, is no failure."""

from __future__ import annotations

from collections.abc import Generator
import re

from hypothesis import HealthCheck, settings
import pytest

from masmc_ros.optional import PACKAGES

settings.register_profile(
    'any machine', deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile('any machine')

# websockets of Ubuntu 24.04 has no `websockets.sync` yet.
INSTALLED_BY = {**PACKAGES, 'websockets': "'websockets>=11'"}
MISSING = re.compile(rf"ModuleNotFoundError: .*\b({'|'.join(INSTALLED_BY)})\b")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Skip a file whose imports need what rosdep does not know; one such would stop all others."""
    report = yield
    missing = MISSING.search(str(report.longrepr)) if report.failed else None
    if missing is not None:
        reason = f'Skipped: {missing[1]} is not installed; pip install {INSTALLED_BY[missing[1]]}'
        report.outcome = 'skipped'
        report.longrepr = str(collector.path), 1, reason
    return report
