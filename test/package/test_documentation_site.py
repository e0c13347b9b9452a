# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Structure of the documentation site, read from the text of its pages without Sphinx."""

from __future__ import annotations

import importlib
from itertools import pairwise
from pathlib import Path
import re
from types import SimpleNamespace

from masmc_ros.law import registry
import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'
GENERATED = DOCS / 'api'
"""Pages of the Python API, which a build writes and removes."""

_TOCTREE = re.compile(r'^```\{toctree\}\n(.*?)^```$', re.DOTALL | re.MULTILINE)
_FENCE = re.compile(r'^( *)```.*?^\1```', re.DOTALL | re.MULTILINE)
_TITLED = re.compile(r'.*<(.+)>$')


def pages() -> set[Path]:
    """Return all pages in Markdown written by hand."""
    return {page for page in DOCS.rglob('*.md') if GENERATED not in page.parents}


def notebooks() -> set[Path]:
    return set(DOCS.rglob('*.ipynb'))


def entries(page: Path) -> set[Path]:
    """Return the pages in the toctrees of a page."""
    targets: set[Path] = set()
    for body in _TOCTREE.findall(page.read_text(encoding='utf-8')):
        for line in filter(None, map(str.strip, body.splitlines())):
            titled = _TITLED.match(line)
            target = titled[1] if titled else line
            if not target.startswith((':', 'https:', 'api/')):
                files = {*page.parent.glob(f'{target}.md'), *page.parent.glob(f'{target}.ipynb')}
                targets |= files or {page.parent / f'{target}.md'}
    return targets - {page}


def test_every_page_is_in_a_toctree() -> None:
    listed = set().union(*map(entries, pages()))
    missing = (pages() | notebooks()) - listed - {DOCS / 'index.md'}
    assert not missing, 'add to a toctree of docs/index.md: ' + ', '.join(map(str, missing))


def test_every_toctree_entry_is_a_page() -> None:
    for page in pages():
        assert entries(page) <= pages() | notebooks(), page


def test_headings_skip_no_level() -> None:
    for page in pages():
        text = _FENCE.sub('', page.read_text(encoding='utf-8'))
        levels = [len(marks) for marks in re.findall(r'^(#+) ', text, re.MULTILINE)]
        assert levels.count(1) == 1, f'{page}: one title'
        for before, after in pairwise(levels):
            assert after <= before + 1, page


def test_katex_style_is_of_the_script_version() -> None:
    script = (ROOT / 'tools' / 'docs_assets.sh').read_text(encoding='utf-8')
    constraints = (ROOT / 'constraints.txt').read_text(encoding='utf-8')
    assert 'KATEX=0.16.22\n' in script
    assert 'sphinxcontrib-katex==0.9.11\n' in constraints, 'check the version of KaTeX it has'


@pytest.mark.parametrize(
    ('url', 'expected'),
    [
        ('', 'See `x` of the file, and [here](page.md).'),
        (
            'https://host.example/r',
            'See [`x` of the file](<https://host.example/r/blob/main/config/x.yaml#a>),'
            ' and [here](page.md).',
        ),
    ],
)
def test_links_to_sources_need_a_repository(
    url: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(DOCS / '_extensions')
    extension = importlib.import_module('repository_links')
    app = SimpleNamespace(config=SimpleNamespace(repository_url=url))
    source = ['See [`x` of the file](../../config/x.yaml#a), and [here](page.md).']
    extension._rewrite_links(app, 'guides/recording', source)
    assert source == [expected]


@pytest.mark.parametrize(
    ('page', 'is_linked'),
    [('reference/laws/smc', True), ('reference/laws/index', False), ('guides/recording', False)],
)
def test_pages_of_laws_link_to_runs_in_the_browser(
    page: str, is_linked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(DOCS / '_extensions')
    source = ['# Title\n\n## Summary\n']
    importlib.import_module('run_links')._add_link(None, page, source)
    assert ('_static/paper.html#law=smc' in source[0]) == is_linked
    assert source[0].endswith('\n## Summary\n')


def test_figures_of_laws_stand_before_equations(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(DOCS / '_extensions')
    extension = importlib.import_module('built_figures')
    monkeypatch.setattr(extension, 'FIGURES', tmp_path)
    noted: list[str] = []
    app = SimpleNamespace(env=SimpleNamespace(note_dependency=noted.append))
    followed = {f'reference/laws/{law}': '\n## Equations\n' for law in registry.LAWS}
    for page, heading in {**followed, 'index': '\n<a href="_static/paper.html">'}.items():
        name = 'animation' if page == 'index' else page.rpartition('/')[2]
        source = [(DOCS / f'{page}.md').read_text(encoding='utf-8')]
        extension._insert(app, page, source)
        assert '<figure>' not in source[0]
        (tmp_path / f'{name}.html').write_text('<figure>\n')
        extension._insert(app, page, source)
        assert f'\n<figure>\n{heading}' in source[0], page
        assert noted.pop() == str(tmp_path / f'{name}.html')


def test_figures_of_laws_have_ranks_of_every_law(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / 'tools')
    figures = importlib.import_module('docs_figures')
    ranks = {law: figures.ranks(law) for law in registry.LAWS}
    for text in ranks.values():
        assert all(f'{title} ' in text for title in figures.CONDITIONS.values())
    best = ranks['super_twisting']
    assert re.search(r'the paper’s robot [1-9]\b', best), best
