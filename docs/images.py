#!/usr/bin/env python3
# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draws the pictures of docs/images from commands: python docs/images.py [--chromium PROGRAM].

Each picture comes twice, for light and dark pages. Needs Chromium, which draws the same plotly
figures that the commands put on their pages; nothing is fetched.
"""

import argparse
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

from fam_bundle_ros.cli import main as fam_bundle
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit, save_model

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent / 'config' / 'data' / 'examples'

#: Command (its page goes to PAGE, or into FOLDER; LAB is that of `lab`) -> figures: key, file
#: name, width in pixels.
PICTURES = (
    (('map', 'spie2021', '--tendon', '20 mm', '--out', 'PAGE'),
     (('space', 'force_strain_space', 980), ('ends-space', 'ends', 980))),
    (('diagnose', str(EXAMPLES / 'hidden_friction.csv'), '--model',
      str(EXAMPLES / 'hidden_friction.model.yaml'), '--out', 'PAGE'),
     (('maps', 'residual_maps', 980), ('ladder', 'ladder', 860))),
    (('diagnose', 'dmsp20_static_map', '--model', 'dmsp20_static_map', '--out', 'PAGE'),
     (('ladder', 'dmsp20_ladder', 900),)),
    (('benchmark-control', '--plants', 'everything', '--trajectories', 'ramp_20', '--units', '2',
      '--controllers', 'neglect', '--no-ros', '--out', 'PAGE'),
     (('compared-ramp_20-everything', 'policies', 900),)),
    # before anything else is measured into the folder
    (('campaign', 'LAB', '--model', 'LAB/model.yaml', '--specimens', 'LAB/specimens.csv', '--out',
      'FOLDER'),
     (('lacking', 'campaign_lacking', 900), ('trends', 'campaign_trends', 900))),
    (('measure', 'spie2021', '--out', 'LAB/isobars.csv'), ()),
    (('compare', 'LAB/isobars.csv', '--model', 'spie2021', '--out', 'PAGE'),
     (('comparison', 'measured_isobars', 980),)),
    (('demo', '--out', 'FOLDER'),
     (('force-run', 'run', 980),)),
)


def main() -> int:
    """Run every command and draw its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--chromium', default=shutil.which('chromium') or 'chromium')
    chromium = parser.parse_args().chromium
    images = HERE / 'images'
    images.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        lab(Path(scratch, 'lab'))
        for place, (command, figures) in enumerate(PICTURES):
            places = {'PAGE': Path(scratch, 'page.html'), 'LAB': Path(scratch, 'lab'),
                      'FOLDER': Path(scratch, f'report_{place}')}
            status = fam_bundle([re.sub('^(PAGE|LAB|FOLDER)', lambda found, places=places: str(
                places[found[1]]), word) for word in command])
            if status:
                return status
            page = places['FOLDER'] / 'index.html' if 'FOLDER' in command else places['PAGE']
            text = page.read_text(encoding='utf-8') if figures else ''
            for key, name, width in figures:
                for theme in ('light', 'dark'):
                    alone = Path(scratch, f'{name}.html')
                    alone.write_text(only(text, key), encoding='utf-8')
                    target = images / f'{name}_{theme}.png'
                    draw(chromium, alone, theme, width, height(text, key), target, scratch)
                    print(target.relative_to(HERE.parent))
    return 0


def lab(folder: Path, count: int = 24) -> None:
    """Write maps of muscles of five lengths: rubber hardens with age, supplier B has long ends."""
    rng = np.random.default_rng(4)
    strain, pressure = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.22, 8),
                                                             np.linspace(4e4, 4e5, 6)))
    folder.mkdir()
    lines = ['file,muscle,length [mm],diameter [mm],age [days],supplier']
    for number in range(count):
        length, diameter = rng.choice([100, 140, 190, 240, 300]), rng.choice([10.0, 12.7, 16.0])
        age, supplier = int(10.0 ** rng.uniform(1.0, 2.8)), 'AB'[number % 2]
        geometry = Geometry(diameter / 2e3, length / 1e3, np.radians(30.0), 1.2e-3)
        ideal = Bundle('lab', [MotorUnit('mu1', 1, geometry)], [catalogue.get('mesh')()])
        truth = ideal if number % 3 == 0 else ideal.with_effect(
            'bladder_elasticity', c10=4e4 * (age / 100.0) ** 0.3, c01=2e4)
        truth = truth.with_effect('end_caps', dead_length=10e-3) if supplier == 'B' else truth
        force = truth.force(strain, pressure[:, None])
        force = force + rng.normal(0.0, 0.002 * np.abs(force).max(), len(force))
        rows = [f'{e:.5f},{p / 1e3:.3f},{f:.4f}' for e, p, f in zip(strain, pressure, force)]
        (folder / f'muscle_{number:02d}.csv').write_text(
            '\n'.join(['strain,pressure [kPa],force [N]', *rows]))
        lines.append(f'muscle_{number:02d}.csv,m{number:02d},{length},{diameter},{age},{supplier}')
    (folder / 'specimens.csv').write_text('\n'.join(lines))
    nominal = Geometry(6.35e-3, 0.2, np.radians(30.0), 1.2e-3)
    save_model(Bundle('lab', [MotorUnit('mu1', 1, nominal)], [catalogue.get('mesh')()]),
               folder / 'model.yaml')


def only(page: str, key: str) -> str:
    """Return a page with nothing but the drawing of one figure."""
    body = re.search(rf'<figure id="{key}">.*?(<div class="drawing".*?</script>)', page, re.S)
    if body is None:
        raise SystemExit(f'the page has no figure {key}')
    start, end = page.index('<header>'), page.index('</footer>') + len('</footer>')
    frame = '<button id="theme" hidden></button><style>body{padding:8px 12px}' \
            '#theme,.modebar{display:none!important}</style>'
    return f'{page[:start]}{frame}{body[1]}{page[end:]}'


def height(page: str, key: str) -> int:
    """Return the height of a figure, pixels."""
    found = re.search(rf'<figure id="{key}">.*?style="height:(\d+)px"', page, re.S)
    assert found is not None
    return int(found[1])


def draw(chromium: str, page: Path, theme: str, width: int, tall: int, target: Path,
         scratch: str) -> None:
    """Take a picture of a page."""
    subprocess.run(
        [chromium, '--headless', '--no-sandbox', '--disable-gpu', '--hide-scrollbars',
         '--no-first-run', '--disable-background-networking', '--disable-component-update',
         '--disable-sync', '--disable-quic', f'--user-data-dir={scratch}/profile',
         f'--window-size={width},{tall + 16}', '--force-device-scale-factor=1.5',
         '--virtual-time-budget=6000', f'--screenshot={target}', f'{page.as_uri()}#{theme}'],
        check=True, capture_output=True, timeout=120)


if __name__ == '__main__':
    sys.exit(main())
