# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What every law owes the composition, built in or a user's; what single laws say."""

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, Motion, Place
from fam_bundle_ros.model.laws.bladder import bladder_elasticity
from fam_bundle_ros.model.laws.mesh import mesh

from .conftest import effect_from, PAPER, units

USERS = effect_from('my_drag: {expression: "-k * strain_rate * pressure", place: loss, '
                    'parameters: {k: 0.02 N*s/kPa}}')
TABLE_FREE = [name for name, law in catalogue.available().items() if law.load is None]


def example(name):
    """Return an effect with values at which it certainly does something."""
    if name == 'my_drag':
        return USERS
    kind = catalogue.get(name)
    values = {}
    for p in kind.parameters:
        middle = p.default if p.default not in (p.lower, 0.0) else p.lower + 0.3 * (
            p.upper - p.lower)
        values[p.name] = middle * p.scale
    return kind(**values)


@pytest.fixture(params=[*TABLE_FREE, 'my_drag'])
def effect(request):
    """Return each effect of the catalogue in turn, and a user's formula."""
    return example(request.param)


def bundle_with(*effects):
    """Return two units with mesh, bladder and these effects."""
    own = {e.name for e in effects}
    base = [e for e in (mesh(), bladder_elasticity()) if e.name not in own]
    return Bundle('test', units(2), [*base, *effects])


def record(seed=1, samples=157, trials=3):
    """Return a motion with pauses, reversals, uneven sampling and several trials."""
    rng = np.random.default_rng(seed)
    start = np.zeros(samples, bool)
    start[np.linspace(0, samples, trials, endpoint=False).astype(int)] = True
    time = np.cumsum(rng.uniform(0.002, 0.05, samples))
    jumps = 0.07 * np.cumsum(start)  # a trial begins where the last one did not end
    strain = np.clip(np.cumsum(rng.normal(0, 0.01, samples)) + jumps, 0.0, 0.27)
    pressure = np.clip(np.cumsum(rng.normal(0, 2e4, (samples, 2)), axis=0) + 2e5, 0.0, 4e5)
    return Motion(strain, pressure, np.gradient(strain, time), time, start)


def test_stepwise_equals_vectorised(effect):
    """One code: sample by sample in the simulator, as a whole record in a comparison."""
    bundle, motion = bundle_with(effect), record()
    forces, state = [], {}
    for k in range(len(motion.time)):
        if motion.start[k]:
            state = bundle.start_state()
        if effect.across_trials and motion.start[k] and k:
            break  # it goes by the whole log, which a fresh state would begin anew
        dt = motion.time[k] - motion.time[k - 1] if k else 0.0
        force, state = bundle.step(state, dt, motion.strain[k], motion.pressure[k],
                                   motion.strain_rate[k])
        forces.append(force)
    assert_allclose(forces, bundle.simulate(motion)[:len(forces)], rtol=1e-9, atol=1e-9)


def test_a_record_can_be_cut_in_two_with_the_memory_handed_over(effect):
    """Candidates at one tick see the same memory, and asking leaves it untouched."""
    bundle, motion = bundle_with(effect), record(trials=1)
    state = bundle.start_state()
    for k in range(20):
        _, state = bundle.step(state, 0.01, motion.strain[k], motion.pressure[k],
                               motion.strain_rate[k])
    tick = (0.01, motion.strain[20], motion.strain_rate[20])
    candidates = np.array([[0.0, 0.0], motion.pressure[20], [3e5, 1e5]])
    asked, _ = bundle.step(state, tick[0], tick[1], candidates, tick[2])
    taken, _ = bundle.step(state, tick[0], tick[1], motion.pressure[20], tick[2])
    assert_allclose(asked[1], taken, rtol=1e-12)


def test_without_its_coefficients_an_effect_does_nothing(effect):
    """Zero coefficient means no effect, wherever it acts."""
    if not effect.off:
        assert effect.name in ('mesh', 'tendon_slack', 'my_drag')
        return
    off = effect.replace(**{key: value * effect.parameter(key).scale
                            for key, value in effect.off.items()})
    motion = record()
    base = bundle_with(off).without_effect(effect.name)
    assert_allclose(bundle_with(off).predict(motion), base.predict(motion), atol=1e-9)


