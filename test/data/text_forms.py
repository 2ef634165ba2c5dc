# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A log, and functions that make of it what programs of labs write as text: `TEXTS`."""

from datetime import datetime, timedelta
import json

import numpy as np

REST = 0.25
ROWS = 360


def cells(log, point='.', time=lambda t: f'{t:.3f}', blank=()):
    """Return the rows as text: time, contraction in mm, pressure in kPa, force."""
    rows = []
    for k in range(ROWS):
        row = [time(log['time'][k]), f'{1e3 * REST * log["strain"][k]:.5f}',
               f'{log["pressure"][k] / 1e3:.2f}', f'{log["force"][k]:.3f}']
        rows.append([cell.replace('.', point) for cell in row])
    return rows


def text(head, rows, separator=',', end='\n'):
    """Return a text table."""
    lines = [*head, *(separator.join(row) for row in rows)]
    return end.join(lines) + end


HEAD = 'time [s],contraction [mm],pressure [kPa],force [N]'
BEGIN = datetime(2026, 5, 3, 23, 59, 52)


def iso(t):
    """Return a date and time a little before midnight."""
    return (BEGIN + timedelta(seconds=float(t))).isoformat(timespec='milliseconds')


def day_time(t):
    """Return a time of day that passes midnight."""
    return (BEGIN + timedelta(seconds=float(t))).strftime('%H:%M:%S.%f')[:-3]


def german(t):
    """Return a date as it is written in Germany."""
    return (BEGIN + timedelta(seconds=float(t))).strftime('%d.%m.%Y %H:%M:%S,%f')[:-3]


def with_column(rows, at, values):
    """Return rows with one more column."""
    return [[*row[:at], value, *row[at:]] for row, value in zip(rows, values)]


def stamped(log, form):
    """Return a CSV with dates of a form."""
    return text([HEAD.replace('time [s]', 'timestamp')], cells(
        log, time=lambda t: (BEGIN + timedelta(seconds=float(t))).strftime(form)))


def in_groups(log, sign):
    """Return the rows in whole ms, um, Pa and mN, digits in groups of three."""
    return [[f'{value:,.0f}'.replace(',', sign) for value in (1e3 * t, 1e6 * REST * e, p, 1e3 * f)]
            for t, e, p, f in zip(*log.values())]


