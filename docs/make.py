#!/usr/bin/env python3
# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Writes pages of docs/reference/ from the code: python docs/make.py.

A test compares them with what this would write, so they cannot fall behind.
"""

from collections.abc import Callable, Iterator
import inspect
from pathlib import Path
import re
from typing import Any

HEAD = '<!-- Written by docs/make.py from the code; do not edit. -->\n\n'

#: What each topic carries. A topic without a line here fails `ros`.
TOPICS = {
    'force': 'force.x in N, tension positive, frame `load_cell`',
    'strain': 'joints `contraction` (m) and `strain`, positive when shorter, with velocities; '
              '`contraction` alone is enough',
    'mu/pressure': 'absolute pressure of the motor unit, Pa',
    'mu/pressure_setpoint': 'absolute pressure setpoint, Pa',
    'mu/valve_command': 'joint `mu<i>_valve`, effort -1 exhaust, 0 closed, 1 fill; stamp of the '
                        'pressure reading on which it is based',
    'supply/pressure': 'absolute pressure of the supply, Pa',
    'reference/force': 'force.x in N; the last reference received is the control mode',
    'reference/strain': 'joint `strain`, with its rate as velocity if you have it',
    'reference/pressures': 'joints `mu1`, `mu2`, ...: gauge pressure setpoints as efforts, Pa; '
                           'for experiments: without a model, with limits and latches',
    'reference/dynamometer': 'joint `strain` with its rate: setpoint of a dynamometer, for the '
                             'simulator if `load.kind` is dynamometer, on a rig for the driver of '
                             'the dynamometer',
    'reference/trajectory': 'joint `force`, `strain` or `contraction`; sampled into the above',
    'recruitment_state': '0 off, also during the ramp down of the pressures; k for RSk; latched',
    'recruitment': 'per motor unit: on or off (position), share of the force (effort, 0 to 1)',
    'adaptation': 'what the controller has learnt of each motor unit, as text; latched',
    'model/force': 'force predicted by the model, N',
    'model/residual': 'measured minus predicted, N',
    'model/state': 'whether the model holds: JSON with holds, words, error_N, noise_N, '
                   'tolerance_N, where, since_s, diagnosing, failure (of the last diagnosis), '
                   'candidate; latched',
    'model/diagnosis': 'result of `diagnose`: the JSON of `fam_bundle diagnose`, with file, '
                       'model_file and protocol_file; latched',
    'model/applied': 'model file that `apply_model` or `restore_model` activated; latched',
    'e_stop': 'emergency stop, latched; one publisher',
    'supply_enable': 'true: the supply may be open; on change and 10 times a second; false or '
                     'silent for 0.5 s: cut and dump the supply',
    'mu/pid_state': 'state of the pressure loop: `ACTIVE`, `LATCHED NO_RESPONSE: mu1 shows ...`; '
                    'on change and 20 times a second; latched',
    '/diagnostics': 'rate, age, saturation, margins, simulated or rig; 1 Hz',
}
SERVICES = {
    'enable': 'bumpless on and off', 'e_stop_trigger': 'vent all, latched',
    'e_stop_reset': 'release the emergency stop',
    'reset': 'restart the simulated rig; an emergency stop is kept',
    'tare': 'zero the load cell of the simulated rig; warns under pressure',
    'fault/clear': 'remove all faults of the simulated rig: all parameters `faults.*`',
    'diagnose': 'find what the model lacks, on the memory of the last minutes; the result is '
                'published on `model/diagnosis` and written to `diagnosis_folder`',
    'apply_model': 'activate the model that the last diagnosis recommends, bumpless; refused '
                   'unless it matches the bundle and predicts the memory better',
    'restore_model': 'restore the previous model',
    'adaptation/reset': 'delete what was learnt',
    'adaptation/save': 'write the adapted model to `adaptation_file`, by default '
                       '`<model>_adapted.yaml` in the working directory',
}


def ros() -> str:
    """Return the nodes' interface: topics, services and parameters with their defaults."""
    from rclpy.context import Context

    from fam_bundle_ros.nodes import base
    from fam_bundle_ros.nodes.bundle_bringup import make_nodes
    context = Context()
    context.init(args=['--ros-args', '--log-level', 'fatal'])
    # In lock-step the reference generator has its publishers from the start.
    nodes = make_nodes(context, overrides={'start_stopped': True, 'lock_step': True,
                                           'publish_clock': False})
    try:
        parts = [HEAD, '# ROS 2 interface\n\n',
                 'All names are relative; the default namespace is `/bundle`. Two motor units are '
                 'shown (`mu1`, `mu2`); a model with more has `mu3`, ... Pressures on topics are '
                 'absolute, as FluidPressure is defined (`pressure_is_gauge` for drivers that '
                 'send gauge).\n\n',
                 '## Topics\n\n', _topics(nodes), '\n## Services\n\n', _services(nodes),
                 '\n## Parameters\n\nEvery parameter has a descriptor with its range. "Running": '
                 'whether it may change while the node runs.\n']
        common = {spec.name for spec in base.COMMON}
        parts += ['\n### Every node\n\n', _parameters(base.COMMON)]
        for node in _one_of_each(nodes):
            module = inspect.getmodule(type(node))
            specs = [spec for spec in node.p.specs.values() if spec.name not in common]
            parts += [f'\n### {_executable(node)}\n\n', f'{_summary(module)}\n\n',
                      _parameters(specs)]
        return ''.join(parts)
    finally:
        for node in nodes:
            node.destroy_node()
        context.try_shutdown()