def test_an_effect_does_something(effect):
    """At its example values each effect changes the prediction, except those of the supply."""
    if effect.place is Place.PNEUMATICS or effect.name == 'mesh':
        return
    motion = record()
    with_it = bundle_with(effect)
    changed = np.abs(with_it.predict(motion) - with_it.without_effect(effect.name).predict(motion))
    assert changed.max() > 1e-3


def test_order_within_a_place_does_not_matter(effect):
    """Two effects of one place compose to the same force in either order."""
    motion = record()
    for name in TABLE_FREE:
        other = example(name)
        if other.place is effect.place and name != effect.name:
            one = bundle_with(effect, other).predict(motion)
            assert_allclose(one, bundle_with(other, effect).predict(motion), rtol=1e-12,
                            atol=1e-12)


def test_finite_over_the_whole_operating_box(effect):
    """No NaN or infinity from -2 to 45 % strain, 0 to 1 MPa, up to 5 1/s."""
    strain, pressure, rate = np.meshgrid(np.linspace(-0.02, 0.45, 24), np.linspace(0, 1e6, 11),
                                         [-5.0, 0.0, 5.0])
    pressures = np.stack([pressure, pressure[::-1]], axis=-1)
    assert np.all(np.isfinite(bundle_with(effect).unit_forces(strain, pressures, rate)))


def test_every_effect_says_what_it_is(effect):
    """Source, signature, units and bounds are there and the default lies within the bounds."""
    assert all((effect.summary, effect.source, effect.signature, effect.family))
    for p in effect.parameters:
        assert p.description
        assert p.lower <= p.default <= p.upper
        assert p.scale > 0.0


def test_an_unknown_parameter_is_refused():
    """The message names what the effect has."""
    with pytest.raises(InputError, match="coulomb_friction has no parameter 'size'; it has force"):
        catalogue.get('coulomb_friction')(size=3.0)


def test_a_value_out_of_bounds_is_refused():
    """In the unit in which the parameter is given."""
    with pytest.raises(InputError, match=r'force is -3 N; expected between 0 and 2000 N'):
        catalogue.get('coulomb_friction')(force=-3.0)


def test_coulomb_loop_has_the_same_width_at_any_speed():
    """Shortening and lengthening differ by twice the friction force, slow or fast."""
    bundle = bundle_with(catalogue.get('coulomb_friction')(force=4.0))
    for speed in (0.02, 0.5):
        there, back = bundle.force(0.1, [2e5, 0.0], [speed, -speed])
        assert_allclose(back - there, 2 * 2 * 4.0, rtol=1e-6)  # two muscles


@pytest.mark.parametrize('name', ['coulomb_friction', 'stribeck_friction'])
def test_dry_friction_is_no_damping_at_any_width_of_its_sign(name):
    """A sweep over the range in 2 s has the friction of one in 0.2 s, within a hundredth."""
    kind = catalogue.get(name)
    widest = next(p.upper for p in kind.parameters if p.name == 'smoothing')
    rubs = bundle_with(kind(smoothing=widest, **({'rise': 0.0} if 'stri' in name else {})))
    slow, fast = (rubs.force(0.1, [2e5, 0.0], [rate]) - rubs.force(0.1, [2e5, 0.0])
                  for rate in (0.1, 1.0))
    assert_allclose(slow, fast, rtol=0.01)


def test_presliding_rounds_the_corner_over_a_fixed_strain():
    """After a reversal half of the loop is crossed within the width, whatever the time taken."""
    bundle = Bundle('one', units(1), [mesh()]).with_effect(
        'presliding_hysteresis', force=4.0, width=0.01)
    strain = np.concatenate([np.linspace(0, 0.1, 201), np.linspace(0.1, 0.05, 101)])
    pressure = np.zeros((302, 1))
    for dt in (1e-3, 1.0):
        motion = Motion(strain, pressure, np.zeros(302), dt * np.arange(302), np.arange(302) == 0)
        force = bundle.simulate(motion)[:, 0]
        assert_allclose(force[200], -4.0)
        assert_allclose(force[-1], 4.0)
        assert -2.0 < force[221] < 2.0  # 1 % strain after the reversal


@pytest.mark.parametrize(('law', 'values', 'at'), [
    ('pressure_dahl', {'half_width': 4e3}, lambda pressure: 4e3),
    ('pressure_friction', {'share': 0.02}, lambda pressure: 0.02 * pressure)])
