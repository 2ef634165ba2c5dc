# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Elements that all views use: text, buttons, fields, plots, the style sheet."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from string import Template
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from fam_bundle_ros import palette, plotting
from fam_bundle_ros.workbench.jobs import Job

_ASSETS = Path(__file__).parent / 'assets'


@lru_cache(maxsize=1)
def style() -> str:
    """Return the page's style sheet in the colours of the palette."""
    def variables(theme: str) -> str:
        return ' '.join(f'--{name}: {getattr(colour, theme)};'
                        for name, colour in palette.NEUTRAL.items())

    accent, alarm = palette.recruitment_state(1), palette.effect('resistive_buckling')
    sheet = Template((_ASSETS / 'workbench.css').read_text(encoding='utf-8'))
    return sheet.substitute(light=variables('light'), dark=variables('dark'), font=plotting.FONT,
                            accent_light=accent.light, accent_dark=accent.dark,
                            alarm_light=alarm.light, alarm_dark=alarm.dark)


def box(tag: str, classes: str = '', mark: str = '') -> ui.element:
    """Return an element that contains others; tests find it by ``mark``."""
    return _marked(ui.element(tag).classes(classes), mark)


def fresh(place: ui.element) -> ui.element:
    """Return an element, emptied, to be filled again."""
    place.clear()
    return place


def text(tag: str, said: str, classes: str = '', mark: str = '') -> TextElement:
    """Return an element with text, which is never interpreted as HTML."""
    return _marked(TextElement(tag=tag, text=said).classes(classes), mark)


def button(said: str, on_click: Callable[..., Any], classes: str = 'plain', mark: str = '',
           **props: str) -> TextElement:
    """Return a button that can be used with the keyboard."""
    made = text('button', said, classes, mark).props('type=button').on('click', on_click, args=[])
    made._props.update(props)
    return made


def progress(job: Job) -> tuple[TextElement, ui.timer]:
    """Draw the progress of a job; return the text beside the bar and the timer of updates."""
    with box('div', 'bar').props('role=progressbar aria-label=progress'):
        filled = box('i').style('width: 2%')
    said = text('span', f'{words(job.words)} …', 'muted small')

    def move() -> None:
        filled.style(f'width: {100 * max(job.share, 0.02):.0f}%')
        said.set_text(f'{words(job.words)} …')

    return said, ui.timer(0.2, move)


def segments(options: Sequence[tuple[str, str]], chosen: str, on_change: Callable[[str], Any],
             label: str) -> ui.element:
    """Return a row of buttons of which one is pressed; options are (key, words)."""
    with box('div', 'seg').props(f'role=group aria-label="{label}"') as row:
        for key, said in options:
            button(said, lambda key=key: on_change(key), '', f'{label}:{key}',
                   **{'aria-pressed': 'true' if key == chosen else 'false'})
    return row


def pick(label: str, options: Sequence[str], chosen: int | None,
         on_change: Callable[[int | None], Any], everything: str = 'all') -> ui.element:
    """Return a native select; the first choice means everything (None)."""
    numbered = [(str(key), said) for key, said in enumerate([everything, *options], start=-1)]
    return choose(label, numbered, str(-1 if chosen is None else chosen),
                  lambda key: on_change(None if key == '-1' else int(key)),
                  f'pick:{label}', 'pick')


def choose(label: str, options: Sequence[tuple[str, str]], chosen: str,
           on_change: Callable[[str], Any], mark: str = '', classes: str = 'field',
           named: str = '') -> ui.element:
    """Return a native select of (key, words); ``named`` is its label for screen readers."""
    def changed(event: Any) -> None:
        if str(event.args) in [key for key, _ in options]:
            on_change(str(event.args))

    with box('label', classes) as made:
        if label:
            text('span', label)
        with box('select', '', mark).on(
                'change', changed, js_handler='(e) => emit(e.target.value)') as select:
            if named:
                select._props['aria-label'] = named
            for key, said in options:
                at = text('option', said)
                at._props['value'] = key
                if key == chosen:
                    at.props('selected')
    return made


def typed(label: str, value: str, on_change: Callable[[str], Any], classes: str = '',
          mark: str = '', code: bool = False, hint: str = '', named: str = '') -> ui.element:
    """
    Return a text field with its label; changes are passed on after a short delay.

    ``named`` is its label for screen readers, where none is shown.
    """
    with box('label', f'field {classes}') as made:
        if label:
            text('span', label)
        field = box('input', 'code' if code else '', mark)
        # not `value`, to which the browser would be reset at each redraw
        field._props.update(type='text', defaultValue=value, placeholder=hint, autocomplete='off',
                            spellcheck='false', maxlength='500',
                            **({'aria-label': named} if named else {}))
        field.on('input', lambda event: on_change(str(event.args)[:500]), throttle=0.25,
                 leading_events=False, js_handler='(e) => emit(e.target.value)')
    return made


def words(name: str) -> str:
    """
    Return an effect's name as people write it.

    Examples
    --------
    >>> words('coulomb_friction'), words('+ end_caps')
    ('Coulomb friction', '+ end caps')
    """
    people = {'coulomb': 'Coulomb', 'tondu': 'Tondu', 'ogden': 'Ogden', 'prony': 'Prony'}
    return ' '.join(people.get(word, word) for word in name.replace('_', ' ').split(' '))


def sentence(said: str) -> str:
    """
    Return a phrase as a sentence, effects named as people write them.

    Examples
    --------
    >>> sentence('coulomb_friction is missing')
    'Coulomb friction is missing.'
    """
    plain = words(said).rstrip('.')
    return f'{plain[:1].upper()}{plain[1:]}.'


def swatch(effect: str, dark: bool) -> ui.element:
    """Return a sample line in the colour and dash of an effect."""
    colour = palette.effect(effect)
    dash = {'solid': 'solid', 'dot': 'dotted'}.get(palette.dash(effect), 'dashed')
    return box('span', 'swatch').style(f'border-top: 4px {dash} {colour.on(dark)}').props(
        'aria-hidden=true')


def plot(figure: dict[str, Any], label: str, classes: str = 'plot') -> ui.plotly:
    """Return a plot in a box of its own."""
    with box('div', classes).props(f'role=img aria-label="{label}"'):
        return ui.plotly(figure)


def _marked(made: Any, mark: str) -> Any:
    """Return an element with the mark by which tests and browsers find it."""
    if mark:
        made.mark(mark)
        made._props['data-mark'] = mark
    return made
