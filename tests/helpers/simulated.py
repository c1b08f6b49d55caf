"""Stars of a known transform in two images, and spots of a known rotation in two groups."""

import numpy as np
import pandas as pd
from numpy.random import default_rng

from reproduce.inference.models import GaussianRegistration, registration_model
from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
from reproduce.physics.registration import Registration, prepare
from reproduce.printed.inputs import load_inputs
from reproduce.store.points import STARS
from reproduce.store.spots import SPOTS
from reproduce.units import ARCSEC_PER_RADIAN

FIELD = np.array([2064.0, 1544.0])
PIVOT = FIELD / 2
TRUTH = Registration.similarity(1.0006, 0.002, (3, 1), PIVOT)
SHIFT = Registration("shift", np.array([3.0, 0.0]), PIVOT)


def stars(count=60, noise=0.1, seed=1, truth=TRUTH, wrong=0, batch=()):
    """Return source and target points; the first `wrong` targets are those of no star.

    The other points do not depend on `wrong`.
    """
    generator = default_rng(seed)
    source = generator.uniform((0, 0), FIELD, (*batch, count, 2))
    target = truth.apply(source) + noise * generator.standard_normal(source.shape)
    target[..., :wrong, :] = generator.uniform((0, 0), FIELD, (*batch, wrong, 2))
    return source, target


def registered(source, target, kind=GaussianRegistration):
    """Return the posterior of the registration of stars about `PIVOT`."""
    return registration_model(kind(prepare(source, target, PIVOT)))


def table_of(*points):
    """Return source and target points as a table."""
    return pd.DataFrame(np.hstack(points), columns=list(STARS))


def star_table(count=60, **settings):
    """Return the points of `stars` as a table."""
    return table_of(*stars(count, **settings))


def spot_frame(*groups):
    """Return groups of images, (frames, lights, 2), as a table without their lost spots."""
    rows = [
        (group, laser, x, y, frame)
        for group, images in enumerate(groups)
        for frame, image in enumerate(images)
        for laser, (x, y) in enumerate(image, start=1)
        if np.isfinite([x, y]).all()
    ]
    return pd.DataFrame(rows, columns=[*SPOTS, "frame"])


def spot_table(noise=0.02, flip=1, drift=(0, 0)):
    """Return two groups of fifty images, without their numbers.

    The camera rotates by (20, -20, 0) arcsec between the groups, and drifts about X inside a group.
    """
    platform = as_designed(load_inputs(INSTRUMENT))
    generator, groups = default_rng(3), []
    for moved, angles in zip(drift, ([0, 0, 0], [20, -20, 0]), strict=True):
        angles = np.outer(np.linspace(-0.5, 0.5, 50), [moved, 0, 0]) + angles
        places = platform.predicted(angles / ARCSEC_PER_RADIAN)
        places = places + noise * generator.normal(size=places.shape)
        groups.append(places * (flip, 1))
    return spot_frame(*groups).drop(columns="frame")
