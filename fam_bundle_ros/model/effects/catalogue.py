# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The catalogue: every effect that a model file can name, built in or a user's."""

from collections.abc import Iterator, Mapping
from functools import cache
import importlib.metadata
import importlib.util
from pathlib import Path
from types import MappingProxyType

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.effects import (
    bladder,
    braid,
    buckling,
    end_caps,
    friction,
    friction_dahl,
    lag,
    mesh,
    mismatch,
    pneumatic,
    relaxation,
    relaxation_rubber,
    rubber,
    sensors,
    slack,
    surface,
    threshold,
    viscous,
)
from fam_bundle_ros.model.effects.base import Effect

#: Entry points in this group name Effect classes of other packages.
ENTRY_POINT_GROUP = 'fam_bundle_ros.effects'

BUILT_IN: tuple[type[Effect], ...] = (
    mesh.Mesh, bladder.BladderElasticity, bladder.BladderPolynomial, bladder.BladderOgden,
    surface.MeasuredSurface, buckling.ResistiveBuckling, buckling.ResistivePlateau,
    slack.TendonSlack, friction.CoulombFriction, friction.PreslidingHysteresis,
    friction_dahl.PreslidingDahl, viscous.ViscousDamping, viscous.ViscousPower,
    relaxation.ViscoelasticRelaxation, relaxation.RelaxationProny,
    relaxation_rubber.RelaxationRubber, end_caps.EndCaps, end_caps.TonduFactor,
    braid.BraidElasticity, threshold.ThresholdPressure, threshold.SoftThreshold,
    lag.PressureLineLag, rubber.Temperature, rubber.Softening, rubber.SofteningLifetime,
    sensors.ForceSensorBias, sensors.ForceSensorGain, sensors.PressureSensorBias,
    sensors.PressureSensorGain, sensors.StrainSensorOffset, mismatch.MotorUnitMismatch,
    pneumatic.Leak, pneumatic.SupplyDroop,
)


@cache
def available() -> Mapping[str, type[Effect]]:
    """Return every effect class by name: the built-ins, then those of entry points."""
    classes = {effect.name: effect for effect in BUILT_IN}
    for point in importlib.metadata.entry_points(group=ENTRY_POINT_GROUP):
        effect = point.load()
        _check_class(effect, f'entry point {point.name}')
        classes.setdefault(effect.name, effect)
    return MappingProxyType(classes)


def names() -> list[str]:
    """Return the names of all effects."""
    return list(available())


def get(name: str) -> type[Effect]:
    """Return an effect class; InputError with the nearest names when there is none."""
    classes = available()
    if name not in classes:
        from difflib import SequenceMatcher

        def likeness(known: str) -> float:
            # 'colomb' is meant to be coulomb_friction: words of a name count like the whole
            return max(SequenceMatcher(None, name, part).ratio()
                       for part in (known, *known.split('_')))
        near = [known for known in sorted(classes, key=likeness, reverse=True)[:2]
                if likeness(known) >= 0.7]
        hint = f'; did you mean {" or ".join(near)}?' if near else ''
        raise InputError(f"effect '{name}' is not known{hint} (fam_bundle effects lists them)")
    return classes[name]


def from_python_file(path: Path) -> Iterator[type[Effect]]:
    """
    Yield the Effect classes that a user's Python file defines. This runs the file.

    Raises
    ------
    InputError
        When the file cannot be imported or defines no effect.
    """
    spec = importlib.util.spec_from_file_location(f'fam_bundle_user_{path.stem}', path)
    if spec is None or spec.loader is None or not path.is_file():
        raise InputError(f'{path}: is not a Python file')
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the user's file raises
        raise InputError(f'{path}: cannot be imported ({type(error).__name__}: {error})'
                         ) from error
    found = [item for item in vars(module).values()
             if isinstance(item, type) and issubclass(item, Effect)
             and item.__module__ == module.__name__ and hasattr(item, 'name')]
    if not found:
        raise InputError(f'{path}: defines no Effect class')
    for effect in found:
        _check_class(effect, str(path))
        effect.python_file = str(path.resolve())
        yield effect


def _check_class(effect, where):
    missing = [key for key in ('name', 'summary', 'source', 'place', 'family', 'signature')
               if not hasattr(effect, key)]
    if not (isinstance(effect, type) and issubclass(effect, Effect)) or missing:
        raise InputError(f'{where}: {effect!r} is not an Effect class'
                         + (f' (it has no {", ".join(missing)})' if missing else ''))
