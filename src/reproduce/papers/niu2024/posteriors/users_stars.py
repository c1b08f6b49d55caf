"""A user's stars: files of the registrations.

One star per line, in px: its place in the channel (``x``, ``y``) and in the reference channel
(``x_reference``, ``y_reference``); for both channels at once ``x_red`` to ``y_green``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from reproduce.inference.model import Model
from reproduce.inference.models.joint import CHANNELS, joint_model
from reproduce.inference.models.least_squares import robust_similarity
from reproduce.inference.models.mixture import mixture_model
from reproduce.inference.models.registration import (
    free_priors,
    registration_model,
    with_priors,
)
from reproduce.inference.models.variants import (
    distortion_model,
)
from reproduce.inference.priors import LogUniform, Normal, Prior, Uniform
from reproduce.papers.declare_posterior import File, Pivot
from reproduce.physics.validate import FloatArray, number_array
from reproduce.store.points import Table, TableFileError

__all__ = [
    "COLUMNS", "JOINT", "dropped", "from_table", "mismatched", "repeated", "unlike_pixels",
]  # fmt: skip

COLUMNS = ("x", "y", "x_reference", "y_reference")
JOINT_COLUMNS = ("x_red", "y_red", "x_blue", "y_blue", "x_green", "y_green")
# Of the field: how far a distortion may move a star beforehand, or so many times the residuals, but
# never so far that it cannot be undone.
SHARE, RESIDUALS, MOST = 1e-3, 10.0, 0.03
# A pivot further away, in fields, takes the digits of the shift.
FURTHEST = 100.0
# Fewer stars do not tell a wrong match from noise.
FEW = 10
# Most decimals that coordinates are looked at for. Rounded stars that the transform moves apart by
# less than `APART` of the last one, more than a `TIED` share of them alike, hide their noise in it.
DECIMALS, APART, TIED = 9, 0.5, 0.1
# Stars that span less, in px, are perhaps in another unit.
SMALL = 50.0


def plain(table: Table, pivot: Pivot) -> Model:
    """Registration of one channel."""
    source, target = table.values[:, :2], table.values[:, 2:]
    centre = pivots(table, pivot)[0]
    priors = _free(table, source, target, centre)
    return registration_model(source, target, centre, priors=priors)


def mixture(table: Table, pivot: Pivot) -> Model:
    """The same with stars that may be matched wrongly."""
    if len(table.values) < FEW:
        raise TableFileError(
            f"{table.path}: expected {FEW} or more stars, got {len(table.values)}; fewer do not "
            "tell a wrong match from noise: take registration, or add some"
        )
    _refuse_rounded(table)
    return _turning(mixture_model(plain(table, pivot)), table)


def _refuse_rounded(table: Table) -> None:
    """Refuse stars whose noise rounding hides: a density that may be as narrow has no bound."""
    if told := rounded(table.values):
        raise TableFileError(
            f"{table.path}: expected coordinates with more digits, got {told}: this model would "
            "take these for free of noise; take registration, or add digits"
        )


def _turning(model: Model, table: Table) -> Model:
    """Any rotation, about that of the stars that agree: wrong matches may turn least squares."""
    try:
        theta = float(model.likelihood.start()[0][1])
    except ValueError as error:  # stars in one place
        raise TableFileError(f"{table.path}: {error}") from error
    turn = Uniform(theta - np.pi, theta + np.pi, "any: the full turn, cut opposite to the fit of "
                   "those stars that agree")  # fmt: skip
    return replace(model, parameters=with_priors(model.parameters, {"rotation": turn}))


def distortion(table: Table, pivot: Pivot) -> Model:
    """The same with both distortions free, up to some thousandths of the field."""
    base = plain(table, pivot)
    residual = base.likelihood.start()[0][4]
    reach = min(max(_share(table), RESIDUALS * residual), MOST * _share(table) / SHARE)
    prior = Normal(0.0, float(reach), "some thousandths of the field at its edge, or ten times the "
                   "residuals where these are larger")  # fmt: skip
    model = distortion_model(base)
    extra = tuple(replace(parameter, prior=prior) for parameter in model.parameters[5:])
    return replace(model, parameters=model.parameters[:5] + extra)


def joint(table: Table, pivot: Pivot) -> Model:
    """Both channels at once."""
    red, blue, green = (table.values[:, i : i + 2] for i in (0, 2, 4))
    centres = pivots(table, pivot)
    priors: dict[str, Prior] = {}
    for channel, source, centre in zip(CHANNELS, (red, blue), centres, strict=True):
        own = _free(table, source, green, centre)
        # Both channels share one noise, and its prior is that of the channel with more of it.
        widest = max((own.pop("noise"), priors.get("noise")), key=_high)
        priors |= {f"{channel}-{key}": prior for key, prior in own.items()}
        if widest is not None:
            priors["noise"] = widest
    model = joint_model((red, blue), green, (centres[0], centres[1]))
    return replace(model, parameters=with_priors(model.parameters, priors))


def _high(prior: Prior | None) -> float:
    return prior.high if isinstance(prior, LogUniform) else 0.0


def pivots(table: Table, pivot: Pivot | FloatArray) -> list[FloatArray]:
    """The principal point of each channel: as given, or the mean of its stars."""
    channels = [table.values[:, i : i + 2] for i in range(0, len(table.columns) - 2, 2)]
    if pivot is None:
        return [points.mean(axis=0) for points in channels]
    for points in channels:
        away = float(np.abs(points.mean(axis=0) - pivot).max())
        field = float(np.ptp(points, axis=0).max())
        # Of stars in one place their number is to be told, or that they coincide.
        if field and not away <= FURTHEST * field:
            raise TableFileError(
                f"pivot: expected a point within {FURTHEST:g} fields of the stars, got "
                f"{pivot[0]:g}, {pivot[1]:g}; give the channel's principal point, in px"
            )
    return [np.array(pivot)] * len(channels)


def _free(
    table: Table, source: FloatArray, target: FloatArray, pivot: FloatArray
) -> dict[str, Prior]:
    try:
        return free_priors(source, target, pivot)
    except ValueError as error:
        raise TableFileError(f"{table.path}: {error}") from error


def remarks(table: Table, pivot: Pivot) -> list[str]:
    """What a user should hear of the stars: another unit, repeated lines, likely mismatches."""
    found = unnamed(table, pivot)
    for i, centre in enumerate(pivots(table, pivot)):
        found += mismatched(table, centre, "registration-mixture names them", i)
    return found


def unnamed(table: Table, pivot: Pivot) -> list[str]:
    """The same but for mismatches, which the mixture names itself."""
    return unlike_pixels(table.values[:, :2], pivots(table, pivot)[0]) + repeated(table)


def from_table(table: Table, pivot: ArrayLike | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stars of a channel and of its reference channel, both (n, 2), and the pivot, in px."""
    about = None if pivot is None else number_array("pivot", pivot, shape=(2,))
    return table.values[:, :2], table.values[:, 2:], pivots(table, about)[0]


