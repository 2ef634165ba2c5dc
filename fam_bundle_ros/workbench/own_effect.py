# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""An effect that the user writes as a formula: contents of the form, and preview of the effect."""

from dataclasses import dataclass, field
import re

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.templates import Template
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Effect, Parameter
from fam_bundle_ros.model.expression import (
    expression_law,
    FUNCTIONS,
    usual_place,
    VARIABLES,
)
from fam_bundle_ros.units import express, parse, si_factor
from fam_bundle_ros.workbench.session import Session

#: Results of a formula, and their names on the page.
PLACES = {'force': 'a force (N), elastic', 'loss': 'a force (N), lost or delayed',
          'pressure': 'a change of pressure (Pa)', 'geometry': 'a change of strain',
          'limit': 'the smallest force (N)'}


@dataclass
class Field:
    """A parameter as typed: ``5 N*s``; empty bounds: from 0 to ten times the value."""

    value: str = ''
    lower: str = ''
    upper: str = ''


@dataclass
class Draft:
    """Contents of the form."""

    name: str = 'my_effect'
    formula: str = ''
    place: str = 'force'
    fields: dict[str, Field] = field(default_factory=dict)

    def sync(self) -> None:
        """Keep one field for each name in the formula that is not a variable or function."""
        names = names_in(self.formula)
        self.fields = {name: self.fields.get(name, Field()) for name in names}

    def effect(self) -> Effect:
        """Return the effect; InputError for a bad name, formula, unit or number."""
        name = self.name.strip()
        if not re.fullmatch(r'[a-z][a-z0-9_]{0,39}', name):
            raise InputError(f"name '{name[:40]}': expected small letters, digits and _ "
                             '(such as my_effect)')
        parameters = tuple(_parameter(key, item) for key, item in self.fields.items())
        return expression_law(name, self.formula.strip(), self.place, parameters)()


@dataclass(frozen=True)
class Preview:
    """Change by an effect at its start values, before any refit."""

    #: Error of the model with the effect, and change of the force by the effect, N rms.
    error_N: float
    change_N: float
    #: Force of the model with the effect, N, shape (T,).
    prediction: np.ndarray


def names_in(formula: str) -> list[str]:
    """
    Return the names in a formula that need a value, in order.

    Examples
    --------
    >>> names_in('-k * max(0, strain - at)')
    ['k', 'at']
    """
    words = re.findall(r'(?<![\w.])[A-Za-z_]\w*', formula)
    return [word for word in dict.fromkeys(words)
            if word not in VARIABLES and word not in FUNCTIONS]


def preview(session: Session, effect: Effect) -> Preview:
    """Return what the present model with the effect added predicts, without a refit."""
    data = session.data
    with np.errstate(all='ignore'):
        prediction = predict(session.now.model.with_effect(effect), data)
    if not np.isfinite(prediction).all():
        raise InputError(f'{effect.name}: the formula gives no finite force at '
                         f'{int((~np.isfinite(prediction)).sum())} samples')
    return Preview(rms(data.force - prediction), rms(prediction - session.now.prediction),
                   prediction)


def from_template(template: Template) -> Draft:
    """Return a form filled with a shape that a diagnosis found in the residual."""
    if template.expression is None:
        raise InputError(f"'{template.words}' cannot be written as a formula")
    unit = f' {template.unit}' if template.unit else ''
    draft = Draft('found_shape', template.expression, usual_place(template.expression))
    draft.sync()
    if 'k' in draft.fields:
        draft.fields['k'] = Field(f'{template.coefficient:.4g}{unit}')
    for name, value, of in template.constants:
        draft.fields[name] = Field(f'{value:.6g} {of}')
    return draft


def _parameter(name: str, item: Field) -> Parameter:
    text = item.value.strip()
    if not text:
        raise InputError(f"parameter {name}: expected a value with its unit, such as '5 N'")
    _, _, unit = text.partition(' ')
    unit = unit.strip() or '1'
    try:
        value = parse(text, unit)
        low = parse(item.lower, unit) if item.lower.strip() else min(0.0, 10.0 * value)
        high = parse(item.upper, unit) if item.upper.strip() else max(0.0, 10.0 * value)
    except InputError as error:
        raise InputError(f'parameter {name}: {error}') from None
    except Exception as error:  # pint raises many kinds of errors for a wrong unit
        raise InputError(f"parameter {name}: '{unit}' is not a unit") from error
    if not high > low:
        raise InputError(f'parameter {name}: its lower bound is not below its upper bound')
    scale = si_factor(unit, unit)
    return Parameter(value / scale, unit, low / scale, high / scale,
                     f'start {express(value, unit, 4)}', name=name)
