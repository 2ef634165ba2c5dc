# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The pressure loop, plain and compiled, on the same inputs; decisions as sentences."""

from dataclasses import asdict, replace
import math

import numpy as np
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.control import (
    ControllerConfig,
    LoadModel,
    PidConfig,
    PidGains,
    RecruitmentController,
)
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

needs_numba = pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
LOAD = LoadModel(table=((0.0, 5.0), (0.1, 30.0), (0.2, 60.0)), inertia=0.3, damping=3.0)


def flat(values):
    """Return all numbers of a nested dict of them."""
    return np.concatenate([flat(value) if isinstance(value, dict) else np.ravel(value)
                           for value in values.values()]).astype(float)


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
    (LOST, 'vent: no usable reading or reference for 0.80 s')])
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
