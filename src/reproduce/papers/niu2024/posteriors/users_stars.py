"""A user's stars: files of the registrations.

One star per line, in px: its place in the channel (``x``, ``y``) and in the reference channel
(``x_reference``, ``y_reference``); for both channels at once ``x_red`` to ``y_green``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.inference.model import Model
from reproduce.inference.models.joint import CHANNELS, joint_model
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
from reproduce.physics.registration.diagnosis import checked_pivot, diagnose, rounded
from reproduce.physics.validate import FloatArray
from reproduce.store.points import STARS, Table, TableFileError

__all__ = ["JOINT"]

JOINT_COLUMNS = ("x_red", "y_red", "x_blue", "y_blue", "x_green", "y_green")
# Of the field: how far a distortion may move a star beforehand, or so many times the residuals, but
# never so far that it cannot be undone.
SHARE, RESIDUALS, MOST = 1e-3, 10.0, 0.03
# Fewer stars do not tell a wrong match from noise.
FEW = 10


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
    try:
        return [checked_pivot(pivot, points) for points in channels]
    except ValueError as error:
        raise TableFileError(str(error)) from error


def _free(
    table: Table, source: FloatArray, target: FloatArray, pivot: FloatArray
) -> dict[str, Prior]:
    try:
        return free_priors(source, target, pivot)
    except ValueError as error:
        raise TableFileError(f"{table.path}: {error}") from error


def remarks(table: Table, pivot: Pivot, model: str = "similarity") -> list[str]:
    """What a user should hear of the stars, in the words of `reproduce.register`."""
    found: dict[str, None] = {}
    for i, centre in enumerate(pivots(table, pivot)):
        source = table.values[:, 2 * i : 2 * i + 2]
        stars = (source, table.values[:, -2:], centre, table.named)
        try:
            found |= dict.fromkeys(one.text for one in diagnose(*stars, model=model))
        except ValueError as error:
            raise TableFileError(f"{table.path}: {error}") from error
    return list(found)


def unnamed(table: Table, pivot: Pivot) -> list[str]:
    """The same but for mismatches, which the mixture names itself."""
    return [text for text in remarks(table, pivot) if "do not fit the others" not in text]


def _share(table: Table) -> float:
    return SHARE * float(np.ptp(table.values[:, :2], axis=0).max())


PLACES = "one star per line, in px: its place in the channel and in the reference channel"
PLAIN, DISTORTION = (File(STARS, PLACES, read, remarks, pivot=True) for read in (plain, distortion))
MIXTURE = File(STARS, PLACES, mixture, unnamed, pivot=True)
JOINT = File(
    JOINT_COLUMNS, "one star per line, in px: its places in the three channels", joint, remarks,
    pivot=True,
)  # fmt: skip
