"""The study of the angular resolution: Monte Carlo against closed form, and what was fitted."""

import numpy as np
import pytest
from bench import ARCSEC

from reproduce.papers.chen2023 import resolution
from reproduce.physics.images import (
    Detector,
    centre_of_gravity,
    expose,
    spot_windows,
)
from reproduce.printed.inputs import load_inputs

INPUTS = load_inputs(resolution.INPUTS)
WIDTHS = resolution._WIDTHS
PHASES = np.linspace(-0.49, 0.49, 50)


@pytest.fixture(scope="module")
def content():
    return resolution.terms(INPUTS)


def test_the_monte_carlo_is_what_the_closed_form_predicts(content):
    """Over 71 resolutions, with the error of the variance of biased phases taken into account."""
    positions = np.stack([PHASES, 0 * PHASES], axis=-1)
    setting = resolution._setting(INPUTS)._replace(positions=positions)
    bias, variance = resolution._predicted(setting)
    square = (bias**2 + variance).mean(axis=-1)
    spread = 2 * variance**2 + 4 * bias**2 * variance
    error = np.sqrt(spread.mean(axis=-1) / (50 * 500))
    surprise = (content["Monte Carlo"] ** 2 - square) / error
    assert np.abs(surprise).max() < 4
    assert 0.6 < (surprise**2).mean() < 1.5


def test_a_range_that_would_fill_the_memory_is_refused():
    high = "chen2023/text-resolution#resolution-high"
    with pytest.raises(ValueError, match=f"{high}: expected 1 to 1,000"):
        resolution.optimum(INPUTS.changed({high: 80_000 * ARCSEC}))


def test_saturation_is_the_coarsest_resolution_that_none_finer_beats():
    assert resolution._saturation(np.array([1.0, 1.0, 1.0, 1.2, 1.3]), 0.03) == 2
    assert resolution._saturation(np.array([3.0, 1.0, 1.02, 1.3]), 0.03) == 2
    assert resolution._saturation(np.array([3.0, 2.0, 1.0]), 0.03) == 2


def test_the_optimum_stands_between_window_and_pixel(content):
    """Left of it the window cuts, right of it the pixel rounds: the bias falls, then rises."""
    best = int(content["total"].argmin())
    bias = content["bias"]
    assert bias[0] > 5 * bias[best] < bias[-1]
    assert (np.diff(content["noise"]) < 0).all(), "the scatter has no optimum inside"


def test_replicated_studies_scatter_as_their_size_says():
    found = resolution._replicated_scatter(
        INPUTS, np.random.SeedSequence(3), 400, (1.0,)
    )
    relative = found.std(axis=0) / found.mean(axis=0)
    middle = resolution._resolutions(INPUTS) / ARCSEC
    unbiased = (middle > 40) & (middle < 50)
    assert relative[unbiased].mean() == pytest.approx(
        resolution._relative_error(INPUTS), rel=0.1
    )


def best(*case, **changes):
    """The optimum in arc seconds and the error there in px, by the closed form."""
    setting = resolution._setting(INPUTS, *case, **changes)
    error = resolution._total(*resolution._predicted(setting))
    return resolution._resolutions(INPUTS)[error.argmin()] / ARCSEC, error.min()


def test_what_the_radius_means_moves_the_optimum_past_the_printed_one():
    """The optimum and its error, by every definition of a Gaussian's radius and photon noise."""
    assert [best(width)[0] for width in WIDTHS.values()] == pytest.approx(
        [57, 42, 49, 31]
    )
    optimum, error = best(WIDTHS["half"], 0.9, 1.1)
    assert (optimum, error) == (pytest.approx(43), pytest.approx(0.016, abs=0.0005)), (
        "as printed"
    )


def test_read_noise_and_light_move_the_optimum_to_finer_pixels():
    changes = (
        {"read_fraction": 0.5},
        {"read_fraction": 0.95},
        {"flux_factor": 2.0},
        {"width": 1.2},
    )
    assert all(best(**one)[0] < best()[0] for one in changes)


def test_the_flux_gives_the_variance_of_table_3():
    """By simulation at the printed spots: whole windows, no closed form."""
    spots = INPUTS.array("chen2023/text-platform#spot-*").reshape(-1, 2)
    corners = np.round(spots).astype(int) - 2
    printed = np.mean((INPUTS.array("chen2023/table-3") / 3) ** 2)
    for fraction in (0.0, 0.5):
        setting = resolution._setting(INPUTS, read_fraction=fraction)
        mean = spot_windows(spots, setting.light, 7.5 / 13, corners, 5)
        frames = np.broadcast_to(mean, (20_000, *mean.shape))
        sensor = Detector(read_noise=setting.read_noise)
        seen = expose(frames, sensor, np.random.default_rng(4))
        variance = centre_of_gravity(seen, corners).var(axis=0).mean()
        assert variance == pytest.approx(printed, rel=0.02)
        assert (setting.read_noise > 0) == (fraction > 0)


def test_each_width_is_the_distance_at_which_the_flux_has_its_level():
    pixel = 13e-6 / 60e-3
    levels = (np.exp(-0.5), np.exp(-1), 0.5, np.exp(-2))
    for width, level in zip(WIDTHS.values(), levels, strict=True):
        radii = resolution._setting(INPUTS, width).radii
        sigma = radii[0, 0] * resolution._resolutions(INPUTS)[0] / pixel
        assert np.exp(-0.5 * (7.5 / (13 * sigma)) ** 2) == pytest.approx(level)