#: What was written by hand, as programs of labs write it: function of the log to text or bytes.
TEXTS = {
    'plain': lambda log: text([HEAD], cells(log)),
    'strain in percent': lambda log: text(
        ['time [s],strain [%],pressure [kPa],force [N]'],
        [[r[0], f'{float(r[1]) / 2.5:.6f}', *r[2:]] for r in cells(log)]),
    'length': lambda log: text(
        ['t [s];L [mm];p [kPa];F [N]'],
        [[r[0], f'{250.0 - float(r[1]):.5f}', *r[2:]] for r in cells(log)], ';'),
    'length in cm, force in kgf, pressure in psi, time in ms': lambda log: text(
        ['Time (ms)\tMuscle length (cm)\tPressure (psi)\tLoad (kg)'],
        [[f'{1e3 * t:.0f}', f'{25.0 * (1.0 - e):.6f}', f'{p / 6894.757:.6f}',
          f'{f / 9.80665:.6f}'] for t, e, p, f in zip(*log.values())], '\t'),
    'force in lbf, pressure in cmH2O': lambda log: text(
        ['time_s,contraction_mm,pressure_cmH2O,force_lbf'],
        [[*r[:2], f'{1e3 * float(r[2]) / 98.0665:.4f}', f'{float(r[3]) / 4.4482216:.6f}']
         for r in cells(log)]),
    'elongation in inches': lambda log: text(
        ['time [s],Extension [in],pressure [MPa],force [g]'],
        [[r[0], f'{-float(r[1]) / 25.4:.7f}', f'{float(r[2]) / 1e3:.6f}',
          f'{1e3 * float(r[3]) / 9.80665:.4f}'] for r in cells(log)]),
    'decimal comma': lambda log: text(
        ['Zeit [s];Verk\u00fcrzung [mm];Druck [kPa];Kraft [N]'], cells(log, ','), ';'),
    'decimal comma, tabs, Latin-1': lambda log: text(
        ['Zeit in s\tVerk\u00fcrzung in mm\tMuskeldruck in kPa\tZugkraft in N'],
        cells(log, ','), '\t', '\r\n').encode('latin-1'),
    'UTF-16': lambda log: text([HEAD], cells(log)).encode('utf-16'),
    'UTF-16 without mark': lambda log: text([HEAD], cells(log)).encode('utf-16-le'),
    'byte order mark': lambda log: text([HEAD], cells(log)).encode('utf-8-sig'),
    'row of units': lambda log: text(
        ['Time,Contraction,Pressure,Force', 's,mm,kPa,N'], cells(log)),
    'row of units in brackets, semicolons': lambda log: text(
        ['Zeit;Kontraktion;Druck;Kraft', '[s];[mm];[kPa];[N]', ''], cells(log, ','), ';'),
    'units in names': lambda log: text(['t_s,contraction_mm,p_kPa,F_N'], cells(log)),
    'units behind a stroke': lambda log: text(['t/s|contraction/mm|p/kPa|F/N'], cells(log), '|'),
    'preamble': lambda log: text(
        ['Test report', 'Operator: K. Meier, Lab 3', 'Date: 2026-05-03', 'Sample rate,20,Hz',
         '', HEAD], cells(log)),
    'preamble of numbers': lambda log: text(
        ['1.0,2.0,3.0,4.0', '0.1,0.1,0.1,0.1', HEAD], cells(log)),
    'long preamble with a row like data': lambda log: text(
        ['0,0,0,0', *(f'setting {k}: on' for k in range(150)), HEAD], cells(log)),
    'notes with numbers in them': lambda log: text(
        [HEAD + ',note'], [[*row, 'ok 1 2 3 4 5 6 7'] for row in cells(log)]),
    'a header for each run': lambda log: text(
        [HEAD], [*cells(log)[:120], HEAD.split(','), *cells(log)[120:]]),
    'a preamble for each run, wider than the table': lambda log: text(
        [HEAD.replace(',', '\t')],
        [*cells(log)[:120], ['Acquisition', 'Timed', '', 'Time', '7.95', 'Sec'],
         ['Station', 'muscle.cfg'], HEAD.split(','), *cells(log)[120:]], '\t'),
    'comment lines': lambda log: text(
        ['# rig 3', f'# {HEAD}'], [*cells(log)[:100], ['# pause'], *cells(log)[100:]]),
    'blanks': lambda log: text(
        ['   time [s]   contraction [mm]   pressure [kPa]   force [N]'],
        [[f'{cell:>14}' for cell in row] for row in cells(log)], ' '),
    'ISO time': lambda log: text(
        [HEAD.replace('time [s]', 'timestamp')], cells(log, time=iso)),
    'ISO time with zone': lambda log: text(
        [HEAD.replace('time [s]', 'timestamp')], cells(log, time=lambda t: iso(t) + '+02:00')),
    'time of day': lambda log: text(
        [HEAD.replace('time [s]', 'Uhrzeit')], cells(log, time=day_time)),
    'date and time of day': lambda log: text(
        ['Datum;Uhrzeit;Kontraktion [mm];Druck [kPa];Kraft [N]'],
        [['03.05.2026', *row] for row in cells(log, ',', day_time)], ';'),
    'words between times of day': lambda log: text(
        [HEAD.replace('time [s]', 'Uhrzeit')],
        [*cells(log, time=day_time)[:99], ['-- pause --'], *cells(log, time=day_time)[99:]]),
    'German date': lambda log: text(
        ['Zeitstempel;Kontraktion [mm];Druck [kPa];Kraft [N]'],
        [[german(t), *row[1:]] for t, row in zip(log['time'], cells(log, ','))], ';'),
    'text and extra columns': lambda log: text(
        ['No,time [s],note,contraction [mm],pressure [kPa],pressure setpoint [kPa],force [N],'
         'Temp [\u00b0C]'],
        [[str(k), row[0], 'ok "go", on'.replace(',', ''), *row[1:3], row[2], row[3], '21.5']
         for k, row in enumerate(cells(log))]),
    'quoted': lambda log: text(
        [','.join(f'"{name}"' for name in HEAD.split(','))],
        [[f'"{cell}"' for cell in row] for row in cells(log)]),
    'no units': lambda log: text(['time,contraction,pressure,force'], cells(log)),
    'separators at the end of lines': lambda log: text(
        [HEAD + ',,'], [[*row, '', ''] for row in cells(log)]),
    'thousands and decimal comma': lambda log: text(
        ['Zeit [s];Kontraktion [mm];Druck [mbar];Kraft [N]'],
        [[*row[:2], f'{10 * float(row[2].replace(",", ".")):,.1f}'.translate(
            str.maketrans(',.', '.,')), row[3]] for row in cells(log, ',')], ';'),
    'old line ends': lambda log: text([HEAD], cells(log), end='\r'),
    'last row cut, and a footer': lambda log: text([HEAD], [*cells(log)]) + 'End of test\n',
    'absolute pressure': lambda log: text(
        [HEAD.replace('[kPa]', '[bar abs]')],
        [[*row[:2], f'{(1e3 * float(row[2]) + 101325) / 1e5:.7f}', row[3]] for row in
         cells(log)]),
    'minus sign of compression': lambda log: (text(
        [HEAD], [[*row[:3], f'{-float(row[3]):.3f}'] for row in cells(log)]),
        {'columns': {'force': '-force [N]'}}),
    'names of nobody': lambda log: (text(
        ['a,b,c,d'], cells(log)),
        {'columns': {'time': 'a', 'contraction': 'b [mm]', 'pressure': 'c [kPa]',
                     'force': 'd [N]'}}),
    'no header': lambda log: (text([], cells(log)),
                              {'columns': {'time': '1', 'contraction': '2 [mm]',
                                           'pressure': '3 [kPa]', 'force': '4 [N]'}}),
    'no time, its rate told': lambda log: (text(
        ['contraction [mm],pressure [kPa],force [N]'], [row[1:] for row in cells(log)]),
        {'columns': {'time': '20 Hz'}}),
    'first line of Excel that names the separator': lambda log: text(
        ['sep=;', 'Zeit [s];Weg [mm];Druck [kPa];Kraft [N]'], cells(log, ','), ';'),
    'three rows of names': lambda log: text(
        ['AI0,AI1,AI2,AI3', 'Time,Displacement,Pressure,Force', 's,mm,kPa,N'], cells(log)),
    'quoted names and units of a testing machine': lambda log: text(
        ['"Time","Extension","Air pressure","Load"', '"(s)","(mm)","(kPa)","(N)"'],
        [[f'"{r[0]}"', f'"-{r[1]}"', f'"{r[2]}"', f'"{r[3]}"'] for r in cells(log)]),
    'commas for decimals and between cells': lambda log: text(
        [','.join(f'"{name}"' for name in HEAD.split(','))],
        [[f'"{cell}"' for cell in row] for row in cells(log, ',')]),
    'exponents of Fortran': lambda log: text(
        ['t_s x_mm p_kPa F_N'],
        [[f'{float(cell):.9E}'.replace('E', 'D') for cell in row] for row in cells(log)], ' '),
    'time of day, AM and PM': lambda log: text(
        [HEAD.replace('time [s]', 'Time')],
        cells(log, time=lambda t: (BEGIN + timedelta(seconds=float(t))).strftime(
            '%I:%M:%S.%f %p'))),
    'milliseconds since 1970': lambda log: text(
        [HEAD.replace('time [s]', 'timestamp')],
        cells(log, time=lambda t: f'{1.777e12 + 1e3 * t:.0f}')),
    'a table of markdown': lambda log: text(
        ['| time [s] | contraction [mm] | pressure [kPa] | force [N] |', '|---|---|---|---|'],
        [['', *row, ''] for row in cells(log)], ' | '),
    'units in every cell': lambda log: text(
        ['Time,Contraction,Pressure,Force'],
        [[f'{cell} {unit}' for cell, unit in zip(row, ('s', 'mm', 'kPa', 'N'))]
         for row in cells(log)]),
    'lines of a microcontroller': lambda log: text(
        ['boot ok', 'free heap: 2000', 'time_ms,contraction_mm,press_kPa,force_N'],
        cells(log, time=lambda t: f'{1e3 * t:.0f}')),
    'JSON lines': lambda log: ''.join(json.dumps(
        dict(zip(HEAD.split(','), map(float, row)))) + '\n' for row in cells(log)),
    'JSON lines of sensors': lambda log: ''.join(json.dumps(
        {'ts': t, 'muscle': {'contraction_mm': x, 'p_kPa': p}, 'cell': {'force_N': f}}) + '\n'
        for t, x, p, f in (map(float, row) for row in cells(log))),
    'JSON lines below a line of settings and units': lambda log: json.dumps(
        {'kind': 'meta', 'gain': 3, 'units': {'x': 'mm', 'p': 'kPa', 'F': 'N', 't': 's'}}
        ) + '\n' + ''.join(json.dumps({'kind': 'sample', 't': t, 'x': x, 'p': p, 'F': f}) + '\n'
                           for t, x, p, f in (map(float, row) for row in cells(log))),
    'JSON lines of arrays and units': lambda log: ''.join(json.dumps(
        {'t': t, 'contraction_mm': [x, 0.0], 'cell': {'value': p, 'unit': 'kPa'},
         'force': {'value': f / 1e3, 'unit': 'kN'}}) + '\n'
        for t, x, p, f in (map(float, row) for row in cells(log))),
    'dicts that Python printed': lambda log: ''.join(
        str(dict(zip(('t', 'contraction_mm', 'p_kPa', 'F_N'), map(float, row)))) + '\n'
        for row in cells(log)),
    'tuples that Python printed': lambda log: (text([], [[f'({r[0]}', *r[1:3], f'{r[3]})']
                                                         for r in cells(log)], ', '), {
        'columns': {'time': '1 [s]', 'contraction': '2 [mm]', 'pressure': '3 [kPa]',
                    'force': '4 [N]'}}),
    "Python's logging": lambda log: ''.join(
        f'2026-05-03 10:00:{float(t):06.3f} INFO x={x}mm p={p}kPa F={f}N\n'.replace('.', ',', 1)
        for t, x, p, f in cells(log)),
    'units in lines of channels above': lambda log: text(
        ['Channel 1: Contraction (mm)', 'Channel 2: Pressure (kPa)', 'Channel 3: Force (N)',
         'Time (s),Contraction,Pressure,Force'], cells(log)),
    'thousands apart by a blank': lambda log: text(
        ['Temps (ms);Contraction (mm);Pression (hPa);Force (N)'],
        [[f'{1e3 * float(t):,.0f}'.replace(',', ' '), x.replace('.', ','),
          f'{10 * float(p):,.2f}'.replace(',', ' ').replace('.', ','), f.replace('.', ',')]
         for t, x, p, f in cells(log)], ';'),
    'a footer of whole numbers below words': lambda log: text(
        ['t [s]\tcontraction [mm]\tp [kPa]\tF [N]\tStatus\tValve'],
        [*([*r, 'OK', 'open'] for r in cells(log)), ['Mean', '1', '1', '1', '1', '1']], '\t'),
    'a clock beside each channel': lambda log: text(
        ['Time [s],Contraction [mm],Time [s],Pressure [kPa],Time [s],Force [N]'],
        [[r[0], r[1], r[0], r[2], r[0], r[3]] for r in cells(log)]),
    'names of channels above, units in the names': lambda log: text(
        [',Laser,Gauge,Cell', 'Time,Value [mm],Value [kPa],Value [N]'], cells(log)),
    'French': lambda log: text(
        ['Temps (s);Longueur (mm);Pression (kPa);Force (N)'],
        [[r[0], f'{250.0 - float(r[1].replace(",", ".")):.5f}'.replace('.', ','), *r[2:]]
         for r in cells(log, ',')], ';'),
    'readings beside setpoints': lambda log: text(
        ['time [s],p_soll [bar],contraction [mm],p_ist [kPa],valve [-],T [C],force [N]'],
        [[r[0], '3.0', r[1], r[2], '1', '23.4', r[3]] for r in cells(log)]),
    'a table of results above the data': lambda log: text(
        ['Results Table 1', ',Max Load,Ext at Max', ',(N),(mm)', '1,120.5,-3.2', '', 'Raw Data',
         'Time,Extension,Load,Air pressure', '(s),(mm),(N),(kPa)'],
        [[r[0], f'-{r[1]}', r[3], r[2]] for r in cells(log)]),
    'catman': lambda log: text(
        ['HBM_CATMAN_DATAFILE_40', 'TITLE:', 'CHANNELS: 4', 'DATE: 03.05.2026',
         'CHANNAME\t CHANNEL=1\t CHANNEL=2', 'CHANNELTITLE:',
         'Zeit  1 - Standardmessrate\tWeg_WA\tDruck_P3\tKraft_S2M', 'UNIT:', 's\tmm\tkPa\tN'],
        cells(log, ','), '\t').encode('latin-1'),
    'points for thousands': lambda log: text(
        ['Zeit [ms];Kontraktion [mm];Druck [Pa];Kraft [N]'],
        [[f'{1e3 * t:,.0f}'.replace(',', '.'), r[1], f'{p:,.0f}'.replace(',', '.'), r[3]]
         for t, p, r in zip(log['time'], log['pressure'], cells(log, ','))], ';'),
    'offset and gain below the units': lambda log: text(
        [HEAD, 'offset,0.12,0.5,1.1', 'gain,1.0,1.0,1.0'], cells(log)),
    'a name beside each value': lambda log: 'boot ok\n' + ''.join(
        f't_s={r[0]} contraction_mm={r[1]} p_kPa={r[2]} F_N={r[3]}\n' for r in cells(log)),
    'a name and a unit beside each value': lambda log: ''.join(
        f't:{r[0]}s,contraction:{r[1]}mm,p:{p / 6894.757:.7f}psi,F:{r[3]}N\r\n'
        for p, r in zip(log['pressure'], cells(log))),
    'a clock in brackets, and names': lambda log: ''.join(
        f'[{r[0]}] contraction={r[1]}mm p={r[2]}kPa F={r[3]}N\n' for r in cells(log)),
    'the clock of a serial monitor, and names': lambda log: ''.join(
        f'{r[0]} -> contraction_mm:{r[1]}, p_kPa:{r[2]}, F_N:{r[3]}\n'
        for r in cells(log, time=day_time)),
    'the clock of a serial monitor': lambda log: ''.join(
        f'{clock} -> {line}\n' for clock, line in zip(
            ['10:00:00.000', *(r[0] for r in cells(log, time=day_time))],
            ['contraction_mm,p_kPa,F_N', *(','.join(r[1:]) for r in cells(log))])),
    'the date of the test above channels and formulas': lambda log: text(
        ['03/11/2024 10:15:42 AM', 'Ch\tAIN0\tAIN1', HEAD.replace(',', '\t')], cells(log),
        '\t'),
    'dates with strokes': lambda log: stamped(log, '%d/%m/%Y %H:%M:%S.%f'),
    'dates of America': lambda log: stamped(log, '%m/%d/%Y %H:%M:%S.%f'),
    'dates of MATLAB': lambda log: stamped(log, '%d-%b-%Y %H:%M:%S.%f'),
    'dates without strokes': lambda log: stamped(log, '%Y%m%dT%H%M%S.%f'),
    'milliseconds behind a colon': lambda log: text(
        [HEAD.replace('time [s]', 'Time')],
        cells(log, time=lambda t: day_time(t).replace('.', ':'))),
    'the form of a clock in the place of its unit': lambda log: text(
        [HEAD.replace('[s]', '[hh:mm:ss]')], cells(log, time=day_time)),
    'the zone of a clock behind its name': lambda log: text(
        [HEAD.replace('time [s]', 'Timestamp (UTC)')], cells(log, time=iso)),
    'a title with the names of quantities': lambda log: (text(
        ['Force (N) over contraction (%) and pressure (bar)', 'a;b;c;d;e'],
        [[*r, '0.1'] for r in cells(log)], ';'),
        {'columns': {'time': 'a', 'contraction': 'b [mm]', 'pressure': 'c [kPa]',
                     'force': 'd [N]'}}),
    'millis of a microcontroller': lambda log: text(
        [HEAD.replace('time [s]', 'millis')], cells(log, time=lambda t: f'{1e3 * t:.0f}')),
    'length over rest length': lambda log: text(
        [HEAD.replace('contraction [mm]', 'L/L0')],
        [[r[0], f'{1.0 - float(r[1]) / 250.0:.7f}', *r[2:]] for r in cells(log)]),
    'whole numbers with points for thousands': lambda log: text(
        ['Zeit [ms]\tKontraktion [um]\tDruck [Pa]\tKraft [mN]'], in_groups(log, '.'), '\t'),
    'whole numbers with commas for thousands': lambda log: text(
        ['Time [ms]\tContraction [um]\tPressure [Pa]\tForce [mN]'], in_groups(log, ','), '\t'),
    'apostrophes for thousands': lambda log: text(
        ['Zeit [ms];Kontraktion [um];Druck [Pa];Kraft [mN]'], in_groups(log, "'"), ';'),
    'narrow blanks for thousands, decimal comma': lambda log: text(
        ['Temps [s];Contraction [mm];Pression [Pa];Force [N]'],
        [[*r[:2], group[2], r[3]] for r, group in zip(cells(log, ','), in_groups(log, '\u202f'))],
        ';'),
    'a header of two lines in each cell': lambda log: text(
        ['"Time\n[s]","Contraction\n[mm]","Pressure\n[kPa]","Force\n[N]"'], cells(log)),
    'comments that tell what channels are': lambda log: (text(
        ['# ch1: time, s', '# ch2: contraction, mm', '# ch3: gauge pressure, kPa',
         '# ch4: force, tension positive, N', 'ch1,ch2,ch3,ch4'], cells(log)),
        {'columns': {'time': 'ch1 [s]', 'contraction': 'ch2 [mm]', 'pressure': 'ch3 [kPa]',
                     'force': 'ch4 [N]'}}),
    'a small table beside the first rows': lambda log: text(
        [HEAD + ',,pressure [kPa],largest force [N]'],
        [*([*r, '', '100', '31.5'] for r in cells(log)[:4]), *cells(log)[4:]]),
    'statistics below rows of words': lambda log: text(
        [HEAD], [*cells(log), ['Mean'], ['9.0', '25.0', '250.0', '70.0'],
                 ['Std'], ['5.2', '17.0', '122.0', '51.0']]),
    'a table of sensors below': lambda log: text(
        [HEAD], [*cells(log), ['Sensors'], ['no', 'offset', 'gain', 'range'],
                 ['1', '0.1', '1.0', '500'], ['2', '0.2', '1.1', '10']]),
    'raw beside tared force': lambda log: text(
        [HEAD.replace('force [N]', 'force_raw [N],force_tared [N]')],
        [[*r[:3], f'{float(r[3]) + 12.0:.3f}', r[3]] for r in cells(log)]),
    'LabVIEW .lvm': lambda log: lvm(log, 'One'),
    'LabVIEW .lvm with German numbers': lambda log: lvm(log, 'One', ','),
    'LabVIEW .lvm without times': lambda log: lvm(log, 'No'),
    'LabVIEW .lvm with a clock for each channel': lambda log: lvm(log, 'Multi', ','),
    'LabVIEW .lvm of three segments': lambda log: lvm(log, 'One', segments=3),
}


