# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A log as instruments, controllers and databases export it: `INSTRUMENTS`, as `TEXTS`."""

from .text_forms import cells, text

INSTRUMENTS = {
    'Japanese names and units in Shift-JIS': lambda log: text(
        ['時刻,変位,圧力,荷重', '秒,ミリ,キロパスカル,ニュートン'], cells(log)).encode('cp932'),
    'Chinese names in GBK': lambda log: text(
        ['时间(s),收缩量(mm),压力(kPa),拉力(N)'], cells(log)).encode('gbk'),
    'full-width brackets': lambda log: text(
        ['時間（秒）,収縮率（％）,圧力（kPa）,張力（N）'],
        [[r[0], f'{float(r[1]) / 2.5:.6f}', *r[2:]] for r in cells(log)]),
}
