"""Stars of a known transform in two images."""

import numpy as np
import pandas as pd

from reproduce.physics.registration import Registration
from reproduce.store.points import STARS

FIELD = np.array([2064.0, 1544.0])
PIVOT = FIELD / 2
TRUTH = Registration.similarity(1.0006, 0.002, (3, 1), PIVOT)
SHIFT = Registration("shift", np.array([3.0, 0.0]), PIVOT)


def stars(count=60, noise=0.1, seed=1, truth=TRUTH, wrong=0, batch=()):
    """Return source and target points; the first `wrong` targets are those of no star.

    The other points do not depend on `wrong`.
    """
    generator = np.random.default_rng(seed)
    source = generator.uniform((0, 0), FIELD, (*batch, count, 2))
    target = truth.apply(source) + noise * generator.standard_normal(source.shape)
    target[..., :wrong, :] = generator.uniform((0, 0), FIELD, (*batch, wrong, 2))
    return source, target


def star_table(count=60, **settings):
    """Return the points of `stars` as a table."""
    return pd.DataFrame(np.hstack(stars(count, **settings)), columns=list(STARS))
