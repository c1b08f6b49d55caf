"""Mirrored points are named, whatever the model; good points never are, however few and noisy."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from simulated import PIVOT, stars

from reproduce.physics.registration import Registration, fit_registration
from reproduce.physics.validate import MirroredPointsError

FLIPS = [[-1.0, 1.0], [1.0, -1.0]]


@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize(
    ("n", "noise"), [(3, 0.0), (3, 0.02), (4, 0.5), (10, 20.0), (81, 60.0)]
)
@pytest.mark.parametrize("model", ["shift", "rigid", "similarity", "similarity+radial"])
def test_a_mirror_image_is_named(model, n, noise, flip):
    turn = 0.0 if model == "shift" else 2.0
    truth = Registration.similarity(1.002, turn, (-3, 2), PIVOT)
    source, target = stars(n, noise, seed=n, truth=truth)
    with pytest.raises(MirroredPointsError, match="flip one axis"):
        fit_registration(source * flip, target, PIVOT, model=model)
    known = {"target_covariance": np.eye(2)}
    with pytest.raises(MirroredPointsError, match="flip one axis"):
        fit_registration(source * flip, target, PIVOT, np.ones(n), model, **known)


def test_a_batch_says_how_many_are_mirrored():
    source, target = stars(10)
    sources = np.stack([source, source * FLIPS[0], source * FLIPS[1]])
    with pytest.raises(MirroredPointsError, match="in 2 of 3 sets"):
        fit_registration(sources, target, PIVOT)


@pytest.mark.parametrize("wrong", [0, 20, 32])
def test_wrong_matches_do_not_hide_a_mirror_image(wrong):
    source, target = stars(81, 0.3, wrong=wrong)
    assert fit_registration(source, target, PIVOT, robust=True).residuals.shape == (
        81,
        2,
    )
    with pytest.raises(MirroredPointsError, match="flip one axis"):
        fit_registration(source * FLIPS[0], target, PIVOT, robust=True)


def test_the_affine_model_may_mirror():
    source, target = stars(20, wrong=5, batch=(50,))
    mirrored, models = source * FLIPS[0], {"model": "affine"}
    robust = fit_registration(mirrored, target, PIVOT, robust=True, **models)
    assert (robust.rejected == (np.arange(20) < 5)).all()
    fit = fit_registration(mirrored, target, PIVOT, robust.weights, **models)
    assert_allclose(fit.parameters, robust.parameters)
    assert (np.linalg.det(fit.transform.matrix) < 0).all()


@pytest.mark.parametrize("n", [2, 3, 4, 6, 20])
@pytest.mark.parametrize("noise", [0.1, 300.0, 3000.0])
@pytest.mark.parametrize("flat", [1.0, 1e-4])
def test_points_that_are_not_mirrored_pass_whatever_their_noise(n, noise, flat):
    """Even without any pattern left, and along a line, which is its own mirror image."""
    generator = default_rng(n)
    source = generator.uniform(0, 1000, (3000, n, 2)) * [1.0, flat]
    target = source + noise * generator.standard_normal(source.shape)
    assert fit_registration(source, target, PIVOT).parameters.shape == (3000, 4)
