"""Functions of the public API, for notebooks and the command line.

Every object displays itself in a notebook and in a terminal, returns its numbers as a DataFrame,
names its function and its inputs, and can be computed again with changes. Each function imports
its modules when it is called.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike

    from reproduce.inference import Prior
    from reproduce.physics.attitude import Platform
    from reproduce.views.consistency import ConsistencyAudit
    from reproduce.views.contents import Check, Contents
    from reproduce.views.figure import Figure, Panels
    from reproduce.views.measurements import MisalignmentResult, RegistrationResult
    from reproduce.views.pictures import Stars
    from reproduce.views.posterior import Posterior
    from reproduce.views.posteriors import Posteriors
    from reproduce.views.study import StudyTable
    from reproduce.views.table import Cell, Table


def contents(paper: str | None = None) -> Contents:
    """Return all items of a paper, or of all papers, in their order, with their score.

    Examples
    --------
    >>> contents("niu2024").frame().loc["niu2024/table-1", "input"]
    np.int64(12)
    """
    from reproduce.views.contents import Contents

    return Contents(paper)


def table(address: str) -> Table | Cell | StudyTable:
    """Return a table, a group of quoted numbers, one cell of it, or a supplementary table.

    Parameters
    ----------
    address : str
        A key such as ``niu2024/table-3``, a cell such as ``niu2024/table-3#scale.red``, or a
        study such as ``chen2023/heat``.

    Returns
    -------
    Table, Cell or StudyTable
        Printed next to computed values, with verdicts; a supplementary table has no verdicts.

    Examples
    --------
    >>> table("niu2024/table-2")["scale.red"].verdict
    'exact'
    """
    from reproduce.papers.catalogue import studies
    from reproduce.views.study import StudyTable
    from reproduce.views.table import Cell, Table

    if address in studies():
        return StudyTable(address)
    return Cell(address) if "#" in str(address) else Table(address)


def figure(key: str) -> Figure | Panels:
    """Return a figure by its key.

    Parameters
    ----------
    key : str
        A panel such as ``chen2023/fig-11a``, or all panels of a figure, ``chen2023/fig-11``.

    Returns
    -------
    Figure or Panels
        Drawn when it is looked at.
    """
    from reproduce.papers.catalogue import catalogue
    from reproduce.views.figure import Figure, Panels

    panels = [one for one in catalogue() if one[:-1] == key and one[-1].isalpha()]
    return Panels(key, tuple(map(Figure, panels))) if panels else Figure(key)


def item(address: str) -> Table | Cell | StudyTable | Figure | Panels:
    """Return what an address of the command line names: `table` or `figure`."""
    from reproduce.papers.catalogue import studies
    from reproduce.printed.cells import library
    from reproduce.views.keys import resolved

    address = resolved(address)
    known = address.partition("#")[0]
    return (
        table(address) if known in library() or known in studies() else figure(address)
    )


def check(*keys: str, progress: Callable[[int, int], None] | None = None) -> Check:
    """Recompute and judge items, or everything, and compare the verdicts with the frozen ones.

    Examples
    --------
    >>> bool(check("niu2024/table-2"))
    True
    """
    from reproduce.views.contents import Check

    return Check(keys, progress)


def cite(address: str, form: str = "bibtex") -> str:
    """Return how to cite an item, a cell or a study and its paper: bibtex, ris, csl or text.

    ``all`` is the whole.

    Examples
    --------
    >>> print(cite("niu2024/table-3", "text").splitlines()[1].split(".")[0])
    Yanzhao Niu, Xinguo Wei, and Jian Li
    """
    from reproduce.views.export import citation

    return citation(address, form)


def verify(citation: str) -> str:
    """Compare the citation of a cell with the statement that this package makes now.

    The mark of a citation is a checksum of its statement, which anyone can compute. It protects
    the words against changes. It is no signature, so only statements that this package makes or
    that a stored release made are confirmed.

    Parameters
    ----------
    citation : str
        Citation of a cell from `cite` in the form ``text``, with the mark ``rp:...`` at its end.

    Returns
    -------
    str
        ``unchanged`` if this package makes the statement, and version, day and commit of the
        citation are those of this package or of a stored release.
        ``moved since VERSION: now ...`` if the stored release VERSION made the statement and this
        package makes another one, with the reason for the present verdict.
        ``well-formed, not known to this package: ...`` if words and mark belong together, but
        nothing is known about the version or about the statement.
        ``not ours: ...`` if words and mark do not belong together.

    Raises
    ------
    TypeError
        If the citation is not text.

    Examples
    --------
    >>> verify(cite("niu2024/table-2#scale.red", "text"))
    'unchanged'
    """
    from reproduce.views.export import verify

    return verify(citation)


def posterior(
    name: str | None = None,
    data: str | Path | pd.DataFrame | None = None,
    pivot: tuple[float, float] | None = None,
    priors: Mapping[str, Prior | tuple[float, float]] | None = None,
    *,
    model: str | None = None,
    weights: ArrayLike | None = None,
    source_covariance: ArrayLike | None = None,
    target_covariance: ArrayLike | None = None,
    platform: Platform | str | Path | None = None,
    sep: str | None = None,
    data_seed: int | None = None,
    steps: int | None = None,
    walkers: int | None = None,
    seed: int | None = None,
) -> Posterior | Posteriors:
    """Return a posterior of the book, or the same model on a reader's data; all without a name.

    Parameters
    ----------
    name : str, optional
        Such as ``registration``; ``rp.posterior().models`` names all.
    data : path or table, optional
        Your data, as in `register`. ``rp.posterior().models`` contains the columns.
    pivot : tuple of float, optional
        Principal point of your stars, in px. Default: their mean.
    priors : mapping, optional
        Name of a parameter to the bounds of a uniform prior, or to a prior of
        `reproduce.inference`. All numbers are in the displayed unit of the parameter.
    model : str, optional
        Transform of your stars, as in `register`, for ``registration``. Default: a similarity.
    weights, source_covariance, target_covariance : array_like, optional
        Errors of your stars, as in `register`, for ``registration``.
    platform : Platform or path, optional
        Fiducial lights and tracker of your laser spots, as for `misalignment`.
    sep : str, optional
        Separator of the columns of a text file. Default: a comma.
    data_seed : int, optional
        Seed of the simulated data of the book.
    steps, walkers, seed : int, optional
        Plan of the sampling. Default: the plan of the book.
    """
    if name is None:
        if data is not None:
            raise TypeError(
                "name: expected a model of the data, such as 'registration', got none. Add it"
            )
        from reproduce.views.posteriors import Posteriors

        return Posteriors()
    from reproduce.views.posterior import Posterior

    return Posterior(
        name,
        data=data,
        pivot=pivot,
        priors=priors,
        data_seed=data_seed,
        model=model,
        weights=weights,
        platform=platform,
        source_covariance=source_covariance,
        target_covariance=target_covariance,
        sep=sep,
        steps=steps,
        walkers=walkers,
        seed=seed,
    )


def audit(paper: str | None = None) -> ConsistencyAudit:
    """Return the consistency checks of the printed numbers, and the errata.

    Parameters
    ----------
    paper : str, optional
        Name such as ``chen2023``. Default: all.

    Returns
    -------
    ConsistencyAudit
        Relations between printed numbers, and the errata.
    """
    from reproduce.views.consistency import ConsistencyAudit

    return ConsistencyAudit(paper)


def register(
    source: str | Path | pd.DataFrame | ArrayLike | Stars,
    target: str | Path | ArrayLike | Stars | None = None,
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

    For images, the stars are found and matched first (`stars`, `match`), which needs Astropy and
    photutils.

    Parameters
    ----------
    source : path, table or array_like, shape (n, 2)
        Source stars, in px, x before y. A table contains matched stars, one per row, with the
        columns ``x``, ``y`` (source), ``x_reference``, ``y_reference`` (target), in px. Optional
        columns: ``sigma`` (or ``sigma_x``, ``sigma_y``), the standard deviation of one coordinate
        of the difference, in px; ``weight``; ``mask``, 1 to leave out a star. A table is a
        DataFrame, an Astropy table, a text file with the names in its first line ("-" is standard
        input), or an ECSV, FITS, VOTable or SExtractor file. An image is an array of shape
        (height, width), a `CCDData`, or a FITS file (``field.fits[SCI]`` if it contains several
        images). Also `Stars`. Rows are counted from zero.
    target : array_like, shape (n, 2)
        The same stars in the other image, in px, if `source` is an array of stars. Otherwise an
        image, `Stars`, or a table with the columns ``x`` and ``y``, as in `stars`.
    pivot : array_like, shape (2,), optional
        Pivot of rotation and scale, in px. Default: mean of the source stars, or the middle of an
        image.
    model : {"similarity", "shift", "rigid", "similarity+radial", "affine"}
        What the transform may do.
    robust : bool, optional
        Whether to guard against wrong matches. Default: true for images.
    weights : array_like, shape (n,), optional
        Relative weights of the stars, such as inverse variances; zero drops a star.
    source_covariance, target_covariance : array_like, shape (n, 2, 2) or (2, 2), optional
        Known covariances of the places, in px^2.
    start, radius : optional
        Parameters of `match`, for images and lists.
    threshold : float, optional
        Parameter of `stars`, for images.
    sep : str, optional
        Separator of the columns of a text file, as in `pandas.read_csv`. Default: a comma.

    Returns
    -------
    Registered
        Scale, rotation in radians, positive from x towards y, and shift in px: where the pivot was
        minus where it lands. With covariance, residuals and the transform for other points.

    Raises
    ------
    ValueError
        If the stars do not fix the model, or a parameter or a row of the table is wrong.

    Examples
    --------
    Stars that lie further right by 3 px in the target have the shift -3.

    >>> moved = register([[0, 0], [99, 0], [0, 99]], [[3, 0], [102, 0], [3, 99]])
    >>> moved.parameters.round(9) + 0.0
    array([ 1.,  0., -3.,  0.])
    """
    known = {
        "weights": weights,
        "source_covariance": source_covariance,
        "target_covariance": target_covariance,
    }
    own = {
        "start": start,
        "radius": radius,
        "threshold": threshold,
    }
    images = _has_images(source, target)
    for name, value in (known if images else own).items():
        if value is not None:
            kind = "images or lists" if images else "matched stars"
            raise ValueError(f"{name}: expected none for {kind}, got one. Leave it out")
    if images:
        from reproduce.views.pictures import registered

        own |= {"model": model, "robust": robust is not False, "sep": sep}
        return registered(source, target, pivot, **own)
    from reproduce.views.measurements import RegistrationResult

    known |= {"model": model, "robust": bool(robust), "sep": sep}
    return RegistrationResult(source, target, pivot, **known)


