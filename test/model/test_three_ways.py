# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Each law gives the same numbers on arrays, on plain numbers, and compiled."""

from functools import cache

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.model import Bundle, catalogue, Motion, Place
from fam_bundle_ros.model.laws.mesh import mesh
from fam_bundle_ros.model.vocabulary import bound

from .conftest import effect_from, units

LAWS = [name for name in catalogue.names() if catalogue.get(name).load is None]
FORMULA = effect_from("""
    words: {expression: "k * (abs(sin(strain)) + sqrt(max(strain, 0)) + exp(-stretch)
            + log(stretch) + tanh(strain_rate / w) + min(sign(force) * cos(pi * strain), 1))
            + c * strain ** 2 * pressure * area", place: loss,
            parameters: {k: 2 N, c: 0.3, w: 0.1 1/s}}""")


def everything():
    """Return laws that can stand in one model, so that numba compiles once for all of them."""
    return [catalogue.get(name) for name in LAWS if name != 'tendon_slack'] + [FORMULA.law]


def alone(name, shares):
    """Return a bundle of every law at its off values but one, that with values from shares."""
    effects = [mesh()]
    for law in everything():
        if law.name == name:
            values = {p.name: p.scale * (p.lower + share * (p.upper - p.lower))
                      for p, share in zip(law.parameters, shares, strict=False)}
        else:
            values = {key: value * law.parameter(key).scale for key, value in law.off.items()}
        if law.name == 'words':
            effects.append(FORMULA if name == 'words' else FORMULA.replace(k=0.0, c=0.0))
        elif law.name != 'mesh':
            effects.append(law().replace(**values))
    return Bundle(name, units(2), effects)


def through(force, unit, strain, rate, pressure, time, dt, start, shape, parameters, tables,
            memory, after):
    """Call a model's force as a control loop does."""
    return force(unit, strain, rate, pressure, time, dt, start, shape, parameters, tables, memory,
                 after)


@pytest.mark.parametrize('mode', ['arrays', 'floats'])
def test_the_sign_of_nothing_is_none(mode):
    """sign(0) is 0 and that of a number is +1 or -1, on arrays and plain numbers."""
    def direction(rate):
        return np.sign(rate)

    assert [float(bound(direction, mode)(rate)) for rate in (-0.2, 0.0, 3.0)] == [-1.0, 0.0, 1.0]


@cache
def caller(compiled):
    """Return a kernel that calls a model's force: one for all models when compiled."""
    return kernels.compiled(through) if compiled else through


def run(bundle, motion, compiled):
    """Return the forces of a record from the functions that a control loop calls."""
    m, forces = bundle.model(compiled), np.empty(motion.pressure.shape)
    rows = [item.tolist() for item in (motion.strain, motion.strain_rate, motion.time)]
    for k, (strain, rate, time) in enumerate(zip(*rows, strict=True)):
        felt = motion.pressure[k] if compiled else motion.pressure[k].tolist()
        dt = time - rows[2][k - 1] if k else 0.0
        for unit in range(bundle.n):
            forces[k, unit] = caller(compiled)(m.force, unit, strain, rate, felt,
                                               time - rows[2][0], dt, k == 0, *m[3:])
            m.memory[unit][:] = m.after[unit][:]
    return forces


