# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Settings of the documentation: `make docs`, or `python -m sphinx docs docs/_build/html`."""

import json
import os
from pathlib import Path
import shutil

from plotly.offline import get_plotlyjs
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

from fam_bundle_ros import __version__, palette

HERE = Path(__file__).resolve().parent

project = 'fam_bundle_ros'
author = 'fam_bundle_ros contributors'
project_copyright = '2026, fam_bundle_ros contributors'
version = release = __version__

extensions = [
    'myst_nb',
    'sphinx.ext.autodoc',
    'sphinx.ext.napoleon',
    'sphinx_copybutton',
]
exclude_patterns = ['_build', 'requirements.txt']
# Types in docstrings are words (`float, s`), not links: one may name two things.
suppress_warnings = ['ref.python']

myst_heading_anchors = 3

napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
add_module_names = False
autodoc_member_order = 'bysource'
toc_object_entries_show_parents = 'hide'
autodoc_typehints = 'none'  # the docstrings have types and units
default_role = 'literal'  # `name` in a docstring is code

# Notebooks (docs/gallery) run on every build, each within a minute of one core.
nb_execution_mode = os.environ.get('NOTEBOOKS', 'force')
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
copybutton_exclude = '.linenos, .gp, .go'

html_theme = 'pydata_sphinx_theme'
html_title = 'fam_bundle_ros'
html_static_path = ['_static']
html_css_files = ['site.css']
html_sidebars = {'index': [], 'start': []}  # they are not part of a section
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    'navigation_with_keys': False,
    'navbar_align': 'left',
    'navbar_persistent': ['search-button'],
    'header_links_before_dropdown': 7,
    'show_prev_next': False,
    # Notebooks take the width: what they print has long lines.
    'secondary_sidebar_items': {
        'gallery/*': [],
        **{f'{part}*': ['page-toc']
           for part in ('start', 'how_to/', 'explanation/', 'reference/', 'reference/python/',
                        'results/')}},
    'footer_start': ['copyright'],
    'footer_end': [],
    'pygments_light_style': 'a11y-high-contrast-light',
    'pygments_dark_style': 'a11y-high-contrast-dark',
}


def prepare(app: Sphinx) -> None:
    """Put what pages need besides Sphinx's own files into the output; nothing is fetched."""
    static = Path(app.outdir) / '_static'
    static.mkdir(parents=True, exist_ok=True)
    (static / 'plotly.js').write_text(get_plotlyjs(), encoding='utf-8')
    (static / 'colours.js').write_text(f'const COLOURS = {json.dumps(palette.by_page())};',
                                       encoding='utf-8')
    shutil.copytree(HERE / 'images', Path(app.outdir) / 'images', dirs_exist_ok=True)
    # The kernels of the notebooks hand their figures to the page as figures.js draws them.
    profile = Path(app.outdir).parent / 'ipython'
    startup = profile / 'profile_default' / 'startup'
    startup.mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE / 'notebook_figures.py', startup / '00-figures.py')
    # Kernels warn on every start that they talk over TCP; they do so on this machine only.
    (startup.parent / 'ipython_kernel_config.py').write_text('c.IPKernelApp.log_level = 40\n')
    os.environ['IPYTHONDIR'] = str(profile)
    os.environ['OMP_NUM_THREADS'] = '1'


def scripts(app: Sphinx, pagename: str, templatename: str, context: dict, doctree: object) -> None:
    """Load plotly.js (5 MB) on the pages of the gallery only."""
    if pagename.startswith('gallery/'):
        app.add_js_file('plotly.js')
    app.add_js_file('colours.js')
    app.add_js_file('figures.js', loading_method='defer')


def without_fields(app: Sphinx, what: str, name: str, obj: object, skip: bool, options: object
                   ) -> bool | None:
    """Leave out the fields of named tuples: the docstring of the class has them."""
    return True if (obj.__doc__ or '').startswith('Alias for field number') else None


def without_modules(app: Sphinx, what: str, name: str, obj: object, options: object,
                    lines: list[str]) -> None:
    """Leave out the docstrings of modules: each page has its own first paragraph."""
    if what == 'module':
        lines.clear()


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the functions above."""
    app.connect('builder-inited', prepare)
    app.connect('html-page-context', scripts)
    app.connect('autodoc-skip-member', without_fields)
    app.connect('autodoc-process-docstring', without_modules, priority=100)
    app.add_lexer('csv', TextLexer)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
