"""Angle factors, both ways round. Everything inside is in radians; these convert at the edges."""

from __future__ import annotations

from math import pi

__all__ = ["ARCMIN_PER_RADIAN", "ARCSEC_PER_RADIAN", "DEGREES_PER_RADIAN", "RADIANS_PER_ARCSEC"]

ARCSEC_PER_RADIAN = 180 * 3600 / pi
RADIANS_PER_ARCSEC = pi / 180 / 3600
ARCMIN_PER_RADIAN = 180 * 60 / pi
DEGREES_PER_RADIAN = 180 / pi