def repeated(table: Table) -> list[str]:
    """Name lines that repeat an earlier one."""
    _, first, where = np.unique(table.values, axis=0, return_index=True, return_inverse=True)
    again = [i for i in range(len(table.values)) if first[where.ravel()[i]] != i]
    if not again:
        return []
    return [
        f"{len(again)} of {len(table.values)} {table.kind}s repeat an earlier one "
        f"({table.named(again)}): each counts as a star of its own"
    ]


def mismatched(table: Table, pivot: FloatArray, remedy: str, channel: int = 0) -> list[str]:
    """Name stars of a channel that do not fit the others, and what tolerates them."""
    source, target = table.values[:, 2 * channel : 2 * channel + 2], table.values[:, -2:]
    if len(target) < FEW:
        return []
    if told := rounded(np.hstack([source, target])):
        return [f"{told}: their noise is lost in the rounding"]
    fit = robust_similarity(source, target, pivot)
    if not len(fit.suspects):
        return []
    return [
        f"{len(fit.suspects)} of {len(target)} stars do not fit the others "
        f"({table.named(fit.suspects)}; up to {fit.off[fit.suspects[0]]:.3g} standard "
        f"deviations off): wrong matches? {remedy}"
    ]


def rounded(stars: FloatArray) -> str:
    """Say how many stars, (n, 4), rounding has moved alike; nothing where it does not matter."""
    source, target = stars[:, :2], stars[:, -2:]
    scaled = (stars * 10.0**decimals for decimals in range(DECIMALS))
    whole = (np.allclose(one, one.round(), rtol=0, atol=1e-6) for one in scaled)
    decimals = next((at for at, found in enumerate(whole) if found), None)
    if decimals is None:
        return ""
    digit = 10.0**-decimals
    scale, theta = robust_similarity(source, target, source.mean(axis=0)).fit.parameters[:2]
    apart = max(abs(scale - 1), abs(theta)) * float(np.ptp(source, axis=0).max())
    moved = ((target - source) / digit).round()
    alike = int(np.unique(moved, axis=0, return_counts=True)[1].max())
    if apart > APART * digit or alike <= max(2, TIED * len(stars)):
        return ""
    return f"{alike} of {len(stars)} stars moved alike to the last digit, {digit:g} px"


def dropped(table: Table, weights: FloatArray) -> list[str]:
    """Name stars to which a robust fit gave no weight."""
    rows = np.flatnonzero(weights == 0).tolist()
    if not rows:
        return []
    return [f"{len(rows)} of {len(weights)} stars count for nothing ({table.named(rows)})"]


def unlike_pixels(points: FloatArray, pivot: FloatArray) -> list[str]:
    """Ask after the unit of stars, shape (n, 2), that are small or far from their pivot."""
    low, high = points.min(axis=0), points.max(axis=0)
    field = float((high - low).max())
    outside = float(np.maximum(low - pivot, pivot - high).max())
    far = f", and the pivot lies {outside:.4g} outside them" if outside > field else ""
    if far or field < SMALL:
        return [f"the stars span {field:.4g}{far} (are these pixels?)"]
    return []


def _share(table: Table) -> float:
    return SHARE * float(np.ptp(table.values[:, :2], axis=0).max())


PLACES = "one star per line, in px: its place in the channel and in the reference channel"
PLAIN, DISTORTION = (
    File(COLUMNS, PLACES, read, remarks, pivot=True) for read in (plain, distortion)
)
MIXTURE = File(COLUMNS, PLACES, mixture, unnamed, pivot=True)
JOINT = File(
    JOINT_COLUMNS, "one star per line, in px: its places in the three channels", joint, remarks,
    pivot=True,
)  # fmt: skip
