# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of ``fam_bundle bench``: every figure with its peer and its target."""

from collections.abc import Mapping, Sequence
from typing import Any

from fam_bundle_ros.benchmarks.speed import FIGURE_HEAD, Result
from fam_bundle_ros.report.page import Page, Section, Table
from fam_bundle_ros.report.provenance import provenance


def bench_page(results: Sequence[Result], machine: Mapping[str, Any]) -> Page:
    """Return the page of measured rows on a machine, which `speed.machine` describes."""
    asked = [figure for result in results for figure in result.figures
             if figure.reached is not None]
    reached = sum(figure.reached is True for figure in asked)
    sections = [
        Section(f'{result.row.name}: {result.row.what}', '; '.join(result.remarks), [
            Table(FIGURE_HEAD, [figure.cells for figure in result.figures])]
                if result.figures else [])
        for result in results]
    return Page('Speed of the parts',
                f'{reached} of {len(asked)} targets are reached. Ratios were measured in one run '
                'on one machine; the shortest of several repeats is used.', (), sections,
                provenance((), [(name, str(value)) for name, value in machine.items()]))
