# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The control kernels, plain and compiled, on the same inputs."""

from dataclasses import asdict, replace
import math

import numpy as np
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.control import (
    ControllerConfig,
    LoadModel,
    OuterConfig,
    PidConfig,
    PidGains,
    RecruitmentController,
)
from fam_bundle_ros.control.outer_loop import FORCE, STRAIN
from fam_bundle_ros.control.pid import pid_settings
from fam_bundle_ros.control.pressure_loop import ANTI_WINDUP, forget, PidState, pressure_step
from fam_bundle_ros.control.reasons import (
    ABSENT,
    AHEAD,
    AT_REST,
    BELOW,
    BEYOND,
    CHEAP,
    FROM_REST,
    from_row,
    LOST,
    Reason,
    ROW,
    row_of,
    sentence,
    TURNED_BACK,
    UNREACHABLE,
)
from fam_bundle_ros.control.recruitment_loop import (
    enable_step,
    recruitment_step,
    start_recruitment,
)
from fam_bundle_ros.control.signals import command_record, MeasurementRecord

needs_numba = pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
DT = 4e-3
LOAD = LoadModel(table=((0.0, 5.0), (0.1, 30.0), (0.2, 60.0)), inertia=0.3, damping=3.0)


def inputs(bundle, ticks=420):
    """
    Yield (measurement, kind, value, rate, dt, whether to enable first), tick by tick.

    A ramp up through all states and down, a step, a strain sine; noise; strains beyond the free
    strain; readings that are lost for a moment and for long; a clock that stands still.
    """
    random = np.random.default_rng(3)
    n, pressure = bundle.n, np.zeros(bundle.n)
    top = 0.9 * float(bundle.force(0.12, bundle.max_pressure))
    times = np.cumsum(np.where(np.arange(ticks) < 200, 3.0 * DT, random.uniform(DT, 5.0 * DT,
                                                                                ticks)))
    for k, t in enumerate(times):
        value = float(np.interp(t, [0.5, 1.6, 2.2, 2.9], [5.0, top, top, 5.0]))
        later = float(np.interp(t + 1e-3, [0.5, 1.6, 2.2, 2.9], [5.0, top, top, 5.0]))
        kind, rate = FORCE, (later - value) / 1e-3
        if t > 3.5:
            value = 0.5 * top
        if t > 4.0:
            kind, value, rate = STRAIN, 0.12 + 0.04 * math.sin(4.0 * t), 0.16 * math.cos(4.0 * t)
        strain = 0.12 + 0.03 * math.sin(2.0 * t) + 0.1 * (4.4 < t < 4.6)
        force = 0.95 * float(bundle.force(strain, pressure)) + 0.5 * random.standard_normal()
        if 150 <= k < 153 or 300 <= k < 330:
            force = math.nan
        shown = pressure + 350.0 * random.standard_normal(n)
        measured = MeasurementRecord(force, strain + 1e-5 * random.standard_normal(),
                                     0.06 * math.cos(2.0 * t) + 5e-3 * random.standard_normal(),
                                     shown.tolist())
        dt = t - times[k - 1] if k not in (0, 250) else 0.0 if k else 3.0 * DT
        pressure = pressure + 0.3 * ((yield measured, kind, value, rate, dt, k in (170, 335))
                                     - pressure)


def run(controller, bundle, compiled):
    """Return the commands of a run, as dicts, and the sentences that go with them."""
    step, enable, start = recruitment_step, enable_step, start_recruitment
    settings, memory, model = controller.settings, controller.memory, controller.model
    command, pack = command_record(bundle.n), (lambda record: record)
    if compiled:
        pack, model = kernels.pack, controller.belief(compiled=True)
        step, enable, start = map(kernels.compiled, (step, enable, start))
    settings, memory, record = pack(settings), pack(memory), pack(command)
    start(settings, memory, record)
    found, source = [], inputs(bundle)
    item = next(source)
    while True:
        measured, kind, value, rate, dt, anew = item
        if anew:
            enable(settings, model, memory, pack(measured), record)
        step(settings, model, memory, pack(measured), kind, value, rate, dt, record)
        if compiled:
            kernels.unpack(record, command)
        found.append((asdict(command), sentence(command.reason, ['A', 'B', 'C'])))
        try:
            item = source.send(np.array(command.pressure))
        except StopIteration:
            return found


def flat(values):
    """Return all numbers of a nested dict of them."""
    return np.concatenate([flat(value) if isinstance(value, dict) else np.ravel(value)
                           for value in values.values()]).astype(float)


CASES = [{'policy': policy, 'scheme': scheme} for policy, scheme in (
    ('neglect', 'orderly'), ('hysteresis', 'batch'), ('reversal_aware', 'orderly'),
    ('reversal_aware', 'batch'), ('reversal_aware', 'all_on'))] + [
    {'order': (1, 0, 2), 'max_pressure': (300e3, 250e3, 280e3)},
    {'outer': OuterConfig(feedback=False)}, {'outer': OuterConfig(feed_forward=False)},
    {'outer': OuterConfig(force_gain=1.0, bias_time=0.15), 'load': LOAD}]


