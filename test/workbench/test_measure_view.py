# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The part "Measure" of the page "Live", with a process that only says what `measure` says."""


import asyncio
from pathlib import Path

import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench import measure_run
from fam_bundle_ros.workbench.measure_run import MeasureRun, model_file, Order
from test.workbench.test_rig_view import able, FOUND, page, sees, STATE

pytestmark = pytest.mark.anyio
__all__ = ['page']
SIMULATED = {'kind': 'graph', 'nodes': ['plant_simulator'], 'rig': True}
RIG = {'kind': 'graph', 'nodes': ['recruitment_controller'], 'rig': True}
#: Says how far it is, then does what its protocol is called; ends with its input, as the real one.
COMMAND = """
import os, signal, sys, threading, time
from pathlib import Path
threading.Thread(target=lambda: (sys.stdin.read(), os.kill(os.getpid(), signal.SIGINT)),
                 daemon=True).start()
def say(words):
    print(words, file=sys.stderr, flush=True)
out = Path(sys.argv[sys.argv.index('--out') + 1])
try:
    say('measure: 40 %, segment 1: sweep at 138, 0 kPa; 12 s left')
    Path('go').exists() or time.sleep(60)
    reason = Path('go').read_text()
    if reason:
        say(reason)
        say('1 of 3 segments are kept in x; --resume goes on')
        Path(f'{out}.parts').mkdir(exist_ok=True)
        sys.exit(1)
    out.write_text('recording')
except KeyboardInterrupt:
    Path('vented').touch()
    say('fam_bundle: stopped')
    sys.exit(1)
"""


@pytest.fixture
def go(monkeypatch, tmp_path):
    """Return a function that lets the process get to its end, with a reason or without."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure_run, '_COMMAND', COMMAND)
    return (tmp_path / 'go').write_text


async def test_a_simulated_bundle_is_measured_and_switched_on_again(page, go):
    """How long it takes, how far it is, where the recording lies; enabled again at the end."""
    user, rig = page
    await sees(user, 'three isobars for a first look: 3 segments, 20 s')
    assert not able(user, 'live:measure')
    rig.hear(STATE, SIMULATED)
    rig.record.now['supply'] = True
    go('')
    await sees(user, 'The model holds')
    user.find(marker='live:measure').click()
    await sees(user, 'Measured: ')
    order = rig.measurement.order
    assert Path(order.out).read_text() == 'recording'
    assert order.arguments[:5] == ['measure', '--rig', '--yes', '--model',
                                   str(config_path('models/spie2021.yaml'))]
    assert order.arguments[-1] == 'first_look'
    assert rig.orders == [{'call': 'enable'}]
    await sees(user, 'Open the recording')


async def test_a_rig_is_moved_only_once_everybody_is_away(page, go):
    """Asked before; no is no; Stop vents; afterwards the controller stays off."""
    user, rig = page
    rig.hear(STATE, RIG)
    rig.record.now['supply'] = True
    await sees(user, 'The model holds')
    user.find(marker='live:measure').click()
    await sees(user, 'Is everybody away from them')
    assert rig.measurement.order is None
    user.find(marker='live:measure-cancel').click()
    await user.should_see(marker='live:measure', retries=50)
    assert rig.measurement.order is None
    user.find(marker='live:measure').click()
    await sees(user, 'Is everybody away from them')
    user.find(marker='live:measure-confirm').click()
    await sees(user, '40 %: segment 1: sweep at 138, 0 kPa; 12 s left')
    with pytest.raises(InputError, match='running already'):
        rig.measure(rig.measurement.order)
    user.find(marker='live:measure-stop').click()
    await sees(user, 'No recording: it was stopped')
    assert Path('vented').exists()
    assert rig.orders == []


async def test_the_reason_of_an_early_end_is_said_and_it_can_go_on(page, go):
    """What the command says last; what is complete is kept for --resume."""
    user, rig = page
    rig.hear(STATE, SIMULATED)
    go('stopped and vented: force is 450 N')
    await sees(user, 'The model holds')
    user.find(marker='live:measure').click()
    await sees(user, 'No recording: stopped and vented: force is 450 N')
    first = rig.measurement.order
    go('')
    user.find(marker='live:measure-on').click()
    await sees(user, 'Measured: ')
    assert (rig.measurement.order.out, rig.measurement.order.resume) == (first.out, True)
    assert '--resume' in rig.measurement.order.arguments


async def test_a_file_and_the_next_experiment_can_be_chosen(page, go):
    """The proposal of the diagnosis is offered by its file; a bad file is told at once."""
    user, rig = page
    proposal = config_path('protocols/spie2021.yaml')
    rig.hear(STATE, SIMULATED, {**FOUND, 'protocol_file': str(proposal)})
    await sees(user, 'the next experiment of the diagnosis')
    user.find(marker='live:protocol').trigger('change', 'next:')
    await sees(user, '13 segments, 5 min')
    user.find(marker='live:measure').click()
    await sees(user, '40 %')
    assert rig.measurement.order.protocol == str(proposal)
    await rig.measurement.stop()
    user.find(marker='live:protocol').trigger('change', 'file:')
    user.find(marker='live:protocol-file').trigger('input', '/absent.yaml')
    await sees(user, '/absent.yaml: no such protocol')
    await user.should_see(marker='live:measure', retries=50)
    assert not able(user, 'live:measure')


async def test_it_ends_with_the_workbench(go):
    """Closed, and killed: both vent."""
    run = MeasureRun()
    order = Order.new('first_look', 'm.yaml', '/bundle')
    task = asyncio.create_task(run.run(order))
    while run.words != 'segment 1: sweep at 138, 0 kPa; 12 s left':
        await asyncio.sleep(0.01)
    # what the system does for a workbench that was killed
    run._process.stdin.close()
    await task
    assert Path('vented').exists()
    assert run.failure == 'stopped'


def test_models_are_found_as_nodes_name_them(tmp_path):
    """A path, or one that ships; else it is said what was expected."""
    assert model_file('models/spie2021.yaml') == model_file('spie2021')
    assert load_model(model_file('spie2021')).n == 2
    with pytest.raises(InputError, match='expected the model file of the controller'):
        model_file(str(tmp_path / 'm.yaml'))