def effects() -> str:
    """Return the catalogue of effects."""
    from fam_bundle_ros.model import catalogue
    parts = [HEAD, '# Effects\n\n',
             'Effects for model files. `fam_bundle effects NAME` shows the same in '
             'the terminal.\n\n',
             _rows(('effect', 'acts on', 'what it is'), (
                 (f'[{name}](#{name})', catalogue.get(name).place.value,
                  catalogue.get(name).summary) for name in catalogue.names()))]
    for name in catalogue.names():
        effect = catalogue.get(name)
        formula = inspect.cleandoc(effect.__doc__ or '')
        parts += [f'\n## {name}\n\n{_sentence(effect.summary)}\n\n```text\n{formula}\n```\n\n',
                  f'- acts on: {effect.place.value}; family: {effect.family}'
                  + (f'; another shape of `{effect.variant_of}`' if effect.variant_of else ''),
                  f'\n- source: {effect.source}\n- sign that it is missing: {effect.signature}\n'
                  f'- code: `{effect.__module__.replace(".", "/")}.py`\n']
        if effect.parameters:
            parts += ['\n', _rows(('parameter', 'default', 'from', 'to', 'unit', 'meaning'), (
                (f'`{p.name}`', f'{p.default:g}', f'{p.lower:g}', f'{p.upper:g}',
                 '' if p.unit == '1' else p.unit, p.description) for p in effect.parameters))]
    return ''.join(parts)


def commands() -> str:
    """Return the commands with their arguments and options."""
    from typer.main import get_command

    from fam_bundle_ros.cli.app import app
    top = get_command(app)
    parts = [HEAD, '# Command line\n\n',
             'Exit status 0 when it worked, 2 for bad input with one line on stderr, 1 otherwise. '
             '`--json FILE` writes the result for other programs; files are written whole or not '
             'at all.\n']
    for name, command in top.commands.items():  # type: ignore[attr-defined]
        text = inspect.cleandoc(command.help or '')
        usage = ' '.join(['fam_bundle', name, *(
            p.metavar if p.required or p.metavar.startswith('[') else f'[{p.metavar}]'
            for p in command.params if p.param_type_name == 'argument')])
        parts += [f'\n## {name}\n\n`{usage} [OPTIONS]`\n\n{text}\n']
        options = [p for p in command.params if p.param_type_name == 'option']
        if options:
            parts += ['\n', _rows(('option', 'default', 'meaning'), (
                (', '.join(f'`{o}`' for o in [*p.opts, *p.secondary_opts])
                 + (f' `{p.metavar}`' if p.metavar else ''),
                 'on' if p.default is True else '' if p.default in (None, False) else p.default,
                 p.help or '') for p in options))]
    return ''.join(parts)


