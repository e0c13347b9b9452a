# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Execution of a notebook without Jupyter: `python notebook.py FILE`, in the current folder.

Cells are plain Python, except for the line `%matplotlib inline`, which is skipped, and cells that
start with `%%writefile NAME`. The printed text of every cell must be the stored one. Jupyter would
add 30 packages to the extra `test`.
"""

from __future__ import annotations

from contextlib import redirect_stdout
import io
import json
from pathlib import Path
import sys

INLINE = '%matplotlib inline\n'
WRITE = '%%writefile '


def execute(notebook: Path) -> None:
    """Execute all cells in their order; AssertionError if a cell prints another text."""
    names: dict[str, object] = {'__name__': 'notebook'}
    for number, cell in enumerate(json.loads(notebook.read_text(encoding='utf-8'))['cells']):
        if cell['cell_type'] == 'code':
            place = f'{notebook.name}, cell {number}'
            printed = _run(''.join(cell['source']), place, names)
            stored = _stored_text(cell)
            assert printed == stored, f'{place}:\n{printed}\n!=\n{stored}'


def _run(source: str, place: str, names: dict[str, object]) -> str:
    """Execute a cell and return the text it prints."""
    if source.startswith(WRITE):
        file, _, content = source.removeprefix(WRITE).partition('\n')
        Path(file).write_text(content, encoding='utf-8')
        return f'Writing {file}\n'
    with redirect_stdout(io.StringIO()) as output:
        exec(compile(source.removeprefix(INLINE), place, 'exec'), names)
    return output.getvalue()


def _stored_text(cell: dict[str, list[dict[str, object]]]) -> str:
    """Return the text that a cell printed when the notebook was saved."""
    texts = [output['text'] for output in cell['outputs'] if output['output_type'] == 'stream']
    return ''.join(text if isinstance(text, str) else ''.join(text) for text in texts)


if __name__ == '__main__':
    execute(Path(sys.argv[1]))
