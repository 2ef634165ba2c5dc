# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Downloads: the data with prediction and residual, the report."""

from pathlib import Path
import tempfile

from fam_bundle_ros.discovery import write_csv
from fam_bundle_ros.report.discovery_pages import (
    comparison_sections,
    diagnosis_sections,
    ladder_picture,
)
from fam_bundle_ros.report.map_page import model_section
from fam_bundle_ros.report.page import Headline, Page, provenance, render, Section
from fam_bundle_ros.workbench.session import Session, short


def file_stem(session: Session) -> str:
    """Return a name for downloads: the case's title in ASCII letters and digits."""
    title = session.case.title if session.case else 'model'
    return '_'.join(''.join(c if c.isascii() and c.isalnum() else ' ' for c in title.lower())
                    .split()) or 'model'


def csv_text(session: Session) -> str:
    """Return the measurement with the columns `model_force [N]` and `residual [N]`."""
    with tempfile.TemporaryDirectory(prefix='fam_bundle_') as folder:
        path = Path(folder) / 'out.csv'
        write_csv(session.data, path, {
            'model_force [N]': session.now.prediction, 'residual [N]': session.residual()})
        return path.read_text(encoding='utf-8')


def report_text(session: Session) -> str:
    """Return the report as one self-contained HTML page."""
    first, now = session.steps[0], session.now
    comparison = now.comparison
    steps = [{'step': step.label, 'error_N': step.error_N, 'held_out_N': step.held_out_N}
             for step in session.steps]
    headline = [
        Headline('Error at the start', f'{short(first.error_N)} N', 'rms, original model'),
        Headline('Error now', f'{short(now.error_N)} N',
                 ', '.join(s.label for s in session.steps[1:]) or 'no effect was added'),
        Headline('On held-out data', f'{short(now.held_out_N)} N', 'blocks not used in the fit'),
        Headline('Noise floor', f'{short(session.noise)} N', comparison.noise.basis)]
    sections = []
    if len(steps) > 1:
        sections.append(Section('Ladder', '', [ladder_picture(steps, session.noise)]))
    if session.diagnosis is not None:
        sections += diagnosis_sections(session.diagnosis)
    sections += comparison_sections(comparison, now.model)
    sections.append(model_section(now.model))
    case = session.case
    rows = [('case', case.title), ('origin of the data', case.origin)] if case else []
    if session.data.sha256:
        rows.append(('data, sha256', session.data.sha256))
    rows.append(('samples in the errors', f'all {len(session.data)}'))
    return render(Page(f'{case.title if case else now.model.name}: a better model',
                       session.headline(), headline, sections, provenance((), rows)))
