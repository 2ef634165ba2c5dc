# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that need a model only: `map`, `effects`, `tune`."""

import inspect
from pathlib import Path
from typing import Annotated, Any

import typer

from fam_bundle_ros.cli.common import (
    AllowPython,
    chosen_model,
    console,
    effect_name,
    JsonFile,
    muscle_of,
    notes,
    open_model,
    page_to_write,
    PAPER,
    quantity,
    save_json,
    show_muscle,
    state_name,
    table,
    wrote,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.resources import model_path
from fam_bundle_ros.told import number
from fam_bundle_ros.units import spaced

ChosenModel = Annotated[str | None, typer.Argument(metavar='[MODEL]', help='Model file, or name '
                                                   'of a shipped model; by default the bundle of '
                                                   'the paper.')]


def draw_map(
    model: ChosenModel = None,
    out: Annotated[Path, typer.Option('--out', '-o', metavar='FILE', callback=page_to_write,
                                      help='The page to write.')] = Path('map.html'),
    model_option: Annotated[str | None, typer.Option('--model', '-m', metavar='MODEL', help=
                                                     'The same as the argument MODEL.')] = None,
    tendon: Annotated[str | None, typer.Option(metavar='LENGTH', help='Also compare fixed ends '
                                               'with tendons of this length in the same packaging '
                                               'length: "20 mm".')] = None,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
) -> None:
    """Draw force-strain space and free strain of a model: figures 2, 3 and 4 of the paper."""
    from fam_bundle_ros.report.map_page import map_page
    from fam_bundle_ros.report.page import write_page
    from fam_bundle_ros.report.paper import paper_figures
    from fam_bundle_ros.report.tendons import compare_ends
    if model is not None and model_option is not None:
        raise InputError(f'MODEL is {model} and --model is {model_option}; expected one of them')
    model = model or model_option
    bundle = chosen_model(model, allow_python)
    ends = None if tendon is None else compare_ends(bundle, quantity(tendon, 'm', '--tendon'))
    figures = paper_figures(bundle)
    write_page(out, map_page(bundle, figures, model_path(model or PAPER), ends))
    found = figures.summary()
    table(('', 'blocked force (N)', 'free strain'),
          [(state_name(k + 1), float(figures.space.high['included'][k][0]),
            float(bundle.free_strain(bundle.state_pressures(k + 1, bundle.max_pressure[k]))))
           for k in range(bundle.n)], title=f'{bundle.name}: limits of each state',
          numeric=(1, 2))
    if figures.free_strain is not None:
        console.print(f'free strain {figures.free_strain.words}')
        widest = found['overlap_widest_N']
        console.print(f'RS1 and RS2 overlap by up to {number(widest)} N, widest at strain '
                      f'{number(found["overlap_widest_at_strain"])}' if widest > 0.0 else
                      'RS1 and RS2 do not overlap')
    if ends is not None:
        told = ends.summary()
        table(('', 'blocked force (N)', 'free strain, smallest', 'free strain, full'),
              [(words, told[name]['blocked_force_N'], told[name].get('free_strain_least'),
                told[name]['free_strain_full'])
               for name, words in (('fixed', 'fixed ends'),
                                   ('tendons', f'tendons of {1e3 * ends.tendon:.4g} mm'))],
              title=f'over a packaging length of {1e3 * ends.packaging_length:.4g} mm',
              numeric=(1, 2, 3))
        found['tendons'] = told
    if bundle.unusual_order:
        notes.print(f'note: {bundle.unusual_order}')
    wrote(out)
    save_json(json_file, {**found, 'muscle': muscle_of(bundle), 'figures': figures,
                          **({'ends': ends} if ends is not None else {})})


def effects(
    name: Annotated[str | None, typer.Argument(metavar='[NAME]', help='Show one effect in full.'
                                               )] = None,
    model: Annotated[str | None, typer.Option('--model', '-m', metavar='MODEL', help='Show the '
                                              'effects of a model, with its values.')] = None,
    every: Annotated[bool, typer.Option('--all', help='Show all effects in full.')] = False,
    json_file: JsonFile = None,
    allow_python: AllowPython = False,
) -> None:
    """List the catalogue of effects, or show one with formula, parameters and bounds."""
    from fam_bundle_ros.model import catalogue
    items: list[Any]
    if model is not None:
        bundle = open_model(model, allow_python)
        items = list(bundle.effects) if name is None else [bundle.effect(name)]
    else:
        items = [catalogue.get(name)] if name is not None else [
            catalogue.get(known) for known in catalogue.names()]
    if every or name is not None:
        for item in items:
            _describe(item)
    else:
        table(('effect', 'acts on', 'what it is'),
              [(effect_name(item.name), item.place.value, item.summary) for item in items])
        own = f' --model {model}' if model is not None else ''
        console.print(f'fam_bundle effects NAME{own} shows one with its parameters', style='dim',
                      markup=False, soft_wrap=True)
    save_json(json_file, {'effects': [_entry(item) for item in items]})


def tune(
    sample_period: Annotated[str, typer.Option(help='Period of the pressure loop.')] = '5 ms',
    transport_delay: Annotated[str, typer.Option(help='Dead time from reading to valve command.'
                                                 )] = '5 ms',
    spool_frequency: Annotated[str, typer.Option(help='Natural frequency of the valve spool.'
                                                 )] = '125 Hz',
    gain_margin: Annotated[float, typer.Option(help='Gain margin to keep, dB.', min=0.0)] = 8.0,
    phase_margin: Annotated[float, typer.Option(help='Phase margin to keep, degrees.',
                                                 min=0.0)] = 55.0,
    scheduled: Annotated[bool, typer.Option(help='Schedule the gains with the volume.')] = True,
    loop: Annotated[str, typer.Option(help='pressure, force or strain.')] = 'pressure',
    gain_error: Annotated[float, typer.Option(help='Force: relative error of the '
                                              "model's gain to tolerate.",
                                              min=0.0, max=1.0)] = 0.5,
    inertia: Annotated[float, typer.Option(help='Strain: force per strain acceleration of the '
                                           'load, N s^2.', min=0.0)] = 0.3,
    model: Annotated[str | None, typer.Option('--model', '-m', metavar='MODEL', help='Strain: '
                                              'model file, or name of a shipped model.')] = None,
    json_file: JsonFile = None,
) -> None:
    """
    Compute the gains of a loop and show their stability margins and step responses.

    A reading from a topic is one period old: the gains of the node pressure_pid are those for a
    sample period and a delay of 5 ms each, as are the defaults here.
    """
    from fam_bundle_ros.control import PidConfig, tuning
    from fam_bundle_ros.control.loop_tuning import pressure_steps
    period = quantity(sample_period, 's', '--sample-period')
    delay = quantity(transport_delay, 's', '--transport-delay')
    if loop != 'pressure':
        _tune_outer(loop, period, delay, gain_error, inertia, model, json_file)
        return
    result = tuning.tune(
        sample_period=period, transport_delay=delay,
        spool_frequency=_hertz(spool_frequency),
        gain_margin_db=gain_margin, phase_margin_deg=phase_margin, scheduled=scheduled)
    gains = result.gains
    console.print(f'[bold]p {gains.p:.4g} 1/s   i {gains.i:.4g} 1/s²   d {number(gains.d)}[/bold]')
    console.print(f'gain margin {result.gain_margin_db:.1f} dB, phase margin '
                  f'{result.phase_margin_deg:.0f}°, the smallest of {len(result.points)} states '
                  f'of the chamber')
    table(('volume (mL)', 'valve', 'rate fully open (MPa/s)', 'gain margin (dB)',
           'phase margin (°)', 'crossover (Hz)'), _by_volume(result.points),
          numeric=(0, 3, 4, 5))
    steps = pressure_steps(gains, PidConfig(transport_delay=delay), period, delay)
    table(('volume (mL)', 'true rate / model rate', 'overshoot (%)', 'settling (ms)'),
          [(1e6 * step.volume, 1.0 + step.gain_error, 100.0 * step.overshoot,
            1e3 * step.settling) for step in steps], numeric=(0, 1, 2, 3))
    save_json(json_file, {'steps': steps,
                          'gains': gains, 'gain_margin_dB': result.gain_margin_db,
                          'phase_margin_deg': result.phase_margin_deg,
                          'sample_period_s': result.sample_period,
                          'dead_time_s': result.dead_time, 'points': result.rows()})


def _tune_outer(loop: str, period: float, delay: float, gain_error: float, inertia: float,
                model: str | None, json_file: Any) -> None:
    """Show settings, margins and steps of the force or strain loop."""
    from fam_bundle_ros.control import LoadModel, OuterConfig
    from fam_bundle_ros.control.loop_tuning import tune_force, tune_strain
    config = OuterConfig(delay=delay, gain_error=gain_error)
    if loop == 'force':
        result = tune_force(config, period)
    elif loop == 'strain':
        if model is None:
            raise InputError('--loop strain needs --model: the gain of the loop depends on the '
                             'muscle (fam_bundle new-model writes one)')
        bundle = open_model(model)
        show_muscle(bundle)
        result = tune_strain(bundle, LoadModel(inertia=inertia), config, period)
    else:
        raise InputError(f"--loop is '{loop}'; expected pressure, force or strain")
    console.print('[bold]' + '   '.join(f'{name} {value:.4g}' for name, value
                                        in result.settings.items()) + '[/bold]')
    table(('true gain / model gain', 'stiffness / mean stiffness', 'gain margin (dB)',
           'phase margin (°)', 'delay margin (ms)', 'overshoot (%)', 'settling (ms)'),
          [(1.0 + p.gain_error, p.stiffness, p.gain_margin_db, p.phase_margin_deg,
            1e3 * p.delay_margin, 100.0 * p.overshoot, 1e3 * p.settling) for p in result.points],
          numeric=(0, 1, 2, 3, 4, 5, 6))
    save_json(json_file, {'loop': loop, 'settings': result.settings, 'lag_s': result.lag,
                          'points': result.rows()})


def _by_volume(points: Any) -> list[tuple[Any, ...]]:
    """Return one row for each volume and side of the valve: the worst of all pressures."""
    groups: dict[tuple[float, bool], list[Any]] = {}
    for point in points:
        groups.setdefault((point.volume, point.filling), []).append(point)
    rows = []
    for (volume, filling), group in groups.items():
        rates = sorted(abs(point.rate_per_opening) / 1e6 for point in group)
        rows.append((1e6 * volume, 'fill' if filling else 'exhaust',
                     f'{rates[0]:.1f} to {rates[-1]:.1f}',
                     min(point.gain_margin_db for point in group),
                     min(point.phase_margin_deg for point in group),
                     max(point.crossover_hz for point in group)))
    return rows


def _hertz(text: str) -> float:
    # parsed here as 1/s, as some releases of pint convert a hertz to rad/s
    number, _, unit = spaced(text).partition(' ')
    if unit.strip() != 'Hz':
        raise InputError(f"--spool-frequency: '{text}' is not a frequency; expected for example "
                         '"125 Hz"')
    try:
        return float(number)
    except ValueError as error:
        raise InputError(f"--spool-frequency: '{number}' is not a number") from error


def _describe(item: Any) -> None:
    values, law = getattr(item, 'values', None), getattr(item, 'law', item)
    console.print(effect_name(item.name), f'  {item.summary}', sep='', soft_wrap=True)
    for line in inspect.cleandoc(vars(law).get('__doc__') or '').splitlines():
        console.print(f'    {line}'.rstrip(), markup=False, highlight=False)
    console.print(f'  acts on {item.place.value}, family {item.family}'
                  + (f', another shape of {item.variant_of}' if item.variant_of else ''))
    console.print(f'  source: {item.source}', soft_wrap=True)
    console.print(f'  missing when: {item.signature}', soft_wrap=True)
    if '__module__' in vars(law):
        code = law.python_file or f'{law.__module__.replace(".", "/")}.py'
        console.print(f'  code: {code}', soft_wrap=True)
    if item.parameters:
        rows = []
        for p in item.parameters:
            own = [] if values is None else [values[p.name] / p.scale]
            rows.append((f'  {p.name}', *own, f'{p.default:g}', f'{p.lower:g}', f'{p.upper:g}',
                         '' if p.unit == '1' else p.unit, p.description))
        head = ('  parameter', *(['value'] if values is not None else []), 'default', 'lower',
                'upper', 'unit', '')
        table(head, rows, numeric=range(1, len(head) - 2))
    console.print()


def _entry(item: Any) -> dict[str, Any]:
    values = getattr(item, 'values', {})
    return {'name': item.name, 'summary': item.summary, 'source': item.source,
            'place': item.place.value, 'family': item.family, 'variant_of': item.variant_of,
            'signature': item.signature,
            'parameters': [{'name': p.name, 'unit': p.unit, 'default': p.default,
                            'lower': p.lower, 'upper': p.upper, 'description': p.description,
                            **({'value': values[p.name] / p.scale} if values else {})}
                           for p in item.parameters]}