def test_filling_and_venting_a_held_muscle_differ_by_twice_the_friction(law, values, at):
    """Ideal mesh, in pressure: constant, or in proportion; after a reversal over the width."""
    width = 10e3
    bundle = Bundle('one', units(1), [mesh()]).with_effect(law, width=width, **values)
    pressure = np.concatenate([np.linspace(0, 3e5, 601), np.linspace(3e5, 0, 601)])
    time = 0.01 * np.arange(1202)
    force = bundle.simulate(Motion(np.zeros(1202), pressure[:, None], np.zeros(1202), time,
                                   time == 0))[:, 0]
    lost = pressure - force / bundle.without_effect(law).force(0.0, [1.0])
    for level in (1e5, 2e5):
        filling, venting = np.flatnonzero(np.isclose(pressure, level))
        assert_allclose(lost[[filling, venting]], [at(level), -at(level)], rtol=1e-3)
    turned = 601 + 20  # 10 kPa after the reversal, of which the play takes 0.2 kPa
    assert_allclose(lost[turned], at(pressure[turned]) * (2 * np.exp(-0.98) - 1), rtol=1e-6)


@pytest.mark.parametrize(('law', 'left'), [
    ('pressure_line_lag', lambda t: np.exp(-t)),
    ('pressure_line_double', lambda t: (1.0 + 2.0 * t) * np.exp(-2.0 * t))])
def test_a_line_is_as_late_behind_a_ramp_as_its_time_constant_says(law, left):
    """Of first and of second order; after a step what is left is that of one or two volumes."""
    lag, time = 0.05, 1e-3 * np.arange(1001)
    bundle = Bundle('one', units(1), [mesh()]).with_effect(law, time_constant=lag)
    per_pascal = bundle.force(0.0, [1.0])

    def felt(pressure):
        motion = Motion(np.zeros(1001), pressure[:, None], np.zeros(1001), time, time == 0)
        return bundle.simulate(motion)[:, 0] / per_pascal
    ramp = 2e5 * time
    assert_allclose(ramp[-1] - felt(ramp)[-1], 2e5 * lag, rtol=1e-6)
    # a step within one sample is a ramp about half a sample before its end
    after = time[101:200] - time[100] + 0.5e-3
    step = np.where(time < 0.1, 0.0, 1e5)
    assert_allclose(1e5 - felt(step)[101:200], 1e5 * left(after / lag), atol=100.0)


@pytest.mark.parametrize(('law', 'left'), [
    ('threshold_pressure', lambda ratio: np.maximum(ratio - 1.0, 0.0)),
    ('soft_threshold', lambda ratio: ratio - (1.0 - np.exp(-ratio ** 1.5)) ** (2.0 / 3.0))])
def test_a_threshold_is_lost_at_once_or_gradually(law, left):
    """Of a pressure in units of the threshold: what is left of it drives the braid."""
    threshold, ratio = 40e3, np.array([0.0, 0.3, 1.0, 2.0, 9.0])
    plain = Bundle('one', units(1), [mesh()])
    force = plain.with_effect(law, pressure=threshold).force(0.1, threshold * ratio[:, None])
    assert_allclose(force, plain.force(0.1, threshold * left(ratio)[:, None]), atol=1e-9)


def test_a_soft_threshold_can_be_a_hyperbolic_tangent():
    """Within a fiftieth of the threshold at any pressure; so do other muscles meet their braid."""
    lost, pressure = 30e3, np.linspace(0.0, 3e5, 301)
    plain = Bundle('one', units(1), [mesh()])
    met = plain.with_effect('soft_threshold', pressure=lost, sharpness=1.7)
    left = met.force(0.1, pressure[:, None]) / plain.force(0.1, [1.0])
    assert_allclose(left, pressure - lost * np.tanh(pressure / lost), atol=0.02 * lost)


def test_relaxation_is_that_of_a_standard_linear_solid():
    """A step of force decays by 1 - 1/e of its excess within one time constant."""
    bundle = Bundle('one', units(1), [mesh()]).with_effect(
        'viscoelastic_relaxation', share=0.1, time_constant=2.0)
    time = np.linspace(0.0, 10.0, 5001)
    pressure = np.where(time < 1.0, 1e5, 2e5)[:, None]
    motion = Motion(np.zeros(5001), pressure, np.zeros(5001), time, np.arange(5001) == 0)
    force = bundle.simulate(motion)[:, 0]
    step = bundle.force(0.0, [2e5]) - bundle.force(0.0, [1e5])
    excess = force - bundle.force(0.0, [2e5])
    assert_allclose(excess[time > 1.0][0], 0.1 * step, rtol=2e-3)
    assert_allclose(excess[np.searchsorted(time, 3.0)], 0.1 * step / np.e, rtol=2e-3)


