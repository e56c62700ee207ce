# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How Sphinx builds the pages: `make docs`. The pages are also plain Markdown for a forge.

The front page begins with the repository's README, up to its first program. A folder's README.md
is its index. Its table of contents is made from its links, in their order, and pages of the folder
that it does not link come after them.
"""
from __future__ import annotations

import re
import shutil
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).parent
ROOT = DOCS.parent

project, author = 'box_contact_ros', 'The box_contact_ros maintainers'
copyright = author  # noqa: A001
release = re.search('<version>(.+)</version>', (ROOT / 'package.xml').read_text('utf-8'))[1]

extensions = ['myst_parser', 'sphinx.ext.autodoc']
source_suffix = {'.md': 'markdown'}
root_doc = 'README'
exclude_patterns = ['figures']
html_theme = 'sphinx_rtd_theme'
html_static_path, html_css_files = ['_static'], ['tables.css']
html_theme_options = {'navigation_depth': 2}
html_show_sphinx = html_show_copyright = html_copy_source = False

# Anchors of headings as a forge makes them, so that links work in both places.
myst_heading_anchors = 4
# Files outside docs/ are no pages: they are linked as downloads.
myst_all_links_external = False
autodoc_typehints = 'none'  # docstrings have shapes and units
autodoc_member_order = 'bysource'
autodoc_default_options = {'exclude-members': '__new__'}  # of named tuples
add_module_names = False
default_role = 'literal'  # docstrings are plain text with `names`
linkcheck_anchors = False
linkcheck_timeout = 20


def contents(app: Sphinx, page: str, source: list[str]) -> None:
    """Append a hidden table of contents to the index of a folder, and to pages that link below."""
    folder, _, name = page.rpartition('/')
    linked = re.findall(r'\]\(([\w/.-]+)\.md\)', source[0])
    # An index has its own pages and the indexes below; another page what lies below it.
    linked = [link for link in linked if ('/' not in link or link.endswith('/README')
                                          if name == 'README' else '/' in link)]
    if name == 'README':
        linked += sorted(path.stem for path in (DOCS / folder).glob('*.md') if path.stem != name)
    below = [link for link in dict.fromkeys(linked)
             if (DOCS / folder / f'{link}.md').exists() and not link.startswith('..')]
    if below:
        source[0] += '\n\n```{toctree}\n:hidden:\n\n' + '\n'.join(below) + '\n```\n'


def front(app: Sphinx, page: str, source: list[str]) -> None:
    """Put the first screen of the repository's README on top of the front page."""
    if page == 'README':
        screen = (ROOT / 'README.md').read_text('utf-8').partition('\n## Begin')[0]
        screen = re.sub(r'\]\((?!\w+:|docs/)', '](../', screen).replace('](docs/', '](')
        source[0] = screen + source[0].partition('\n')[2]


def index(app: Sphinx, error: Exception | None) -> None:
    """Write the front page under the name that browsers and servers look for."""
    page = Path(app.outdir) / 'README.html'
    if error is None and page.exists():
        shutil.copy(page, page.with_name('index.html'))


def plain_docstring(app: Sphinx, kind: str, name: str, item: object, options: object,
                    lines: list[str]) -> None:
    """Turn a docstring of plain text into reStructuredText: code blocks, and no markup else."""
    made, code = [], False
    for line in lines:
        if line.startswith('```'):
            code = not code
            made += ['', '.. code-block:: python', ''] if code else ['']
        elif code:
            made.append(f'   {line}')
        else:
            made.append(re.sub(r'([*|_])(?![^`]*`(?:[^`]*`[^`]*`)*[^`]*$)', r'\\\1', line))
    lines[:] = made


def setup(app: Sphinx) -> None:
    """Connect them to Sphinx."""
    app.connect('source-read', contents)
    app.connect('source-read', front)
    app.connect('build-finished', index)
    app.connect('autodoc-process-docstring', plain_docstring)
