"""What one replicate of the simulation yields, and the ways in which its RMSE can count the axes.

Arrays end with an axis of numbers; parameters are in radians and px, residuals in px.
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.validate import FloatArray

# Ways to count the axes: (26) as it stands first.
COUNTED = ("both axes", "one axis on average", "x alone", "y alone")
PARAMETERS = ("scale", "rotation", "translation-x", "translation-y")
# What one replicate of one channel yields, in this order, and what is printed of it.
MEASURED = (*PARAMETERS, "rmse-before-x", "rmse-before-y", "rmse-after-x", "rmse-after-y")
CELLS = (*PARAMETERS, "rmse-before", "rmse-after")
# All that the ways of counting need, but for the root of two between both axes and their average.
SUMMARISED = (*MEASURED, "rmse-before", "rmse-after")


def summarised(measured: FloatArray) -> FloatArray:
    """Return draws with the RMSE of both axes together beside those of each.

    Shape (..., 10). Numbers as in `SUMMARISED`.

    Examples
    --------
    >>> summarised(np.array([1.0, 0, 0, 0, 3, 4, 6, 8]))[-2:]
    array([ 5., 10.])
    """
    both = np.hypot(measured[..., 4::2], measured[..., 5::2])
    return np.concatenate([measured, both], axis=-1)


def quantiles_counted(summaries: FloatArray, way: str) -> FloatArray:
    """Return quantiles of the printed numbers, the axes counted in one way.

    Shape (..., 6). Quantiles of the numbers of `CELLS`.

    Examples
    --------
    >>> quantiles_counted(np.arange(10.0), "y alone")
    array([0., 1., 2., 3., 5., 7.])
    """
    if way not in COUNTED:
        raise ValueError(f"way: expected one of {COUNTED}, got {way!r}")
    taken = [(8, 9), (8, 9), (4, 6), (5, 7)][COUNTED.index(way)]
    residuals = summaries[..., list(taken)]
    if way == COUNTED[1]:
        residuals = residuals * np.sqrt(0.5)
    return np.concatenate([summaries[..., :4], residuals], axis=-1)


def counted(measured: FloatArray, way: str) -> FloatArray:
    """Return the printed numbers of draws, the axes counted in one way.

    Shape (..., 6). Numbers as in `CELLS`.

    Examples
    --------
    >>> counted(np.array([1.0, 0, 0, 0, 3, 4, 6, 8]), "both axes")
    array([ 1.,  0.,  0.,  0.,  5., 10.])
    """
    if way not in COUNTED:
        raise ValueError(f"way: expected one of {COUNTED}, got {way!r}")
    x, y = measured[..., 4::2], measured[..., 5::2]
    both = np.hypot(x, y)
    residuals = dict(zip(COUNTED, (both, both * np.sqrt(0.5), x, y), strict=True))[way]
    return np.concatenate([measured[..., :4], residuals], axis=-1)
