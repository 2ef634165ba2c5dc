# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A log as instruments, controllers and databases export it: `INSTRUMENTS`, as `TEXTS`."""

from datetime import timedelta

from .text_forms import BEGIN, cells, HEAD, iso, text

#: What oscilloscopes and amplifiers name channels, and what a volt is worth.
VOLTS = {'contraction': 'CH1 * 10 mm', 'pressure': 'CH2 * 100 kPa', 'force': 'CH3 * 50 N'}


def volts(log):
    """Return the rows in V: contraction, pressure, force."""
    return [[f'{float(cell) / worth:.8g}' for cell, worth in zip(row[1:], (10, 100, 50))]
            for row in cells(log)]


def twincat(log, names, unit):
    """Return an export of TwinCAT Scope: a head of pairs, a time in ms beside each channel."""
    keys = {'Name': names, 'SymbolComment': ['', '', ''], 'Data-Type': ['REAL64'] * 3,
            'SampleTime[ms]': ['50'] * 3, 'SymbolName': [f'MAIN.{name}' for name in names],
            'Port': ['851'] * 3, 'Offset': ['0'] * 3, 'Unit': unit, 'Unit ScaleFactor': ['1'] * 3,
            'Unit Offset': ['0'] * 3}
    return text(
        ['Name\tYT Scope Project', 'Starttime of export\t133546329421200000\tMonday', '',
         *('\t'.join(f'{key}\t{value}' for value in values) for key, values in keys.items()), ''],
        [[cell for value in row[1:] for cell in (f'{1e3 * float(row[0]):.0f}', value)]
         for row in cells(log)], '\t')



def readings(log, names, time=lambda t: f'{t:.3f}'):
    """Return a row for each reading: time, name, value, in the order of time."""
    return [[row[0], name, value] for row in cells(log, time=time)
            for name, value in zip(names, row[1:])]


def wincc(log):
    """Return an archive of WinCC: whole seconds, the clock in millionths of a day beside them."""
    names = ('Contraction_mm', 'Pressure_kPa', 'Force_N')
    rows = [[f'"{name}"', f'"{stamp:%d.%m.%Y %H:%M:%S}"', value.replace('.', ','), '1',
             f'{1e6 * (45362.0 + t / 86400.0):.6f}'.replace('.', ',')]
            for t, stamp, row in zip(log['time'], stamps(log), cells(log))
            for name, value in zip(names, row[1:])]
    return text(['"VarName";"TimeString";"VarValue";"Validity";"Time_ms"'],
                [['"$RT_OFF$"', '"03.05.2026 23:59:40"', '0', '2', '45361999900,0'], *rows], ';')


