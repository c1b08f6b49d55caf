"""Conversion factors of angles. The package computes in radians."""

from __future__ import annotations

from math import pi

ARCSEC_PER_RADIAN = 180 * 3600 / pi
RADIANS_PER_ARCSEC = pi / 180 / 3600
DEGREES_PER_RADIAN = 180 / pi