def _has_images(source: Any, target: Any) -> bool:
    """Return whether stars of an image, a file or `Stars` are to be matched."""
    from reproduce.store.images import is_image

    both = [source, target]
    if target is not None and all(isinstance(one, str | Path) for one in both):
        return True
    return any(is_image(one) or hasattr(one, "rejected") for one in both)


def stars(
    source: str | Path | ArrayLike | pd.DataFrame,
    *,
    threshold: float | None = None,
    sep: str | None = None,
) -> Stars:
    """Find the stars of an image, with Astropy and photutils.

    Parameters
    ----------
    source : path, table or array_like, shape (height, width) or (n, 2)
        FITS file (``field.fits[SCI]`` if it contains several images), array, masked array or
        `CCDData`, whose mask and uncertainty apply. Also a list of stars in any order: an array of
        shape (n, 2), or a table as in `register` with the columns ``x`` and ``y``, in px. Optional
        columns are ``flux`` or ``mag`` (brighter stars have a lower magnitude), by which `match`
        selects stars, ``sigma`` (or ``sigma_x``, ``sigma_y``), in px, and ``weight``.
    threshold : float, optional
        Detection threshold, in standard deviations of the noise. Default: 5.
    sep : str, optional
        Separator of the columns of a text file. Default: a comma.

    Returns
    -------
    Stars
        Centres with covariance, and what was dropped and why.

    Raises
    ------
    ValueError
        If the image cannot be read or contains no stars.
    """
    from reproduce.views.pictures import stars_of

    return stars_of(source, threshold, sep)