def lvm(log, clocks, decimal='.', segments=1):
    """Return a LabVIEW measurement file as National Instruments documents it."""
    multi = clocks == 'Multi'

    def line(*values):
        """Return a line of the segment's header: a value for each channel."""
        return '\t'.join([values[0], *('\t\t' if multi else '\t').join(values[1:]).split('\t')])

    head = ['LabVIEW Measurement\t', 'Writer_Version\t2', 'Reader_Version\t2', 'Separator\tTab',
            f'Decimal_Separator\t{decimal}', 'Multi_Headings\tNo', f'X_Columns\t{clocks}',
            'Time_Pref\tRelative', 'Operator\tlab', 'Date\t2026/05/03', 'Time\t12:00:00.0',
            '***End_of_Header***\t']
    for rows in np.array_split(np.array(cells(log, decimal)), segments):
        head += ['\t', 'Channels\t3\t\t\t\t', line('Samples', *[str(len(rows))] * 3),
                 line('Date', *['2026/05/03'] * 3), line('Time', *['12:00:00'] * 3),
                 line('Y_Unit_Label', 'mm', 'kPa', 'N'), line('X_Dimension', *['Time'] * 3),
                 line('X0', *[f'0{decimal}0'] * 3), line('Delta_X', *[f'0{decimal}05'] * 3),
                 '***End_of_Header***\t\t\t\t']
        names = ['Contraction', 'Pressure', 'Force']
        head.append('\t'.join([f'X_Value\t{name}' for name in names] if multi
                              else ['X_Value', *names]) + '\tComment')
        for t, *row in rows:
            head.append('\t'.join([f'{t}\t{cell}' for cell in row] if multi
                                  else [t if clocks == 'One' else '', *row]))
    return '\r\n'.join(head) + '\r\n'


def the_log(muscle):
    """Return the log: three sweeps at 100, 250 and 400 kPa, 20 Hz, as SI arrays."""
    time = 0.05 * np.arange(ROWS)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 6.0)
    pressure = np.repeat([100e3, 250e3, 400e3], ROWS // 3)
    force = muscle(strain, pressure) - 3.0 * np.sign(np.gradient(strain))
    return {'time': time, 'strain': strain, 'pressure': pressure, 'force': np.round(force, 3)}


def same(data, log):
    """Raise where a measurement is not the log."""
    assert len(data) == ROWS
    assert np.allclose(data.strain, log['strain'], atol=2e-6)
    assert np.allclose(data.pressure[:, 0], log['pressure'], rtol=1e-5, atol=1.0)
    assert np.allclose(data.force, log['force'], rtol=1e-5, atol=2e-3)
    assert np.allclose(np.diff(data.time), 0.05, atol=1e-6)
