# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Generator of CHANGELOG.rst, which the release tools of ROS 2 read, from CHANGELOG.md."""

from __future__ import annotations

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parent.parent


def as_rst(markdown: str) -> str:
    """Return a changelog in the format of REP-132."""
    lines = []
    title = 'Changelog for package masmc_ros'
    bar = '^' * len(title)
    lines += [bar, title, bar]
    for line in markdown.splitlines()[1:]:
        if line.startswith('## '):
            version = line[3:].replace(' (unreleased)', '')
            heading = 'Forthcoming' if '(unreleased)' in line else version
            lines += [heading, '-' * len(heading)]
        else:
            line = re.sub(r'`([^`]+)`', r'``\1``', line)
            lines.append(re.sub(r'^- ', '* ', line))
    return re.sub(r'\n{3,}', '\n\n', '\n'.join(lines)) + '\n'


if __name__ == '__main__':
    text = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    (ROOT / 'CHANGELOG.rst').write_text(as_rst(text), encoding='utf-8')