@needs_numba
@pytest.mark.parametrize('settings', CASES, ids=str)
def test_plain_and_compiled_control_agree(bundles, settings):
    """Every tick of a run, with memory and time in the model, gives the same command to 1e-9."""
    bundle = bundles[3].with_effect('coulomb_friction', force=2.0).with_effect(
        'viscoelastic_relaxation').with_effect('temperature', rise=80.0, time_constant=10.0)
    plain, compiled = (run(RecruitmentController(bundle, ControllerConfig(**settings)), bundle,
                           way) for way in (False, True))
    assert [why for _, why in plain] == [why for _, why in compiled]
    one, other = (np.stack([flat(command) for command, _ in way]) for way in (plain, compiled))
    np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9)
    assert any(why.startswith('recruit') for _, why in plain) or (
        settings.get('scheme') == 'all_on')
    assert any(one['reason']['why'] == LOST for one, _ in plain)


@needs_numba
@pytest.mark.parametrize('mode', ANTI_WINDUP)
@pytest.mark.parametrize('helped', [True, False])
def test_plain_and_compiled_pressure_loops_agree(mode, helped):
    """Steps, lost readings, take-over and limits: the same command and diagnostics to 1e-9."""
    config = PidConfig(anti_windup=mode, feed_forward=helped, dead_band_compensation=helped)
    settings = pid_settings(PidGains(), config)
    random, pressure = np.random.default_rng(3), 0.0
    one, other = PidState(), PidState()
    record, packed = kernels.pack(other), kernels.pack(settings)
    step, anew = kernels.compiled(pressure_step), kernels.compiled(forget)
    plain, compiled, answers = [], [], []
    for k in range(1200):
        setpoint = (0.0, 200e3, 350e3, 80e3)[k // 75 % 4]
        if k == 500:
            forget(one, 0.4)
            anew(record, 0.4)
        shown = math.nan if k % 333 == 5 else pressure + 350.0 * random.standard_normal()
        given = (setpoint, shown, 2e-3 if k % 200 else 0.0, 500e3 if k < 900 else 150e3,
                 20e-6, 1e-6 * random.standard_normal())
        command = pressure_step(settings, one, *given)
        answers.append((step(packed, record, *given), command))
        if k % 10 == 9:
            kernels.unpack(record, other)
            plain.append(flat(asdict(one)))
            compiled.append(flat(asdict(other)))
        pressure += 4e3 * command if command > 0.0 or pressure > 0.0 else 0.0
    np.testing.assert_allclose(*np.transpose(answers), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(('why', 'text'), [
    (FROM_REST, 'recruit B: demand 20.0 N above 31.5 N; vented it gives 33.0 N'),
    (BEYOND, "recruit B: demand 20.0 N above RS1's 33.0 N by more than -1.5 N"),
    (AHEAD, "recruit B: demand 20.0 N rising by 4.0 N/s towards RS1's 33.0 N; above 25.0 N its "
            'push-back of 8.0 N could not be compensated'),
    (BELOW, 'release A: demand 20.0 N below 31.5 N'),
    (UNREACHABLE, 'release A: demand 20.0 N below 31.5 N, the least force of RS1'),
    (AT_REST, 'release A: demand 20.0 N below 31.5 N and at rest for 0.8 s'),
    (ABSENT, 'release A: demand 20.0 N below 31.5 N for 0.8 s'),
    (TURNED_BACK, 'release A: demand 20.0 N below 31.5 N and turned back before it was needed'),
    (CHEAP, 'release A: demand 20.0 N below 31.5 N, and only 12 kPa to fill again from here'),
    (LOST, 'vent: no usable reading for 0.80 s')])
def test_a_reason_reads_as_a_sentence(why, text):
    """Each code has its sentence, with the numbers that the decision rests on."""
    assert sentence(Reason(why, 1, 20.0, 31.5, 33.0, 25.0, 4.0, 0.8, 12e3), ['A', 'B']) == text


def test_where_a_unit_does_not_push_back_nothing_is_said_of_it():
    """A muscle with slack ends; `0.0 N could not be compensated` says nothing."""
    reason = Reason(AHEAD, 1, force=20.0, rate=4.0, limit=33.0, crossing=33.0)
    assert sentence(reason, ['A', 'B']) == (
        "recruit B: demand 20.0 N rising by 4.0 N/s towards RS1's 33.0 N")


def test_a_reason_survives_being_kept_as_numbers():
    """What a loop wrote into a row reads as the same sentence."""
    for why in range(LOST + 1):
        reason = Reason(why, 1, 20.0, 31.5, 33.0, 25.0, 4.0, 0.8, 12e3)
        row = np.zeros(ROW)
        row_of(reason, row)
        assert from_row(row) == reason
        assert sentence(from_row(row), ['A', 'B']) == sentence(reason, ['A', 'B'])
        assert bool(sentence(reason, ['A', 'B'])) == (why > 0)


def test_records_of_different_settings_have_one_type():
    """Compiled code is made once: loads with and without a table, all policies, one record."""
    def dtype(**settings):
        from fam_bundle_ros.model import load_model
        from fam_bundle_ros.resources import config_path
        bundle = load_model(config_path('models/spie2021.yaml'))
        return kernels.pack(RecruitmentController(bundle, ControllerConfig(**settings))
                            .settings).dtype
    assert dtype() == dtype(load=LOAD, policy='neglect', scheme='batch', order=(1, 0))
    assert kernels.pack(pid_settings(PidGains(), replace(PidConfig(), anti_windup='none'))).dtype \
        == kernels.pack(pid_settings(PidGains(p=3.0), PidConfig())).dtype
