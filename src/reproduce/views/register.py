"""Registration of your stars or images."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from reproduce.physics.validate import without_none
from reproduce.store.files import FilePath
from reproduce.store.images import is_image
from reproduce.views.measurements import RegistrationResult

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.views.pictures import Stars

# Arguments for matched stars only, and for images and lists only.
_FOR_STARS = {"weights", "source_covariance", "target_covariance"}
_FOR_IMAGES = {"start", "radius", "threshold"}


def register(
    source: FilePath | pd.DataFrame | Mapping[str, Any] | ArrayLike | Stars,
    target: FilePath | Mapping[str, Any] | ArrayLike | Stars | None = None,
    pivot: ArrayLike | None = None,
    *,
    model: str = "similarity",
    robust: bool | None = None,
    weights: ArrayLike | None = None,
    source_covariance: ArrayLike | None = None,
    target_covariance: ArrayLike | None = None,
    start: Any = None,
    radius: float | None = None,
    threshold: float | None = None,
    sep: str | None = None,
) -> RegistrationResult:
    """Fit the transform that maps source stars onto the same stars of a target.

    A source position p maps to ``pivot - shift + scale R(rotation) (p - pivot)``. Positions are in
    px, x before y, and the centre of the first pixel is (0, 0). Two arrays are matched by row. The
    stars of images and of separate lists are matched first, with `match`; images also need Astropy
    and photutils.

    Without errors or weights, all stars have the same Gaussian noise, which follows from the
    residuals. With ``sigma`` or covariances, the noise is known, and the result compares
    chi-square with it. The fit includes no distortion, except for two models: "affine", and
    "similarity+radial" with a cubic term about the pivot.

    Parameters
    ----------
    source : path, table or array_like, shape (n, 2)
        Source stars, in px. A table contains one matched star per row in the columns ``x``, ``y``
        (source), ``x_reference``, ``y_reference`` (target). Optional columns: ``sigma`` (or
        ``sigma_x``, ``sigma_y``), the standard deviation of one coordinate of target minus source,
        in px; ``weight``, 0 to leave out a star. With errors, a weight is 0 or 1. A table is a
        DataFrame, a dict of columns, an Astropy table, a text file with the names in its first line
        ("-" is standard input), or an ECSV, FITS, VOTable or SExtractor file. An image is an array
        of shape (height, width), a `CCDData`, or a FITS file (``field.fits[SCI]`` if it contains
        several images). The result of `stars` is accepted too.
    target : array_like, shape (n, 2)
        The same stars in the other image, in the order of the source, if `source` is an array of
        stars. Otherwise an image, the result of `stars`, or a table with the columns ``x`` and
        ``y``, in any order of rows. Two tables that are not files are matched by row, without
        columns of errors. Default: the columns of `source`.
    pivot : array_like, shape (2,), optional
        Centre of rotation and scale, in px. Default: mean of the source stars, or the middle of an
        image.
    model : {"similarity", "shift", "rigid", "similarity+radial", "affine"}
        Type of the transform. A similarity has a scale, a rotation and a shift, and "rigid" has no
        scale.
    robust : bool, optional
        Whether to reject stars that do not fit the others. Default: true for images.
    weights : array_like, shape (n,), optional
        Relative weights of the stars, such as inverse variances. Zero drops a star. With
        errors, a weight is 0 or 1.
    source_covariance, target_covariance : array_like, shape (n, 2, 2) or (2, 2), optional
        Known covariances of the positions, in px^2.
    start, radius : optional
        Parameters of `match`, for images and separate lists.
    threshold : float, optional
        Parameter of `stars`, if both are images.
    sep : str, optional
        Separator of the columns of a text file, as in `pandas.read_csv`. Default: a comma.

    Returns
    -------
    RegistrationResult
        ``parameters`` in the order of ``fit.names``: scale, rotation in radians (positive from x
        towards y) and shift in px. ``interval()``: their confidence intervals of 95 %, by Student's
        t-distribution if the noise is unknown. ``covariance``, ``residuals`` (target minus
        registered source), ``transform.apply(points)`` for other points, and ``remarks``: warnings
        such as wrong matches, distortion or an unlikely chi-square, with the cure.

    Raises
    ------
    ValueError
        If the stars are too few or collinear, if no match is better than by chance, or if a
        parameter or a row of a table is wrong.

    Notes
    -----
    Implements: niu2024 (17).

    Examples
    --------
    Stars that are further right by 3 px in the target have the shift -3.

    >>> moved = register([[0, 0], [99, 0], [0, 99]], [[3, 0], [102, 0], [3, 99]])
    >>> [round(float(value), 9) for value in moved.parameters[:3]]
    [1.0, 0.0, -3.0]
    """
    if source is None:
        raise TypeError(
            "source: expected stars or an image, got None. Pass a table, an array or a file"
        )
    arguments = without_none(locals())
    pair = source, target
    # Stars must be found or matched in a file of one image, an image, or a result of `stars`.
    separate = any(
        is_image(one)
        or hasattr(one, "rejected")
        or (isinstance(one, FilePath) and target is not None)
        for one in pair
    )
    if separate and target is None:
        raise ValueError("target: expected another image or list, got none. Pass both")
    for name in arguments.keys() & (_FOR_STARS if separate else _FOR_IMAGES):
        kind = "images or lists" if separate else "matched stars"
        raise ValueError(f"{name}: expected none for {kind}, got one. Leave it out")
    if separate:
        from reproduce.views.pictures import PairedRegistration  # it is slow

        result: RegistrationResult = PairedRegistration(**arguments)
    else:
        result = RegistrationResult(**arguments)
    result.call = partial(register, **arguments)
    return result
