# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects that are added by name: their shape, and the doubt that is told with them."""

import math
from types import SimpleNamespace

import pytest

from fam_bundle_ros.discovery.add import _best_shapes, Added
from fam_bundle_ros.discovery.settings import Choices


@pytest.mark.parametrize(('gain', 'added'), [
    (-1.0, 'coulomb_friction'), (math.log(20.0) - 0.1, 'coulomb_friction'),
    (math.log(20.0) + 0.1, 'stribeck_friction')])
def test_the_shape_that_was_named_is_added_unless_another_is_clearly_better(gain, added):
    """By more than the odds of a tie."""
    search = SimpleNamespace(
        options=SimpleNamespace(choices=Choices(odds=20.0),
                                effects=('mesh', 'coulomb_friction', 'stribeck_friction')),
        fit=lambda names: SimpleNamespace(
            names=names, posterior=gain if 'stribeck_friction' in names else 0.0))
    fit, shapes = _best_shapes(search, {'mesh'}, ('coulomb_friction',), ['coulomb_friction'])
    assert shapes == (added,)
    assert fit.names == tuple(sorted(('mesh', added)))


@pytest.mark.parametrize(('odds', 'told'), [
    (0.5, 'these data do not support the change: with it they are 0.5 times as probable'),
    (12.0, 'caution: a smooth discrepancy in its place is nearly as probable (odds of 12 to 1'),
    (21.0, ''), (None, '')])
def test_the_doubt_about_a_change_is_that_of_a_diagnosis(odds, told):
    """Nearly as probable is no contradiction to an effect that was named with this caution."""
    log_odds = None if odds is None else math.log(odds)
    doubt = Added.doubt.fget(SimpleNamespace(log_odds=log_odds, least_odds=20.0))
    assert doubt.startswith(told)
    assert bool(doubt) == bool(told)
