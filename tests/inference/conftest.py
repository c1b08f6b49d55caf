"""Small data of known truth for the models."""

import numpy as np
import pytest

from reproduce.inference.models import registration_model
from reproduce.physics.attitude import Platform
from reproduce.physics.registration import Registration

PIVOT = np.array([1030.0, 770.0])
TRUTH = Registration.similarity(1.002, -0.001, (-0.4, -0.6), PIVOT)
NOISE = 0.07


def stars(count=137, seed=1, noise=NOISE):
    """Return source and target points of a registration whose truth is `TRUTH`."""
    generator = np.random.default_rng(seed)
    source = generator.uniform((0, 0), (2064, 1544), (count, 2))
    return source, TRUTH.apply(source) + noise * generator.normal(size=source.shape)


@pytest.fixture(scope="session")
def registration():
    return registration_model(*stars(), PIVOT)


@pytest.fixture(scope="session")
def platform():
    spots = np.array([[544.8, 435.8], [520.7, 459.8], [569.0, 459.9], [544.6, 483.9]])
    corners = np.array([[0, -1], [-1, 0], [1, 0], [0, 1]])
    return Platform(corners * 0.011, 2.0, 0.06, 13e-6, np.array([511.5, 511.5]), spots)
