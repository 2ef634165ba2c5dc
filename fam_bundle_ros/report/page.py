# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One self-contained HTML page: summary, headline numbers, figures, tables, provenance.

Everything is inside the file (plotly.js once, if there are figures); it needs no network.
plotly.js and the curves are compressed to a third (gzip, which browsers of 2023 and later
decompress themselves).
"""

import base64
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
import gzip
from html import escape
from importlib import metadata
import json
from pathlib import Path
import platform
from string import Template
from typing import Any

import plotly.graph_objects as go

import fam_bundle_ros
from fam_bundle_ros import palette, plotting
from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.data.measurement import file_digest
from fam_bundle_ros.told import shown

_ASSETS = Path(__file__).parent / 'assets'
_PACKAGES = ('numpy', 'scipy', 'plotly', 'control')


@dataclass(frozen=True)
class Headline:
    """A headline number with its name and a note."""

    name: str
    value: str
    note: str = ''


@dataclass(frozen=True)
class Picture:
    """A drawing with its title and caption."""

    #: Anchor on the page.
    key: str
    #: Content, and number of the figure in the paper if there is one.
    title: str
    drawing: go.Figure
    #: Origin of each curve, and what it shows.
    caption: str


@dataclass(frozen=True)
class Table:
    """Rows under column titles (units in the titles)."""

    columns: Sequence[str]
    #: Numbers are shown with three significant digits and aligned right; None and nan as a dash;
    #: a cell ``('effect', name)`` has a swatch in the effect's colour.
    rows: Sequence[Sequence[Any]]
    caption: str = ''


@dataclass(frozen=True)
class Section:
    """
    A heading, a few sentences, then figures and tables in the order given.

    ``folded`` sections are closed until the reader opens them.
    """

    title: str
    text: str = ''
    items: Sequence[Picture | Table] = ()
    folded: bool = False


@dataclass(frozen=True)
class Page:
    """A report."""

    title: str
    #: The result in a sentence or two.
    lead: str
    headline: Sequence[Headline]
    sections: Sequence[Section]
    #: Files and their hashes, versions, seeds; what is simulated, what measured.
    provenance: Sequence[tuple[str, str]] = ()


def render(page: Page) -> str:
    """Return the page as HTML text."""
    sections = list(page.sections)
    if page.provenance:
        sections.append(Section('Provenance', '', [Table(('what', 'value'), page.provenance)]))
    light, dark = (_variables(theme_name) for theme_name in ('light', 'dark'))
    pictures = any(isinstance(item, Picture) for section in sections for item in section.items)
    return _asset('page.html').substitute(
        title=escape(page.title), lead=escape(page.lead),
        generator=f'fam_bundle_ros {fam_bundle_ros.__version__}',
        light=light, dark=dark, css=_asset('page.css').substitute(font=plotting.FONT),
        headline=_cards(page.headline), nav=_nav(sections),
        sections='\n'.join(_section(section) for section in sections),
        footer=f'Written by fam_bundle_ros {fam_bundle_ros.__version__}. This file is complete '
               'and needs no network.',
        plotly=_plotly() if pictures else '', colours=json.dumps(palette.by_page()),
        script=(_ASSETS / 'page.js').read_text(encoding='utf-8'))


def write_page(path: str | Path, page: Page) -> Path:
    """Write the page atomically (InputError when it cannot be written)."""
    return write_whole(path, render(page))


@lru_cache(maxsize=4)
def _asset(name: str) -> Template:
    return Template((_ASSETS / name).read_text(encoding='utf-8'))


@lru_cache(maxsize=1)
def _plotly() -> str:
    from plotly.offline import get_plotlyjs
    return _packed(get_plotlyjs())


def _packed(text: str) -> str:
    """Return text as gzip in base64; `unpacked` of page.js reads it."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _variables(theme_name: str) -> str:
    neutral = {name: getattr(colour, theme_name) for name, colour in palette.NEUTRAL.items()}
    neutral['link'] = getattr(palette.recruitment_state(1), theme_name)
    return ' '.join(f'--{name}: {value};' for name, value in neutral.items())


def _anchor(title: str) -> str:
    return '-'.join(''.join(c if c.isalnum() else ' ' for c in title.lower()).split())


def _cards(headline: Sequence[Headline]) -> str:
    if not headline:
        return ''
    cards = ''.join(
        f'<li><span class="name">{escape(card.name)}</span>'
        f'<span class="value">{escape(card.value)}</span>'
        f'<span class="note">{escape(card.note)}</span></li>' for card in headline)
    return f'<ul class="cards">{cards}</ul>'


def _nav(sections: Sequence[Section]) -> str:
    if len(sections) < 3:
        return ''
    links = ''.join(f'<li><a href="#{_anchor(s.title)}">{escape(s.title)}</a></li>'
                    for s in sections)
    return f'<nav aria-label="sections"><ul>{links}</ul></nav>'


def _section(section: Section) -> str:
    text = ''.join(f'<p>{escape(part)}</p>' for part in section.text.split('\n\n') if part)
    items = ''.join(_picture(item) if isinstance(item, Picture) else _table(item)
                    for item in section.items)
    body = f'{text}{items}'
    if section.folded:
        body = f'<details><summary>show</summary>{body}</details>'
    return (f'<section id="{_anchor(section.title)}"><h2>{escape(section.title)}</h2>'
            f'{body}</section>')


def _picture(picture: Picture) -> str:
    height = int(picture.drawing.layout.height or 400)
    data = _packed(picture.drawing.to_json())
    return (f'<figure id="{escape(picture.key)}"><h3>{escape(picture.title)}</h3>'
            f'<div class="drawing" role="img" aria-label="{escape(picture.title)}" '
            f'style="height:{height}px"></div><script type="application/gzip">{data}</script>'
            f'<figcaption>{escape(picture.caption)}</figcaption></figure>')


def _table(table: Table) -> str:
    rows = [list(row) for row in table.rows]
    numeric = [bool(rows) and all(_is_number(row[k]) or row[k] is None for row in rows)
               for k in range(len(table.columns))]

    def cell(tag, content, right):
        return f'<{tag}{" class=number" if right else ""}>{content}</{tag}>'

    head = ''.join(cell('th', escape(str(name)), right)
                   for name, right in zip(table.columns, numeric, strict=True))
    body = ''.join('<tr>' + ''.join(cell('td', _cell(value), right)
                                    for value, right in zip(row, numeric, strict=True)) + '</tr>'
                   for row in rows)
    caption = f'<caption>{escape(table.caption)}</caption>' if table.caption else ''
    return (f'<div class="scroll"><table>{caption}<thead><tr>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table></div>')


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _cell(value: Any) -> str:
    if isinstance(value, tuple):
        _, name = value
        return ('<span class="named"><span class="swatch" style="background:'
                f'{palette.effect(name).light}"></span>{escape(name)}</span>')
    return escape(shown(value))


def provenance(files: Sequence[tuple[str, str | Path]] = (),
               more: Sequence[tuple[str, str]] = ()) -> list[tuple[str, str]]:
    """
    Return the rows of a report's provenance table.

    ``files`` are (what it is, path), ``more`` (what, value): seeds; what is simulated, measured.
    """
    versions = []
    for name in _PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions.append(f'{name} {metadata.version(name)}')
    return [*((what, f'{Path(path).name}, sha256 {file_digest(path)[:16]}…')
              for what, path in files), *more,
            ('fam_bundle_ros', fam_bundle_ros.__version__), ('versions', ', '.join(versions)),
            ('Python', f'{platform.python_version()} on {platform.system()} '
                       f'{platform.machine()}')]
