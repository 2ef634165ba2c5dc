# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is said of a measurement beside the answer."""

from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import words
from fam_bundle_ros.discovery.posterior import Change
from fam_bundle_ros.discovery.verdict import Finding, Left
from fam_bundle_ros.discovery.words import ascends, summarise

TIME = np.arange(0.0, 20.0, 0.1)
STRAIN = 0.1 + 0.1 * np.sin(TIME)


def log(*isobars):
    """Return a log of some isobars, Pa, one after the other."""
    count = len(isobars)
    trial = np.repeat(np.arange(count), len(TIME))
    return build('log', np.tile(STRAIN, count), np.repeat(isobars, len(TIME))[:, None],
                 np.tile(50.0 - 100.0 * STRAIN, count), trial,
                 np.tile(TIME, count) + 30.0 * trial)


@pytest.mark.parametrize(('isobars', 'told'), [
    ((1e5, 2e5, 3e5, 4e5), True),
    ((1e5, 3e5, 2e5, 4e5), False),
    ((1e5, 2e5), False),
])
def test_isobars_that_only_rise_are_told_of(isobars, told):
    """Then pressure and time go together; two isobars are no order."""
    assert ascends(log(*isobars)) == told


def test_a_trial_that_was_taken_out_breaks_no_order():
    """Rows of one isobar left out, as a held-out test does: the others rise still."""
    data = log(1e5, 2e5, 3e5, 4e5)
    assert ascends(data.select(data.trial != 1))
    assert not ascends(data.select(data.trial < 2))


@pytest.mark.parametrize(('rough', 'noise', 'told'), [
    (0.1, 1.3, 'down to the noise'), (0.1, 0.0, '1.36 N rms are left without one'),
    (1.3, 0.4, 'down to 1.36 N')])
def test_what_is_left_without_a_shape_is_not_called_noise(rough, noise, told):
    """Stick and slip, in cells or between them, though as good as none for a rig."""
    finding = Finding('missing_effect', Left(3.1, 0.2), Left(0.0, rough), 0.8)
    friction = [Change('', 'coulomb_friction')]
    said = summarise(finding, friction, friction, (), (), None, (), {
        'recalibrated': 3.1, 'best': 1.36, 'noise': noise})
    assert told in said
    assert ('1% of the largest' in said) == (rough > 1.0)


def test_the_next_experiment_asks_about_the_effect_that_is_least_sure(monkeypatch):
    """Not about one that all likely sets have."""
    asked, without = [], SimpleNamespace(names=('coulomb_friction',))
    monkeypatch.setattr(words, '_rival', lambda posterior, tie, chosen: asked.append(tie[0])
                        or without)
    monkeypatch.setattr(words, '_labels', lambda posterior, fit: ['coulomb_friction'])
    monkeypatch.setattr(words, 'best_experiment', lambda *fits: (None, []))
    posterior = SimpleNamespace(of_label={'end_caps': 0.7, 'coulomb_friction': 1.0}.get)
    fitter = SimpleNamespace(cells=SimpleNamespace(data=SimpleNamespace(is_static=False)))
    words.next_experiment(fitter, posterior, Finding('missing_effect', Left(3.1, 0.2),
                                                     Left(0.0, 0.2), 0.8),
                          [Change('', 'end_caps'), Change('', 'coulomb_friction')], None, (), ())
    assert asked == ['end_caps']


def test_an_effect_that_is_likelier_than_not_but_not_named_is_told_of(monkeypatch):
    """Named effects are told as the answer, ties as ties; what is left is below one half."""
    shares = {'end_caps': 0.99, 'coulomb_friction': 0.6, 'tendon_slack': 0.7, 'temperature': 0.4}
    posterior = SimpleNamespace(labels=lambda: list(shares), of_label=shares.get)
    monkeypatch.setattr(words, '_labels', lambda posterior, fit: ['end_caps'])
    told, = words.not_named(posterior, None, ['tendon_slack'])
    assert told.startswith('coulomb_friction is likelier than not (0.60)')
