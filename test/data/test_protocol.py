# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Experiments as files: what is read, what it comes to, how long it takes, what is refused."""

import math

import pytest

from fam_bundle_ros.data.protocol import (
    dumps_protocol,
    duration,
    Hold,
    Limits,
    Pause,
    PressureSteps,
    PressureSweep,
    Protocol,
    read_protocol,
    save_protocol,
    segments,
    Sweep,
)
from fam_bundle_ros.data.schedule import minutes
from fam_bundle_ros.data.steps import Course, Leg
from fam_bundle_ros.errors import InputError

HEAD = 'format: fam-bundle-protocol/1\nname: mine\nmotor_units: 2\n'
PSI = 6894.757


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a protocol of some steps and reads it."""
    def read(steps, head=''):
        path = tmp_path / 'mine.yaml'
        path.write_text(f'{HEAD}{head}steps:\n{steps}')
        return read_protocol(path)
    return read


def test_the_paper_s_experiment_ships():
    """13 isobars from 0 to 60 psi, MU1 alone and then with MU2, past free strain."""
    protocol = read_protocol('spie2021')
    planned = segments(protocol)
    pressures = {tuple(round(value / PSI) for value in each.course.start.pressure)
                 for each in planned}
    assert pressures == {*((p, 0) for p in range(0, 70, 10)),
                         *((50, p) for p in range(10, 70, 10))}
    assert all(each.course.start.strain == 0.0 for each in planned)
    assert all(each.course.legs[0].strain == 0.247 for each in planned)
    assert protocol.limits.force == 450.0


def test_a_mapping_by_motor_unit_is_a_grid_and_units_not_named_are_vented(written):
    """`{mu1: [a, b]}` is MU1 alone at a and at b; a bare quantity is for all units."""
    protocol = written('  - sweep: {strain: [0, 0.1], rate: 0.1 1/s, pressure: '
                       '[{mu1: [1 kPa, 2 kPa]}, {mu1: 3 kPa, mu2: [4 kPa, 5 kPa]}, 6 kPa]}\n')
    assert protocol.steps[0].pressure == ((1e3, 0.0), (2e3, 0.0), (3e3, 4e3), (3e3, 5e3),
                                          (6e3, 6e3))


def test_a_sweep_moves_the_strain_at_its_rate_and_comes_back():
    """0 to 0.2 at 0.02 1/s takes 10 s, with two cycles 40 s; the pressures stay."""
    (course,) = Sweep((0.0, 0.2), 0.02, ((50e3,),), cycles=2).courses()
    assert course.seconds == pytest.approx(40.0)
    assert course.at(2.0)[:2] == pytest.approx((0.04, 0.02))
    assert course.at(12.0)[:2] == pytest.approx((0.16, -0.02))
    assert course.at(35.0)[:2] == pytest.approx((0.1, -0.02))
    assert course.at(40.0) == (0.0, 0.0, (50e3,))
    assert course.at(35.0)[2] == (50e3,)


def test_a_hold_steps_the_strain_and_waits():
    """Two strains of 60 s each, with a step of 0.1 at 0.5 1/s between."""
    (course,) = Hold((0.1, 0.2), 60.0, ((50e3,),)).courses()
    assert course.seconds == pytest.approx(120.2)
    assert course.at(59.9)[:2] == (0.1, 0.0)
    assert course.at(60.1)[:2] == pytest.approx((0.15, 0.5))
    assert course.at(60.3)[:2] == (0.2, 0.0)


def test_pressures_step_and_sweep_in_one_course():
    """Steps are sudden, sweeps take the time of the unit whose pressure changes most."""
    (steps,) = PressureSteps(((10e3, 0.0), (90e3, 0.0)), 0.5, strain=0.1, cycles=2).courses()
    assert steps.seconds == 2.0
    assert [steps.at(t)[2][0] for t in (0.4, 0.6, 1.1, 1.6, 2.5)] == [10e3, 90e3, 10e3, 90e3, 90e3]
    (sweep,) = PressureSweep(((0.0, 20e3), (80e3, 40e3)), 20e3).courses()
    assert sweep.seconds == 8.0
    assert sweep.at(2.0) == (None, 0.0, (40e3, 30e3))
    assert sweep.at(6.0)[2] == pytest.approx((40e3, 30e3))


def test_random_order_is_the_same_each_time_and_never_crosses_a_pause():
    """Repeats are shuffled anew; what stands behind a pause stays behind it, with its wait."""
    levels = tuple((1e3 * k,) for k in range(8))
    sweep = Sweep((0.0, 0.1), 0.1, levels)
    protocol = Protocol('shuffled', 1, (sweep, Pause(100.0), sweep), order='random', seed=3,
                        repeats=2)
    planned = segments(protocol)
    assert planned == segments(protocol)
    assert [each.number for each in planned] == list(range(1, 33))
    blocks = [[each.course.start.pressure for each in planned[k:k + 8]] for k in (0, 8, 16, 24)]
    assert all(sorted(block) == list(levels) for block in blocks)
    assert len({tuple(block) for block in blocks} | {levels}) == 5
    assert [each.number for each in planned if each.pause] == [9, 25]


def test_duration_counts_ways_filling_settling_and_pauses():
    """One sweep of 2 s: on the way for 1 s, 1 s to fill, 3 s to settle; then again after 50 s."""
    sweep = Sweep((0.1, 0.2), 0.1, ((50e3,),))
    once = Protocol('once', 1, (sweep,), settle=3.0)
    assert duration(once) == pytest.approx(1.0 + 3.0 + 2.0)
    again = Protocol('twice', 1, (sweep, Hold((0.0,), 5.0, ((50e3,),)), Pause(50.0), sweep),
                     settle=3.0)
    assert duration(again) == pytest.approx(6.0 + (1.0 + 3.0 + 5.0) + 50.0 + (1 + 1 + 3 + 2))
    free = PressureSweep(((0.0,), (80e3,)), 20e3)
    assert duration(Protocol('free', 1, (free,), settle=3.0)) == pytest.approx(3.0 + 8.0)
    # a load that is free keeps the dynamometer where it was; pauses in a row add up
    between = Protocol('between', 1, (Hold((0.2,), 5.0, ((50e3,),)), free, sweep), settle=3.0)
    assert segments(between)[2].before == pytest.approx(1.0 + 1.0 + 3.0)
    rested = Protocol('rested', 1, (sweep, Pause(50.0), Pause(20.0), sweep), settle=3.0)
    assert [each.pause for each in segments(rested)] == [0.0, 70.0]


@pytest.mark.parametrize('seconds', [0.4, 59.0, 60.0, 3599.0, 3600.0, 7199.0, 86399.0, 1e6])
def test_a_duration_in_words_is_that_time(seconds):
    """To the second below an hour, to the minute above."""
    told = minutes(seconds).split()
    size = {'s': 1, 'min': 60, 'h': 3600}
    found = sum(int(count) * size[unit] for count, unit in zip(told[::2], told[1::2]))
    assert found - 0.5 <= seconds < found + (60.0 if seconds >= 3600.0 else 0.5)
    assert all(int(count) < 60 for count, unit in zip(told[::2], told[1::2]) if unit != 'h')


def test_a_name_or_note_that_looks_like_a_number_is_text(written):
    """As YAML reads it: the number of a muscle, a year."""
    protocol = written('  - hold: {strain: 0.1, time: 1 s, pressure: 40 kPa}\n', 'notes: 2024\n')
    assert protocol.notes == '2024'
    assert protocol.order == 'as written'


def test_what_is_written_is_read_again(tmp_path):
    """Every kind of step and every key survives the file."""
    protocol = Protocol(
        'all', 2, (Sweep((0.0, 0.2), 0.02, ((50e3, 0.0), (1e5, 1e5)), 3),
                   Hold((0.1, 0.2), 60.0, ((50e3, 0.0),), 0.1), Pause(3600.0),
                   PressureSteps(((0.0, 0.0), (9e4, 1e4)), 0.5, 0.1, 2),
                   PressureSweep(((0.0, 0.0), (9e4, 1e4)), 2e4)),
        Limits(2e5, (-0.05, 0.3), 450.0), 2.0, 0.05, 'random', 7, 2, 'why')
    save_protocol(protocol, tmp_path / 'all.yaml')
    assert read_protocol(tmp_path / 'all.yaml') == protocol
    fine = Protocol('fine', 2, (Hold((0.1,), 1.0, ((344737.857, 123456.789),)),))
    save_protocol(fine, tmp_path / 'fine.yaml')
    assert read_protocol(tmp_path / 'fine.yaml') == fine
    plain = Protocol('plain', 1, (Sweep((0.0, 0.2), 0.02, ((50e3,),)),))
    assert len(dumps_protocol(plain).splitlines()) == 8
    assert plain.limits.force == math.inf


@pytest.mark.parametrize(('steps', 'head', 'words'), [
    ('  - sweep: {strain: [0, 0.1], rate: 0.1 1/s, pressure: 40}\n', '',
     'mine.yaml: step 1 (sweep): pressure: .*has no unit'),
    ('  - sweep: {strain: [0, 0.1], rate: 0.1 kPa, pressure: 40 kPa}\n', '',
     'step 1 (sweep): rate: .*expected a unit like 1/s'),
    ('  - sweep: {strain: [0, 0.1], pressure: 40 kPa}\n', '', "has no key 'rate'"),
    ('  - sweep: {strain: 0.1, rate: 0.1 1/s, pressure: 40 kPa}\n', '', 'expected two strains'),
    ('  - sweep: {strain: [0, 0.1, 0.2], rate: 0.1 1/s, pressure: 40 kPa}\n', '',
     'expected two strains'),
    ('  - sweep: {strain: [0, 0.1], rate: 0 1/s, pressure: 40 kPa}\n', '', 'rate is 0'),
    ('  - sweep: {strain: [0, 0.1], rate: 0.1 1/s, pressure: {mu3: 4 kPa}}\n', '', "key 'mu3'"),
    ('  - wiggle: {strain: 0.1}\n', '', 'step 1 is wiggle; expected one of sweep, hold'),
    ('  - pressure_steps: {pressure: 40 kPa, time: 1 s}\n', '', 'pressure does not change'),
    ('  - pause: 1 h\n', '', 'nothing to record'),
    ('  - sweep: {strain: [0, 0.3], rate: 0.1 1/s, pressure: 40 kPa}\n',
     'limits: {strain: [0, 0.2]}\n', 'strain 0.3 is outside the limits 0 to 0.2'),
    ('  - sweep: {strain: [0, 0.3], rate: 0.1 1/s, pressure: 40 psi}\n',
     'limits: {pressure: 40 kPa}\n', 'outside the limits 0 to 40 kPa'),
    ('  - pause: 1 h\n', 'limits: {strain: 0.2}\n', 'expected \\[from, to\\]'),
    ('  - pause: 1 h\n', 'limits: {strain: [0, 0.1, 0.2]}\n', 'expected \\[from, to\\]'),
    ('  - pause: 1 h\n', 'limits: 3 N\n', 'limits is .3 N.; expected pressure, strain, force'),
    ('  - pause: 1 h\n', 'limits: {strain: [0.2, 0.1]}\n', 'expected two rising strains'),
    ('  - pause: 1 h\n', 'limits: {force: 0 N}\n', 'pressure or force is not above 0'),
    ('  - pause: 1 h\n', 'settle: -1 s\n', 'settle is -1 s; expected 0 s or more'),
    ('  - pause: 1 h\n', 'travel: 0 1/s\n', 'travel is 0.*; expected more than 0'),
    ('  - pause: 1 h\n', 'repeats: 0\n', 'repeats is 0; expected more than 0'),
    ('  - sweep: 0.1\n', '', 'step 1 (sweep) is 0.1; expected keys with values'),
    ('  - pause: 1 h\n', 'limits: {weight: 3 kg}\n', "limits: key 'weight'"),
    ('  - pause: 1 h\n', 'order: sorted\n', "order is 'sorted'"),
    ('  - pause: 1 h\n', 'speed: 3\n', "key 'speed' is not known"),
    ('  - pause: 1 h\n', 'repeats: 2.5\n', 'repeats is 2.5; expected a whole number'),
])
def test_a_mistake_is_named_with_file_step_and_key(written, steps, head, words):
    """Each is one sentence that says what was expected."""
    with pytest.raises(InputError, match=r'^mine\.yaml: ') as error:
        written(steps, head)
    assert error.match(words.replace('(sweep)', r'\(sweep\)'))


def test_what_is_no_yaml_is_told_with_its_line(written):
    """A bracket that is not closed: the line in which that shows."""
    with pytest.raises(InputError, match=r'^mine\.yaml: .*YAML \(line \d+: expected'):
        written('- sweep: {strain: [0, 1')


def test_an_unknown_protocol_is_answered_with_those_that_ship():
    """A name that is neither a file nor one of ours."""
    with pytest.raises(InputError, match='absent: no such protocol; protocols that ship: .*spie'):
        read_protocol('absent')


def test_a_strain_that_is_free_at_one_end_of_a_course_is_free_on_the_way():
    """From where the load puts the muscle to a strain there is no rate; the pressures go on."""
    free, held = Leg(0.0, None, (0.0,)), Leg(2.0, 0.1, (40e3,))
    assert Course('on', free, (held,)).at(1.0) == (None, 0.0, (20e3,))
    assert Course('off', held, (Leg(2.0, None, (0.0,)),)).at(1.0) == (None, 0.0, (20e3,))


@pytest.mark.parametrize(('text', 'words'), [
    ('- sweep', "no protocol; expected a mapping with 'format: fam-bundle-protocol/1'"),
    (HEAD, "has no key 'steps'"), (f'{HEAD}steps: sweep\n', 'steps is str; expected a list'),
    (HEAD.replace('2', '65') + 'steps: []\n', 'motor_units is 65; expected 1 to 64')])
def test_a_file_that_is_no_protocol_is_told_why(tmp_path, text, words):
    """A list, one without steps, too many motor units."""
    (tmp_path / 'mine.yaml').write_text(text)
    with pytest.raises(InputError, match=rf'mine\.yaml: .*{words}'):
        read_protocol(tmp_path / 'mine.yaml')


def test_a_protocol_from_python_has_a_pressure_for_each_motor_unit():
    """And so does one of several thousand segments, which no rig records in a day."""
    sweep = Sweep((0.0, 0.1), 0.1, ((40e3,),))
    with pytest.raises(InputError, match=r'step 1 .sweep.: 1 pressures; expected one for each of'):
        Protocol('two', 2, (sweep,))
    with pytest.raises(InputError, match='segments; expected at most'):
        segments(Protocol('many', 1, (sweep,), repeats=100_000))
