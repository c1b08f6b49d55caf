"""Small data of known truth for the models."""

import pytest
from bench import LASERS, SPOTS
from simulated import registered, stars

from reproduce.physics.attitude import Platform


@pytest.fixture(scope="session")
def registration():
    return registered(*stars(137, 0.07))


@pytest.fixture(scope="session")
def platform():
    return Platform(LASERS, 2.0, 0.06, 13e-6, (511.5, 511.5), SPOTS)
