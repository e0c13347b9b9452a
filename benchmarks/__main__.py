# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Command that prints all benchmarks, or the named ones, and writes them to bench.json.

usage: python -m benchmarks [--quick] [kernel] [campaign] [peers] [whole_process] [lockstep]
[recording]; --quick: fewer runs of campaigns, whose figures mean little
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
import sys

from benchmarks import campaign, kernel, lockstep, peers, recording, whole_process
from benchmarks.measure import Measure, write

PARTS: dict[str, Callable[[], Iterator[Measure]]] = {
    'kernel': kernel.measures,
    'campaign': campaign.measures,
    'peers': peers.measures,
    'whole_process': whole_process.measures,
    'lockstep': lockstep.measures,
    'recording': recording.measures,
}


def main(names: list[str]) -> int:
    """Run the benchmarks and return the exit status."""
    parts = PARTS
    if '--quick' in names:
        names = [name for name in names if name != '--quick']
        parts = {**PARTS, 'campaign': partial(campaign.measures, campaign.QUICK)}
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        print(f"no benchmark '{unknown[0]}'; known are {', '.join(PARTS)}", file=sys.stderr)
        return 2
    results: list[Measure] = []
    for name in names or PARTS:
        for measure in parts[name]():
            print(measure, flush=True)
            results.append(measure)
    write(results, Path('bench.json'))
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