def stamped_rows(log):
    """Return rows as of a ROS message: seconds, nanoseconds, frame, readings."""
    moments = [1710152142_900000000 + round(1e9 * t) for t in log['time']]
    return [[str(moment // 10**9), str(moment % 10**9), 'base', *row[1:]]
            for moment, row in zip(moments, cells(log))]


def stamps(log):
    """Return the times as datetimes."""
    return [BEGIN + timedelta(seconds=float(t)) for t in log['time']]


def influx(log, tables):
    """Return annotated CSV of InfluxDB: a signal after the other, in tables or in one."""
    notes = ['#group,false,false,false,false,true', '#default,_result,,,,',
             '#datatype,string,long,dateTime:RFC3339,double,string',
             ',result,table,_time,_value,_field']
    lines = []
    for k, name in enumerate(('contraction_mm', 'pressure_kPa', 'force_N')):
        lines += notes if tables or not k else []
        lines += [f',,{k},{row[0]}Z,{row[1 + k]},{name}' for row in cells(log, time=iso)]
        lines += [''] if tables else []
    return text(lines, [], end='\r\n')


INSTRUMENTS = {
    'Japanese names and units in Shift-JIS': lambda log: text(
        ['時刻,変位,圧力,荷重', '秒,ミリ,キロパスカル,ニュートン'], cells(log)).encode('cp932'),
    'Chinese names in GBK': lambda log: text(
        ['时间(s),收缩量(mm),压力(kPa),拉力(N)'], cells(log)).encode('gbk'),
    'full-width brackets': lambda log: text(
        ['時間（秒）,収縮率（％）,圧力（kPa）,張力（N）'],
        [[r[0], f'{float(r[1]) / 2.5:.6f}', *r[2:]] for r in cells(log)]),
    'TwinCAT Scope': lambda log: twincat(
        log, ['Contraction', 'Pressure', 'Force'], ['mm', 'kPa', 'N']),
    'TwinCAT Scope without units': lambda log: (
        twincat(log, ['lrPos', 'lrPt', 'lrLc'], ['(None)'] * 3),
        {'columns': {'contraction': 'lrPos [mm]', 'pressure': 'lrPt [kPa]',
                     'force': 'lrLc [N]'}}),
    'a Rigol oscilloscope': lambda log: (text(
        ['X,CH1,CH2,CH3,Start,Increment,', 'Sequence,Volt,Volt,Volt,-1.5e+00,5.0e-02'],
        [[str(k), *row, ''] for k, row in enumerate(volts(log))]), {'columns': VOLTS}),
    'a Rigol oscilloscope with the increment in its head': lambda log: (text(
        ['Time(s),CH1(V),CH2(V),CH3(V),t0 = -6.0s, tInc = 5.0E-02s,'],
        [['', *row, '', ''] for row in volts(log)]), {'columns': VOLTS}),
    'a Siglent oscilloscope': lambda log: (text(
        ['Record Length,Analog:360', 'Sample Interval,Analog:0.05', 'Horizontal Units,s',
         'Horizontal Scale,2', 'Source,CH1,CH2,CH3', 'Second,Volt,Volt,Volt'],
        [[r[0], *row] for r, row in zip(cells(log), volts(log))]), {'columns': VOLTS}),
    'NI SignalExpress': lambda log: (text(
        ['channel names: ', 'CH1\tCH2\tCH3\t', 'start times: ',
         '\t'.join(3 * ['11.03.2024 10:15:42.120']), 'dt: ', '\t'.join(3 * ['0.050000']),
         'data: '], volts(log), '\t'), {'columns': VOLTS}),
    'settings and statistics beside their names above the data': lambda log: text(
        ['Name;Zeit;Weg;Druck;Kraft', 'Einheit;s;mm;kPa;N', 'Kommentar;;LVDT;SDE1;U9C',
         'Länge;360;360;360;360', 'Minimum;0;0;100;-3', 'Maximum;17,95;50;400;900'],
        [['', *row] for row in cells(log, ',')], ';'),
    'the last name of the head beside the first row': lambda log: text(
        ['trace_name,Time,Contraction,Pressure,Force', 'unit,s,mm,kPa,N'],
        [['' if k else 'trace_values', *row] for k, row in enumerate(cells(log))]),
    'an archive of WinCC': wincc,
    'InfluxDB, a table': lambda log: influx(log, False),
    'InfluxDB, a table for each field': lambda log: influx(log, True),
    'pandas.melt': lambda log: text(['t,variable,value'], sorted(
        readings(log, ('contraction_mm', 'pressure_kPa', 'force_N')), key=lambda row: row[1])),
    'tags that are told, and one of words': lambda log: (text(
        ['Timestamp;Tag;Value;Quality'], [
            *([*row, 'Good'] for row in readings(log, ('R1.POS', 'R1.PT', 'R1.LC'), iso)),
            [iso(0.0), 'R1.VALVE', 'OPEN', 'Good'], [iso(9.0), 'R1.VALVE', 'SHUT', 'Good']], ';'),
        {'columns': {'contraction': 'R1.POS [mm]', 'pressure': 'R1.PT [kPa]',
                     'force': 'R1.LC [N]'}}),
    'names and units of a reading in columns': lambda log: text(
        ['time [s],what,unit,reading'],
        [[*row[:2], {'contraction': 'mm', 'pressure': 'kPa', 'force': 'N'}[row[1]], row[2]]
         for row in readings(log, ('contraction', 'pressure', 'force'))]),
    'seconds and nanoseconds of ROS messages': lambda log: (text(
        ['header.stamp.sec,header.stamp.nanosec,header.frame_id,x,p,f'], stamped_rows(log)),
        {'columns': {'contraction': 'x [mm]', 'pressure': 'p [kPa]', 'force': 'f [N]'}}),
    'ros2 topic echo --csv': lambda log: (text([], stamped_rows(log)), {
        'columns': {'contraction': '4 [mm]', 'pressure': 'column 5 [kPa]', 'force': '6 [N]'}}),
    'durations of pandas': lambda log: text(
        ['elapsed,contraction_mm,pressure_kPa,force_N'],
        cells(log, time=lambda t: f'0 days 00:00:{t:09.6f}')),
    'a Yokogawa recorder': lambda log: text(
        ['"Model","DL850"', '"BlockNumber",1', '"TraceName","Contraction","Pressure","Force"',
         '"BlockSize",360,360,360', '"VUnit","mm","kPa","N"', '"SampleRate",20,20,20',
         '"HResolution",0.05,0.05,0.05', '"HOffset",0,0,0', '"HUnit","s","s","s"',
         '"Date","2024/03/11"', '"Time","10:15:42.12"', ''],
        [['', *row[1:]] for row in cells(log)]),
    'a Graphtec logger': lambda log: text(
        ['Vendor,GRAPHTEC Corporation', 'AMP settings', 'CH,Signal name,Input,Range,Span',
         'CH1,"Contraction",DC,10V,+50.000,+0.000,mm', 'Data',
         'Number,Date&Time,ms,CH1,CH2,CH3,Alarm1-10', 'NO.,Time,ms,mm,kPa,N,A1234567890'],
        [[str(k), f'{stamp:%Y/%m/%d %H:%M:%S}', f'{stamp.microsecond // 1000}', *row[1:],
          'LLLLLLLLLL'] for k, (stamp, row) in enumerate(zip(stamps(log), cells(log)))]),
    'a clock for each channel, units and sensors below': lambda log: text(
        ['Time,Contraction,Time,Pressure,Time,Force', 's,mm,s,kPa,s,N',
         'clock,LVDT,clock,SDE1,clock,U9C'],
        [[row[0], row[1], row[0], row[2], row[0], row[3]] for row in cells(log)]),
    'a clock for each channel, told by its header': lambda log: (text(
        ['Time (s),Contraction (mm),Time (s),Pressure (kPa),Time (s),Force (N)'],
        [[row[0], row[1], row[0], row[2], row[0], row[3]] for row in cells(log)]),
        {'columns': {'time': 'Time (s)'}}),
    'the newest row first': lambda log: text([HEAD], cells(log)[::-1]),
    'one reading per row, the newest first': lambda log: text(
        ['_time,_field,_value'],
        readings(log, ('contraction_mm', 'pressure_kPa', 'force_N'), iso)[::-1]),
    'units alone above the data': lambda log: text(['s,mm,kPa,N'], cells(log)),
    'events beside the first rows': lambda log: text(
        ['Event,' + HEAD], [[{0: 'start', 1: 'fill'}.get(k, ''), *row]
                            for k, row in enumerate(cells(log))]),
    'write.table of R, without a name for the row names': lambda log: text(
        [HEAD.replace(' ', '').replace(',', '\t')],
        [[str(k), *row] for k, row in enumerate(cells(log), 1)], '\t'),
    'write.table of R, quoted, between blanks': lambda log: text(
        ['"t_s" "contraction_mm" "p_kPa" "F_N"'],
        [[f'"{k}"', *row] for k, row in enumerate(cells(log), 1)], ' '),
    'names of levels and of the index, as pandas writes a pivot': lambda log: text(
        [',value,value,value', 'signal,contraction_mm,pressure_kPa,force_N', 'time_s,,,'],
        cells(log)),
    'row names of R beside remarks that are mostly blank': lambda log: text(
        ['t / s;contraction / mm;p / kPa;F / N;remark'],
        [[str(k), *row, 'valve' if k == 3 else ''] for k, row in enumerate(cells(log), 1)], ';'),
    'units of other things in the row of units': lambda log: text(
        ['p_kPa;F;T;t;remark;contraction', ';kN;°C;;;'],
        [[row[2], f'{float(row[3]) / 1e3:.6f}', '21.5', row[0], '',
          f'{float(row[1]) / 250.0:.8f}'] for row in cells(log)], ';'),
    'a row of units that begins with %': lambda log: text(
        ['contraction,t,p,F', '%,s,kPa,N'],
        [[f'{float(row[1]) / 2.5:.6f}', row[0], *row[2:]] for row in cells(log)]),
}