def record(seed):
    """Return a short motion at uneven times, with reversals."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.002, 0.3, 9))
    strain = np.clip(0.1 + np.cumsum(rng.normal(0, 0.03, 9)), -0.02, 0.2)
    return Motion(strain, rng.uniform(-1e4, 6e5, (9, 2)), rng.uniform(-2, 2, 9), time)


@pytest.mark.parametrize('name', [*LAWS, 'words'])
@given(shares=st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6), seed=st.integers(0, 9999))
@settings(max_examples=12)
def test_the_three_ways_agree(name, shares, seed):
    """A record in one call, sample by sample, and compiled: the same to 1e-9."""
    if name == 'tendon_slack':
        bundle = Bundle(name, units(2), [mesh(), catalogue.get(name)()])
    else:
        bundle = alone(name, shares)
    motion = record(seed)
    whole = bundle.simulate(motion)
    assert np.isfinite(whole).all()
    assert_allclose(run(bundle, motion, compiled=False), whole, rtol=1e-9, atol=1e-9)
    if kernels.numba() is not None:
        assert_allclose(run(bundle, motion, compiled=True), whole, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize('compiled', [False, True])
def test_volumes_agree_with_the_arrays(compiled):
    """The loop's volume and slope are those of `gas_volume`, with every geometry effect on."""
    if compiled and kernels.numba() is None:
        pytest.skip('numba is not installed')
    effects = [catalogue.get(name)() for name in LAWS
               if catalogue.get(name).place is Place.GEOMETRY]
    bundle = Bundle('all', units(2), [mesh(), *effects]).with_parameters(
        {'motor_unit_mismatch.mu2': 0.2, 'tondu_factor.low_pressure': 0.3})
    m, pressure = bundle.model(compiled), np.array([1e5, 3e5])
    felt = pressure if compiled else pressure.tolist()
    for function, arrays in ((m.volume, bundle.gas_volume),
                             (m.volume_slope, bundle.gas_volume_slope)):
        ask = kernels.compiled(volume_through) if compiled else volume_through
        found = [ask(function, unit, 0.15, felt, 0.0, *m[3:6]) for unit in range(2)]
        assert_allclose(found, arrays(0.15, pressure), rtol=1e-12)


def volume_through(function, unit, strain, pressure, time, shape, parameters, tables):
    """Call a model's volume or slope as a control loop does."""
    return function(unit, strain, pressure, time, shape, parameters, tables)


@pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
def test_a_compiled_curve_has_the_forces_of_its_pressures():
    """Every law, memory included: one call says what as many calls of `force` do."""
    bundle = alone('viscoelastic_relaxation', [0.5] * 6)
    m, curve = bundle.model(compiled=True), np.zeros(40)
    m.memory[:] = np.random.default_rng(4).uniform(-1.0, 1.0, m.memory.shape)
    pressures = np.linspace(0.0, 4e5, len(curve))
    moment = (0.12, -0.03), (0.7, 4e-3, False, *m[3:])
    for unit in range(2):
        kernels.compiled(curve_through)(bundle.curve, unit, *moment[0], pressures, *moment[1],
                                        curve)
        expected = []
        for pressure in pressures:
            felt = np.full(2, 1e5)
            felt[unit] = pressure
            expected.append(caller(True)(m.force, unit, *moment[0], felt, *moment[1]))
        assert_allclose(curve, expected, rtol=1e-12, atol=1e-12)
        assert np.ptp(curve) > 10.0


def curve_through(function, unit, strain, rate, pressures, time, dt, start, shape, parameters,
                  tables, memory, after, force):
    """Call a model's curve as the controller does."""
    function(unit, strain, rate, pressures, time, dt, start, shape, parameters, tables, memory,
             after, force)


def test_plain_numbers_give_nan_or_infinity_where_arrays_do():
    """A loop must not stop at a division by zero, a root or a power of a negative number."""
    for formula, strain in (('k / strain', 0.0), ('k * sqrt(strain)', -0.1),
                            ('k * strain ** 0.5', -0.1), ('k * log(strain)', 0.0),
                            ('k * exp(1000 * stretch)', 0.0)):
        bundle = Bundle('b', units(2), [mesh(), own(formula)])
        expected = bundle.unit_forces(strain, [1e5, 1e5])
        assert not np.isfinite(expected).any()
        for forces in [run(bundle, Motion(np.array([strain]), np.full((1, 2), 1e5), np.zeros(1),
                                          np.zeros(1)), compiled)[0]
                       for compiled in (False, kernels.numba() is not None)]:
            np.testing.assert_array_equal(forces, expected)


def own(formula):
    """Return a force given by a formula with one parameter, in N."""
    from fam_bundle_ros.model.expression import expression_law
    from fam_bundle_ros.model.laws.base import Parameter
    return expression_law('own', formula, 'force', (Parameter(1.0, 'N', 0, 9, 'k', name='k'),))()