#: File below docs/reference/ -> what makes it.
PAGES: dict[str, Callable[[], str]] = {'ros.md': ros, 'effects.md': effects, 'cli.md': commands}


def _one_of_each(nodes: list[Any]) -> Iterator[Any]:
    seen = set()
    for node in nodes:
        if type(node) not in seen:
            seen.add(type(node))
            yield node


def _executable(node: Any) -> str:
    return inspect.getmodule(type(node)).__name__.rpartition('.')[2]  # type: ignore[union-attr]


def _summary(module: Any) -> str:
    text = inspect.cleandoc(module.__doc__).split('\n\n')[0].replace('\n', ' ')
    return _sentence(text.partition(': ')[2] or text)


def _sentence(text: str) -> str:
    text = text[:1].upper() + text[1:]
    return text if text.endswith('.') else f'{text}.'


def _short(node: Any, name: str) -> str:
    return name.removeprefix(node.get_namespace() + '/')


def _type(kind: Any) -> str:
    package, _, rest = kind.__module__.partition('.')
    return f'{package}/{rest.split(".")[0]}/{kind.__name__}'


def _topics(nodes: list[Any]) -> str:
    found: dict[str, tuple[str, list[str], list[str]]] = {}
    hidden = {'/parameter_events', '/rosout'}
    for node in nodes:
        who = _executable(node)
        for index, ends in ((1, node.publishers), (2, node.subscriptions)):
            for end in ends:
                if end.topic_name in hidden:
                    continue
                entry = found.setdefault(end.topic_name, (_type(end.msg_type), [], []))
                if who not in entry[index]:
                    entry[index].append(who)
    order = sorted(found, key=lambda name: (not name.startswith('/bundle'), name))
    return _rows(('topic', 'type', 'published by', 'read by', 'carries'), (
        (f'`{_short(nodes[0], name)}`', found[name][0],
         ', '.join(found[name][1]) or 'you', ', '.join(found[name][2]) or 'you',
         TOPICS[re.sub(r'^mu\d+', 'mu', _short(nodes[0], name))])
        for name in order))


def _services(nodes: list[Any]) -> str:
    found = {}
    for node in nodes:
        for service in node.services:
            kind = _type(service.srv_type)
            if not kind.startswith(('rcl_interfaces', 'type_description')):
                found[service.srv_name] = (kind, _executable(node))
    return _rows(('service', 'type', 'answered by', 'does'), (
        (f'`{_short(nodes[0], name)}`', *found[name], SERVICES[_short(nodes[0], name)])
        for name in sorted(found)))


def _parameters(specs: Any) -> str:
    def default(spec: Any) -> str:
        if isinstance(spec.default, bool):
            return str(spec.default).lower()
        return f"'{spec.default}'" if isinstance(spec.default, str) else f'{spec.default:g}'

    def bounds(spec: Any) -> str:
        if spec.choices:
            return ', '.join(spec.choices)
        return '' if isinstance(spec.default, (bool, str)) else f'{spec.low:g} to {spec.high:g}'

    return _rows(('parameter', 'default', 'range', 'running', 'meaning'), (
        (f'`{s.name}`', default(s), bounds(s),
         'while off' if s.at_rest else 'yes' if s.dynamic else '', s.text)
        for s in specs))


def _rows(head: tuple[str, ...], rows: Any) -> str:
    lines = [head, ('---',) * len(head), *rows]
    return ''.join('| ' + ' | '.join(str(cell).replace('|', '\\|').replace('\n', ' ')
                                     for cell in row) + ' |\n' for row in lines)


if __name__ == '__main__':
    for name, page in PAGES.items():
        Path(__file__).with_name('reference').joinpath(name).write_text(page(), encoding='utf-8')
        print(f'docs/reference/{name}')
