# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A figure with what a reader needs beside it."""

from dataclasses import dataclass
from typing import Any

__all__ = ['Picture']


@dataclass(frozen=True)
class Picture:
    """
    A drawing with its title and caption.

    Attributes
    ----------
    key : str
        Short name: the anchor on a page, the key in JSON.
    title : str
        What is shown, and where in the paper, if it is.
    drawing : plotly.graph_objects.Figure
    caption : str
        Where each curve comes from, and what to see.
    """

    key: str
    title: str
    drawing: Any
    caption: str