def test_rubber_of_a_spectrum_relaxes_with_the_logarithm_of_time():
    """Over each factor of two between the fastest and the slowest arm by the same force."""
    plain = Bundle('one', units(1), [mesh()])
    bundle = plain.with_effect('relaxation_spectrum', stiffness=100.0, time_constant=25.6)
    time = np.append(0.0, np.geomspace(0.001, 100.0, 4001))
    strain = np.where(time < 0.001, 0.0, 0.1)
    motion = Motion(strain, np.full((len(time), 1), 1e5), np.zeros(len(time)), time, time == 0.0)
    excess = (bundle.simulate(motion) - plain.simulate(motion))[:, 0]
    assert_allclose(excess[1], -10.0, rtol=0.01)
    fall = np.diff(np.interp([0.2, 0.4, 0.8, 1.6, 3.2, 6.4], time, excess))
    assert_allclose(fall, 10.0 / 5.0 * np.log(2.0) / np.log(4.0), rtol=0.1)


def test_stretching_braid_loses_force_with_the_square_of_pressure():
    """At zero strain the loss is 2 c pi r0^2 P^2/sin^2 a0 to first order (hoop balance)."""
    plain = Bundle('one', units(1), [mesh()])
    soft = plain.with_effect('braid_elasticity', compliance=1e-8)
    pressure = np.array([[1e5], [2e5], [4e5]])
    loss = plain.force(0.0, pressure) - soft.force(0.0, pressure)
    assert_allclose(loss, 2e-8 * PAPER.area * pressure[:, 0] ** 2 / PAPER.sin2, rtol=5e-3)


def test_softening_recovers_between_trials_or_not():
    """The same trial twice gives the same force, unless softening lasts for a lifetime."""
    strain = np.tile(np.linspace(0.0, 0.2, 50), 2)
    motion = Motion(strain, np.zeros((100, 1)), np.zeros(100), 0.1 * np.arange(100.0),
                    np.arange(100) % 50 == 0)
    tube = Bundle('tube', units(1), [bladder_elasticity()])
    first, second = tube.with_effect('softening').simulate(motion).reshape(2, 50)
    assert_allclose(first, second, atol=1e-9)
    first, second = tube.with_effect('softening_lifetime').simulate(motion).reshape(2, 50)
    assert np.all(second[1:] > first[1:])


@pytest.mark.parametrize(('law', 'lost'), [
    ('softening_lifetime', lambda way: 1.0 - np.exp(-way)),
    ('softening_gradual', lambda way: way / (1.0 + way))])
def test_what_a_bladder_loses_goes_with_the_strain_it_has_travelled(law, lost):
    """In units of ``travel``: exponentially, or by half, two thirds, three quarters."""
    strain = np.tile(np.concatenate([np.linspace(0.0, 0.2, 21), np.linspace(0.19, 0.01, 19)]), 8)
    count = len(strain)
    motion = Motion(strain, np.zeros((count, 1)), np.zeros(count), 0.1 * np.arange(count),
                    np.arange(count) == 0)
    tube = Bundle('tube', units(1), [bladder_elasticity()])
    soft = tube.with_effect(law, depth=0.4, travel=0.5).simulate(motion)[:, 0]
    share = 1.0 - soft[20::40] / tube.simulate(motion)[20::40, 0]
    travelled = 0.2 + 0.4 * np.arange(8)
    # the play takes up to 0.4 % of the strain at each reversal
    assert_allclose(share, 0.4 * lost(travelled / 0.5), rtol=0.03)


def test_resistive_buckling_past_collapse_is_a_column_of_three_hinges():
    """Of a length h, halves of which are at phi: (F/2) (h/2) sin phi is the moment of a hinge."""
    folds = catalogue.get('resistive_buckling')(
        euler_load=200.0, pressure_share=0.0, collapse_strain=0.1, collapse_slope=1e-6,
        hinge_moment=1e-3, hinge_share=0.05)
    muscle = Bundle('muscle', units(1), [mesh(), folds])
    unit, = muscle.motor_units
    for pressure in (5e4, 1e5):
        strain = np.linspace(0.36, 0.45, 5)
        hinged = unit.geometry.length * (1.0 - 0.1 - 1e-6 * pressure)
        phi = np.arccos((1.0 - strain) * unit.geometry.length / hinged)
        moment = 1e-3 + 0.05 * np.pi * unit.geometry.radius ** 3 * pressure
        force = muscle.force(strain, np.full((5, 1), pressure)) / unit.muscles
        assert_allclose(-force / 4.0 * hinged * np.sin(phi), moment, rtol=1e-9)


