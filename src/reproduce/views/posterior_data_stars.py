"""A user's stars: files of the registrations.

One star per line, in px: its place in the channel (``x``, ``y``) and in the reference channel
(``x_reference``, ``y_reference``); for both channels at once ``x_red`` to ``y_green``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from reproduce.inference.joint import joint_model
from reproduce.inference.model import Model
from reproduce.inference.priors import Normal
from reproduce.inference.registration import principal_point_model, registration_model
from reproduce.inference.variants import distortion_model, field_noise_model, student_model
from reproduce.store.points import Table

Pivot = tuple[float, float] | None
Reader = Callable[[str, Table, Pivot], Model]

COLUMNS = ("x", "y", "x_reference", "y_reference")
JOINT_COLUMNS = ("x_red", "y_red", "x_blue", "y_blue", "x_green", "y_green")
# Of the field: how far a principal point or a distortion may move a star, beforehand.
SHARE = 1e-3


def plain(name: str, table: Table, pivot: Pivot) -> Model:
    """Registration of one channel."""
    source, target = table.values[:, :2], table.values[:, 2:]
    centre = source.mean(axis=0) if pivot is None else np.array(pivot)
    return registration_model(source, target, centre, name=name)


def student(name: str, table: Table, pivot: Pivot) -> Model:
    """The same with Student-t noise."""
    return student_model(plain(name, table, pivot))


def field_noise(name: str, table: Table, pivot: Pivot) -> Model:
    """The same with noise that varies across the field."""
    return field_noise_model(plain(name, table, pivot))


def distortion(name: str, table: Table, pivot: Pivot) -> Model:
    """The same with both distortions free, up to some thousandths of the field."""
    model = distortion_model(plain(name, table, pivot))
    prior = Normal(0.0, _share(table), "some thousandths of the field at its edge")
    extra = tuple(replace(parameter, prior=prior) for parameter in model.parameters[5:])
    return replace(model, parameters=model.parameters[:5] + extra)


def principal_point(name: str, table: Table, pivot: Pivot) -> Model:
    """The same with the principal point uncertain by a thousandth of the field."""
    return principal_point_model(plain(name, table, pivot), _share(table))


def joint(name: str, table: Table, pivot: Pivot) -> Model:
    """Both channels at once."""
    red, blue, green = (table.values[:, i : i + 2] for i in (0, 2, 4))
    pivots = [points.mean(axis=0) if pivot is None else np.array(pivot) for points in (red, blue)]
    return joint_model((red, blue), green, (pivots[0], pivots[1]))


def _share(table: Table) -> float:
    return SHARE * float(np.ptp(table.values[:, :2], axis=0).max())
