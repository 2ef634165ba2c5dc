# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Cases of the workbench: a measurement with a model to start from; and the shipped examples."""

from dataclasses import dataclass

from fam_bundle_ros.discovery import Measurement, read_measurement
from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench.incoming import Incoming


@dataclass(frozen=True)
class Case:
    """A measurement and the model to start from."""

    title: str
    #: Origin of the data in one line.
    origin: str
    data: Measurement
    model: Bundle
    #: Data and model as written in a command line.
    files: tuple[str, str] = ('', '')
    #: How a user's file was read, so that its columns can be corrected.
    source: Incoming | None = None


@dataclass(frozen=True)
class Example:
    """A shipped case: its key, its description for the user, and the stem of its files."""

    key: str
    title: str
    question: str
    origin: str
    stem: str


_SIMULATED = "simulated with this project's own engine, noise 0.6 N"

EXAMPLES = (
    Example('hidden_friction', 'Hidden friction',
            'One muscle, up and down at seven pressures. The model is off by 6.6 N: why?',
            _SIMULATED, 'examples/hidden_friction'),
    Example('bundle_push_back', 'The unit that pushes back',
            'Two motor units. While the second one fills, the bundle is stronger than the model '
            'predicts.', _SIMULATED, 'examples/bundle_push_back'),
    Example('dmsp20', 'A real muscle: DMSP-20',
            'Measured map of a Festo muscle against the ideal braid: 150 N off, several effects '
            'missing.', 'measured: Martens and Boblan, Actuators 2017, CC BY 4.0',
            'dmsp20_static_map'),
    Example('nothing_missing', 'Nothing missing',
            'A model without a missing effect: does the diagnosis report that?', _SIMULATED,
            'examples/nothing_missing'),
    Example('a_stranger', 'Not in the catalogue',
            'An effect that no catalogue has. Describe it, then write it yourself.', _SIMULATED,
            'examples/a_stranger'),
)


def load_example(key: str) -> Case:
    """Return an example by its key."""
    example = next(each for each in EXAMPLES if each.key == key)
    data, model = (config_path(f'data/{example.stem}{ending}')
                   for ending in ('.csv', '.model.yaml'))
    return Case(example.title, example.origin, read_measurement(data, name=example.title),
                load_model(model), (str(data), str(model)))
