# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""An effect of the simulated rig that is in no model, switched on and off while the rig runs."""

from collections.abc import Mapping
import re
from typing import Any

import yaml

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, dumps_model, loads_model
from fam_bundle_ros.nodes.parameters import Spec
from fam_bundle_ros.plant import Rig

HIDDEN = Spec('hidden_effect', '', 'an additional effect of the rig, written as in a model file: '
              '"coulomb_friction: {force: 4 N}"', dynamic=True)


class HiddenEffect:
    """The parameter ``hidden_effect`` of a simulated rig; ``text`` is its first value."""

    def __init__(self, rig: Rig, text: str):
        self._rig, self._plain = rig, rig.bundle
        self._text = ''
        self.take(text)

    def check(self, values: Mapping[str, Any]) -> None:
        """Check that a text is an effect which the rig does not have yet (InputError)."""
        if values[HIDDEN.name] not in ('', self._text):
            with_written_effect(self._plain, values[HIDDEN.name])

    def take(self, text: str) -> None:
        """Replace the additional effect of the rig; an empty text removes it."""
        if text != self._text:
            self._rig.change_bundle(with_written_effect(self._plain, text) if text
                                    else self._plain)
            self._text = text


def with_written_effect(bundle: Bundle, text: str) -> Bundle:
    """
    Return a bundle with an additional effect, written as in a model file.

    InputError if the text is no effect, or one that the bundle has already.

    Examples
    --------
    >>> from fam_bundle_ros.nodes.models import bundle_from
    >>> bundle = with_written_effect(bundle_from('spie2021'), 'coulomb_friction: {force: 4 N}')
    >>> bundle.effect('coulomb_friction').force
    4.0
    """
    try:
        tree = yaml.safe_load(dumps_model(Bundle(bundle.name, bundle.motor_units, [])))
        tree['effects'] = [yaml.safe_load(text)]
        (effect,) = loads_model(yaml.safe_dump(tree), HIDDEN.name).effects
    except yaml.YAMLError as error:
        raise InputError(f'{HIDDEN.name} is {text!r}; expected an effect as a model file writes '
                         'it, such as "coulomb_friction: {force: 4 N}"') from error
    except InputError as error:
        # the line number is that of the text made above, which the user does not see
        raise InputError(re.sub(r', line \d+', '', str(error))) from error
    if any(own.name == effect.name for own in bundle.effects):
        raise InputError(f'{HIDDEN.name}: {bundle.name} has {effect.name} already')
    return bundle.with_effect(effect)
