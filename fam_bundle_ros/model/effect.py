# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A law with parameter values: one element of a model."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TYPE_CHECKING

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.units import express

if TYPE_CHECKING:
    from fam_bundle_ros.model.laws.base import Law

#: Message for a file of version 1, in which effects were classes.
CLASSES_ARE_GONE = ('an effect is a function now, not a class: write @law(...) above a function '
                    'that returns what contribution(x) returned; '
                    'docs/how_to/own_effect.md, "An effect in Python", shows one')


class Effect:
    """
    A law with SI values; a parameter's value is also an attribute, ``effect.c10``.

    The fields of the law are attributes too: name, summary, source, place, family, signature,
    parameters, off, memory, ... (`fam_bundle_ros.model.laws.base.Law`).

    Parameters
    ----------
    law : Law
    table, folder : str and path, optional
        Only for a law that reads a table: its file, and the folder of a relative path.
    **values : float
        SI values by parameter name; other parameters have their default.

    Raises
    ------
    InputError
        For an unknown parameter or a value outside its bounds.
    """

    def __init__(self, law: Law, *, table: str = '', folder: str | Path = '.', **values: float):
        for name in values:
            law.parameter(name)
        self.law = law
        self.values: dict[str, float] = {
            p.name: p.check(float(values.get(p.name, p.default * p.scale)))
            for p in law.parameters}
        #: Narrower bounds from the model file (SI), by parameter name.
        self.bounds: dict[str, tuple[float, float]] = {}
        #: 95 % intervals of a fit (SI), by parameter name.
        self.intervals: dict[str, tuple[float, float]] = {}
        #: The measured table, if the law reads one.
        self.table: Any = None
        if law.load is not None:
            if not table:
                raise InputError(f'{law.name}: needs a table (a CSV file)')
            self.table = law.load(Path(folder) / table)

    def __init_subclass__(cls):
        """Raise InputError for an effect written as a class, as in version 1."""
        raise InputError(f'{cls.__name__}: {CLASSES_ARE_GONE}')

    @property
    def name(self) -> str:
        """Name of the law; read so often that `__getattr__` would be too slow."""
        return self.law.name

    def __getattr__(self, name: str) -> Any:
        """Return a field of the law, or the SI value of a parameter."""
        own = self.__dict__
        if not name.startswith('__') and 'law' in own:
            if hasattr(own['law'], name):
                return getattr(own['law'], name)
            if name in own['values']:
                return own['values'][name]
        raise AttributeError(f'effect has no attribute {name!r}')

    def limits(self, name: str) -> tuple[float, float]:
        """Return the bounds of a parameter, SI."""
        parameter = self.law.parameter(name)
        return self.bounds.get(name, (parameter.lower * parameter.scale,
                                      parameter.upper * parameter.scale))

    def replace(self, **values: float) -> Effect:
        """
        Return a copy with other SI values; bounds are not checked.

        Raises
        ------
        InputError
            For an unknown parameter.
        """
        for name in values:
            if name not in self.values:
                self.law.parameter(name)
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.values = {**self.values, **values}
        return other

    def options(self) -> dict[str, Any]:
        """Return the entries other than parameters that a model file needs for this effect."""
        if self.law.formula:
            return {'expression': self.law.formula, 'place': self.law.place.value}
        return {} if self.table is None else {'table': str(self.table.path.resolve())}

    def __repr__(self):
        shown = ', '.join(f'{p.name}={express(self.values[p.name], p.unit)}'
                          for p in self.law.parameters)
        return f'{self.law.name}({shown})'