def match(
    source: Any, target: Any, start: Any = None, radius: float | None = None
) -> pd.DataFrame:
    """Match the stars of two images or lists.

    Shifts are tried first, then triangles of the brightest stars, then triangles of the most
    isolated stars. Four common stars suffice if they agree to their errors. Matches that are not
    better than by chance are rejected.

    Parameters
    ----------
    source, target : Stars, or any `source` of `stars`
        Both images or lists, in any order of rows.
    start : Registration, Registered or array_like, shape (4,), optional
        Rough transform, under which the stars of a pair are neighbours. An array contains scale,
        rotation in radians and shift in px about the middle of the image, or the mean of the stars
        of a list, as in ``register(...).parameters``. Default: found from the stars.
    radius : float, optional
        Largest distance between the stars of a pair, in px. Default: 2 px and 1/1000 of the field.

    Returns
    -------
    DataFrame
        Pairs in the columns of `register`, with the rows of both stars. Its ``attrs`` contain
        ``mirrored``, whether the images mirror each other.

    Raises
    ------
    ValueError
        If a list has fewer than four stars, or the stars do not agree better than by chance.

    Examples
    --------
    >>> import numpy as np
    >>> target = np.array([[10.0, 20], [400, 30], [250, 300], [90, 410]])
    >>> match(target[::-1] - (5, 0), target)["row_reference"].tolist()
    [3, 2, 1, 0]
    """
    from reproduce.views.pictures import paired, stars_of

    return paired(stars_of(source), stars_of(target), start, radius)[0]


