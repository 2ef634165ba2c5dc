# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Encoding of a text file, by its byte order mark or by its bytes."""

import codecs
from pathlib import Path
import re

_BOMS = ((codecs.BOM_UTF8, 'utf-8-sig'), (codecs.BOM_UTF32_LE, 'utf-32'),
         (codecs.BOM_UTF32_BE, 'utf-32'), (codecs.BOM_UTF16_LE, 'utf-16'),
         (codecs.BOM_UTF16_BE, 'utf-16'))


def encoding_of(path: Path) -> str:
    """Return the encoding by the byte order mark, else by what the first MB can be."""
    with open(path, 'rb') as stream:
        head = stream.read(1 << 20)
    for mark, name in _BOMS:
        if head.startswith(mark):
            return name
    for offset, name in ((1, 'utf-16-le'), (0, 'utf-16-be')):
        if len(head) > 8 and head[offset:4096:2].count(0) > 0.4 * len(head[offset:4096:2]):
            return name
    return 'utf-8' if _decodes(head, 'utf-8') else _of_bytes(head)


def _decodes(head: bytes, name: str) -> bool:
    """Return whether bytes are text of an encoding; the last letter may be cut."""
    try:
        codecs.getincrementaldecoder(name)().decode(head)
    except UnicodeDecodeError:
        return False
    return True


def _of_bytes(head: bytes) -> str:
    """
    Return the encoding of text that is not UTF-8: of Japanese or Chinese, else Latin-1.

    In European text bytes above ASCII stand alone between letters, and hardly one is of 0x80 to
    0x9f; in Japanese and Chinese they stand side by side.
    """
    runs = re.findall(rb'[\x80-\xff]+', head)
    above, low = sum(map(len, runs)), len(re.findall(rb'[\x80-\x9f]', head))
    pairs = all(len(run) % 2 == 0 for run in runs)
    name = 'cp932' if low > 0.2 * above else 'gb18030' if pairs else ''
    side_by_side = above > 2 * len(runs)
    return name if name and side_by_side and _decodes(head, name) else 'cp1252'
