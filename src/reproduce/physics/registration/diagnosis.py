"""What is doubtful in the stars of a registration, and what cures it.

One diagnosis for arrays, frames and files: wrong matches, another model, another unit, repeats,
stars in a line, rounding. Image points have shape (n, 2), in px, as in `fit`.

A star is suspect where it does not fit the others, by the F law of its residual, so that one field
in a thousand of right matches names any; how many stars there are is counted in. Before stars are
called wrong the model is: a richer one that fits the same stars better than chance allows, by the
F law of both sums of squares, is the cure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import validate
from reproduce.physics.registration._least_squares import thinned
from reproduce.physics.registration.fit import (
    _ALARM,
    _MEDIAN_LENGTH,
    RegistrationFit,
    fit_registration,
)
from reproduce.physics.registration.transforms import MODELS
from reproduce.physics.validate import Finding, FloatArray

# Residuals below this share of the coordinates are rounding.
_ROUNDING = 1e-11
# The chance that a richer model is named where the fitted one is right.
_BETTER = 1e-4
# Models that can do all that one does, and more.
_RICHER = {
    "shift": ("rigid", "similarity", "similarity+radial", "affine"),
    "rigid": ("similarity", "similarity+radial", "affine"),
    "similarity": ("similarity+radial", "affine"),
    "similarity+radial": (),
    "affine": (),
}
_CALLED = {"similarity+radial": "similarity with a radial term"}
# Models are compared by so many stars at most: more would tell a gain that no star shows.
_COMPARED = 8_000
# Fewer stars tell one wrong match of a robust fit, not two.
_FEW = 8
# Fewer degrees of freedom of the others tell no star to be wrong.
_LEAST = 4
# Stars that span less, in px, are perhaps in another unit, as are those so many times apart.
_SMALL, _APART = 50.0, 20.0
# A pivot further away, in fields, takes the digits of the shift.
_FURTHEST = 100.0
# Stars whose width is a smaller share of their length lie in a line.
_THIN = 1e-3
# Most decimals that coordinates are looked at for. Rounded stars that the transform moves apart by
# less than `_STILL` of the last one, more than `_TIED` of them alike, hide their noise in it.
_DECIMALS, _STILL, _TIED = 9, 0.5, 0.1
# Fewer stars than this share no digits by more than chance.
_ALIKE = 10

_Named = Callable[[Sequence[int]], str]


def fits_exactly(fit: RegistrationFit, source: FloatArray, target: FloatArray) -> bool:
    """Whether what a fit leaves of the points that count, (n, 2), is rounding.

    Parameters
    ----------
    fit : RegistrationFit
        Of one set of stars.
    source, target : ndarray, shape (n, 2)
        What was fitted, in px.

    Returns
    -------
    bool

    Examples
    --------
    >>> square = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> fits_exactly(fit_registration(square, square + 1 / 3, (0, 0)), square, square + 1 / 3)
    True
    """
    largest = max(float(np.abs(one).max()) for one in (source, target, fit.transform.pivot))
    return float(np.abs(fit.residuals[fit.weights > 0]).max()) < _ROUNDING * largest


def checked_pivot(pivot: ArrayLike, points: FloatArray) -> FloatArray:
    """Return the pivot as an array; one that takes the digits of the shift is refused.

    Parameters
    ----------
    pivot : array_like, shape (2,), in px
    points : ndarray, shape (n, 2), in px

    Returns
    -------
    ndarray, shape (2,), in px

    Raises
    ------
    ValueError
        If it is further from the stars than a hundred fields.

    Examples
    --------
    >>> checked_pivot((1, 2), np.array([[0.0, 0], [9, 9]]))
    array([1., 2.])
    """
    pivot = validate.number_array("pivot", pivot, shape=(2,))
    away = float(np.abs(points.mean(axis=0) - pivot).max())
    field = float(np.ptp(points, axis=0).max())
    # Of stars in one place their number is to be told, or that they coincide.
    if field and not away <= _FURTHEST * field:
        raise ValueError(
            f"pivot: expected a point within {_FURTHEST:g} fields of the stars, got "
            f"{pivot[0]:g}, {pivot[1]:g}; give the channel's principal point, in px"
        )
    return pivot


def diagnose(
    source: FloatArray,
    target: FloatArray,
    pivot: ArrayLike,
    named: _Named = lambda rows: f"rows {', '.join(map(str, rows))}",
    fit: RegistrationFit | None = None,
    **settings: Any,
) -> list[Finding]:
    """Return what is doubtful in the stars of a registration.

    Parameters
    ----------
    source, target : ndarray, shape (n, 2)
        The same stars in both images, in px.
    pivot : array_like, shape (2,)
        As in `fit_registration`, in px.
    named : callable
        Turns rows into words: "lines 3, 4".
    fit : RegistrationFit, optional
        The same with these settings, where it is made already.
    **settings
        Those of `fit_registration`: model, robust, weights, covariances.

    Returns
    -------
    list of Finding
        Empty where nothing is doubtful.

    Raises
    ------
    ValueError
        If the stars cannot be fitted.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [90, 0], [0, 90], [90, 90]])
    >>> [one.kind for one in diagnose(square, square + 1 / 3, (0, 0))]
    ['exact']
    """
    settings = {"model": "similarity", "robust": False, **settings}
    fit = fit or fit_registration(source, target, pivot, **settings)
    exact = fits_exactly(fit, source, target)
    told = "" if exact else rounded(np.hstack([source, target]))
    found = [*_units(source, target, fit), *_repeated(source, target, named), *_line(source)]
    found += _errors(fit) if fit.errors_known else _size(fit, exact)
    if told:
        found.append(Finding("rounded", f"{told}: their noise is lost in the rounding"))
    if exact or told:
        return found + _dropped(fit, settings, named)
    return found + _misfits(source, target, pivot, named, settings, fit)


def _misfits(
    source: FloatArray,
    target: FloatArray,
    pivot: ArrayLike,
    named: _Named,
    settings: dict[str, Any],
    fit: RegistrationFit,
) -> list[Finding]:
    """Say what does not fit: the model, or single stars, or both."""
    model, found = settings["model"], []
    if better := _better_model(source, target, pivot, **settings):
        model = better[0]
        found.append(Finding("model", better[1]))
    if settings["robust"] and not found:
        return _dropped(fit, settings, named)
    if not found and _none_far(fit, settings):
        return found
    off = _wrong_matches(source, target, pivot, **settings | {"model": model})
    suspects = np.flatnonzero(off)
    rows = tuple(suspects[np.argsort(-off[suspects])].tolist())
    if rows:
        of = f" of the {_CALLED.get(model, model)}" if found else ""
        text = (
            f"{len(rows)} of {len(off)} stars do not fit the others ({named(rows)}; up to "
            f"{off.max():.3g} standard deviations{of} off): wrong matches? a robust fit or "
            "registration-mixture tolerates them"
        )
        found.append(Finding("mismatched", text, rows))
    return found


def _none_far(fit: RegistrationFit, settings: dict[str, Any]) -> bool:
    """Whether of very many stars none is far by the median of all: a robust fit would keep them."""
    keys = ("weights", "source_covariance", "target_covariance")
    if len(fit.residuals) < _COMPARED or any(settings.get(key) is not None for key in keys):
        return False
    lengths = np.hypot(*fit.residuals.T)
    limit = np.sqrt(2 * np.log(len(lengths) / _ALARM))
    return bool(lengths.max() < limit * np.median(lengths) / _MEDIAN_LENGTH)


def _robustly(
    source: FloatArray, target: FloatArray, pivot: ArrayLike, **settings: Any
) -> RegistrationFit | None:
    """Return the robust fit, or None where the stars are too few or too close for one."""
    try:
        return fit_registration(source, target, pivot, **settings | {"robust": True})
    except validate.MirroredPointsError:
        raise
    except (validate.DegenerateGeometryError, np.linalg.LinAlgError):
        return None


def _wrong_matches(
    source: FloatArray, target: FloatArray, pivot: ArrayLike, **settings: Any
) -> FloatArray:
    """Return how many standard deviations of the others each suspect is off, else zero, (n,)."""
    fit = _robustly(source, target, pivot, **settings)
    off = np.zeros(len(source))
    # Of three stars that fit the scatter says next to nothing.
    if fit is None or fit.degrees_of_freedom < _LEAST:
        return off
    out = _left_out(fit, settings)
    # What the others leave of themselves, known errors or not.
    kept = fit.residuals[fit.weights > 0]
    noise = np.sqrt(np.square(kept).sum() / max(float(fit.degrees_of_freedom), 1.0))
    off[out] = np.hypot(*fit.residuals[out].T) / max(noise, np.finfo(float).tiny)
    return off


def _left_out(fit: RegistrationFit, settings: dict[str, Any]) -> NDArray[np.bool_]:
    """Return which stars a robust fit left out by itself, (n,)."""
    given = settings.get("weights")
    return np.asarray((fit.weights == 0) & (np.asarray(1.0 if given is None else given) > 0))


def _better_model(
    source: FloatArray, target: FloatArray, pivot: ArrayLike, **settings: Any
) -> tuple[str, str] | None:
    """Return a model that fits better than chance allows, and the sentence that says so.

    Both are fitted to those stars that the richer one keeps.
    """
    source, target, settings = _thinned(source, target, settings)
    candidates = []
    for model in _RICHER[settings.get("model", "similarity")]:
        rich = _robustly(source, target, pivot, **settings | {"model": model})
        if rich is None or rich.degrees_of_freedom <= 0:
            continue
        plain = fit_registration(
            source, target, pivot, **settings | {"robust": False, "weights": rich.weights}
        )
        if _chance(plain, rich) < _BETTER:
            # Of several the one that gains most for its parameters (Schwarz, 1978).
            count = 2 * np.count_nonzero(rich.weights)
            cost = count * np.log(rich.chi_square) + len(MODELS[model]) * np.log(count)
            candidates.append((float(cost), model, plain, rich))
    if not candidates:
        return None
    _, model, plain, rich = min(candidates, key=lambda one: one[0])
    kept = rich.weights > 0
    before, after = (np.sqrt(np.square(fit.residuals[kept]).mean()) for fit in (plain, rich))
    called = _CALLED.get(model, model)
    cause = "do they turn or change scale" if model in ("rigid", "similarity") else "distortion"
    return model, (
        f"{called} fits the stars better than {_CALLED.get(plain.model, plain.model)} (rms "
        f'{before:.3g} → {after:.3g} px): {cause}? take model="{model}"'
    )


def _thinned(
    source: FloatArray, target: FloatArray, settings: dict[str, Any]
) -> tuple[FloatArray, FloatArray, dict[str, Any]]:
    """Return so many stars at most, spread evenly over the rows, and what is said of each."""
    some = thinned(len(source), _COMPARED)
    axes = {"weights": 1, "source_covariance": 3, "target_covariance": 3}
    own = {k: np.asarray(v)[some] for k, v in settings.items() if axes.get(k) == np.ndim(v)}
    return source[some], target[some], settings | own


def _chance(plain: RegistrationFit, rich: RegistrationFit) -> float:
    """How often a needless model gains as much, by the F law."""
    more = len(rich.names) - len(plain.names)
    freedom = float(rich.degrees_of_freedom)
    gain = float(plain.chi_square - rich.chi_square) / more
    ratio = gain / max(float(rich.chi_square) / freedom, np.finfo(float).tiny)
    if ratio < 2:  # no freedom makes so little rare, and SciPy need not be loaded
        return 1.0
    from scipy.special import fdtrc

    return float(fdtrc(more, freedom, ratio))


def _units(source: FloatArray, target: FloatArray, fit: RegistrationFit) -> list[Finding]:
    """Ask after the unit of stars that are small, far from their pivot, or unlike each other."""
    pivot, low, high = fit.transform.pivot, source.min(axis=0), source.max(axis=0)
    span, outside = float((high - low).max()), float(np.maximum(low - pivot, pivot - high).max())
    far = f", and the pivot lies {outside:.4g} outside them" if outside > span else ""
    found = []
    if far or span < _SMALL:
        found.append(f"the stars span {span:.4g}{far} (are these pixels?)")
    some = thinned(len(source), _COMPARED)
    pair = (source[some], target[some])
    middle = [np.median(np.hypot(*(one - np.median(one, axis=0)).T)) for one in pair]
    if min(middle) > 0 and max(middle) > _APART * min(middle):
        found.append(
            f"one image spans {max(middle) / min(middle):.3g} times the other (are both in pixels?)"
        )
    return [Finding("unit", text) for text in found]


def _repeated(source: FloatArray, target: FloatArray, named: _Named) -> list[Finding]:
    """Name rows that repeat an earlier one, or that share a star of one image with it."""
    alike = {"source": _again(source), "target": _again(target)}
    # Who repeats a row repeats both of its stars.
    doubtful = min(map(len, alike.values())) > 0
    repeats = _again(np.hstack([source, target])) if doubtful else np.empty(0, dtype=np.intp)
    told = [("repeated", repeats, "repeat an earlier one")]
    for name, again in alike.items():
        text = f"share the star of the {name} with an earlier one"
        told.append(("shared", np.setdiff1d(again, repeats), text))
    found = []
    for kind, again, text in told:
        if len(again):
            rows = tuple(again.tolist())
            count = f"{len(rows)} of {len(source)} stars {text} ({named(rows)})"
            found.append(Finding(kind, f"{count}: each counts as a star of its own", rows))
    return found


def _again(stars: FloatArray) -> NDArray[np.intp]:
    """Return the rows, in order, that repeat an earlier one."""
    sums = np.sort(stars[:, 0] + np.pi * stars[:, -1])  # rows that are equal have equal sums
    if (sums[1:] > sums[:-1]).all():
        return np.empty(0, dtype=np.intp)
    order = np.lexsort(stars.T)  # keeps the order of equal rows
    same = (stars[order[1:]] == stars[order[:-1]]).all(axis=1)
    return np.sort(order[1:][same])


def _line(source: FloatArray) -> list[Finding]:
    """Say that stars lie in a line, which a mirror image fits as well."""
    if len(source) < 3:
        return []
    some = source[thinned(len(source), _COMPARED)]
    length, width = np.linalg.svd(some - some.mean(axis=0), compute_uv=False)
    if width > _THIN * length:
        return []
    return [Finding("line", "the stars lie in a line: their mirror image would fit as well")]


def _size(fit: RegistrationFit, exact: bool) -> list[Finding]:
    """Say what the scatter cannot tell."""
    if fit.degrees_of_freedom <= 0:
        return [Finding("spare", "no star is to spare, so the size of the errors is unknown")]
    if exact:
        return [Finding("exact", "the stars fit without any error, so their errors are unknown")]
    return []


def _errors(fit: RegistrationFit) -> list[Finding]:
    """Say that the scatter is not that of the errors given."""
    freedom = float(fit.degrees_of_freedom)
    ratio = float(fit.chi_square) / max(freedom, 1.0)
    # Beyond four standard deviations of chi-square over its freedom; then by its law.
    if freedom <= 0 or abs(ratio - 1) < 2 * np.sqrt(2 / freedom):
        return []
    from scipy.special import chdtr, chdtrc

    if min(chdtr(freedom, fit.chi_square), chdtrc(freedom, fit.chi_square)) > _BETTER:
        return []
    text = f"the stars scatter {np.sqrt(ratio):.3g} times as much as their given errors"
    return [Finding("errors", f"{text}; the deviations follow these")]


def _dropped(fit: RegistrationFit, settings: dict[str, Any], named: _Named) -> list[Finding]:
    """Name the stars that a robust fit left out."""
    if not settings["robust"]:
        return []
    rows = tuple(np.flatnonzero(_left_out(fit, settings)).tolist())
    found: list[Finding] = []
    if rows:
        text = f"{len(rows)} of {len(fit.weights)} stars have zero weight ({named(rows)})"
        found.append(Finding("dropped", text, rows))
    if len(fit.weights) < _FEW:
        text = f"of {len(fit.weights)} stars a robust fit can tell one to be wrong, not two"
        found.append(Finding("few", text))
    return found


def rounded(stars: FloatArray) -> str:
    """Say how many stars rounding has moved alike; nothing where it does not matter.

    Parameters
    ----------
    stars : ndarray, shape (n, 4)
        Their places in the source and in the target, in px.

    Returns
    -------
    str

    Examples
    --------
    >>> field = np.arange(40.0).reshape(20, 2) ** 1.5 // 1
    >>> rounded(np.hstack([field, field + 3]))
    '20 of 20 stars moved alike to the last digit, 1 px'
    """
    first, second, _ = _thinned(stars[:, :2], stars[:, -2:], {})
    decimals = None if len(stars) < _ALIKE else _decimals(np.hstack([first, second]))
    if decimals is None:
        return ""
    digit = 10.0**-decimals
    scale, theta = robust_similarity(first, second, first.mean(axis=0)).parameters[:2]
    apart = max(abs(scale - 1), abs(theta)) * float(np.ptp(first, axis=0).max())
    moved = ((second - first) / digit).round()
    alike = int(np.unique(moved, axis=0, return_counts=True)[1].max())
    if apart > _STILL * digit or alike <= max(2, _TIED * len(first)):
        return ""
    return f"{alike} of {len(first)} stars moved alike to the last digit, {digit:g} px"


def _decimals(stars: FloatArray) -> int | None:
    """How many decimals write all coordinates; None where they have more than are looked at."""
    for decimals in range(_DECIMALS):
        with np.errstate(over="ignore"):
            scaled = stars * 10.0**decimals
        if np.allclose(scaled, scaled.round(), rtol=0, atol=1e-6):
            return decimals
    return None


def robust_similarity(source: FloatArray, target: FloatArray, pivot: FloatArray) -> RegistrationFit:
    """Fit the similarity of the stars that fit; of all where they are too few or half coincide.

    Parameters
    ----------
    source, target, pivot
        As in `fit_registration`.

    Returns
    -------
    RegistrationFit

    Examples
    --------
    >>> square = np.array([[0.0, 0], [90, 0], [0, 90], [90, 90]])
    >>> float(robust_similarity(square, 2 * square, np.zeros(2)).transform.scale.round(9))
    2.0
    """
    return _robustly(source, target, pivot) or fit_registration(source, target, pivot)
