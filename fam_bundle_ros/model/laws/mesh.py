# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The ideal braid: conversion of gas pressure to tension."""

from fam_bundle_ros.model.laws.base import law


@law('force', family='mesh', candidate=False, look=('blue', 'solid'),
     summary='ideal braid of inextensible threads (virtual work of the gas)',
     source='Chou and Hannaford 1996, IEEE T-RA 12(1)',
     signature='the model has no pressure-driven force at all')
def mesh(pressure, stretch, braid, area, cot2, sin2):
    """F = pi r0^2 P (3 l^2/tan^2 a0 - B/sin^2 a0), B = 1 for threads that do not stretch."""
    return area * pressure * (3.0 * stretch * stretch * cot2 - braid / sin2)
