"""Small data of known truth for the models."""

import numpy as np
import pytest
from simulated import registered, stars

from reproduce.physics.attitude import Platform


@pytest.fixture(scope="session")
def registration():
    return registered(*stars(137, 0.07))


@pytest.fixture(scope="session")
def platform():
    spots = np.array([[544.8, 435.8], [520.7, 459.8], [569.0, 459.9], [544.6, 483.9]])
    corners = np.array([[0, -1], [-1, 0], [1, 0], [0, 1]])
    return Platform(corners * 0.011, 2.0, 0.06, 13e-6, np.array([511.5, 511.5]), spots)
