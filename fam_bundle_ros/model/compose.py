# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Generate functions for force and volume from a set of laws; one text for all modes.

A `Composition` belongs to a set of laws and has no values: parameters, geometry, tables and
memory are arguments. Its text defines

- ``muscle(...)``: force of one muscle at a sample, laws with memory included
- ``muscle_at_rest(...)``: the same at equilibrium
- ``volume(...)``, ``volume_slope(...)``: gas volume of one muscle, derived from the mesh
- ``unit_force``, ``unit_volume``, ``unit_volume_slope``: the same for a motor unit, with the
  signatures of `fam_bundle_ros.model.seam`

The text is in `linecache`, so tracebacks show its lines. It has no names from a model file.
"""

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
import textwrap
from types import SimpleNamespace
from typing import Any

import numpy as np

from fam_bundle_ros import kernels
from fam_bundle_ros.model.laws.base import (
    arguments,
    FELT,
    Law,
    Part,
    Place,
    SHAPE,
    STEPPING,
    TABLES,
)
from fam_bundle_ros.model.seam import CURVE, pointers
from fam_bundle_ros.model.source import executed
from fam_bundle_ros.model.vocabulary import bound

#: Column of the shape array with the number of muscles, after the fields `SHAPE`.
MUSCLES = len(SHAPE)
#: Nodes and weights of Gauss-Legendre's rule on [0, 1], exact for polynomials up to degree 9.
_GAUSS = ((0.04691007703066800, 0.11846344252809454), (0.23076534494715845, 0.23931433524968324),
          (0.5, 0.28444444444444444), (0.76923465505284155, 0.23931433524968324),
          (0.95308992296933200, 0.11846344252809454))
_RESERVED = {*FELT, *SHAPE, *STEPPING, *TABLES, 'np', 'shape', 'parameters', 'memory', 'after',
             'muscle', 'muscle_at_rest', 'volume', 'volume_slope', 'grown', 'stretched', 'felt',
             'whole', 'bracket', 'inside', 'node', 'weight', 'int', 'one'}
_VOLUME_ARGUMENTS = 'unit, strain, pressure, time, shape, parameters, tables'

_SEAM = f'''
def unit_force(unit, strain, strain_rate, pressure, time, dt, start, shape, parameters, tables,
               memory, after):
    """Force of a motor unit at a sample, N."""
    one = shape[unit]
    return one[{MUSCLES}] * muscle(
        unit, strain, strain_rate, pressure[unit], time, dt, start, start, one, parameters,
        tables, memory[unit], after[unit])


def unit_curve(unit, strain, strain_rate, pressure, time, dt, start, shape, parameters, tables,
               memory, after, force):
    """Force of a motor unit at each of some pressures of its own, N."""
    one, before, then = shape[unit], memory[unit], after[unit]
    for k in range(len(pressure)):
        force[k] = one[{MUSCLES}] * muscle(
            unit, strain, strain_rate, pressure[k], time, dt, start, start, one, parameters,
            tables, before, then)


def unit_volume(unit, strain, pressure, time, shape, parameters, tables):
    """Gas volume of a motor unit, m^3."""
    one = shape[unit]
    return one[{MUSCLES}] * volume(unit, strain, pressure[unit], time, one, parameters, tables)


def unit_volume_slope(unit, strain, pressure, time, shape, parameters, tables):
    """How fast the gas volume of a motor unit grows with strain at constant pressure, m^3."""
    one = shape[unit]
    return one[{MUSCLES}] * volume_slope(
        unit, strain, pressure[unit], time, one, parameters, tables)
'''


class Composition:
    """
    The laws of a model, combined by place.

    Parameters
    ----------
    laws : sequence of Law
        Names must differ. Within a place their order does not matter.

    Attributes
    ----------
    parameters : tuple of (str, str)
        Law and parameter of each element of the parameter array.
    memory : tuple of (str, str)
        Law and field of each element of a unit's memory.
    tabled : tuple of str
        Laws with a table, in the order of the table array.
    text : str
        Source of the generated functions.
    """

    def __init__(self, laws: Sequence[Law]):
        self.laws = tuple(laws)
        self.parameters = tuple((law.name, p.name) for law in laws for p in law.parameters)
        self.memory = tuple((law.name, name) for law in laws for name in law.memory)
        self.tabled = tuple(law.name for law in laws if law.load is not None)
        self._functions: dict[str, Callable] = {}
        self._modes: dict[str, SimpleNamespace] = {}
        self._fields: dict[str, tuple[str, ...]] = {}
        self._parts: dict[Place, list[tuple[str, Law, Part]]] = {place: [] for place in Place}
        for index, law in enumerate(laws):
            plain = not law.formula and law.name.isidentifier() and law.name not in _RESERVED
            for part in law.parts:
                called = law.name if plain else f'law_{index}'
                called += f'_{part.place.value}' if part is not law.parts[0] else ''
                self._parts[part.place].append((called, law, part))
                self._functions[called] = part.function
                self._fields[called] = tuple(f for f in part.arguments if f in law.memory)
                if part.equilibrium is not None:
                    self._functions[called + '_at_rest'] = part.equilibrium
        self.text = '\n\n'.join([
            self._muscle(False), self._muscle(True), self._volume(),
            self._volume_slope()]) + '\n' + _SEAM

    @property
    def has_memory(self) -> bool:
        """Whether the force depends on earlier samples."""
        return bool(self.memory)

    def at(self, place: Place) -> list[tuple[str, Law, Part]]:
        """Return the parts at a place: name in the text, law, part."""
        return self._parts[place]

    # --- the text ------------------------------------------------------------------------------

    def _call(self, called, law, part, static):
        """Return the line that assigns a part's contribution."""
        rest = static and part.equilibrium is not None
        function = part.equilibrium if rest else part.function
        offset = [law.name for law in self.laws].index(law.name)
        first = sum(len(other.parameters) for other in self.laws[:offset])
        remembered = sum(len(other.memory) for other in self.laws[:offset])
        own = list(law.names)
        given, after = [], []
        for name in arguments(function):
            if name in law.names:
                given.append(f'parameters[{first + own.index(name)}]')
            elif name in law.memory:
                index = remembered + law.memory.index(name)
                given.append('0.0' if static else f'memory[{index}]')
                after.append(f', after[{index}]')
            elif name == 'table':
                given.append(f'int(tables[{self.tabled.index(law.name)}])')
            elif static and name in STEPPING:
                given.append('0.0' if name == 'dt' else 'True')
            else:
                given.append(name)
        call = f'{called}{"_at_rest" if rest else ""}({", ".join(given)})'
        if after and static and not rest:
            call, after = f'{call}[0]', []
        return f'by_{called}{"".join(after)} = {call}'

    def _calls(self, parts, static=True):
        return [self._call(called, law, part, static) for called, law, part in parts]

    def _used(self, *places):
        """Return the argument names of the laws at some places."""
        return {name for place in places for _, _, part in self._parts[place]
                for function in (part.function, part.equilibrium) if function is not None
                for name in arguments(function)}

    def _felt_pressure(self, static):
        lines = self._calls(self._parts[Place.PRESSURE], static)
        if lines:
            lines.append(f'pressure = pressure + {_total(self._parts[Place.PRESSURE])}')
        return lines

    def _changing(self, quantity):
        return [part for part in self._parts[Place.GEOMETRY] if part[2].changes == quantity]

    def _muscle(self, static):
        force = self._parts[Place.FORCE]
        bladder = [part for part in force if part[1].family == 'bladder']
        others = [part for part in force if part[1].family != 'bladder']
        used = self._used(Place.PRESSURE, Place.GEOMETRY, Place.FORCE, Place.LIMIT, Place.LOSS,
                          Place.RESIDUAL)
        lines = [f'{name} = shape[{SHAPE.index(name)}]' for name in SHAPE if name in used]
        lines += ['braid = 1.0', 'bladder = 0.0', 'stretch = 1.0 - strain']
        residual = self._parts[Place.RESIDUAL]
        lines += self._calls(residual, static)
        lines += self._felt_pressure(static)
        lines += self._calls(self._parts[Place.GEOMETRY], static)
        for quantity, start in (('strain', 'strain'), ('braid', '1.0')):
            if self._changing(quantity):
                lines.append(f'{quantity} = {start} + {_total(self._changing(quantity))}')
        if self._changing('area'):
            lines.append(f'grown = 1.0 + {_total(self._changing("area"))}')
            lines += [f'{name} = {name} * {"np.sqrt(grown)" if linear else "grown"}'
                      for name, linear in (('radius', True), ('wall_thickness', True),
                                           ('area', False), ('wall_area', False))
                      if name in used]
        if self._changing('strain'):
            lines.append('stretch = 1.0 - strain')
        if bladder:
            lines += [*self._calls(bladder, static), f'bladder = {_total(bladder)}']
        lines += [*self._calls(others, static),
                  f'force = bladder + {_total(others)}' if others else 'force = bladder']
        limits = self._parts[Place.LIMIT]
        lines += self._calls(limits, static)
        lines += [f'force = np.maximum(force, by_{called})' for called, _, _ in limits]
        losses = self._parts[Place.LOSS]
        lines += self._calls(losses, static)
        lines += [f'force = force + {_total(parts)}' for parts in (losses, residual) if parts]
        stepping = '' if static else ', dt, start, log_start'
        ends = '' if static else ', memory, after'
        return _function(
            'muscle_at_rest' if static else 'muscle',
            f'unit, strain, strain_rate, pressure, time{stepping}, shape, parameters, tables'
            f'{ends}', 'Force of one muscle{}, N.'.format(' at equilibrium' if static else ''),
            [*lines, 'return force'])

    def _felt(self):
        """Return the lines that compute pressure, thread stretch and cross section."""
        used = self._used(Place.PRESSURE, Place.GEOMETRY) | {
            'length', 'area', 'wall_area', 'cos2', 'sin2', 'cot2'}
        lines = [f'{name} = shape[{SHAPE.index(name)}]' for name in SHAPE if name in used]
        lines += ['strain_rate = 0.0', 'stretch = 1.0 - strain', *self._felt_pressure(True)]
        lines += self._calls(self._changing('braid') + self._changing('area'))
        for name, quantity in (('stretched', 'braid'), ('grown', 'area')):
            change = self._changing(quantity)
            lines.append(f'{name} = 1.0' + (f' + {_total(change)}' if change else ''))
        return lines

    def _volume(self):
        strains = self._changing('strain')
        if strains:
            nodes = ', '.join(f'({x!r}, {w!r})' for x, w in _GAUSS)
            lines = ['whole = strain', 'bracket = 0.0', f'for node, weight in ({nodes}):',
                     *(f'    {line}' for line in [
                         'strain = node * whole', 'stretch = 1.0 - strain',
                         *self._calls(strains), f'felt = stretch - {_total(strains)}',
                         'bracket = bracket + weight * '
                         '(3.0 * felt * felt * cot2 - stretched / sin2)']),
                     'inside = (stretched - cos2) / sin2 + whole * bracket']
        else:
            lines = ['inside = stretch * (stretched - stretch * stretch * cos2) / sin2']
        return _function(
            'volume', _VOLUME_ARGUMENTS, 'Gas volume of one muscle without tubes, m^3.',
            [*self._felt(), *lines, 'return grown * length * (area * inside - wall_area)'])

    def _volume_slope(self):
        strains = self._changing('strain')
        felt = f'stretch - {_total(strains)}' if strains else 'stretch'
        return _function(
            'volume_slope', _VOLUME_ARGUMENTS,
            'Growth of the gas volume of one muscle with strain, m^3.',
            [*self._felt(), *self._calls(strains), f'felt = {felt}',
             'return grown * length * area * (3.0 * felt * felt * cot2 - stretched / sin2)'])

    # --- the functions -------------------------------------------------------------------------

    def functions(self, mode: str) -> SimpleNamespace:
        """
        Return the functions of the text for one mode of `fam_bundle_ros.model.vocabulary`.

        With ``'arrays'`` call ``muscle``, ``muscle_at_rest``, ``volume`` and
        ``volume_slope`` with arrays that broadcast to (..., n): ``unit`` (n,), ``shape`` (G, n).
        """
        if mode not in self._modes:
            self._modes[mode] = self._with_names(mode, bound(np, mode), {
                called: bound(function, mode) for called, function in self._functions.items()})
        return self._modes[mode]

    def functions_of(self, words: Any, made: Callable[[Callable, tuple[str, ...]], Callable]
                     ) -> SimpleNamespace:
        """
        Return the functions of the text for another type of number.

        Parameters
        ----------
        words : object
            Has the functions used between laws: ``maximum`` and ``sqrt``.
        made : callable
            Takes a law's function and the names of its memory fields; returns a function for this
            type of number.
        """
        return self._with_names('', words, {
            called: made(function, self._fields.get(called, ()))
            for called, function in self._functions.items()})

    def _with_names(self, mode, words, laws):
        names = executed(self.text, 'laws', {'np': words, **laws}, mode == 'kernels')
        return SimpleNamespace(**{name: item for name, item in names.items()
                                  if name not in {'np', *laws} and not name.startswith('__')})

    @cached_property
    def plain(self) -> tuple[Callable, Callable, Callable]:
        """`unit_force`, `unit_volume` and `unit_volume_slope` on floats and lists."""
        made, arrays = self.functions('floats'), self.functions('arrays')
        return (_never_raises(made.unit_force, arrays.unit_force),
                _never_raises(made.unit_volume, arrays.unit_volume),
                _never_raises(made.unit_volume_slope, arrays.unit_volume_slope))

    @cached_property
    def curve(self) -> Any:
        """`unit_curve` as a C function; raises `kernels.NotCompiled` if that is impossible."""
        return kernels.pointer(self.functions('kernels').unit_curve, CURVE)

    @cached_property
    def pointers(self) -> tuple[Any, Any, Any]:
        """The functions of `plain` as C functions; raises as `curve` does."""
        made = self.functions('kernels')
        return pointers(made.unit_force, made.unit_volume, made.unit_volume_slope)


#: Returns the composition of some laws; cached.
composition = lru_cache(maxsize=512)(Composition)


def _total(parts):
    """Return the text of the sum of some parts' contributions."""
    text = ' + '.join(f'by_{called}' for called, _, _ in parts)
    return f'({text})' if len(parts) > 1 else text


def _function(name, arguments, summary, lines):
    head = textwrap.fill(f'def {name}({arguments}):', 99,
                         subsequent_indent=' ' * (len(name) + 5))
    return '\n'.join([head, f'    """{summary}"""', *(f'    {line}' for line in lines)]) + '\n'


def _never_raises(plain, on_arrays):
    """Return a function on floats that returns nan or infinity where arrays do."""
    def function(*arguments):
        try:
            return float(plain(*arguments))
        except (ArithmeticError, ValueError, TypeError):
            unit, *others = arguments
            after = others[-1] if isinstance(others[-1], list) and len(others) > 7 else None
            given: list[Any] = [item if isinstance(item, bool) else np.asarray(item, float)[()]
                                for item in others]
            with np.errstate(all='ignore'):
                value = float(on_arrays(unit, *given))
            if after is not None:
                after[unit][:] = given[-1][unit].tolist()
            return value
    return function
