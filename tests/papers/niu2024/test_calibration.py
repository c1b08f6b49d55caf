"""Tests of the bounds, the bias and the convergence of the calibration."""

from dataclasses import replace

import numpy as np

from reproduce.papers.niu2024 import simulation
from reproduce.physics.optics import channel_centroids
from reproduce.physics.registration import (
    calibrate,
    fit_registration,
    random_starts,
    registration_bound,
    similarity_between,
    starting_values,
)
from reproduce.printed.inputs import load_inputs

INPUTS = load_inputs(simulation.INPUTS)


def twin(place, cameras=None):
    """Return centroids in green and in a channel, its principal point, and the true transform."""
    printed, rotations = simulation.instrument(INPUTS)
    cameras = cameras or printed
    true = channel_centroids(cameras, rotations, simulation.arrangement(INPUTS))
    truth = similarity_between(cameras[place], rotations[place], cameras[0])
    return true[0], true[place], cameras[place].principal_point, truth


def test_the_scheme_reaches_the_cramer_rao_bound():
    """Within what the replicates can tell, for both channels and all parameters."""
    count = 4000
    bench = simulation._Bench(INPUTS, "square", "every-channel", "one", "table-1")
    found = bench.calibrated(np.random.default_rng(8), count)
    for place in (1, 2):
        _, true, _, truth = twin(place)
        bound = registration_bound(true, truth, 0.05, 0.05).diagonal()
        variance = found.parameters[:, place - 1].var(axis=0)
        np.testing.assert_allclose(variance / bound, 1, atol=5 * np.sqrt(2 / count))


def test_only_unequal_distortions_bias_the_fit():
    """With distortion only the scale is biased, by more than its scatter; without, nothing."""

    def bias(place, cameras=None):
        green, true, pivot, truth = twin(place, cameras)
        fit = fit_registration(true, green, pivot)
        return np.abs(fit.parameters - truth.parameters)

    straight = [
        replace(one, radial_distortion=0.0)
        for one in simulation.instrument(INPUTS).cameras
    ]
    for place in (1, 2):
        _, true, _, truth = twin(place)
        scatter = np.sqrt(registration_bound(true, truth, 0.05, 0.05)[0, 0])
        assert bias(place)[0] > 2 * scatter
        assert bias(place)[1:].max() < 1e-9
        assert bias(place, straight).max() < 1e-9


def test_all_starts_end_at_one_point():
    """Far starts, too: within a step or two once all four are free."""
    green, true, _, _ = twin(1)
    noise = 0.05 * np.random.default_rng(1).standard_normal((2, *true.shape))
    green, red = np.array([green, true]) + noise
    table = simulation.arrangement(INPUTS)
    still, [zero] = np.isclose(table[:, 1], 0.0), simulation.zero_positions(table)
    start = starting_values(red[still], green[still], red[zero], green[zero])
    widths = (0.1, np.radians(5.0), 50.0, 50.0)
    starts = random_starts(start, widths, 20, np.random.default_rng(2))
    own, restarted = (calibrate(red, green, red[zero], one) for one in (start, starts))
    ends = np.broadcast_to(own.parameters, restarted.parameters.shape)
    np.testing.assert_allclose(restarted.parameters, ends, atol=1e-9)
    assert np.abs(starts - ends)[:, 2:].max() > 10
    assert len(restarted.history) - restarted.first_stage <= 4
