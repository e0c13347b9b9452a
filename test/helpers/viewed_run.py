# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Short simulated run with decoded messages, for tests of viewers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from masmc_ros.cli.main import main
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

ROOT = Path(__file__).resolve().parents[2]
PAPER = ROOT / 'config' / 'paper.yaml'


def computed_run(folder: Path, duration: float = 1.0) -> Path:
    """Return the log that `masmc simulate` writes into a folder."""
    log = folder / 'run.mcap'
    settings = ['--set', f'duration={duration}', '--output', str(log)]
    assert main(['simulate', str(PAPER), *settings]) == 0
    return log


def decoded(log: Path, *topics: str) -> Iterator[tuple[str, Any]]:
    """Yield topic and decoded message of every message of a log, or of some topics."""
    with log.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(topics=topics or None):
            yield channel.topic, message
