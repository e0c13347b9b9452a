# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Settings of the documentation site; `make docs` builds it with Sphinx."""

from __future__ import annotations

from pathlib import Path
import sys
from xml.etree import ElementTree

from sphinxcontrib import katex

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS / '_extensions'))

project = 'masmc_ros'
author = 'The masmc_ros authors'
copyright = '2026, The masmc_ros authors'
html_title = 'masmc_ros'
# Empty before a release sets it; links to files outside docs/ are then texts.
repository_url = ElementTree.parse(ROOT / 'package.xml').findtext("url[@type='repository']") or ''

extensions = [
    'myst_nb',
    'sphinx.ext.napoleon',
    'autoapi.extension',
    'sphinxcontrib.katex',
    'sphinx_copybutton',
    'plain_docstrings',
    'built_figures',
    'repository_links',
    'mermaid_diagrams',
    'run_links',
    'short_navigation',
]
exclude_patterns = ['_extensions']
highlight_language = 'none'

# Pages show the stored outputs; a test executes the notebooks.
nb_execution_mode = 'off'

myst_enable_extensions = ['dollarmath', 'amsmath', 'html_image']
myst_fence_as_directive = ['math', 'mermaid']
myst_heading_anchors = 4

# tools/docs_assets.sh puts the style sheet and fonts of KaTeX and the script of Mermaid there, the
# Makefile the page of `masmc page`.
# The version of KaTeX is that of the script in sphinxcontrib-katex.
html_static_path = ['_static', '../build/docs_assets']
katex_prerender = True
katex.STARTUP_TIMEOUT = katex.RENDER_TIMEOUT = 120.0  # s, for busy machines
katex_css_path = 'katex/katex.min.css'

# Attributes are fields of their class: properties have an entry of their own.
napoleon_use_ivar = True

autoapi_dirs = ['../masmc_ros']
autoapi_root = 'api'
autoapi_add_toctree_entry = False
autoapi_options = ['members', 'show-module-summary']
autoapi_member_order = 'groupwise'
# `ref.python`: classes of the same name, such as Settings of each law, are no link targets.
suppress_warnings = ['autoapi.python_import_resolution', 'ref.python']

copybutton_exclude = '.linenos, .gp, .go'

html_theme = 'furo'
html_css_files = ['site.css']
html_js_files = ['search_excerpts.js']
html_favicon = '_static/favicon.svg'
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
if repository_url:
    html_theme_options = {
        'source_repository': repository_url,
        'source_branch': 'main',
        'source_directory': 'docs/',
    }
