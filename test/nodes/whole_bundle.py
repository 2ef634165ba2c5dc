# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of a whole bundle say to it and hear of it."""

from diagnostic_msgs.msg import DiagnosticArray

from fam_bundle_ros.nodes.profile import Points


def hold(force):
    """Return a constant force."""
    return Points('hold', 'force', (0.0,), (force,))


def warnings_of(graph, node='bundle/recruitment_controller'):
    """Return a function: whether a node's newest diagnostics hold a text, at WARN or worse."""
    seen = graph.listen('/diagnostics', DiagnosticArray)

    def warned(text):
        mine = [m.status[0] for m in seen if m.status[0].name == node]
        return bool(mine) and text in mine[-1].message and mine[-1].level >= b'\x01'
    return warned