def misalignment(
    spots: str | Path | pd.DataFrame | ArrayLike,
    zero: ArrayLike | None = None,
    platform: Platform | str | Path | None = None,
    times: ArrayLike | None = None,
    *,
    sep: str | None = None,
) -> MisalignmentResult:
    """Return the misalignment of your camera since the zero point, from spots of its lights.

    ``findings`` names a displaced light, a pattern of another size, repeated images and correlated
    images. Correlated images and a chi-square above 1 widen the standard errors.

    Parameters
    ----------
    spots : path or array_like, shape (frames, lights, 2)
        Images at the present, in px; or both groups as a DataFrame or a CSV file ("-" is standard
        input), one spot per row, with the columns ``group`` (0 at the zero point, 1 at the
        present), ``laser``, ``x``, ``y``, and if wanted ``frame`` (a number that the spots of an
        image share; without it no spot may be lost), ``time`` and ``mask`` (1 drops a row). A spot
        that is NaN or masked in an array is lost; its image counts less.
    zero : array_like, shape (frames, lights, 2), optional
        Images at the zero point, if `spots` is an array.
    platform : Platform or path, optional
        The lights and the tracker, or a TOML file of the arguments that make one; chen2023's ground
        platform as designed by default.
    times : array_like, shape (frames,), optional
        Times of the images at the present, in any unit, if `spots` is an array. They give
        ``over_time()``, drift and averages, and ``stability``, its numbers.
    sep : str, optional
        Separator of the columns of a text file. Default: a comma.

    Returns
    -------
    Monitored
        Angles about the camera's axes, image by image.

    Raises
    ------
    ValueError
        If the spots are mirrored or belong to another platform, two lights are swapped or have one
        place, or a group has fewer than two lights.
    """
    from reproduce.views.measurements import MisalignmentResult

    return MisalignmentResult(
        spots=spots, zero=zero, platform=platform, times=times, sep=sep
    )
