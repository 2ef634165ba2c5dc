# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of a whole bundle say to it and hear of it."""

from fam_bundle_ros.nodes.profile import Points


def hold(force):
    """Return a constant force."""
    return Points('hold', 'force', (0.0,), (force,))


def warnings_of(graph):
    """Return a function: whether the controller warns of a text in its newest diagnostics."""
    states = graph.diagnostics('recruitment_controller')
    return lambda text: (bool(states) and text in states[-1].message
                         and states[-1].level >= b'\x01')


def values_of(state):
    """Return keys and values of a state on /diagnostics."""
    return {pair.key: pair.value for pair in state.values}
