"""Conversion factors of angles. The package computes in radians."""

from __future__ import annotations

from math import pi

ARCSEC_PER_RADIAN = 180 * 3600 / pi
RADIANS_PER_ARCSEC = pi / 180 / 3600
ARCMIN_PER_RADIAN = 180 * 60 / pi
DEGREES_PER_RADIAN = 180 / pi
