"""A posterior of the made-up paper: stars seen through both lenses, registered to each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.inference.models import GaussianRegistration, registration_model
from reproduce.papers.posteriors import Declaration
from reproduce.physics.registration import prepare

INPUTS = ("lamp2025/table-1#focal-length.*",)


def registration(inputs):
    """Simulate stars behind both lenses and return the model of the transform between them."""
    near, far = inputs.array(INPUTS[0])
    generator = np.random.default_rng(2025)
    stars = generator.uniform(0.0, 1000.0, (30, 2))
    other = far / near * stars + generator.normal(0.0, 0.1, stars.shape)
    problem = prepare(stars, other, np.zeros(2))
    model = registration_model(GaussianRegistration(problem))
    return replace(model, truth={"scale": far / near})


POSTERIORS = (
    Declaration(
        key="lamp-registration",
        title="Transform between both lenses",
        paper="lamp2025",
        inputs=INPUTS,
        build=registration,
        meaning="the stars are made up",
    ),
)
