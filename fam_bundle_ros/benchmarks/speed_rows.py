# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""All rows of `fam_bundle bench`, and the function that fills the cache of compiled code."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np

from fam_bundle_ros import kernels
from fam_bundle_ros.benchmarks import (
    speed_loop,
    speed_model,
    speed_ros,
    speed_start,
    speed_studies,
    speed_ticks,
)
from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory
from fam_bundle_ros.model import catalogue, load_model, rowlaw
from fam_bundle_ros.resources import config_names, config_path
from fam_bundle_ros.simulation import ClosedLoop

ROWS = (*speed_loop.ROWS, *speed_model.ROWS, *speed_ticks.ROWS, *speed_ros.ROWS,
        *speed_start.ROWS, *speed_studies.ROWS)


def warm_up() -> None:
    """Compile laws and shipped models on two cores, so that a user's first run is fast."""
    if kernels.numba() is None:
        return
    with ProcessPoolExecutor(2, get_context('spawn')) as pool:
        for compiled in (pool.submit(_compile_laws), pool.submit(_compile_models)):
            compiled.result()


def _compile_laws() -> None:
    rowlaw.prepare(catalogue.available().values())


def _compile_models() -> None:
    for name in config_names('models'):
        bundle = load_model(config_path(f'models/{name}'))
        strain = np.linspace(0.0, 0.2, 9)
        bundle.force(strain, np.full((9, bundle.n), 1e5))
        trajectory = replace(make_trajectory('sine_0.5', bundle), duration=0.1, prepare=0.0)
        ClosedLoop(bundle).run(trajectory)
