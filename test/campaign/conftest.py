# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A lab's folder: small static maps of muscles of several lengths, with what labs get wrong."""

import numpy as np
import pytest

from fam_bundle_ros.campaign import run_campaign
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit, save_model

#: Length (mm) of each muscle; the dead ends are this share of it.
LENGTHS = (90.0, 120.0, 160.0, 210.0, 280.0)
SHARE = 0.08


def record(folder, muscles, seed=1):
    """Write a recording of each (name, length in mm, dead share) and their table."""
    rng = np.random.default_rng(seed)
    strain, pressure = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.2, 5),
                                                             np.linspace(8e4, 4e5, 5)))
    lines = ['file,muscle,length [mm],age [days],supplier']
    for number, (name, length, share) in enumerate(muscles):
        model = muscle(1e-3 * length)
        if share:
            model = model.with_effect('end_caps', dead_length=1e-3 * share * length)
        force = model.force(strain, pressure[:, None]) + rng.normal(0.0, 0.5, len(strain))
        rows = [f'{(1.0 - e) * length:.4f};{p / 1e5:.4f};{f:.3f}'
                for e, p, f in zip(strain, pressure, force)]
        (folder / f'{name}.csv').write_text('\n'.join(['L [mm];p (bar);Kraft [N]', *rows]))
        age = 'unknown' if number == 0 else 10 * rng.integers(1, 50)
        lines.append(f'{name}.csv,{name.partition("_")[0]},{length},{age},ACME')
    (folder / 'specimens.csv').write_text('\n'.join(lines))


def muscle(length):
    """Return an ideal muscle of a length (m)."""
    return Bundle('lab', [MotorUnit('mu1', 1, Geometry(6e-3, length, np.radians(30.0), 1e-3))],
                  [catalogue.get('mesh')()])


@pytest.fixture(scope='session')
def lab(tmp_path_factory):
    """Return a folder with five muscles, a recipe, a model, a broken log and a copy."""
    folder = tmp_path_factory.mktemp('lab')
    record(folder, [(f'm{k}', length, SHARE) for k, length in enumerate(LENGTHS)])
    (folder / 'later').mkdir()
    (folder / 'later' / 'broken.csv').write_text('L [mm];p (bar)\n1;2\n')
    (folder / 'a_copy.csv').write_bytes((folder / 'm2.csv').read_bytes())
    (folder / 'recipe.yaml').write_text('format: fam-bundle-recipe/1\n'
                                        'columns: {force: "Kraft [N]"}\n'
                                        'rest_length: 200 mm\n')  # the table counts more
    save_model(muscle(0.2), folder / 'model.yaml')
    return folder


@pytest.fixture(scope='session')
def campaign(lab):
    """Return a function that runs the lab's campaign into a folder of results."""
    def run(out, **options):
        return run_campaign(lab, lab / 'model.yaml', out, recipe=lab / 'recipe.yaml',
                            **{'specimens': lab / 'specimens.csv', **options})
    return run


@pytest.fixture(scope='session')
def three(lab):
    """Return the options of a campaign of three recordings of the lab."""
    table = lab / '.three.csv'  # a hidden file is no recording
    table.write_text('\n'.join((lab / 'specimens.csv').read_text().splitlines()[:4]))
    return {'specimens': table, 'pattern': 'm[0-2].csv'}


@pytest.fixture(scope='session')
def alone(campaign, tmp_path_factory, once):
    """Return the campaign as one core does it, and the folder of its results, to be read only."""
    def make():
        out = tmp_path_factory.mktemp('alone') / 'out'
        return campaign(out, workers=1), out
    return once('campaign_alone', make)


@pytest.fixture(scope='module')
def in_psi(tmp_path_factory):
    """Return a function that runs a campaign of a log, and of the same with psi called kPa."""
    folder = tmp_path_factory.mktemp('psi')
    record(folder, [('right', LENGTHS[0], 0.0)])
    (folder / 'specimens.csv').unlink()
    head, *rows = (folder / 'right.csv').read_text().splitlines()
    slipped = [f'{length};{float(bar) * 100.0 / 6.894757:.4f};{force}'
               for length, bar, force in (row.split(';') for row in rows)]
    (folder / 'psi.csv').write_text('\n'.join([head.replace('bar', 'kPa'), *slipped]))
    save_model(muscle(1e-3 * LENGTHS[0]), folder / 'model.yaml')

    def run(**options):
        return run_campaign(folder, folder / 'model.yaml', folder / 'out', workers=1, **options)
    return run
