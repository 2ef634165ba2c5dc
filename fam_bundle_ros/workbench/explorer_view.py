# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The force-strain space on the page: sliders, three figures, and their description."""

from collections.abc import Callable
from functools import partial
from typing import Any, TYPE_CHECKING

from fam_bundle_ros import palette
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.own_muscle import muscle_words
from fam_bundle_ros.workbench import drawings, parts
from fam_bundle_ros.workbench.explorer import Explorer

if TYPE_CHECKING:
    from fam_bundle_ros.workbench.page import Page


class ExplorerView:
    """Sliders that set the point, and figures that show it."""

    def __init__(self, page: 'Page', explorer: Explorer):
        self.page, self.explorer = page, explorer
        said = '' if page.chosen_muscle else 'No model of yours is open: the bundle of the paper. '
        with parts.box('div', 'explorer'):
            with parts.box('div', 'wide'):
                parts.text('h1', 'Which recruitment state can hold this force at this strain?')
                parts.text('span', f'{said}Model {muscle_words(explorer.bundle)}', 'muted small',
                           'muscle-words')
            with parts.box('div'):
                self.space = parts.plot(self._of(explorer.space_figure()),
                                        'force-strain space with the recruitment states')
            with parts.box('div'):
                with parts.box('div', 'sliders'):
                    self._sliders()
                    parts.typed('Tendon length', '', self._tendon, mark='explore:tendon',
                                hint='none, or "20 mm"')
                self.wrong = parts.text('p', '', 'small', 'explore:wrong').props('role=status')
                self.wrong.style('margin-top: .4rem')
                self.told = parts.box('div', 'told').props('aria-live=polite')
                self.crossing = parts.plot(self._of(explorer.crossing_figure()),
                                           'force while the next unit fills', 'plot half')
                self.free = None if explorer.paper.free_strain is None else parts.plot(
                    self._of(explorer.free_strain_figure()),
                    'free strain while the second unit fills', 'plot half')
        self._tell()

    def _sliders(self) -> None:
        explorer = self.explorer
        self._slider('Strain', explorer.highest_strain, explorer.strain, 0.001,
                     '{:.1%}', self._strain, 'strain')
        for k in range(explorer.bundle.n):
            most = float(explorer.bundle.max_pressure[k]) / 1e3
            self._slider(f'Pressure of MU{k + 1}', most, explorer.pressure[k] / 1e3, most / 200,
                         '{:.0f} kPa', partial(self._pressure, k), f'mu{k + 1}',
                         palette.recruitment_state(k + 1))

    def _slider(self, label: str, high: float, value: float, step: float,
                shown: str, on_change: Callable[[float], None], mark: str,
                colour: palette.Colour | None = None) -> None:
        def changed(event: Any) -> None:
            now = float(event.args)
            if not 0.0 <= now <= high:
                return
            number.set_text(shown.format(now))
            on_change(now)

        with parts.box('label'):
            parts.text('span', label)
            number = parts.text('b', shown.format(value), 'num')
            slider = parts.box('input', '', f'slider:{mark}')
            slider._props.update(type='range', min=0, max=high, step=step, defaultValue=value)
            if colour is not None:
                slider.style(f'accent-color: {colour.on(self.page.dark)}')
            slider.on('input', changed, throttle=0.08, js_handler='(e) => emit(e.target.value)')

    def _strain(self, value: float) -> None:
        self.explorer.strain = value
        self._update()

    def _pressure(self, unit: int, value: float) -> None:
        self.explorer.pressure[unit] = 1e3 * value
        self._update()

    def _tendon(self, told: str) -> None:
        self.wrong.set_text('')
        try:
            self.explorer.set_tendon(told)
        except InputError as error:
            self.wrong.set_text(str(error))
        self._update()

    def _update(self) -> None:
        self.space.update_figure(self._of(self.explorer.space_figure()))
        self.crossing.update_figure(self._of(self.explorer.crossing_figure()))
        if self.free is not None:
            self.free.update_figure(self._of(self.explorer.free_strain_figure()))
        self._tell()

    def _tell(self) -> None:
        with parts.fresh(self.told):
            for sentence in self.explorer.sentences():
                parts.text('p', sentence)
            for sentence, look in ((self.explorer.free_strain_sentence(), 'muted small'),
                                   (self.explorer.tendon_sentence(), 'small')):
                if sentence:
                    parts.text('p', sentence, look)

    def _of(self, figure: dict[str, Any]) -> dict[str, Any]:
        return drawings.for_page(figure, self.page.dark)
