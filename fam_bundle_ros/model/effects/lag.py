# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A pressure line between sensor and muscle, and the first-order lag that memory effects share."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place
from fam_bundle_ros.model.scan import affine_scan


def low_pass(signal, time_constant, x, state):
    """
    Return the first-order lag of a signal over time, and the state to go on with.

    Exact for a signal that is linear between samples (first-order hold), for any sampling.

    Parameters
    ----------
    signal : array, shape (T, ...)
    time_constant : float, s
    x : Sample
        Gives ``dt`` and ``start``; the lag begins at rest with each trial.
    state : tuple or None
        Output and input at the last sample.
    """
    signal = np.asarray(signal, float)
    output, last = (signal[0], signal[0]) if state is None else state
    before = np.empty(np.broadcast_shapes(signal.shape, (1,) + np.shape(last)))
    before[0] = last
    before[1:] = signal[:-1]
    ratio = np.maximum(x.dt, 1e-12) / time_constant
    decay = np.exp(-ratio)
    mean = -np.expm1(-ratio) / ratio
    gain = np.where(x.start, 0.0, decay)
    offset = np.where(x.start, signal, (1.0 - mean) * signal + (mean - decay) * before)
    lagged = affine_scan(gain, offset, output)
    return lagged, (lagged[-1], signal[-1])


class PressureLineLag(Effect):
    """The muscle feels p with tau dp/dt = P - p; the gauge sits at the valve."""

    name = 'pressure_line_lag'
    summary = 'first-order lag of the line between pressure sensor and muscle'
    source = 'first-order line; 5-50 ms as measured on tube-fed muscles'
    place = Place.PRESSURE
    family = 'line_lag'
    memory = True
    signature = 'the residual is in proportion to how fast the pressure changes'
    parameters = (Parameter('time_constant', 's', 0.02, 0.0, 2.0, 'lag of the line'),)
    off = {'time_constant': 0.0}

    def contribution(self, x):
        return 0.0 * x.pressure

    def advance(self, x, state):
        if self.time_constant <= 0.0:
            return 0.0 * x.pressure, state
        lagged, state = low_pass(x.pressure, self.time_constant, x, state)
        return lagged - x.pressure, state
