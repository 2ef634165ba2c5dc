# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""One muscle: geometry and effects composed into a force. Arrays in, arrays out, SI units."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Place, Sample, SensorError
from fam_bundle_ros.model.geometry import Geometry


class Muscle:
    """
    The effects of a model, sorted by place once, and the order in which they act.

    Parameters
    ----------
    effects : sequence of Effect
        Names must differ. Within a place their order does not matter.
    """

    def __init__(self, effects: Sequence[Effect]):
        self._at = {place: tuple(e for e in effects if e.place is place) for place in Place}
        forces = self._at[Place.FORCE]
        self._bladder = tuple(e for e in forces if e.family == 'bladder')
        self._elastic = tuple(e for e in forces if e.family != 'bladder')
        self.memory = any(e.memory for e in effects)

    def at(self, place: Place) -> tuple[Effect, ...]:
        """Return the effects that act at a place."""
        return self._at[place]

    def force(self, x: Sample, states: dict[str, Any] | None = None):
        """
        Return the tension of one muscle, N, and the memory after the last sample.

        Parameters
        ----------
        x : Sample
            Consumed: pressure, strain and geometry become what the muscle feels.
        states : dict or None
            Memory by effect name; empty at the first sample. Without it, and with ``x.dt`` None,
            effects with memory are at equilibrium.
        """
        after: dict[str, Any] = {}

        def act(effect):
            if x.dt is None or not effect.memory:
                return effect.contribution(x)
            value, after[effect.name] = effect.advance(x, (states or {}).get(effect.name))
            return value

        changes = [act(effect) for effect in self._at[Place.PRESSURE]]
        if changes:
            x.pressure = x.pressure + sum(changes)
        if self._at[Place.GEOMETRY]:
            self._deform(x, [act(effect) for effect in self._at[Place.GEOMETRY]])
        if self._bladder:
            x.bladder = sum(act(effect) for effect in self._bladder)
        force = x.bladder + sum(act(effect) for effect in self._elastic)
        if self._at[Place.LIMIT]:
            x.force = force
            for floor in [act(effect) for effect in self._at[Place.LIMIT]]:
                force = np.maximum(force, floor)
        if self._at[Place.LOSS]:
            x.force = force
            force = force + sum(act(effect) for effect in self._at[Place.LOSS])
        return force, after

    def sensor_error(self) -> SensorError:
        """Return the sum of all sensor effects."""
        total = SensorError()
        for effect in self._at[Place.SENSOR]:
            total = total + effect.contribution(None)  # type: ignore[arg-type]
        return total

    @staticmethod
    def _deform(x, changes):
        """Apply the sum of all geometry changes."""
        x.strain = x.strain + sum(change.strain for change in changes)
        x.braid = x.braid + sum(change.braid for change in changes)
        area = sum(change.area for change in changes)
        if np.any(area):
            g, scale = x.geometry, np.sqrt(1.0 + area)
            x.geometry = Geometry(g.radius * scale, g.length, g.braid_angle,
                                  g.wall_thickness * scale)
