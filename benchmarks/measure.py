# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of a benchmark, with their table and file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
import json
from pathlib import Path


@dataclass(frozen=True)
class Measure:
    """
    A figure and a reference of the same run: their ratio depends less on the machine.

    Attributes
    ----------
    name
        measured quantity.
    value
        figure.
    unit
        unit of the figure.
    reference
        name of the reference, '' for no reference.
    ratio
        ratio of the value to that of the reference.
    claim
        documented ratio; None if no ratio is documented.

    """

    name: str
    value: float
    unit: str
    reference: str = ''
    ratio: float | None = None
    claim: float | None = None

    def __str__(self) -> str:
        """Return a line of the table."""
        text = f'{self.name:58} {self.value:10.4g} {self.unit:5}'
        if self.ratio is None:
            return text.rstrip()
        claim = '' if self.claim is None else f' (documented: {self.claim:g})'
        return f'{text} {self.ratio:6.2f} of {self.reference}{claim}'


def compared(
    name: str,
    value: float,
    unit: str,
    reference: Measure | None,
    claim: float | None = None,
) -> Measure:
    """Return a figure with a reference that was measured in the same unit."""
    if reference is None:
        return Measure(name, value, unit, claim=claim)
    return Measure(name, value, unit, reference.name, value / reference.value, claim)


def write(measures: Iterable[Measure], path: Path) -> None:
    """Write figures as a list of JSON objects."""
    objects = [asdict(measure) for measure in measures]
    path.write_text(json.dumps(objects, indent=2, ensure_ascii=False) + '\n', encoding='utf-8')
