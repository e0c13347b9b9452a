# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files of a dataset that another process writes, or that are damaged."""

from __future__ import annotations

from pathlib import Path

from helpers.campaigns import campaign_with
from masmc_ros.campaign.dataset import Dataset, reserved
from masmc_ros.campaign.engine import carry_out
from masmc_ros.errors import InputError
import numpy as np
import pytest


def test_dataset_of_another_process_is_rejected(tmp_path: Path) -> None:
    """Parts of two processes overlap if their numbers of threads differ."""
    with reserved(tmp_path), pytest.raises(InputError, match='another process writes'):
        carry_out(campaign_with(4), tmp_path)
    with reserved(tmp_path / 'new' / 'runs'):
        pass
    assert not list(tmp_path.iterdir())


def test_runs_in_two_files_are_rejected(tmp_path: Path) -> None:
    campaign = campaign_with(8)
    for first, count in ((0, 4), (4, 2), (5, 3)):
        dataset = Dataset(tmp_path, campaign)
        dataset.write({'run': np.arange(first, first + count)})
    with pytest.raises(InputError, match='run 5 is in two files; remove the folder'):
        Dataset(tmp_path, campaign)


def test_damaged_file_is_named_with_remedy(tmp_path: Path) -> None:
    """A power cut can leave an empty file with its final name."""
    path = tmp_path / 'part-0000000000-4.parquet'
    path.touch()
    with pytest.raises(InputError, match=f'{path}: no readable Parquet file .*; remove it'):
        Dataset(tmp_path, campaign_with(4))
