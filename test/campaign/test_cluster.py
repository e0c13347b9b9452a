# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Campaigns on a Dask cluster of real worker processes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from distributed import Client, LocalCluster
from helpers.campaigns import assert_equal, campaign_with, DRAWS, PAPER, SETTINGS
import masmc_ros
from masmc_ros.campaign.dataset import arrays, Dataset
from masmc_ros.campaign.engine import carry_out
from masmc_ros.campaign.runs import rows
from masmc_ros.cli.main import main
from masmc_ros.compare.law_comparison import comparison_of, compute
from masmc_ros.errors import InputError
import pytest

pytestmark = pytest.mark.slow


def cluster_of(workers: int) -> LocalCluster:
    """Return a cluster of processes."""
    return LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=':0',
        silence_logs='CRITICAL',
    )  # fmt: skip


@contextmanager
def foreign_worker(cluster: LocalCluster, path: str) -> Iterator[None]:
    """Run a worker whose Python imports from a path first."""
    command = [sys.executable, '-m', 'distributed.cli.dask_worker', cluster.scheduler_address]
    options = ['--nworkers', '1', '--nthreads', '1', '--no-nanny', '--no-dashboard']
    worker = subprocess.Popen(
        [*command, *options], env={**os.environ, 'PYTHONPATH': path}, cwd=path,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        cluster.wait_for_workers(1)
        yield
    finally:
        worker.terminate()
        worker.wait()


def test_rows_are_those_of_one_process_if_worker_is_killed(tmp_path: Path) -> None:
    campaign, killed = campaign_with(640), []
    with cluster_of(2) as cluster:
        victim = cluster.workers[0].pid

        def kill(count: int) -> None:
            if count and not killed:
                os.kill(victim, signal.SIGKILL)
                killed.append(victim)

        dataset = carry_out(
            campaign, tmp_path, scheduler=cluster.scheduler_address, advance=kill
        )
    assert killed
    assert len(list(tmp_path.iterdir())) > 10
    assert_equal(arrays(dataset.table()), rows(campaign, 0, 640))


def test_killed_coordinator_continues_on_the_same_cluster(tmp_path: Path) -> None:
    folder, total = tmp_path / 'out', 640
    options = ['monte-carlo', PAPER, '--runs', str(total), '--output', str(folder)]
    options += [word for text in DRAWS for word in ('--draw', text)]
    options += [word for text in SETTINGS for word in ('--set', text)]
    with cluster_of(2) as cluster:
        options += ['--scheduler', cluster.scheduler_address]
        command = [sys.executable, '-m', 'masmc_ros.cli.main', *options]
        coordinator = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        try:
            while coordinator.poll() is None and not list(folder.glob('runs/part-*.parquet')):
                time.sleep(0.01)
        finally:
            coordinator.kill()
            coordinator.wait()
        known = {path: path.stat().st_mtime_ns for path in folder.glob('runs/part-*.parquet')}
        assert known
        assert main(options) == 0
    assert len(list(folder.glob('runs/part-*.parquet'))) > len(known)
    assert {path: path.stat().st_mtime_ns for path in known} == known
    campaign = campaign_with(total)
    assert_equal(arrays(Dataset(folder / 'runs', campaign).table()), rows(campaign, 0, total))


def test_end_of_scheduler_prints_one_line(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, '-m', 'distributed.cli.dask_scheduler', '--host', '127.0.0.1',
         '--port', '0', '--no-dashboard', '--scheduler-file', str(tmp_path / 'scheduler.json')],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as scheduler:  # fmt: skip
        try:
            while not (tmp_path / 'scheduler.json').exists():
                time.sleep(0.05)
            address = json.loads((tmp_path / 'scheduler.json').read_text())['address']
            command = [sys.executable, '-m', 'distributed.cli.dask_worker', address]
            with subprocess.Popen(
                [*command, '--no-nanny', '--no-dashboard', '--death-timeout', '20'],
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            ) as worker:  # fmt: skip
                try:
                    with Client(address) as client:
                        client.wait_for_workers(1, timeout=60)
                    with pytest.raises(InputError, match='connection to the Dask scheduler was'):
                        carry_out(
                            campaign_with(64_000), tmp_path / 'out', scheduler=address,
                            advance=lambda count: scheduler.kill() if count else None,
                        )  # fmt: skip
                finally:
                    worker.kill()
        finally:
            scheduler.kill()


def test_comparison_on_cluster_has_rows_of_threads() -> None:
    comparison = comparison_of(PAPER, ('duration=0.2',), 'smc,rasmc', 'noise', 8)
    with cluster_of(2) as cluster:
        distributed = compute(comparison, scheduler=cluster.scheduler_address)
    assert_equal(distributed, compute(comparison, threads=2))


def shadow(folder: Path, *, is_whole: bool) -> str:
    """Return a folder with this package under another version, or with one that is broken."""
    own, other = Path(masmc_ros.__file__).parent, folder / 'masmc_ros'
    other.mkdir()
    text = (own / '__init__.py').read_text(encoding='utf-8')
    text = text.replace(masmc_ros.__version__, '9.9.9')
    if not is_whole:
        text = "raise ImportError('a part is missing')\n"
    (other / '__init__.py').write_text(text, encoding='utf-8')
    for path in own.iterdir() if is_whole else ():
        if path.name != '__init__.py':
            (other / path.name).symlink_to(path)
    return str(folder)


def line_of(scheduler: str, output: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the line of a rejected cluster."""
    options = ['--draw', 'controller.k_s1=uniform:1:2', '--output', str(output)]
    assert main(['monte-carlo', PAPER, *options, '--scheduler', scheduler]) == 2
    error_text = capsys.readouterr().err
    assert error_text.count('\n') == 1
    assert not output.exists()
    return error_text


@pytest.mark.parametrize(
    ('is_whole', 'line'),
    [(True, 'has masmc_ros 9.9.9; expected 0.1.0'), (False, 'a worker cannot import masmc_ros')],
)
def test_worker_of_another_version_is_rejected(
    is_whole: bool, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = shadow(tmp_path, is_whole=is_whole)
    with cluster_of(0) as cluster, foreign_worker(cluster, path):
        assert line in line_of(cluster.scheduler_address, tmp_path / 'out', capsys)


def test_scheduler_without_workers_and_no_scheduler_are_rejected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with cluster_of(0) as cluster:
        address = cluster.scheduler_address
        assert 'no workers' in line_of(address, tmp_path / 'out', capsys)
    assert 'no Dask scheduler answers' in line_of(address, tmp_path / 'out', capsys)
    assert 'no Dask scheduler answers' in line_of('nonsense://x', tmp_path / 'out', capsys)
