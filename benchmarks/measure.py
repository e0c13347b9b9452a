# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""One figure of a benchmark, and the table and the file of all of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
import json
from pathlib import Path


@dataclass(frozen=True)
class Measure:
    """
    A figure and another one of the same run: machines differ, their ratio less so.

    Attributes
    ----------
    name
        what was measured.
    value
        the figure.
    unit
        its unit.
    reference
        what it is held against, '' for nothing.
    ratio
        of the value to that of the reference.
    claim
        the ratio that the documentation states, None where it states none.

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


def beside(
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
    found = [asdict(each) for each in measures]
    path.write_text(json.dumps(found, indent=2, ensure_ascii=False) + '\n', encoding='utf-8')
