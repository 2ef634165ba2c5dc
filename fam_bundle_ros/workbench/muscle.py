# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The form "Your muscle" as plain Python: a part or dimensions, as `fam_bundle new-model` takes them.

The text is kept as typed, right or wrong; `MuscleForm.bundle` says what is wrong.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from operator import attrgetter
import re

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, dumps_model
from fam_bundle_ros.model.own_muscle import (
    dimensions_of,
    ENTRIES,
    find_part,
    fitted_bundle,
    model_text,
    new_bundle,
    START_EFFECTS,
)
from fam_bundle_ros.units import parse, spaced

#: Choices of the first effects of a new model: key, name, effects of the catalogue.
STARTS = (('braid', 'the ideal braid', START_EFFECTS),
          ('bladder', 'the braid and a rubber bladder', (*START_EFFECTS, 'bladder_elasticity')))


@dataclass
class MuscleForm:
    """A muscle as text fields."""

    name: str = 'my_muscle'
    #: By key of `ENTRIES`.
    values: dict[str, str] = field(default_factory=lambda: {'muscles': '1'})
    #: Sources of the values that were not typed.
    sources: dict[str, str] = field(default_factory=dict)
    #: Name of a catalogue part; '' for own dimensions.
    part: str = ''
    #: Key of `STARTS`.
    start: str = 'braid'
    #: A model whose effects are kept; its dimensions may be changed.
    base: Bundle | None = None

    @classmethod
    def of(cls, bundle: Bundle) -> 'MuscleForm':
        """Return the form of an existing model, with its dimensions and its effects."""
        return cls(bundle.name, dimensions_of(bundle), base=bundle)

    def choose(self, part: str) -> None:
        """Set the values of a catalogue part; '' for own dimensions, starting from the present."""
        self.part = part
        if part:
            stock = find_part(part)
            self.values.update(stock.values)
            self.sources = {key: f'{stock.title}, {said}' for key, said in stock.sources.items()}
        else:
            self.sources = {}

    def type(self, key: str, value: str) -> None:
        """Change one value; a bare number is in the unit of its field."""
        unit = next(entry.unit for entry in ENTRIES if entry.key == key)
        bare = unit and re.fullmatch(r'[-+]?[\d.,]+', value.strip())
        self.values[key] = f'{value.strip()} {unit}' if bare else value
        self.sources.pop(key, None)

    def bundle(self) -> Bundle:
        """Return the model; InputError names the field that is missing or wrong."""
        if self.base is not None:
            return fitted_bundle(self.base.name, self.values, self.base.effects,
                                 self.base.notes, attrgetter('label'))
        name = '_'.join(self.name.split())
        if not name:
            raise InputError('Name: expected a name for the model')
        effects = next(effects for key, _, effects in STARTS if key == self.start)
        return new_bundle(name, self.values, effects, attrgetter('label'))

    @property
    def problem(self) -> str:
        """What is missing or invalid; an empty string if the input is valid."""
        try:
            self.bundle()
        except InputError as error:
            return str(error)
        return ''

    def quantity(self, key: str) -> float | None:
        """Return one value in SI units, None if it is not a positive quantity."""
        entry = next(entry for entry in ENTRIES if entry.key == key)
        try:
            value = parse(spaced(self.values.get(key, '')), entry.unit)
        except InputError:
            return None
        return value if value > 0.0 else None

    def text(self) -> str:
        """Return the model file."""
        bundle = self.bundle()
        if self.base is not None:
            return dumps_model(bundle)
        origin = f'A {find_part(self.part).title}' if self.part else 'A muscle of your own'
        return model_text(bundle, self.values, self.sources, f'{origin}, from the workbench.')

    def changed(self, bundle: Bundle) -> bool:
        """Return whether a model has other dimensions than those typed."""
        before: Mapping[str, str] = dimensions_of(bundle)
        return any(self.values.get(key, '').strip() != value for key, value in before.items())