def test_the_larger_of_two_limits_holds():
    """A slack tendon hides buckling: no push-back is left, in either order."""
    bundle = bundle_with(example('tendon_slack'), example('resistive_buckling'))
    assert np.all(bundle.unit_forces(np.linspace(0, 0.3, 20), np.full((20, 2), 5e4)) >= 0.0)


def test_gauges_and_muscle_agree_after_correction():
    """Reading a simulated rig through its own sensor errors gives back its force."""
    sensors = [example(n) for n in TABLE_FREE if example(n).place is Place.SENSOR]
    bundle, motion = bundle_with(*sensors), record()
    true = bundle.simulate(motion).sum(axis=-1)
    force, strain, pressure = bundle.readings(true, motion.strain, motion.pressure,
                                              motion.time - motion.time[0], motion.strain_rate)
    shown = Motion(strain, pressure, motion.strain_rate, motion.time, motion.start)
    assert_allclose(bundle.predict(shown), force, rtol=1e-9)
    felt = bundle.felt(strain, pressure, motion.time - motion.time[0], motion.strain_rate)
    assert_allclose(felt[0], motion.strain, atol=1e-12)
    assert_allclose(felt[1], motion.pressure, rtol=1e-12, atol=1e-6)


def test_the_end_effect_of_length_is_a_dead_length_on_one_length_and_none_on_two():
    """On 127 mm both give the same strain; at 80 mm the dead length of it gives another."""
    both = catalogue.get('end_effect_of_length')(dead_length=12e-3, share=0.08)
    factor = 1.08 * 0.127 / 0.115
    caps = catalogue.get('end_caps')(dead_length=0.127 * (1.0 - 1.0 / factor))
    here, there = bundle_with(both), bundle_with(caps)
    strain, pressure = np.linspace(0.0, 0.25, 9), np.full((9, 2), 2e5)
    assert_allclose(here.force(strain, pressure), there.force(strain, pressure), rtol=1e-12)
    short = {'geometry.length': 0.08}
    apart = (here.with_parameters(short).force(0.15, pressure[0])
             - there.with_parameters(short).force(0.15, pressure[0]))
    assert abs(apart) > 0.3
    # the longer, the nearer to the factor alone
    long = {'geometry.length': 10.0}
    alone = bundle_with(catalogue.get('tondu_factor')(factor=0.08))
    assert_allclose(here.with_parameters(long).force(strain, pressure),
                    alone.with_parameters(long).force(strain, pressure), rtol=0.02, atol=0.2)


@pytest.mark.parametrize('name', catalogue.available())
def test_every_parameter_starts_within_its_bounds(name):
    """A fit goes from the default to either bound."""
    for parameter in catalogue.get(name).parameters:
        assert parameter.lower <= parameter.default <= parameter.upper, parameter.name
        assert parameter.lower < parameter.upper, parameter.name


def test_rubber_is_as_stiff_as_it_is_warm():
    """A tenth above 293.15 K (20 degrees Celsius) is a tenth of the bladder's force more."""
    law = catalogue.get('temperature').function
    assert law(-50.0, 1e9, 29.315, 300.0) == pytest.approx(-5.0)


def test_series_compliance_balances_the_braid_against_a_spring():
    """The gauge reads muscle and spring; both carry the same force at the clamps."""
    compliance, pressure, strain = 30e-6, 300e3, 0.05  # m/N, Pa
    spring = catalogue.get('series_compliance')(compliance=compliance)
    muscle = Bundle('stiff', units(1), [mesh()])
    force = Bundle('soft', units(1), [mesh(), spring]).force(strain, [pressure])
    own_strain = strain + compliance * force / units(1)[0].geometry.length
    assert_allclose(force, muscle.force(own_strain, [pressure]), rtol=1e-9)
    assert force < 0.9 * muscle.force(strain, [pressure])
